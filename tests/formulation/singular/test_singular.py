"""Singular ends: what is detected, and the quickest descents held against their cycloids."""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.special import beta

import varcalc as vc
from varcalc.formulation.singular import Infinite, forms
from varcalc.formulation.singular.detection import (
    Survey,
    almost_singular_ends,
    blowup,
    blowup_beyond,
    rational,
    singular_ends,
)
from varcalc.problems._curves import Cycloid


def quickest(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt((1 + dy**2) / y)


def quickest_speed(q: Any, dq: Any) -> Any:
    return ca.norm_2(dq) / ca.sqrt(q[1])


def cycloid(across: float, depth: float) -> tuple[float, float, float]:
    """Radius, last angle and time of the cycloid from rest at the origin, L = sqrt((1 + y'^2) / y)."""
    with mp.workdps(30):
        if depth == 0:
            angle = 2 * mp.pi
            radius = mp.mpf(across) / angle
        else:

            def miss(t: Any) -> Any:
                return (t - mp.sin(t)) / (1 - mp.cos(t)) - mp.mpf(across) / depth

            angle = mp.findroot(miss, (mp.mpf("1e-3"), 2 * mp.pi - mp.mpf("1e-2")), solver="anderson", tol=1e-25)
            radius = mp.mpf(depth) / (1 - mp.cos(angle))
        return float(radius), float(angle), float(angle * mp.sqrt(2 * radius))


def descent_time(across: float, depth: float) -> float:
    return cycloid(across, depth)[2]


def half_arch(power: float) -> tuple[float, float]:
    """Depth and value of half an arch of L = y^-k sqrt(1 + y'^2) half a unit wide: y^-k / sqrt(1 + y'^2) = const."""
    depth = power / float(beta(0.5 + 0.5 / power, 0.5))
    return depth, depth ** (1 - power) * float(beta(0.5 / power - 0.5, 0.5)) / (2 * power)


def assert_solved(problem: vc.Problem | vc.Curve, exact: float) -> vc.Solution:
    """Solved at 1e-12, and the claim holds."""
    solution = vc.solve(problem, tol=1e-12)
    assert solution.status is vc.Status.SOLVED
    error = abs(solution.value - exact)
    assert error <= 1e-12 * max(1.0, abs(exact))
    assert solution.error.value >= 0.1 * error or error <= 1e-13 * max(1.0, abs(exact))
    assert solution.error.value <= 1e-12 * max(1.0, abs(exact))
    return solution


# detection


def test_the_metric_of_a_descent_is_conformal() -> None:
    metric = Survey(vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(1, 1))).metric
    assert metric is not None
    q, dq = ca.SX.sym("q", 2), ca.SX.sym("dq", 2)
    square = ca.Function("square", [q, dq], [metric.square(q, dq, ca.SX(0, 1))])
    for q, dq in (((0.3, 0.7), (0.4, -2.0)), ((0.9, 2.0), (-1.0, 0.5))):
        assert float(square(q, dq)) == pytest.approx((dq[0] ** 2 + dq[1] ** 2) / q[1], rel=1e-14)
    # what is conformal is written so: the velocity enters by its square alone, also where dq[0] = 0
    assert float(square((0.3, 0.7), (0.0, 1.0))) == pytest.approx(1 / 0.7, rel=1e-14)


def test_a_riemannian_metric_that_is_not_conformal() -> None:
    def length(x: Any, y: Any, dy: Any) -> Any:
        return ca.sqrt(2 + 0.6 * dy + (1 + y**2) * dy**2)

    metric = Survey(vc.Problem(length, vc.Fixed(0, 0), vc.Fixed(1, 1))).metric
    assert metric is not None
    q, dq = ca.SX.sym("q", 2), ca.SX.sym("dq", 2)
    square = ca.Function("square", [q, dq], [metric.square(q, dq, ca.SX(0, 1))])
    expected = 2 * 0.25 + 0.6 * 0.5 * -2 + (1 + 0.49) * 4
    assert float(square((0.3, 0.7), (0.5, -2.0))) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, dy: dy**2 + y**2,
        lambda x, y, dy: ca.sqrt((1 + dy**2) / (1 + y**2)) + 0.3 * dy**2,
        lambda x, y, dy: (1 + dy**4) ** 0.25,
        lambda x, y, dy: y * ca.sqrt(1 + dy**2),  # a metric, but for its sign
    ],
)
def test_what_is_no_metric(lagrangian: Callable[..., Any]) -> None:
    problem = vc.Problem(lagrangian, vc.Fixed(0, -1), vc.Fixed(1, 1))
    assert Survey(problem).metric is None
    assert not any(form is not None and form.coordinates.energetic for form in forms(problem))


