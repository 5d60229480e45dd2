"""Least polygons through a box of departures from a known curve that keep a level.

By its multiplier a level makes of a valley a slope, or a hill, elsewhere: what lies there is seen where what is summed
of the level on the way is one more coordinate. The least polygons that come to a node with so much of it are found by
dynamic programming (Joksch, "The shortest route problem with constraints", J. Math. Anal. Appl. 14, 1966).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from varcalc.existence.directions import Departures
from varcalc.existence.moved_polygons import polygon_costs
from varcalc.existence.polygons import Valley
from varcalc.existence.together import AlongAxes, Looked, ranges
from varcalc.solution import Solution

PIECES_LEVELLED = {1: 12, 2: 8, 3: 6}
"""Pieces of the polygons of so many functions; of more there is no box."""
FEWEST_SUMS, MOST_SUMS, SUMS_OF_ALL = 8, 64, 600_000
"""How many sums of the level are told apart, and how many with all the pairs of nodes they are carried on between."""
MOST_LEVELS = 2
"""Levels up to which there is a box for each."""
SAME = 0.5
"""Steps by which two polygons differ at most that are one."""
FARTHEST_SUM = 2.0
"""The largest sum on the way, in units of the level, or of what the known curve sums."""
ROUNDED_APART = 0.5 * (np.sqrt(5) - 1)
"""By how much the sums of a piece are rounded otherwise than those of the one before: what is alike would add up."""
PASSED = (0.25, 0.5, 0.75)
"""Where on the way every node of the box is passed by a polygon."""
RIDGE = 0.03
"""Height of what lies between two valleys, in units of what the known curve sums: sums are told no more finely."""
BOXES, NARROWER = 4, 0.7
"""Boxes, each about what of the last was worth following; how much smaller one is that is another."""
WORTH_LEVELLED = 1.0
"""How far above the known curve one may lie to be followed, in units of what that sums."""
NEARLY_LOWER = 0.1
"""How far above the known value polygons that alternate may lie, in the same units: their slopes are few."""
SPREADS = 2.0 ** np.arange(-2.0, 4.0)
"""Half distances of two slopes that a piece has by halves, in units of the box's height over the interval."""


