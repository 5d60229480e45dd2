"""Tables as text for a monospaced page, and numbers as their cells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

TABLE_WIDTH = 400
"""Columns offered to a table: more than any takes, so that nothing is cut short where output is not a terminal."""


def table(
    words: Sequence[str],
    numbers: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    last: Sequence[str] = (),
    notes: Iterable[str] = (),
) -> str:
    """Columns of words, of numbers, and ``last`` of words again, as wide as their content, with ``notes`` beneath."""
    # rich is only for those who ask for a table
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    drawn = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for headings, right in ((words, False), (numbers, True), (last, False)):
        for heading in headings:
            drawn.add_column(heading, justify="right" if right else "left", no_wrap=True)
    for row in rows:
        drawn.add_row(*row)
    console = Console(width=TABLE_WIDTH, color_system=None, force_terminal=False, markup=False)
    with console.capture() as capture:
        console.print(drawn)
    lines = [line.rstrip() for line in capture.get().splitlines()]
    return "\n".join([*lines, "", *notes]).rstrip()


def shown(value: float | None, form: str) -> str:
    """A number as the text of a cell, empty where there is none (None or NaN)."""
    return "" if value is None or math.isnan(value) else format(value, form)


def labelled(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Lines of a label and a text each, the texts below each other."""
    rows = list(rows)
    width = max(len(label) for label, _ in rows)
    return [f"  {label:<{width}}  {text}" for label, text in rows]


def known(value: float | None) -> float | None:
    """A number as a document holds it: None where it is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)
