"""Somebody else's solver, run over the reference problems and held against their closed forms."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.extensions import optional
from varcalc.problem.conditions import finite, real, sequence, told, truth, whole
from varcalc.problem.functional import Functional
from varcalc.spelling import spelled
from varcalc.study.plain import PlainProblem, size_of
from varcalc.study.reference import Exact, Reference, catalogue, load
from varcalc.tables import shown, table

if TYPE_CHECKING:
    import pandas as pd

NO_NUMBER = "no number; where there is no answer, return None"
COMPARED = 33
"""Places at which a curve is held against the closed form."""
UNCLAIMED = 8 * np.finfo(float).eps
"""Relative error that no claim in double precision need cover."""


class Outcome(Enum):
    """What came of one problem; each member carries its meaning."""

    RIGHT = "an answer, as close as was asked for"
    WRONG = "an answer that is further off than was asked for, as it says itself"
    REFUSED = "no answer, and it says so"
    FALSELY_RIGHT = "an answer given out for right that is not"

    @property
    def words(self) -> str:
        """The name as a table shows it."""
        return self.name.lower().replace("_", " ")


@spelled
@dataclass(frozen=True)
class SolverAnswer:
    """What a solver says: the ``value``, and where it has them the curve ``y(x)`` and the ``error`` it claims.

    ``y`` takes abscissae (m,) (t in [0, 1] at constant speed for a Curve) and returns (m,) or (n, m). ``success=False``
    is a refusal, and ``message`` says why. Raises TypeError for a value or an error that is no number and a y that is
    no function, and ValueError for an error below 0.
    """

    value: float
    y: Callable[[np.ndarray], Any] | None = None
    error: float | None = None
    success: bool = True
    message: str = ""

    def __post_init__(self) -> None:
        if not truth("SolverAnswer.success", self.success):
            return  # of a refusal the words are all that is taken
        object.__setattr__(self, "value", _number("value", self.value))
        if self.error is not None:
            object.__setattr__(self, "error", _number("error", self.error))
            if self.error < 0:
                raise ValueError(f"SolverAnswer.error must not be negative, not {self.error}: it is a distance")
        if self.y is not None and not callable(self.y):
            raise TypeError(f"SolverAnswer.y must be a function of the abscissae, not {told(self.y)}")


def _number(name: str, given: Any) -> Any:
    """A number as it was given, so that mpmath's keep their digits; the one entry of an array that has no more."""
    value = given.item() if isinstance(given, np.ndarray) and given.size == 1 else given
    real(f"SolverAnswer.{name}", value)
    return value


Solver = Callable[[PlainProblem], "SolverAnswer | float | None"]
"""A solver, adapted: it returns the value, with more in a SolverAnswer, or None for what it does not do."""


@dataclass(frozen=True)
class SolverRow:
    """One problem: the :class:`Outcome`, the value and its distance from the closed form, that of the curve, the claim.

    Distances are absolute; what is not known is None.
    """

    problem: str
    outcome: Outcome
    value: float | None = None
    value_error: float | None = None
    curve_error: float | None = None
    claimed_error: float | None = None
    message: str = ""


