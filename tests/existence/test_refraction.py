"""Minima that meet kinks and jumps of the Lagrangian in y, in (x, y) and in the slope, against closed forms."""

import math
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from mpmath import findroot, mp, mpf, quad, sqrt
from scipy.optimize import minimize_scalar

import varcalc as vc

mp.dps = 30


def refracted(level, inclined, below, above):
    """Least optical length from (0, 0) to (1, 1) through the line y = level + inclined x: a root of its derivative."""

    def length(c):
        y = level + inclined * c
        return below * sqrt(c**2 + y**2) + above * sqrt((1 - c) ** 2 + (1 - y) ** 2)

    return length(findroot(lambda c: mp.diff(length, c), 0.5))


def two_media(level, inclined, below, above):
    return vc.Problem(
        lambda x, y, dy: ca.if_else(y > level + inclined * x, above, below) * ca.sqrt(1 + dy**2),
        vc.Fixed(0, 0), vc.Fixed(1, 1),
    )  # fmt: skip


def stuck(friction, load, shift=0.0, rise=0.0):
    """int y'^2/2 + friction |y' - shift| - load (y - shift x): sliding, held along the middle, sliding back."""
    problem = vc.Problem(
        lambda x, y, dy: (dy - shift) ** 2 / 2 + friction * ca.fabs(dy - shift) - load * (y - shift * x),
        vc.Fixed(0, 0), vc.Fixed(1, shift + rise),
    )  # fmt: skip
    m, further = mpf(load) / 2 - mpf(friction), mpf(rise) * load / (mpf(load) - 2 * mpf(friction))
    # y' - shift falls at the rate of the load from one to 0, and from 0 to minus the other
    start, end = (m + further) / load, (m - further) / load
    slid = sum(load * friction * a**2 / 2 - mpf(load) ** 2 * a**3 / 6 for a in (start, end))
    return problem, slid - load * rise * end - load**2 * start**2 / 2 * (1 - start - end)


def across(stiffness):
    """int y'^2/2 + stiffness |y - 1/2| from (0, 0) to (1, 1), by symmetry through (1/2, 1/2)."""
    slope = 1 + mpf(stiffness) / 4

    def integrand(x):
        return (slope - stiffness * x) ** 2 / 2 + stiffness * (0.5 - slope * x + stiffness * x**2 / 2)

    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 + stiffness * ca.fabs(y - 0.5), vc.Fixed(0, 0), vc.Fixed(1, 1))
    return problem, 2 * quad(integrand, [0, 0.5])


CASES = {
    "a level interface": (two_media(0.4, 0.0, 1.0, 1.5), refracted(mpf("0.4"), 0, 1, mpf("1.5"))),
    "into the thinner medium": (two_media(0.6, 0.0, 1.3, 1.0), refracted(mpf("0.6"), 0, mpf("1.3"), 1)),
    "an inclined interface": (two_media(0.3, 0.2, 1.0, 1.4), refracted(mpf("0.3"), mpf("0.2"), 1, mpf("1.4"))),
    "friction": stuck(1.0, 12.0),
    "less friction": stuck(0.3, 5.0),
    "friction nearly as strong as the load": stuck(2.5, 9.0),
    "hardly any friction": stuck(0.15, 15.0),
    "friction against a moving belt": stuck(1.0, 12.0, 0.5),
    "a belt whose speed is no dyadic number": stuck(0.8, 9.0, 0.7),
    "ends that all but move with the belt": stuck(0.8, 9.0, 0.7, 1e-6),
    "ends that all but rest": stuck(0.8, 9.0, 0.0, 1e-5),
    "a kink in y": across(3.0),
}


@pytest.mark.parametrize("name", CASES)
def test_the_crossing_is_made_out(name):
    problem, exact = CASES[name]
    solution = vc.solve(problem)
    assert abs(solution.value - float(exact)) <= solution.error.value + 1e-14 * abs(float(exact))
    assert solution.error.value < 1e-8
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting(), vc.FirstIntegral()])
@pytest.mark.parametrize("name", ["a level interface", "friction", "a kink in y"])
def test_no_other_method_calls_a_wrong_answer_right(name, method):
    problem, exact = CASES[name]
    solution = vc.solve(problem, method, throw=False)
    right = abs(solution.value - float(exact)) <= solution.error.value + 1e-14 * abs(float(exact))
    assert right or not solution.status.ok


