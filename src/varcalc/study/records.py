"""What measurements of speed and accuracy are kept as: a row of numbers and words each, and where they were made.

The axes are ragged (a method that does not apply has no row), so that an array
with named axes would be half empty; a JSON document is what every tool reads.
"""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from importlib.metadata import version
from pathlib import Path
from textwrap import shorten
from typing import Any, Self

import numpy as np

from varcalc.problem.conditions import file, finite, text
from varcalc.showing import Plotted, Shown
from varcalc.solution import Status
from varcalc.study.compare import EXACT_FLOOR, EXACT_MARGIN
from varcalc.study.routes import Knob
from varcalc.tables import shown, table

FORMAT = 1
"""Number of the layout of a stored file."""
ANSWERED = tuple(s.words for s in Status if s.ok)
"""The statuses of answers that stand, as records hold them."""
MINIMUM, MAXIMUM = "minimum", "maximum"
FEWEST_POINTS = 3
"""Points through which a slope is drawn, at the least."""
MOST_SAID = 200
"""Characters of what is wrong with a damaged file, at most."""
STEADY = 0.2
"""Relative difference of two slopes of a curve up to which it is a straight line."""


@dataclass(frozen=True, repr=False)
class Record(Shown):
    """One method on one problem at one setting.

    ``setting`` is the value of ``knob``: the tolerance asked for, or what else
    was turned (:class:`varcalc.study.routes.Knob`), which ``curve`` says in
    words; ``route`` is the method that it belongs to, by its default options
    (``method`` where nothing is said). Times are milliseconds of processor
    time, which other programs do not lengthen, medians of the repeats:
    ``build_ms`` the share that the method says it spent on building its
    functions, ``solve_ms`` the rest of the call (the problem's traced
    Lagrangian being given), ``resolve_ms`` that of a call with everything
    built, begun from the last curve, one parameter
    moved by a thousandth where there are any. ``value_error`` is signed, value
    minus closed form, ``curve_error`` the largest distance from the exact
    curve at equal abscissae; both are absolute, as is ``claimed_error``, and
    ``size`` is what a tolerance is relative to, max(1, abs(value)). What is
    not known is None. ``reason`` says why there is no answer, ``sought``
    whether the value is to be a minimum or a maximum.
    """

    problem: str
    method: str
    setting: float
    status: str
    build_ms: float | None = None
    solve_ms: float | None = None
    resolve_ms: float | None = None
    unknowns: int | None = None
    iterations: int | None = None
    value_error: float | None = None
    curve_error: float | None = None
    claimed_error: float | None = None
    size: float = 1.0
    reason: str = ""
    knob: str = Knob.TOLERANCE
    curve: str = ""
    route: str = ""
    sought: str = MINIMUM

    def __post_init__(self) -> None:
        object.__setattr__(self, "route", self.route or self.method)

    @property
    def ok(self) -> bool:
        """True for an answer that stands, or is given out for one by what claims no error."""
        return self.status in ANSWERED

    @property
    def turned(self) -> str:
        """The setting in words, such as ``h = 1/8``."""
        if self.knob == Knob.ELEMENT:
            return f"h = 1/{1 / self.setting:.0f}"
        return f"{self.knob} = {self.setting:.0f}" if self.knob == Knob.DEGREE else f"{self.knob} = {self.setting:.0e}"

    @property
    def too_good(self) -> bool:
        """True for a value on the side of the closed form where no curve's is, by more than round-off."""
        gain = (self.value_error or 0.0) * (1 if self.sought == MAXIMUM else -1)
        return gain > EXACT_FLOOR * self.size

    @property
    def astray(self) -> bool:
        """True for an answer further from the closed form than ten times its claimed error, and than round-off."""
        if self.value_error is None or self.claimed_error is None:
            return False
        return abs(self.value_error) > max(EXACT_MARGIN * self.claimed_error, EXACT_FLOOR * self.size)


