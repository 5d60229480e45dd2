"""Curves that touch a bound, with the ends of contact among the unknowns."""

from __future__ import annotations

import math
import pickle

import casadi as ca
import numpy as np
import pytest
from mpmath import exp, findroot, mpf, quad
from scipy.optimize import brentq

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.touching import touchable


def under_a_ceiling(area=1.0, ceiling=1.2):
    """The least integral of y'^2 from (0, 0) to (1, 0) with a given area under a ceiling."""
    level, bound = vc.Isoperimetric(lambda x, y, v: y, area), vc.Bound(lambda x, y, v: y, upper=ceiling)
    return vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [level, bound])


def on_a_floor(depth, unit, sign):
    """A string of unit tension and weight on a floor, in other units and signs."""
    return vc.Problem(
        lambda x, y, v: sign * (v**2 / 2 + y / unit),
        vc.Fixed(0, 0),
        vc.Fixed(unit, 0),
        [vc.Bound(lambda x, y, v: y, lower=-depth * unit)],
        maximise=sign < 0,
    )


def contact(area, ceiling):
    # parabolas y = h (1 - (1 - x / c)^2) leave the ceiling smoothly at c from either end: h (1 - 2 c / 3) is the area
    return 1.5 * (1 - area / ceiling)


@pytest.mark.parametrize("ceiling", [1.05, 1.2, 1.4])
def test_value_curve_and_multiplier(ceiling):
    solution = vc.solve(under_a_ceiling(1.0, ceiling), tol=1e-12)
    c = contact(1.0, ceiling)
    assert solution.value == pytest.approx(8 * ceiling**2 / (3 * c), rel=1e-12)
    x = np.linspace(0, c, 30)
    assert solution.y(x) == pytest.approx(ceiling * (1 - (1 - x / c) ** 2), abs=1e-6)
    assert solution.y(0.5) == pytest.approx(ceiling, rel=1e-12)
    # dJ/darea = 4 h / c^2
    assert solution.multipliers[0] == pytest.approx(4 * ceiling / c**2, rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("unit", [1e-7, 1.0, 1e7])
@pytest.mark.parametrize("depth", [0.02, 0.08])
def test_a_string_on_a_floor_in_any_unit(depth, unit, sign):
    # y = x^2/2 - c x down to the floor at c, c^2/2 = depth; 1/2 y'^2 + y integrates to -c^3/6 on either side
    c = math.sqrt(2 * depth)
    solution = vc.solve(on_a_floor(depth, unit, sign), tol=1e-12)
    assert solution.value == pytest.approx(-sign * unit * (c**3 / 3 + depth * (1 - 2 * c)), rel=1e-12)
    x = np.linspace(0, c, 30)
    assert solution.y(x * unit) == pytest.approx(unit * (x**2 / 2 - c * x), abs=1e-7 * unit)
    # the floor carries the weight: raising it raises the energy by as much
    assert solution.multipliers[0](0.5 * unit) == pytest.approx(-sign / unit, rel=2e-2)


def test_a_bound_that_is_not_touched_changes_nothing():
    # the parabola of area 1 is 3/2 high
    free = vc.solve(under_a_ceiling(1.0, 1.6), tol=1e-12)
    assert free.value == pytest.approx(12, rel=1e-11)


@pytest.mark.parametrize("optimiser", [None, vc.Ipopt()])
def test_contact_costs_no_bisection(optimiser):
    solution = vc.solve(under_a_ceiling(), vc.Ritz(optimiser=optimiser), tol=1e-12)
    assert solution.stats.elements <= 6
    assert solution.x[1:-1] == pytest.approx([0.25, 0.75], abs=1e-6)


def test_where_contacts_are_looked_for():
    assert touchable(formulate(under_a_ceiling()))
    slopes = vc.Bound(lambda x, y, v: v, upper=2.0)
    ends = vc.Fixed(0, 0), vc.Fixed(1, 1)
    assert not touchable(formulate(vc.Problem(lambda x, y, v: v**2, *ends, [slopes])))
    assert not touchable(formulate(vc.Problem(lambda x, y, v: v**2, *ends)))


@pytest.mark.parametrize("width", [1e-1, 3e-3, 1e-4])
@pytest.mark.parametrize("centre", [0.3, 0.6180339887])
def test_a_string_over_a_post_touches_both_its_corners(width, centre):
    # straight to one corner, along the top, straight on
    bound = vc.Bound(lambda x, y, v: y - ca.if_else(ca.fabs(x - centre) <= width, 1.0, -1.0), lower=0)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0.1), vc.Fixed(1, 0.2), [bound]))
    exact = 0.9**2 / (centre - width) + 0.8**2 / (1 - centre - width)
    assert solution.value == pytest.approx(exact, rel=1e-10)
    assert abs(solution.value - exact) <= solution.error.value


