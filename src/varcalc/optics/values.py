"""Points and directions as people give them, checked and made arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

DIMENSIONS = (2, 3)
"""Plane and space."""


def numbers(name: str, given: Any) -> np.ndarray:
    """``given`` as an array of finite floats; TypeError or ValueError naming ``name``."""
    try:
        array = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be made of numbers, not {given!r}") from None
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} must be finite, not {given!r}")
    return array


def point(name: str, given: Any) -> tuple[float, ...]:
    """One point as a tuple of 2 or 3 floats."""
    array = numbers(name, given)
    if array.ndim != 1 or len(array) not in DIMENSIONS:
        raise ValueError(f"{name} must be one point, 2 coordinates in the plane or 3 in space, not {given!r}")
    return tuple(float(v) for v in array)


def direction(name: str, given: Any) -> tuple[float, ...]:
    """One direction as a tuple of 2 or 3 floats of length one."""
    vector = np.array(point(name, given))
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise ValueError(f"{name} has length zero; give any vector that points the way")
    return tuple(float(v) for v in vector / length)


def rows(name: str, given: Any, dimension: int | None = None) -> np.ndarray:
    """Points or directions as an array (m, d); a single one becomes one row."""
    array = numbers(name, given)
    array = array[None, :] if array.ndim == 1 else array
    if array.ndim != 2 or array.shape[1] not in DIMENSIONS:
        raise ValueError(f"{name} must have shape (m, 2) in the plane or (m, 3) in space, not {array.shape}")
    if dimension is not None and array.shape[1] != dimension:
        raise ValueError(f"{name} must have {dimension} coordinates here, not {array.shape[1]}")
    return array


def unit_rows(name: str, given: Any, dimension: int | None = None) -> np.ndarray:
    """Directions as an array (m, d) of unit vectors; ValueError where one has length zero."""
    array = rows(name, given, dimension)
    lengths = np.linalg.norm(array, axis=1)
    if np.any(lengths == 0):
        raise ValueError(f"{name}: row {int(np.argmin(lengths))} has length zero; give any vector that points the way")
    return array / lengths[:, None]


def matched(names: str, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Copies (m, d) of both, where a single row of one serves for all of the other; ``names`` are theirs."""
    if len(first) != len(second) and 1 not in (len(first), len(second)):
        raise ValueError(f"there are {len(first)} and {len(second)} {names}; give as many of both, or one")
    m = len(second) if len(first) == 1 else len(first)
    return np.array(np.broadcast_to(first, (m, first.shape[1]))), np.array(
        np.broadcast_to(second, (m, second.shape[1]))
    )
