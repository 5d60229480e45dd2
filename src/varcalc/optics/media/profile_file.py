"""Measured profiles from files of columns: heights or depths against an index or a speed."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from varcalc.optics.media.tabulated import Tabulated
from varcalc.problem.conditions import file
from varcalc.spelling import spelled

HEIGHT, DEPTH, INDEX, SPEED = "height", "depth", "index", "speed"
WORDS = {
    "height": HEIGHT, "heights": HEIGHT, "altitude": HEIGHT, "alt": HEIGHT, "elevation": HEIGHT, "z": HEIGHT,
    "h": HEIGHT, "depth": DEPTH, "depths": DEPTH, "index": INDEX, "n": INDEX, "ior": INDEX, "speed": SPEED,
    "velocity": SPEED, "c": SPEED, "v": SPEED, "vp": SPEED, "ssp": SPEED,
}  # fmt: skip
"""What a column holds, by the words in its name."""
LENGTHS = {"m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3,
           "um": 1e-6, "ft": 0.3048, "feet": 0.3048}  # fmt: skip
SPEEDS = {"m/s": 1.0, "ms-1": 1.0, "km/s": 1e3, "kms-1": 1e3, "ft/s": 0.3048}
"""Units that a header may state, in metres and in metres a second."""
PURE = {"": 1.0, "1": 1.0, "-": 1.0}
"""Those of an index."""
UNIT = re.compile(r"[(\[]([^)\]]*)[)\]]")
"""A unit in brackets, in a column's name."""


@dataclass(frozen=True)
class Column:
    """One column: the words over it, what it holds and in which unit, as far as they say."""

    name: str
    quantity: str | None
    unit: str

    def scale(self, units: Mapping[str, float]) -> float:
        """Its unit in those that its ``units`` are in; ValueError for one that is not among them."""
        if self.unit and self.unit not in units:
            known = ", ".join(unit for unit in units if unit)
            raise ValueError(f"the unit {self.unit!r} of the column {self.name!r} is not known; known are {known}")
        return units[self.unit] if self.unit else 1.0


@spelled
def read_profile(
    path: str | Path,
    *,
    reference_speed: float | None = None,
    columns: Sequence[str | int] | None = None,
    smooth: bool = True,
) -> Tabulated:
    r"""A measured profile from a file of columns, as a medium of layers.

    Raises ValueError naming the row of the file: for what is no number or no index, and for heights out of order; and
    where the columns do not say what they are.

    Parameters
    ----------
    path : str or Path
        Columns separated by commas, semicolons, tabs or spaces; empty lines and what follows a ``#`` are passed over.
        Rows without numbers at the top are a header: its words say which column is a height (or altitude, z) or a
        depth, and which is an index (n) or a speed (velocity, c); its units, in brackets or in a row of their own, are
        metres, kilometres, feet, ..., and metres or kilometres a second. Without a header the first column is the
        height and the second the index, or the speed where ``reference_speed`` is given.
    reference_speed : float, optional
        For a column of speeds: the index is ``reference_speed`` over it. In metres a second where the header states
        the unit of the speeds, and in their unit otherwise.
    columns : two of str or int, optional
        The columns to take, by name or by number from 0: heights or depths, then index or speed.
    smooth : bool
        As for :class:`Tabulated`.

    Returns
    -------
    Tabulated
        Its heights are in metres where the header states a unit, and in the unit of the file otherwise. A depth is a
        negative height. A table that descends is turned round.

    Examples
    --------
    >>> from pathlib import Path
    >>> from varcalc import optics
    >>> file = Path(getfixture("tmp_path")) / "ocean.csv"
    >>> _ = file.write_text("depth (km), sound speed (m/s)\n0.0, 1520\n0.7, 1490\n1.3, 1480\n")
    >>> profile = optics.read_profile(file, reference_speed=1480.0)
    >>> profile.heights, profile.n[0]
    ((-1300.0, -700.0, 0.0), 1.0)
    """
    path = file("path", path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}; give the path of a file of columns")
    header, numbered = _split(path)
    found = _columns(header, len(numbered[0][1]))
    first, second = _chosen(path, found, columns, speeds=reference_speed is not None)
    heights, values = (np.array([_number(path, row, cells, k) for row, cells in numbered]) for k in (first, second))
    heights *= found[first].scale(LENGTHS)
    if found[first].quantity == DEPTH:
        heights = 0.0 - heights
    values = _index_of(path, found[second], values, reference_speed)
    _check_index(path, values, [(row, cells[second]) for row, cells in numbered])
    _check_order(path, heights, [row for row, _ in numbered])
    if heights[0] > heights[-1]:
        heights, values = heights[::-1], values[::-1]
    return Tabulated(heights, values, smooth)  # pyright: ignore[reportArgumentType]


def _split(path: Path) -> tuple[list[list[str]], list[tuple[int, list[str]]]]:
    """The rows of the header, and those of numbers, each with its number in the file, from 1."""
    try:
        content = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        row = error.object[: error.start].count(b"\n") + 1
        raise ValueError(f"row {row} of {path.name} is no text in UTF-8; write the columns as text") from error
    lines = [line.split("#", 1)[0].strip() for line in content.splitlines()]
    rows = [(number, _cells(line)) for number, line in enumerate(lines, start=1) if line]
    begins = next((k for k, (_, cells) in enumerate(rows) if _is_number(cells[0])), len(rows))
    if len(rows) - begins < 2:
        raise ValueError(f"{path.name} has {len(rows) - begins} rows of numbers; a profile needs two or more")
    return [cells for _, cells in rows[:begins]], rows[begins:]


