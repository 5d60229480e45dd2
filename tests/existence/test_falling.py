"""Functionals without a lower bound."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.falling import falling

LEVEL_END = vc.Fixed(1, 0)


def graph(lagrangian, end=LEVEL_END, **more):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), end, **more)


def oscillator(duration, rise):
    return graph(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(duration, rise))


UNBOUNDED = {
    "a saddle beyond the conjugate point": oscillator(4, 1),
    "conjugate ends, no extremal": oscillator(math.pi, 1),
    "a quartic potential": graph(lambda x, y, v: v**2 - y**4),
    # 4 is beyond the fold of y'' + lambda exp(y) = 0 at lambda = 3.5138: there is no local minimum either
    "an exponential one": graph(lambda x, y, v: v**2 / 2 - 4 * ca.exp(y)),
    "the longest curve": graph(lambda x, y, v: ca.sqrt(1 + v**2), maximise=True),
    "a beam pressed too hard": vc.Problem(
        lambda x, y, v, w: w**2 - 50 * v**2, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2
    ),
    "two functions": vc.Problem(
        lambda x, y, v: ca.sumsqr(v) - 12 * y[0] * y[1], vc.Fixed(0, (0, 0)), vc.Fixed(2, (0, 0))
    ),
}
BOUNDED = {
    "before the conjugate point": oscillator(3, 1),
    "at it, between zero ends": oscillator(math.pi, 0),
    "the shortest curve": graph(lambda x, y, v: ca.sqrt(1 + v**2)),
    "a pendulum": graph(lambda x, y, v: v**2 / 2 + ca.cos(y), vc.Fixed(10, 0)),
    "a beam that stands": vc.Problem(
        lambda x, y, v, w: w**2 - 39 * v**2, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2
    ),
    # int y sqrt(1 - v^2) is the area below a string of length 1: at most 1/(2 pi), and no curve has v > 1
    "an area by its arc": graph(lambda x, y, v: y * ca.sqrt(1 - v**2), maximise=True),
    "wells of the slope": graph(lambda x, y, v: v**2 * (v**2 - 1) ** 2 + y, vc.Free(1)),
    "a descent": graph(lambda x, y, v: ca.sqrt((1 + v**2) / y), vc.Fixed(1, 1)),
    # area is negative for y < 0, but no curve gets there without passing where L_vv = 0
    "a soap film": vc.Problem(lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(-1, 1), vc.Fixed(1, 1)),
}


@pytest.mark.parametrize("problem", UNBOUNDED.values(), ids=UNBOUNDED.keys())
def test_a_line_of_curves_shows_it(problem):
    fall = falling(problem)
    assert fall is not None
    sign = -1 if problem.maximise else 1
    assert np.all(np.diff(sign * fall.values) < 0)
    assert ("above" if problem.maximise else "below") in fall.finding.sentence


@pytest.mark.parametrize("problem", BOUNDED.values(), ids=BOUNDED.keys())
def test_no_line_where_there_is_a_bound(problem):
    assert falling(problem) is None


def test_the_fall_is_that_of_the_functional():
    # along sin the action of T = pi is linear: S(t/pi + c sin t) = S(t/pi) + c (int cos t / pi - t sin t / pi)
    fall = falling(oscillator(math.pi, 1))
    rates = np.diff(fall.values) / np.diff(fall.distances)
    assert rates == pytest.approx(rates[0], rel=1e-3)
    assert rates[0] == pytest.approx(-1.0, rel=2e-2)  # int t sin t dt / pi over (0, pi), and sin at its greatest is 1


@pytest.mark.parametrize(
    "name", ["a saddle beyond the conjugate point", "conjugate ends, no extremal", "an exponential one"]
)
def test_solve_says_so(name):
    with pytest.raises(vc.VariationalError, match="unbounded below") as refusal:
        vc.solve(UNBOUNDED[name])
    assert refusal.value.verdict is vc.Verdict.UNBOUNDED


def test_a_functional_that_falls_with_an_unknown_alone_is_unbounded():
    problem = graph(lambda x, y, v, p: v**2 + p.T, vc.Fixed(1, 1), unknowns={"T": 1})
    with pytest.raises(vc.VariationalError, match="unbounded below"):
        vc.solve(problem)


@pytest.mark.parametrize("lagrangian", [lambda x, y, v, p: p.T * v**2, lambda x, y, v, p: v**2 + p.T * y])
def test_an_unknown_number_may_lead_down_for_ever(lagrangian):
    refusal = vc.solve(graph(lagrangian, vc.Fixed(1, 1), unknowns={"T": 1.0}), throw=False)
    assert refusal.verdict is vc.Verdict.UNBOUNDED


@pytest.mark.parametrize("unit", [1e-10, 1.0, 1e10])
def test_a_fall_is_seen_in_any_unit_of_y(unit):
    # Bratu's problem: exp(y) outgrows y'^2 / 2, some ten units of its own away; a hundred further on it is no number
    found = vc.solve(vc.Problem(lambda x, y, v: (v / unit) ** 2 / 2 - ca.exp(y / unit), vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert found.local
    assert found.lower == -math.inf
