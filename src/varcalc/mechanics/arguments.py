"""Names, units, times and states that a person gives, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from varcalc.problem.conditions import finite, numbers, reals, sequence, told


def coordinate_names(coordinates: Sequence[str]) -> tuple[str, ...]:
    """Different names, one for each coordinate."""
    names = (coordinates,) if isinstance(coordinates, str) else sequence("coordinates", coordinates)
    if not names or not all(isinstance(name, str) and name for name in names) or len(set(names)) != len(names):
        raise ValueError(f"coordinates must be different names, one for each coordinate, not {told(coordinates)}")
    return names


def coordinate_units(units: Sequence[str], n: int) -> tuple[str, ...]:
    """One unit for each of n coordinates; empty ones where none are given."""
    given = (units,) if isinstance(units, str) else sequence("units", units)
    if (given and len(given) != n) or not all(isinstance(unit, str) for unit in given):
        raise ValueError(f"units must be {n} strings, one for each coordinate, not {told(units)}")
    return given or ("",) * n


def finite_column(name: str, values: Any, n: int) -> np.ndarray:
    """n finite numbers (n,), one for each coordinate; TypeError or ValueError, naming the argument, for what is not."""
    column = np.atleast_1d(reals(name, values))
    if column.shape != (n,) or not np.all(np.isfinite(column)):
        raise ValueError(f"{name} must be {n} finite numbers, one for each coordinate, not {told(values)}")
    return column


def ascending_span(span: Any) -> tuple[float, float]:
    """Two ascending times; TypeError or ValueError for anything else."""
    times = sequence("span", span) if isinstance(span, Sequence | np.ndarray) and np.ndim(span) else ()
    if len(times) != 2:
        raise TypeError(
            f"span must be two ascending times, not {told(span)}; write (0, {told(span)})"
            if not times
            else f"span must be two ascending times, not {told(span)}"
        )
    first, last = (finite(f"span[{k}]", value) for k, value in enumerate(times))
    if not last > first:
        raise ValueError(f"span must be two ascending times, not {told(span)}")
    return first, last


def ascending_times(times: Any) -> np.ndarray:
    """Two or more ascending times (k,); TypeError or ValueError for anything else."""
    when = numbers("times", times)
    if when.ndim != 1 or len(when) < 2 or not np.all(np.diff(when) > 0):
        raise ValueError(f"times must be two or more, ascending, not {told(times)}")
    return when


def times_within(t: Any, span: tuple[float, float]) -> np.ndarray:
    """Times of any shape; ValueError for those at which a motion over ``span`` is not known."""
    times = reals("t", t)
    low, high = min(span), max(span)
    if times.size and not (times.min() >= low and times.max() <= high):
        raise ValueError(f"t must lie between {low:.17g} and {high:.17g}, where the motion is known")
    return times