def test_a_refusal_says_what_was_met_and_where():
    problem, _ = CASES["friction"]
    solution = vc.solve(problem, vc.Collocation(), throw=False)
    assert "a kink (fabs) where y' = 0, and the curve meets it at x = 0.5" in solution.message


def test_a_switch_that_no_curve_meets_changes_nothing():
    line = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) + ca.fmax(y - 5, 0), vc.Fixed(0, 0), vc.Fixed(1, 1))
    for method in (None, vc.Collocation(), vc.Shooting(), vc.FirstIntegral()):
        assert vc.solve(line, method).value == pytest.approx(2**0.5, rel=1e-13)


@pytest.mark.parametrize("kink", [lambda u: ca.fmax(u, 0), ca.fabs], ids=["fmax", "fabs"])
@pytest.mark.parametrize(("level", "first", "last", "way"), [(0, 1, 1, 1), (0.7, 1.7, 1.2, 1), (-2, 0.3, 1, -1)])
def test_a_dead_core(kink, level, first, last, way):
    """y'' = k down to the level, which is kept in between: each side costs k^2 l^3 / 3 on the length l of its arc."""
    k = mpf(50)
    core = vc.Problem(
        lambda x, y, dy: dy**2 / 2 + 50 * kink(way * (y - level)),
        vc.Fixed(0, level + way * first), vc.Fixed(1, level + way * last),
    )  # fmt: skip
    solution = vc.solve(core)
    exact = sum(k**2 * sqrt(2 * mpf(depth) / k) ** 3 / 3 for depth in (first, last))
    assert solution.value == pytest.approx(float(exact), rel=1e-10)
    assert solution.y(0.5) == pytest.approx(level, abs=1e-9)


def test_an_arc_beside_a_level_that_could_hold_it():
    """The parabola of y'' = k that does not come down to the level, though the arc is near it."""
    arc = vc.Problem(lambda x, y, dy: dy**2 / 2 + 2 * ca.fabs(y), vc.Fixed(0, 1.4), vc.Fixed(1.4, 0.5))
    s = (0.5 - 1.4 - 1.4**2) / 1.4
    exact = quad(lambda x: (s + 2 * x) ** 2 / 2 + 2 * (1.4 + s * x + x * x), [0, 1.4])
    assert vc.solve(arc).value == pytest.approx(float(exact), rel=1e-12)


@pytest.mark.parametrize(("force", "level", "length"), [(50, 0, 1), (1, 0, 5), (1, 0.3, 6), (7, -0.2, 2)])
def test_a_level_is_followed_from_one_side_to_the_other(force, level, length):
    """y'' = -k, and k on the other side: each side costs k^2 l^3 / 3 on the length l of its arc."""
    core = vc.Problem(lambda x, y, dy: dy**2 / 2 + force * ca.fabs(y - level), vc.Fixed(0, -1), vc.Fixed(length, 1))
    solution = vc.solve(core)
    k = mpf(force)
    exact = sum(k**2 * sqrt(2 * depth / k) ** 3 / 3 for depth in (1 + mpf(level), 1 - mpf(level)))
    assert solution.value == pytest.approx(float(exact), rel=1e-10)
    verification = vc.verify(solution)
    assert verification.verdict is vc.Verdict.MINIMUM
    assert verification.evidence["Euler-Lagrange"] <= 1e-9


@pytest.mark.parametrize(("friction", "load"), [(1.0, 1.5), (2.0, 0.6), (3.0, 5.9)])
def test_where_friction_holds_all_the_way_no_sliding_is_called_an_answer(friction, load):
    """y = 0 is least: what slides anywhere costs more than it gains."""
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 + friction * ca.fabs(dy) - load * y, vc.Fixed(0, 0), vc.Fixed(1, 0))
    solution = vc.solve(problem)
    assert abs(solution.value) <= solution.error.value
    assert not solution.curve(np.linspace(0, 1, 9), 0).any()


