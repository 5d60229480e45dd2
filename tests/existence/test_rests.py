"""Curves that friction holds again and again: each rest ends where the momentum is enough to set out."""

import math
from itertools import pairwise
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize
from scipy.special import erf

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


STIFF, WEIGHT = 2.0, 1.5


def valley():
    """From both ends down to the kink of STIFF |y|, and a rest there in which the momentum turns."""
    ends, time = (0.8, 0.5), 6.0
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + MU * ca.fabs(v) + STIFF * ca.fabs(y), vc.Fixed(0, ends[0]), vc.Fixed(time, ends[1])
    )
    # v^2/2 = STIFF y on both ways, as the rest is left with no speed
    return problem, sum(2 / 3 * np.sqrt(2 * STIFF) * y**1.5 + MU * y for y in ends)


def ceiling():
    """A body pushed up against a bound, where it stays: it comes there with no speed."""
    height, time = 0.7, 4.0
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + MU * ca.fabs(v) - WEIGHT * y,
        vc.Fixed(0, 0), vc.Free(time), [vc.Bound(lambda x, y, v: y, upper=height)],
    )  # fmt: skip
    speed = np.sqrt(2 * WEIGHT * height)
    below = speed**3 / (3 * WEIGHT**2) + height * (time - speed / WEIGHT)
    return problem, speed**3 / (6 * WEIGHT) + MU * height - WEIGHT * below


def pulled():
    """A body that rests until its end pulls it up to a bound, which it comes to at the end alone, with some speed."""
    height, time, pull = 0.3, 1.2, 4.0
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + MU * ca.fabs(v) + WEIGHT * y,
        vc.Fixed(0, 0), vc.Free(time), [vc.Bound(lambda x, y, v: y, upper=height)],
        end_cost=lambda x0, y0, x1, y1: -pull * y1,
    )  # fmt: skip
    last = np.sqrt(2 * height / WEIGHT)
    assert last < time
    assert MU + WEIGHT * last < pull  # it is the bound that holds the end
    assert abs(MU - WEIGHT * (time - last)) < MU  # and friction that holds the beginning
    return problem, WEIGHT**2 * last**3 / 3 + (MU - pull) * height


def hurried():
    """A body that friction lets rest between two ways on which it is as fast as it may be."""
    fastest = 0.6
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + MU * ca.fabs(v) + rate(x) * y,
        vc.Fixed(0, 0), vc.Free(T), [vc.Bound(lambda x, y, v: v, lower=-fastest, upper=fastest)],
    )  # fmt: skip

    def gain(x):
        speed = min(max(abs(momentum(x)) - MU, 0.0), fastest)
        return speed**2 / 2 - (abs(momentum(x)) - MU) * speed if speed else 0.0

    x = np.linspace(0, T, 4001)
    excess = np.abs(momentum(x)) - MU
    turns = [
        brentq(lambda s, level=level: abs(momentum(s)) - MU - level, x[k], x[k + 1], xtol=1e-14)
        for level in (0.0, fastest)
        for k in np.flatnonzero(np.diff(np.sign(excess - level)))
    ]
    edges = sorted({0.0, T, *turns})
    return problem, sum(quad(gain, a, b, epsabs=1e-14)[0] for a, b in pairwise(edges))


@pytest.mark.parametrize("case", [valley, ceiling, pulled, hurried])
def test_a_body_rests_on_kinks_of_the_place_and_at_bounds_as_well(case):
    problem, exact = case()
    found = vc.solve(problem)
    assert abs(found.value - exact) <= 10 * found.error.value + 1e-13
    assert found.error.value < 1e-9
    assert not found.local


