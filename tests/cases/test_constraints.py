"""Prescribed integrals: arcs, chains, Dido's shore; levels that one curve only, or none, can meet."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc

INDIRECT = (vc.Collocation(), vc.Shooting(), vc.FirstIntegral())


def arc_length(x, y, v):
    return ca.sqrt(1 + v**2)


# chord and arc


def area_under(length):
    return vc.Problem(
        lambda x, y, v: y, vc.Fixed(-1, 0), vc.Fixed(1, 0), [vc.Isoperimetric(arc_length, length)], maximise=True
    )


def area_beside(length):
    return vc.Curve(
        lambda q, dq: q[1] * dq[0], vc.At((-1, 0)), vc.At((1, 0)),
        [vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), length)], maximise=True,
    )  # fmt: skip


def circular(length):
    """Half angle, radius and area of the arc over a chord of 2: sin(a)/a = 2/length."""
    a = mp.findroot(lambda a: mp.sin(a) / a - mp.mpf(2) / length, (0.1, 3.1), "illinois")
    r = 1 / mp.sin(a)
    return float(a), float(r), float(r**2 * (2 * a - mp.sin(2 * a)) / 2)


@pytest.mark.parametrize("method", [None, *INDIRECT], ids=repr)
def test_an_arc_that_is_a_graph(method):
    _, radius, area = circular(3)
    solution = vc.solve(area_under(3), method)
    assert abs(solution.value - area) <= 10 * solution.error.value <= 1e-8
    assert abs(solution.multipliers[0]) == pytest.approx(radius, rel=1e-6)  # dA/dl is the radius
    assert vc.verify(solution).verdict is vc.Verdict.MAXIMUM


@pytest.mark.parametrize("method", [vc.Ritz(), *INDIRECT], ids=repr)
def test_longer_than_half_a_circle_it_is_no_graph(method):
    assert not vc.solve(area_under(3.3), method, throw=False).status.ok


def test_but_a_curve():
    half_angle, radius, area = circular(4)
    assert half_angle > mp.pi / 2
    solution = vc.solve(area_beside(4))
    assert abs(solution.value - area) <= 10 * solution.error.value <= 1e-8
    assert solution.multipliers[0] == pytest.approx(radius, rel=1e-6)
    assert vc.verify(solution).verdict is vc.Verdict.MAXIMUM


@pytest.mark.parametrize("problem", [area_under(2), area_beside(2)], ids=["graph", "curve"])
def test_as_long_as_the_chord_the_multiplier_is_infinite(problem):
    refused = vc.solve(problem, throw=False)
    assert refused.status is vc.Status.REFUSED
    assert refused.verdict is vc.Verdict.DEGENERATE


# chains


def chain(length):
    return vc.Problem(
        lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(arc_length, length)]
    )


def hanging(length):
    """Sag and moment of a chain over a span of 1: sinh(h)/h = length, c = 1/(2 h)."""
    guess = 1.6 if length > 1.2 else mp.sqrt(6 * (mp.mpf(length) - 1))
    h = mp.findroot(lambda h: mp.sinh(h) / h - mp.mpf(length), guess)
    c = 1 / (2 * h)
    sag = c * (mp.cosh(h) - 1)
    moment = c / 2 + c**2 * mp.sinh(2 * h) / 2 - c * mp.cosh(h) * mp.mpf(length)
    return float(sag), float(moment)


@pytest.mark.parametrize("length", [1.5, 1.01, 1.0001])
@pytest.mark.parametrize("method", [None, *INDIRECT], ids=repr)
def test_chains_slack_and_taut(length, method):
    sag, moment = hanging(length)
    solution = vc.solve(chain(length), method)
    assert abs(solution.value - moment) <= 10 * solution.error.value <= 1e-8
    assert -solution.y(0.5) == pytest.approx(sag, abs=1e-8)


@pytest.mark.parametrize("length", [1.001, 1.00011, 1.0001, 1.00005])
def test_the_rounding_of_a_taut_chains_length_is_no_fold(length):
    """Its length all but ceases to depend on the curve: a miss of 2e-16 moves the curve by 1e-12."""
    solution = vc.solve(chain(length), vc.Shooting())
    assert abs(solution.value - hanging(length)[1]) <= solution.error.value <= 1e-13


@pytest.mark.parametrize("length", [1.5, 1.01])
def test_the_chain_hangs_at_a_minimum(length):
    assert vc.verify(vc.solve(chain(length))).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("method", [None, vc.Shooting(), vc.FirstIntegral(), vc.Collocation()], ids=repr)
def test_a_chain_as_long_as_its_span_is_abnormal(method):
    refused = vc.solve(chain(1), method, throw=False)
    assert refused.status is vc.Status.REFUSED
    assert refused.verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize(
    ("length", "method"), [(1 - 1e-6, None), (0.5, None), *((0.999, method) for method in (None, *INDIRECT))], ids=repr
)
def test_a_chain_shorter_than_its_span_is_impossible(length, method):
    with pytest.raises(vc.InfeasibleError, match="its integral lies between 1") as refusal:
        vc.solve(chain(length), method)
    assert refusal.value.verdict is vc.Verdict.INFEASIBLE


def test_no_extremal_of_an_impossible_chain():
    assert len(vc.extremals(chain(0.9))) == 0


def test_any_level_out_of_reach_is_found_out():
    # int y'^2 >= 1 between ends that differ by 1
    stiff = vc.Problem(
        lambda x, y, v: y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Isoperimetric(lambda x, y, v: v**2, 0.5)]
    )
    assert vc.solve(stiff, throw=False).verdict is vc.Verdict.INFEASIBLE


# Dido


def test_didos_shore_is_met_at_right_angles():
    length = 3.0
    shore = vc.Curve(
        lambda q, dq: q[1] * dq[0], vc.At((0, 0)), vc.OnSurface(lambda q: q[1], guess=(1, 0)),
        [vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), length)], maximise=True,
    )  # fmt: skip
    solution = vc.solve(shore)
    assert abs(solution.value - float(length**2 / (2 * mp.pi))) <= 10 * solution.error.value <= 1e-8
    along, away = solution.dq(1.0)
    assert abs(along / away) < 1e-5
    assert solution.q(1.0) == pytest.approx([float(2 * length / mp.pi), 0], abs=1e-6)
    check = vc.verify(solution)
    assert (check.verdict, check.index) == (vc.Verdict.MAXIMUM, 0)


def test_both_ends_on_the_shore():
    length = 3.0
    shore = vc.Curve(
        lambda q, dq: q[1] * dq[0], vc.OnSurface(lambda q: q[1], guess=(-1, 0)),
        vc.OnSurface(lambda q: q[1], guess=(1, 0)),
        [vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), length)], maximise=True,
    )  # fmt: skip
    solution = vc.solve(shore)
    assert solution.value == pytest.approx(float(length**2 / (2 * mp.pi)), abs=1e-9)
    slopes = solution.dq(np.array([0.0, 1.0]))
    assert np.abs(slopes[0] / slopes[1]).max() < 1e-5