@pytest.mark.parametrize("method", [None, vc.Collocation(), vc.Shooting(), vc.FirstIntegral()])
def test_a_natural_condition_on_a_kink_is_none(method):
    """int y'^2/2 + |y'| - 3 y to a free end: y' = 2 - 3 x, held from x = 2/3 on; y' = 3 - 3 x ends on the kink."""
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 + ca.fabs(dy) - 3 * y, vc.Fixed(0, 0), vc.Free(1))
    solution = vc.solve(problem, method, throw=False)
    assert not solution.status.ok or abs(solution.value + 4 / 9) <= solution.error.value + 1e-14
    assert solution.status.ok or method is not None


@pytest.mark.parametrize("last", [-0.3, -0.02, -1e-4])
@pytest.mark.parametrize("load", [0.1, 0.8])
def test_a_curve_that_all_but_comes_to_rest_is_not_held(last, load):
    # v^2/2 + |v|/2 - load y with the slope -load x + const below zero throughout: -|v| is then a null Lagrangian
    first, length = last - load * 3.0, 3.0
    fall = 0.5 * (first + last) * length

    def value(slopes):
        x, weights = np.polynomial.legendre.leggauss(8)
        x, weights = 1.5 * (x + 1), 1.5 * weights
        v = slopes[0] + (slopes[1] - slopes[0]) * x / length
        y = slopes[0] * x + (slopes[1] - slopes[0]) * x**2 / (2 * length)
        return weights @ (v**2 / 2 - v / 2 + load * y)

    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ca.fabs(v) / 2 + load * y, vc.Fixed(0, 0), vc.Fixed(length, fall))
    assert vc.solve(problem).value == pytest.approx(value((first, last)), abs=1e-10)


def test_a_curve_that_meets_a_million_steps_is_refused_with_the_first_of_them():
    steps = vc.Problem(lambda x, y, dy: dy**2 + ca.floor(y), vc.Fixed(0, 1e6), vc.Fixed(1, 0))
    solution = vc.solve(steps, throw=False)
    assert solution.status is vc.Status.NOT_CONVERGED
    assert "a jump (floor) where y = a whole number, and the curve meets it at x = " in solution.message


@pytest.mark.parametrize(
    ("first", "last", "strict"),
    [(0.2, 0.3, True), (3e-3, 0.4, True), (1e-4, 1e-4, True), (0.5, 2e-3, True), (0.2, 0.3, False)],
)
def test_a_ray_runs_along_a_jump_on_its_faster_side(first, last, strict):
    """Down to y = 0 at the critical angle, along it in the faster medium below, and up again (Snell)."""
    slow, fast, width = mpf("1.5"), mpf(1), 4

    def index(y):
        return ca.if_else(y > 0 if strict else y >= 0, 1.5, 1.0)

    problem = vc.Problem(lambda x, y, dy: index(y) * ca.sqrt(1 + dy**2), vc.Fixed(0, first), vc.Fixed(width, last))
    cosine = sqrt(1 - (fast / slow) ** 2)
    depth = mpf(first) + mpf(last)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(float(slow * depth * cosine + fast * width), rel=1e-12)


@pytest.mark.parametrize("beyond", [0.1, 4e-3, 1e-4])
def test_an_end_just_beyond_a_jump(beyond):
    """From (0, -0.6) in the faster medium to (2, beyond) in the slower one: a root of the length's derivative."""
    problem = vc.Problem(
        lambda x, y, dy: ca.if_else(y > 0, 2.4, 1.3) * ca.sqrt(1 + dy**2), vc.Fixed(0, -0.6), vc.Fixed(2, beyond)
    )

    def length(c):
        return mpf("1.3") * sqrt(c**2 + mpf("0.36")) + mpf("2.4") * sqrt((2 - c) ** 2 + mpf(beyond) ** 2)

    crossing = findroot(lambda c: mp.diff(length, c), (1, 2), solver="illinois", maxsteps=200)
    assert vc.solve(problem).value == pytest.approx(float(length(crossing)), rel=1e-12)


