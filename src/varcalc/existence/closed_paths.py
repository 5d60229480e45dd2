"""The least paths that end where they began, by dynamic programming."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from varcalc.existence.polygons import Path, minima


def closed_paths(costs: np.ndarray, barred: np.ndarray, own: int) -> Iterator[tuple[float, Path]]:
    """What least paths over rows of J nodes sum that end where they began, and these, but for one from the ``own``.

    One from each node of the first row beside which none is lower. Pieces add the ``costs`` (K, J, J), and none leads
    to a node that is ``barred`` (K + 1, J).
    """
    costs = np.where(barred[1:, None], np.inf, costs)
    reached = [costs[0]]  # (J, J), from each node of the first row
    for piece in costs[1:-1]:
        reached.append(np.min(reached[-1][:, :, None] + piece, axis=1))
    closed = np.min(reached[-1] + costs[-1].T, axis=1)
    least = minima(closed) & np.isfinite(closed)
    least[own] = False
    for j in np.flatnonzero(least).tolist():
        path = [j]
        for row, piece in zip(reached[::-1], costs[:0:-1], strict=True):
            path.insert(0, int(np.argmin(row[j] + piece[:, path[0]])))
        yield float(closed[j]), (j, *path)
