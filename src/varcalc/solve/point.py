"""One point of a sweep: what was found there, as plain numbers and words."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from varcalc.problem.conditions import real, text
from varcalc.showing import Shown, brief
from varcalc.solution import Solution, Status

FAILED = "failed"
"""The status of a point at which no problem could be made, or whose process died."""
NUMBERS = ("value", "claimed_error", "lower")
"""The fields of a point that are a number or None."""
MISSING = "missing"
"""The status of a point that a store does not hold yet."""
ANSWERS = {status.words: status.ok for status in Status} | {FAILED: False}
"""The words that a store has for what became of a point, and whether such a point has an answer."""
BROKEN_POINT = (ValueError, ArithmeticError, LookupError, RuntimeError)
"""What is raised where values allow no problem, or its functions fail there (CasADi raises RuntimeError)."""


def _number(given: Any) -> bool:
    return isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given)


def _no_number_or(given: Any) -> bool:
    return given is None or _number(given)


WRITTEN: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "values": ("a list of numbers", lambda given: isinstance(given, list) and all(map(_number, given))),
    "status": (f"one of {', '.join(ANSWERS)}", lambda given: isinstance(given, str) and given in ANSWERS),
    "value": ("a number or null", _no_number_or),
    "claimed_error": ("a number that is not negative, or null", lambda e: _no_number_or(e) and not (e and e < 0)),
    "iterations": ("a number of steps", lambda given: isinstance(given, int) and given >= 0),
    "seconds": ("a time that is not negative", lambda given: _number(given) and given >= 0),
    "message": ("words", lambda given: isinstance(given, str)),
    "local": ("true or false", lambda given: isinstance(given, bool)),
    "lower": ('a number, null or "-inf"', lambda given: _no_number_or(given) or given in ("-inf", "inf")),
}
"""What each field of a point is where it is written, in words, and whether something is that."""


@dataclass(frozen=True, repr=False)
class SweepPoint(Shown):
    """One point of a grid: its ``values`` in the order of the names, and what :func:`varcalc.solve` found there.

    ``value`` and ``claimed_error`` are None where there is no answer, and ``message`` says why; with an answer it holds
    what the solution says besides. ``local`` is True where something lower is known, ``lower`` what is reached there
    (None where that is not known). ``seconds``, the wall clock of the solve, is no part of what makes two points equal.
    """

    values: tuple[float, ...]
    status: str
    value: float | None
    claimed_error: float | None
    iterations: int = 0
    seconds: float = field(default=0.0, compare=False)
    message: str = ""
    local: bool = False
    lower: float | None = None

    @property
    def ok(self) -> bool:
        """True for an answer that stands."""
        return self.value is not None

    @property
    def reason(self) -> str:
        """Why there is no answer; empty where there is one."""
        return "" if self.ok else self.message

    @classmethod
    def of(cls, values: Mapping[str, float], solution: Solution, seconds: float) -> SweepPoint:
        """What a solution says of a point."""
        stands = solution.status.ok
        return cls(
            tuple(values.values()), solution.status.words, solution.value if stands else None,
            solution.error.value if stands else None, solution.stats.iterations, seconds,
            solution.message or ("" if stands else solution.status.value), solution.local, solution.lower,
        )  # fmt: skip

    @classmethod
    def failed(cls, values: Mapping[str, float], message: str, seconds: float = 0.0) -> SweepPoint:
        """A point at which nothing could be solved."""
        return cls(tuple(values.values()), FAILED, None, None, 0, seconds, message)

    @classmethod
    def read(cls, row: Mapping[str, Any]) -> SweepPoint:
        """The point that :meth:`row` wrote; ValueError, naming the field, for what it did not write."""
        names = {f.name for f in fields(cls)}
        for name in sorted(row.keys() ^ names):
            raise ValueError(f"a point has no {name}" if name in row else f"the point has no {name}, which each has")
        for name, (means, allowed) in WRITTEN.items():
            if not allowed(row[name]):
                raise ValueError(f"{name} must be {means}, not {brief(row[name])}")
        if (row["value"] is None) == ANSWERS[row["status"]]:
            raise ValueError(f"a point that is {row['status']} has {'no' if row['value'] is not None else 'a'} value")
        numbers = {name: None if row[name] is None else float(row[name]) for name in NUMBERS}
        return cls(**{**row, **numbers, "values": tuple(map(float, row["values"]))})

    def row(self) -> dict[str, Any]:
        """The point as JSON holds it; what lies infinitely low is a word, which JSON has no number for."""
        row = {f.name: getattr(self, f.name) for f in fields(self)} | {"values": list(self.values)}
        return row | ({} if self.lower is None or math.isfinite(self.lower) else {"lower": str(self.lower)})


@dataclass(frozen=True)
class Measured:
    """What a function handed to :func:`varcalc.sweep` may return instead of a problem: a number it found itself.

    ``error`` is what it claims of the ``value``, None where it claims nothing. A ``value`` that is not finite is a
    point without an answer, and ``message`` says why. Raises TypeError for what is no number.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> from varcalc import mechanics
    >>> pendulum = mechanics.System(lambda t, q, v, p: p.l**2 * v[0]**2 / 2 + p.g * p.l * ca.cos(q[0]), ("theta",),
    ...                             parameters={"g": 9.81, "l": 1.0})
    >>> def swing(l):
    ...     motion = pendulum.with_parameters({"l": l}).motion([1e-3], [0.0], (0, 1))
    ...     return vc.Measured(motion.q(1.0)[0], motion.error)
    >>> vc.sweep(swing, {"l": [1.0, 4.0]}).values.round(6).tolist()
    [-0.001, 5e-06]
    """

    value: float
    error: float | None = None
    message: str = ""

    def __post_init__(self) -> None:
        for name in ("value", "error"):
            given: Any = getattr(self, name)
            number = None if name == "error" and given is None else real(f"Measured.{name}", given)
            object.__setattr__(self, name, number)
        text("Measured.message", self.message)

    def point(self, values: Mapping[str, float], seconds: float) -> SweepPoint:
        """The point of a sweep at which this was measured."""
        if not math.isfinite(self.value):
            return SweepPoint.failed(values, self.message or f"the value measured is {self.value}", seconds)
        words = Status.SOLVED.words
        return SweepPoint(tuple(values.values()), words, self.value, self.error, 0, seconds, self.message)
