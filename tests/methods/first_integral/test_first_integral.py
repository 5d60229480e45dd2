"""FirstIntegral against closed forms, evaluated here."""

import math
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc.formulation import formulate
from varcalc.methods.first_integral.method import FirstIntegral
from varcalc.problem.conditions import Bound, Fixed, Free, Isoperimetric, OnCurve, Periodic
from varcalc.problem.problem import Problem
from varcalc.solution import Solution, Status

ROUND_OFF = 1e-13


def solve(problem: Problem, tol: float = 1e-12) -> Solution:
    return FirstIntegral().solve(formulate(problem), tol=tol, guess=None)


def given(lagrangian: Callable[..., Any], start: Any, end: Any, **options: Any) -> Solution:
    return solve(Problem(lagrangian, start, end, **options))


def assert_value(solution: Solution, exact: float) -> None:
    """Solved, to double precision, with a claim that is honest and sharp."""
    size = max(1.0, abs(exact))
    error = abs(solution.value - exact) / size
    assert solution.status is Status.SOLVED, solution.message
    assert error < 2e-13
    assert solution.error.value / size >= 0.1 * error or error < ROUND_OFF
    assert solution.error.value / size < 1e-12


def assert_curve(solution: Solution, exact: Callable[[np.ndarray], Any], slope: Callable[[np.ndarray], Any]) -> None:
    a, b = solution.problem.span  # type: ignore[attr-defined]
    x = np.linspace(a, b, 203)[1:-1]
    size = float(np.abs(exact(x)).max())
    error = float(np.abs(solution.y(x) - exact(x)).max())
    assert error < 2e-12 * max(1.0, size)
    assert solution.error.curve >= 0.1 * error or error < ROUND_OFF * size
    assert solution.dy(x) == pytest.approx(slope(x), rel=1e-10, abs=1e-11)


# brachistochrone: y downward, L = sqrt((1 + y'^2) / y)


