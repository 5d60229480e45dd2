"""Scans along one variable, on whole arrays at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

NARROWING = 14
"""Scans of 17 points, each within the two intervals found before: 8^-14 = 2e-13 of the first bracket."""


def least(function: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> float:
    """The place of a minimum inside a bracket, by repeated scans."""
    for _ in range(NARROWING):
        at = np.linspace(low, high, 17)
        values = np.nan_to_num(function(at), nan=np.inf)
        k = int(np.argmin(values))
        low, high = float(at[max(k - 1, 0)]), float(at[min(k + 1, 16)])
    return 0.5 * (low + high)


def boundary(holds: Callable[[np.ndarray], np.ndarray], inside: float, outside: float) -> float:
    """The last place, going outside from where a condition holds, at which it still does."""
    for _ in range(NARROWING):
        at = np.linspace(inside, outside, 17)
        good = holds(at)
        k = 16 if good.all() else max(int(np.argmin(good)) - 1, 0)
        inside, outside = float(at[k]), float(at[min(k + 1, 16)])
    return inside
