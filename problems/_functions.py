"""Elementary functions in forms that keep all their digits where the usual ones cancel."""

import math
from typing import Any

import numpy as np

from varcalc.problems._arithmetic import context, sin, sinh

TERMS = 13
"""Terms of the series for arguments up to 2: the first one left out is below round-off."""


def _odd_series(z: np.ndarray, sign: float) -> np.ndarray:
    """z^3/3! + sign z^5/5! + z^7/7! + sign z^9/9! + ..."""
    square, total = sign * z * z, np.zeros_like(z)
    for k in range(TERMS, 0, -1):
        total = total * square + 1.0 / math.factorial(2 * k + 1)
    return total * z**3


def sine_deficit(angle: Any) -> np.ndarray:
    """The difference of an angle and its sine."""
    if context(angle) is not None:  # there are digits to spare
        return angle - sin(angle)
    angle = np.asarray(angle, dtype=float)
    return np.where(np.abs(angle) < 2.0, _odd_series(angle, -1.0), angle - np.sin(angle))


def sinh_excess(z: Any) -> np.ndarray:
    """The difference of a hyperbolic sine and its argument."""
    if context(z) is not None:
        return sinh(z) - z
    z = np.asarray(z, dtype=float)
    return np.where(np.abs(z) < 2.0, _odd_series(z, 1.0), np.sinh(z) - z)
