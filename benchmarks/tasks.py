"""The work that every package is given: functionals of a graph, and descents from rest, with their exact values.

A peer takes a graph y(x) as the control problem y' = u, z' = L(x, y, u), and a
descent as the motion of the bead in time, as its users do. Functions are
written once, in terms of the elementary functions ``m`` of whatever package asks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems import great_circle, spheroid
from varcalc.problems._curves import Catenary, Cycloid

GRAVITY = 9.81
FLATTENING = spheroid.EARTH["f"]
SHIFT = 1e-3
"""Relative change of the ends from one repeat to the next: no solve is of a problem that was solved before."""

Integrand = Callable[[Any, Any, Any, Any], Any]
"""(m, x, y, slope) to a number of m's kind."""


@dataclass(frozen=True)
class Graph:
    """Make the integral of ``cost`` least among graphs between two points, that of ``held`` being ``level``."""

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    cost: Integrand
    exact: float
    held: Integrand | None = None
    level: float = 0.0

    def problem(self) -> vc.Problem:
        """The same for varcalc, its functions new."""
        held = self.held
        limits = [] if held is None else [vc.Isoperimetric(lambda x, y, dy: held(ca, x, y, dy), self.level)]
        return vc.Problem(lambda x, y, dy: self.cost(ca, x, y, dy), vc.Fixed(*self.start), vc.Fixed(*self.end), limits)

    def line(self, x: Any) -> Any:
        """The straight line between the ends, on which everybody starts; bent by as much as a level asks for."""
        along = (x - self.start[0]) / (self.end[0] - self.start[0])
        sag = 0.0 if self.held is None else BENT * (1 if self.name == "isoperimetric" else -1)
        return self.start[1] + (self.end[1] - self.start[1]) * along + sag * along * (1 - along)


BENT = 1.5
"""How far a curve of prescribed length is bent to start with, given to every peer: varcalc finds its own."""


@dataclass(frozen=True)
class Descent:
    """From rest at the origin to a point ``across`` and ``depth`` below in the least time."""

    name: str
    across: float
    depth: float
    exact: float

    def problem(self) -> vc.Problem:
        """The same for varcalc: the functional itself, infinite at the start."""
        return vc.Problem(
            lambda x, y, dy: ca.sqrt((1 + dy**2) / (2 * GRAVITY * y)), vc.Fixed(0, 0), vc.Fixed(self.across, self.depth)
        )


Task = Graph | Descent


def descent(name: str, across: float) -> Callable[[float], Descent]:
    """A descent to a point one deep, by the factor on its distance."""
    return lambda f: Descent(name, f * across, 1.0, Cycloid.through(f * across, 1.0).descent_time(GRAVITY))


def film(f: float) -> Graph:
    """The soap film between equal rings a unit apart."""
    start, end = (-0.5 * f, 1.0), (0.5 * f, 1.0)
    exact = Catenary.over_axis(start, end).moment_about_axis
    return Graph("soap film", start, end, lambda m, x, y, u: y * m.sqrt(1 + u**2), exact)


def chain(f: float) -> Graph:
    """A chain half as long again as its span."""
    return Graph(
        "chain", (0.0, 0.0), (1.0, 0.0), lambda m, x, y, u: y * m.sqrt(1 + u**2),
        Catenary.of_length(0, 1, 0, 1.5 * f).moment_about_start, lambda m, x, y, u: m.sqrt(1 + u**2), 1.5 * f,
    )  # fmt: skip


def shore(f: float) -> Graph:
    """Most land between a shore and a fence of given length: an arc of a circle, area R^2 (a - sin a cos a)."""
    from scipy.optimize import brentq

    length = 1.3 * f
    half_angle = brentq(lambda a: a / math.sin(a) - length, 1e-3, 3.0, xtol=1e-15)
    radius = 0.5 / math.sin(half_angle)
    return Graph(
        "isoperimetric", (0.0, 0.0), (1.0, 0.0), lambda m, x, y, u: -y,
        -(radius**2) * (half_angle - math.sin(half_angle) * math.cos(half_angle)),
        lambda m, x, y, u: m.sqrt(1 + u**2), length,
    )  # fmt: skip


def circle(f: float) -> Graph:
    """A great circle to a point not far from the antipode, polar angle as a function of the azimuth."""
    start, end = (0.0, 1.3), (3.0 * (2 - f), 1.8)
    exact = great_circle.angle_between(start[1], end[1], end[0])
    return Graph("great circle", start, end, lambda m, x, y, u: m.sqrt(u**2 + m.sin(y) ** 2), exact)


def ray(f: float) -> Graph:
    """A ray under an index that falls linearly with height, n = 1.5 (1 - y)."""
    exact = 1.5 * Catenary.over_axis((0, 1), (f, 1)).moment_about_axis
    return Graph("linear-index ray", (0.0, 0.0), (f, 0.0), lambda m, x, y, u: 1.5 * (1 - y) * m.sqrt(1 + u**2), exact)


def geodesic(f: float) -> Graph:
    """A geodesic of the Earth over its northernmost point, in equatorial radii, latitude by longitude."""
    exact = spheroid.Geodesic.between({"a": 1.0, "f": FLATTENING}, 0.7, 0.75, 1.8 * f, vertex=True).length
    eccentricity2 = FLATTENING * (2 - FLATTENING)

    def length(m: Any, x: Any, y: Any, u: Any) -> Any:
        across = 1 / m.sqrt(1 - eccentricity2 * m.sin(y) ** 2)
        return m.sqrt(((1 - eccentricity2) * across**3 * u) ** 2 + (across * m.cos(y)) ** 2)

    return Graph("spheroid geodesic", (0.0, 0.7), (1.8 * f, 0.75), length, exact)


TASKS: dict[str, Callable[[float], Task]] = {
    "brachistochrone (1,1)": descent("brachistochrone (1,1)", 1.0),
    "brachistochrone (5,1)": descent("brachistochrone (5,1)", 5.0),
    "soap film": film,
    "chain": chain,
    "isoperimetric": shore,
    "great circle": circle,
    "linear-index ray": ray,
    "spheroid geodesic": geodesic,
}
"""Each task by the factor on one of its ends (or on its length), 1 + SHIFT * repeat."""