@pytest.mark.parametrize(("load", "length", "last"), [
    (1.41865461205, 2.0776604096376636, -0.38129831162374817), (0.9, 2.0, -0.3), (2.2, 1.5, 0.2), (1.4, 2.0, 0.1),
])  # fmt: skip
def test_one_corner_is_not_taken_for_three(load, length, last):
    """(|v| - 1)^2 - load y: the momentum load (c - x) vanishes at the corner, where the slope goes from 1 to -1."""
    problem = vc.Problem(lambda x, y, dy: (ca.fabs(dy) - 1) ** 2 - load * y, vc.Fixed(0, 0), vc.Fixed(length, last))
    k, end = mpf(load), mpf(length)
    c = findroot(lambda c: c + k * c**2 / 4 - (end - c) - k * (end - c) ** 2 / 4 - mpf(last), 0.5 * length)
    after, top = end - c, c + k * c**2 / 4
    area = c**2 / 2 + k * c**3 / 6 + top * after - after**2 / 2 - k * after**3 / 12
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(float(k**2 * (c**3 + after**3) / 12 - k * area), rel=1e-11)


def by_branches(loss, load):
    """Huber's loss of the slope by ``if_else``, with a tenth of its square so that the slope is bounded, and a load."""
    return vc.Problem(lambda x, y, dy: loss(dy) + dy**2 / 20 - load * y, vc.Fixed(0, 0), vc.Fixed(1, 0))


def test_branches_that_join_smoothly_make_no_jump():
    # the momentum is 3/2 - 3x; of it L* is p^2/2.2 up to 1.1, and 5 (p - 1)^2 + 1/2 beyond
    exact = -mpf(2) / 3 * (mpf("1.1") ** 3 / mpf("6.6") + 5 * (mpf("0.5") ** 3 - mpf("0.1") ** 3) / 3 + mpf("0.2"))
    huber = by_branches(lambda v: ca.if_else(ca.fabs(v) < 1, v**2 / 2, ca.fabs(v) - 0.5), 3)
    solution = vc.solve(huber)
    assert abs(solution.value - exact) <= solution.error.value < 1e-10


def test_branches_that_agree_on_one_side_alone_are_refused_where_they_jump():
    one_sided = by_branches(lambda v: ca.if_else(ca.fabs(v) < 1, v**2 / 2, v - 0.5), 3)
    with pytest.raises(vc.VariationalError, match="jump"):
        vc.solve(one_sided)


def test_a_slope_whose_cost_joins_smoothly_leaves_the_curve_whole():
    problem = vc.Problem(lambda x, y, dy: dy**2 + ca.fmax(0, dy - 0.5) ** 2 - 3 * y, vc.Fixed(0, 0), vc.Fixed(1, 0))

    def slope(p):
        return p / 2 if p < 1 else (p + 1) / 4

    def conjugate(p):
        return p**2 / 4 if p < 1 else (p + 1) ** 2 / 8 - mpf(1) / 4

    def along(function, c):  # of the momentum c - 3x, whose kink lies at x = (c - 1)/3
        return quad(lambda x: function(c - 3 * x), [0, (c - 1) / 3, 1])

    exact = -along(conjugate, findroot(lambda c: along(slope, c), mpf("1.6")))
    solution = vc.solve(problem)
    assert abs(solution.value - exact) <= solution.error.value < 1e-10


def test_an_end_of_several_functions_on_a_kink_of_its_cost_is_the_reason():
    sprung = vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) / 2, vc.Fixed(0, (0, 0)), vc.Free(1),
        end_cost=lambda x0, y0, x1, y1: 3 * ca.fabs(y1[0] - 1),
    )  # fmt: skip
    solution = vc.solve(sprung, throw=False)
    assert not solution.status.ok
    assert "end_cost has a kink" in solution.message


@pytest.mark.parametrize("seed", range(6))
def test_a_random_smooth_splice_is_solved_the_same_however_it_is_written(seed):
    rng = np.random.default_rng(seed)
    bend, place, load, end = rng.uniform(0.1, 1), rng.uniform(-0.5, 0.9), rng.uniform(-6, 6), rng.uniform(-1, 2)
    size = [lambda x, y, v: v, lambda x, y, v: y, lambda x, y, v: y - x, lambda x, y, v: v - y][seed % 4]

    def problem(added):
        return vc.Problem(
            lambda x, y, v: v**2 + added(size(x, y, v) - place) + load * y, vc.Fixed(0, 0), vc.Fixed(1, end)
        )

    branched = vc.solve(problem(lambda e: ca.if_else(e > 0, bend * e**2, 0)))
    plain = vc.solve(problem(lambda e: bend * ca.fmax(e, 0) ** 2))
    assert abs(branched.value - plain.value) <= branched.error.value + plain.error.value + 1e-13
    assert branched.error.value < 1e-9


