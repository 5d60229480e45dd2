"""Obstacles: the shortest string over a hill and round a disc, a loaded string, and a bound on the slope.

Off the obstacle the string is an extremal, straight, and it leaves the
obstacle along a tangent.

* Over the hill y = 1 - x^2 from (-2, 0) to (2, 0) it touches for |x| <= s,
  s = 2 - sqrt(3). Its length is 2 (2 - s) sqrt(1 + 4 s^2) + s sqrt(1 + 4 s^2) + arsinh(2s)/2;
  half the integral of y'^2, whose least curve is the same, is 4 s^2 (2 - s) + 4 s^3/3.
* Round the unit disc from (-2, 0) to (2, 0), above or below: 2 sqrt(3) + pi/3.
* The integral of y'^2/2 - 4y with |y'| <= 1 and y(0) = y(2) = 0: the slope is
  4 (1 - x), cut at -1 and 1. The value is -37/12.

Source: Kinderlehrer and Stampacchia, "An Introduction to Variational
Inequalities and Their Applications", ch. I and II.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Kinderlehrer and Stampacchia, "An Introduction to Variational Inequalities", ch. I'
TOUCH = 2 - math.sqrt(3)
TANGENT = math.sqrt(1 + 4 * TOUCH**2)


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def energy(x, y, dy):
    return dy**2 / 2


def loaded(x, y, dy):
    return dy**2 / 2 - 4 * y


def above_hill(x, y, dy):
    return y - (1 - x**2)


def speed(q, dq):
    return ca.norm_2(dq)


def taut(x: Any) -> np.ndarray:
    x = np.abs(np.asarray(x, dtype=float))
    return np.where(x < TOUCH, 1 - x**2, 2 * TOUCH * (2 - x))


def cut_slope(x: Any) -> np.ndarray:
    near = 1 - np.abs(1 - np.asarray(x, dtype=float))
    return np.where(near < 0.75, near, 0.875 - 2 * (1 - near) ** 2)


references = (
    vc.Reference(
        name="obstacle",
        problem=vc.Problem(arc_length, vc.Fixed(-2, 0), vc.Fixed(2, 0), [vc.Bound(above_hill, lower=0)]),
        exact=vc.Exact(
            2 * (2 - TOUCH) * TANGENT + TOUCH * TANGENT + math.asinh(2 * TOUCH) / 2, taut, "tangents and parabola"
        ),
        source=SOURCE,
        statement="The shortest string over a parabolic hill.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/string",
        problem=vc.Problem(energy, vc.Fixed(-2, 0), vc.Fixed(2, 0), [vc.Bound(above_hill, lower=0)]),
        exact=vc.Exact(4 * TOUCH**2 * (2 - TOUCH) + 4 * TOUCH**3 / 3, taut, "tangents and parabola"),
        source=SOURCE,
        statement="The string of least energy over a parabolic hill.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/disc",
        problem=vc.Curve(speed, vc.At((-2, 0)), vc.At((2, 0)), [vc.Bound(lambda q, dq: ca.sumsqr(q), lower=1)]),
        exact=vc.Exact(2 * math.sqrt(3) + math.pi / 3, description="tangents and arc, above or below"),
        source=SOURCE,
        statement="The shortest string round a disc.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/slope",
        problem=vc.Problem(loaded, vc.Fixed(0, 0), vc.Fixed(2, 0), [vc.Bound(lambda x, y, dy: dy, lower=-1, upper=1)]),
        exact=vc.Exact(-37 / 12, cut_slope, "straight lines and parabola"),
        source=SOURCE,
        statement="A loaded string whose slope is bounded.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
)