def test_a_lagrangian_that_changes_sign_is_not_solved_by_its_square() -> None:
    # y sqrt(1 + y'^2) through y = 0 has no lower bound
    problem = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, -1), vc.Fixed(1, 1))
    assert not vc.solve(problem, throw=False).status.ok


@pytest.mark.parametrize(
    ("end", "singular"), [((1, 1), (True, False)), ((1, 0), (True, True)), ((0.2, 3), (True, False))]
)
def test_singular_ends(end: tuple[float, float], singular: tuple[bool, bool]) -> None:
    problem = vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(*end))
    assert singular_ends(problem) == singular
    first = forms(problem)[0]
    assert first is not None
    assert first.coordinates.energetic
    assert first.coordinates.singular == singular


def test_regular_ends_keep_the_persons_coordinates() -> None:
    problem = vc.Problem(quickest, vc.Fixed(0, 1), vc.Fixed(1, 2))
    assert singular_ends(problem) == (False, False)
    assert forms(problem)[0].lifted is None


@pytest.mark.parametrize("power", [1 / 4, 1 / 3, 1 / 2, 3 / 5, 2 / 3, 3 / 4, 4 / 5, 0.9])
def test_the_power_and_the_normal_of_a_tilted_singular_line(power: float) -> None:
    tilt = 0.6
    problem = vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + dy**2) * (x * math.sin(tilt) + y * math.cos(tilt)) ** -power,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
    )
    found = blowup(problem, True)
    assert found is not None
    # 9/10 is no fraction of small denominator: it is as good as it was measured
    assert found.power == pytest.approx(power, rel=1e-13 if power != 0.9 else 1e-6)
    assert found.normal == pytest.approx([math.sin(tilt), math.cos(tilt)], abs=1e-7)


def test_the_chart_between_parallel_singular_lines() -> None:
    # L^2 = (1 + v^2) / (y (1 - y)): y = sin(w)^2 makes the metric 4 dw^2 + dx^2 / (sin w cos w)^2 regular across
    problem = vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / (y * (1 - y))), vc.Fixed(0, 0), vc.Fixed(1, 1))
    assert singular_ends(problem) == (True, True)
    form = forms(problem)[0]
    assert form.coordinates.energetic
    lift = form.lift
    assert lift is not None
    x, y, _, _ = lift.function(0.5, [0.3, math.pi / 6], [0, 0], [], [])
    assert (abs(float(x)), float(y)) == pytest.approx((0.3, 0.25), abs=1e-15)


@pytest.mark.parametrize(("value", "expected"), [(0.4999999, 0.5), (0.6666, 2 / 3), (0.9, 0.9), (0.23, 0.23)])
def test_measured_powers_become_fractions(value: float, expected: float) -> None:
    assert rational(value) == expected


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_a_functional_that_is_infinite(power: float) -> None:
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) * y**-power, vc.Fixed(0, 0), vc.Fixed(1, 1))
    with pytest.raises(Infinite, match="infinite for every curve"):
        forms(problem)
    with pytest.raises(vc.VariationalError, match="at the start, so the functional is infinite") as caught:
        vc.solve(problem)
    assert caught.value.status is vc.Status.REFUSED
    assert caught.value.verdict is vc.Verdict.INFEASIBLE


# quickest descent


