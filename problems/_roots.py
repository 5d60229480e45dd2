"""Roots of increasing functions, to the last digits, for arrays of targets at once."""

from collections.abc import Callable
from typing import Any

import numpy as np

from varcalc.problems._arithmetic import context, sqrt

STEPS = 200
"""More than bisection alone needs to bring any bracket of double-precision numbers to round-off."""

SETTLED = 1e-9
"""Relative step below which one more step of Newton's method reaches round-off."""


def increasing_root(function: Callable[[Any], tuple[Any, Any]], lower: Any, upper: Any, target: Any = 0.0) -> Any:
    """The x in [lower, upper] where an increasing function takes the value ``target``.

    ``function`` returns values and slopes. Newton's method, with a bisection
    wherever it would leave the bracket; shapes are broadcast.
    """
    if (digits := context(lower, upper, target)) is not None:
        return _root_in_digits(function, *map(digits.mpf, (lower, upper, target)))
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


def _root_in_digits(function: Callable[[Any], tuple[Any, Any]], lower: Any, upper: Any, target: Any) -> Any:
    """The same in mpmath's numbers, one root: to the root of their precision, and one step of Newton's method more."""
    x, settled = (lower + upper) / 2, sqrt(context(lower).eps)
    for _ in range(STEPS + 4 * context(lower).prec):
        value, slope = function(x)
        miss = value - target
        lower, upper = (x, upper) if miss <= 0 else (lower, x)
        newton = x - miss / slope if slope else lower
        better = newton if lower <= newton <= upper else (lower + upper) / 2
        step, x = abs(better - x), better
        if step <= settled * abs(x):
            break
    value, slope = function(x)
    return x - (value - target) / slope
