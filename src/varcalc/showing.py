"""Objects that show themselves: a line as ``repr``, a few lines when printed, HTML in a notebook, and a picture.

A record of few numbers derives from :class:`Brief`. One that holds more derives from :class:`Shown`, and says in
``_facts`` what there is to say of it; print and notebook are made of that (of HTML there is a table, for which no
template has to be loaded). One that can be drawn derives from
:class:`Plotted`; ``varcalc.charts`` knows how.
"""

from __future__ import annotations

import base64
import html
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import singledispatch
from textwrap import shorten
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.axes import measured
from varcalc.spelling import NoMember, spelled
from varcalc.symbolic.tracing import name_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE = 100
"""Characters of a repr, at most."""
MOST_ENTRIES = 4
"""Entries of a sequence that are written out; of more, only the number is."""
LONG_TEXT = 40
FACT_WIDTH = 150
"""Characters of a fact in a print, about."""
PICTURE_DPI = 60
"""Of the picture in a notebook: a small one."""


@dataclass(frozen=True)
class Fact:
    """One thing that is to be said of an object: what it is about, in words, and as a ``formula`` in LaTeX."""

    label: str
    text: str
    formula: str = ""


class Brief:
    """A record whose repr is one line: the fields as they are where they are short."""

    def __repr__(self) -> str:
        return _record(self)

    if not TYPE_CHECKING:  # which knows what is there

        def __getattr__(self, name: str) -> Any:
            """No such name: the error says what was meant. What is there and failed fails once more, in its words."""
            if hasattr(type(self), name):
                return object.__getattribute__(self, name)
            raise NoMember(type(self), name)


class Shown(Brief):
    """An object that shows itself in a line, in a few lines, and in a notebook."""

    def _headline(self) -> str:
        """What it is; nothing where the facts say it."""
        return type(self).__name__

    def _facts(self) -> Iterable[Fact]:
        """What there is to say of it: by default its fields."""
        for name, value in _shown_fields(self):
            yield Fact(name, shorten(brief(value), LINE, placeholder=" ..."))

    def __str__(self) -> str:
        told = [(f"{fact.label}:" if fact.label else "", fact.text) for fact in self._facts()]
        width, head = max((len(label) for label, _ in told), default=0), self._headline()
        rows = [f"{'  ' if head else ''}{label:<{width}} {text}" for label, text in told]
        return "\n".join([head, *rows] if head else rows)

    def _repr_html_(self) -> str:
        """What a notebook shows: the headline, a table of the facts, and the picture where there is one."""
        rows = "".join(f"<tr>{_cell(fact.label, 'th')}{_value(fact)}</tr>" for fact in self._facts())
        head = f"<p><strong>{html.escape(self._headline())}</strong></p>" if self._headline() else ""
        return f'<div class="varcalc">{head}<table>{rows}</table>{self._picture_html()}</div>'

    def _picture_html(self) -> str:
        return ""


class Plotted(Shown):
    """An object that can be drawn as well."""

    @spelled
    def plot(self) -> Figure:
        """The picture, a matplotlib Figure of its own: write it with ``savefig``; a notebook shows it.

        Raises ValueError where there is nothing to draw, with the reason.
        """
        return charts().picture(self)

    def _picture_html(self) -> str:
        try:
            figure = self.plot()
        except ValueError as error:
            return f"<p>{html.escape(str(error))}</p>"
        out = io.BytesIO()
        figure.savefig(out, format="png", dpi=PICTURE_DPI)
        return f'<img alt="" src="data:image/png;base64,{base64.b64encode(out.getvalue()).decode()}">'


def charts() -> ModuleType:
    """The pictures: the one way to them from below, on demand, as matplotlib takes longer to load than many solves."""
    from varcalc import charts

    return charts


def line(name: str, parts: Iterable[str]) -> str:
    """``name(part, part, ...)`` in one line, as many parts as it has room for.

    >>> line("Sweep", ["g=1", "points=12"])
    'Sweep(g=1, points=12)'
    """
    given = [" ".join(part.split()) for part in parts]
    kept = list(given)
    while kept and len(_called(name, kept, len(kept) < len(given))) > LINE:
        kept.pop()
    return _called(name, kept, len(kept) < len(given))


def _called(name: str, parts: Sequence[str], more: bool) -> str:
    return f"{name}({', '.join([*parts, *(['...'] if more else [])])})"