@dataclass(frozen=True)
class SolverReport:
    """What :func:`verify_solver` found: a row for each problem, in the order they were given. It prints as a table."""

    solver: str
    tolerance: float
    rows: tuple[SolverRow, ...] = field(repr=False)

    def of(self, outcome: Outcome) -> tuple[SolverRow, ...]:
        """The rows with one outcome."""
        return tuple(row for row in self.rows if row.outcome is outcome)

    @property
    def right(self) -> tuple[SolverRow, ...]:
        """The problems it solved."""
        return self.of(Outcome.RIGHT)

    @property
    def wrong(self) -> tuple[SolverRow, ...]:
        """Those of which it was off, and said so."""
        return self.of(Outcome.WRONG)

    @property
    def refused(self) -> tuple[SolverRow, ...]:
        """Those it had no answer to."""
        return self.of(Outcome.REFUSED)

    @property
    def falsely_right(self) -> tuple[SolverRow, ...]:
        """Those of which it gave out a wrong answer for right."""
        return self.of(Outcome.FALSELY_RIGHT)

    @property
    def exit_status(self) -> int:
        """0 where no answer is wrong and one at least is right; 1 else. What it refuses is held against nobody."""
        return 0 if self.right and not (self.wrong or self.falsely_right) else 1

    def table(self) -> str:
        """The rows as text for a monospaced page, with the counts beneath."""
        rows = [
            (
                r.problem, r.outcome.words, shown(r.value, ".15g"), shown(r.value_error, "+.1e"),
                shown(r.curve_error, ".1e"), shown(r.claimed_error, ".1e"), r.message.partition("\n")[0][:80],
            )
            for r in self.rows
        ]  # fmt: skip
        counts = ", ".join(f"{len(self.of(o))} {o.words}" for o in Outcome)
        note = f"{self.solver}, {len(self.rows)} problems to {self.tolerance:.1g} of max(1, |value|): {counts}"
        return table(
            ("problem", "outcome"), ("value", "error", "curve", "claimed"), rows, last=("message",), notes=[note]
        )

    def __str__(self) -> str:
        return self.table()

    def document(self) -> dict[str, Any]:
        """The report as plain numbers, strings, lists and dicts, ready for JSON."""
        rows = [asdict(row) | {"outcome": row.outcome.words} for row in self.rows]
        return {"solver": self.solver, "tolerance": self.tolerance, "rows": rows}

    def to_pandas(self) -> pd.DataFrame:
        """One row a problem; raises ModuleNotFoundError without pandas (``pip install 'varcalc[frames]'``)."""
        pd = optional("pandas", "frames", "tables of outcomes")
        return pd.DataFrame(self.document()["rows"])


@spelled
def verify_solver(
    solver: Solver, *, problems: Iterable[str | Reference] | None = None, tolerance: float = 1e-6, digits: int = 0
) -> SolverReport:
    """Run a solver over the reference problems, and tell what is right, what is wrong, and what is falsely right.

    ``solver`` takes a :class:`PlainProblem` and returns the value, a :class:`SolverAnswer`, or None for what it does
    not do; what it raises is a refusal, and so is what is no answer. ``problems`` are names of the catalogue (a file's
    name for all of its cases) or :class:`varcalc.Reference` with a closed form; without them all are taken. An answer
    is right where value and claim agree with the closed form to ``tolerance``, relative to max(1, abs(value)), and its
    curve, where it has one, to the root of that, as the value depends on the curve to second order. It is falsely right
    where it gives itself out for better than it is: off by more than the error it claims, or than the tolerance where
    it claims none. With ``digits`` the closed form is evaluated to so many, for solvers of more than double precision
    (mpmath's numbers are kept).

    Raises TypeError for a solver that cannot be called with one problem, ValueError for a tolerance that is none, no
    problems, a name that is not in the catalogue, and a reference without a closed form, or without one to so many
    digits.

    >>> import varcalc as vc
    >>> report = vc.verify_solver(lambda problem: vc.solve(problem.problem).value, problems=["soap_film", "cone"])
    >>> len(report.right), report.exit_status
    (6, 0)
    """
    within = finite("tolerance", tolerance)
    if not 0 < within < 1:
        raise ValueError(f"tolerance must be a number between 0 and 1, not {told(tolerance)}")
    whole("digits", digits, 0)
    check_solver(solver)
    references = _references(tuple(catalogue()) if problems is None else problems)
    bare = next((r.name for r in references if r.exact is None), None)
    if bare is not None:
        raise ValueError(f"{bare} has no closed form to hold a solver against; leave it out")
    called = getattr(solver, "__qualname__", type(solver).__name__)
    return SolverReport(called, within, tuple(judged(solver, r, within, digits) for r in references))


