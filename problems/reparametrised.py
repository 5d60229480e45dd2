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
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._curves import PolarLine

SOURCE = 'Abanov, "Analytical Mechanics", sect. 9.1'
VALUE = math.sqrt(5)
END_ANGLE, END_RADIUS = math.atan2(1, 2), math.sqrt(5)
squared = PolarLine(1, 5, 2 * END_ANGLE)
NEAREST = 2 / math.sqrt(5)
"""The distance of the straight line in w = z^2 from w = 0."""


def by_x(x, y, dy):
    return ca.sqrt(x**2 + y**2) * ca.sqrt(1 + dy**2)


def by_t(q, dq):
    return ca.norm_2(q) * ca.norm_2(dq)


def by_angle(x, y, dy):
    return y * ca.sqrt(y**2 + dy**2)


def by_radius(x, y, dy):
    return x * ca.sqrt(1 + (x * dy) ** 2)


def hyperbola(x: Any) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    return 2 * (x - 1) * (x + 1) / (x + np.sqrt(5 * x**2 - 4))


def point(t: Any) -> np.ndarray:
    z = np.sqrt(1 + (2 + 4j) * np.asarray(t, dtype=float))
    return np.array([np.real(z), np.imag(z)])


def angle(r: Any) -> np.ndarray:
    square = np.asarray(r, dtype=float) ** 2
    along = np.sqrt((square - NEAREST) * (square + NEAREST))
    return (np.arctan2(along, NEAREST) - math.atan2(1, 2)) / 2


references = (
    vc.Reference(
        name="reparametrised",
        problem=vc.Problem(by_x, vc.Fixed(1, 0), vc.Fixed(2, 1)),
        exact=vc.Exact(VALUE, hyperbola, "rectangular hyperbola"),
        source=SOURCE,
        statement="The light ray from (1, 0) to (2, 1) in a medium of index r, as y(x).",
        inapplicable=_inapplicable.NOT_IGNORABLE,
    ),
    vc.Reference(
        name="reparametrised/curve",
        problem=vc.Curve(by_t, vc.At((1, 0)), vc.At((2, 1))),
        exact=vc.Exact(VALUE, point, "square root of a straight line"),
        source=SOURCE,
        statement="The same light ray as a curve q(t).",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="reparametrised/polar",
        problem=vc.Problem(by_angle, vc.Fixed(0, 1), vc.Fixed(END_ANGLE, END_RADIUS)),
        exact=vc.Exact(
            VALUE, lambda x: np.sqrt(squared.radius(2 * np.asarray(x, dtype=float))), "rectangular hyperbola"
        ),
        source=SOURCE,
        statement="The same light ray in polar coordinates, as r(theta).",
    ),
    vc.Reference(
        name="reparametrised/radius",
        problem=vc.Problem(by_radius, vc.Fixed(1, 0), vc.Fixed(END_RADIUS, END_ANGLE)),
        exact=vc.Exact(VALUE, angle, "rectangular hyperbola"),
        source=SOURCE,
        statement="The same light ray in polar coordinates, as theta(r).",
    ),
)
