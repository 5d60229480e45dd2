"""The linear systems of multiple shooting: dense with its symmetries, or sparse by blocks."""

from __future__ import annotations

import numpy as np

RANK = 1e-11
"""Singular values below this part of the largest are symmetries, or signs that there is no isolated extremal."""


def solve_dense(matrix: np.ndarray, right: np.ndarray, symmetries: bool) -> np.ndarray | None:
    """The solution of a dense system with its rows scaled; the shortest one where a symmetry leaves it open."""
    rows = np.abs(matrix).max(axis=1)
    rows[rows == 0.0] = 1.0
    matrix, right = matrix / rows[:, None], right / rows
    if symmetries:
        out, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=RANK)
        if rank < len(right):
            return out
    try:
        out = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return None
    return out if np.all(np.isfinite(out)) else None


def solve_sparse(
    size: int, blocks: list[tuple[int, int, np.ndarray]], right: np.ndarray, weights: np.ndarray
) -> np.ndarray | None:
    """The solution of a system of ``blocks`` (row, column, matrix), unknowns of sizes ``weights``; None if singular."""
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    rows = np.concatenate([np.repeat(np.arange(r, r + m.shape[0]), m.shape[1]) for r, _, m in blocks])
    columns = np.concatenate([np.tile(np.arange(c, c + m.shape[1]), m.shape[0]) for _, c, m in blocks])
    values = np.concatenate([m.ravel() for _, _, m in blocks]) * weights[columns]
    largest = np.zeros(size)
    np.maximum.at(largest, rows, np.abs(values))
    if not largest.all():
        return None
    try:
        factors = splu(csc_matrix((values / largest[rows], (rows, columns)), shape=(size, size)))
    except RuntimeError:  # exactly singular
        return None
    out = weights * factors.solve(right / largest)
    return out if np.all(np.isfinite(out)) else None
