"""Growth, blind parameters and round-off: what is lost is said, and nothing is called a failure that is an answer."""

import re

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc

# eps y'' = y


def layer(eps):
    return vc.Problem(lambda x, y, v: (eps * v**2 + y**2) / 2, vc.Fixed(0, 1), vc.Fixed(1, 0))


def layer_value(eps):
    """sqrt(eps) coth(k)/2 with k = eps^(-1/2)."""
    return float(mp.sqrt(eps) * mp.coth(1 / mp.sqrt(eps)) / 2)


@pytest.mark.parametrize("eps", [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("method", [None, vc.Collocation()], ids=repr)
def test_a_layer_however_thin(eps, method):
    solution = vc.solve(layer(eps), method)
    assert abs(solution.value - layer_value(eps)) <= 10 * solution.error.value <= 1e-9
    x = np.array([0.5, 1.0, 2.0]) * np.sqrt(eps)
    k = float(eps) ** -0.5
    assert solution.y(x) == pytest.approx([float(mp.sinh(k * (1 - t)) / mp.sinh(k)) for t in x], abs=1e-4)


@pytest.mark.parametrize("eps", [1e-2, 1e-4, 1e-6])
def test_multiple_shooting_takes_segments_as_the_growth_demands(eps):
    solution = vc.solve(layer(eps), vc.Shooting())
    assert solution.value == pytest.approx(layer_value(eps), rel=1e-13)


@pytest.mark.parametrize("eps", [1e-3, 1e-4])
def test_simple_shooting_says_how_many_digits_the_growth_costs(eps):
    # the end value grows by sinh(k)
    digits = float(mp.log10(mp.sinh(1 / mp.sqrt(eps))))
    refused = vc.solve(layer(eps), vc.Shooting(segments=1), throw=False)
    assert not refused.status.ok
    told = re.search(r"costs ([\d.]+) of the 16 digits", refused.message)
    assert told is not None
    assert float(told.group(1)) == pytest.approx(digits, abs=0.2)


def test_simple_shooting_answers_while_it_has_digits():
    solution = vc.solve(layer(1e-2), vc.Shooting(segments=1))
    assert abs(solution.value - layer_value(1e-2)) <= 10 * solution.error.value <= 1e-9


@pytest.mark.parametrize("eps", [1e-2, 1e-4, 1e-6])
def test_a_layer_is_a_minimum(eps):
    assert vc.verify(vc.solve(layer(eps))).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("eps", [1e-3, 1e-6])
def test_no_route_says_that_there_is_no_layer(eps):
    refused = vc.solve(layer(eps), vc.FirstIntegral(), throw=False)
    assert refused.verdict is not vc.Verdict.NO_EXTREMAL


# Troesch


def troesch(mu):
    return vc.Problem(lambda x, y, v: v**2 / 2 + ca.cosh(mu * y), vc.Fixed(0, 0), vc.Fixed(1, 1))


def troesch_slope(mu):
    """y'(0) = 2 q, sinh(mu/2)/q = sc(mu | 1 - q^2) (Roberts and Shipman, J. Comput. Phys. 10 (1972))."""
    with mp.workdps(60):

        def miss(q):
            sn, cn = (mp.ellipfun(kind, mu, m=1 - q * q) for kind in ("sn", "cn"))
            return (cn / sn).real - q / mp.sinh(mp.mpf(mu) / 2)

        # tan(gd) with the modulus one: q ~ 4 exp(-mu) is where cn is about to vanish
        guess = 4 * mp.exp(-mu) * mp.tanh(mp.mpf(mu) / 4)
        return float(2 * mp.findroot(miss, (guess * mp.mpf("0.999"), guess * mp.mpf("1.001")), "secant", tol=1e-50))


@pytest.mark.parametrize("mu", [5, 10, 30])
@pytest.mark.parametrize("method", [None, vc.Shooting(), vc.Collocation()], ids=repr)
def test_troesch(mu, method):
    solution = vc.solve(troesch(mu), method)
    slope = troesch_slope(mu)
    assert abs(solution.dy(0.0) - slope) <= 1e-3 * slope
    if isinstance(method, vc.Shooting):
        assert solution.dy(0.0) == pytest.approx(slope, rel=1e-9)


@pytest.mark.parametrize("mu", [5, 10])
def test_troeschs_solution_is_a_minimum(mu):
    assert vc.verify(vc.solve(troesch(mu))).verdict is vc.Verdict.MINIMUM


def test_a_steep_end_does_not_make_a_minimum_no_extremal():
    # y'(1) = 2 sinh(mu/2): the mesh has kinks there that are its own
    assert vc.verify(vc.solve(troesch(20))).verdict is vc.Verdict.MINIMUM


def test_simple_shooting_has_no_steep_solution():
    refused = vc.solve(troesch(30), vc.Shooting(segments=1), throw=False)
    assert not refused.status.ok
    assert "could not be integrated" in refused.message


# the gauge of a length


def test_length_is_blind_to_its_parameter_and_the_speed_is_made_constant():
    half_plane = vc.Curve(lambda q, dq: ca.norm_2(dq) / q[1], vc.At((-1, 1)), vc.At((2, 1)))
    solution = vc.solve(half_plane, guess=lambda t: [-1 + 3 * t**2, 1 + t * (1 - t)])
    # hyperbolic distance
    assert solution.value == pytest.approx(float(mp.acosh(1 + mp.mpf(9) / 2)), abs=1e-10)
    t = np.linspace(0, 1, 33)
    speed = np.linalg.norm(solution.dq(t), axis=0) / solution.q(t)[1]
    assert speed == pytest.approx(solution.value, rel=1e-4)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_with_the_gauge_left_open_the_second_variation_is_singular():
    length = vc.Problem(lambda t, q, v: ca.norm_2(v), vc.Fixed(0, (0, 0)), vc.Fixed(1, (3, 4)))
    solution = vc.solve(length, vc.Collocation(), throw=False)
    assert vc.verify(solution).verdict is vc.Verdict.DEGENERATE


# tolerances below round-off

METHODS = (None, vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting(), vc.FirstIntegral())


@pytest.mark.parametrize("tol", [1e-16, 1e-30])
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_below_round_off_the_best_answer_is_returned(tol, method):
    # c = 1 + z: arccosh(3/2)
    ray = vc.Problem(lambda x, z, v: ca.sqrt(1 + v**2) / (1 + z), vc.Fixed(0, 0), vc.Fixed(1, 0))
    solution = vc.solve(ray, method, tol=tol)
    assert solution.status is vc.Status.ROUND_OFF
    assert solution.value == pytest.approx(float(mp.acosh(mp.mpf(3) / 2)), abs=1e-14)
    assert tol < solution.error.value < 1e-13
