"""Roots of increasing functions, to the last digits, for arrays of targets at once."""

from collections.abc import Callable
from typing import Any

import numpy as np

STEPS = 200
"""More than bisection alone needs to bring any bracket of double-precision numbers to round-off."""

SETTLED = 1e-9
"""Relative step below which one more step of Newton's method reaches round-off."""


def increasing_root(
    function: Callable[[np.ndarray], tuple[Any, Any]], lower: Any, upper: Any, target: Any = 0.0
) -> np.ndarray:
    """The x in [lower, upper] where an increasing function takes the value ``target``.

    ``function`` returns values and slopes. Newton's method, with a bisection
    wherever it would leave the bracket; shapes are broadcast.
    """
    lower, upper, target = (np.array(v, dtype=float) for v in np.broadcast_arrays(lower, upper, target))
    x = 0.5 * (lower + upper)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(STEPS):
            value, slope = function(x)
            miss = value - target
            lower, upper = np.where(miss <= 0, x, lower), np.where(miss >= 0, x, upper)
            newton = x - miss / slope
            better = np.where((newton > lower) & (newton < upper), newton, 0.5 * (lower + upper))
            settled = np.all(np.abs(better - x) <= SETTLED * np.abs(x))
            x = better
            if settled:
                break
        value, slope = function(x)
        newton = x - (value - target) / slope
    return np.where(np.abs(newton - x) <= SETTLED * np.abs(x), newton, x)
