"""One extremal in four coordinates: in x, in a parameter t, and in polar coordinates both ways.

The equation of Euler and Lagrange keeps its form in any coordinates, and the
functional its value. Here it is the light ray from (1, 0) to (2, 1) in a medium
of index n = r,

    y(x):      integral of sqrt(x^2 + y^2) sqrt(1 + y'^2) dx
    q(t):      integral of |q| |dq|
    r(theta):  integral of r sqrt(r^2 + r'^2) dtheta
    theta(r):  integral of r sqrt(1 + r^2 theta'^2) dr

Since r |dz| = |d(z^2)|/2, it is a straight line in w = z^2, from 1 to 3 + 4i:
the hyperbola y^2 + xy - x^2 + 1 = 0, of optical length |3 + 4i - 1|/2 = sqrt(5).

Source: Abanov, "Analytical Mechanics", sect. 9.1; Brizard, "An Introduction to
Lagrangian Mechanics" (2005), sect. 1.4.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import atan2, cos, hypot, numbers, sin, sqrt
from varcalc.problems._curves import PolarLine

SOURCE = 'Abanov, "Analytical Mechanics", sect. 9.1'
END_ANGLE, END_RADIUS = math.atan2(1, 2), math.sqrt(5)


def by_x(x, y, dy):
    return ca.sqrt(x**2 + y**2) * ca.sqrt(1 + dy**2)


def by_t(q, dq):
    return ca.norm_2(q) * ca.norm_2(dq)


def by_angle(x, y, dy):
    return y * ca.sqrt(y**2 + dy**2)


def by_radius(x, y, dy):
    return x * ca.sqrt(1 + (x * dy) ** 2)


def hyperbola(number: Callable[[float], Any]) -> tuple[Any, Any]:
    def y(x: Any) -> Any:
        x = numbers(x)
        return 2 * (x - 1) * (x + 1) / (x + sqrt(5 * x**2 - 4))

    return sqrt(number(5)), y


def point(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The root of the straight line 1 + (2 + 4i) t, of modulus u and argument a: sqrt(u) (cos(a/2), sin(a/2))."""

    def q(t: Any) -> np.ndarray:
        t = numbers(t)
        modulus, half = hypot(1 + 2 * t, 4 * t), atan2(4 * t, 1 + 2 * t) / 2
        return sqrt(modulus) * np.array([cos(half), sin(half)])

    return sqrt(number(5)), q


def polar(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The straight line in w = z^2 ends at the doubles nearest to the polar coordinates of 3 + 4i."""
    squared = PolarLine(number(1), number(END_RADIUS) ** 2, 2 * number(END_ANGLE))
    return squared.length / 2, lambda x: sqrt(squared.radius(2 * numbers(x)))


def angle(number: Callable[[float], Any]) -> tuple[Any, Any]:
    squared = PolarLine(number(1), number(END_RADIUS) ** 2, 2 * number(END_ANGLE))
    # the distance of the line from w = 0, and the angle from its foot to its start
    nearest = squared.r1 * sin(squared.angle) / squared.length
    before = atan2(sqrt((1 - nearest) * (1 + nearest)), nearest)

    def y(r: Any) -> Any:
        square = numbers(r) ** 2
        return (atan2(sqrt((square - nearest) * (square + nearest)), nearest) - before) / 2

    return squared.length / 2, y


references = (
    vc.Reference(
        name="reparametrised",
        problem=vc.Problem(by_x, vc.Fixed(1, 0), vc.Fixed(2, 1)),
        exact=vc.Exact.of(hyperbola, "rectangular hyperbola"),
        source=SOURCE,
        statement="The light ray from (1, 0) to (2, 1) in a medium of index r, as y(x).",
        inapplicable=_inapplicable.NOT_IGNORABLE,
    ),
    vc.Reference(
        name="reparametrised/curve",
        problem=vc.Curve(by_t, vc.At((1, 0)), vc.At((2, 1))),
        exact=vc.Exact.of(point, "square root of a straight line"),
        source=SOURCE,
        statement="The same light ray as a curve q(t).",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="reparametrised/polar",
        problem=vc.Problem(by_angle, vc.Fixed(0, 1), vc.Fixed(END_ANGLE, END_RADIUS)),
        exact=vc.Exact.of(polar, "rectangular hyperbola"),
        source=SOURCE,
        statement="The same light ray in polar coordinates, as r(theta).",
    ),
    vc.Reference(
        name="reparametrised/radius",
        problem=vc.Problem(by_radius, vc.Fixed(1, 0), vc.Fixed(END_RADIUS, END_ANGLE)),
        exact=vc.Exact.of(angle, "rectangular hyperbola"),
        source=SOURCE,
        statement="The same light ray in polar coordinates, as theta(r).",
    ),
)