def quickest(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt((1 + dy**2) / y)


def cycloid(x: float, y: float) -> tuple[float, float]:
    """Radius and last angle of the cycloid from the origin to (x, y), to 30 digits (Gelfand and Fomin, sect. 4)."""
    with mp.workdps(30):
        if y == 0:
            return float(x / (2 * mp.pi)), 2 * math.pi

        def miss(t: Any) -> Any:
            return (t - mp.sin(t)) / (1 - mp.cos(t)) - mp.mpf(x) / y

        theta = mp.findroot(miss, (mp.mpf("1e-3"), 2 * mp.pi - mp.mpf("1e-2")), solver="anderson", tol=1e-25)
        return float(y / (1 - mp.cos(theta))), float(theta)


ENDS = [(1, 1), (5, 1), (1, 0), (0.2, 3), (20, 1), (1, 2 / math.pi), (1, 0.636)]


@pytest.mark.parametrize(("x", "y"), ENDS)
def test_brachistochrone(x: float, y: float) -> None:
    radius, theta = cycloid(x, y)
    solution = given(quickest, Fixed(0, 0), Fixed(x, y))
    assert_value(solution, math.sqrt(2 * radius) * theta)
    angles = np.linspace(0.0, theta, 101)[1:-1]
    at = radius * (angles - np.sin(angles))
    error = np.abs(solution.y(at) - radius * (1 - np.cos(angles)))
    # y itself moves by dy/dx times the rounding of the abscissa
    slope = np.abs(np.sin(angles) / (1 - np.cos(angles)))
    assert np.all(error < 2e-12 * max(1.0, 2 * radius) + 4e-16 * slope * at)


VARIANTS = {
    "upward": (lambda x, y, dy: ca.sqrt((1 + dy**2) / -y), (0, 0), (1, -1)),
    "backward": (lambda x, y, dy: ca.sqrt((1 + dy**2) / y), (0, 1), (1, 0)),
    "shifted": (lambda x, y, dy: ca.sqrt((1 + dy**2) / (3 - y)), (0, 3), (1, 2)),
    "axes swapped": (lambda x, y, dy: ca.sqrt((1 + dy**2) / x), (0, 0), (1, 1)),
    "axes swapped, backward": (lambda x, y, dy: ca.sqrt((1 + dy**2) / (2 - x)), (1, 0), (2, 1)),
    "axes swapped, downward": (lambda x, y, dy: ca.sqrt((1 + dy**2) / (x - 7)), (7, 0), (8, -1)),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_brachistochrone_however_it_is_laid(name: str) -> None:
    lagrangian, start, end = VARIANTS[name]
    radius, theta = cycloid(1, 1)
    assert_value(given(lagrangian, Fixed(*start), Fixed(*end)), math.sqrt(2 * radius) * theta)


def power_law(s: float) -> float:
    """The value for L = y^-s sqrt(1 + y'^2) from (0, 0) to (1, 1): with u the angle from the vertical y^s ~ sin(u)."""
    with mp.workdps(25):
        k = 1 / mp.mpf(s)

        def reach(last: Any) -> Any:
            return k * mp.sin(last) ** -k * mp.quad(lambda u: mp.sin(u) ** k, [0, last])

        last = mp.findroot(lambda u: reach(u) - 1, (mp.mpf("0.2"), mp.pi / 2), solver="anderson", tol=1e-20)
        return float(
            k * mp.sin(last) ** (1 - k) * mp.quad(lambda w: mp.sin(w**3) ** (k - 2) * 3 * w**2, [0, mp.cbrt(last)])
        )


@pytest.mark.parametrize("s", [1 / 4, 1 / 3, 3 / 4])
def test_other_powers_that_leave_the_value_finite(s: float) -> None:
    def slow(x: Any, y: Any, dy: Any) -> Any:
        return (y - 1) ** (-s) * ca.sqrt(1 + dy**2)

    solution = given(slow, Fixed(0, 1), Fixed(1, 2))
    assert solution.value == pytest.approx(power_law(s), rel=1e-12)
    assert solution.error.value < 1e-12


def test_a_power_that_leaves_the_value_infinite_is_no_answer() -> None:
    solution = given(lambda x, y, dy: ca.sqrt(1 + dy**2) / y, Fixed(0, 0), Fixed(1, 1))
    assert not solution.status.ok
    assert solution.error.value == math.inf


def test_a_singular_end_that_is_not_conformal() -> None:
    # y = x^2: the extremals of v^2/(2 y) are parabolas, the one from the origin with its vertex there
    solution = given(lambda x, y, dy: dy**2 / (2 * y), Fixed(0, 0), Fixed(1, 1))
    assert_value(solution, 2.0)
    assert_curve(solution, lambda x: x**2, lambda x: 2 * x)


# soap film


def film(x: Any, y: Any, dy: Any) -> Any:
    return y * ca.sqrt(1 + dy**2)


def necks(a: float) -> list[float]:
    """Every c with c cosh(a / c) = 1, thickest first."""
    with mp.workdps(30):
        fold = mp.findroot(lambda t: t * mp.tanh(t) - 1, mp.mpf("1.2"))

        def miss(t: Any) -> Any:
            return mp.log(mp.cosh(t)) - mp.log(t) + mp.log(a)

        brackets = [(mp.mpf(a), fold), (fold, mp.mpf(60))]
        return [float(a / mp.findroot(miss, b, solver="anderson", tol=1e-26)) for b in brackets]


def area(a: float, c: float) -> float:
    with mp.workdps(30):
        return float(c * (a + c * mp.sinh(2 * mp.mpf(a) / c) / 2))


@pytest.mark.parametrize("a", [0.1, 0.5, 0.6])
def test_soap_film(a: float) -> None:
    c = necks(a)[0]
    solution = given(film, Fixed(-a, 1), Fixed(a, 1))
    assert_value(solution, area(a, c))
    assert_curve(solution, lambda x: c * np.cosh(x / c), lambda x: np.sinh(x / c))


def critical() -> float:
    t = float(mp.findroot(lambda t: t * mp.tanh(t) - 1, mp.mpf("1.2")))
    return t / math.cosh(t)


def test_soap_film_next_to_the_fold() -> None:
    a = critical() - 1e-7
    solution = given(film, Fixed(-a, 1), Fixed(a, 1))
    assert_value(solution, area(a, necks(a)[0]))
    assert solution.y(0.0) == pytest.approx(necks(a)[0], abs=10 * solution.error.curve + 1e-12)
    assert solution.error.curve < 1e-9


def test_what_is_built_is_timed_apart() -> None:
    began = time.perf_counter()
    stats = given(film, Fixed(-0.5, 1), Fixed(0.5, 1)).stats
    assert 0 < stats.build < stats.solve
    assert stats.build + stats.solve <= time.perf_counter() - began


def test_both_catenaries_are_seen() -> None:
    from varcalc.methods.first_integral.method import EndValues, Stopwatch, reduction_of

    a = critical() - 1e-7
    problem = Problem(film, Fixed(-a, 1), Fixed(a, 1))
    ends = EndValues(-a, 1.0, a, 1.0)
    found = reduction_of(problem, ends, Stopwatch()).all_curves(ends)
    assert sorted(j.parameter for j in found) == pytest.approx(sorted(necks(a)), abs=1e-6)


def test_no_soap_film_beyond_the_fold() -> None:
    a = critical() + 1e-6
    solution = given(film, Fixed(-a, 1), Fixed(a, 1))
    assert solution.status is Status.NOT_CONVERGED
    assert "at most one turning point" in solution.message


# rays and geodesics


def test_linear_index_prefers_the_shorter_ray() -> None:
    # n^2 = 1 - 2 y, range 0.5 at the same height: launch at 15 degrees (see any parabola of safety)
    angle = math.asin(0.5) / 2
    solution = given(lambda x, y, dy: ca.sqrt(1 - 2 * y) * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(0.5, 0))
    cosine, sine = math.cos(angle), math.sin(angle)
    # n cos(phi) = cos(angle), so that n ds = (1 - 2 y) dx / cos(angle)
    exact = (0.5 - 0.5**2 * sine / cosine + 0.5**3 / (3 * cosine**2)) / cosine
    assert_value(solution, exact)
    assert_curve(
        solution,
        lambda x: x * sine / cosine - x**2 / (2 * cosine**2),
        lambda x: sine / cosine - x / cosine**2,
    )


def test_exponential_index() -> None:
    # n = exp(-y): exp(-y) cos(phi) is constant, so that phi = phi0 - x and y = log(cos(x - 1/2) / cos(1/2))
    solution = given(lambda x, y, dy: ca.exp(-y) * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 0))
    assert_value(solution, 2 * math.sin(0.5))
    assert_curve(solution, lambda x: np.log(np.cos(x - 0.5) / math.cos(0.5)), lambda x: -np.tan(x - 0.5))


@pytest.mark.parametrize("height", [0.1, 1e-3])
def test_half_plane(height: float) -> None:
    solution = given(lambda x, y, dy: ca.sqrt(1 + dy**2) / y, Fixed(0, height), Fixed(2, height))
    assert_value(solution, 2 * math.asinh(1 / height))
    assert_curve(
        solution,
        lambda x: np.sqrt(height**2 + x * (2 - x)),
        lambda x: (1 - x) / np.sqrt(height**2 + x * (2 - x)),
    )


def great_circle(t0: float, t1: float, angle: float) -> float:
    return math.acos(math.cos(t0) * math.cos(t1) + math.sin(t0) * math.sin(t1) * math.cos(angle))


@pytest.mark.parametrize(("t0", "t1", "angle"), [(0.5, 2.0, 1.0), (1.2, 1.4, 2.0), (0.5, 0.5, 1.0)])
def test_great_circle_from_either_side(t0: float, t1: float, angle: float) -> None:
    exact = great_circle(t0, t1, angle)
    over_angle = given(lambda x, y, dy: ca.sqrt(dy**2 + ca.sin(y) ** 2), Fixed(0, t0), Fixed(angle, t1))
    assert_value(over_angle, exact)
    if t0 == 0.5 and t1 == 2.0:
        over_latitude = given(lambda x, y, dy: ca.sqrt(1 + (ca.sin(x) * dy) ** 2), Fixed(t0, 0), Fixed(t1, angle))
        assert_value(over_latitude, exact)


def test_spheroid_geodesic_against_geographiclib() -> None:
    from geographiclib.geodesic import Geodesic

    exact = Geodesic.WGS84.Inverse(-20, 0, 30, 60)["s12"]
    a, f = Geodesic.WGS84.a, Geodesic.WGS84.f
    b = a * (1 - f)
    first, last = (math.atan((1 - f) * math.tan(math.radians(d))) for d in (-20, 30))
    turn = math.radians(60)

    def by_longitude(x: Any, y: Any, dy: Any) -> Any:
        meridian = (a * ca.sin(y)) ** 2 + (b * ca.cos(y)) ** 2
        return ca.sqrt(meridian * dy**2 + (a * ca.cos(y)) ** 2)

    def by_latitude(x: Any, y: Any, dy: Any) -> Any:
        return ca.sqrt((a * ca.sin(x)) ** 2 + (b * ca.cos(x)) ** 2 + (a * ca.cos(x) * dy) ** 2)

    assert given(by_longitude, Fixed(0, first), Fixed(turn, last)).value == pytest.approx(exact, rel=1e-14, abs=1e-7)
    assert given(by_latitude, Fixed(first, 0), Fixed(last, turn)).value == pytest.approx(exact, rel=1e-14, abs=1e-7)


def test_the_torus_keeps_clairaut() -> None:
    solution = given(lambda x, y, dy: ca.sqrt((2 + ca.cos(y)) ** 2 + dy**2), Fixed(0, 0.3), Fixed(1, 1))
    x = np.linspace(0, 1, 31)
    y, dy = solution.y(x), solution.dy(x)
    clairaut = (2 + np.cos(y)) ** 2 / np.sqrt((2 + np.cos(y)) ** 2 + dy**2)
    assert np.ptp(clairaut) < 1e-12
    assert solution.y(0.0) == pytest.approx(0.3, abs=1e-14)
    assert solution.y(1.0) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("end", [(3, 4), (3, 0), (1e-8, 1), (1e8, 1)])
def test_shortest_line(end: tuple[float, float]) -> None:
    solution = given(lambda x, y, dy: ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(*end))
    assert_value(solution, math.hypot(*end))
    slope = end[1] / end[0]
    assert solution.y(end[0] / 3) == pytest.approx(end[1] / 3, rel=1e-13)
    assert solution.dy(end[0] / 3) == pytest.approx(slope, rel=1e-12)


def test_a_jump_of_the_index_in_x() -> None:
    problem = Problem(
        lambda x, y, dy: ca.if_else(x < 0.4, 1.0, 1.5) * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 1), breakpoints=[0.4]
    )
    solution = solve(problem)
    with mp.workdps(25):  # Snell: c is n sin of the angle with the x axis
        c = mp.findroot(
            lambda c: mp.mpf("0.4") * c / mp.sqrt(1 - c**2) + mp.mpf("0.6") * c / mp.sqrt(mp.mpf("2.25") - c**2) - 1,
            (mp.mpf("0.5"), mp.mpf("0.95")),
            solver="anderson",
        )
        exact = mp.mpf("0.4") / mp.sqrt(1 - c**2) + mp.mpf("0.6") * mp.mpf("2.25") / mp.sqrt(mp.mpf("2.25") - c**2)
    assert_value(solution, float(exact))
    assert solution.dy(0.4 - 1e-9) / solution.dy(0.4 + 1e-9) > 1.5


