"""The end map and its zeros: derivatives, folds between samples, gaps and what is said of them."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.search.end_map import EndMap, mappable
from varcalc.search.scan import scan


def end_map(lagrangian, start, end):
    return EndMap(forms(vc.Problem(lagrangian, start, end))[0])


def spring(x, y, dy):
    return (dy**2 - y**2) / 2


def test_the_derivative_of_the_map_is_the_jacobi_field():
    on_pendulum = end_map(lambda t, q, v: v**2 / 2 + ca.cos(q), vc.Fixed(0, 0), vc.Fixed(3, 0.5))
    for u in (-1.0, 0.2, 2.0):
        ahead, behind = on_pendulum.shoot(u + 1e-5), on_pendulum.shoot(u - 1e-5)
        assert on_pendulum.shoot(u).slope == pytest.approx((ahead.miss - behind.miss) / 2e-5, rel=1e-6)


def test_the_map_of_a_spring_is_its_sine():
    on_spring = end_map(spring, vc.Fixed(0, 0), vc.Fixed(2, 1))
    v = 0.7
    miss = on_spring.unit * v * math.sin(2) - 1
    assert on_spring.shoot(math.asinh(v)).miss == pytest.approx(math.asinh(miss / on_spring.ordinate), abs=1e-13)


def test_a_free_start_is_scanned_from_the_fixed_end():
    backwards = end_map(spring, vc.Free(0), vc.Fixed(1, 1))
    [u] = scan(backwards).zeros
    # y = cos x / cos 1
    assert backwards.unit * math.sinh(u) == pytest.approx(-math.tan(1.0), abs=1e-12)
    assert backwards.curve(u)(np.array([0.0])) == pytest.approx(np.array([[1 / math.cos(1.0)]]), abs=1e-9)


def test_two_zeros_closer_than_the_samples_are_found():
    # y'' = -k e^y between zeros: t = sqrt(2 k) cosh(t / 4) and y'(0) = t tanh(t / 4), a double zero at the greatest k
    with mp.workdps(40):
        fold = mp.findroot(lambda u: u * mp.tanh(u) - 1, 1.2)
        strength = float(8 * (fold / mp.cosh(fold)) ** 2 * (1 - mp.mpf("1e-10")))
        sides = (3.9 * fold, 4 * fold), (4 * fold, 4.1 * fold)
        roots = [mp.findroot(lambda t: t - mp.sqrt(2 * strength) * mp.cosh(t / 4), side, "anderson") for side in sides]
        exact = [float(t * mp.tanh(t / 4)) for t in roots]
    assert 0 < exact[1] - exact[0] < 2e-4
    near = end_map(lambda x, y, dy: dy**2 / 2 - strength * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0))
    slopes = [near.unit * math.sinh(u) for u in scan(near).zeros]
    assert slopes == pytest.approx(exact, abs=1e-8)


def test_what_does_not_arrive_is_told():
    blow_up = end_map(lambda x, y, dy: dy**2 / 2 + y**4 / 4, vc.Fixed(0, 0), vc.Fixed(1, 1))
    found = scan(blow_up)
    assert len(found.zeros) == 1
    assert "trajectories do not arrive (the solution leaves every bound" in found.searched
    # y'' = y^3 from 0 with slope v has its pole at sqrt(2)^(1/2) K(1/2) / sqrt(v), here x = 1
    [(_, low, _), (high, _, _)] = found.lost
    assert -low == pytest.approx(high, rel=1e-3)
    assert high == pytest.approx(math.sqrt(2) * 1.8540746773013719**2, rel=1e-3)


def test_only_one_open_number_is_scanned():
    def mapped(*arguments, **more):
        return mappable(forms(vc.Problem(*arguments, **more))[0])

    assert mapped(spring, vc.Fixed(0, 0), vc.Free(1))
    assert not mapped(spring, vc.Free(0), vc.Free(1))
    assert not mapped(lambda x, y, dy: ca.sumsqr(dy), vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1]))
    assert not mapped(lambda x, y, dy, ddy: ddy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), order=2)
    assert not mapped(spring, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Isoperimetric(lambda x, y, dy: y, 1)])


def test_slopes_are_told_in_their_unit():
    fall = vc.Problem(spring, vc.Fixed(0, 0), vc.Fixed(1, 1), names=("t", "h"), units=("s", "m"))
    assert "slope in [-1e+06, 1e+06] m/s that" in scan(EndMap(forms(fall)[0])).searched


def test_no_trajectories_are_asked_for_and_none_come():
    # every interval may be resolved, or beyond the budget, when the next ones are to be halved
    assert EndMap(forms(vc.Problem(lambda x, y, v: v**2 + y**4, vc.Fixed(0, 0), vc.Fixed(1, 1)))[0]).shots([]) == []
