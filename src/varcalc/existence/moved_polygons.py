"""Polygons moved to where the functional is less, by iterative dynamic programming.

About a polygon the least one in departures along each axis is found, again and again, with ever smaller steps (Luus,
"Iterative Dynamic Programming", 2000, ch. 3): what it ends in is bound to the nodes of no lattice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from varcalc.existence.landscape import Landscape
from varcalc.existence.polygons import Valley, values_of
from varcalc.numerics.mesh import GAUSS_SHARES, composite_gauss

FINE_ENOUGH = 150
"""Pieces of a polygon from which on it is fine enough."""
MOVES = np.arange(-3.0, 4.0)[[3, 2, 4, 1, 5, 0, 6]]
"""Steps that vertices are moved by at once; the first is none."""
SWEEPS, HALVINGS = 3, 2
"""How often they are moved with one step, and how many steps there are, each half the last, on so many pieces."""
STEPS_HIGH = 64
"""Steps of the extent of a valley, by which it is first moved."""
SUMMED_BY = 8
"""Gauss points a piece by which polygons are compared."""
MARKS, EVENLY = 14, 0.3
"""Elements of a mesh that holds a polygon, and how much of the interval is shared out evenly between them."""


class Departing(Protocol):
    """Curves that depart from a known one: what ends are ``held``, whether they are ``closed``, and where all meet."""

    held: tuple[bool, bool]
    closed: bool
    waypoints: tuple[float, ...]


class Pieced(Protocol):
    """A functional of curves that are pieced together, as it is minimised: k numbers at each vertex tell a curve."""

    def costs(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """What each piece adds between nodes (P, K + 1, S, k) of neighbouring rows, (P, K, S, S)."""
        ...

    def kept(self, x: np.ndarray) -> np.ndarray:
        """Which of the numbers at vertices x (K + 1,) are those of all curves, (K + 1, k)."""
        ...

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ends that depart by y (..., k) add."""
        ...