# mechanics


def spring(x: Any, y: Any, dy: Any) -> Any:
    return (dy**2 - y**2) / 2


@pytest.mark.parametrize("duration", [0.5, 2.0, 4.0])
def test_oscillator(duration: float) -> None:
    solution = given(spring, Fixed(0, 0), Fixed(duration, 1))
    sine = math.sin(duration)
    assert_value(solution, math.cos(duration) / (2 * sine))
    assert_curve(solution, lambda x: np.sin(x) / sine, lambda x: np.cos(x) / sine)


def test_oscillator_with_no_extremal() -> None:
    assert not given(spring, Fixed(0, 0), Fixed(math.pi, 1)).status.ok


def test_pendulum_against_elliptic_functions() -> None:
    # from the bottom upward, through the turning point back to 1 radian: sin(y / 2) = k sn(x, k)
    duration = 4.0
    with mp.workdps(25):
        k = mp.findroot(lambda k: k * mp.ellipfun("sn", duration, k=k) - mp.sin(0.5), (0.85, 0.93), solver="anderson")
        half = float(mp.asin(k * mp.ellipfun("sn", duration / 2, k=k)) * 2)
    solution = given(lambda x, y, dy: dy**2 / 2 + ca.cos(y), Fixed(0, 0), Fixed(duration, 1))
    assert solution.status is Status.SOLVED
    assert solution.y(duration / 2) == pytest.approx(half, abs=1e-12)


