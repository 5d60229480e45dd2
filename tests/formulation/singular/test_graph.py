"""Singular ends where more is asked than a curve between two points: closed forms from the cycloid."""

import math
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import Infinite, forms
from varcalc.formulation.singular.departure import departure


def quickest(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt((1 + dy**2) / y)


def length(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt(1 + dy**2)


def braked(x: Any, y: Any, dy: Any) -> Any:
    return quickest(x, y, dy) + 0.3 * dy**2


RADIUS, ANGLE = 0.6, 1.2
"""The first arc of a descent in two parts."""
CORNER = (RADIUS * (ANGLE - math.sin(ANGLE)), RADIUS * (1 - math.cos(ANGLE)))


def following_arc(radius: float) -> tuple[float, float, float]:
    """End point and time of a cycloid's arc, one unit of angle long, from CORNER on."""
    first = math.acos(1 - CORNER[1] / radius)
    last = first + 1
    across = radius * (last - math.sin(last) - first + math.sin(first))
    return CORNER[0] + across, radius * (1 - math.cos(last)), math.sqrt(2 * radius)


def first_time() -> float:
    return ANGLE * math.sqrt(2 * RADIUS)


def steered(weight: float, constant: float, turns: bool) -> tuple[float, float, float, float]:
    """Width, depth, length and time of an extremal of (1 / sqrt(y) + weight) sqrt(1 + y'^2).

    Its first integral (1 / sqrt(y) + weight) / sqrt(1 + y'^2) = constant makes all of them integrals over sqrt(y);
    from rest to depth 1, or to rest again.
    """
    with mp.workdps(30):
        w, c = mp.mpf(weight), mp.mpf(constant)

        last = 1 / (c - w) if turns else mp.mpf(1)

        def along(rate: Any) -> Any:
            if not turns:
                return mp.quad(lambda u: rate(u) / mp.sqrt((1 + w * u) ** 2 - (c * u) ** 2), [0, last])
            # u = last (1 - s^2) takes the root at the turning point out
            depth = lambda s: last * (1 - s * s)  # noqa: E731
            return 2 * mp.quad(lambda s: 2 * last * rate(depth(s)) / mp.sqrt(1 + (w + c) * depth(s)), [0, 1])

        width, way = along(lambda u: 2 * c * u**2), along(lambda u: 2 * u * (1 + w * u))
        time = along(lambda u: 2 * (1 + w * u))
        return float(width), 0.0 if turns else 1.0, float(way), float(time)


def descent(across: float, depth: float) -> float:
    """The time of the cycloid from rest at the origin."""
    with mp.workdps(30):

        def miss(t: Any) -> Any:
            return (t - mp.sin(t)) / (1 - mp.cos(t)) - mp.mpf(across) / depth

        angle = mp.findroot(miss, (mp.mpf("1e-3"), 2 * mp.pi - mp.mpf("1e-2")), solver="anderson", tol=1e-25)
        return float(angle * mp.sqrt(2 * depth / (1 - mp.cos(angle))))


def assert_solved(problem: Any, exact: float, tol: float = 1e-10) -> vc.Solution:
    solution = vc.solve(problem, tol=tol)
    assert solution.status is vc.Status.SOLVED
    error = abs(solution.value - exact)
    assert error <= tol * max(1.0, abs(exact))
    assert error <= 1.2 * solution.error.value + 4e-15
    return solution


# powers of a departure


@pytest.mark.parametrize(
    ("lagrangian", "end", "abscissa", "ordinates"),
    [
        (quickest, (1, 1), 3, (2,)),
        (lambda x, y, dy: -quickest(x, y, dy), (1, 1), 3, (2,)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / x), (1, 1), 2, (3,)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / (0.3 * x + y)), (1, 1), 2, (2,)),
        (lambda x, y, dy: ca.sqrt(1 + dy**2) * y ** (-1 / 4), (1, 1), 5, (4,)),
        (braked, (1, 1), 7, (6,)),
        (lambda x, y, dy: ca.sqrt((1 + ca.sumsqr(dy)) / y[1]), (1, [1, 1]), 3, (3, 2)),
    ],
)
def test_powers_of_a_departure(lagrangian: Any, end: Any, abscissa: int, ordinates: tuple[int, ...]) -> None:
    start = (0, [0, 0]) if len(ordinates) == 2 else (0, 0)
    found = departure(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end)), True)
    assert found is not None
    assert (found.abscissa, found.ordinates) == (abscissa, ordinates)


