"""Poincare's half-plane, which is the medium of index n = H/y: semicircles.

    S[y] = integral of (H/y) sqrt(1 + y'^2) dx

is least on the circle through the ends that is centred on y = 0, on which
y^2 is its linear interpolant plus (x - x0)(x1 - x). S/H is the hyperbolic
distance 2 arsinh(d / (2 sqrt(y0 y1))), d the distance of the ends; at constant
speed x = m + R tanh(s), y = R sech(s). Through a waypoint the path is made of
two such arcs.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), ch. 1,
problem 5; Stillwell, "Geometry of Surfaces", ch. 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import asinh, cosh, greatest, hypot, least, numbers, sqrt, tanh, where

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), ch. 1, problem 5'


def optical_length(x, y, dy, p):
    return p.H * ca.sqrt(1 + dy**2) / y


def speed(q, dq):
    return ca.norm_2(dq) / q[1]


@dataclass(frozen=True)
class Semicircle:
    """The geodesic between two points above y = 0."""

    start: tuple[Any, Any]
    end: tuple[Any, Any]

    @classmethod
    def between(
        cls, number: Callable[[float], Any], start: tuple[float, float], end: tuple[float, float]
    ) -> Semicircle:
        """That between two points in the arithmetic of ``number``."""
        return cls((number(start[0]), number(start[1])), (number(end[0]), number(end[1])))

    @property
    def distance(self) -> float:
        """The hyperbolic distance."""
        (x0, y0), (x1, y1) = self.start, self.end
        return 2 * asinh(hypot(x1 - x0, y1 - y0) / (2 * sqrt(y0 * y1)))

    def y(self, x: Any) -> np.ndarray:
        """The height at x."""
        (x0, y0), (x1, y1) = self.start, self.end
        x = numbers(x)
        chord = (y0**2 * (x1 - x) + y1**2 * (x - x0)) / (x1 - x0)
        return sqrt(chord + (x - x0) * (x1 - x))

    def q(self, t: Any) -> np.ndarray:
        """The point a fraction t of the distance along."""
        (x0, y0), (x1, y1) = self.start, self.end
        middle = (x0 + x1) / 2 + (y1 - y0) * (y1 + y0) / (2 * (x1 - x0))
        radius = hypot(x0 - middle, y0)
        s = asinh((x0 - middle) / y0) + self.distance * numbers(t)
        return np.array([middle + radius * tanh(s), radius / cosh(s)])


def ray(start: tuple[float, float], end: tuple[float, float], H: float, case: str, statement: str) -> vc.Reference:
    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        arc = Semicircle.between(number, start, end)
        return number(H) * arc.distance, arc.y

    return vc.Reference(
        name="half_plane" + case,
        problem=vc.Problem(optical_length, vc.Fixed(*start), vc.Fixed(*end), parameters={"H": H}, name="half_plane"),
        exact=vc.Exact.of(form, "semicircle"),
        source=SOURCE,
        statement=statement,
    )


def oblique(number: Callable[[float], Any]) -> tuple[Any, Any]:
    arc = Semicircle.between(number, (0, 1), (1, 2))
    return arc.distance, arc.q


def waypoint(number: Callable[[float], Any]) -> tuple[Any, Any]:
    there, back = Semicircle.between(number, (0, 1), (1, 2)), Semicircle.between(number, (1, 2), (3, 1))
    return (
        there.distance + back.distance,
        lambda x: where(numbers(x) < 1, there.y(least(x, number(1))), back.y(greatest(x, number(1)))),
    )


references = (
    ray((0, 1), (2, 2), 1.0, "", "The geodesic of the hyperbolic plane between two points."),
    ray((0, 0.1), (2, 0.1), 1.0, "/low", "A geodesic between points close to the boundary, steep at both ends."),
    ray((0, 1), (3, 0.5), 1.5, "/ray", "The light ray in a medium of index 1.5/y."),
    vc.Reference(
        name="half_plane/curve",
        problem=vc.Curve(speed, vc.At((0, 1)), vc.At((1, 2))),
        exact=vc.Exact.of(oblique, "semicircle"),
        source=SOURCE,
        statement="The geodesic of the hyperbolic plane as a curve.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="half_plane/waypoint",
        problem=vc.Problem(optical_length, vc.Fixed(0, 1), vc.Fixed(3, 1), [vc.Through(1, 2)], parameters={"H": 1.0}),
        exact=vc.Exact.of(waypoint, "two semicircles"),
        source=SOURCE,
        statement="The shortest path of the hyperbolic plane through a waypoint.",
        inapplicable=_inapplicable.WAYPOINT,
    ),
)
