"""One problem by several methods, each answer held against the others and against the closed form."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

from varcalc.methods.labels import checked_method, label
from varcalc.problem.conditions import sequence
from varcalc.problem.functional import check_functional
from varcalc.problem.problem import Curve, Problem
from varcalc.progress import Interrupted, Progress, telling
from varcalc.showing import Fact, Plotted, brief, charts, counted, figure_of, line
from varcalc.solution import Solution, Status, VariationalError
from varcalc.solve.ladder import solve
from varcalc.spelling import spelled
from varcalc.study.reference import Exact, as_exact, checked_reasons
from varcalc.study.routes import methods_for
from varcalc.symbolic.derived import Cache
from varcalc.tables import known, shown, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PAIR_MARGIN = 1.0
"""Share of the sum of two claims that two routes may differ by; claims carry their own margin."""
EXACT_MARGIN = 10.0
"""How many times its claimed error a value may lie from the closed form: an estimate, not a bound."""

EXACT_FLOOR = 1e-13
"""Relative distance from the closed form that is never held against a value."""


@dataclass(frozen=True)
class Row:
    """One method's answer.

    ``deviation`` is the signed error, value minus closed form, NaN without
    one; ``claimed`` the error the solution claims; ``build`` and ``solve``
    seconds; ``unknowns`` their number. ``reason`` says why a row holds no
    value. ``status`` and ``solution`` are None for a method that was not tried
    because it does not apply.
    """

    label: str
    method: Any
    status: Status | None
    value: float = math.nan
    deviation: float = math.nan
    claimed: float = math.nan
    build: float = math.nan
    solve: float = math.nan
    unknowns: int | None = None
    reason: str = ""
    solution: Solution | None = None

    @property
    def ok(self) -> bool:
        """True for an answer that stands."""
        return self.status is not None and self.status.ok

    @property
    def outcome(self) -> str:
        """The status in lower-case words; "not applicable" for a method that was not tried."""
        return "not applicable" if self.status is None else self.status.words

    def record(self) -> dict[str, Any]:
        """The row as plain numbers and strings, None where there is no number."""
        return {
            "method": self.label,
            "status": self.outcome,
            "value": known(self.value),
            "error": known(self.deviation),
            "claimed_error": known(self.claimed),
            "build_seconds": known(self.build),
            "solve_seconds": known(self.solve),
            "unknowns": self.unknowns,
            "reason": self.reason,
        }


@spelled
@dataclass(frozen=True, repr=False)
class Comparison(Plotted):
    """What :func:`compare` found: one row a method, in the order the methods were given."""

    problem: Problem | Curve
    rows: tuple[Row, ...]
    exact: Exact | None
    tol: float

    @property
    def disagreements(self) -> tuple[str, ...]:
        """One sentence for each pair of routes, or route and closed form, further apart than they may be.

        Two routes may differ by the sum of their claimed errors and a few
        units of rounding; a route may lie from the closed form by ten times
        its claimed error, or by 1e-13 of the value. A comparison in which no
        route answered says so.
        """
        answered = [row for row in self.rows if row.ok]
        if not answered:
            return ("no route answered, so there is nothing to hold against anything",)
        apart = [sentence for a, b in combinations(answered, 2) if (sentence := _apart(a, b))]
        if self.exact is not None:
            apart += [sentence for row in answered if (sentence := _off(row, self.exact))]
        return tuple(apart)

    @property
    def agree(self) -> bool:
        """True when there is an answer and no two answers disagree; see :attr:`disagreements`."""
        return not self.disagreements

    @property
    def conclusion(self) -> tuple[str, ...]:
        """The closing lines: whether the answers agree, as far as there are any, and whether the ladder's stands."""
        return tuple(_verdict(self))

    def table(self) -> str:
        """The comparison as text for a monospaced page, with the reasons and disagreements beneath.

        Times are in milliseconds. Columns are as wide as their content.
        """
        rows = [
            (
                row.label, row.outcome, shown(row.value if row.ok else None, ".15g"), shown(row.deviation, "+.1e"),
                shown(row.claimed, ".1e"), shown(1e3 * row.build, ".2f"), shown(1e3 * row.solve, ".2f"),
                shown(row.unknowns, "d"),
            )
            for row in self.rows
        ]  # fmt: skip
        headings = ("value", "error", "claimed", "build ms", "solve ms", "unknowns")
        return table(("method", "status"), headings, rows, notes=_notes(self))

    def certified(self) -> str:
        """How many digits of the ladder's value are proved, and for which curves, in one line; or why none are."""
        from varcalc.study.certified import certified_line  # python-flint is an extra

        ladder = next((row.solution for row in self.rows if row.method is None and row.ok), None)
        return "the ladder has no answer to certify" if ladder is None else certified_line(ladder)

    def record(self) -> dict[str, Any]:
        """The comparison as plain numbers, strings, lists and dicts, ready for JSON; None where there is no number."""
        return {
            "problem": self.problem.name,
            "tol": self.tol,
            "exact": None if self.exact is None else self.exact.value,
            "agree": self.agree,
            "disagreements": list(self.disagreements),
            "rows": [row.record() for row in self.rows],
        }

    def chart(self, *, title: str = "", downward: bool = False) -> Figure:
        """All curves over each other, and their differences beneath on a logarithmic axis.

        The differences are from the exact curve where one is known, otherwise
        from the route that claims the least error. ``title`` is by default the
        problem's name; ``downward`` draws y downward. Returns a matplotlib Figure; write it with ``savefig``.
        Raises ValueError when no curve is known at all.
        """
        return charts().comparison_picture(self, title=title, downward=downward)

    def __repr__(self) -> str:
        agree = "agree" if self.agree else "disagree"
        return line("Comparison", [brief(self.problem.name), counted(len(self.rows), "route"), agree])

    def _headline(self) -> str:
        return f"{self.problem.name} by {counted(len(self.rows), 'route')}"

    def _facts(self) -> Iterator[Fact]:
        for row in self.rows:
            yield Fact(row.label, figure_of(row.value, row.claimed) if row.ok else f"{row.outcome}: {row.reason}")
        if self.exact is not None:
            yield Fact("closed form", f"{self.exact.value:.15g}  {self.exact.description}".rstrip())
        yield Fact("verdict", "; ".join(line.strip() for line in _verdict(self)))