def _cells(line: str) -> list[str]:
    """The cells of one line, by the first separator it holds of semicolon, tab, comma; by blanks without one."""
    for separator in (";", "\t", ","):
        if separator in line:
            [cells] = csv.reader([line], delimiter=separator, skipinitialspace=True)
            return [cell.strip() for cell in cells]
    return line.split()


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _columns(header: list[list[str]], count: int) -> list[Column]:
    """What the header says of each of ``count`` columns."""
    return [_column([row[place] for row in header if len(row) == count]) for place in range(count)]


def _column(cells: list[str]) -> Column:
    """One column from the cells over it: names, with units in brackets or in a cell of their own."""
    units, quantities = [], []
    for cell in cells:
        alone = _compact(cell) in {**LENGTHS, **SPEEDS, **PURE}
        units += [_compact(unit) for unit in ([cell] if alone else UNIT.findall(cell))]
        words = [] if alone else re.findall("[a-z]+", UNIT.sub(" ", cell).lower().replace("_", " "))
        quantities += [WORDS[word] for word in words if word in WORDS]
    return Column(" ".join(cells), quantities[0] if quantities else None, units[0] if units else "")


def _compact(unit: str) -> str:
    """A unit as the tables above write it."""
    return re.sub(r"[\s^*·]", "", unit.lower())


def _chosen(path: Path, found: list[Column], columns: Sequence[str | int] | None, *, speeds: bool) -> tuple[int, int]:
    """The places of the heights and of the index or speed."""
    names = [column.name for column in found]
    if columns is not None:
        if len(columns) != 2:
            raise ValueError(f"columns must be two, heights and index or speed, not {columns!r}")
        first, second = (_place(path, names, column) for column in columns)
        return first, second
    heights = [k for k, column in enumerate(found) if column.quantity in {HEIGHT, DEPTH}]
    values = [k for k, column in enumerate(found) if column.quantity == (SPEED if speeds else INDEX)]
    values = values or [k for k, column in enumerate(found) if column.quantity in {INDEX, SPEED}]
    if len(heights) == len(values) == 1:
        return heights[0], values[0]
    if len(found) == 2 and not heights and not values:
        return 0, 1
    raise ValueError(
        f"{path.name} has the columns {names}, which do not say what is the height and what the index or speed; "
        "give columns=, their names or numbers"
    )


def _place(path: Path, names: list[str], column: str | int) -> int:
    if isinstance(column, int) and 0 <= column < len(names):
        return column
    alike = [k for k, name in enumerate(names) if isinstance(column, str) and column.lower() in name.lower()]
    exact = [k for k in alike if names[k] == column]
    if len(exact or alike) != 1:
        raise ValueError(f"{path.name} has no column {column!r}, or more than one; it has {names}")
    return (exact or alike)[0]


def _number(path: Path, row: int, cells: list[str], place: int) -> float:
    cell = cells[place] if place < len(cells) else ""
    if not _is_number(cell) or not np.isfinite(float(cell)):
        raise ValueError(f"row {row} of {path.name}: {cell!r} is no number; mend it, or leave the row out")
    return float(cell)


def _index_of(path: Path, column: Column, values: np.ndarray, reference: float | None) -> np.ndarray:
    """The index that the ``values`` of a column are, or are the speeds for."""
    if column.quantity != SPEED and (column.quantity is not None or reference is None):
        if reference is not None:
            raise ValueError(f"{path.name} holds an index, {column.name!r}; leave out reference_speed=")
        return values * column.scale(PURE)
    speeds = values * column.scale(SPEEDS)
    if reference is None:
        raise ValueError(f"{path.name} holds a speed; give reference_speed=, which the index is in proportion to")
    if not reference > 0:
        raise ValueError(f"reference_speed must be a positive speed, not {reference!r}")
    with np.errstate(divide="ignore"):
        return reference / speeds


def _check_index(path: Path, index: np.ndarray, written: list[tuple[int, str]]) -> None:
    """ValueError, naming the row and what is ``written`` there, unless every index is positive and finite."""
    wrong = ~((index > 0) & np.isfinite(index))
    if np.any(wrong):
        k = int(np.argmax(wrong))
        row, cell = written[k]
        raise ValueError(
            f"row {row} of {path.name}: {cell!r} makes the index {index[k]:g}, which must be positive and finite; "
            "mend it, or leave the row out"
        )


def _check_order(path: Path, heights: np.ndarray, rows: list[int]) -> None:
    """ValueError, naming the row, unless the heights ascend throughout or descend throughout."""
    steps = np.diff(heights)
    against = steps <= 0 if np.sum(steps > 0) >= np.sum(steps < 0) else steps >= 0
    if np.any(against):
        k = int(np.argmax(against))
        raise ValueError(
            f"row {rows[k + 1]} of {path.name}: {abs(heights[k + 1]):g} after {abs(heights[k]):g} is out of order; "
            "sort the table by height, and leave out what is there twice"
        )
