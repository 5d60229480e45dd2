"""Metrics with kinks beside their ends, against the cycloid that leaves a floor in a straight line, in 30 digits."""

import casadi as ca
import pytest
from mpmath import acos, cos, findroot, mp, mpf, pi, sin, sqrt

import varcalc as vc


def descent(floor, across, down):
    """int sqrt((1 + y'^2)/max(y, floor)) from (0, 0) to (across, down): straight through the floor, then a cycloid.

    The invariant 1/sqrt(y (1 + y'^2)) = 1/sqrt(D) is the diameter's on both sides of y = floor; on the cycloid
    y = D (1 - cos phi)/2, x = D (phi - sin phi)/2 + const and the value grows by sqrt(D) dphi. The value, and a point.
    """
    with mp.workdps(30):
        e, x, y = mpf(floor), mpf(across), mpf(down)

        def ends(phi):
            diameter = 2 * y / (1 - cos(phi))
            begun = acos(1 - 2 * e / diameter)
            first = e / sqrt(diameter / e - 1)
            arc = diameter / 2 * (phi - sin(phi) - begun + sin(begun))
            return first, first + arc, sqrt(diameter) * (phi - begun)

        low, high = mpf("1e-3"), 2 * pi - mpf("1e-6")
        phi = findroot(lambda p: ends(p)[1] - x, (low, high), solver="anderson", tol=1e-40)
        first, _, value = ends(phi)
        diameter, half = 2 * y / (1 - cos(phi)), phi / 2
        begun = acos(1 - 2 * e / diameter)
        point = first + diameter / 2 * (half - sin(half) - begun + sin(begun)), diameter / 2 * (1 - cos(half))
        return float(value + sqrt(e**2 + first**2) / sqrt(e)), tuple(float(v) for v in point)


def floored(floor, across, down):
    return vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / ca.fmax(y, floor)), vc.Fixed(0, 0), vc.Fixed(across, down))


DESCENTS = [(1e-4, 2.0, 1.0), (1e-9, 1.0, 1.0), (1e-6, 5.0, 0.8), (1e-12, 3.0, 0.5), (3e-3, 0.02, 0.3)]


@pytest.mark.parametrize("way", DESCENTS)
def test_a_floor_against_division_by_zero(way):
    exact, (x, y) = descent(*way)
    solution = vc.solve(floored(*way))
    assert abs(solution.value - exact) <= solution.error.value + 1e-14 * exact
    assert solution.error.value <= 1e-10 * max(1.0, exact)
    assert abs(float(solution.y(x)) - y) <= solution.error.curve
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_where_no_curve_keeps_to_a_floor_it_costs_nothing():
    above = vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / ca.fmax(y, 0.1)), vc.Fixed(0, 1), vc.Fixed(1, 2))
    plain = vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), vc.Fixed(0, 1), vc.Fixed(1, 2))
    assert vc.solve(above).value == pytest.approx(vc.solve(plain).value, rel=1e-12)


def test_a_film_above_a_floor_that_it_cannot_span_is_refused_and_not_broken_off():
    film = vc.Problem(lambda x, y, dy: ca.fmax(y, 1e-6) * ca.sqrt(1 + dy**2), vc.Fixed(-0.8, 1), vc.Fixed(0.8, 1))
    solution = vc.solve(film, throw=False)
    assert not solution.status.ok or solution.value == pytest.approx(1.0, abs=1e-5)


def arch(floor, across):
    """The value of int sqrt((1 + y'^2)/max(y, floor)) along half a cycloid and its mirror image, as in `descent`."""
    with mp.workdps(30):
        e, x = mpf(floor), mpf(across)

        def half(diameter):
            begun = acos(1 - 2 * e / diameter)
            return e / sqrt(diameter / e - 1), diameter / 2 * (pi - begun + sin(begun)), sqrt(diameter) * (pi - begun)

        diameter = findroot(lambda d: sum(half(d)[:2]) - x / 2, x / pi)
        first, _, value = half(diameter)
        return float(2 * (value + sqrt(e**2 + first**2) / sqrt(e)))


@pytest.mark.parametrize("floor", [1e-3, 1e-9])
def test_the_arch_that_leaves_a_floor_and_comes_back_is_found_from_the_line_in_it(floor):
    """The line from (0, 0) to (2, 0) costs 2/sqrt(floor), and is a minimum among the curves near it."""
    solution = vc.solve(floored(floor, 2, 0))
    exact = arch(floor, 2)
    assert abs(solution.value - exact) <= solution.error.value + 1e-14 * exact
    assert not solution.local


def test_a_mesh_that_is_asked_for_is_kept():
    solution = vc.solve(floored(1e-4, 2.0, 1.0), vc.Ritz(elements=8, degree=4, refine=False), throw=False)
    assert (solution.stats.elements, solution.stats.degree) == (8, 4)