@spelled
def compare(
    problem: Problem | Curve,
    methods: Iterable[Any] | None = None,
    exact: Exact | float | None = None,
    *,
    tol: float = 1e-10,
    inapplicable: Mapping[type, str] | None = None,
    progress: Progress = None,
) -> Comparison:
    """Solve ``problem`` by each of ``methods`` and hold the answers against each other.

    ``methods`` are method objects; None among them stands for the ladder, which
    chooses for itself. By default they are all that are offered for the
    problem (:func:`varcalc.study.routes.methods_for`). They are taken one at a
    time. ``exact`` is the closed form, a number or an :class:`Exact`.
    ``inapplicable`` maps method classes to the reason why they do not apply;
    such a method is not tried and its row holds the reason. A method that
    finds no answer is a row as well, never an exception. ``progress`` is as
    :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which holds the rows that are
    finished.

    Raises TypeError for what is no method object, ValueError when there are
    no methods, and whatever :func:`varcalc.solve` raises for bad arguments.
    """
    check_functional(problem)
    if methods is None:
        methods = methods_for(problem)
    tried, closed_form = sequence("methods", methods), as_exact(exact)
    reasons = {} if inapplicable is None else checked_reasons("inapplicable", inapplicable)
    rows: list[Row] = []
    with telling(progress, problem.name) as told:
        try:
            for i, method in enumerate(told.over(tried, lambda m: "the ladder" if m is None else label(m))):
                rows.append(_row(problem, checked_method(i, method), closed_form, tol, reasons))
        except KeyboardInterrupt as stop:
            raise Interrupted(Comparison(problem, tuple(rows), closed_form, tol)) from stop
    if not rows:
        raise ValueError("methods is empty; give at least one method, or None for the ladder")
    return Comparison(problem, tuple(rows), closed_form, tol)


