"""Linear algebra on stacks of matrices, in which single ones may be singular or no numbers."""

from __future__ import annotations

import numpy as np


def positive(matrices: np.ndarray) -> np.ndarray:
    """Which of the symmetric matrices (K, N, N) are positive definite; (K,) of bool."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.zeros(1, dtype=bool)
        half = len(matrices) // 2
        return np.concatenate([positive(matrices[:half]), positive(matrices[half:])])
    return np.ones(len(matrices), dtype=bool)


def solutions(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solutions (.., N) of linear equations, not numbers where a matrix is singular."""
    try:
        return np.linalg.solve(matrices, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if matrices.ndim == 2 or len(matrices) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([solutions(matrices[k : k + 1], right[k : k + 1]) for k in range(len(matrices))])


def applied(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Each of the matrices (.., a, b) times its vector (.., b)."""
    return (matrices @ vectors[..., None])[..., 0]
