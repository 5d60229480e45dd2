"""Curves that friction holds again and again: each rest ends where the momentum is enough to set out."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc
from varcalc.existence.rests import with_rests
from varcalc.methods.crossings import Crossing
from varcalc.problem.breaks import on_curve

MU, T = 0.5, 7.0


def momentum(x):
    """The momentum of v^2/2 + MU |v| + p' y where the end is free: p itself, which is nothing there."""
    return np.sin(2 * x) * (T - x) / 3


def rate(x):
    """Its rate."""
    return 2 * ca.cos(2 * x) * (T - x) / 3 - ca.sin(2 * x) / 3


def pushed(hill=0.0):
    """A body on a rough floor under a load that turns again and again, on the side of a hill or not."""
    return vc.Problem(
        lambda x, y, v: v**2 / 2 + MU * ca.fabs(v) + rate(x) * y - hill * y**2 / 2, vc.Fixed(0, 0), vc.Free(T)
    )


def turns():
    """Where the body sets out and comes to rest, by the momentum alone."""
    x = np.linspace(0, T, 2001)
    excess = np.abs(momentum(x)) - MU
    inside = np.flatnonzero(np.diff(np.sign(excess)))
    return [brentq(lambda s: abs(momentum(s)) - MU, x[k], x[k + 1], xtol=1e-14) for k in inside]


def least():
    """v is what of p is more than MU: the functional is minus half the integral of its square."""
    ends = turns()
    values = [
        quad(lambda x: max(abs(momentum(x)) - MU, 0.0) ** 2 / 2, a, b, epsabs=1e-14)[0]
        for a, b in zip([0.0, *ends], [*ends, T], strict=True)
    ]
    return -sum(values)


def nearly(ends, away):
    """A curve that moves as the body does but for its slopes at rest, and rests at its rests, nearly."""

    def slopes(x):
        excess = np.maximum(np.abs(momentum(x)) - MU, 0.0)
        return (np.sign(momentum(x)) * excess)[None]

    grid = np.linspace(0, T, 4001)
    y = np.concatenate([[0.0], np.cumsum(slopes(0.5 * (grid[1:] + grid[:-1]))[0] * np.diff(grid))])
    edges = [0.0, *ends, T]
    rests = [(a - away, b + away) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return lambda x, k: slopes(x) if k else np.interp(x, grid, y)[None], rests


@pytest.mark.parametrize("away", [0.0, 0.03, 0.05])
def test_rests_end_where_the_body_sets_out(away):
    problem, ends = pushed(), turns()
    assert len(ends) >= 6
    curve, rests = nearly(ends, away)
    switch = on_curve(problem)[0]
    found = [Crossing(switch, max(a, 0.0), until=min(b, T)) for a, b in rests]
    solution = with_rests(problem, vc.Ritz(), 1e-10, curve, found)
    assert solution is not None
    assert solution.value == pytest.approx(least(), abs=1e-11)
    x = np.linspace(0, T, 501)
    slopes = np.sign(momentum(x)) * np.maximum(np.abs(momentum(x)) - MU, 0.0)
    np.testing.assert_allclose(solution.curve(x, 1)[0], slopes, atol=1e-6)


def test_the_ladder_finds_all_rests():
    found = vc.solve(pushed())
    assert found.value == pytest.approx(least(), abs=1e-10)
    assert abs(found.value - least()) <= 10 * found.error.value
    assert not found.local


def test_a_rest_that_was_not_seen_is_found():
    """The curve strays to the other side of the kink on its way where a rest is missing."""
    problem, ends = pushed(), turns()
    curve, rests = nearly(ends, 0.0)
    switch = on_curve(problem)[0]
    found = [Crossing(switch, max(a, 0.0), until=min(b, T)) for a, b in rests[1:]]
    solution = with_rests(problem, vc.Ritz(), 1e-10, curve, found)
    assert solution is not None
    assert solution.value == pytest.approx(least(), abs=1e-11)


def test_a_body_that_no_friction_holds_does_not_rest():
    """On a crest of the slope's cost the momentum lies on the wrong side of both."""
    problem = vc.Problem(lambda x, y, v: v**2 / 2 - MU * ca.fabs(v) + rate(x) * y, vc.Fixed(0, 0), vc.Free(T))
    curve, rests = nearly(turns(), 0.0)
    found = [Crossing(on_curve(problem)[0], max(a, 0.0), until=min(b, T)) for a, b in rests]
    assert with_rests(problem, vc.Ritz(), 1e-10, curve, found) is None


def test_on_the_side_of_a_hill_the_body_comes_to_rest_as_often():
    """L is not convex; the answer obeys the equations of motion between rests, by another integration of them."""
    from scipy.integrate import solve_ivp

    hill = 0.03
    found = vc.solve(pushed(hill))
    assert not found.local
    x = np.linspace(0, T, 4001)
    v = found.curve(x, 1)[0]
    moving = np.abs(v) > 1e-7
    starts = np.flatnonzero(np.diff(moving.astype(int)) == 1)
    stops = np.flatnonzero(np.diff(moving.astype(int)) == -1)
    assert len(starts) >= 3
    ways = SimpleNamespace(begin=x[starts + 20], end=x[stops[stops > starts[0]][: len(starts)] - 20])
    for a, b in zip(ways.begin, ways.end, strict=False):
        state = [found.curve(np.array([a]), k)[0, 0] for k in (0, 1)]
        path = solve_ivp(
            lambda s, q: [q[1], float(rate(s)) - hill * q[0]], (a, b), state, "DOP853", rtol=1e-11, atol=1e-13
        )
        assert path.y[0, -1] == pytest.approx(found.curve(np.array([b]), 0)[0, 0], abs=1e-7)
