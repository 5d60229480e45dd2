"""Eigenvalues of a real matrix with what rounding leaves of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

MATRIX_ROUND_OFF = 64 * float(np.finfo(float).eps)
"""Of the matrix, times the condition of an eigenvalue: by how much that may be rounded."""
DEFECTIVE = 1e6
"""Condition from which on an eigenvalue may lack a vector."""


@dataclass(frozen=True)
class Spectrum:
    """The eigenvalues of a matrix: ``values`` (N,), ``vectors`` (N, N) by columns, and what each may be off (N,).

    ``conditions`` (N,) tell by how many times more a value moves than the matrix does (Golub and Van Loan, "Matrix
    Computations", sect. 7.2.2).
    """

    values: np.ndarray
    vectors: np.ndarray
    conditions: np.ndarray
    noise: np.ndarray

    @classmethod
    def of(cls, matrix: np.ndarray) -> Spectrum:
        """That of a ``matrix`` (N, N), in units in which its rows are as large as its columns."""
        balanced, (units, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
        values, left, right = (np.asarray(part) for part in scipy.linalg.eig(balanced, left=True, right=True))
        with np.errstate(divide="ignore"):
            conditions = 1 / np.abs(np.sum(left.conj() * right, axis=0))
        return cls(
            values,
            units[:, None] * right,
            conditions,
            MATRIX_ROUND_OFF * float(np.linalg.norm(balanced, 2)) * conditions,
        )

    def __getitem__(self, order: np.ndarray) -> Spectrum:
        return Spectrum(self.values[order], self.vectors[:, order], self.conditions[order], self.noise[order])

    @property
    def alone(self) -> np.ndarray:
        """Which of the values (N,) are shown to have a vector of their own."""
        return self.conditions < DEFECTIVE
