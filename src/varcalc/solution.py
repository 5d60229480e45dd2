"""What a solve gives back: the curve, its value, an honest error, and a status."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from varcalc.problem.conditions import reals, told
from varcalc.problem.functional import Functional
from varcalc.showing import Brief, Fact, Plotted, brief, counted, figure_of, line

WORTHLESS_ERROR = 1e-6
"""Relative error at which an answer limited by round-off is none."""
OUTSIDE = 1e-12
"""Distance beyond the ends of a curve, relative to its interval, that is round-off of the person's abscissa."""


class Status(Enum):
    """How far an answer can be relied on; each member carries its meaning."""

    SOLVED = "solved to the tolerance asked for"
    ROUND_OFF = "the best answer double precision allows, short of the tolerance asked for"
    NOT_CONVERGED = "no answer: the method did not converge"
    REFUSED = "no answer: the problem has none of the kind asked for, or the method does not apply"

    @property
    def ok(self) -> bool:
        """True for an answer that stands."""
        return self in (Status.SOLVED, Status.ROUND_OFF)

    @property
    def words(self) -> str:
        """The name as a table shows it, such as "round off"."""
        return self.name.lower().replace("_", " ")


class Verdict(Enum):
    """What an extremal is, or why there is none; in the order in which they take precedence."""

    INFEASIBLE = "no curve meets the ends and constraints"
    UNBOUNDED = "the functional is unbounded"
    GAP = "smooth curves do not come near the infimum (Lavrentiev gap)"
    SINGULAR = "the Lagrangian depends on the slope in no way that could fix a curve"
    NO_EXTREMAL = "there is no extremal between these ends"
    NOT_ATTAINED = "the infimum is not attained"
    DEGENERATE = "a conjugate end, a continuum of extremals, or an abnormal constraint"
    SADDLE = "stationary, but neither a minimum nor a maximum"
    WEAK_MINIMUM = "a minimum among curves of nearby slope only (Weierstrass fails)"
    MINIMUM = "a minimum"
    MAXIMUM = "a maximum"


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated absolute errors: of the value, and of the curve (largest over the interval)."""

    value: float
    curve: float


@dataclass(frozen=True)
class Stats:
    """Cost of a solve: seconds to build and to solve, iterations, number of unknowns, the mesh.

    ``more_starts`` says that starting curves were left that were not tried, for lack of ``Ritz.starts``.
    """

    build: float = 0.0
    solve: float = 0.0
    iterations: int = 0
    unknowns: int = 0
    elements: int = 0
    degree: int = 0
    more_starts: bool = False


PROVED = "L is proved convex"
"""How what was searched begins where nothing had to be."""


@dataclass(frozen=True, repr=False, eq=False)
class Solution(Plotted):
    """An extremal of ``problem`` as one method found it.

    ``value`` is the functional on the curve, ``error`` the claimed errors,
    ``x`` the nodes, ``multipliers`` one entry for each constraint in the order
    given (floats, dJ/dlevel, for :class:`varcalc.Isoperimetric`),
    ``sensitivities`` dJ/dparameter by name (NaN for one that moves an end where that is not known:
    at singular ends, at second order, beside pathwise conditions and costs of the ends; and for one that moves what a
    curve rests on where kinks hold it as well), ``unknowns`` the optimised
    unknowns by name, ``rung`` the name of the method that answered,
    ``message`` why there is no answer, when there is none. ``local`` is True
    when a better value, ``lower``, is known of; ``searched`` says where better ones were looked for.
    """

    problem: Functional
    method: Any
    status: Status
    value: float
    error: ErrorEstimate
    x: np.ndarray = field(repr=False)
    curve: Callable[[np.ndarray, int], np.ndarray] | None = field(default=None, repr=False)
    multipliers: tuple[Any, ...] = ()
    sensitivities: Mapping[str, float] = field(default_factory=dict)
    unknowns: Mapping[str, float] = field(default_factory=dict)
    stats: Stats = field(default_factory=Stats)
    message: str = ""
    verdict: Verdict | None = None
    local: bool = False
    lower: float | None = None
    searched: str = ""
    extremal: Any = field(default=None, repr=False, compare=False)
    """The curve in the coordinates it was solved in (:class:`varcalc.methods.answer.Extremal`), where there are any."""

    def __str__(self) -> str:
        """Five lines: the value and its claim, what it is, on what evidence, by which route, where others were sought.

        >>> import casadi as ca
        >>> import varcalc as vc
        >>> line = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, 4))
        >>> print(vc.solve(line))  # doctest: +ELLIPSIS
        value:    5, known to ... (solved to the tolerance asked for)
        kind:     a minimum, the least of all curves
        evidence: the curve is known to ..., on a mesh of 1 element of degree 6
        route:    Ritz, 5 unknowns, 1 iteration in ... s
        searched: L is proved convex in the curve and its slope: there is no other valley
        """
        return super().__str__()

    def _headline(self) -> str:
        return ""

    def _facts(self) -> Iterator[Fact]:
        yield Fact("value", f"{figure_of(self.value, self.error.value)} ({self.status.value})")
        yield Fact("kind", self._kind())
        yield Fact("evidence", self._evidence())
        stats = self.stats
        steps = counted(stats.iterations, "iteration")
        yield Fact("route", f"{self.rung}, {stats.unknowns} unknowns, {steps} in {stats.build + stats.solve:.2g} s")
        yield Fact("searched", self.searched or "no other curves were looked for")

    def __repr__(self) -> str:
        """The problem's name, the value, the status and the method: of more, print tells."""
        told = f"{self.value:.12g}" if self.status.ok else self.status.name
        return line(type(self).__name__, [brief(self.problem.name), told, self.rung])

    def _kind(self) -> str:
        if not self.status.ok:
            return f"no answer: {self.message}"
        kind = sought(self.problem)
        if self.local:
            lower = "a better value" if self.lower is None else f"{self.lower:.12g}"
            return self.message or f"a local {kind} only: {lower} is reached elsewhere"
        if self.searched.startswith(PROVED):
            return f"a {kind}, the {'greatest' if self.problem.maximise else 'least'} of all curves"
        if getattr(self.method, "minimises", False):
            return f"a {kind} among the curves near it"
        return "a curve that solves the Euler-Lagrange equation; varcalc.verify tells what it is"

    def _evidence(self) -> str:
        if self.curve is None:
            return "no curve was found"
        known = f"the curve is known to {self.error.curve:.1g}" if math.isfinite(self.error.curve) else "a curve"
        elements, degree = self.stats.elements, self.stats.degree
        mesh = f", on a mesh of {counted(elements, 'element')}" if elements else ""
        return known + mesh + (f" of degree {degree}" if elements and degree else "")

    @property
    def rung(self) -> str:
        """The name of the method that answered."""
        return type(self.method).__name__

    @property
    def unknown_values(self) -> np.ndarray:
        """The numbers in ``unknowns``, in the order in which the problem names them."""
        return np.array(list(self.unknowns.values()))

    @property
    def interval(self) -> tuple[float, float]:
        """The first and the last abscissa of the curve; (0, 1) for a Curve. Where an end slides they are results.

        Raises ValueError when there is no curve.
        """
        if self.curve is None:
            raise ValueError(f"there is no curve to evaluate: {self.message or self.status.value}")
        return float(self.x.min()), float(self.x.max())

    def _evaluate(self, x: Any, derivative: int) -> Any:
        first, last = self.interval
        at = reals("x", x)
        slack = OUTSIDE * (last - first)
        if not np.all((at >= first - slack) & (at <= last + slack)):
            raise ValueError(f"the curve is known from {first} to {last} only, not at {_strange(at, first, last)}")
        assert self.curve is not None
        at = np.clip(at, first, last)
        values = self.curve(at.ravel(), derivative).reshape(self.problem.n, *at.shape)
        if not self.problem.scalar:
            return values
        return float(values[0]) if at.ndim == 0 else values[0]

    def y(self, x: Any) -> Any:
        """y(x): a float for a scalar x of a scalar problem; x's shape, or (n,) + x.shape for n functions.

        Raises ValueError outside :attr:`interval`, where nothing is known of the curve.
        """
        return self._evaluate(x, 0)

    def dy(self, x: Any) -> Any:
        """The slope y'(x), shaped as :meth:`y`."""
        return self._evaluate(x, 1)

    def q(self, t: Any) -> Any:
        """The point q(t) of a Curve, t in [0, 1], shape (n,) + t.shape; ValueError for other t."""
        return self._evaluate(t, 0)

    def dq(self, t: Any) -> Any:
        """The velocity dq/dt of a Curve, shaped as :meth:`q`."""
        return self._evaluate(t, 1)


