"""Speed against accuracy: every method on every problem at every tolerance, measured, stored, and drawn elsewhere.

The records are a few hundred rows of numbers and words with a note of where
they were measured: a JSON document, which every tool reads. The axes are
ragged (a method that does not apply has no row), so that an array with named
axes would be half empty.
"""

from __future__ import annotations

import json
import math
import platform
import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

import numpy as np

from varcalc.methods.labels import checked_method, label
from varcalc.problem.conditions import Periodic
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution
from varcalc.solve.ladder import solve
from varcalc.study.compare import EXACT_FLOOR, EXACT_MARGIN, cold
from varcalc.study.reference import Exact, Reference, as_exact
from varcalc.tables import monospaced

TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 15))
"""The settings of a line: one point each."""
ENOUGH = 1.0
"""Seconds of one solve's repeats after which there are no more: a slow solve is measured well enough by few."""
MOVED = 1e-3
"""Relative change of a parameter between two warm solves."""
PLACES = 201
"""Places at which a curve is held against the exact one."""
FORMAT = 1
"""Number of the layout of a stored file."""


@dataclass(frozen=True)
class Record:
    """One method on one problem at one setting.

    ``setting`` is the tolerance asked for. Times are milliseconds, medians of
    the repeats: ``build_ms`` what the method says it spent on building its
    functions, ``solve_ms`` the rest of the call (together its wall clock, the
    problem's traced Lagrangian being given), ``resolve_ms`` the wall clock of
    a call with everything built, begun from the last curve, one parameter
    moved by a thousandth where there are any. ``value_error`` is signed, value
    minus closed form, ``curve_error`` the largest distance from the exact
    curve at equal abscissae; both are absolute, as is ``claimed_error``, and
    ``size`` is what a tolerance is relative to, max(1, abs(value)). What is
    not known is None. ``reason`` says why there is no answer.
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

    @property
    def ok(self) -> bool:
        """True for an answer that stands."""
        return self.claimed_error is not None

    @property
    def astray(self) -> bool:
        """True for an answer further from the closed form than ten times its claimed error, and than round-off."""
        if self.value_error is None or self.claimed_error is None:
            return False
        return abs(self.value_error) > max(EXACT_MARGIN * self.claimed_error, EXACT_FLOOR * self.size)


@dataclass(frozen=True)
class WorkPrecision:
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
                r.problem, r.method, f"{r.setting:.0e}", r.status, _shown(r.value_error, r.size, "+.1e"),
                _shown(r.curve_error, 1.0, ".1e"), _shown(r.claimed_error, r.size, ".1e"),
                _shown(r.build_ms, 1.0, ".2f"), _shown(r.solve_ms, 1.0, ".2f"), _shown(r.resolve_ms, 1.0, ".2f"),
                "" if r.unknowns is None else str(r.unknowns),
            )
            for r in self.records
        ]  # fmt: skip
        words = ("problem", "method", "tol", "status")
        numbers = ("error", "curve", "claimed", "build ms", "solve ms", "re-solve ms", "unknowns")
        reasons = dict.fromkeys(f"{r.problem}, {r.method}: {r.reason}" for r in self.records if r.reason)
        return "\n".join([*monospaced(words, numbers, rows), "", *reasons]).rstrip()

    def document(self) -> dict[str, Any]:
        """The measurements as plain numbers, strings, lists and dicts, ready for JSON."""
        return {"format": FORMAT, "about": dict(self.about), "records": [asdict(r) for r in self.records]}

    def save(self, path: str | Path) -> None:
        """Write :meth:`document` as JSON. Raises OSError where that is not possible."""
        Path(path).write_text(json.dumps(self.document(), indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The measurements in a file that :meth:`save` wrote; ValueError when it is none, OSError without a file."""
        try:
            document = json.loads(Path(path).read_text(encoding="utf-8"))
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{path} holds no JSON ({error}); give a file that WorkPrecision.save wrote") from error
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise ValueError(f"{path} holds no measurements of format {FORMAT}; measure again, and save")
        known = {f.name for f in fields(Record)}
        try:
            return cls(tuple(Record(**row) for row in document["records"]), document["about"])
        except (KeyError, TypeError) as error:
            raise ValueError(
                f"{path} is damaged ({error}); its records must have the fields {sorted(known)}"
            ) from error


def work_precision(
    problems: Iterable[Reference | Problem | Curve],
    methods: Iterable[Any],
    tolerances: Iterable[float] = TOLERANCES,
    *,
    exact: Sequence[Exact | float | None] | None = None,
    repeats: int = 5,
) -> WorkPrecision:
    """Measure what each of ``methods`` costs on each of ``problems`` at each of ``tolerances``, and what it delivers.

    ``problems`` are References, which bring their closed form, or Problems and
    Curves, with the closed forms in ``exact``, one each. Without one there are
    times and claims, but no error that was delivered: that is never guessed
    from another run, and the pictures say so instead of being drawn.
    ``methods`` are method objects, None for the ladder. Every time is the
    median of ``repeats`` solves after one that is not counted, fewer once they
    took a second. A cold solve begins from a problem of which nothing is
    built. A method that finds no answer has a record with its status.

    Raises TypeError for what is no problem or no method, ValueError when there
    are none, and whatever :func:`varcalc.solve` raises for bad arguments.

    >>> import varcalc as vc
    >>> line = vc.Problem(lambda x, y, dy: (1 + dy**2) ** 0.5, vc.Fixed(0, 0), vc.Fixed(3, 4), name="line")
    >>> measured = work_precision([line], [vc.Ritz()], [1e-6], exact=[5.0], repeats=1)
    >>> [(r.problem, r.method, r.status, abs(r.value_error) < 1e-12) for r in measured.records]
    [('line', 'Ritz', 'solved', True)]
    """
    references = _references(problems, exact)
    routes = [checked_method(i, method) for i, method in enumerate(methods)]
    settings = list(tolerances)
    for name, given in (("problems", references), ("methods", routes), ("tolerances", settings)):
        if not given:
            raise ValueError(f"{name} is empty; give at least one")
    if not isinstance(repeats, int) or isinstance(repeats, bool) or repeats < 1:
        raise ValueError(f"repeats must be a whole number from 1 on, not {repeats!r}")
    records = [_measured(r, m, tol, repeats) for r in references for m in routes for tol in settings]
    return WorkPrecision(tuple(records), about())


