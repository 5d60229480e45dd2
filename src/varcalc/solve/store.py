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
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Self

from varcalc.problem.conditions import file
from varcalc.showing import brief
from varcalc.solve.grid import Grid, Paired, Place, checked
from varcalc.solve.identity import same
from varcalc.solve.point import SweepPoint

FORMAT = {"format": "varcalc sweep", "version": 1}
DIFFERENT = {
    "grid": "with other values of the parameters", "paired": "with another grid", "units": "in other units",
    "method": "by another method", "tol": "to another tolerance", "problem": "of another problem",
}  # fmt: skip
"""What a store is of that differs from what is wanted, by the part of the first line that does."""


HEADED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "paired": ("true or false", lambda given: isinstance(given, bool)),
    "units": ("units by the names of parameters", lambda given: _is_named(given, str)),
    "method": ("words", lambda given: isinstance(given, str)),
    "tol": ("a number", lambda given: isinstance(given, int | float) and not isinstance(given, bool)),
    "problem": ("what tells it from others", lambda given: isinstance(given, dict)),
}
"""What each part of the first line but the grid is, in words, and whether something is that."""


class Store:
    """A file of points, open to take more; ``known`` are those it has, ``notes`` what was odd about it."""

    def __init__(self, path: str | Path, header: dict[str, Any]) -> None:
        """Open the file at ``path``, or begin one.

        Raises ValueError when the file belongs to something else, OSError when it cannot be written.
        """
        path = file("store", path)
        if not path.parent.is_dir():
            raise FileNotFoundError(f"there is no folder {path.parent} for the store {path.name}; make it first")
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
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}; give one that sweep(..., store=) wrote")
    whole, rest = path.read_bytes(), b""
    if not whole.endswith(b"\n"):
        end = whole.rfind(b"\n") + 1
        whole, rest = whole[:end], whole[end:]
    lines = whole.decode("utf-8", errors="replace").splitlines()
    found: dict[Place, SweepPoint] = {}
    header, grid = {}, Grid({}, paired=False)
    for number, line in enumerate(lines or [""], start=1):
        try:
            if number == 1:
                header, grid = _headed(_parsed(line))
            else:
                at, point = _pointed(_parsed(line), grid)
                found[at] = point
        except (ValueError, TypeError) as error:
            raise ValueError(
                f"{path} is no store of this sweep (line {number}: {error}); give another name, or remove it"
            ) from error
    notes = (f"the last line of {path.name} was cut short and dropped; its point is solved again",) if rest else ()
    return header, found, notes, len(whole)


def _parsed(line: str) -> Any:
    """What JSON says in a line; ValueError for what it cannot."""
    try:
        return json.loads(line, parse_constant=_no_number)
    except RecursionError:
        raise ValueError("it is nested too deeply for a line of a store") from None


def _is_named(given: Any, kind: type) -> bool:
    return isinstance(given, dict) and all(isinstance(value, kind) for value in given.values())


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def _headed(header: Any) -> tuple[dict[str, Any], Grid]:
    """The first line of a store, and its grid."""
    if not isinstance(header, dict) or {k: header.get(k) for k in FORMAT} != FORMAT:
        raise ValueError(f"a store of version {FORMAT['version']} does not begin so")
    for name, (means, allowed) in HEADED.items():
        if not allowed(header.get(name)):
            raise ValueError(f"{name} must be {means}, not {brief(header.get(name))}")
    axes = checked("grid", header.get("grid"))
    if header["paired"]:
        Paired(axes)  # which sees to it that there are as many of one as of another
    return header, Grid(axes, header["paired"])


def _pointed(row: Any, grid: Grid) -> tuple[Place, SweepPoint]:
    """Any other line: a place on the grid and its point."""
    at = row.pop("at", None) if isinstance(row, dict) else None
    counts = grid.shape
    if not isinstance(at, list) or [type(k) for k in at] != [int] * len(counts):
        raise ValueError(f"at must be a list of {len(counts)} whole numbers, not {brief(at)}")
    if not all(0 <= k < count for k, count in zip(at, counts, strict=True)):
        raise ValueError(f"at = {at} lies outside the grid, which has {' x '.join(map(str, counts))} points")
    point, columns = SweepPoint.read(row), at * len(grid.axes) if grid.paired else at
    wanted = [values[k] for values, k in zip(grid.axes.values(), columns, strict=True)]
    if not same(list(point.values), wanted):
        raise ValueError(f"values = {list(point.values)} are not those of the grid there, {wanted}")
    return tuple(at), point


def _check_same(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Refuse a store that is not of what is wanted."""
    wanted = json.loads(json.dumps(wanted, allow_nan=False))
    for part, words in DIFFERENT.items():
        if not same(found.get(part), wanted.get(part)):
            raise ValueError(f"{path} is the store of a sweep {words}; give another name, or remove it")
