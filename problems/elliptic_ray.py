"""Light rays in n = n0 sqrt(2 - (r/R)^2), Luneburg's lens: ellipses about the centre.

    S[q] = integral of n |dq|,  or, in polar coordinates,  S[r] = integral of n sqrt(r^2 + r'^2) dtheta

In units of R and with dsigma = n0 ds/n the ray equation is r'' = -r, so that
r = A cos(sigma) + p sin(sigma), |p|^2 = 2 - |A|^2: an ellipse,
r^2 = r0^2 (1 + e)/(1 + e cos(2 theta)) from its axis. For given ends c = cos(sigma)
solves 2 c^2 - 2 (A.B) c + |A|^2 + |B|^2 - 2 = 0, the greater root being the
shorter ray, and S = n0 R (sigma + sin(sigma) (c - A.B)).

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.4.2
and problem 8; Luneburg, "Mathematical Theory of Optics".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import acos, atan2, cos, hypot, numbers, sin, sqrt
from varcalc.problems._roots import increasing_root

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.4.2 and problem 8'
N0, R = 1.5, 2.0
START, END = (2.0, 0.0), (0.5, 1.75)
ANGLE, DISTANCE = math.atan2(END[1], END[0]), math.hypot(*END)


def speed(q, dq, p):
    return p.n0 * ca.sqrt(2 - ca.sumsqr(q) / p.R**2) * ca.norm_2(dq)


def polar_length(x, y, dy, p):
    return p.n0 * ca.sqrt(2 - (y / p.R) ** 2) * ca.sqrt(y**2 + dy**2)


@dataclass(frozen=True)
class Ellipse:
    """r = A cos(sigma) + P sin(sigma) in units of R, from the start to ``sigma``."""

    A: Any
    P: Any
    sigma: Any
    optical_path: Any

    @classmethod
    def between(cls, start: Any, end: Any, index: Any) -> Ellipse:
        """The shorter of the two rays between two points (2,), n0 being the ``index``."""
        A, B = start / R, end / R
        dot = A @ B
        cosine = (dot + sqrt(dot**2 - 2 * (A @ A + B @ B - 2))) / 2
        sigma = acos(cosine)
        P = (B - A * cosine) / sin(sigma)
        return cls(A, P, sigma, index * R * (sigma + sin(sigma) * (cosine - dot)))

    def path(self, sigma: Any) -> Any:
        """Optical path up to sigma, in units of n0 R: the integral of 2 - r^2."""
        s, c = sin(sigma), cos(sigma)
        return sigma - (self.A @ self.A - 1) * s * c - (self.A @ self.P) * s**2

    def point(self, sigma: Any) -> np.ndarray:
        """The point at sigma, in units of R."""
        return np.array([a * cos(sigma) + b * sin(sigma) for a, b in zip(self.A, self.P, strict=True)])

    def q(self, t: Any) -> np.ndarray:
        """The point a fraction t of the optical path along."""

        def covered(sigma: Any) -> tuple[Any, Any]:
            return self.path(sigma), 2 - (self.point(sigma) ** 2).sum(axis=0)

        sigma = increasing_root(covered, 0.0, self.sigma, numbers(t) * self.path(self.sigma))
        return R * self.point(sigma)

    def radius(self, theta: Any) -> Any:
        """The distance from the centre at a polar angle, counted from the start."""
        c, s = cos(theta), sin(theta)
        x, y = self.point(atan2(self.A[0] * s, self.P[1] * c - self.P[0] * s))
        return R * hypot(x, y)


def polar(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The polar coordinates of the end are rounded, and so is the end."""
    theta, r = number(ANGLE), number(DISTANCE)
    end = r * np.array([cos(theta), sin(theta)])
    ellipse = Ellipse.between(np.array([*map(number, START)]), end, number(N0))
    return ellipse.optical_path, ellipse.radius


def curve(number: Callable[[float], Any]) -> tuple[Any, Any]:
    start, end = (np.array([*map(number, point)]) for point in (START, END))
    ellipse = Ellipse.between(start, end, number(N0))
    return ellipse.optical_path, ellipse.q


references = (
    vc.Reference(
        name="elliptic_ray",
        problem=vc.Problem(
            polar_length,
            vc.Fixed(0, START[0]),
            vc.Fixed(ANGLE, DISTANCE),
            parameters={"n0": N0, "R": R},
        ),
        exact=vc.Exact.of(polar, "ellipse"),
        source=SOURCE,
        statement="A light ray in n0 sqrt(2 - (r/R)^2), in polar coordinates.",
    ),
    vc.Reference(
        name="elliptic_ray/curve",
        problem=vc.Curve(speed, vc.At(START), vc.At(END), parameters={"n0": N0, "R": R}),
        exact=vc.Exact.of(curve, "ellipse"),
        source=SOURCE,
        statement="The same light ray as a curve in the plane.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