def about() -> dict[str, str]:
    """The machine and the versions that measurements were made with."""
    return {
        "python": platform.python_version(),
        "processor": _processor(),
        **{name: version(name) for name in ("varcalc", "casadi", "numpy", "scipy")},
    }


def _processor() -> str:
    """The name of the processor, as far as the system tells it."""
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        for line in listed.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _references(
    problems: Iterable[Reference | Problem | Curve], exact: Sequence[Exact | float | None] | None
) -> list[Reference]:
    given = list(problems)
    forms = [None] * len(given) if exact is None else [as_exact(e) for e in exact]
    if len(forms) != len(given):
        raise ValueError(f"exact must have one entry a problem, {len(given)} of them, not {len(forms)}")
    found = []
    for i, (problem, form) in enumerate(zip(given, forms, strict=True)):
        if isinstance(problem, Reference):
            found.append(problem)
        elif isinstance(problem, Problem | Curve):
            found.append(Reference(problem.name, problem, form))
        else:
            raise TypeError(f"problems[{i}] must be a Reference, a Problem or a Curve, not {problem!r}")
    return found


def _measured(reference: Reference, method: Any, tol: float, repeats: int) -> Record:
    name = "ladder" if method is None else label(method)
    reason = reference.inapplicable.get(type(method))
    if reason is not None:
        return Record(reference.name, name, tol, "not applicable", reason=reason)
    answer = partial(solve, method=method, tol=tol, throw=False)
    answer(cold(reference.problem))  # loads plug-ins and fills tables, and is not counted
    solution, calls = _timed(lambda _: answer(cold(reference.problem)), repeats)
    build = 1e3 * statistics.median(found.stats.build for _, found in calls)
    spent = 1e3 * statistics.median(seconds for seconds, _ in calls)
    record = Record(
        reference.name, name, tol, solution.status.name.lower().replace("_", " "), build_ms=build,
        solve_ms=spent - build, unknowns=solution.stats.unknowns or None, iterations=solution.stats.iterations,
    )  # fmt: skip
    if not solution.status.ok:
        return replace(record, reason=solution.message or solution.status.value)
    return replace(record, resolve_ms=_warm(solution, answer, repeats), **_delivered(reference, solution))


def _timed(call: Any, repeats: int) -> tuple[Solution, list[tuple[float, Solution]]]:
    """The last answer of ``call(number)``, and the seconds and answer of each, up to ``repeats`` of them."""
    calls: list[tuple[float, Solution]] = []
    while len(calls) < repeats and sum(seconds for seconds, _ in calls) < ENOUGH:
        began = time.perf_counter()
        found = call(len(calls))
        calls.append((time.perf_counter() - began, found))
    return calls[-1][1], calls


def _warm(solution: Solution, answer: Any, repeats: int) -> float | None:
    """Milliseconds of a solve with everything built from the last curve; None where one finds no answer."""
    problem, last = solution.problem, solution
    first = next(iter(problem.parameters.items()), None)
    try:
        variants = [problem.with_parameters({first[0]: first[1] * (1 + m)} if first else {}) for m in (MOVED, 0.0)]
    except ValueError:  # the ends hold at these values only
        variants = [problem, problem]
    for variant in variants:
        last = answer(variant, guess=last) if last.status.ok else last

    def again(number: int) -> Solution:
        nonlocal last
        last = answer(variants[number % 2], guess=last) if last.status.ok else last
        return last

    _, calls = _timed(again, repeats)
    return 1e3 * statistics.median(seconds for seconds, _ in calls) if last.status.ok else None


def _delivered(reference: Reference, solution: Solution) -> dict[str, Any]:
    """The errors of an answer: those it claims and those it has."""
    exact = reference.exact
    found: dict[str, Any] = {"claimed_error": _number(solution.error.value)}
    if exact is None:
        return found | {"size": max(1.0, abs(solution.value))}
    value_error, curve_error = solution.value - exact.value, _curve_error(reference.problem, solution, exact)
    return found | {"value_error": value_error, "curve_error": curve_error, "size": max(1.0, abs(exact.value))}


def _curve_error(problem: Problem | Curve, solution: Solution, exact: Exact) -> float | None:
    """The largest distance from the exact curve; None where it is not known, or may begin at any of its points."""
    if exact.y is None or isinstance(problem.start, Periodic):
        return None
    first, last = solution.interval
    # clustered at the ends, where curves may be steep
    at = first + (last - first) * (0.5 - 0.5 * np.cos(np.linspace(0, math.pi, PLACES)))
    shape = (problem.n, len(at))
    wanted = np.broadcast_to(np.asarray(exact.y(at), dtype=float), shape)
    return _number(float(np.linalg.norm(np.asarray(solution.y(at)).reshape(shape) - wanted, axis=0).max()))


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _shown(value: float | None, unit: float, form: str) -> str:
    return "" if value is None else format(value / unit, form)
