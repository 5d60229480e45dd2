"""The linear systems of multiple shooting: dense with their symmetries, or sparse by blocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

RANK, ROUGH_RANK = 1e-11, 1e-5
"""Singular values below this part of the largest are symmetries, or signs that there is no isolated extremal; those of
a look, to six digits."""
DENSE = 240
"""Unknowns up to which the systems are solved as dense ones."""


@dataclass(frozen=True)
class Jacobian:
    """The derivatives (M, M) of a mismatch by the states (N D) of the segments, then by the r numbers they share.

    ``before`` and ``after`` (N - 1, D, D) are those of the rows of the inner vertices by the segments that meet there,
    ``shared`` (N - 1, D, r) by the numbers; ``closing`` (R, N, D) and ``direct`` (R, r) those of the other rows.
    Singular values below the part ``rank`` of the largest are taken for zeros.
    """

    before: np.ndarray
    after: np.ndarray
    shared: np.ndarray
    closing: np.ndarray
    direct: np.ndarray
    rank: float = RANK

    @property
    def size(self) -> int:
        """Number of unknowns M."""
        return self.closing.shape[1] * self.closing.shape[2] + self.direct.shape[1]

    @cached_property
    def values(self) -> np.ndarray:
        """All entries, flat."""
        return np.concatenate([b.ravel() for b in (self.before, self.after, self.shared, self.closing, self.direct)])

    @property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        return _places(*self.closing.shape, self.direct.shape[1])

    @cached_property
    def dense(self) -> np.ndarray:
        """The whole matrix (M, M)."""
        matrix = np.zeros((self.size, self.size))
        matrix[self._places] = self.values
        return matrix

    def rows(self, weights: np.ndarray) -> np.ndarray:
        """The largest entry of each row (M,), the unknowns being of sizes ``weights`` (M,)."""
        rows, columns = self._places
        largest = np.zeros(self.size)
        np.maximum.at(largest, rows, np.abs(self.values * weights[columns]))
        return largest

    @property
    def condition(self) -> float:
        """The condition number with the rows scaled; 1 where it is too large to be looked at."""
        if self.size > DENSE:
            return 1.0
        rows = np.abs(self.dense).max(axis=1)
        return float(np.linalg.cond(self.dense / np.where(rows == 0.0, 1.0, rows)[:, None]))

    def solve(self, right: np.ndarray, weights: np.ndarray, *, symmetries: bool) -> np.ndarray | None:
        """The x (M,) with Jacobian . x = ``right``; None when the Jacobian is singular to working precision.

        ``weights`` (M,) are the sizes of the unknowns. With ``symmetries`` the shortest x is taken where one is open.
        """
        if self.size > DENSE:
            return self._solve_sparse(right, weights)
        matrix = self.dense * weights
        rows = np.abs(matrix).max(axis=1)
        rows[rows == 0.0] = 1.0
        matrix, right = matrix / rows[:, None], right / rows
        if symmetries:
            out, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=self.rank)
            if rank < len(right):
                return weights * out
        try:
            out = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            return None
        return weights * out if np.all(np.isfinite(out)) else None

    def _solve_sparse(self, right: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        largest = self.rows(weights)
        if not largest.all():
            return None
        occupied = self.values != 0.0
        rows, columns = (place[occupied] for place in self._places)
        values = self.values[occupied] * weights[columns] / largest[rows]
        try:
            factors = splu(csc_matrix((values, (rows, columns)), shape=(self.size, self.size)))
        except RuntimeError:  # exactly singular
            return None
        out = weights * factors.solve(right / largest)
        return out if np.all(np.isfinite(out)) else None


@lru_cache(maxsize=64)
def _places(closing: int, segments: int, states: int, shared: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of each of :attr:`Jacobian.values`."""
    inner, last = np.arange(segments - 1)[:, None, None] * states, (segments - 1) * states
    row, column = np.arange(states)[:, None], np.arange(states)
    numbers, ends = segments * states + np.arange(shared), last + np.arange(closing)[:, None]
    parts = [
        (inner + row, inner + column), (inner + row, inner + states + column), (inner + row, numbers),
        (ends, np.arange(segments * states)), (ends, numbers),
    ]  # fmt: skip
    pairs = [np.broadcast_arrays(*part) for part in parts]
    rows, columns = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    return rows, columns
