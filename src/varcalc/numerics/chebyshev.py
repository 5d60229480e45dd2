"""Chebyshev's points of the first kind, and the series through values there.

Boyd, "Chebyshev and Fourier Spectral Methods" (2001), ch. 4.
"""

from __future__ import annotations

import numpy as np


def roots(count: int) -> np.ndarray:
    """The zeros (count,) of the polynomial of this degree in [-1, 1], from the greatest to the least."""
    return np.cos(_angles(count))


def to_series(count: int) -> np.ndarray:
    """The matrix (count, count) from values at the zeros to the coefficients of the series that takes them there."""
    matrix = 2 / count * np.cos(np.arange(count)[:, None] * _angles(count))
    matrix[0] /= 2
    return matrix


def _angles(count: int) -> np.ndarray:
    return np.pi * (np.arange(count) + 0.5) / count