def test_the_constant_is_an_extremal_only_where_the_euler_lagrange_equation_holds() -> None:
    rest = given(spring, Fixed(0, 0), Fixed(2, 0))
    assert (rest.value, rest.y(1.0), rest.dy(1.0)) == (0.0, 0.0, 0.0)
    # a horizontal line keeps L - y' L_y' constant, and is none
    dip = given(quickest, Fixed(0, 1), Fixed(1, 1))
    assert dip.value < 1.0
    assert dip.y(0.5) > 1.05


def test_legendre_bars_a_maximum_posing_as_a_minimum() -> None:
    # y = 0 is stationary for (1 - y'^2)^2 + y^2, with L_vv < 0
    solution = given(lambda x, y, dy: (1 - dy**2) ** 2 + y**2, Fixed(0, 0), Fixed(1, 0))
    assert solution.status is Status.NOT_CONVERGED
    assert "Legendre" in solution.message


def test_slopes_limited_by_the_domain() -> None:
    # uniformly accelerated relativistic motion, c = 1: hyperbolic
    solution = given(lambda x, y, dy: -ca.sqrt(1 - dy**2) + y, Fixed(0, 0), Fixed(1, 0))
    x = np.linspace(0, 1, 11)
    momentum = x - 0.5
    assert solution.dy(x) == pytest.approx(momentum / np.sqrt(1 + momentum**2), abs=1e-12)


