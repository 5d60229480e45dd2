"""Least polygons of several functions at once, where hills and wells were seen along some directions.

What lies between two directions is on no lattice along one. A coarse box of departures along all axes of the known
curve is taken first, and the least polygons through its nodes. Of more than four axes those along each direction stand
for them. About each of them the least one in departures along each axis is found, again and again, with ever smaller
steps (Luus, "Iterative Dynamic Programming", 2000, ch. 3): what they end in is no longer bound to the nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from varcalc.existence.along_directions import AlongDirection
from varcalc.existence.directions import Departures
from varcalc.existence.moved_polygons import kept_vertices, moved, polygon_costs
from varcalc.existence.polygons import NEAR, Lattice, Valley
from varcalc.formulation import Sampled

PIECES_TOGETHER = 8
"""Pieces of the polygons through the nodes of the box."""
SIDE = {1: 25, 2: 11, 3: 7, 4: 4}
"""Levels of the box along each of so many axes."""
LEAST_SIDE = 9
"""Levels of more axes, of which no box is taken: the least polygons of each direction are moved."""
CLOSER, EVEN = 65, 0.3
"""Places along an axis at which L is asked for its changes, and the share of the levels that lie evenly."""
MIDDLE = (0.5,)
"""Where L is asked on a piece between two nodes of the box."""
ROWS_PASSED = (0.25, 0.5, 0.75)
"""Where on the way every node of the box is passed by a polygon."""
MOVES = 3
"""How often each axis is moved along with one step."""
MOST_TOGETHER = (160, 60), (40, 20), (12, 12)
"""Polygons that are moved, the lowest first, each time with half the step, each pair on twice as many pieces."""
WORTH_TOGETHER = 0.05
"""How far above the known curve's polygon one may lie to be followed, in units of what the larger of them sums."""
ABOUT, FAR_APART = 2.0, 3.0
"""How far a box about the known curve goes, in extents, and the range of another, in such units, that asks for it."""
SAME = 0.5
"""Steps by which two polygons differ at most that are one."""