@pytest.mark.parametrize("end", [(1, 1), (5, 1), (1, 0), (0.2, 3), (20, 1)])
def test_quickest_descent(end: tuple[float, float]) -> None:
    radius, last, time = cycloid(*end)
    solution = assert_solved(vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(*end)), time)
    angle = np.linspace(0, last, 52)[1:-1]
    x, y = radius * (angle - np.sin(angle)), radius * (1 - np.cos(angle))
    error = np.abs(solution.y(x) - y).max()
    # the value is stationary: the curve needs half its digits
    assert error < 2e-8 * end[0]
    assert solution.error.curve >= 0.1 * error or error < 1e-12
    middle = slice(10, -10)
    assert solution.dy(x)[middle] == pytest.approx(1 / np.tan(angle / 2)[middle], abs=1e-6)
    assert solution.y(0.0) == 0.0
    assert solution.dy(0.0) == math.inf
    if end[1] == 0:
        assert solution.dy(float(end[0])) == -math.inf


def test_descent_with_gravity_of_9_81() -> None:
    problem = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81}
    )
    solution = assert_solved(problem, descent_time(1, 1) / math.sqrt(2 * 9.81))
    # T is proportional to g^(-1/2)
    assert solution.sensitivities["g"] == pytest.approx(-solution.value / (2 * 9.81), rel=1e-10)


@pytest.mark.parametrize(
    ("lagrangian", "start", "end", "descent"),
    [
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / -y), (0, 0), (1, -1), (1, 1)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / (y - 3)), (-7, 3), (-6, 4), (1, 1)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / x), (0, 0), (1, 1), (1, 1)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / x), (0, 0), (3, 0.2), (0.2, 3)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / x), (0, 2), (1, 1), (1, 1)),
        (quickest, (0, 1), (1, 0), (1, 1)),
        (quickest, (0, 1), (5, 0), (5, 1)),
        (lambda x, y, dy: ca.sqrt((1 + dy**2) / (1 - x)), (0, 1), (1, 0), (1, 1)),
        (lambda x, y, dy: np.sqrt((1 + dy**2) / y), (0, 0), (1, 1), (1, 1)),
    ],
    ids=[
        "upward",
        "shifted",
        "swapped",
        "swapped-steep",
        "swapped-down",
        "reversed",
        "reversed-beyond",
        "both",
        "numpy",
    ],
)
def test_descent_in_other_coordinates(
    lagrangian: Callable[..., Any], start: tuple[float, float], end: tuple[float, float], descent: tuple[float, float]
) -> None:
    assert_solved(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end)), descent_time(*descent))


def tilted(tilt: float, across: float, depth: float) -> vc.Problem:
    """The descent in axes turned by ``tilt`` > 0: the cycloid is a graph there up to its angle 2 (pi - tilt)."""
    sine, cosine = math.sin(tilt), math.cos(tilt)
    end = vc.Fixed(across * cosine + depth * sine, depth * cosine - across * sine)
    return vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / (x * sine + y * cosine)), vc.Fixed(0, 0), end)


@pytest.mark.parametrize("case", [(0.3, 1, 1), (0.3, 2, 0.7), (math.pi / 4, 1, 1), (math.pi / 4, 2, 0.7), (1.2, 1, 1)])
def test_tilted_descent(case: tuple[float, float, float]) -> None:
    assert cycloid(*case[1:])[1] < 2 * (math.pi - case[0])
    assert_solved(tilted(*case), descent_time(*case[1:]))


@pytest.mark.parametrize("end", [vc.Free(1), vc.OnCurve(lambda x, y: x - 1, 1.2)], ids=["free", "on a vertical line"])
def test_quickest_descent_to_a_wall(end: Any) -> None:
    # T = sqrt(pi X / g), with 2 g = 1 here; the cycloid meets the wall at right angles
    solution = assert_solved(vc.Problem(quickest, vc.Fixed(0, 0), end), math.sqrt(2 * math.pi))
    assert solution.y(1.0) == pytest.approx(2 / math.pi, abs=1e-6)
    assert solution.dy(1.0) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("end", [(1, 1), (1, 0.1), (1, 0), (0.2, 3)])