@pytest.mark.parametrize(("first", "last", "height"), [(0.3, 0.41, 0.23), (0.664, 0.787, 0.488), (0.705, 0.754, 0.43)])
def test_what_the_barrier_leaves_is_claimed(first, last, height):
    """The shortest way over a box."""
    bound = vc.Bound(lambda x, y, v: y - ca.if_else(ca.logic_and(x >= first, x <= last), height, -1.0), lower=0)
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 0), [bound]))
    exact = math.hypot(first, height) + (last - first) + math.hypot(1 - last, height)
    assert abs(solution.value - exact) <= solution.error.value <= 1e-10


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-3])
def test_a_string_over_a_narrow_cap_follows_it(width):
    # over 2 - ((x - c)/w)^2 with both ends at 0: tangents of slope s from a distance t = s w^2/2 either side of its top
    c = 0.5
    t = c - math.sqrt(c**2 - 2 * width**2)
    height, slope = 2 - (t / width) ** 2, 2 * t / width**2
    assert height == pytest.approx(slope * (c - t), rel=1e-9)
    bound = vc.Bound(lambda x, y, v: y - 2 + ((x - c) / width) ** 2, lower=0)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [bound]))
    value = 2 * (height**2 / (c - t) + 4 * t**3 / (3 * width**4))
    assert solution.value == pytest.approx(value, rel=1e-10)


def beam(load, bound, last=(0.0, 0.0)):
    """A beam that is clamped level at both ends, of unit length and stiffness."""
    return vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 - load(x) * y, vc.Fixed(0, 0, 0), vc.Fixed(1, *last), [bound], order=2
    )


@pytest.mark.parametrize(
    ("load", "level", "close"), [(1000.0, 0.1, 1e-5), (3000.0, 0.02, 1e-5), (100.0, 0.08, 2e-3)]
)  # along a stretch of 0.02 the pressure is a small part of what is balanced
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_beam_lies_on_a_level(load, level, close, sense):
    """It is down at x = a with y' = y'' = 0: a^4 = 72 level / load (y = load x^4/24 - load a x^3/9 + load a^2 x^2/12).

    There the level presses with a force besides, and along it with the load.
    """
    bound = vc.Bound(lambda x, y, dy: y, **{"upper" if sense > 0 else "lower": sense * level})
    solution = vc.solve(beam(lambda x: sense * load, bound))
    a = (72 * level / load) ** 0.25
    way = np.polynomial.Polynomial([0, 0, load * a**2 / 12, -load * a / 9, load / 24])
    lost = (way.deriv(2) ** 2 / 2 - load * way).integ()(a)
    assert solution.value == pytest.approx(2 * lost - load * level * (1 - 2 * a), abs=3 * solution.error.value + 1e-13)
    assert solution.error.value < 1e-9
    np.testing.assert_allclose(solution.x[[1, -2]], [a, 1 - a], atol=1e-6)
    inside = np.linspace(a, 1 - a, 9)[1:-1]
    np.testing.assert_allclose(np.abs(solution.multipliers[0](inside)), load, rtol=close)