def check_solver(solver: Any) -> None:
    """TypeError for what cannot be called with one problem."""
    if isinstance(solver, type) or not callable(solver):
        by_method = "; a method of varcalc's is run by lambda problem: varcalc.solve(problem.problem, method).value"
        remedy = by_method if hasattr(solver, "solve") else ""
        raise TypeError(f"solver must be a function of a PlainProblem, not {told(solver)}{remedy}")
    try:
        inspect.signature(solver).bind(None)
    except TypeError:
        written = inspect.signature(solver)
        raise TypeError(f"solver is called with one PlainProblem, but its signature is {written}") from None
    except ValueError:  # a function of C's, which does not tell
        return


def _references(problems: Iterable[str | Reference]) -> list[Reference]:
    """The references that are named or given."""
    found: list[Reference] = []
    for given in [problems] if isinstance(problems, str | Reference) else sequence("problems", problems):
        if not isinstance(given, str | Reference):
            remedy = "; write Reference(name, problem, Exact(value))" if isinstance(given, Functional) else ""
            raise TypeError(f"problems takes names and References, not {told(given)}{remedy}")
        found += (given,) if isinstance(given, Reference) else load(given)
    if not found:
        raise ValueError("problems is empty; give at least one, or leave it out for all of the catalogue")
    return found


def judged(solver: Solver, reference: Reference, tolerance: float = 1e-6, digits: int = 0) -> SolverRow:
    """What comes of one reference problem that has a closed form; see :func:`verify_solver`."""
    exact = reference.exact
    if exact is None:
        raise ValueError(f"{reference.name} has no closed form to hold a solver against")
    value: Any = exact(digits).value if digits else exact.value
    problem = PlainProblem(reference)
    try:
        answer = solver(problem)
        if answer is None:
            return SolverRow(reference.name, Outcome.REFUSED, message="not among what it does")
        if not isinstance(answer, SolverAnswer):
            answer = SolverAnswer(answer)
        if not answer.success:
            return SolverRow(reference.name, Outcome.REFUSED, message=answer.message)
        off = float(answer.value - value)
        apart = _apart(reference, exact, answer)
    except (Exception, SystemExit) as error:  # noqa: BLE001  # packages raise errors of their own, of any class
        return SolverRow(reference.name, Outcome.REFUSED, message=f"{type(error).__name__}: {error}")
    claim = None if answer.error is None else float(answer.error)
    outcome = _outcome(off, apart, claim, tolerance, size_of(exact.value), round_off=0.0 if digits else UNCLAIMED)
    message = answer.message or (NO_NUMBER if math.isnan(off) else "")
    return SolverRow(reference.name, outcome, float(answer.value), off, apart, claim, message)


def _outcome(
    off: float, apart: float | None, claim: float | None, tolerance: float, size: float, round_off: float
) -> Outcome:
    """What an answer is that is ``off`` in its value and whose curve is ``apart`` from the closed form."""
    allowed = tolerance * size
    # not(<=) rather than >, so that what is no number is not close
    close = abs(off) <= allowed and (apart is None or apart <= tolerance**0.5 * size)
    honest = claim is None or abs(off) <= claim + round_off * size
    if close and honest:
        return Outcome.RIGHT
    if claim is not None and honest and claim > allowed:
        return Outcome.WRONG
    return Outcome.FALSELY_RIGHT


def _apart(reference: Reference, exact: Exact, answer: SolverAnswer) -> float | None:
    """The largest distance of an answer's curve from the exact one; None where one of the two is not known."""
    if answer.y is None or exact.y is None:
        return None
    problem = reference.problem
    if any(problem.slides):
        return None  # how far the curve goes is part of the answer
    x = np.linspace(*problem.span, COMPARED)
    given, true = (np.asarray(curve(x), dtype=float) for curve in (answer.y, exact.y))
    if given.size != problem.n * COMPARED:
        wanted = f"({problem.n}, {COMPARED})" if problem.n > 1 else f"({COMPARED},)"
        raise ValueError(f"y must return shape {wanted} for {COMPARED} abscissae, not {given.shape}")
    return float(np.abs(given.reshape(problem.n, -1) - true.reshape(problem.n, -1)).max())
