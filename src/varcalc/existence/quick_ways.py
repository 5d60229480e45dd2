"""Valleys far from the curve for which little time is needed: where it rests there far longer than the way takes.

On rows that lie evenly a piece that leads to another valley takes as long as all pieces, however quick it had better
be. Between levels at which a curve may rest the rows here lie as close as the cheapest straight way is long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from varcalc.existence.landscape import Landscape
from varcalc.existence.polygons import FINEST_RULE, OWN_LINE, Lattice, Valley, at_ends, values_of
from varcalc.numerics.mesh import composite_gauss, gauss
from varcalc.numerics.runs import runs

STRETCHES = 10
"""Pieces of the interval at whose ends a quick way is looked for."""
HALVED = np.arange(26)
"""Of such a piece, down to the shortest way."""
CHANGE, STEEP = 0.05, 0.3
"""Share of all of a polygon's change that is none, and of the steepest slope that is steep."""
SHIFTS, TIMES_CLOSER, PANELS = 17, 5, 12
LONGER = np.array([0.5, 0.7, 1.0, 1.4, 2.0])
"""Places of a way that are tried at a time, and lengths; how often closer; and panels of a piece that is summed."""
MARKS, COARSER, MOST_COARSER = 8, 3.0, 12
"""Even pieces of the mesh for curves there, and by how much pieces are longer, and how often, away from a way."""


class QuickWays(Lattice):
    """Polygons that change between levels on short pieces, on which no few points tell what they sum."""

    @cached_property
    def _by_rule(self) -> tuple[int, np.ndarray]:
        return FINEST_RULE, self._finely[OWN_LINE]


def quick_ways(across: Lattice, ordinates: Callable[[np.ndarray], np.ndarray]) -> Lattice | None:
    """Polygons between a curve with such ``ordinates`` and levels at rest; None where no way is quick, or worth while.

    It is not where the curve would save less at rest there than the cheapest way costs.
    """
    landscape, (a, b) = across.landscape, across.landscape.span
    if len(across.rests) == 0 or landscape.closed:
        return None
    x = np.union1d(np.linspace(a, b, STRETCHES + 1), landscape.waypoints)
    c, steps = ordinates(x), np.diff(x)
    own = values_of(landscape, 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / steps) * steps
    at_rest = values_of(landscape, 0.5 * (x[1:] + x[:-1]), across.rests[:, None], np.zeros(1)) * steps
    saved = np.fmax(own - at_rest, 0.0).sum(axis=1)
    lengths, costs = _straight_ways(across, x, c)
    ways = max(1, sum(landscape.held))
    cheapest = np.argmin(costs, axis=1)
    worth = saved > ways * costs[np.arange(len(costs)), cheapest]
    if not worth.any() or lengths[cheapest[worth]].min() >= across.steps.max():
        return None
    near = np.unique(lengths[np.clip(cheapest[worth][:, None] + np.arange(-1, 2), 0, len(lengths) - 1)])
    rows = np.unique(np.clip(np.concatenate([x, (x[:, None] + near).ravel(), (x[:, None] - near).ravel()]), a, b))
    nodes = np.column_stack([ordinates(rows), np.tile(across.rests, (len(rows), 1))])
    order = np.argsort(nodes, axis=1, kind="stable")
    nodes, curve = np.take_along_axis(nodes, order, 1), np.argmin(order, axis=1)
    return QuickWays(landscape, rows, nodes, curve, across.reach, across.steep)


def _straight_ways(across: Lattice, x: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths (h,) of straight ways from the curve to each rest, and what they cost on average (rests, h)."""
    shares, weights = gauss(FINEST_RULE)
    shares = 0.5 * (1 + shares)
    lengths = (x[-1] - x[0]) / STRETCHES * 0.5**HALVED
    rise = (across.rests[:, None] - c)[:, None, :, None]
    y = c[:, None] + shares * rise
    values = values_of(across.landscape, x[:, None], y, rise / lengths[:, None, None])
    costs = np.abs(values) @ weights / 2 * lengths[:, None]
    return lengths, np.where(np.isfinite(costs), costs, np.inf).mean(axis=2)


def settled(landscape: Landscape, valley: Valley) -> Valley:
    """The polygon with each of its ways where, and as quick as, it costs least; the rows had them at a few places."""
    way = np.abs(np.diff(valley.y)) > CHANGE * np.ptp(valley.y)
    kept = np.concatenate([[True], way[1:] | way[:-1], [True]])
    x, y = valley.x[kept], valley.y[kept]
    rises = np.abs(np.diff(y))
    room, step = (x[-1] - x[0]) / STRETCHES, float(np.ptp(y)) * CHANGE
    for _ in range(TIMES_CLOSER):
        for k in np.flatnonzero(rises > step).tolist():
            moved = np.repeat(x[None], SHIFTS * len(LONGER), axis=0)
            middle, half = 0.5 * (x[k] + x[k + 1]), 0.5 * (x[k + 1] - x[k])
            middles, halves = np.meshgrid(middle + room * np.linspace(-1, 1, SHIFTS), half * LONGER)
            # a way that begins or ends at an end of the interval goes on doing so
            moved[:, k] = x[0] if k == 0 else np.clip((middles - halves).ravel(), x[k - 1], None)
            moved[:, k + 1] = x[-1] if k == len(x) - 2 else np.clip((middles + halves).ravel(), None, x[k + 2])
            if k == 0:
                moved[:, 1] = np.minimum(x[0] + 2 * halves.ravel(), x[2])
            elif k == len(x) - 2:
                moved[:, k] = np.maximum(x[-1] - 2 * halves.ravel(), x[k - 1])
            sums = _summed(landscape, moved, y)
            if np.isfinite(sums).any():
                x = moved[int(np.nanargmin(np.where(np.isfinite(sums), sums, np.inf)))]
        room /= 0.5 * SHIFTS
    value, apart = float(_summed(landscape, x[None], y)[0]), np.append(True, np.diff(x) > 0)
    return replace(valley, x=x[apart], y=y[apart], value=value)


def _summed(landscape: Landscape, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What polygons with vertices x (m, V), ascending, and ordinates y (V,) sum."""
    shares, weights = composite_gauss(np.linspace(0, 1, PANELS + 1), FINEST_RULE // 2)
    h = np.diff(x)[..., None]
    rise = np.diff(y)[:, None]
    with np.errstate(all="ignore"):
        slopes = np.where(h > 0, rise / h, 0.0)
        values = values_of(landscape, x[:, :-1, None] + h * shares, y[:-1, None] + rise * shares, slopes)
        summed = np.where(h > 0, values * h, np.where(rise == 0, 0.0, np.inf)) @ weights
    return summed.sum(axis=1) + at_ends(landscape, y)


def mesh_for(x: np.ndarray, y: np.ndarray) -> tuple[float, ...]:
    """The vertices of a mesh that holds a curve through x (m,) and y (n, m): ever coarser away from where it is steep.

    Of several functions the one that changes most tells where.
    """
    a, b = float(x[0]), float(x[-1])
    slopes = np.abs(np.diff(y[np.argmax(np.ptp(y, axis=1))]) / np.diff(x))
    found = set(np.linspace(a, b, MARKS + 1)[1:-1].tolist())
    for i, j in runs(slopes > STEEP * slopes.max()):
        first, last = float(x[i]), float(x[j + 1])
        away = (last - first) * np.append(0.0, COARSER ** np.arange(MOST_COARSER) / COARSER)
        found |= {*(first - away).tolist(), *(last + away).tolist(), 0.5 * (first + last)}
    return tuple(sorted(at for at in found if a < at < b))