@pytest.mark.parametrize("level", [0.7e-3, 1.0e-3, 1.25e-3])
def test_a_beam_touches_a_level_in_a_point(level):
    """Under the load x, at c with y'(c) = 0, where y'' has no jump: each side is y = x^5/120 and a cubic."""

    def side(start, end, first, last):
        """The cubic beside x^5/120 with the given ordinates and the slope 0 at both ends."""
        rows = [[x**k for k in range(4)] for x in (start, end)]
        rows += [[k * x ** (k - 1) if k else 0.0 for k in range(4)] for x in (start, end)]
        right = [first - start**5 / 120, last - end**5 / 120, -(start**4) / 24, -(end**4) / 24]
        series = [*np.linalg.solve(rows, right), 0.0, 1 / 120]
        return np.polynomial.Polynomial(series)

    def bend(c):
        return side(0.0, c, 0.0, level).deriv(2)(c) - side(c, 1.0, level, 0.0).deriv(2)(c)

    c = brentq(bend, 0.3, 0.8, xtol=1e-15)
    ways = [(side(0.0, c, 0.0, level), 0.0, c), (side(c, 1.0, level, 0.0), c, 1.0)]
    parts = [(way.deriv(2) ** 2 / 2 - np.polynomial.Polynomial([0, 1]) * way).integ() for way, *_ in ways]
    value = sum(part(b) - part(a) for part, (_, a, b) in zip(parts, ways, strict=True))
    free = vc.solve(beam(lambda x: x, vc.Bound(lambda x, y, dy: y, upper=1.0)))
    assert float(free.curve(np.linspace(0, 1, 501), 0).max()) > level
    solution = vc.solve(beam(lambda x: x, vc.Bound(lambda x, y, dy: y, upper=level)))
    assert solution.value == pytest.approx(value, rel=1e-10, abs=3 * solution.error.value)
    assert solution.error.value < 1e-9
    assert solution.x[1:-1] == pytest.approx([c], abs=1e-5)


def test_the_slope_of_a_beam_rests_on_its_bound():
    """v = y' is a parabola of length a at both ends, v = top (1 - (1 - x/a)^2), and the top between."""
    height = 0.1
    top = 1.2 * height
    problem = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2, vc.Fixed(0, 0, 0), vc.Fixed(1, height, 0),
        [vc.Bound(lambda x, y, dy: dy, upper=top)], order=2,
    )  # fmt: skip
    a = 1.5 * (1 - height / top)  # the height is top (1 - 2 a/3)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(2 * 0.5 * 4 * top**2 / (3 * a), abs=3 * solution.error.value + 1e-15)
    np.testing.assert_allclose(solution.x[[1, -2]], [a, 1 - a], atol=1e-5)