@singledispatch
def brief(value: Any) -> str:
    """A value in a few characters: numbers as they are, arrays by their shape, functions by their name.

    >>> brief(0.1), brief(np.zeros((3, 100))), brief([1, None]), brief(len), brief("a")
    ('0.1', 'array(3, 100)', '[1, None]', 'len', "'a'")
    >>> brief(np.array([1, 2]) / 3), brief(np.arange(1, 5) / 7)
    ('[0.3333333333333333, 0.6666666666666666]', '[0.142857, 0.285714, 0.428571, 0.571429]')
    """
    if not hasattr(value, "__name__") and (isinstance(value, Brief) or is_dataclass(value)):
        short = repr(value) if isinstance(value, Brief) else _record(value)
        return short if len(short) <= LONG_TEXT else f"{type(value).__name__}(...)"
    return name_of(value) if callable(value) else shorten(repr(value), LONG_TEXT, placeholder=" ...")


@brief.register
def _member(value: Enum) -> str:
    return value.name


@brief.register
def _number(value: np.generic) -> str:
    return repr(value.item())


@brief.register
def _array(value: np.ndarray) -> str:
    if value.ndim > 1 or value.size > MOST_ENTRIES:
        return f"array{value.shape}"
    whole = brief(value.tolist())
    # a few numbers are seen, if not to all their digits
    return f"[{', '.join(f'{v:.6g}' for v in value)}]" if value.dtype.kind == "f" and "entries" in whole else whole


@brief.register
def _text(value: str) -> str:
    return repr(shorten(value, LONG_TEXT, placeholder=" ..."))


@brief.register
def _mapping(value: Mapping) -> str:  # type: ignore[type-arg]  # by its type the function is chosen
    return _many(value, "{", (f"{key!r}: {brief(entry)}" for key, entry in value.items()), "}")


@brief.register
def _list(value: list) -> str:  # type: ignore[type-arg]
    return _many(value, "[", map(brief, value), "]")


@brief.register
def _tuple(value: tuple) -> str:  # type: ignore[type-arg]
    return _many(value, "(", map(brief, value), ",)" if len(value) == 1 else ")")


def _record(thing: Any) -> str:
    return line(type(thing).__name__, (f"{name}={brief(value)}" for name, value in _shown_fields(thing)))


def _many(value: Sequence[Any] | Mapping[Any, Any], left: str, parts: Iterable[str], right: str) -> str:
    if len(value) <= MOST_ENTRIES and len(short := left + ", ".join(parts) + right) <= LONG_TEXT:
        return short
    return f"{left}{len(value)} entries{right[-1]}"


def _shown_fields(thing: Any) -> Iterator[tuple[str, Any]]:
    """The fields of a record that its author wants seen."""
    if is_dataclass(thing):
        yield from ((f.name, getattr(thing, f.name)) for f in fields(thing) if f.repr)


def figure_of(value: float, error: float, unit: str = "") -> str:
    """A value and what is claimed of it, as people write it; "none" where it is no number.

    >>> figure_of(5.0, 2e-15), figure_of(5.0, 2e-15, "m")
    ('5, known to 2e-15', '5 m, known to 2e-15')
    """
    if math.isnan(value):
        return "none"
    return measured(f"{value:.12g}", unit) + (f", known to {error:.1g}" if math.isfinite(error) else "")


def counted(number: int, noun: str, plural: str = "") -> str:
    """A number of things in words.

    >>> counted(1, "ray"), counted(3, "ray")
    ('1 ray', '3 rays')
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def listed(values: Mapping[str, float]) -> str:
    """Numbers by their names, as many as there is room for.

    >>> listed({"g": 9.81, "h": 1.0})
    'g = 9.81, h = 1'
    """
    return shorten(", ".join(f"{name} = {value:.9g}" for name, value in values.items()), FACT_WIDTH, placeholder=" ...")


def equations(lines: Sequence[str]) -> str:
    """Formulas in LaTeX below each other as one."""
    return lines[0] if len(lines) == 1 else r"\begin{gathered}" + r" \\ ".join(lines) + r"\end{gathered}"


def _cell(text: str, kind: str) -> str:
    return f'<{kind} style="text-align:left;vertical-align:top">{html.escape(text)}</{kind}>'


def _value(fact: Fact) -> str:
    if fact.formula:
        return f'<td style="text-align:left">$\\displaystyle {html.escape(fact.formula)}$</td>'
    return _cell(fact.text, "td")
