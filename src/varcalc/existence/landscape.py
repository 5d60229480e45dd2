"""The levels of a landscape: where L has several minima in y, a lattice from the lowest of its turns to the highest.

A lattice about a curve is fine near it and coarse far from it. Hills and wells have places and widths of their own:
along each of some vertical lines it is seen where L turns, and between these places the levels lie evenly, with the
ones on which a resting curve is cheapest among them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from varcalc.existence.polygons import Lattice, values_of
from varcalc.problem.problem import Problem

PIECES, LEVELS = 24, 64
"""Pieces of the polygons, and levels that lie evenly."""
SHIFTS = 2.0 ** np.arange(-10, 6, 0.25)
"""Departures at which L is asked for its turns, either way, in units of the larger of the extent and the interval."""
NOISE = 1e-7
"""Change of L from one to the next, relative to its size there, that is none."""
NEAREST = 8
"""Turns of a vertical line that are taken, the nearest ones: what is periodic has no end of them."""
BEYOND = 0.25
"""Share of their range by which the levels go beyond the turns."""
CLOSER = 8
"""Times as many levels at which the cheapest ones for a curve at rest are looked for."""


def across_the_landscape(problem: Problem, ordinates: Callable[[np.ndarray], np.ndarray]) -> Lattice | None:
    """The lattice of levels, with the curve's own ordinates among them; None where L has no two minima in y."""
    x = np.linspace(*problem.span, PIECES + 1)
    c = ordinates(x)
    turns = _turns(problem, x, c)
    if turns is None:
        return None
    low, high = min(turns.min(), c.min()), max(turns.max(), c.max())
    room = BEYOND * (high - low)
    levels = np.linspace(low - room, high + room, LEVELS)
    levels = np.union1d(levels, _rests(problem, x, levels))
    nodes = np.column_stack([c, np.broadcast_to(levels, (len(x), len(levels)))])
    order = np.argsort(nodes, axis=1, kind="stable")
    return Lattice(problem, x, np.take_along_axis(nodes, order, 1), np.argmin(order, axis=1), float(high - low))


def _turns(problem: Problem, x: np.ndarray, c: np.ndarray) -> np.ndarray | None:
    """The ordinates at which L turns as y goes either way from the curve; None where no line has two minima."""
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / np.diff(x)
    unit = max(float(np.ptp(c)), float(np.ptp(x)))
    y = centre[:, None] + unit * np.concatenate([-SHIFTS[::-1], [0.0], SHIFTS])
    values = values_of(problem, middle[:, None], y, slope[:, None])
    change = np.diff(values)
    told = np.isfinite(change) & (np.abs(change) > NOISE * (np.abs(values[:, 1:]) + np.abs(values[:, :-1])))
    found: list[np.ndarray] = []
    several = False
    for row, at, rates in zip(told, y, change, strict=True):
        steps = np.flatnonzero(row)
        signs = np.sign(rates[steps])
        turning = np.flatnonzero(signs[1:] != signs[:-1])
        if not len(steps):
            continue
        # where a hill's foot is flat there is no turn, but it is as low as a minimum
        feet = (steps[0] > 0 and signs[0] > 0, steps[-1] < len(row) - 1 and signs[-1] < 0)
        several = several or int((signs[turning] < 0).sum()) + sum(feet) > 1
        nearest = np.argsort(np.abs(steps[turning] - len(SHIFTS)), kind="stable")[:NEAREST]
        found.append(at[steps[turning[nearest]] + 1])
    return np.concatenate(found) if several else None


def _rests(problem: Problem, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """The levels on which a curve at rest costs least among its neighbours, by a parabola through three."""
    y = np.linspace(levels[0], levels[-1], CLOSER * len(levels))
    values = values_of(problem, 0.5 * (x[1:] + x[:-1])[:, None], y, np.zeros(1)).sum(0)
    inner = values[1:-1]
    k = 1 + np.flatnonzero((inner < values[:-2]) & (inner <= values[2:]))
    before, here, after = values[k - 1], values[k], values[k + 1]
    return y[k] + 0.5 * (y[1] - y[0]) * (before - after) / (before - 2 * here + after)
