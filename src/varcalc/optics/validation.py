"""Points and directions as people give them, checked and made arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from varcalc.problem.conditions import finite as number
from varcalc.problem.conditions import numbers, positive, told

__all__ = [
    "CHUNK", "DIMENSIONS", "by_chunks", "chunks", "direction", "how_far", "matched", "number", "numbers", "point",
    "positive", "rows", "unit_rows",
]  # fmt: skip

CHUNK = 1 << 16
"""Rays carried, or points looked at, together: beside the results, that bounds the memory."""
DIMENSIONS = (2, 3)
"""Plane and space."""
PAIR = ("A", "B")
"""What the ends of one search for rays are called."""


def point(name: str, given: Any) -> tuple[float, ...]:
    """One point as a tuple of 2 or 3 floats."""
    array = numbers(name, given)
    if array.ndim != 1 or len(array) not in DIMENSIONS:
        hint = "; many pairs go into one call of arrivals" if array.ndim == 2 and name in PAIR else ""
        kind = "2 coordinates in the plane or 3 in space, such as (0, 1)"
        raise ValueError(f"{name} must be one point, {kind}, not {told(given)}{hint}")
    return tuple(float(v) for v in array)


def direction(name: str, given: Any) -> tuple[float, ...]:
    """One direction as a tuple of 2 or 3 floats of length one."""
    vector = _of_size_one(np.array(point(name, given)))
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise ValueError(f"{name} has length zero; give any vector that points the way")
    return tuple(float(v) for v in vector / length)


def rows(name: str, given: Any, dimension: int | None = None) -> np.ndarray:
    """Points or directions as an array (m, d); a single one becomes one row."""
    array = numbers(name, given)
    array = array[None, :] if array.ndim == 1 else array
    if array.ndim != 2 or array.shape[1] not in DIMENSIONS:
        hint = "; the direction at an angle a is (cos(a), sin(a))" if array.ndim == 0 and name == "directions" else ""
        raise ValueError(f"{name} must have shape (m, 2) in the plane or (m, 3) in space, not {array.shape}{hint}")
    if dimension is not None and array.shape[1] != dimension:
        raise ValueError(f"{name} must have {dimension} coordinates here, not {array.shape[1]}")
    return array


def unit_rows(name: str, given: Any, dimension: int | None = None) -> np.ndarray:
    """Directions as an array (m, d) of unit vectors; ValueError where one has length zero."""
    array = _of_size_one(rows(name, given, dimension))
    lengths = np.linalg.norm(array, axis=1)
    if np.any(lengths == 0):
        raise ValueError(f"{name}: row {int(np.argmin(lengths))} has length zero; give any vector that points the way")
    return array / lengths[:, None]


def _of_size_one(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., d) by powers of two of their own, exactly: squares of any number of theirs are floats."""
    return np.ldexp(vectors, -np.frexp(np.abs(vectors).max(axis=-1, keepdims=True))[1])


def matched(first_name: str, first: np.ndarray, name: str, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Views (m, d) of both, where a single row of one serves for all of the other; ValueError naming them."""
    if len(first) != len(second) and 1 not in (len(first), len(second)):
        raise ValueError(f"there are {len(first)} {first_name} and {len(second)} {name}; give as many of both, or one")
    m = len(second) if len(first) == 1 else len(first)
    return np.broadcast_to(first, (m, first.shape[1])), np.broadcast_to(second, (m, second.shape[1]))


def how_far(name: str, given: Any, count: int) -> np.ndarray:
    """How far (count,) each ray goes, from one number or one for each; ValueError naming ``name``."""
    until = numbers(name, given)
    if until.shape not in ((), (count,)):
        raise ValueError(f"{name} must be one number or one for each of the {count} rays, not of shape {until.shape}")
    if np.any(until < 0):
        raise ValueError(f"{name} must not be negative; turn the directions round to go back")
    return np.broadcast_to(until, (count,))


def by_chunks(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """``function`` (m,) of points (m, d), so many at a time; of one that is there m times, once."""
    if points.strides[0] == 0:
        return np.broadcast_to(function(points[:1]), len(points))
    return np.concatenate([function(points[part]) for part in chunks(len(points))] or [np.zeros(0)])


def chunks(count: int) -> list[slice]:
    """Parts of ``count`` rays or points, each a chunk at most, and of one size: few are carried more slowly each."""
    size = -(-count // max(1, -(-count // CHUNK)))
    return [slice(first, min(first + size, count)) for first in range(0, count, max(1, size))]