def test_quickest_descent_as_a_curve(end: tuple[float, float]) -> None:
    radius, last, time = cycloid(*end)
    solution = assert_solved(vc.Curve(quickest_speed, vc.At((0, 0)), vc.At(end)), time)
    x, y = solution.q(np.linspace(0, 1, 23)[1:-1])
    angle = np.arccos(np.clip(1 - y / radius, -1, 1))
    before = radius * (angle - np.sin(angle))
    # on the cycloid, before or beyond its lowest point
    off = np.minimum(np.abs(x - before), np.abs(x - (2 * math.pi * radius - before)))
    assert off[np.abs(angle - math.pi) > 0.2].max() < 1e-6
    assert 0 < last <= 2 * math.pi


@pytest.mark.parametrize("power", [1 / 4, 1 / 3, 1 / 2, 3 / 5, 2 / 3, 3 / 4, 4 / 5, 0.9])
@pytest.mark.parametrize("free", [False, True])
def test_other_powers(power: float, free: bool) -> None:
    depth, value = half_arch(power)

    def lagrangian(x: Any, y: Any, dy: Any) -> Any:
        return ca.sqrt(1 + dy**2) * y**-power

    end = vc.Free(0.5) if free else vc.Fixed(0.5, depth)
    solution = assert_solved(vc.Problem(lagrangian, vc.Fixed(0, 0), end), value)
    assert solution.y(0.5) == pytest.approx(depth, abs=1e-6)


@pytest.mark.parametrize("power", [1 / 3, 1 / 2, 2 / 3])
def test_whole_arches(power: float) -> None:
    assert_solved(
        vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) * y**-power, vc.Fixed(0, 0), vc.Fixed(1, 0)),
        2 * half_arch(power)[1],
    )


def braked_descent(weight: float) -> float:
    """The least value of sqrt((1 + v^2) / y) + weight v^2 from (0, 0) to (1, 1), in 30 digits.

    The first integral 1 / sqrt(y (1 + v^2)) - weight v^2 = c gives y as a rational function
    of u = 1/v; x and the value are integrals over u of smooth functions.
    """
    with mp.workdps(30):

        def y(u: Any, c: Any) -> Any:
            return u**6 / ((1 + u**2) * (c * u**2 + weight) ** 2)

        def rate(u: Any, c: Any) -> Any:
            return y(u, c) * (6 / u - 2 * u / (1 + u**2) - 4 * c * u / (c * u**2 + weight))

        def lagrangian(u: Any, c: Any) -> Any:
            return mp.sqrt((1 + u**-2) / y(u, c)) + weight / u**2

        def misses(c: Any, last: Any) -> list[Any]:
            return [y(last, c) - 1, mp.quad(lambda u: rate(u, c) * u, [0, last]) - 1]

        c, last = mp.findroot(misses, (0.5, 1.5))
        return float(mp.quad(lambda u: lagrangian(u, c) * rate(u, c) * u, [0, last]))


@pytest.mark.parametrize("weight", [0.3, 0.1])
def test_a_singular_lagrangian_that_is_no_metric(weight: float) -> None:
    problem = vc.Problem(lambda x, y, dy: quickest(x, y, dy) + weight * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    assert Survey(problem).metric is None
    assert_solved(problem, braked_descent(weight))


def test_a_circle_that_is_no_graph_is_refused() -> None:
    # in the half-plane x > 0 the shortest way from (1, 0) to (1.1, 3) is an arc that bulges beyond x = 1.1
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) / x, vc.Fixed(1, 0), vc.Fixed(1.1, 3))
    with pytest.raises(vc.VariationalError, match="no graph") as caught:
        vc.solve(problem)
    assert caught.value.verdict is vc.Verdict.NOT_ATTAINED


@pytest.mark.parametrize("case", [(-0.4, 1, 1), (1.2, 2, 0.7)], ids=["starts backward", "ends backward"])
def test_a_descent_that_is_no_graph_is_refused(case: tuple[float, float, float]) -> None:
    with pytest.raises(vc.VariationalError, match="no graph") as caught:
        vc.solve(tilted(*case))
    assert caught.value.verdict is vc.Verdict.NOT_ATTAINED