def no_solution(given: Any, asked: str) -> TypeError:
    """The error of what was ``given`` to the function ``asked`` for a Solution and is none."""
    remedy = ""
    if isinstance(given, Functional):
        remedy = f"; write {asked}(solve(problem))"
    elif callable(getattr(given, asked, None)):  # a ray, which is declared above this module
        kind = type(given).__name__
        remedy = f"; a {kind} has a {asked} of its own: {kind.lower()}.{asked}()"
    return TypeError(f"solution must be what varcalc.solve gives back, not {told(given)}{remedy}")


def _strange(at: np.ndarray, first: float, last: float) -> float:
    """The first abscissa that is outside, or no number."""
    return float(at[~((at >= first) & (at <= last))].flat[0])


class VariationalError(Exception):
    """No answer that stands: ``status``, ``verdict`` and the ``solution`` as far as it was computed."""

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.message or solution.status.value)
        self.solution: Solution = solution
        self.status: Status = solution.status
        self.verdict: Verdict | None = solution.verdict


class InfeasibleError(VariationalError, ValueError):
    """No curve meets the ends and constraints."""


@dataclass(frozen=True, repr=False)
class Finding(Brief):
    """One statement that holds of a curve or problem, in words and ``numbers``; its ``verdict`` when it decides one."""

    verdict: Verdict | None
    sentence: str
    numbers: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.sentence