@dataclass(frozen=True, repr=False)
class WorkPrecision(Plotted):
    """What :func:`work_precision` measured: ``records``, and ``about``, where and by what."""

    records: tuple[Record, ...]
    about: Mapping[str, str] = field(default_factory=dict)

    @property
    def astray(self) -> tuple[Record, ...]:
        """The answers that lie further from the closed form than their claims allow; see :attr:`Record.astray`."""
        return tuple(r for r in self.records if r.astray)

    def table(self) -> str:
        """The records as text for a monospaced page, errors relative to max(1, abs(value)), with reasons beneath."""
        rows = [
            (
                r.problem, r.method, r.turned, r.status, shown(_relative(r.value_error, r.size), "+.1e"),
                shown(r.curve_error, ".1e"), shown(_relative(r.claimed_error, r.size), ".1e"),
                shown(r.build_ms, ".2f"), shown(r.solve_ms, ".2f"), shown(r.resolve_ms, ".2f"), shown(r.unknowns, "d"),
            )
            for r in self.records
        ]  # fmt: skip
        words = ("problem", "method", "setting", "status")
        numbers = ("error", "curve", "claimed", "build ms", "solve ms", "re-solve ms", "unknowns")
        reasons = dict.fromkeys(f"{r.problem}, {r.method}: {r.reason}" for r in self.records if r.reason)
        return table(words, numbers, rows, notes=reasons)

    def document(self) -> dict[str, Any]:
        """The measurements as plain numbers, strings, lists and dicts, ready for JSON."""
        return {"format": FORMAT, "about": dict(self.about), "records": [asdict(r) for r in self.records]}

    def save(self, path: str | Path) -> None:
        """Write :meth:`document` as JSON. Raises OSError where that is not possible."""
        Path(path).write_text(json.dumps(self.document(), indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The measurements in a file that :meth:`save` wrote; ValueError when it is none, OSError without a file."""
        document = _read(file("path", path))
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise ValueError(f"{path} holds no measurements of format {FORMAT}; measure again, and save")
        rows, where = document.get("records"), document.get("about")
        if not isinstance(rows, list) or not isinstance(where, dict):  # what a file holds is no type of an argument
            raise ValueError(  # noqa: TRY004
                f"{path} is damaged: it must hold a list of records, and where they were made in about"
            )
        return cls(tuple(_record(f"{path} is damaged: record {i}", row) for i, row in enumerate(rows, start=1)), where)


def _read(path: Path) -> Any:
    """What a JSON file holds; ValueError, with the line where there is one, for what is none."""
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}; give one that WorkPrecision.save wrote")
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except RecursionError as error:
        raise ValueError(f"{path} holds lists within lists without end; give a file that was saved") from error
    except ValueError as error:
        raise ValueError(f"{path} holds no JSON ({error}); give a file that WorkPrecision.save wrote") from error


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _record(place: str, row: Any) -> Record:
    """A record as it is stored; ValueError, with its ``place``, for one that is damaged."""
    kinds = {f.name: str(f.type) for f in fields(Record)}
    needed = {f.name for f in fields(Record) if f.default is MISSING}
    if not isinstance(row, dict) or not needed <= row.keys() <= kinds.keys():
        raise ValueError(f"{place} must have the fields {sorted(kinds)}")
    for name, value in row.items():
        if value is None and kinds[name].endswith("None"):
            continue
        try:
            _ = text(name, value) if kinds[name] == "str" else finite(name, value)
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"{place}: {shorten(str(error), MOST_SAID)}") from error
    if not (row["setting"] > 0 and row.get("size", 1.0) > 0 and row.get("knob", Knob.TOLERANCE) in [*Knob]):
        raise ValueError(f"{place}: setting and size must be positive, and knob one of {', '.join(Knob)}")
    if row.get("sought", MINIMUM) not in {MINIMUM, MAXIMUM}:
        raise ValueError(f"{place}: sought must be {MINIMUM} or {MAXIMUM}")
    counts: dict[str, Any] = {name: int(row[name]) for name in ("unknowns", "iterations") if row.get(name) is not None}
    return Record(**row | counts)


def measured_order(records: Iterable[Record]) -> float | None:
    """The order of convergence in h: the slope of log(error) against log(h) by least squares, None where none shows.

    It is taken over the resolved part of the records: from the finest one whose
    error is above round-off towards coarser ones, as long as the slope from one
    to the next stays as it is.
    """
    resolved = [
        (math.log(r.setting), math.log(abs(r.value_error)))
        for r in sorted(records, key=lambda r: r.setting)
        if r.ok and r.knob == Knob.ELEMENT and r.value_error is not None and abs(r.value_error) > EXACT_FLOOR * r.size
    ]
    if len(resolved) < FEWEST_POINTS:
        return None
    h, error = np.array(resolved).T
    slopes = np.diff(error) / np.diff(h)
    steady = np.abs(slopes - slopes[0]) <= STEADY * abs(slopes[0])
    count = len(h) if steady.all() else 1 + int(np.argmin(steady))
    return float(np.polyfit(h[:count], error[:count], 1)[0]) if count >= FEWEST_POINTS else None


def about() -> dict[str, str]:
    """The machine and the versions that measurements were made with."""
    return {
        "python": platform.python_version(),
        "processor": _processor(),
        **{name: version(name) for name in ("varcalc", "casadi", "numpy", "scipy")},
    }


def _relative(error: float | None, size: float) -> float | None:
    return None if error is None else error / size


def _processor() -> str:
    """The name of the processor, as far as the system tells it."""
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        for line in listed.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