def test_a_singular_curve_to_a_surface() -> None:
    wall = vc.OnSurface(lambda q: q[0] - 1, (1, 0.5))
    assert_solved(vc.Curve(quickest_speed, vc.At((0, 0)), wall), math.sqrt(2 * math.pi))


# lines just beyond an end


def arc(power: float, start: float) -> tuple[float, float]:
    """Width and value of the extremal of y^-k sqrt(1 + y'^2) from depth ``start`` to its lowest point, at depth 1.

    y^-k = sqrt(1 + y'^2) makes both integrals over t, y^k = sin t.
    """
    with mp.workdps(30):
        k, first = mp.mpf(power), mp.asin(mp.mpf(start) ** power)
        stops = [first, *(first * 10**j for j in range(1, 15) if first * 10**j < 1.5), mp.pi / 2]
        width = mp.quad(lambda t: mp.sin(t) ** (1 / k), stops) / k
        return float(width), float(mp.quad(lambda t: mp.sin(t) ** (1 / k - 2), stops) / k)


NEAR_STARTS = [1e-3, 1e-6, 1e-8, 1e-10, 1e-12]


@pytest.mark.parametrize("start", NEAR_STARTS)
@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.FirstIntegral()], ids=["ladder", "Ritz", "FirstIntegral"])
def test_a_start_just_below_the_line_of_rest(start: float, method: Any) -> None:
    width, value = arc(0.5, start)
    solution = vc.solve(vc.Problem(quickest, vc.Fixed(0, start), vc.Fixed(width, 1)), method, tol=1e-12)
    assert solution.status is vc.Status.SOLVED
    assert solution.value == pytest.approx(value, rel=4e-15)
    assert solution.error.value >= 0.1 * abs(solution.value - value) or solution.error.value > 1e-15
    # sin(t) = sqrt(y), x = t - sin(t) cos(t) counted from the line of rest: the cycloid
    t = np.linspace(math.asin(math.sqrt(start)), math.pi / 2, 12)[1:-1]
    x = t - np.sin(t) * np.cos(t)
    assert solution.y(x - (math.pi / 2 - width)) == pytest.approx(np.sin(t) ** 2, abs=1e-6)


@pytest.mark.parametrize("start", [1e-4, 1e-8])
@pytest.mark.parametrize("power", [1 / 4, 1 / 3, 3 / 5, 2 / 3, 3 / 4, 4 / 5])
def test_other_powers_just_beyond_an_end(power: float, start: float) -> None:
    width, value = arc(power, start)
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) * y**-power, vc.Fixed(0, start), vc.Fixed(width, 1))
    found = blowup_beyond(problem, True)
    assert found is not None
    assert found.power == pytest.approx(power, rel=1e-13)
    assert found.origin == pytest.approx([0, 0], abs=1e-6 * start)
    solution = vc.solve(problem)
    assert solution.status is vc.Status.SOLVED
    assert abs(solution.value - value) <= min(1e-10 * value, 2 * solution.error.value + 4e-15)
    assert abs(vc.solve(problem, vc.FirstIntegral()).value - value) < 1e-13 * value


@pytest.mark.parametrize("start", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize(
    "place",
    [
        lambda w, d: vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / x), vc.Fixed(d, 0), vc.Fixed(1, w)),
        lambda w, d: vc.Problem(quickest, vc.Fixed(0, 1), vc.Fixed(w, d)),
        lambda w, d: vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / -y), vc.Fixed(0, -d), vc.Fixed(w, -1)),
        lambda w, d: vc.Problem(quickest, vc.Fixed(0, d), vc.Free(w)),
        lambda w, d: vc.Curve(quickest_speed, vc.At((0, d)), vc.At((w, 1))),
    ],
    ids=["in x", "reversed", "upward", "free", "curve"],
)
def test_lines_beyond_ends_of_every_kind(place: Callable[[float, float], Any], start: float) -> None:
    width, value = arc(0.5, start)
    assert_solved(place(width, start), value)