def fallen(knots, values, start, end):
    """Value and time of the way between two ordinates at the slope sqrt(2 (T - least T)), T straight between knots."""
    least = min(values)
    places = sorted({start, end, *(k for k in knots if min(start, end) < k < max(start, end))})
    heights = [mpf(h) for h in np.interp(places, knots, values)]
    value, time = mpf(0), mpf(0)
    for a, b, high, low in zip(places, places[1:], heights, heights[1:], strict=False):
        first, last = sqrt(2 * abs(high - least)), sqrt(2 * abs(low - least))
        rate = (low - high) / (mpf(b) - mpf(a))
        value += (last**3 - first**3) / (3 * rate)
        time += (last - first) / rate
    return value, time


TABLES = [
    # knots, values, and the ends: kinks that are valleys and crests on the way to the deepest and from there
    ([-2.0, 0.0, 0.5, 3.0], [8.0, -1.0, 1.5, 9.0], 2.0, 1.0),
    ([-2.0, -1.2, -1.1, 0.0, 0.4, 0.5, 1.5, 3.0], [3.0, 2.0, 4.0, -2.0, -1.0, 1.0, 0.5, 6.0], -1.5, 2.0),
    ([-3.0, -2.0, -0.3, -0.1, 0.12, 0.9, 3.0], [7.0, 1.0, 0.4, 0.2, -3.0, 0.0, 2.0], 2.5, -2.5),
    (list(np.linspace(-2, 2, 17)), list(3 * np.abs(np.linspace(-2, 2, 17)) ** 1.5 + 1), 1.8, 1.9),
    ([0.0, 1.0, 2.0], [0.0, 1.0, 3.0], 1.5, 1.7),
]


@pytest.mark.parametrize(("knots", "values", "start", "end"), TABLES)
def test_a_curve_goes_through_kinks_and_rests_on_the_deepest(knots, values, start, end):
    rest, least = knots[int(np.argmin(values))], min(values)
    ways = [fallen(knots, values, y, rest) for y in (start, end)]
    width = float(sum(time for _, time in ways)) + 1.0
    table = ca.interpolant("T", "linear", [knots], values)
    if rest == knots[0]:  # an edge of the table: what rests there is held by no kink
        table = ca.interpolant("T", "linear", [[knots[0] - 1, *knots]], [values[0] + 5, *values])
    solution = vc.solve(vc.Problem(lambda x, y, dy: dy**2 / 2 + table(y), vc.Fixed(0, start), vc.Fixed(width, end)))
    exact = sum(value for value, _ in ways) + mpf(least) * mpf(width)
    assert abs(solution.value - exact) <= solution.error.value + 1e-13
    assert solution.error.value < 1e-10
    assert not solution.local
    left, right = float(ways[0][1]), width - float(ways[1][1])
    assert np.abs(solution.curve(np.linspace(left, right, 9), 0) - rest).max() < 1e-9


def test_a_curve_goes_through_many_kinks():
    # no place to rest: y'^2 / 2 = T(y) + E, and E is what the time takes
    knots = np.linspace(-1, 3, 15)
    values = 2 + np.sin(knots) + 0.1 * knots**2
    start, end, width = mpf(-0.9), mpf(2.8), 1.4
    places = [start, *(mpf(k) for k in knots if start < k < end), end]

    heights = [mpf(h) for h in np.interp([float(y) for y in places], knots, values)]

    def along(e, power):  # the integral over y of a power of the slope, whose square is linear between places
        slopes = [sqrt(2 * (h + e)) for h in heights]
        parts = zip(pairwise(places), pairwise(heights), pairwise(slopes), strict=True)
        return sum(
            (w ** (power + 2) - v ** (power + 2)) / (power + 2) * (b - a) / (high - low)
            for (a, b), (low, high), (v, w) in parts
        )

    energy = findroot(lambda e: along(e, -1) - mpf(width), (0.5, 1.0))
    exact = along(energy, 1) - energy * mpf(width)
    table = ca.interpolant("T", "linear", [knots], values)
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 + table(y), vc.Fixed(0, float(start)), vc.Fixed(width, float(end)))
    solution = vc.solve(problem)
    assert abs(solution.value - exact) <= solution.error.value + 1e-12


