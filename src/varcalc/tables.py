"""Tables as text for a monospaced page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

TABLE_WIDTH = 400
"""Columns offered to a table: more than any takes, so that nothing is cut short where output is not a terminal."""


def monospaced(words: Sequence[str], numbers: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """The lines of a table: columns of words, then columns of numbers, as wide as their content."""
    # rich is only for those who ask for a table
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for heading in words:
        table.add_column(heading, no_wrap=True)
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(width=TABLE_WIDTH, color_system=None, force_terminal=False, markup=False)
    with console.capture() as capture:
        console.print(table)
    return [line.rstrip() for line in capture.get().splitlines()]
