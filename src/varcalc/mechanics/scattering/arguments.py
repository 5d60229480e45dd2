"""Numbers that a person gives, checked."""

from __future__ import annotations

from typing import Any

import numpy as np


def positive(name: str, value: Any) -> float:
    """``value`` as a positive number; TypeError or ValueError, naming the argument, where it is none."""
    number = not_negative(name, value)
    if number == 0:
        raise ValueError(f"{name} must be positive, not {value!r}")
    return number


def not_negative(name: str, value: Any) -> float:
    """The same for what may be 0."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, not {value!r}") from None
    if not (number >= 0 and np.isfinite(number)):
        raise ValueError(f"{name} must be finite and not negative, not {value!r}")
    return number