class _Alone:
    """The polygons of a landscape of one function."""

    def __init__(self, landscape: Landscape) -> None:
        self.landscape = landscape

    def costs(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """What each piece adds."""
        return polygon_costs(lambda x, y, v: values_of(self.landscape, x, y[..., 0], v[..., 0]), x, nodes)

    def kept(self, x: np.ndarray) -> np.ndarray:
        """The waypoints and what ends are given."""
        return kept_vertices(self.landscape, x)[:, None]

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ends that depart by y (..., 1) add."""
        return self.landscape.at_end(side, y[..., 0].ravel()).reshape(y.shape[:-1])


def moved_on(landscape: Landscape, valley: Valley) -> Valley:
    """The polygon that the one of a valley of one function leads to, on a mesh that holds it."""
    y = valley.y[None, :, None]
    step = np.array([float(np.ptp(valley.y)) / STEPS_HIGH])
    x, ordinates, values = refined(_Alone(landscape), valley.x, y, step, 1)
    return marked(replace(valley, x=x, y=ordinates[0, :, 0], value=float(values[0])))


def ranked(landscape: Landscape, valleys: Sequence[Valley]) -> list[float]:
    """What polygons of one function sum when they were moved a little, on twice as many pieces, by a finer rule.

    A lattice tells which of many is the lowest no better than its pieces hold them. What goes a little through a bound
    between the points of its pieces is as low as these say: moved further it may keep clear.
    """
    finer, y, values = _moved_a_little(landscape, valleys)
    x, weights = composite_gauss(finer, SUMMED_BY)
    ordinates = np.stack([np.interp(x, finer, row) for row in y])
    slopes = np.repeat(np.diff(y) / np.diff(finer), SUMMED_BY, axis=1)
    sums = values_of(landscape, x, ordinates, slopes) @ weights
    sums = sums + sum(landscape.at_end(side, y[:, -side]) for side in (0, 1))
    return np.where(np.isfinite(sums), sums, np.where(np.isfinite(values), values, np.inf)).tolist()


def moved_a_little(landscape: Landscape, valleys: Sequence[Valley]) -> list[Valley]:
    """The polygons of valleys of one function, moved a little on twice as many pieces; every other vertex is kept."""
    _, rows, values = _moved_a_little(landscape, valleys)
    told = zip(valleys, rows[:, ::2], values.tolist(), strict=True)
    return [replace(valley, y=y, value=value) for valley, y, value in told]


def _moved_a_little(landscape: Landscape, valleys: Sequence[Valley]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The vertices (K + 1,), ordinates (P, K + 1) and values (P,) of polygons of one function."""
    x, rows = valleys[0].x, np.stack([valley.y for valley in valleys])
    finer = np.union1d(x, (x[1:] + x[:-1]) / 2)
    y = np.stack([np.interp(finer, x, row) for row in rows])[:, :, None]
    step, values = np.array([float(np.ptp(rows)) / STEPS_HIGH]), np.zeros(len(y))
    for _ in range(HALVINGS):
        for _ in range(SWEEPS):
            y, values = moved(_Alone(landscape), finer, y, MOVES[:, None] * step)
        step = step / 2
    return finer, y[:, :, 0], values


def marked(valley: Valley) -> Valley:
    """A valley with the vertices of a mesh that is finer where its polygon turns."""
    turns = np.abs(np.diff((np.diff(valley.y, axis=0).T / np.diff(valley.x)).T, axis=0).reshape(len(valley.x) - 2, -1))
    share = np.sqrt(turns.max(1))
    passed = np.cumsum(share / (share.sum() or 1.0) + EVENLY / len(share))
    marks = np.interp(passed[-1] * np.arange(1, MARKS) / MARKS, passed, valley.x[1:-1])
    return replace(valley, marks=tuple(np.unique(marks).tolist()))


def refined(
    landscape: Pieced, x: np.ndarray, y: np.ndarray, step: np.ndarray, most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The vertices x, departures and values of polygons that ``y`` (P, K + 1, k) lead to, on ever more pieces.

    They are moved by ``step`` (k,) and less; of the first ones the ``most`` that are lowest are moved on.
    """
    values = np.zeros(len(y))
    while True:
        for _ in range(HALVINGS):
            for _ in range(SWEEPS):
                for axis in np.diag(step):
                    y, values = moved(landscape, x, y, MOVES[:, None] * axis)
            step = step / 2
        if len(x) > FINE_ENOUGH:
            return x, y, values
        order = np.argsort(values, kind="stable")[:most]
        finer = np.union1d(x, (x[1:] + x[:-1]) / 2)
        y = np.stack([[np.interp(finer, x, row) for row in y[p].T] for p in order]).transpose(0, 2, 1)
        x = finer


def kept_vertices(landscape: Departing, x: np.ndarray) -> np.ndarray:
    """At which of the vertices x (K + 1,) all curves have one ordinate."""
    kept = np.isin(x, landscape.waypoints)
    kept[[0, -1]] |= np.array(landscape.held) | landscape.closed  # a closed one moves between its ends
    return kept


def polygon_costs(
    values: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray], x: np.ndarray, nodes: np.ndarray,
    shares: Sequence[float] = GAUSS_SHARES,
) -> np.ndarray:  # fmt: skip
    """What each straight piece adds between nodes (P, K + 1, S, k) of neighbouring rows, (P, K, S, S).

    ``values`` are those of L at x, y and v (..., k), and ``shares`` tells where on a piece it is asked.
    """
    first, last, h = nodes[:, :-1, :, None], nodes[:, 1:, None], np.diff(x)[:, None, None]
    sums = 0.0
    for share in shares:
        sums = sums + values(
            x[:-1, None, None] + share * h, first + share * (last - first), (last - first) / h[..., None]
        )
    return np.where(np.isfinite(sums), sums, np.inf) * h / len(shares)


def moved(landscape: Pieced, x: np.ndarray, y: np.ndarray, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least of the curves that vertices of each of y (P, K + 1, k) make by one of the ``moves`` (S, k), or 0.

    The first of the moves is 0. Their values are (P,).
    """
    nodes = y[:, :, None] + moves
    added = landscape.costs(x, nodes)
    barred = np.where((landscape.kept(x)[:, None] & (moves != 0)).any(-1), np.inf, 0.0)[None].repeat(len(y), 0)
    barred[:, 0] += landscape.at_end(0, nodes[:, 0])
    barred[:, -1] += landscape.at_end(1, nodes[:, -1])
    return least_through(nodes, added, barred)


def least_through(nodes: np.ndarray, added: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least curves (P, K + 1, k) through one of the nodes (P, K + 1, S, k) of each row, and their values (P,).

    What pieces add is (P, K, S, S), and what nodes add ``there`` (P, K + 1, S).
    """
    reached, before = there[:, 0], list[np.ndarray]()
    for k in range(added.shape[1]):
        sums = reached[:, :, None] + added[:, k] + there[:, k + 1, None]
        before.append(np.argmin(sums, axis=1))
        reached = np.min(sums, axis=1)
    path = [np.argmin(reached, axis=1)]
    for back in reversed(before):
        path.insert(0, back[np.arange(len(nodes)), path[0]])
    chosen = np.stack(path, axis=1)[:, :, None, None]
    return np.take_along_axis(nodes, chosen, axis=2)[:, :, 0], reached.min(axis=1)