def test_an_infinite_functional_is_refused_whatever_else_is_asked() -> None:
    level = vc.Isoperimetric(lambda x, y, dy: y, 0.6)
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) / y, vc.Fixed(0, 0), vc.Fixed(1, 1), [level])
    with pytest.raises(Infinite, match="infinite for every curve"):
        forms(problem)


# what may be asked


def test_a_maximum_of_the_negative() -> None:
    exact = -descent(1, 1)
    assert_solved(
        vc.Problem(lambda x, y, dy: -quickest(x, y, dy), vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=True), exact, 1e-12
    )
    curve = vc.Curve(
        lambda q, dq: -ca.norm_2(dq) / ca.sqrt(q[1]), vc.At((0, 0)), vc.At((1, 1)), maximise=True
    )  # fmt: skip
    assert_solved(curve, exact, 1e-12)
    positive = vc.solve(vc.Problem(braked, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    negative = vc.Problem(lambda x, y, dy: -braked(x, y, dy), vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=True)
    assert_solved(negative, -positive.value)


@pytest.mark.parametrize("end", [vc.Free(1), vc.OnCurve(lambda x, y: x - 1, 1.2)], ids=["free", "on a vertical line"])
def test_a_cost_of_the_end(end: Any) -> None:
    # L_y' = cot(angle / 2) / sqrt(2 R) on a cycloid, which must be minus the derivative of the cost
    rate = 0.3
    angle, radius = (
        float(v)
        for v in mp.findroot(lambda t, r: [r * (t - mp.sin(t)) - 1, mp.cot(t / 2) / mp.sqrt(2 * r) + rate], (3.5, 0.3))
    )
    depth = radius * (1 - math.cos(angle))
    problem = vc.Problem(quickest, vc.Fixed(0, 0), end, end_cost=lambda x0, y0, x1, y1: rate * y1)
    solution = assert_solved(problem, angle * math.sqrt(2 * radius) + rate * depth, 1e-12)
    assert solution.y(1.0) == pytest.approx(depth, abs=1e-6)


@pytest.mark.parametrize("maximise", [False, True])
@pytest.mark.parametrize(("weight", "turns"), [(0.3, False), (-0.2, False), (0.3, True), (-0.2, True)])
def test_a_descent_of_given_length(weight: float, turns: bool, maximise: bool) -> None:
    across, depth, way, time = steered(weight, 0.6, turns)
    sign = -1.0 if maximise else 1.0
    problem = vc.Problem(
        lambda x, y, dy: sign * quickest(x, y, dy), vc.Fixed(0, 0), vc.Fixed(across, depth),
        [vc.Isoperimetric(length, way)], maximise=maximise,
    )  # fmt: skip
    solution = assert_solved(problem, sign * time)
    assert solution.multipliers[0] == pytest.approx(-sign * weight, abs=1e-4)


def test_a_weight_that_jumps_on_the_way_down() -> None:
    # L_y' is continuous where the weight doubles: 1 / y - 1 / 2R is the square of L_y' over the weight
    momentum = 1 / math.tan(ANGLE / 2) / math.sqrt(2 * RADIUS)
    radius = 0.5 / (1 / CORNER[1] - (momentum / 2) ** 2)
    across, depth, pace = following_arc(radius)
    problem = vc.Problem(
        lambda x, y, dy: ca.if_else(x < CORNER[0], 1, 2) * quickest(x, y, dy),
        vc.Fixed(0, 0), vc.Fixed(across, depth), breakpoints=[CORNER[0]],
    )  # fmt: skip
    solution = assert_solved(problem, first_time() + 2 * pace)
    assert solution.y(CORNER[0]) == pytest.approx(CORNER[1], abs=1e-6)


def test_a_descent_through_a_point() -> None:
    across, depth, pace = following_arc(0.7)
    ends = vc.Fixed(0, 0), vc.Fixed(across, depth)
    solution = assert_solved(vc.Problem(quickest, *ends, [vc.Through(*CORNER)]), first_time() + pace)
    assert solution.y(CORNER[0]) == pytest.approx(CORNER[1], abs=1e-12)


@pytest.mark.parametrize(("start", "end"), [((0, 0), (1, 1)), ((0, 1), (1, 0))], ids=["at the start", "at the end"])
def test_a_bound_that_is_never_touched(start: tuple[float, float], end: tuple[float, float]) -> None:
    wide = vc.Bound(lambda x, y, dy: y, upper=2)
    assert_solved(vc.Problem(quickest, vc.Fixed(*start), vc.Fixed(*end), [wide]), descent(1, 1))


@pytest.mark.parametrize("power", [1 / 4, 1 / 3, 1 / 2, 3 / 5])
def test_breakpoints_change_nothing_where_nothing_jumps(power: float) -> None:
    def lagrangian(x: Any, y: Any, dy: Any) -> Any:
        return ca.sqrt(1 + dy**2) * y**-power

    # half an arch: y^-k / sqrt(1 + y'^2) = 1 from rest to depth 1
    with mp.workdps(30):
        k = mp.mpf(power)
        across = float(mp.quad(lambda t: mp.sin(t) ** (1 / k), [0, mp.pi / 2]) / k)
        value = float(mp.quad(lambda t: mp.sin(t) ** (1 / k - 2), [0, mp.pi / 2]) / k)
    assert_solved(vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(across, 1), breakpoints=[0.3 * across]), value)


def test_breakpoints_where_the_lagrangian_is_singular_in_x_or_along_a_tilted_line() -> None:
    swapped = vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + dy**2) / x), vc.Fixed(0, 0), vc.Fixed(1, 1), breakpoints=[0.3]
    )  # fmt: skip
    assert_solved(swapped, descent(1, 1))
    sine, cosine = math.sin(0.3), math.cos(0.3)
    tilted = vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + dy**2) / (x * sine + y * cosine)),
        vc.Fixed(0, 0), vc.Fixed(cosine + sine, cosine - sine), breakpoints=[0.3],
    )  # fmt: skip
    assert_solved(tilted, descent(1, 1))


