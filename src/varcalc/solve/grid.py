"""Parameter values at which one problem is solved: every combination of some, or those that belong together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.problem.conditions import finite, sequence, told
from varcalc.showing import Brief
from varcalc.spelling import spelled

MOST_VALUES = 10**6
"""Values of one name that are written as from, to and count, at most: more were hardly meant."""
Place = tuple[int, ...]
"""Where a point lies: one number an axis of a grid, one number alone among paired values."""


@spelled
@dataclass(frozen=True, repr=False)
class Paired(Brief):
    """Values that are taken together: the first of every name, then the second of every name, and so on.

    It stands where :func:`varcalc.sweep` takes the values of a grid. Raises TypeError and
    ValueError for what are no numbers, and for names with different numbers of them.

    >>> import varcalc as vc
    >>> spring = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, vc.Parameter("to")),
    ...                     parameters={"k": 1, "to": 1})
    >>> vc.sweep(spring, vc.Paired({"k": [0, 1], "to": [3, 2]})).values.round(6).tolist()
    [9.0, 5.252141]
    """

    values: Mapping[str, Iterable[float]]

    def __post_init__(self) -> None:
        axes = checked("Paired.values", self.values)
        counts = {name: len(values) for name, values in axes.items()}
        if len(set(counts.values())) > 1:
            told = ", ".join(f"{name} has {count}" for name, count in counts.items())
            raise ValueError(f"Paired.values must have as many values of one name as of another, but {told}")
        object.__setattr__(self, "values", axes)


@dataclass(frozen=True)
class Grid:
    """Checked values by name: ``paired``, or to be combined in every way, the last name fastest."""

    axes: Mapping[str, tuple[float, ...]]
    paired: bool

    @classmethod
    def of(cls, given: Mapping[str, Iterable[float]] | Paired) -> Grid:
        """The grid that a person means; TypeError and ValueError for what is none."""
        if isinstance(given, Paired):
            return cls({name: tuple(values) for name, values in given.values.items()}, True)
        return cls(checked("grid", given), False)

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values along each axis."""
        counts = tuple(len(values) for values in self.axes.values())
        return counts[:1] if self.paired else counts

    @property
    def count(self) -> int:
        """The number of points."""
        return math.prod(self.shape)

    def places(self) -> Iterator[Place]:
        """Every place, each a neighbour of the one before where that can be told from the order of the values."""
        return walk(self.shape)

    def points(self, places: Sequence[Place]) -> list[dict[str, float]]:
        """The values at some places, by name."""
        indices = np.array(places, dtype=int).reshape(len(places), len(self.shape))
        columns = [indices[:, 0 if self.paired else k] for k in range(len(self.axes))]
        rows = zip(*(np.array(v)[i].tolist() for v, i in zip(self.axes.values(), columns, strict=True)), strict=True)
        return [dict(zip(self.axes, row, strict=True)) for row in rows]

    def document(self) -> dict[str, Any]:
        """The grid as plain lists and dicts."""
        return {name: list(values) for name, values in self.axes.items()}


def checked(label: str, given: Any) -> dict[str, tuple[float, ...]]:
    """Values by name; TypeError and ValueError naming ``label`` for what are none."""
    if not isinstance(given, Mapping) or not given:
        raise ValueError(f"{label} must map names to values, such as {{'g': [1.6, 9.8]}}, not {told(given)}")
    axes = {}
    for name, values in given.items():
        axes[name] = _numbers(f"{label}[{name!r}]", values)
        if not axes[name]:
            raise ValueError(f"{label}[{name!r}] is empty; give at least one value")
    return axes


def _numbers(label: str, values: Iterable[Any]) -> tuple[float, ...]:
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype == float and np.isfinite(values).all():
        return tuple(values.tolist())
    return tuple(finite(label, v) for v in sequence(label, values))


def walk(shape: Sequence[int]) -> Iterator[Place]:
    """Every place of a grid, each a neighbour of the one before: every line is walked back where the last went on."""
    if not shape:
        yield ()
        return
    for number, rest in enumerate(walk(shape[:-1])):
        line = range(shape[-1])
        yield from ((*rest, i) for i in (reversed(line) if number % 2 else line))


def spaced(text: str) -> tuple[str, tuple[float, ...]]:
    """The name and values in "name=from:to:count", or "name=value,value,..."; ValueError for anything else.

    >>> spaced("g=1:3:3"), spaced("k=0.5,2")
    (('g', (1.0, 2.0, 3.0)), ('k', (0.5, 2.0)))
    """
    name, sign, rest = text.partition("=")
    parts = rest.split(":")
    refusal = f"{text!r} is no grid; write name=from:to:count, or name=value,value"
    if not (name and sign) or len(parts) not in (1, 3):
        raise ValueError(refusal)
    try:
        if len(parts) == 1:
            return name, tuple(finite(name, float(v)) for v in rest.split(","))
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise ValueError(refusal) from None
    if not (math.isfinite(first) and math.isfinite(last)) or count > MOST_VALUES:
        raise ValueError(f"{text!r} is no grid of at most {MOST_VALUES} finite values; mend its numbers")
    if count < 1:
        raise ValueError(f"{text!r} has no values; the last number counts them, so write 1 or more")
    return name, tuple(np.linspace(first, last, count).tolist())


def all_spaced(texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The names and values in several such texts; ValueError for a name that stands in two."""
    axes: dict[str, tuple[float, ...]] = {}
    for name, values in map(spaced, texts):
        if name in axes:
            raise ValueError(f"{name!r} is given twice; write all its values at once: {name}=value,value")
        axes[name] = values
    return axes