@pytest.mark.parametrize("start", [1e-4, 1e-8])
def test_lines_beyond_both_ends(start: float) -> None:
    width, value = arc(0.5, start)
    problem = vc.Problem(quickest, vc.Fixed(0, start), vc.Fixed(2 * width, start))
    assert almost_singular_ends(problem) == (True, True)
    assert_solved(problem, 2 * value)
    # one end at rest, the other almost
    at_rest, whole = math.pi / 2, math.pi
    assert_solved(vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(width + at_rest, start)), value + whole)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, dy: ca.sqrt(1 + dy**2) / y,  # infinitely far
        lambda x, y, dy: ca.sqrt(1 + dy**2) / y**2,
        lambda x, y, dy: ca.sqrt(1 + dy**2) * y,  # no cost at all
        lambda x, y, dy: ca.sqrt(1 + dy**2) * (1 + ca.exp(-y / 1e-3)),  # steep, but finite everywhere
        lambda x, y, dy: ca.sqrt((1 + dy**2) / ca.sqrt(x**2 + y**2)),  # a point, no line
    ],
)
def test_what_is_no_line_of_finite_cost(lagrangian: Callable[..., Any]) -> None:
    assert blowup_beyond(vc.Problem(lagrangian, vc.Fixed(0, 1e-3), vc.Fixed(1, 1)), True) is None


def test_regular_metrics_are_not_taken_to_be_almost_singular() -> None:
    for lagrangian in (lambda x, y, dy: y * ca.sqrt(1 + dy**2), lambda x, y, dy: ca.sqrt(1 + dy**2) / y):
        problem = vc.Problem(lagrangian, vc.Fixed(0, 1), vc.Fixed(1, 2))
        assert almost_singular_ends(problem) == (False, False)
        assert forms(problem)[0].lift is None


def test_a_form_is_made_once_for_all_parameter_values_with_its_chart():
    def travel_time(x, y, dy, p):
        return ca.sqrt((1 + dy**2) / (2 * p.g * y))

    fall = vc.Problem(travel_time, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81})
    moon = fall.with_parameters({"g": 1.62})
    assert forms(moon)[0].problem is moon
    assert forms(moon)[0].cache is forms(fall)[0].cache


@pytest.mark.parametrize("exponent", [0.25, 0.5, 0.0, -1.0])
def test_parameter_values_with_other_charts_have_forms_of_their_own(exponent):
    def weighted(x, y, dy, p):
        return ca.sqrt(1 + dy**2) * y ** (-p.k)

    family = vc.Problem(weighted, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 0.4})
    vc.solve(family, tol=1e-9)
    alone = vc.Problem(weighted, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": exponent})
    known, fresh = (vc.solve(p, tol=1e-9, throw=False) for p in (family.with_parameters({"k": exponent}), alone))
    assert known.status is fresh.status
    if fresh.status.ok:
        assert known.value == pytest.approx(fresh.value, rel=1e-12)


@pytest.mark.parametrize("method", [None, vc.Collocation()], ids=["ladder", "Collocation"])
@pytest.mark.parametrize("size", [1e-6, 1e3, 1e6])
@pytest.mark.parametrize("across", [1, 5])
def test_a_fall_has_no_size_of_its_own(across, size, method):
    # times grow with the square root of all lengths
    fall = vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / y), vc.Fixed(0, 0), vc.Fixed(across * size, size))
    exact = Cycloid.through(across, 1).descent_time(0.5) * size**0.5
    assert vc.solve(fall, method).value == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("unit", [1e-8, 1e-4, 1.0, 1e4])
def test_what_is_no_length_is_taken_for_one_in_no_units(unit):
    """(k y')^2 + |k y|: where the slopes that are tried make next to nothing of it, its square looks quadratic."""
    ends = vc.Fixed(0, 1 / unit), vc.Fixed(4, 1 / unit)
    square = vc.Problem(lambda x, y, v: (unit * v) ** 2 + ca.fabs(unit * y), *ends)
    length = vc.Problem(lambda x, y, v: (2 + ca.fabs(unit * y)) * ca.sqrt(1 + (unit * v) ** 2), *ends)
    assert Survey(square).metric is None
    assert Survey(length).metric is not None
