"""Curves to draw, and how far apart they are.

Closed ones, whose place and start may be free, are laid upon each other before they are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Curve

DRAWN_POINTS = 501
"""Points a curve is drawn with, denser at the ends, where it may be steep."""

ALIGNED = "place and start moved to coincide"
"""Said where closed curves are drawn upon each other: the functional does not tell where one lies or begins."""
ENVELOPE = 8
"""Samples to either side over which a line of differences takes its largest value, so that it can be read."""

Points = np.ndarray
"""Shape (n, m): m points of n components."""


@dataclass(frozen=True)
class DrawnCurve:
    """A curve to draw: ``at`` maps parameters of shape (m,) within ``span`` to points of shape (n, m)."""

    label: str
    colour: str
    at: Callable[[np.ndarray], Points]
    span: tuple[float, float]
    closed: bool = False

    def samples(self) -> np.ndarray:
        """Parameters to draw the curve at, (m,)."""
        start, end = self.span
        return start + (end - start) * (1 - np.cos(np.linspace(0, np.pi, DRAWN_POINTS))) / 2


def shaped(curve: Callable[[np.ndarray], object], n: int) -> Callable[[np.ndarray], Points]:
    """``curve`` with its result in shape (n, m), whether it is scalar, constant or a vector."""
    return lambda s: np.broadcast_to(np.asarray(curve(s), dtype=float), (n, s.size))


def distance_along(line: DrawnCurve, reference: DrawnCurve, along: bool) -> tuple[np.ndarray, np.ndarray]:
    """Places on ``line`` and their distances from ``reference``.

    Graphs are compared at equal abscissae, over what both cover. Curves that
    are not graphs are compared as sets of points, since their parameters need
    not run alike.
    """
    s = line.samples()
    if along:
        return s, distance_to(reference, line.at(s))
    s = s[(s >= reference.span[0]) & (s <= reference.span[1])]
    return s, np.linalg.norm(line.at(s) - reference.at(s), axis=0)


def distance_to(reference: DrawnCurve, points: Points) -> np.ndarray:
    """The distance of each point, shape (n, m), from the curve ``reference``."""
    return np.linalg.norm(points - reference.at(nearest(reference, points)), axis=0)


def nearest(reference: DrawnCurve, points: Points) -> np.ndarray:
    """Where on ``reference`` the foot of each point (n, m) lies.

    From the nearest sample, Newton's iteration moves along the curve until the
    way to the point is perpendicular to the tangent.
    """
    start, end = reference.span
    samples = np.linspace(start, end, 4 * DRAWN_POINTS)
    away = np.linalg.norm(points[:, :, None] - reference.at(samples)[:, None, :], axis=0)
    s = samples[np.argmin(away, axis=1)]
    step = 1e-5 * (end - start)
    for _ in range(4):
        left, right = np.maximum(s - step, start), np.minimum(s + step, end)
        tangent = (reference.at(right) - reference.at(left)) / (right - left)
        ahead = np.sum(tangent * (points - reference.at(s)), axis=0) / np.sum(tangent**2, axis=0)
        s = start + np.mod(s + ahead - start, end - start) if reference.closed else np.clip(s + ahead, start, end)
    return s


def envelope(values: np.ndarray) -> np.ndarray:
    """The largest of the neighbouring values, at each place."""
    padded = np.pad(values, ENVELOPE, mode="edge")
    return np.nanmax(np.lib.stride_tricks.sliding_window_view(padded, 2 * ENVELOPE + 1), axis=-1)


def is_closed(problem: Functional) -> bool:
    """True for a closed :class:`varcalc.Curve`."""
    return isinstance(problem, Curve) and problem.start.periodic


def free_directions(problem: Functional) -> np.ndarray:
    """Along which coordinates a closed curve may be moved at no cost, as n truth values.

    Those that occur neither in the Euler-Lagrange equations of the functional
    and its prescribed integrals, nor in any pathwise constraint, as far as
    the formulas show it: terms that would cancel are not looked for.
    """
    integrals = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    pathwise = [t.expression for t in problem.traced if not isinstance(t.constraint, Isoperimetric)]
    equations = [Lagrangian(problem.symbols, e).euler_lagrange for e in (problem.integrand, *integrals)]
    by_place = ca.jacobian(ca.vertcat(*equations, *pathwise), problem.symbols.y)
    return np.array(ca.DM(by_place.sparsity(), 1)).any(axis=0) == 0


def aligned(line: DrawnCurve, reference: DrawnCurve, free: np.ndarray) -> DrawnCurve:
    """A closed curve with its middle moved onto that of another along ``free``, beginning where that one begins."""
    once = np.arange(DRAWN_POINTS) / DRAWN_POINTS
    move = np.where(free, reference.at(once).mean(axis=1) - line.at(once).mean(axis=1), 0.0)[:, None]
    moved = replace(line, at=lambda t: line.at(t) + move)
    (first,) = nearest(moved, reference.at(np.zeros(1)))
    return replace(line, at=lambda t: moved.at(np.mod(t + first, 1.0)))
