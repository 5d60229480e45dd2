"""An upper bound of a least value by hand: polygons by a dynamic programme that is repeated ever nearer to the last.

Nothing of it is the library's. What it finds is a curve that is admitted, summed by many points: an answer that lies
above it is no least one. That none lies below says nothing.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from campaigns.mixtures import Mixture

EXTENT, PIECES, LEVELS = 2.5, 16, 81
"""How far beyond both ends levels go, pieces of the first polygon, and levels at each of its vertices."""
LOOKS, NEARER, SHRUNK, HALVED = 7, 13, 0.45, (1, 3, 5)
"""Looks about the last polygon, levels of each, how much less far each goes, and before which pieces are halved."""
ROUGHLY, EXACTLY = 3, 400
"""Parts of a piece, of three Gauss points each, by which it is summed in a look and in the end."""
OUT = 1e30
"""What a point costs that is not admitted."""


def least_polygon(mixture: Mixture) -> tuple[float, np.ndarray, np.ndarray]:
    """The value of the least polygon that was found, and its vertices."""
    summed = _Sums(mixture)
    ends = [y for y in (mixture.start, mixture.end) if y is not None]
    x = np.linspace(0.0, mixture.span, PIECES + 1)
    grid = np.linspace(min(ends) - EXTENT, max(ends) + EXTENT, LEVELS)
    y = _through(mixture, summed, x, [_admitted(mixture, grid)] * len(x))
    room = 1.3 * (grid[1] - grid[0])
    for look in range(LOOKS):
        if look in HALVED:
            finer = np.sort(np.concatenate([x, (x[1:] + x[:-1]) / 2]))
            x, y = finer, np.interp(finer, x, y)
        y = _through(mixture, summed, x, [_admitted(mixture, v + room * np.linspace(-1, 1, NEARER)) for v in y])
        room *= SHRUNK
    pieces = [summed(a, b, p, q, EXACTLY) for a, b, p, q in zip(x[:-1], x[1:], y[:-1], y[1:], strict=True)]
    return float(np.sum(pieces)) + _cost(mixture, y[-1]), x, y


def _admitted(mixture: Mixture, levels: np.ndarray) -> np.ndarray:
    return np.unique(np.clip(levels, mixture.low, mixture.high))


def _cost(mixture: Mixture, y: float) -> float:
    return 0.0 if mixture.end is not None or mixture.cost is None else float(mixture.cost(float(y)))


class _Sums:
    """The integral of L along straight pieces, from each of some ordinates to each of others."""

    def __init__(self, mixture: Mixture) -> None:
        x, y, v = (ca.SX.sym(name) for name in "xyv")
        self.mixture, self.function = mixture, ca.Function("L", [x, y, v], [mixture.lagrangian(x, y, v)])
        nodes, self.weights = np.polynomial.legendre.leggauss(3)
        self.nodes = (1 + nodes) / 2

    def __call__(self, a: float, b: float, first: np.ndarray, last: np.ndarray, parts: int) -> np.ndarray:
        """Of pieces from a to b, (m,)."""
        share = ((np.arange(parts)[:, None] + self.nodes) / parts).ravel()
        first, last = np.atleast_1d(first), np.atleast_1d(last)
        y = first + share[:, None] * (last - first)
        x, v = (np.broadcast_to(r, y.shape) for r in ((a + share * (b - a))[:, None], (last - first) / (b - a)))
        # what takes numbers alone is handed arrays in a sixth of the time as a map
        values = np.asarray(self.function.map(y.size)(*(rows.ravel()[None] for rows in (x, y, v)))).reshape(y.shape)
        m, room = self.mixture, 1e-12
        out = (y < m.low - room) | (y > m.high + room) | (np.abs(v) > m.steep * (1 + room)) | ~np.isfinite(values)
        return np.tile(self.weights, parts) / (2 * parts) @ np.where(out, OUT, values) * (b - a)


def _through(mixture: Mixture, summed: _Sums, x: np.ndarray, grids: list[np.ndarray]) -> np.ndarray:
    """The least polygon through the levels at each abscissa."""
    grids = [np.array([mixture.start]), *grids[1:]]
    if mixture.end is not None:
        grids[-1] = np.array([mixture.end])
    costs, back = np.zeros(1), []
    for a, b, here, there in zip(x[:-1], x[1:], grids[:-1], grids[1:], strict=True):
        first, last = np.meshgrid(here, there, indexing="ij")
        through = costs[:, None] + summed(a, b, first.ravel(), last.ravel(), ROUGHLY).reshape(first.shape)
        back.append(through.argmin(axis=0))
        costs = through.min(axis=0)
    path = [int(np.argmin(costs + np.array([_cost(mixture, y) for y in grids[-1]])))]
    for numbers in reversed(back):
        path.insert(0, int(numbers[path[0]]))
    return np.array([levels[k] for levels, k in zip(grids, path, strict=True)])