def test_a_well_behind_friction_and_a_bound_is_seen():
    """The line at rest is a minimum among the curves near it; a ramp to the bound beside a well is lower."""
    well, level = -0.11, -0.24

    def lagrangian(m, y, v):
        return v**2 / 2 + 0.7 * m.fabs(v) - 9.3 * m.exp(-(((y - well) / 0.096) ** 2)) + 0.38 * m.fabs(y)

    problem = vc.Problem(
        lambda x, y, v: lagrangian(ca, y, v),
        vc.Fixed(0, -0.95),
        vc.Free(1.0),
        [vc.Bound(lambda x, y, v: y, upper=level)],
    )
    found = vc.solve(problem)
    ramp = (level + 0.95) / 0.4
    before = quad(lambda x: lagrangian(np, -0.95 + ramp * x, ramp), 0, 0.4)[0]
    assert found.value < before + 0.6 * lagrangian(np, level, 0.0)
    assert not found.local
    assert found.curve(np.linspace(0.5, 1, 9), 0) == pytest.approx(level, abs=1e-9)


HIGHER = 9.0


def wall(start, end, rough=0.0, written=lambda y: ca.if_else(y < 0, HIGHER, 0)):
    """A body that falls to where L jumps up, and stays beside that: v^2/2 = y on the ways there and back."""
    free = end is None
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + rough * ca.fabs(v) + y + written(y),
        vc.Fixed(0, start), vc.Free(6) if free else vc.Fixed(6, end),
    )  # fmt: skip
    return problem, sum(2 / 3 * np.sqrt(2) * y**1.5 + rough * y for y in (start, 0.0 if free else end))


WALLS = {
    "to a free end": wall(1.0, None),
    "there and back": wall(1.0, 0.7),
    "begun beside it": wall(0.01, None),
    "with friction": wall(1.0, 0.7, 0.3),
    "with friction to a free end": wall(1.0, None, 0.3),
    "no less and equal": wall(1.0, 0.7, written=lambda y: ca.if_else(y <= 0, HIGHER, 0)),
    "by a sign": wall(1.0, None, written=lambda y: HIGHER * (1 - ca.sign(y)) / 2),
}


@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt())], ids=["ladder", "Newton", "IPOPT"])
@pytest.mark.parametrize("case", WALLS)
def test_a_body_stays_beside_a_jump_as_at_a_wall(case, method):
    problem, exact = WALLS[case]
    found = vc.solve(problem, method)
    assert abs(found.value - exact) <= found.error.value + 1e-13
    assert found.error.value < 1e-9
    assert not found.local


@pytest.mark.parametrize("case", WALLS)
def test_what_stays_beside_a_jump_is_verified(case):
    assert vc.verify(vc.solve(WALLS[case][0])).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("moving", [0.0, 0.1])
def test_a_body_falls_over_a_ledge_and_on_to_a_wall(moving):
    """The energy v^2/2 - V is that of the wall all along, in coordinates that move with both."""
    ledge, deep, time = 2.0, 0.3, 5.0
    problem = vc.Problem(
        lambda x, y, v: (v - moving) ** 2 / 2 + (y - moving * x)
        - ca.if_else(y - moving * x < 0, ledge, 0) + ca.if_else(y - moving * x < -deep, 9, 0),
        vc.Fixed(0, 1), vc.Free(time),
    )  # fmt: skip
    level = deep + ledge

    def along(drop, low, high):
        def part(t, value):  # y = low + t^2: the speed may vanish there as t does
            y = low + t * t
            speed = np.sqrt(2 * (level + low - drop + t * t))
            return 2 * t * (speed / 2 + (y - drop) / speed if value else 1 / speed)

        return [quad(part, 0, np.sqrt(high - low), args=(value,), epsabs=1e-14)[0] for value in (True, False)]

    (above, first), (below, second) = along(0.0, 0.0, 1.0), along(ledge, -deep, 0.0)
    found = vc.solve(problem)
    assert abs(found.value - (above + below - level * (time - first - second))) <= found.error.value + 1e-12
    assert found.error.value < 1e-9
    assert not found.local