# isoperimetric levels


def length(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt(1 + dy**2)


@pytest.mark.parametrize("arc", [2.0001, 2.5, 3.0, 3.14])
def test_chord_and_arc(arc: float) -> None:
    solution = given(
        lambda x, y, dy: y, Fixed(-1, 0), Fixed(1, 0), constraints=[Isoperimetric(length, arc)], maximise=True
    )
    with mp.workdps(25):
        half = mp.findroot(lambda t: mp.sin(t) / t - 2 / mp.mpf(arc), mp.sqrt(6 * (1 - 2 / mp.mpf(arc))))
        radius = arc / (2 * half)
        exact = float(radius**2 * (half - mp.sin(2 * half) / 2))
    assert_value(solution, exact)
    # the area grows with the length by the radius
    assert solution.multipliers[0] == pytest.approx(float(radius), rel=1e-8)


def chain(span: float, arc: float, drop: float) -> tuple[float, float]:
    """The parameter of the catenary a cosh((x - x0) / a) + C and its multiplier sense: a from the length."""
    with mp.workdps(25):
        wanted = mp.sqrt(mp.mpf(arc) ** 2 - mp.mpf(drop) ** 2)
        a = mp.findroot(
            lambda a: 2 * a * mp.sinh(mp.mpf(span) / (2 * a)) - wanted, span / mp.sqrt(24 * (wanted / span - 1))
        )
        return float(a), float(mp.mpf(span) / 2 - a * mp.asinh(drop / (2 * a * mp.sinh(mp.mpf(span) / (2 * a)))))


@pytest.mark.parametrize(("arc", "drop"), [(3.0, 0.0), (2.02, 0.0), (2.0002, 0.0), (3.0, 1.0), (2.01, 0.1)])
def test_hanging_chain(arc: float, drop: float) -> None:
    solution = given(film, Fixed(0, 0), Fixed(2, drop), constraints=[Isoperimetric(length, arc)])
    a, lowest = chain(2.0, arc, drop)
    shift = -a * math.cosh(lowest / a)
    x = np.linspace(0, 2, 41)
    assert solution.status is Status.SOLVED
    assert solution.y(x) == pytest.approx(a * np.cosh((x - lowest) / a) + shift, abs=1e-11)
    assert solution.multipliers[0] == pytest.approx(shift, rel=1e-9)
    assert solution.error.curve < 1e-10


def test_multipliers_and_sensitivities_are_derivatives_of_the_value() -> None:
    def weight(x: Any, y: Any, dy: Any, p: Any) -> Any:
        return p.rho * y * ca.sqrt(1 + dy**2)

    def hung(level: float, rho: float) -> Solution:
        constraint = Isoperimetric(lambda x, y, dy, p: ca.sqrt(1 + dy**2), level)
        return solve(Problem(weight, Fixed(0, 0), Fixed(2, 0.5), [constraint], parameters={"rho": rho}))

    step = 1e-4
    middle = hung(2.6, 1.7)
    by_level = (hung(2.6 + step, 1.7).value - hung(2.6 - step, 1.7).value) / (2 * step)
    by_rho = (hung(2.6, 1.7 + step).value - hung(2.6, 1.7 - step).value) / (2 * step)
    assert middle.multipliers[0] == pytest.approx(by_level, rel=1e-6)
    assert middle.sensitivities["rho"] == pytest.approx(by_rho, rel=1e-6)


def test_an_isoperimetric_level_with_y_ignorable() -> None:
    # y'^2 with the first moment of y' prescribed: y' = 2.4 x - 0.2
    solution = given(
        lambda x, y, dy: dy**2, Fixed(0, 0), Fixed(1, 1), constraints=[Isoperimetric(lambda x, y, dy: x * dy, 0.7)]
    )
    assert_value(solution, 1.48)
    assert solution.multipliers == pytest.approx((4.8,), rel=1e-12)
    assert_curve(solution, lambda x: 1.2 * x**2 - 0.2 * x, lambda x: 2.4 * x - 0.2)


# ends


def test_free_ends() -> None:
    assert_value(given(quickest, Fixed(0, 0), Free(1.0)), math.sqrt(2 * math.pi))
    solution = given(lambda x, y, dy: dy**2 / 2 + x * dy, Fixed(0, 1), Free(2.0))
    assert_value(solution, -4 / 3)
    assert_curve(solution, lambda x: 1 - x**2 / 2, lambda x: -x)
    mirrored = given(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), Free(0.0), Fixed(1, 0))
    assert_value(mirrored, math.sqrt(2 * math.pi))


