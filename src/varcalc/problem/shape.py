"""How many functions there are and over which interval: read off the ends of a problem, and checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from varcalc.problem.conditions import AnyEnd, finite, sequence


def dimension(start: AnyEnd, end: AnyEnd) -> tuple[int, bool]:
    """Number of unknown functions of a Problem, and whether they are handed over as numbers."""
    _check_kind(start, end, False, "Fixed, Free, OnCurve or Periodic")
    if (start.periodic or end.periodic) and start != end:
        raise ValueError("Periodic must be given as both ends, with the same abscissae")
    told = [(label, *known) for label, e in (("start", start), ("end", end)) if (known := e.tells(label)) is not None]
    if not told:
        return 1, True
    (first, n, scalar), (last, m, also) = told[0], told[-1]
    if n != m:
        raise ValueError(f"{first} has {n} components and {last} has {m}; both ends need the same form of y")
    if scalar is not None and also is not None and scalar != also:
        raise ValueError("one end gives y as a number and the other as a sequence; both ends need the same form of y")
    return n, bool(scalar or also)


def _check_kind(start: AnyEnd, end: AnyEnd, of_space: bool, kinds: str) -> None:
    for label, e in (("start", start), ("end", end)):
        if not isinstance(e, AnyEnd) or e.of_space not in (of_space, None):
            raise TypeError(f"{label} must be {kinds}, not {e!r}{_instead(e, of_space)}")


def _instead(given: Any, of_space: bool) -> str:
    """What to write instead of what is no end, where that can be told."""
    if isinstance(given, AnyEnd):
        return f"; {type(given).__name__} is an end of a {'Problem' if of_space else 'Curve'}"
    if isinstance(given, type) and issubclass(given, AnyEnd):
        return f"; that is the class: write {given.__name__}(...)"
    if isinstance(given, tuple | list) and len(given) >= 2 and all(isinstance(v, int | float) for v in given):
        rest = given[1] if len(given) == 2 else list(given[1:])
        return f"; write At({list(given)})" if of_space else f"; write Fixed({given[0]!r}, {rest!r})"
    if isinstance(given, int | float):
        return "; write At([x, y])" if of_space else "; write Fixed(x, y)"
    return "; the arguments are the Lagrangian, the start and the end" if callable(given) else ""


def span_of(start: Any, end: Any) -> tuple[float, float]:
    """The interval of the abscissa; ValueError where there is none."""
    if start.periodic:
        if start.x0 is None or start.x1 is None:
            raise ValueError("Periodic ends of a Problem need abscissae: Periodic(x0, x1)")
        return float(start.x0), float(start.x1)
    a, b = float(start.x), float(end.x)
    if not a < b:
        remedy = "give the left end first" if b < a else "give them different abscissae"
        raise ValueError(f"the end must lie right of the start: start.x = {a}, end.x = {b}; {remedy}")
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


def check_slopes(start: AnyEnd, end: AnyEnd) -> None:
    """ValueError for a slope given at an end of a first-order problem."""
    for label, e in (("start", start), ("end", end)):
        if getattr(e, "dy", None) is not None:
            raise ValueError(f"{label}.dy cannot be fixed for a first-order Lagrangian; leave it out, or use order=2")


def curve_dimension(start: Any, end: Any) -> int:
    """Number of coordinates of a Curve; TypeError, ValueError for ends that do not suit it or each other."""
    _check_kind(start, end, True, "At, OnSurface or Periodic")
    if start.periodic or end.periodic:
        if start != end:
            raise ValueError("Periodic must be given as both ends of a closed Curve")
        if start.x0 is not None:
            raise ValueError("Periodic ends of a Curve take no abscissae; write Periodic()")
        return int(start.n or 2)
    sizes = [e.tells(label)[0] for label, e in (("start", start), ("end", end))]
    if sizes[0] != sizes[1]:
        raise ValueError(f"start has {sizes[0]} coordinates and end has {sizes[1]}; they must agree")
    return sizes[0]