def test_a_wall_that_a_local_minimum_lies_beyond_is_seen():
    """A method that is held to smooth curves falls past the wall: it says that there is something lower."""
    problem, exact = wall(0.1, None)
    found = vc.solve(problem, vc.Ritz(elements=4, degree=3, refine=False), throw=False)
    assert not found.status.ok or found.local or found.value <= exact + 1e-3


@pytest.mark.parametrize("end", [None, 1.2], ids=["free", "held"])
def test_what_bends_but_does_not_break_leaves_a_rest_on_a_bound(end):
    # V = y + 3 max(y - 1/2, 0)^2 >= 0, and L >= |v| sqrt(2 V), with equality where v^2/2 = V
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + y + 3 * ca.fmax(y - 0.5, 0) ** 2, vc.Fixed(0, 1.5),
        vc.Free(6) if end is None else vc.Fixed(6, end), [vc.Bound(lambda x, y, v: y, lower=0)],
    )  # fmt: skip

    def way(y):
        return quad(lambda z: np.sqrt(2 * (z + 3 * max(z - 0.5, 0) ** 2)), 0, y, points=[0.5], epsabs=1e-13)[0]

    exact = way(1.5) + (0 if end is None else way(end))
    found = vc.solve(problem)
    assert abs(found.value - exact) <= found.error.value + 1e-12
    assert found.error.value < 1e-8
    assert not found.local


def test_what_bends_and_a_bound_that_holds_without_a_rest():
    # the fmax bends L and breaks nothing: no side of it has to be known beside the bound
    def lagrangian(x, y, v, greater):
        return v**2 / 2 + y * np.cos(x) + 3 * greater(y - 0.5, 0) ** 2

    n = 600
    x = np.linspace(0, 6, n + 1)
    h, middles = x[1], 0.5 * (x[1:] + x[:-1])

    def polygon(free):
        y = np.append(1.5, free)
        z, v = 0.5 * (y[1:] + y[:-1]), np.diff(y) / h
        by_place, by_slope = h * (np.cos(middles) + 6 * np.maximum(z - 0.5, 0)), v
        gradient = np.append(0.5 * by_place, 0.0) + np.append(0.0, 0.5 * by_place)
        gradient += np.append(0.0, by_slope) - np.append(by_slope, 0.0)
        return h * lagrangian(middles, z, v, np.maximum).sum(), gradient[1:]

    options = {"maxiter": 20000, "maxfun": 40000, "ftol": 1e-15, "gtol": 1e-10}
    least = minimize(polygon, np.full(n, 0.3), jac=True, method="L-BFGS-B", bounds=[(0, 3)] * n, options=options).fun
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + y * ca.cos(x) + 3 * ca.fmax(y - 0.5, 0) ** 2, vc.Fixed(0, 1.5), vc.Free(6),
        [vc.Bound(lambda x, y, v: y, lower=0)],
    )  # fmt: skip
    found = vc.solve(problem)
    assert abs(found.value - least) < 1e-4
    assert found.error.value < 1e-8
    assert not found.local


def kicked(height, place, width, first, last, length=5.0, friction=0.7):
    """A body with friction under one short push: v^2/2 + m |v| + f y, f = height exp(-((x - place) / width)^2).

    The momentum is p0 plus the integral of f, v what of it exceeds the friction, and p0 leads to the end.
    """
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + friction * ca.fabs(v) + height * ca.exp(-(((x - place) / width) ** 2)) * y,
        vc.Fixed(0, first), vc.Fixed(length, last),
    )  # fmt: skip
    x = np.union1d(np.linspace(0, length, 4001), np.linspace(place - 8 * width, place + 8 * width, 8001))
    push = height * width * np.sqrt(np.pi) / 2 * (erf((x - place) / width) + erf(place / width))

    def slope(p0):
        return np.sign(p0 + push) * np.maximum(np.abs(p0 + push) - friction, 0.0)

    v = slope(brentq(lambda p0: np.trapezoid(slope(p0), x) - (last - first), -50, 50, xtol=1e-14))
    y = first + np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(x)))
    force = height * np.exp(-(((x - place) / width) ** 2))
    return problem, np.trapezoid(v**2 / 2 + friction * np.abs(v) + force * y, x)