@pytest.mark.parametrize("crest", [1.0, 3.0])
def test_a_curve_in_balance_on_a_crest_is_no_minimum(crest):
    # y = 0 obeys the equations; falling off to one side is better: y = crest x (1 - x) / 2
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 - crest * ca.fabs(y), vc.Fixed(0, 0), vc.Fixed(1, 0))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(-(crest**2) / 24, abs=1e-12)


def let_go(below, above, way, after, kink=1, level=0):
    """A string at rest on a kink |y - level|, under a load that grows past what that holds.

    L = y'^2/2 + f y + kink |y - level| with f = kink - below up to x = 1, kink + above beyond. The string lets go of
    the level ``way`` before, to go through it at last and on for as long as ``after``. What is convex has one extremal.
    """
    a, b, d, tau, m, c = map(mpf, (below, above, way, after, kink, level))
    back = d * (a + sqrt(a**2 + a * b)) / b
    pace, bend = d * sqrt(a**2 + a * b), 2 * m + b
    pieces = [  # where it begins, its length, ordinate less the level, slope, bend, load
        (mpf(0), 1 - d, 0, 0, 0, m - a), (1 - d, d, 0, 0, -a, m - a), (mpf(1), back, -a * d**2 / 2, -a * d, b, m + b),
        (1 + back, tau, 0, pace, bend, m + b),
    ]  # fmt: skip
    value = mpf(0)
    for _, length, y, v, w, f in pieces:

        def along(s, y=y, v=v, w=w, f=f):
            z = y + v * s + w * s**2 / 2
            return (v + w * s) ** 2 / 2 + f * (z + c) + m * abs(z)

        value += quad(along, [0, length])
    ends = vc.Fixed(0, float(c)), vc.Fixed(float(1 + back + tau), float(c + pace * tau + bend * tau**2 / 2))

    def lagrangian(x, y, v):
        return v**2 / 2 + ca.if_else(x < 1, kink - below, kink + above) * y + kink * ca.fabs(y - level)

    return vc.Problem(lagrangian, *ends), float(value)


@pytest.mark.parametrize(
    ("case", "method"),
    [
        ((0.5, 1, 0.6, 0.5), None),
        ((0.1, 0.05, 0.2, 0.3, 2, 1.5), None),
        ((0.02, 0.01, 0.3, 0.2), None),
        ((0.1, 0.05, 0.2, 0.3, 2, 1.5), vc.Ritz()),
    ],
)
def test_a_kink_lets_go_of_what_is_pulled_too_hard(case, method):
    problem, exact = let_go(*case)
    found = vc.solve(problem, method)
    assert abs(found.value - exact) <= found.error.value + 1e-14 * abs(exact)
    assert found.error.value < 1e-8
    assert not found.local
    assert vc.verify(found).verdict is vc.Verdict.MINIMUM


def test_a_curve_that_stays_on_a_kink_that_does_not_hold_it_is_not_verified():
    problem, _exact = let_go(0.5, 1, 0.6, 0.5)
    x1, y1 = problem.span[1], problem.end.values(1)[0]
    left = x1 - np.sqrt(2 * y1 / 3)  # where y'' = 2 m + b = 3 leads from the level to the end

    def curve(x, k):
        after = np.maximum(x - left, 0.0)
        return np.array([(1.5 * after**2, 3 * after, 3.0 * (after > 0))[k]])

    found = vc.solve(problem)
    resting = replace(found, curve=curve, extremal=None, x=np.array([0.0, 1.0, left, x1]), value=np.nan)
    measured = vc.verify(resting)
    assert measured.verdict is vc.Verdict.NO_EXTREMAL
    assert any("does not hold it" in finding.sentence for finding in measured.findings)
    assert not vc.verify(found).evidence["kinks"]