class AlongAxes:
    """The functional of the curves c + t A about the curve c, where t are as many functions as there are axes A."""

    pieces = PIECES_TOGETHER
    """Those of the polygons through the nodes of a box."""

    def __init__(self, departures: Departures, axes: np.ndarray) -> None:
        self.departures, self.axes = departures, axes
        self.span, self.sign, self.closed = departures.span, departures.sign, departures.closed
        self.approximate, self.waypoints = departures.approximate, departures.waypoints
        self.held = departures.held((axes != 0).any(0))

    def along(self, valley: Sampled) -> Sampled:
        """The curve of the problem that functions of x, which give (k, m), stand for."""
        curve = self.departures.curve
        return lambda x: curve(np.atleast_1d(x), 0) + self.axes.T @ valley(np.atleast_1d(x))

    def costs(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """What each piece adds between nodes (P, K + 1, S, k) of neighbouring rows, (P, K, S, S)."""
        return polygon_costs(self.values, x, nodes)

    def box_costs(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """The same more roughly, between the nodes of a box."""
        return polygon_costs(self.values, x, nodes, MIDDLE)

    def kept(self, x: np.ndarray) -> np.ndarray:
        """Which departures are none at vertices x (K + 1,): all or none, (K + 1, k)."""
        return np.repeat(kept_vertices(self, x)[:, None], len(self.axes), axis=1)

    def values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L as it is minimised, where y and v are (..., k)."""
        values = self.departures.values(x, *(list(np.moveaxis(t @ self.axes, -1, 0)) for t in (y, v)))
        return np.broadcast_to(values, np.broadcast_shapes(x.shape, y.shape[:-1], v.shape[:-1]))

    def own_values(self, x: np.ndarray, weights: np.ndarray, y: np.ndarray, v: np.ndarray) -> bool:
        """Whether ``values`` along a curve are the functional's own, where y and v are (m, k)."""
        rows = [list((t @ self.axes).T) for t in (y, v)]
        return not self.approximate or self.departures.free_of_levels(x, weights, *rows)

    def halved(self, x: np.ndarray, y: np.ndarray, finer: np.ndarray) -> np.ndarray:
        """What stands for the polygons y (P, K + 1, k) with vertices at x on more vertices."""
        rows = np.array([np.interp(finer, x, row) for polygon in y for row in polygon.T])  # there may be none
        return rows.reshape(len(y), y.shape[2], len(finer)).transpose(0, 2, 1)

    def valley(self, x: np.ndarray, y: np.ndarray, value: float, size: float) -> Valley:
        """A polygon y (K + 1, k), to be followed."""
        return Valley(x, y, value, False, size=size)

    def starts(self, x: np.ndarray, levels: list[np.ndarray], seen: Callable[[], np.ndarray]) -> np.ndarray:
        """The least polygons (P, K + 1, k) through the nodes of a box; of many axes, those ``seen`` along one each."""
        if len(levels) not in SIDE:
            return seen()
        box = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, len(levels))
        return through_box(self, x, box, self.box_costs(x, np.broadcast_to(box, (1, len(x), *box.shape)))[0])

    def levels(self, low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
        """Those along each axis between ``low`` (k,) and ``high``."""
        side, ends = SIDE.get(len(self.axes), LEAST_SIDE), zip(np.eye(len(self.axes)), low, high, strict=True)
        return [_levels(self, axis, first, last, side) for axis, first, last in ends]

    def step(self, levels: np.ndarray) -> float:
        """By how much curves are moved at first that come from a box with such levels along an axis."""
        return float(np.median(np.diff(levels)))

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ends that depart by y (..., k) add."""
        return self.departures.at_end(side, (y @ self.axes).reshape(-1, self.axes.shape[1])).reshape(y.shape[:-1])


_Kind = TypeVar("_Kind", bound=AlongAxes)


class PolygonsTogether:
    """The curves that ``starts`` (P, K + 1, k) with vertices at x lead to, by departures of ``steps`` (k,)."""

    def __init__(self, landscape: AlongAxes, x: np.ndarray, starts: np.ndarray, steps: np.ndarray) -> None:
        self.landscape, self._room = landscape, SAME * steps
        y, values, step = starts, np.zeros(len(starts)), steps
        for number, most in enumerate(MOST_TOGETHER):
            if number:
                finer = np.union1d(x, (x[1:] + x[:-1]) / 2)
                x, y = finer, landscape.halved(x, y, finer)
            y, values, step = self._settled(x, y, step, most)
        self.x, self.found = x, list(zip(y, values.tolist(), strict=True))
        own = np.zeros((1, len(x), len(steps)))
        summed = landscape.costs(x, own[:, :, None])
        self.summed = float(np.abs(summed).sum())
        self._sizes = [float(np.abs(landscape.costs(x, row[None, :, None])).sum()) for row in y]
        self.own_value = float(summed.sum()) + float(sum(landscape.at_end(side, own[0, -side]) for side in (0, 1)))

    def distinct(self) -> list[Valley]:
        """The curves that are worth following and come not near the known one all along, the lowest first."""
        sized = [(y, value, size) for (y, value), size in zip(self.found, self._sizes, strict=True)]
        worth = [own for own in sized if own[1] < self.own_value + WORTH_TOGETHER * max(self.summed, own[2])]
        return [self.landscape.valley(self.x, *own) for own in worth if (np.abs(own[0]) > self._room).any()]

    def _settled(
        self, x: np.ndarray, y: np.ndarray, step: np.ndarray, most: Sequence[int]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the lowest polygons of y (P, K + 1, k) lead to, their values, the lowest first, and the last step.

        The steps are halved as often as it is said how many are moved at ``most``.
        """
        y, values = moved(self.landscape, x, y, np.zeros((1, len(step))))
        for count in most:
            chosen = self._distinct(y, values, count)
            y, step = y[chosen], 0.5 * step
            for _ in range(MOVES):
                for axis in np.diag(step):
                    y, values = moved(self.landscape, x, y, np.array([0 * axis, axis, -axis]))
        chosen = self._distinct(y, values, len(y))
        return y[chosen], values[chosen], step

    def _distinct(self, y: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
        """The numbers of the polygons, so many at ``most``, of which none comes near a lower one, the lowest first."""
        kept: list[int] = []
        for number in np.argsort(values, kind="stable").tolist():
            if len(kept) == most:
                break
            if np.isfinite(values[number]) and (np.abs(y[kept] - y[number]) > self._room).any((1, 2)).all():
                kept.append(number)
        return np.array(kept, dtype=int)


Looked = tuple[AlongDirection, Lattice, Lattice | None]
"""A direction that was looked along: the lattice about the curve, and one across hills and wells if some were seen."""


def together(looked: Sequence[Looked]) -> list[PolygonsTogether]:
    """The polygons of all axes at once, as far out as hills and wells were seen along the directions; none for none.

    Where those were seen far out there are also the ones about the known curve: a box has few levels.
    """
    several = len({tuple(along.shares.tolist()) for along, _, _ in looked}) > 1
    if not several or all(across is None for _, _, across in looked):
        return []
    near = ABOUT * max(along.extent(about.c) for along, about, _ in looked)
    _, _, low, high = ranges(AlongAxes, looked)
    rooms = [math.inf, near] if (high - low).max() > FAR_APART * near else [math.inf]
    boxes = (in_box(AlongAxes, looked, room) for room in rooms)
    return [PolygonsTogether(*box) for box in boxes if box is not None]


def in_box(
    kind: Callable[[Departures, np.ndarray], _Kind], looked: Sequence[Looked], room: float = math.inf
) -> tuple[_Kind, np.ndarray, np.ndarray, np.ndarray] | None:
    """A landscape of a ``kind``, vertices, curves through a box as large as what was looked along, and its steps.

    It goes no farther than a ``room``. None where no curve is admitted.
    """
    landscape, x, low, high = ranges(kind, looked)
    levels = landscape.levels(np.maximum(low, -room), np.minimum(high, room))
    steps = np.array([landscape.step(row) for row in levels])
    starts = landscape.starts(x, levels, lambda: _in_their_directions(x, _axes(looked)[1], looked))
    if not len(starts):
        return None
    kept = landscape.kept(x)
    if landscape.closed:  # what is closed elsewhere stays there, and moves between its ends
        kept[[0, -1]] &= np.isin(x[[0, -1]], landscape.waypoints)[:, None]
    starts[:, kept] = 0.0  # where the known curve is all are
    return landscape, x, starts, steps


def ranges(
    kind: Callable[[Departures, np.ndarray], _Kind], looked: Sequence[Looked]
) -> tuple[_Kind, np.ndarray, np.ndarray, np.ndarray]:
    """A landscape of a ``kind``, vertices, and from where to where (k,) along its axes there is what to see."""
    axes, own = _axes(looked)
    corners = np.array(
        [end * own @ along.shares for along, about, across in looked for end in _range(along, about, across)]
    )
    landscape = kind(looked[0][0].departures, axes)
    x = np.union1d(np.linspace(*landscape.span, landscape.pieces + 1), landscape.waypoints)
    return landscape, x, corners.min(0), corners.max(0)


def _axes(looked: Sequence[Looked]) -> tuple[np.ndarray, np.ndarray]:
    """The axes (k, n) that were looked along, and their shares of those of the departures, 1 or 0."""
    alone = [along for along, _, _ in looked if np.count_nonzero(along.shares) == 1]
    return np.array([a.direction for a in alone]), np.array([a.shares for a in alone]) > 0


def _in_their_directions(
    x: np.ndarray, own: np.ndarray, looked: Sequence[tuple[AlongDirection, Lattice, Lattice | None]]
) -> np.ndarray:
    """The polygons (P, K + 1, k) that were seen along one direction each, and sums of the lowest along several.

    ``own`` are the shares of the k axes.
    """
    alone: list[np.ndarray] = []
    lowest: list[tuple[float, int]] = []
    for along, *lattices in looked:
        seen = [(v.value - t.own_value, v) for t in lattices if t is not None for v in t.distinct()]
        if seen:
            lowest.append(min((height, len(alone) + k) for k, (height, _) in enumerate(seen)))
        alone += [valley(x)[0][:, None] * (own @ along.shares) for _, valley in seen]
    sums = np.cumsum([alone[k] for _, k in sorted(lowest)], axis=0) if lowest else []
    return np.array([*alone, *sums])


def through_box(landscape: AlongAxes, x: np.ndarray, box: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """The least curves (P, K + 1, k) through the nodes (J, k) of a box on some rows; of a closed curve, those at rest.

    Pieces between nodes add the ``costs`` (K, J, J).
    """
    if landscape.closed:
        return np.repeat(box[:, None], len(x), axis=1)
    barred = np.where((landscape.kept(x)[[0, -1], None] & (box != 0)).any(-1), np.inf, 0.0)
    begun, ended = (landscape.at_end(side, box) + barred[side] for side in (0, 1))
    back, ahead = _pointers(begun, costs), _pointers(ended, costs[::-1].transpose(0, 2, 1))[::-1]
    found = []
    for row in (round(share * (len(x) - 1)) for share in ROWS_PASSED):
        path = [np.arange(len(box))]
        for k in range(row - 1, -1, -1):
            path.insert(0, back[k][path[0]])
        for k in range(row, len(x) - 1):
            path.append(ahead[k][path[-1]])
        found.append(box[np.stack(path, axis=1)])
    return np.unique(np.concatenate(found), axis=0)


def _pointers(reached: np.ndarray, costs: np.ndarray) -> list[np.ndarray]:
    """Of each piece (K, J, J), the nodes from which the least polygons come that begin with the costs ``reached``."""
    found = []
    for cost in costs:
        sums = reached[:, None] + cost
        found.append(np.argmin(sums, axis=0))
        reached = sums.min(0)
    return found


def _levels(landscape: AlongAxes, axis: np.ndarray, low: float, high: float, side: int) -> np.ndarray:
    """Levels along an axis, closer where L changes more; the known curve's is one."""
    x = np.linspace(*landscape.span, PIECES_TOGETHER + 1)
    y = np.linspace(low, high, CLOSER)
    rows = landscape.values(x[:, None], y[:, None] * axis, np.zeros(len(axis)))
    change = np.abs(np.diff(rows))
    change = np.where(np.isfinite(change), change, 0.0).sum(0)
    share = EVEN / len(change) + (1 - EVEN) * change / (change.sum() or 1.0)
    passed = np.concatenate([[0.0], np.cumsum(share)])
    levels = np.interp(np.linspace(0, passed[-1], side), passed, y)
    levels[np.argmin(np.abs(levels))] = 0.0
    return levels


def _range(along: AlongDirection, about: Lattice, across: Lattice | None) -> tuple[float, float]:
    """The departures along a direction between which there is what to see."""
    if across is not None:
        return float(across.nodes.min()), float(across.nodes.max())
    reach = NEAR[-1] * along.extent(about.c)
    return -reach, reach
