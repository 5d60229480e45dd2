"""Names, units and numbers that a person gives, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def coordinate_names(coordinates: Sequence[str]) -> tuple[str, ...]:
    """Different names, one for each coordinate."""
    names = (coordinates,) if isinstance(coordinates, str) else tuple(coordinates)
    if not names or not all(isinstance(name, str) and name for name in names) or len(set(names)) != len(names):
        raise ValueError(f"coordinates must be different names, one for each coordinate, not {coordinates!r}")
    return names


def coordinate_units(units: Sequence[str], n: int) -> tuple[str, ...]:
    """One unit for each of n coordinates; empty ones where none are given."""
    given = (units,) if isinstance(units, str) else tuple(units)
    if (given and len(given) != n) or not all(isinstance(unit, str) for unit in given):
        raise ValueError(f"units must be {n} strings, one for each coordinate, not {units!r}")
    return given or ("",) * n


def finite_number(name: str, value: Any) -> float:
    """A finite number; TypeError or ValueError, naming the argument, where it is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, not {value!r}") from None
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite, not {value!r}")
    return number


def finite_column(name: str, values: Any, n: int) -> np.ndarray:
    """n finite numbers (n,), one for each coordinate; ValueError, naming the argument, where they are none."""
    column = np.atleast_1d(np.asarray(values, dtype=float))
    if column.shape != (n,) or not np.all(np.isfinite(column)):
        raise ValueError(f"{name} must be {n} finite numbers, one for each coordinate, not {values!r}")
    return column
