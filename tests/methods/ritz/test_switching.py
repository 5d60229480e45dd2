"""Bounds of the slope where L is of first degree in it: bang-bang and singular arcs, to round-off."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize

import varcalc as vc


def bounded(L, end, m, start=(0.0, 0.0)):
    limit = vc.Bound(lambda x, y, v: v, lower=-m, upper=m)
    return vc.Problem(L, vc.Fixed(*start), end, [limit])


def along(L, switches, levels, start, last):
    """The integral of L(x, y) along the polygon of slopes ``levels`` between ``switches``, and where it ends."""
    total, y, edges = 0.0, start, [0.0, *switches, last]
    for a, b, level in zip(edges[:-1], edges[1:], levels, strict=True):
        total += quad(lambda x, a=a, y=y, level=level: L(x, y + level * (x - a)), a, b, epsabs=1e-13)[0]
        y += level * (b - a)
    return total, y


def test_a_slope_that_switches_from_bound_to_bound():
    """(y - sin 2x)^2 with slopes of 1 at most: four switches, of which the end leaves three."""
    levels = (-1, 1, -1, 1, -1)

    def value(three):
        last = brentq(lambda t: along(lambda x, y: 0, [*three, t], levels, 0.5, 4.0)[1], 3.0, 4.0)
        return along(lambda x, y: (y - np.sin(2 * x)) ** 2, [*three, last], levels, 0.5, 4.0)[0]

    found = minimize(value, [0.1, 0.65, 2.4], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-15})
    solution = vc.solve(bounded(lambda x, y, v: (y - ca.sin(2 * x)) ** 2, vc.Fixed(4, 0), 1.0, (0.0, 0.5)))
    assert solution.value == pytest.approx(found.fun, abs=1e-11)
    assert solution.error.value < 1e-10
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_between_stretches_at_a_bound_the_curve_is_where_L_is_least():
    """y^2 from 2 to 1 with slopes of 1 at most: down, at rest on y = 0, up; 8/3 + 1/3."""
    solution = vc.solve(bounded(lambda x, y, v: y**2, vc.Fixed(5, 1), 1.0, (0.0, 2.0)))
    assert solution.value == pytest.approx(3.0, abs=1e-12)
    np.testing.assert_allclose(solution.curve(np.array([1.0, 3.0, 4.5]), 0)[0], [1.0, 0.0, 0.5], atol=1e-9)


def test_a_stretch_cuts_areas_off_that_are_equal():
    """(y - f)^2, f = sin 2x: from f(s) back to f(t) with the slope m, the areas on both sides of it alike."""
    m, f = 1.5, lambda x: np.sin(2 * x)

    def chord(s, level, low, high):
        """Where the line of a slope from the curve at s comes back to it, and what it cuts off."""

        def line(x):
            return f(s) + level * (x - s)

        t = brentq(lambda x: line(x) - f(x), low, high)
        return t, quad(lambda x: line(x) - f(x), s, t, epsabs=1e-14)[0]

    begun = brentq(lambda s: chord(s, -m, 1.8, 2.8)[1], 0.86, 1.1)
    ended = chord(begun, -m, 1.8, 2.8)[0]
    again = brentq(lambda s: chord(s, m, 3.4, 4.0)[1], 2.45, 2.7)
    last = chord(again, m, 3.4, 4.0)[0]
    # from the origin, given, it keeps its slope until it comes to the curve
    first = brentq(lambda x: m * x - f(x), 0.3, 1.0)
    pieces = [(0.0, 0.0, m, first), (begun, f(begun), -m, ended), (again, f(again), m, last)]
    exact = sum(
        quad(lambda x, a=a, y=y, v=v: (y + v * (x - a) - f(x)) ** 2, a, b, epsabs=1e-14)[0] for a, y, v, b in pieces
    )
    end = vc.Fixed(4, float(np.sin(8.0)))
    solution = vc.solve(bounded(lambda x, y, v: (y - ca.sin(2 * x)) ** 2, end, m))
    assert solution.value == pytest.approx(exact, abs=1e-11)
    assert solution.error.value < 1e-10


@pytest.mark.parametrize("m", [0.4, 1.0])
def test_what_is_linear_in_ordinate_and_slope(m):
    """x v alone: y sums to 3 y(3) - its area, and the highest line up and down to y(3) = 0 has the most."""
    solution = vc.solve(bounded(lambda x, y, v: x * v, vc.Fixed(3, 0), m))
    assert solution.value == pytest.approx(-m * 1.5**2, abs=1e-11)


def test_the_one_curve_that_bounds_admit():
    solution = vc.solve(bounded(lambda x, y, v: (y - x**2) ** 2 * (1 + x), vc.Fixed(2, 4), 2.0))
    x = np.polynomial.Polynomial([0, 1])
    exact = ((2 * x - x**2) ** 2 * (1 + x)).integ()
    assert solution.value == pytest.approx(exact(2) - exact(0), abs=1e-11)


def test_what_presses_a_slope_is_asked_all_along_a_stretch():
    """y sin 3x: the slope switches where the integral of sin 3x from the switch before comes back to it."""
    solution = vc.solve(bounded(lambda x, y, v: y * ca.sin(3 * x), vc.Fixed(3, 1), 1.0))
    levels = (-1, 1, -1, 1)
    # M' = sin 3x: M has one value, cos(3c)/3 - cos(3x)/3, at all switches: x = c, 2 pi/3 - c, 2 pi/3 + c
    turn = 2 * np.pi / 3
    c = brentq(lambda c: along(lambda x, y: 0, [c, turn - c, turn + c], levels, 0.0, 3.0)[1] - 1.0, 0.0, turn / 2)
    exact = along(lambda x, y: y * np.sin(3 * x), [c, turn - c, turn + c], levels, 0.0, 3.0)[0]
    assert solution.value <= exact + 1e-9
    assert solution.value == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("cost", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("freed", ["start", "end"])
def test_a_free_end_says_what_presses_a_slope_all_along(freed, cost):
    """x v with y(3) free, which costs c y: c y(3) + 3 y(3) - its area; or y(0) free, which costs -c y(0)."""
    limit = vc.Bound(lambda x, y, v: v, lower=-1, upper=1)
    ends = (vc.Free(0), vc.Fixed(3, 0)) if freed == "start" else (vc.Fixed(0, 0), vc.Free(3))
    sign = -1 if freed == "start" else 1
    of_ends = lambda x0, y0, x1, y1: sign * cost * (y0 if freed == "start" else y1)  # noqa: E731
    solution = vc.solve(vc.Problem(lambda x, y, v: x * v, *ends, [limit], end_cost=of_ends))
    # int (x + c) v with v = -1 throughout, either way: a start at y costs -c y = c int v
    assert solution.value == pytest.approx(-(4.5 + 3 * cost), abs=1e-10)


def test_a_level_shifts_where_the_slope_switches():
    """y^2 from 2 to 2 in 5 with slopes of 1 at most and the area 4.5: down to a, at rest there, up.

    The area is 2 (4 - a^2)/2 + a (1 + 2 a), where the rest takes 5 - 2 (2 - a).
    """
    limit = vc.Bound(lambda x, y, v: v, lower=-1, upper=1)
    area = vc.Isoperimetric(lambda x, y, v: y, 4.5)
    a = (-1 + np.sqrt(1 + 4 * 0.5)) / 2
    exact = 2 * (8 - a**3) / 3 + a**2 * (1 + 2 * a)
    solution = vc.solve(vc.Problem(lambda x, y, v: y**2, vc.Fixed(0, 2), vc.Fixed(5, 2), [limit, area]))
    assert solution.value == pytest.approx(exact, abs=1e-9)


def test_a_level_that_two_slopes_have_is_switched_between_as_well():
    """y^2 from 2 to 1 with v^2 of 1 at most: 8/3 + 1/3."""
    limit = vc.Bound(lambda x, y, v: v**2, upper=1)
    solution = vc.solve(vc.Problem(lambda x, y, v: y**2, vc.Fixed(0, 2), vc.Fixed(5, 1), [limit]))
    assert solution.value == pytest.approx(3.0, abs=1e-9)


def test_an_edge_beyond_which_other_slopes_are_admitted_forces_no_curve():
    """y with v^2 >= 1: y = x keeps to an edge from (0, 0) to (1, 1), and steep ways down and up are lower."""
    limit = vc.Bound(lambda x, y, v: v**2, lower=1)
    solution = vc.solve(vc.Problem(lambda x, y, v: y, vc.Fixed(0, 0), vc.Fixed(1, 1), [limit]), throw=False)
    assert solution.local or not solution.status.ok