@pytest.mark.parametrize("load", [10.0, 300.0])
def test_a_string_lies_on_a_level_up_to_its_free_end(load):
    """y = load x (a - x/2) up to a = sqrt(2 level/load), where it comes to the level with no slope."""
    level = 0.1
    problem = vc.Problem(
        lambda x, y, dy: dy**2 / 2 - load * y, vc.Fixed(0, 0), vc.Free(1), [vc.Bound(lambda x, y, dy: y, upper=level)]
    )
    a = math.sqrt(2 * level / load)
    solution = vc.solve(problem)
    value = load**2 * a**3 / 6 - load**2 * a**3 / 3 - load * level * (1 - a)
    assert solution.value == pytest.approx(value, abs=3 * solution.error.value + 1e-15 * abs(value))
    upon = solution.curve(np.linspace(1.01 * a, 1, 9), 0)
    np.testing.assert_allclose(upon, level, atol=3 * solution.error.curve + 1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_what_touches_a_bound_in_points_is_a_minimum(order):
    """Over the peak of a tent; up to two levels, in two points and in one."""
    if order == 1:
        tent = vc.Bound(lambda x, y, dy: y - (1 - 8 * ca.fabs(x - 0.3)), lower=0)
        problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(1, 0.1), [tent])
        exact = math.hypot(0.3, 1) + math.hypot(0.7, 0.9)
        assert vc.solve(problem).value == pytest.approx(exact, abs=1e-10)
    else:
        levels = vc.Bound(lambda x, y, dy: y, lower=-0.05, upper=0.1)
        problem = vc.Problem(
            lambda x, y, dy, ddy: ddy**2 / 2 - 2000 * y * ca.sin(3 * math.pi * x),
            vc.Fixed(0, 0), vc.Fixed(1, 0), [levels], order=2,
        )  # fmt: skip
    solution = vc.solve(problem)
    assert len(solution.x) == 2 * order + 1
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_a_beam_travels_with_all_its_derivatives():
    solution = vc.solve(beam(lambda x: 1000.0, vc.Bound(lambda x, y, dy: y, upper=0.1)))
    read = pickle.loads(pickle.dumps(solution))
    x = np.linspace(0, 1, 31)
    for derivative in range(3):
        there, here = read.curve(x, derivative), solution.curve(x, derivative)
        np.testing.assert_allclose(there, here, atol=1e-10 * np.abs(here).max())


@pytest.mark.parametrize("width", [0.1, 1e-2, 1e-3])
@pytest.mark.parametrize(("left", "right"), [(0.2, 0.04), (0.5, 0.1)])
def test_a_string_over_a_narrow_bump_leaves_it_along_tangents(width, left, right):
    middle, top = 0.382, 0.8

    def bump(x):
        return top * exp(-(((x - middle) / width) ** 2))

    def rate(x):
        return -2 * (x - middle) / mpf(width) ** 2 * bump(x)

    # the lines from both ends touch it: bump(x) - y_end = rate(x) (x - x_end)
    leaning = mpf(width) / mpf(2) ** 0.5
    first = findroot(lambda x: bump(x) - left - rate(x) * x, (middle - leaning, middle), solver="anderson")
    last = findroot(lambda x: bump(x) - right - rate(x) * (x - 1), (middle, middle + leaning), solver="anderson")
    along = quad(lambda x: rate(x) ** 2, [first, middle, last])
    exact = rate(first) ** 2 * first + along + rate(last) ** 2 * (1 - last)
    over = vc.Bound(lambda x, y, v: y - top * ca.exp(-(((x - middle) / width) ** 2)), lower=0)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, left), vc.Fixed(1, right), [over]))
    assert abs(solution.value - exact) <= solution.error.value + 1e-12 * exact
    assert solution.error.value < 1e-9


@pytest.mark.parametrize(("height", "digits"), [(0.0, 1e-4), (2.4, 1e-2)])
def test_a_beam_under_a_steepest_slope_has_the_force_that_holds_it(height, digits):
    # y' = u is steepest, c, on the middle; beside it u'' = -F, u' = 0 where it begins: F x1^2 / 2 = c
    steepest, rise = 0.144, 0.1
    begins = 1.5 * (steepest - rise) / steepest
    force = 2 * steepest / begins**2
    held = vc.Bound(lambda x, y, v: v, upper=steepest)
    problem = vc.Problem(
        lambda x, y, v, a: a**2, vc.Fixed(0, height, dy=0), vc.Fixed(1, height + rise, dy=0), [held], order=2
    )
    solution = vc.solve(problem)
    exact = 2 * force**2 * begins**3 / 3
    assert abs(solution.value - exact) <= solution.error.value + 1e-13
    # d/dx (2 y'') is -2 F beside the stretch; on it y'' = 0 and the bound makes up for it
    push = solution.multipliers[0](np.linspace(begins + 0.02, 1 - begins - 0.02, 5))
    # a force is a third derivative: round-off of ordinates leaves it few digits
    assert np.abs(push) == pytest.approx(2 * force, rel=digits)
