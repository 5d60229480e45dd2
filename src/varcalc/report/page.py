"""A page as plain data: what it says in one line each, and sections of parts; it knows nothing of HTML."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

from varcalc.showing import Fact


class Mark(Enum):
    """How an answer stands, for a reader who sees only one sign of it."""

    GOOD = "stands"
    DOUBTFUL = "with a reservation"
    BAD = "no answer"


@dataclass(frozen=True)
class Formula:
    """A formula in LaTeX, on a line of its own."""

    latex: str


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; ``verbatim`` keeps its lines as they are."""

    text: str
    verbatim: bool = False


@dataclass(frozen=True)
class Facts:
    """Facts below each other."""

    facts: tuple[Fact, ...]


@dataclass(frozen=True)
class Listed:
    """Sentences as a list."""

    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """A cell of a table: what is shown, and the number it is sorted by where it is one."""

    text: str
    value: float | None = None
    href: str = ""


@dataclass(frozen=True)
class Table:
    """A table that can be sorted by each of its columns; ``numbers`` tells which of them hold numbers."""

    caption: str
    columns: tuple[str, ...]
    numbers: tuple[bool, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture as SVG whose colours follow the theme: ``colours`` holds them for light and for dark, by name.

    ``alt`` says what is seen, for who cannot see it.
    """

    svg: str
    alt: str
    caption: str
    width: float
    colours: tuple[tuple[str, str, str], ...] = ()


@dataclass(frozen=True)
class Pictures:
    """Pictures beside each other, as many as there is room for."""

    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class Folded:
    """Parts that are shown when they are asked for."""

    summary: str
    parts: tuple[Part, ...]


Part = Paragraph | Formula | Facts | Listed | Table | Pictures | Folded


@dataclass(frozen=True)
class PageSection:
    """A section of a page; the ``level`` of its heading is 2, or 3 within one."""

    heading: str
    parts: tuple[Part, ...]
    level: int = 2

    @property
    def anchor(self) -> str:
        """What a link within the page leads to."""
        return "-".join("".join(c if c.isalnum() else " " for c in self.heading.lower()).split())


@dataclass(frozen=True)
class Page:
    """All that is said of one subject.

    ``kind`` is what it is (a problem, a scene, a system), ``answer`` the answer in a line, ``known`` how well it is
    known, ``mark`` how it stands; ``sketch`` is a small picture of a line or a few, each (2, m) as tuples.
    """

    name: str
    kind: str
    title: str
    answer: str
    known: str
    mark: Mark
    sections: tuple[PageSection, ...]
    sketch: str = ""
    value: float | None = None
    error: float | None = None
    seconds: float = 0.0

    @property
    def pictures(self) -> Iterable[Picture]:
        """Every picture of the page."""
        return _pictures(part for section in self.sections for part in section.parts)


def _pictures(parts: Iterable[Part]) -> Iterable[Picture]:
    for part in parts:
        if isinstance(part, Pictures):
            yield from part.pictures
        elif isinstance(part, Folded):
            yield from _pictures(part.parts)


def number_cell(value: float | None, form: str, *, shown: bool = True) -> Cell:
    """A cell of a number; empty where there is none, or where it is not to be shown."""
    if value is None or math.isnan(value) or not shown:
        return Cell("")
    return Cell(format(value, form), float(value))


def table(caption: str, columns: Sequence[tuple[str, bool]], rows: Iterable[Sequence[Cell]]) -> Table:
    """A table of ``columns``, each a heading and whether it holds numbers."""
    return Table(caption, tuple(c for c, _ in columns), tuple(n for _, n in columns), tuple(map(tuple, rows)))
