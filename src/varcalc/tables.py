"""Tables as text for a monospaced page, and numbers as their cells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

BETWEEN = "   "
"""What stands between columns."""


def table(
    words: Sequence[str],
    numbers: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    last: Sequence[str] = (),
    notes: Iterable[str] = (),
) -> str:
    """Columns of words, of numbers, and ``last`` of words again, as wide as their content, with ``notes`` beneath."""
    # rich measures characters; its own tables take 0.25 ms a row, a sweep less for a solve
    from rich.cells import cell_len

    right = [False] * len(words) + [True] * len(numbers) + [False] * len(last)
    lines = [[*words, *numbers, *last], *map(list, rows)]
    lengths = [[cell_len(cell) for cell in line] for line in lines]
    widths = [max(column) for column in zip(*lengths, strict=True)]
    drawn = [
        BETWEEN.join(
            " " * (width - length) + cell if to_right else cell + " " * (width - length)
            for cell, length, width, to_right in zip(line, taken, widths, right, strict=True)
        ).rstrip()
        for line, taken in zip(lines, lengths, strict=True)
    ]
    drawn.insert(1, "─" * (sum(widths) + len(BETWEEN) * (len(widths) - 1)))
    return "\n".join([*drawn, "", *notes]).rstrip()


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
