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

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), ch. 1, problem 5'


def optical_length(x, y, dy, p):
    return p.H * ca.sqrt(1 + dy**2) / y


def speed(q, dq):
    return ca.norm_2(dq) / q[1]


@dataclass(frozen=True)
class Semicircle:
    """The geodesic between two points above y = 0."""

    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def distance(self) -> float:
        """The hyperbolic distance."""
        (x0, y0), (x1, y1) = self.start, self.end
        return 2 * math.asinh(math.hypot(x1 - x0, y1 - y0) / (2 * math.sqrt(y0 * y1)))

    def y(self, x: Any) -> np.ndarray:
        """The height at x."""
        (x0, y0), (x1, y1) = self.start, self.end
        x = np.asarray(x, dtype=float)
        chord = (y0**2 * (x1 - x) + y1**2 * (x - x0)) / (x1 - x0)
        return np.sqrt(chord + (x - x0) * (x1 - x))

    def q(self, t: Any) -> np.ndarray:
        """The point a fraction t of the distance along."""
        (x0, y0), (x1, y1) = self.start, self.end
        middle = (x0 + x1) / 2 + (y1 - y0) * (y1 + y0) / (2 * (x1 - x0))
        radius = math.hypot(x0 - middle, y0)
        s = math.asinh((x0 - middle) / y0) + self.distance * np.asarray(t, dtype=float)
        return np.array([middle + radius * np.tanh(s), radius / np.cosh(s)])


def ray(start: tuple[float, float], end: tuple[float, float], H: float, case: str, statement: str) -> vc.Reference:
    arc = Semicircle(start, end)
    return vc.Reference(
        name="half_plane" + case,
        problem=vc.Problem(optical_length, vc.Fixed(*start), vc.Fixed(*end), parameters={"H": H}, name="half_plane"),
        exact=vc.Exact(H * arc.distance, arc.y, "semicircle"),
        source=SOURCE,
        statement=statement,
    )


oblique, there, back = Semicircle((0, 1), (1, 2)), Semicircle((0, 1), (1, 2)), Semicircle((1, 2), (3, 1))

references = (
    ray((0, 1), (2, 2), 1.0, "", "The geodesic of the hyperbolic plane between two points."),
    ray((0, 0.1), (2, 0.1), 1.0, "/low", "A geodesic between points close to the boundary, steep at both ends."),
    ray((0, 1), (3, 0.5), 1.5, "/ray", "The light ray in a medium of index 1.5/y."),
    vc.Reference(
        name="half_plane/curve",
        problem=vc.Curve(speed, vc.At((0, 1)), vc.At((1, 2))),
        exact=vc.Exact(oblique.distance, oblique.q, "semicircle"),
        source=SOURCE,
        statement="The geodesic of the hyperbolic plane as a curve.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="half_plane/waypoint",
        problem=vc.Problem(optical_length, vc.Fixed(0, 1), vc.Fixed(3, 1), [vc.Through(1, 2)], parameters={"H": 1.0}),
        exact=vc.Exact(
            there.distance + back.distance,
            lambda x: np.where(np.asarray(x) < 1, there.y(np.minimum(x, 1)), back.y(np.maximum(x, 1))),
            "two semicircles",
        ),
        source=SOURCE,
        statement="The shortest path of the hyperbolic plane through a waypoint.",
        inapplicable=_inapplicable.WAYPOINT,
    ),
)