def test_breakpoints_between_two_singular_ends() -> None:
    problem = vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(1, 0), breakpoints=[0.3])
    assert_solved(problem, 2 * math.sqrt(math.pi))


@pytest.mark.parametrize("last", [[3, 1], [3, None]])
def test_a_descent_in_space(last: list[float | None]) -> None:
    # the plane through the ends is turned: 5 = |(4, 3)| across
    problem = vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + ca.sumsqr(dy)) / y[1]), vc.Fixed(0, [0, 0]), vc.Fixed(4, last)
    )  # fmt: skip
    exact = descent(5, 1) if last[1] else math.sqrt(2 * math.pi * 5)
    solution = assert_solved(problem, exact)
    at = np.linspace(0.3, 3.9, 7)
    assert solution.y(at)[0] == pytest.approx(0.75 * at, abs=1e-5)


def test_waypoints_and_levels_of_a_lagrangian_that_is_no_metric() -> None:
    free = vc.solve(vc.Problem(braked, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    ends = vc.Fixed(0, 0), vc.Fixed(1, 1)
    # a waypoint on the extremal costs nothing
    assert_solved(vc.Problem(braked, *ends, [vc.Through(0.4, float(free.y(0.4)))]), free.value)
    assert_solved(vc.Problem(braked, *ends, breakpoints=[0.4]), free.value)


@pytest.mark.parametrize("power", [0.3, 0.5, 0.75])
def test_a_weight_that_vanishes_at_both_ends(power: float) -> None:
    # (x (1 - x))^s y' = c, with c B(1 - s, 1 - s) = 1, is also the value
    problem = vc.Problem(lambda x, y, dy: (x * (1 - x)) ** power * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = assert_solved(problem, float(1 / mp.beta(1 - power, 1 - power)), 1e-12)
    assert solution.y(0.5) == pytest.approx(0.5, abs=1e-8)
    assert solution.y(0.1) == pytest.approx(float(mp.betainc(1 - power, 1 - power, 0, 0.1, regularized=True)), abs=1e-7)


@pytest.mark.parametrize(
    "problem",
    [
        vc.Problem(lambda x, y, dy, ddy: ddy**2 + 1 / ca.sqrt(y), vc.Fixed(0, 0, 1), vc.Fixed(1, 1, 0), order=2),
        vc.Curve(lambda q, dq: ca.norm_2(dq) / ca.sqrt(q[1]), vc.At((0, 0, 0)), vc.At((1, 1, 0))),
    ],
    ids=["second order", "in space"],
)
def test_what_cannot_be_served_is_refused_with_its_reason(problem: Any) -> None:
    with pytest.raises(vc.VariationalError, match="infinite at the start, and") as caught:
        vc.solve(problem)
    assert caught.value.status is vc.Status.REFUSED
    assert caught.value.solution.stats.iterations == 0