def test_sliding_ends() -> None:
    assert_value(given(length, Fixed(0, 0), OnCurve(lambda x, y: y - (2 - x), 1.5)), math.sqrt(2))
    assert_value(given(length, OnCurve(lambda x, y: x**2 + y**2 - 1, -0.9), Fixed(3, 4)), 4.0)
    assert_value(given(quickest, Fixed(0, 0), OnCurve(lambda x, y: x - 1, 0.8)), math.sqrt(2 * math.pi))


def test_transversality_on_a_slanting_line() -> None:
    solution = given(quickest, Fixed(0, 0), OnCurve(lambda x, y: x + y - 1, 0.5))
    x = solution.x[-1]
    assert solution.status is Status.SOLVED
    assert x + solution.y(x) == pytest.approx(1.0, abs=1e-14)
    assert solution.dy(x) == pytest.approx(1.0, abs=1e-6)  # perpendicular to the line


# scaling, maxima, refusals


@pytest.mark.parametrize("unit", [1e-7, 1e7])
def test_units_do_not_matter(unit: float) -> None:
    radius, theta = cycloid(1, 1)
    solution = given(quickest, Fixed(0, 0), Fixed(unit, unit))
    assert solution.value == pytest.approx(math.sqrt(2 * radius * unit) * theta, rel=1e-13)
    c = necks(0.5)[0]
    soap = given(film, Fixed(-0.5 * unit, unit), Fixed(0.5 * unit, unit))
    assert soap.value == pytest.approx(area(0.5, c) * unit**2, rel=1e-13)
    assert soap.y(0.0) == pytest.approx(c * unit, rel=1e-13)


