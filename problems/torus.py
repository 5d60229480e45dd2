"""Geodesics of the torus, by Clairaut's relation.

With the angle u about the tube and v about the axis, rho(u) = R + r cos(u),

    l[v] = integral of sqrt(r^2 + rho^2 v'^2) du.

v is ignorable: rho^2 v'/L = c, Clairaut's constant, and where u is monotonic

    v = integral of c r / (rho sqrt(rho^2 - c^2)) du,
    l = integral of r rho / sqrt(rho^2 - c^2) du,

elliptic integrals, here by Gauss's rule; c follows from the ends.

Source: do Carmo, "Differential Geometry of Curves and Surfaces", sect. 4-4;
Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.17.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cos, numbers, scalar, sqrt
from varcalc.problems._quadrature import integral
from varcalc.problems._roots import increasing_root

SOURCE = 'do Carmo, "Differential Geometry of Curves and Surfaces", sect. 4-4'
R, TUBE = 2.0, 1.0
START, END = (-1.0, 0.0), (1.2, 0.5)


def arc_length(x, y, dy, p):
    return ca.sqrt(p.r**2 + ((p.R + p.r * ca.cos(x)) * dy) ** 2)


def speed(q, dq, p):
    return ca.sqrt((p.r * dq[0]) ** 2 + ((p.R + p.r * ca.cos(q[0])) * dq[1]) ** 2)


def on_torus(u, v, p):
    """The point at an angle about the tube and one about the axis."""
    rho = p.R + p.r * ca.cos(u)
    return rho * ca.cos(v), rho * ca.sin(v), p.r * ca.sin(u)


def rho(u: Any) -> Any:
    return R + TUBE * cos(u)


def across(c: Any, u: Any) -> Any:
    return c * integral(lambda w: TUBE / (rho(w) * sqrt(rho(w) ** 2 - c**2)), START[0], u)


def along(c: Any, u: Any) -> Any:
    return integral(lambda w: TUBE * rho(w) / sqrt(rho(w) ** 2 - c**2), START[0], u)


def clairaut_constant(number: Callable[[float], Any]) -> Any:
    last = number(END[0])

    def end(c: Any) -> tuple[Any, Any]:
        slope = integral(lambda w: TUBE * rho(w) / (rho(w) ** 2 - c**2) ** 1.5, START[0], last)
        return across(scalar(c), last), slope

    return scalar(increasing_root(end, 0.0, scalar(rho(last)), END[1]))


def graph(number: Callable[[float], Any]) -> tuple[Any, Any]:
    c = clairaut_constant(number)
    return scalar(along(c, number(END[0]))), lambda x: across(c, x)


def curve(number: Callable[[float], Any]) -> tuple[Any, Any]:
    c = clairaut_constant(number)
    length = scalar(along(c, number(END[0])))

    def geodesic(t: Any) -> np.ndarray:
        """The point a fraction t of the length along."""

        def covered(u: Any) -> tuple[Any, Any]:
            return along(c, u), TUBE * rho(u) / sqrt(rho(u) ** 2 - c**2)

        u = increasing_root(covered, START[0], END[0], numbers(t) * length)
        return np.array([u, across(c, u)])

    return length, geodesic


references = (
    vc.Reference(
        name="torus",
        problem=vc.Problem(
            arc_length,
            vc.Fixed(*START),
            vc.Fixed(*END),
            parameters={"R": R, "r": TUBE},
            names=("u", "v"),
            surface=on_torus,
        ),
        exact=vc.Exact.of(graph, "elliptic integrals"),
        source=SOURCE,
        statement="The geodesic across the outside of a torus, as a graph over the angle about the tube.",
    ),
    vc.Reference(
        name="torus/curve",
        problem=vc.Curve(
            speed,
            vc.At(START),
            vc.At(END),
            parameters={"R": R, "r": TUBE},
            names=("u", "v"),
            surface=lambda q, p: on_torus(q[0], q[1], p),
        ),
        exact=vc.Exact.of(curve, "elliptic integrals"),
        source=SOURCE,
        statement="The same geodesic of the torus, as a curve in its two angles.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
