"""A function with its derivatives at points, as one row of numbers each."""

from __future__ import annotations

import math

import numpy as np


class Derivatives:
    """A function with its first and second derivatives in ``k`` variables at ``m`` points.

    ``rows`` (m, 1 + k + k^2) are the value, the gradient and the columns of the Hessian.
    """

    def __init__(self, rows: np.ndarray) -> None:
        self.rows = rows
        self.k = math.isqrt(rows.shape[1] - 1)
        if self.k * (self.k + 1) + 1 != rows.shape[1]:
            raise ValueError(f"{rows.shape[1]} entries are no value with a gradient and a Hessian")

    @property
    def value(self) -> np.ndarray:
        """The function itself, (m,)."""
        return self.rows[:, 0]

    @property
    def gradient(self) -> np.ndarray:
        """Shape (m, k)."""
        return self.rows[:, 1 : 1 + self.k]

    @property
    def hessian(self) -> np.ndarray:
        """Shape (m, k, k)."""
        return self.rows[:, 1 + self.k :].reshape(-1, self.k, self.k)
