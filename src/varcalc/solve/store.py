"""The file a sweep is kept in: lines of JSON, the first of which says what is swept, and every other is a point.

Lines are only ever added, those of one chunk in one write, so that a process that is killed loses the chunk in flight
and no more. Reading runs nothing: what is in the file is numbers and words. The layout, by its number:

1. ``{"format": "varcalc sweep", "version": 1, "grid": {name: [values]}, "paired": bool, "units": {name: unit},
   "method": words, "tol": number, "problem": what tells it from others}``, then for each point ``{"at": [places along
   the axes], "values": [numbers], "status": words, "value": number or null, "claimed_error": number or null,
   "iterations": number, "seconds": number, "message": words, "local": bool, "lower": number, null or "-inf"}``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

from varcalc.solve.grid import Place
from varcalc.solve.identity import same
from varcalc.solve.point import SweepPoint

FORMAT = {"format": "varcalc sweep", "version": 1}
DIFFERENT = {
    "grid": "with other values of the parameters", "paired": "with another grid", "units": "in other units",
    "method": "by another method", "tol": "to another tolerance", "problem": "of another problem",
}  # fmt: skip
"""What a store is of that differs from what is wanted, by the part of the first line that does."""


class Store:
    """A file of points, open to take more; ``known`` are those it has, ``notes`` what was odd about it."""

    def __init__(self, path: str | Path, header: dict[str, Any]) -> None:
        """Open the file at ``path``, or begin one.

        Raises ValueError when the file belongs to something else, OSError when it cannot be written.
        """
        path = Path(path)
        self.known: dict[Place, SweepPoint] = {}
        self.notes: tuple[str, ...] = ()
        header = FORMAT | header
        if path.exists() and path.stat().st_size:
            found, self.known, self.notes, length = read(path)
            _check_same(path, found, header)
            self.file = path.open("r+b")
            # what was being written when the sweep ended is written again
            self.file.truncate(length)
            self.file.seek(length)
        else:
            self.file = path.open("xb" if not path.exists() else "wb")
            self._write([header])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()

    def add(self, points: Iterable[tuple[Place, SweepPoint]]) -> None:
        """Append points, all in one write."""
        self._write({"at": list(at), **point.row()} for at, point in points)

    def _write(self, rows: Iterable[dict[str, Any]]) -> None:
        self.file.write("".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode())
        self.file.flush()


def read(path: Path) -> tuple[dict[str, Any], dict[Place, SweepPoint], tuple[str, ...], int]:
    """The first line of a store, its points, notes on it, and how many of its bytes are whole lines.

    Raises ValueError for what is no store, OSError where there is no file.
    """
    whole, rest = path.read_bytes(), b""
    if not whole.endswith(b"\n"):
        end = whole.rfind(b"\n") + 1
        whole, rest = whole[:end], whole[end:]
    lines = whole.decode("utf-8", errors="replace").splitlines()
    found: dict[Place, SweepPoint] = {}
    header: dict[str, Any] = {}
    for number, line in enumerate(lines or [""], start=1):
        try:
            if number == 1:
                header = _headed(line)
            else:
                at, point = _pointed(line)
                found[at] = point
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise ValueError(
                f"{path} is no store of this sweep (line {number}: {error}); give another name, or remove it"
            ) from error
    notes = (f"the last line of {path.name} was cut short and dropped; its point is solved again",) if rest else ()
    return header, found, notes, len(whole)


def _headed(line: str) -> dict[str, Any]:
    """The first line of a store."""
    header = json.loads(line)
    if not isinstance(header, dict) or {k: header.get(k) for k in FORMAT} != FORMAT:
        raise ValueError(f"a store of version {FORMAT['version']} does not begin so")
    return header


def _pointed(line: str) -> tuple[Place, SweepPoint]:
    """Any other line: a place and its point."""
    row = json.loads(line)
    return tuple(row.pop("at")), SweepPoint.read(row)


def _check_same(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Refuse a store that is not of what is wanted."""
    wanted = json.loads(json.dumps(wanted, allow_nan=False))
    for part, words in DIFFERENT.items():
        if not same(found.get(part), wanted.get(part)):
            raise ValueError(f"{path} is the store of a sweep {words}; give another name, or remove it")