def test_maximise_is_minimising_the_negative() -> None:
    least = given(quickest, Fixed(0, 0), Fixed(1, 1))
    greatest = given(lambda x, y, dy: -quickest(x, y, dy), Fixed(0, 0), Fixed(1, 1), maximise=True)
    assert greatest.value == pytest.approx(-least.value, rel=1e-14)


def test_sensitivity_of_the_brachistochrone_to_gravity() -> None:
    def fall(x: Any, y: Any, dy: Any, p: Any) -> Any:
        return ca.sqrt((1 + dy**2) / (2 * p.g * y))

    solution = given(fall, Fixed(0, 0), Fixed(1, 1), parameters={"g": 9.81})
    assert solution.sensitivities["g"] == pytest.approx(-solution.value / (2 * 9.81), rel=1e-12)


REFUSED = {
    "both variables": (lambda x, y, dy: x * y * dy**2, Fixed(0, 1), Fixed(1, 2), {}),
    "vector": (lambda x, y, dy: ca.sumsqr(dy), Fixed(0, [0, 0]), Fixed(1, [1, 1]), {}),
    "second order": (lambda x, y, dy, ddy: ddy**2, Fixed(0, 0), Fixed(1, 1), {"order": 2}),
    "bound": (length, Fixed(0, 0), Fixed(1, 1), {"constraints": [Bound(lambda x, y, dy: y, lower=0)]}),
    "between levels": (film, Fixed(0, 1), Fixed(1, 1), {"constraints": [Isoperimetric(length, upper=3.0)]}),
    "periodic": (length, Periodic(0, 1), Periodic(0, 1), {}),
    "end cost": (length, Fixed(0, 0), Free(1), {"end_cost": lambda x0, y0, x1, y1: (y1 - 1) ** 2}),
    "two free ends": (length, Free(0), Free(1), {}),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_says_why(name: str) -> None:
    lagrangian, start, end, options = REFUSED[name]
    solution = given(lagrangian, start, end, **options)
    assert solution.status is Status.REFUSED
    assert len(solution.message) > 40


def test_a_tolerance_below_round_off_gives_the_best_answer() -> None:
    solution = solve(Problem(quickest, Fixed(0, 0), Fixed(1, 1)), tol=1e-17)
    assert solution.status is Status.ROUND_OFF
    assert solution.value == pytest.approx(2.5819045128277716, rel=1e-14)
