"""The least polygons between the ends, of which no curve is known: where the line between them led to no minimum.

Over lattices about that line the least polygons are found, and moved by iterative dynamic programming on ever more
pieces until they are near a minimum. They come with a mesh that holds what they hold: a direct method that begins so
has little left to do, wherever the functional is not convex on the way from the line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.existence.along_directions import along_directions
from varcalc.existence.directions import Departures, polygonal, stated_at_points
from varcalc.existence.moved_polygons import marked, refined
from varcalc.existence.polygons import NEAR, PIECES, PIECES_ACROSS, PolygonLattice, Valley, across_the_landscape
from varcalc.existence.together import AlongAxes, together
from varcalc.formulation import Form, formulate
from varcalc.problem.conditions import Holonomic, Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem

MOST = 3
"""Polygons that are handed out, the lowest first; twice as many are begun with."""
SAME_POLYGON = 1e-2
"""Departure, in units of the extent, of polygons that are one."""
SEEN = 65
"""Vertices of the polygon that stands for the line between the ends, which may go through points."""


def least_polygons(problem: Functional) -> list[Valley]:
    """The lowest polygons as curves of the problem, with the marks of a mesh; none where there is no lattice."""
    if not _polygonal(problem):
        return []
    assert isinstance(problem, Problem)
    departures = from_line(formulate(problem))
    with np.errstate(all="ignore"):
        axes, x, starts, step = _on_lattices(departures, _at_rest(problem))
        if not len(starts):
            return []
        landscape = AlongAxes(departures, axes)
        x, y, values = refined(landscape, x, starts, step, MOST)
    found = [Valley(x, landscape.along(_drawn(x, row))(x).T, float(v), False) for row, v in zip(y, values, strict=True)]
    return list(map(marked, _distinct(found)))


def in_the_middle(problem: Functional, valley: Valley) -> Valley:
    """The polygon with its pieces in an order in which what rises or falls most lies half way.

    Where L is without x that may lie anywhere, if nothing but two fixed ends is asked of one function.
    """
    plain = not problem.constraints and problem.start.fixed and problem.end.fixed and valley.y.shape[1] == 1
    if not plain or ca.depends_on(problem.integrand, problem.symbols.x):
        return valley
    return _turned(valley)


def _polygonal(problem: Functional) -> bool:
    """Whether curves are graphs between two abscissae that polygons stand for."""
    if not isinstance(problem, Problem) or problem.order > 1 or formulate(problem).stated.is_lifted:
        return False
    held = any(isinstance(c, Holonomic | Isoperimetric) for c in problem.constraints)
    if held or any(problem.slides) or problem.start.periodic:
        return False
    return stated_at_points(problem).vectorised


def from_line(form: Form) -> Departures:
    """The departures from the curve that a form is begun with."""
    x = np.union1d(np.linspace(*form.span, SEEN), form.conditions.knots)
    levels = [0.0] * len(form.problem.constraints)
    line = polygonal(x, form.start.curve(x))
    return Departures(form.problem, line, form.span, levels, form.problem.unknown_guesses.tolist())


def _at_rest(problem: Problem) -> float | None:
    """The unit of a lattice whose polygons rest on the levels of both ends; None where these are not two."""
    ends = np.array([end.values(problem.n)[0] for end in (problem.start, problem.end)])
    apart = float(np.abs(np.diff(ends))[0]) if problem.n == 1 else 0.0
    return apart / (PIECES * NEAR[1]) if apart > 0 else None


def _on_lattices(departures: Departures, unit: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The axes (k, n), vertices x, departures (P, K + 1, k) of the lowest polygons, and the steps (k,) of a lattice."""
    looked = [(along, PolygonLattice(along, np.zeros_like, unit)) for along in along_directions(departures)]
    across = [across_the_landscape(along, np.zeros_like) for along, _ in looked]
    alone = [along for along, _ in looked if np.count_nonzero(along.shares) == 1]
    axes, own = np.array([a.direction for a in alone]), np.array([a.shares for a in alone]) > 0
    x = np.union1d(np.linspace(*departures.span, PIECES_ACROSS + 1), departures.waypoints)
    found, steps = [], []
    for (along, about), other in zip(looked, across, strict=True):
        for lattice in (about, other):
            if lattice is not None:
                lowest = sorted(lattice.valleys(), key=lambda v: v.value)[:MOST]
                found += [(v.value, v(x)[0][:, None] * (own @ along.shares)) for v in lowest]
                steps.append(np.median(np.diff(lattice.nodes, axis=1)))
    boxes = together([(*pair, other) for pair, other in zip(looked, across, strict=True)])
    found += [(v.value, v(x).T) for box in boxes for v in box.distinct()[:MOST]]
    found.sort(key=lambda f: f[0])
    step = float(min(steps)) * np.ones(len(axes))
    return axes, x, np.array([polygon for _, polygon in found[: 2 * MOST]]), step


def _drawn(x: np.ndarray, y: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda at: np.array([np.interp(at, x, row) for row in y.T])


def _distinct(found: list[Valley]) -> list[Valley]:
    """The valleys of which none is a lower one, the lowest first."""
    kept: list[Valley] = []
    for valley in sorted(found, key=lambda v: v.value):
        room = SAME_POLYGON * float(np.ptp(valley.y, axis=0).max())
        if np.isfinite(valley.value) and all(np.abs(valley.y - other.y).max() > room for other in kept):
            kept.append(valley)
    return kept


def _turned(valley: Valley) -> Valley:
    """The polygon with its pieces in an order in which what rises or falls most lies half way."""
    rises = np.diff(valley.y, axis=0)[:, 0]
    size = np.abs(rises)
    if not size.any():
        return valley
    turned = np.roll(rises, round(0.5 * (len(rises) - 1) - float(size @ np.arange(len(rises)) / size.sum())))
    y = valley.y[0] + np.concatenate([[0.0], np.cumsum(turned)])[:, None]
    return replace(valley, y=y)