@pytest.mark.parametrize(
    "stiffer",
    [
        lambda v, slope, more: ca.if_else(v > slope, more * (v - slope) ** 2, 0),
        lambda v, slope, more: more * ca.fmax(0, v - slope) ** 2,
    ],
    ids=["if_else", "fmax"],
)
def test_a_slope_from_which_on_a_curve_is_stiffer_is_passed_on_the_way_from_a_kink(stiffer):
    # the momentum is the first slope up to the level, and grows by the load from there; three pieces
    load, level, slope, more, first, span = 3.0, 0.3, 0.8, 2.0, 0.5, 1.5
    met, passed = level / first, level / first + (slope - first) / load

    def pace(t):
        p = first + load * max(0.0, t - met)
        return p if p < slope else (p + 2 * more * slope) / (1 + 2 * more)

    def place(t):
        nodes, weights = np.polynomial.legendre.leggauss(4)
        edges = [0.0, *(e for e in (met, passed) if e < t), t]
        return sum(
            w * (b - a) / 2 * pace((a + b) / 2 + (b - a) / 2 * n)
            for a, b in pairwise(edges) for n, w in zip(nodes, weights, strict=True)
        )  # fmt: skip

    def summed(t):
        return pace(t) ** 2 / 2 + more * max(0.0, pace(t) - slope) ** 2 + load * max(0.0, place(t) - level)

    nodes, weights = np.polynomial.legendre.leggauss(6)
    least = sum(
        w * (b - a) / 2 * summed((a + b) / 2 + (b - a) / 2 * n)
        for a, b in pairwise([0.0, met, passed, span]) for n, w in zip(nodes, weights, strict=True)
    )  # fmt: skip
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + stiffer(v, slope, more) + load * ca.fmax(0, y - level),
        vc.Fixed(0, 0),
        vc.Fixed(span, place(span)),
    )
    solution = vc.solve(problem)
    assert abs(solution.value - least) <= 10 * solution.error.value


def test_a_valley_beside_a_bound_that_meets_no_kink_is_begun_from_its_polygon():
    # the line between the ends, and curves near it, meet a kink that the least curve never comes to
    hill, place, span, floor = 5.054, 0.628, 4.0, -0.05

    def lagrangian(x, y, v, exp, largest):
        pulled = v**2 / 2 - 2.528 * (0.942 - y) - hill * exp(-9.256 * ((x / span - 0.663) ** 2 + (y - place) ** 2))
        return pulled + 2.074 * largest(0, y - 0.573)

    problem = vc.Problem(
        lambda x, y, v: lagrangian(x, y, v, ca.exp, ca.fmax),
        vc.Fixed(0, 0.4),
        vc.Free(span),
        [vc.Bound(lambda x, y, v: y, lower=floor - 0.652)],
    )

    def fallen(x):
        left = max(0.0, 1 - x / 0.93)
        return floor - 0.652 + 1.102 * left**2, -2 * 1.102 / 0.93 * left

    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = np.concatenate([0.93 * (1 + nodes) / 2, 0.93 + (span - 0.93) * (1 + nodes) / 2])
    w = np.concatenate([0.93 * weights / 2, (span - 0.93) * weights / 2])
    known = sum(b * lagrangian(a, *fallen(a), np.exp, max) for a, b in zip(x, w, strict=True))
    solution = vc.solve(problem)
    assert known - 1e-2 < solution.value < known


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting()])
def test_a_method_of_smooth_equations_that_fails_names_what_switches(method):
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + 5 * ca.fabs(y - 0.3), vc.Fixed(0, 0), vc.Fixed(1, 1))
    refused = vc.solve(problem, method, throw=False)
    assert not refused.status.ok
    assert "a kink (fabs) where y - 3/10 = 0" in refused.message
    assert "try Ritz" in refused.message


@pytest.mark.parametrize("end", [(1.2, 0.9), (1.2, 1.0), (1.0, 0.75), (2.0, 1.3)])
def test_a_slanting_line_is_crossed_next_to_the_end_by_whatever_angle(end):
    """n = 1 below y = x/2 + 1/5 and 2 above it: the least of both lengths over the place at which it is crossed."""

    def path(t):
        return math.hypot(t, t / 2 + 0.2) + 2 * math.hypot(end[0] - t, end[1] - 0.2 - t / 2)

    exact = minimize_scalar(path, bounds=(0, end[0]), method="bounded", options={"xatol": 1e-9}).fun
    solution = vc.solve(
        vc.Problem(
            lambda x, y, v: (1.5 + 0.5 * ca.sign(y - x / 2 - 0.2)) * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(*end)
        )
    )
    assert solution.value == pytest.approx(exact, rel=1e-13)
    assert float(solution.y(end[0])) == pytest.approx(end[1], abs=1e-12)