class KeepingLevel(AlongAxes):
    """The functional of the curves c + t A beside one level, by its number, that they keep."""

    def __init__(self, level: int, departures: Departures, axes: np.ndarray) -> None:
        super().__init__(departures, axes)
        self.pieces, self._level = PIECES_LEVELLED[len(axes)], level
        self._mixed = departures.mixed_by_level(level)

    def paths(self, x: np.ndarray, box: np.ndarray) -> SummedPaths:
        """The least polygons with vertices at x through the nodes of a box (J, k) that keep the level."""
        costs, summed = self._parts(x, np.broadcast_to(box, (1, len(x), *box.shape)), self.spreads(box))
        barred = np.where((self.kept(x)[:, None] & (box != 0)).any(-1), np.inf, 0.0)
        begun, ended = (self.at_end(side, box) + barred[side] for side in (0, 1))
        low, high = self.departures.levels[self._level].interval
        own = self._parts(x, np.zeros((1, len(x), 1, box.shape[1])), np.zeros(1))[1]
        limits = [abs(limit) for limit in (low, high) if np.isfinite(limit)]
        size = FARTHEST_SUM * max(*limits, float(np.abs(own).sum()))
        return SummedPaths(costs + barred[1:, None, None], summed, (begun, ended), (low, high), size)

    def spreads(self, box: np.ndarray) -> np.ndarray:
        """Half distances of the slopes of a piece, the first of them 0: others where the level tells them from one."""
        if not self._mixed:
            return np.zeros(1)
        return np.append(0.0, SPREADS * float(np.ptp(box)) / (self.span[1] - self.span[0]))

    def sums(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """What polygons y (P, K + 1, k) sum, (P,), with the level by its multiplier."""
        at_ends = self.at_end(0, y[:, 0]) + self.at_end(1, y[:, -1])
        return self.costs(x, y[:, :, None])[..., 0, 0].sum(1) + at_ends

    def _parts(self, x: np.ndarray, nodes: np.ndarray, spreads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What pieces between nodes (1, K + 1, S, k) add to the functional, and to the level, (K, V, S, S).

        Each of them has slopes apart from its own by plus and minus one of the ``spreads`` (V,), by halves.
        """

        def told(x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
            """What is integrated, and the level, at points with a slope apart by each of the spreads: (K, V, ...)."""
            slopes = np.stack([v + turn * spread for spread in spreads for turn in turns])
            rows = (list(np.moveaxis(t @ self.axes, -1, 0)) for t in (y, slopes))
            shape = np.broadcast_shapes(x.shape, y.shape[:-1], slopes.shape[:-1])
            parts = self.departures.beside_level(self._level, x, *rows)
            return np.stack(
                [np.broadcast_to(part, shape).reshape(-1, len(turns), *shape[1:]).mean(1) for part in parts]
            )

        turns = (1, -1) if len(spreads) > 1 else (0,)
        costs, summed = polygon_costs(told, x, nodes)[:, :, 0].swapaxes(1, 2)
        admitted = np.isfinite(summed)
        return np.where(admitted, costs, np.inf), np.where(admitted, summed, 0.0)


class SummedPaths:
    """The least paths through rows of J nodes each, of which a second sum ends within an ``interval``.

    From node to node a piece leads in one of V ways. Pieces add the ``costs`` and what is ``summed``, (K, V, J, J), and
    ends what is ``at_ends``, (J,) each. Sums on the way are told apart as finely as many are, as far as ``size``.
    """

    def __init__(
        self, costs: np.ndarray, summed: np.ndarray, at_ends: tuple[np.ndarray, np.ndarray],
        interval: tuple[float, float], size: float,
    ) -> None:  # fmt: skip
        count = min(MOST_SUMS, max(FEWEST_SUMS, SUMS_OF_ALL // costs[0, 0].size))
        first, last = _ranges(np.where(np.isfinite(costs), summed, np.nan), at_ends, interval, size)
        width = max(float((last - first).max()) / (count - 1), 1e-300)
        rounded = np.floor((summed + (first[:-1] - first[1:])[:, None, None, None]) / width + _dithers(len(costs)))
        self._shifts = np.clip(rounded, -count, count).astype(int)
        kept = first[-1] + width * np.arange(count)
        within = np.where((kept >= interval[0] - width) & (kept <= interval[1] + width), 0.0, np.inf)
        begun = np.where(np.arange(count) == round(min(max(-first[0] / width, 0), count - 1)), 0.0, np.inf)
        back, ahead = self._shifts, -self._shifts[::-1].swapaxes(2, 3)
        self._before = _carried(at_ends[0][:, None] + begun, costs, back)
        self._after = _carried(at_ends[1][:, None] + within, costs[::-1].swapaxes(2, 3), ahead)[::-1]

    @property
    def least(self) -> float:
        """What the least path of all costs."""
        return float(np.min(self._before[-1][0] + self._after[-1][0]))

    def through(self, row: int, shape: tuple[int, ...]) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
        """The least costs (J,) by the nodes of a row, and the paths by those beside which none is lower.

        The nodes make a box of a ``shape``. A path is its nodes (K + 1,) and the ways of its pieces (K,).
        """
        values = self._before[row][0] + self._after[row][0]
        least = values.min(axis=1)
        lowest = np.flatnonzero(_minima(least.reshape(shape)).ravel() & np.isfinite(least))
        return least, [self._path(row, node, int(np.argmin(values[node]))) for node in lowest.tolist()]

    def _path(self, row: int, node: int, place: int) -> tuple[np.ndarray, np.ndarray]:
        """The path by a node with the sum at a ``place``."""
        nodes = self._shifts.shape[-1]
        path, ways, at = [node], [], (node, place)
        for k in range(row, 0, -1):
            way, before = divmod(int(self._before[k][1][at]), nodes)
            at = before, at[1] - int(self._shifts[k - 1][way, before, at[0]])
            path.insert(0, before)
            ways.insert(0, way)
        at = node, place
        for k in range(row, len(self._shifts)):
            way, after = divmod(int(self._after[k][1][at]), nodes)
            at = after, at[1] + int(self._shifts[k][way, at[0], after])
            path.append(after)
            ways.append(way)
        return np.array(path), np.array(ways)


def _dithers(count: int) -> np.ndarray:
    return (np.arange(count) * ROUNDED_APART % 1.0)[:, None, None, None]


def _ranges(
    summed: np.ndarray, at_ends: tuple[np.ndarray, np.ndarray], interval: tuple[float, float], size: float
) -> tuple[np.ndarray, np.ndarray]:
    """From where to where sums can lie at each row (K + 1,) that begin with 0 and end within the interval.

    ``summed`` (K, V, J, J) is NaN where no path leads.
    """
    ends = [np.where(np.isfinite(cost), 0.0, np.nan) for cost in at_ends]
    bounds = []
    for least in (np.fmin.reduce, np.fmax.reduce):
        ahead, left = [ends[0]], [ends[1]]
        pieces = least(summed, axis=1)
        for piece in pieces:
            ahead.append(least(ahead[-1][:, None] + piece, axis=0))
        for piece in pieces[::-1]:
            left.insert(0, least(piece + left[0], axis=1))
        bounds.append([[float(least(row)) for row in rows] for rows in (ahead, left)])
    (low, left_low), (high, left_high) = np.array(bounds)
    first = np.maximum(np.maximum(low, interval[0] - left_high), -size)
    last = np.minimum(np.minimum(high, interval[1] - left_low), size)
    # where no path leads there is no sum
    return np.nan_to_num(np.minimum(first, last)), np.nan_to_num(np.maximum(first, last))


def _carried(begun: np.ndarray, costs: np.ndarray, shifts: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """At each row the least costs (J, S) to come to a node with a sum, and where they come from, (J, S).

    They begin with the costs ``begun`` (J, S); pieces add the ``costs`` and shift the sums, (K, V, J, J). Where they
    come from is the number of the node, and J more for each way before that of the piece.
    """
    nodes, count = begun.shape
    found = [(begun, np.zeros(begun.shape, dtype=int))]
    rows = np.tile(np.arange(nodes), costs.shape[1])[:, None, None] * (3 * count) + np.arange(count, 2 * count)
    for cost, shift in zip(costs.reshape(len(costs), -1, nodes), shifts.reshape(len(costs), -1, nodes), strict=True):
        reached = np.pad(found[-1][0], [(0, 0), (count, count)], constant_values=np.inf).ravel()
        sums = reached[rows - shift[:, :, None]]  # (V J before, J, S)
        sums += cost[:, :, None]
        before = np.argmin(sums, axis=0)
        found.append((np.take_along_axis(sums, before[None], axis=0)[0], before))
    return found


def _minima(values: np.ndarray) -> np.ndarray:
    """Where in a box nothing next to a value along an axis is lower."""
    found = np.ones(values.shape, dtype=bool)
    for axis in range(values.ndim):
        rows = np.moveaxis(values, axis, 0)
        beside = np.pad(rows, [(1, 1)] + [(0, 0)] * (values.ndim - 1), constant_values=np.inf)
        found &= np.moveaxis((rows <= beside[:-2]) & (rows <= beside[2:]), 0, axis)
    return found


@dataclass(frozen=True)
class Alternating:
    """A polygon, with departures y (K + 1,) of one function, whose pieces have two slopes each by halves.

    They lie apart from its own by plus and minus the ``spreads`` (K,).
    """

    value: float
    x: np.ndarray
    y: np.ndarray
    spreads: np.ndarray


class LevelledPolygons:
    """The least polygons that keep a level, through boxes of departures, the first of them from low to high (k,)."""

    def __init__(self, landscape: KeepingLevel, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
        self.landscape, self._x = landscape, x
        own = np.zeros((1, len(x), len(low)))
        self.summed = float(np.abs(landscape.costs(x, own[:, :, None])).sum())
        self.own_value = float(landscape.sums(x, own)[0])
        self._found: list[tuple[float, np.ndarray, np.ndarray]] = []
        self.alternating: Alternating | None = None
        for _ in range(BOXES):
            levels = landscape.levels(low, high)
            box = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, len(levels))
            passed = self._through(box, levels)
            first, last = low, high
            low, high = np.array([_around(row, worth) for row, worth in zip(levels, passed, strict=True)]).T
            if ((high - low) > NARROWER * (last - first)).all():
                break

    def _through(self, box: np.ndarray, levels: list[np.ndarray]) -> list[np.ndarray]:
        """Whether the levels of each axis of a box are passed by a polygon that is worth following."""
        paths, shape = self.landscape.paths(self._x, box), tuple(map(len, levels))
        steps = np.array([self.landscape.step(row) for row in levels])
        kept = self.landscape.kept(self._x)
        spreads = self.landscape.spreads(box)
        passed, own = np.zeros(shape, dtype=bool), np.unravel_index(np.flatnonzero((box == 0).all(1))[0], shape)
        for row in (round(share * (len(self._x) - 1)) for share in PASSED):
            least, found = paths.through(row, shape)
            least = least.reshape(shape)
            for path, ways in found:
                if spreads[ways].any():  # no polygon itself, but what finer and finer ones come to
                    mixed = Alternating(float(least.ravel()[path[row]]), self._x, box[path][:, 0], spreads[ways])
                    self.alternating = min(self.alternating or mixed, mixed, key=lambda found: found.value)
                    continue
                if not _beyond_ridge(least, own, np.unravel_index(path[row], shape), RIDGE * self.summed):
                    continue
                y = np.where(kept, 0.0, box[path])
                self._found.append((float(self.landscape.sums(self._x, y[None])[0]), y, SAME * steps))
            passed |= least < paths.least + WORTH_LEVELLED * self.summed
        return [np.asarray(passed.any(tuple(k for k in range(len(shape)) if k != axis))) for axis in range(len(shape))]

    def may_be_lower(self, best: Solution) -> bool:
        """Whether polygons that alternate lie so low that what they lead to may be lower than a solution."""
        known = best.problem.sign * best.value + NEARLY_LOWER * self.summed
        return self.alternating is not None and self.alternating.value < known

    def distinct(self) -> list[Valley]:
        """Those that are worth following, the lowest first, of which none comes near another all along."""
        kept, found = [np.zeros_like(self._x[:, None])], []
        for value, y, room in sorted(self._found, key=lambda found: found[0]):
            if not value < self.own_value + WORTH_LEVELLED * self.summed:
                break
            if all((np.abs(y - other) > room).any() for other in kept):
                kept.append(y)
                found.append(Valley(self._x, y, value, False))
        return found


def _beyond_ridge(least: np.ndarray, own: tuple[int, ...], other: tuple[int, ...], height: float) -> bool:
    """Whether on the straight way in a box from one node to an``other`` one both are lower by a height than a third."""
    count = 1 + max(abs(int(a) - int(b)) for a, b in zip(own, other, strict=True))
    way = [np.round(np.linspace(a, b, count)).astype(int) for a, b in zip(own, other, strict=True)]
    along = least[tuple(way)]
    return bool(along.max() > max(along[0], along[-1]) + height)


def _around(levels: np.ndarray, passed: np.ndarray) -> tuple[float, float]:
    """The levels just beyond those that are passed; those beside the known curve's where none are."""
    within = np.flatnonzero(passed) if passed.any() else np.flatnonzero(levels == 0)
    return float(levels[max(within[0] - 1, 0)]), float(levels[min(within[-1] + 1, len(levels) - 1)])


def keeping_levels(looked: Sequence[Looked]) -> list[LevelledPolygons]:
    """The least polygons about a curve that was looked about that keep one level each; none of a closed curve."""
    departures = looked[0][0].departures
    few = len(departures.axes) in PIECES_LEVELLED and len(departures.levels) <= MOST_LEVELS
    if not few or departures.closed or departures.problem.order > 1:
        return []
    return [LevelledPolygons(*ranges(partial(KeepingLevel, k), looked)) for k in range(len(departures.levels))]