@pytest.mark.parametrize(
    "case",
    [
        (3.222, 2.1772, 0.0219, -0.485, -1.4088),  # it never rests, though it all but stops
        (2.8577, 2.9062, 0.0155, -0.3022, -1.209),
        (1.6483, 3.4698, 0.008, -0.8924, -1.3898),  # the push lies between the points of the first mesh
        (3.496, 1.9518, 0.0167, -1.4986, -0.8697),
    ],
)
def test_a_short_push_on_what_friction_slows(case):
    problem, exact = kicked(*case)
    found = vc.solve(problem, throw=False)
    assert not found.status.ok or abs(found.value - exact) < 1e-5
    # one that comes to rest, or sets out, within the push may be refused
    assert found.status.ok or case[0] == 3.496


def held_twice(load, friction, slope, level, first, last, span):
    """A curve that friction holds at a slope, and then a kink of the place at rest, as pieces that are parabolas.

    L is v^2/2 + friction |v + slope| + load max(0, y - level). On the way down the momentum grows by the load: the
    slope is held while it grows by twice the friction, ends as the curve comes to the level, and leaves it in time.
    """
    left = span - math.sqrt(2 * (last - level) / load)
    here = level + slope**2 / (2 * load) + 2 * friction * slope / load
    a = (-slope + math.sqrt(slope**2 + 2 * load * (first - here))) / load
    b = a + 2 * friction / load
    d = b + slope / load

    def curve(x):
        if x < a:
            return here + slope * (a - x) + load * (a - x) ** 2 / 2, -slope - load * (a - x)
        if x < b:
            return here - slope * (x - a), -slope
        if x < d:
            return level + load * (d - x) ** 2 / 2, -load * (d - x)
        return level + load * max(0.0, x - left) ** 2 / 2, load * max(0.0, x - left)

    nodes, weights = np.polynomial.legendre.leggauss(6)
    total = 0.0
    for low, high in ((0.0, a), (a, b), (b, d), (d, left), (left, span)):
        for x, w in zip((low + high) / 2 + (high - low) / 2 * nodes, weights * (high - low) / 2, strict=True):
            y, v = curve(x)
            total += w * (v**2 / 2 + friction * abs(v + slope) + load * max(0.0, y - level))
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + friction * ca.fabs(v + slope) + load * ca.fmax(0, y - level),
        vc.Fixed(0, first),
        vc.Fixed(span, last),
    )
    return problem, total


@pytest.mark.parametrize(
    "numbers", [(2.397, 1.175, 0.14, -0.547, -0.03, 0.666, 4.0), (3.0, 0.5, 0.3, -0.5, 0.2, 0.4, 4.0)]
)
def test_what_a_slope_holds_ends_before_a_level_of_another_slope_does(numbers):
    problem, least = held_twice(*numbers)
    solution = vc.solve(problem)
    assert abs(solution.value - least) <= 10 * solution.error.value + 1e-13


def test_a_curve_beside_a_jump_has_the_value_it_is_said_to_have():
    # up to the jump, along it on its lower side of L, and down again, as steep as the energy says; slopes have a bound
    gain, level, first, last = 0.719, 0.305, 0.135, -0.858
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - gain * ca.if_else(y > level, 1, 0) + 2.593 * ca.if_else(y > 0.98, 1, 0),
        vc.Fixed(0, first),
        vc.Fixed(2, last),
        [vc.Bound(lambda x, y, v: v, lower=-1.46, upper=1.46)],
    )
    steep = math.sqrt(2 * gain)
    moving = ((level - first) + (level - last)) / steep
    solution = vc.solve(problem)
    assert abs(solution.value - (gain * moving - gain * (2 - moving))) < 1e-9
    x = np.linspace(0, 2, 200_001)[1:-1:2]
    y, v = solution.y(x).ravel(), solution.dy(x).ravel()
    assert abs(2 * np.mean(v**2 / 2 - gain * (y > level)) - solution.value) < 1e-3


