"""A figure to draw as plain data: panels of lines, points and levels, that know of no drawing program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Line:
    """A line through places ``x``, ``y`` (m,), and ``z`` in a panel in space; where one is no number it breaks.

    Lines of one ``colour``, a number from 0 on, look alike; without it each has its own, in the order in which they
    come. ``label`` stands in the panel's legend.
    """

    x: Any
    y: Any
    z: Any = None
    label: str = ""
    dashed: bool = False
    colour: int | None = None

    @property
    def places(self) -> np.ndarray:
        """The coordinates (2, m) or (3, m)."""
        given = (self.x, self.y) if self.z is None else (self.x, self.y, self.z)
        return np.array(np.broadcast_arrays(*(np.atleast_1d(np.asarray(part, dtype=float)) for part in given)))


@dataclass(frozen=True)
class Points(Line):
    """Dots in the place of a line."""


@dataclass(frozen=True)
class Levels:
    """The lines on which ``values`` (r, c) over ``x`` (c,) and ``y`` (r,) have given ``levels``, ascending."""

    x: Any
    y: Any
    values: Any
    levels: Sequence[float]
    dashed: bool = False
    colour: int | None = None


@dataclass(frozen=True)
class Net:
    """A surface in space, drawn faintly by ``lines`` on it, each (3, m)."""

    lines: Sequence[np.ndarray]


@dataclass(frozen=True)
class Shades:
    """A map of ``values`` (r, c) over ``x`` (c,) and ``y`` (r,), with a bar beside it that says what they are."""

    x: Any
    y: Any
    values: Any
    label: str


@dataclass(frozen=True)
class Text:
    """A word at a place."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Panel:
    """One picture of a figure: its ``parts`` over the axes ``x`` and ``y``, which are named, and ``z`` in space.

    ``equal`` gives both axes one scale; ``within`` limits them, (x0, x1, y0, y1); ``logarithmic`` is that of y. A
    panel with a ``z`` is drawn in space, on a ``sphere`` of radius 1 where that is asked for, ``bare`` of axes, and
    seen from the direction ``towards`` (3,) which it looks.
    """

    parts: Sequence[Line | Levels | Text | Net | Shades]
    x: str
    y: str
    z: str = ""
    title: str = ""
    equal: bool = False
    within: tuple[float, float, float, float] | None = None
    logarithmic: bool = False
    sphere: bool = False
    bare: bool = False
    towards: Sequence[float] | None = None


@dataclass(frozen=True)
class Drawing:
    """A figure: its ``title``, and a function that computes its panels, row by row, when they are asked for.

    >>> Drawing("A line", lambda: [[Panel([Line([0, 1], [0, 2])], "x", "y")]]).rows[0][0].parts[0].places
    array([[0., 1.],
           [0., 2.]])
    """

    title: str
    compute: Callable[[], Sequence[Sequence[Panel]]]

    @cached_property
    def rows(self) -> tuple[tuple[Panel, ...], ...]:
        """The panels. Raises ValueError where there is none."""
        rows = tuple(tuple(row) for row in self.compute())
        if not rows or not all(rows):
            raise ValueError(f"the figure {self.title!r} has no panel in a row; compute must return rows of panels")
        return rows
