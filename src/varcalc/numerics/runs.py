"""Runs of neighbours at which something holds, on a row of places."""

from __future__ import annotations

import numpy as np


def runs(holds: np.ndarray) -> list[tuple[int, int]]:
    """The first and the last number of each run of neighbours that are True in ``holds`` (m,), ascending.

    >>> runs(np.array([True, True, False, True]))
    [(0, 1), (3, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return [(int(first), int(stop) - 1) for first, stop in edges.reshape(-1, 2)]