def sought(problem: Functional) -> str:
    """What is looked for: a "minimum", or a "maximum"."""
    return "maximum" if problem.maximise else "minimum"


def local_only(solution: Solution, known: str, lower: float | None = None) -> Solution:
    """The solution marked as a local one only for what is ``known``, a better value, ``lower``, among it."""
    message = f"a local {sought(solution.problem)} only: {known}"
    return replace(solution, local=True, lower=solution.lower if lower is None else lower, message=message)


def refused(solution: Solution, finding: Finding) -> Solution:
    """The solution as no answer, for what was found of it."""
    return replace(solution, status=Status.REFUSED, verdict=finding.verdict, message=finding.sentence)


def refusal(problem: Functional, method: Any, finding: Finding) -> Solution:
    """No answer for what was found of a problem before any method was tried."""
    return no_answer(problem, method, Status.REFUSED, finding.sentence, finding.verdict)


def defined(solution: Solution, ordinates: np.ndarray) -> Solution:
    """The solution; no answer where its value, a claimed error or the ``ordinates`` at its nodes are no numbers.

    A method may come to rest on a curve that runs along a line where L is infinite.
    """
    error = solution.error
    if not solution.status.ok:
        return solution
    if not math.isfinite(solution.value):
        reason = "the functional is not a number along the curve found: L is infinite or undefined somewhere on it"
    elif not (math.isfinite(error.value) and math.isfinite(error.curve)):
        reason = "no error can be told of the curve found: L is infinite or undefined close to it"
    elif not np.isfinite(ordinates).all():
        reason = "the curve found is not a number at all of its nodes"
    else:
        return solution
    return no_answer(solution.problem, solution.method, Status.NOT_CONVERGED, reason, stats=solution.stats)


def no_answer(
    problem: Functional,
    method: Any,
    status: Status,
    message: str,
    verdict: Verdict | None = None,
    stats: Stats | None = None,
) -> Solution:
    """A Solution that holds no curve, only the reason why."""
    nan = float("nan")
    return Solution(
        problem, method, status, nan, ErrorEstimate(float("inf"), float("inf")), np.empty(0),
        message=message, verdict=verdict, stats=stats or Stats(),
    )  # fmt: skip
