"""Names, units, times and states that a person gives, checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from varcalc.problem.conditions import finite, is_vector, numbers, reals, sequence, told
from varcalc.symbolic.tracing import check_arity


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


def ascending_span(span: Any, name: str = "span", what: str = "times") -> tuple[float, float]:
    """Two ascending times, or whatever else they are; TypeError or ValueError for anything else."""
    times = sequence(name, span) if is_vector(span) else ()
    if len(times) != 2:
        raise TypeError(
            f"{name} must be two ascending {what}, not {told(span)}" + ("" if times else f"; write (0, {told(span)})")
        )
    first, last = (finite(f"{name}[{k}]", value) for k, value in enumerate(times))
    if not last > first:
        raise ValueError(f"{name} must be two ascending {what}, not {told(span)}")
    return first, last


def ascending_times(times: Any) -> np.ndarray:
    """Two or more ascending times (k,); TypeError or ValueError for anything else."""
    when = numbers("times", times)
    if when.ndim != 1 or len(when) < 2 or not np.all(np.diff(when) > 0):
        raise ValueError(f"times must be two or more, ascending, not {told(times)}")
    return when


def triple(name: str, values: Any) -> np.ndarray:
    """A vector in space (3,); TypeError or ValueError, naming the argument, for what is none."""
    vector = reals(name, values)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ValueError(f"{name} must be three finite numbers, not {told(values)}")
    return vector


def momenta_of(momenta: Any, ignorable: Sequence[str]) -> dict[str, float]:
    """The momenta by the names of ``ignorable`` coordinates; TypeError or ValueError for anything else."""
    if not isinstance(momenta, Mapping):
        raise TypeError(f"momenta must map names of coordinates to numbers, not {told(momenta)}; write {{'phi': 1.0}}")
    wrong = [name for name in momenta if name not in ignorable]
    if wrong:
        raise ValueError(f"momenta must name ignorable coordinates, which are {tuple(ignorable)}, not {told(wrong)}")
    return {name: finite(f"momenta[{name!r}]", value) for name, value in momenta.items()}


def sampled(name: str, given: Callable[..., Any], *places: np.ndarray) -> np.ndarray:
    """What a person's function of numbers gives at ``places``, arrays of one shape: a number at each of them.

    Raises TypeError or ValueError, naming the function, where it is none or gives anything else.
    """
    check_arity(name, given, len(places), "it is called with arrays")
    found, shape = reals(f"what {name} returns", given(*places)), places[0].shape
    if found.shape not in ((), shape):
        raise ValueError(f"{name} is called with an array and must return one of its shape, {shape}, not {found.shape}")
    return np.broadcast_to(found, shape)


def times_within(t: Any, span: tuple[float, float]) -> np.ndarray:
    """Times of any shape; ValueError for those at which a motion over ``span`` is not known."""
    times = reals("t", t)
    low, high = min(span), max(span)
    if times.size and not (times.min() >= low and times.max() <= high):
        raise ValueError(f"t must lie between {low:.17g} and {high:.17g}, where the motion is known")
    return times