def _row(problem: Problem | Curve, method: Any, exact: Exact | None, tol: float, reasons: Mapping[type, str]) -> Row:
    reason = reasons.get(type(method))
    if reason is not None:
        return Row(label(method), method, status=None, reason=reason)
    try:
        solution = solve(cold(problem), method, tol=tol, throw=False, progress=False)
    except VariationalError as error:
        solution = error.solution
    name = label(method) if method is not None else f"ladder ({solution.rung})" if solution.status.ok else "ladder"
    answered = solution.status.ok
    return Row(
        name,
        method,
        solution.status,
        value=solution.value,
        deviation=solution.value - exact.value if exact is not None and answered else math.nan,
        claimed=solution.error.value if answered else math.nan,
        build=solution.stats.build,
        solve=solution.stats.solve,
        unknowns=solution.stats.unknowns,
        reason="" if answered else solution.message or solution.status.value,
        solution=solution,
    )


def cold(problem: Problem | Curve) -> Problem | Curve:
    """The same problem with nothing built yet, so that no method's build time is paid by another.

    What was found where other valleys were looked for is kept: no row's time tells of that.
    """
    other = copy.copy(problem)
    other.cache, other.answers = Cache(), problem.answers
    return other


def _apart(a: Row, b: Row) -> str:
    """The sentence that says two routes disagree; empty when they agree."""
    distance = abs(a.value - b.value)
    size = max(abs(a.value), abs(b.value))
    allowed = PAIR_MARGIN * (a.claimed + b.claimed) + EXACT_FLOOR * size
    if distance <= allowed:
        return ""
    return (
        f"{a.label} and {b.label} differ by {distance:.1e}, "
        f"more than the errors they claim, {a.claimed:.1e} and {b.claimed:.1e}"
    )


def _off(row: Row, exact: Exact) -> str:
    """The sentence that says a route misses the closed form; empty when it does not."""
    allowed = max(EXACT_MARGIN * row.claimed, EXACT_FLOOR * abs(exact.value))
    if abs(row.deviation) <= allowed:
        return ""
    return (
        f"{row.label} is {row.deviation:+.1e} from the closed form, "
        f"more than {EXACT_MARGIN:g} times the error it claims, {row.claimed:.1e}"
    )


def _notes(comparison: Comparison) -> list[str]:
    exact = comparison.exact
    notes = [] if exact is None else [f"closed form: {exact.value:.15g}  {exact.description}".rstrip()]
    notes += [f"{row.label}: {row.reason}" for row in comparison.rows if row.reason]
    return [*notes, *comparison.conclusion]


def _routes(comparison: Comparison) -> list[str]:
    """The routes that answered; the ladder is one of its own only where its last rung is not among the others."""
    named = [row for row in comparison.rows if row.ok and row.method is not None]
    tried = {type(row.method).__name__ for row in named}
    ladders = [row.solution.rung for row in comparison.rows if row.ok and row.method is None and row.solution]
    return [*(row.label for row in named), *(rung for rung in ladders if rung not in tried)]


def _verdict(comparison: Comparison) -> list[str]:
    """See :attr:`Comparison.conclusion`."""
    routes = _routes(comparison)
    measure = " with the closed form" if comparison.exact is not None else ""
    if not routes:
        lines = ["no route answered"]
    elif not comparison.agree:
        lines = ["the routes disagree:", *(f"  {sentence}" for sentence in comparison.disagreements)]
    elif len(routes) > 1:
        lines = ["the routes agree" + (" with each other and" + measure if measure else "")]
    elif measure:
        lines = [f"{routes[0]}, the only route that answered, agrees{measure}"]
    else:
        lines = [f"{routes[0]} is the only route that answered; there is nothing to hold it against"]
    if any(row.method is None and not row.ok for row in comparison.rows) and routes:
        lines.append("the ladder has no answer that stands")
    return lines
