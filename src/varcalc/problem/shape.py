"""How many functions there are and over which interval: read off the ends of a problem, and checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from varcalc.problem.conditions import (
    At,
    Fixed,
    Free,
    OnCurve,
    OnSurface,
    Periodic,
    components,
    finite,
    is_vector,
    sequence,
)


def dimension(start: Any, end: Any) -> tuple[int, bool]:
    """Number of unknown functions, and whether they are handed over as scalars."""
    told: list[tuple[str, int, bool | None]] = []  # where only n is told, a single y may be handed over either way
    for label, e in (("start", start), ("end", end)):
        if not isinstance(e, Fixed | Free | OnCurve | Periodic):
            raise TypeError(f"{label} must be Fixed, Free, OnCurve or Periodic, not {e!r}")
        if isinstance(e, Fixed):
            told.append((label, len(components(f"{label}.y", e.y)), not is_vector(e.y)))
        elif e.n is not None:
            told.append((label, int(e.n), None))
    if isinstance(start, Periodic) != isinstance(end, Periodic) or (isinstance(start, Periodic) and start != end):
        raise ValueError("Periodic must be given as both ends, with the same abscissae")
    if not told:
        return 1, True
    (first, n, scalar), (last, m, also) = told[0], told[-1]
    if n != m:
        raise ValueError(f"{first} has {n} components and {last} has {m}; both ends need the same form of y")
    if scalar is not None and also is not None and scalar != also:
        raise ValueError("one end gives y as a number and the other as a sequence; both ends need the same form of y")
    return n, bool(scalar or also)


def span_of(start: Any, end: Any) -> tuple[float, float]:
    """The interval of the abscissa; ValueError where there is none."""
    if isinstance(start, Periodic):
        if start.x0 is None or start.x1 is None:
            raise ValueError("Periodic ends of a Problem need abscissae: Periodic(x0, x1)")
        return float(start.x0), float(start.x1)
    a, b = float(start.x), float(end.x)
    if not a < b:
        raise ValueError(f"the end must lie right of the start: start.x = {a}, end.x = {b}")
    return a, b


def inside(name: str, values: Sequence[float], span: tuple[float, float], start: Any, end: Any) -> tuple[float, ...]:
    """The abscissae ``values`` in ascending order, each once; ValueError for one outside the interval ``span``."""
    marks = tuple(sorted({finite(name, v) for v in sequence(name, values)})) if values != () else ()
    if marks and (start.slides or end.slides):
        raise ValueError(f"{name}: abscissae inside the interval cannot be kept while an end slides on a curve")
    for v in marks:
        if not span[0] < v < span[1]:
            raise ValueError(f"{name} = {v} must lie strictly between the ends, {span[0]} and {span[1]}")
    return marks


def check_slopes(start: Any, end: Any, order: int) -> None:
    """ValueError for a slope given at an end of a first-order problem."""
    for label, e in (("start", start), ("end", end)):
        if isinstance(e, Fixed) and e.dy is not None and order == 1:
            raise ValueError(f"{label}.dy cannot be fixed for a first-order Lagrangian; leave it out, or use order=2")


def curve_point(end: Any) -> np.ndarray | None:
    """A point near the end of a Curve, zeros for free components, None for a closed curve."""
    if isinstance(end, At):
        return np.array([0.0 if v is None else v for v in components("At.q", end.q)])
    if isinstance(end, OnSurface):
        return np.array(end.guess, dtype=float)
    return None


def curve_dimension(start: Any, end: Any) -> int:
    """Number of coordinates of a Curve; TypeError, ValueError for ends that do not suit it or each other."""
    for label, e in (("start", start), ("end", end)):
        if not isinstance(e, At | OnSurface | Periodic):
            raise TypeError(f"{label} must be At, OnSurface or Periodic, not {e!r}")
    if isinstance(start, Periodic) or isinstance(end, Periodic):
        if start != end:
            raise ValueError("Periodic must be given as both ends of a closed Curve")
        if start.x0 is not None:
            raise ValueError("Periodic ends of a Curve take no abscissae; write Periodic()")
        return int(start.n or 2)
    sizes = [len(p) for p in map(curve_point, (start, end)) if p is not None]
    if sizes[0] != sizes[1]:
        raise ValueError(f"start has {sizes[0]} coordinates and end has {sizes[1]}; they must agree")
    return sizes[0]
