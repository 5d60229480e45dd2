"""Every kind of problem in metres, in 1e7 of them and in ten-millionths: the same digits, against closed forms."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

UNITS = (1e-7, 1.0, 1e7)


def length(x, y, v):
    return ca.sqrt(1 + ca.sumsqr(v))


def speed(q, dq):
    return ca.norm_2(dq)


def area(q, dq):
    return (q[0] * dq[1] - q[1] * dq[0]) / 2


def line(r):
    return vc.Problem(length, vc.Fixed(0, 0), vc.Fixed(3 * r, 4 * r)), 5 * r


def soap_film(r):
    ends = (vc.Fixed(-r, math.cosh(1) * r), vc.Fixed(r, math.cosh(1) * r))
    return vc.Problem(lambda x, y, v: y * length(x, y, v), *ends), (1 + math.sinh(2) / 2) * r**2


def half_plane(r):
    return vc.Problem(lambda x, y, v: length(x, y, v) / y, vc.Fixed(0, r), vc.Fixed(r, r)), math.acosh(1.5)


def vector(r):
    return vc.Problem(length, vc.Fixed(0, (0, 0)), vc.Fixed(r, (2 * r, 2 * r))), 3 * r


def spline(r):
    return vc.Problem(lambda x, y, v, w: w**2 / 2, vc.Fixed(0, 0, 0), vc.Fixed(r, r, 0), order=2), 6 / r


def waypoint(r):
    return vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(2 * r, 0), [vc.Through(r, r)]), 2 * r


def to_a_line(r):
    return vc.Problem(length, vc.Fixed(0, 0), vc.OnCurve(lambda x, y: x + y - 2 * r, x=0.8 * r)), math.sqrt(2) * r


def to_a_circle(r):
    end = vc.OnCurve(lambda x, y: (x - 2 * r) ** 2 + (y - r) ** 2 - r**2, x=1.2 * r)
    return vc.Problem(length, vc.Fixed(0, 0), end), (math.sqrt(5) - 1) * r


def curve_to_a_circle(r):
    end = vc.OnSurface(lambda q: ca.sumsqr(q - ca.DM([3 * r, 4 * r])) - r**2, (2 * r, 3 * r))
    return vc.Curve(speed, vc.At((0, 0)), end), 4 * r


def under_an_arc(r):
    level = vc.Isoperimetric(length, math.pi / math.sqrt(2) * r)
    problem = vc.Problem(lambda x, y, v: y, vc.Fixed(-r, 0), vc.Fixed(r, 0), [level], maximise=True)
    return problem, (math.pi / 2 - 1) * r**2


def over_an_area(r):
    level = vc.Isoperimetric(lambda x, y, v: y, r**2)
    return vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Fixed(r, 0), [level]), 6 * r


def largest_area(r):
    level = vc.Isoperimetric(speed, 2 * math.pi * r)
    return vc.Curve(area, vc.Periodic(), vc.Periodic(), [level], maximise=True), math.pi * r**2


def shortest_rim(r):
    level = vc.Isoperimetric(area, math.pi * r**2)
    return vc.Curve(speed, vc.Periodic(), vc.Periodic(), [level]), 2 * math.pi * r


def great_circle(r):
    end = (math.cos(2) * r, 0.6 * math.sin(2) * r, 0.8 * math.sin(2) * r)
    sphere = vc.Holonomic(lambda q: ca.sumsqr(q) - r**2)
    return vc.Curve(speed, vc.At((r, 0, 0)), vc.At(end), [sphere]), 2 * r


def around_a_circle(r):
    circle = vc.Holonomic(lambda x, y: ca.sumsqr(y) - r**2)
    ends = (vc.Fixed(0, (r, 0)), vc.Fixed(1, (0, r)))
    return vc.Problem(lambda x, y, v: ca.sumsqr(v) / 2, *ends, [circle]), math.pi**2 / 8 * r**2


def bounded_slope(r):
    bound = vc.Bound(lambda x, y, v: v, lower=-2, upper=2)
    return vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(r, r), [bound]), r


KINDS = (
    line, soap_film, half_plane, vector, spline, waypoint, to_a_line, to_a_circle, curve_to_a_circle, under_an_arc,
    over_an_area, largest_area, shortest_rim, great_circle, around_a_circle, bounded_slope,
)  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_digits_in_any_unit(kind, unit):
    problem, value = kind(unit)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(value, rel=2e-12)
    assert abs(solution.value - value) <= 2 * solution.error.value + 1e-15 * abs(value)


def test_an_obstacle_in_another_unit():
    # around a disc: two tangents and an arc
    unit = 1e7
    disc = vc.Bound(lambda x, y, v: x**2 + y**2, lower=unit**2)
    problem = vc.Problem(length, vc.Fixed(-2 * unit, 0), vc.Fixed(2 * unit, 0), [disc])
    solution = vc.solve(problem, tol=1e-6)
    assert solution.value == pytest.approx((2 * math.sqrt(3) + math.pi / 3) * unit, rel=1e-6)


def test_the_multipliers_carry_their_unit():
    # the force that holds q on the circle is v^2 / r: the multiplier of |q|^2 - r^2 is the same in any unit
    forces = []
    for unit in UNITS:
        multiplier = vc.solve(around_a_circle(unit)[0]).multipliers[0]
        forces.append(multiplier(np.array([0.3, 0.5, 0.7])))
        assert forces[-1] == pytest.approx(forces[0], rel=1e-6)
    assert forces[0] == pytest.approx(-(math.pi**2) / 8, rel=1e-3)