PRICE, LIFT = 3.0, 1.0


def under_a_step(start, end, span, rough=0.0, moving=0.0, sign=1):
    """A body that falls off a step and is lifted against its edge from below, to stay there: V = PRICE - y, then -y.

    The energy v^2/2 - V is that of rest at the edge, in coordinates that move with it. On the step v grows by LIFT.
    """
    at_rest = math.sqrt(2 * PRICE)

    def lagrangian(x, y, v):
        u, w = sign * (y - moving * x), sign * (v - moving)
        return w**2 / 2 + rough * ca.fabs(w) + PRICE * ca.if_else(u > 0, 1, 0) - LIFT * u

    def above(height):  # w = -(at_rest - LIFT s) at a time s before the edge
        time = (at_rest - math.sqrt(at_rest**2 - 2 * LIFT * height)) / LIFT
        speeds = [(at_rest**3 - (at_rest - LIFT * time) ** 3) / (6 * LIFT), PRICE * time]
        lifted = LIFT * (at_rest * time**2 / 2 - LIFT * time**3 / 6)
        return sum(speeds) - lifted + rough * height

    first, last = vc.Fixed(0, sign * start), vc.Free(span)
    if end is not None:
        last = vc.Fixed(span, sign * end + moving * span)
    return vc.Problem(lagrangian, first, last), above(start) + (0.0 if end is None else above(end))


@pytest.mark.parametrize(
    "problem",
    [
        under_a_step(0.5, None, 1.5),
        under_a_step(1.0, None, 2.5),  # on a longer way it is least to rise
        under_a_step(0.5, 0.8, 3.0),
        under_a_step(0.5, None, 2.0, rough=0.4),
        under_a_step(0.5, 0.8, 3.0, rough=0.4),
        under_a_step(0.5, None, 2.0, moving=0.3),
        under_a_step(0.5, 0.8, 3.0, moving=-0.3),
        under_a_step(0.5, 0.8, 3.0, sign=-1),
    ],
    ids=["down", "far", "and up", "rough", "rough and up", "moving", "moving and up", "mirrored"],
)
def test_a_body_stays_beside_a_jump_that_it_came_through(problem):
    stated, exact = problem
    found = vc.solve(stated)
    assert abs(found.value - exact) <= found.error.value + 1e-12
    assert found.error.value < 1e-9
    assert not found.local
    assert vc.verify(found).verdict is vc.Verdict.MINIMUM


def test_a_fall_off_a_step_keeps_a_bound_of_its_slope():
    # as steep as may be, and not as steep as the energy says: v^2/2 + PRICE - LIFT y for 0.5, at rest then
    problem, _ = under_a_step(0.5, None, 2.0)
    bounded = problem.restated(constraints=[vc.Bound(lambda x, y, v: v, lower=-1, upper=1)])
    found = vc.solve(bounded)
    exact = 0.5 * (0.5 + PRICE) - LIFT * 0.5**2 / 2
    assert found.local or abs(found.value - exact) <= 10 * found.error.value + 1e-11
    assert found.value >= exact - 1e-9
    assert np.abs(found.dy(np.linspace(0, 2, 999))).max() <= 1 + 1e-9


def test_what_rises_above_a_step_is_held_against_what_falls_off_it():
    """y'' = -lift all along, to a free end: no lattice about the curve at rest beside the step shows it."""
    price, lift, start, span = 1.07, 1.3, 0.36, 1.5
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + price * ca.if_else(y > 0, 1, 0) - lift * y, vc.Fixed(0, start), vc.Free(span)
    )
    found = vc.solve(problem)
    exact = price * span - lift * start * span - lift**2 * span**3 / 6
    assert abs(found.value - exact) <= found.error.value + 1e-12
