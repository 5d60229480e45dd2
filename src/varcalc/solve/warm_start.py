"""One problem at parameter values near to those at which it is solved.

What has been built for one value serves the others: the expressions, their
functions, the singular ends and the degree that sufficed. Each value begins
from the nearest solution and is held to what a solve asks of an answer; one
for which that is in doubt has none here.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from varcalc.existence.broken_curve import runs_level, with_rival
from varcalc.formulation import Elsewhere, Form
from varcalc.formulation.singular import Infinite, forms
from varcalc.methods.answer import Extremal
from varcalc.methods.ritz import family as direct
from varcalc.methods.ritz.family import Answer, Answers
from varcalc.methods.ritz.method import Ritz
from varcalc.methods.ritz.system import Places
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import derived
from varcalc.verify.slopes import TRIED_PLACES, convinced, vouched

REMEMBERED_SOLUTIONS = 256
"""Solutions among which the nearest is looked for: the last ones."""

FOR_THEMSELVES = 8
"""Values up to which the form of each is found for itself: to build the function that compares them costs as much."""


@dataclass(frozen=True)
class Known:
    """A solution to begin from: parameter values, degree and coefficients on one element."""

    values: np.ndarray
    degree: int
    coefficients: np.ndarray


class Family(Protocol):
    """How a method treats many values of the parameters at once; modules of the methods are such families."""

    def applies(self, form: Form) -> bool:
        """Whether a form can be solved so."""
        ...

    def straight_starts(self, form: Form, places: Places) -> tuple[np.ndarray, list[np.ndarray]]:
        """The degrees (K,) and coefficients to begin from where nothing is known."""
        ...

    def solved(
        self, form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray], tol: float, *, near: bool
    ) -> Answers:
        """What is found at K places from curves with the coefficients ``starts``, ``near`` to solutions or not."""
        ...

    def sampled(
        self, form: Form, places: Places, degree: int, coefficients: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Abscissae (K, Q), ordinates and slopes (K, Q, n) along the curves."""
        ...

    def solution(self, form: Form, method: Any, found: Answer, seconds: float) -> Solution:
        """An answer as a Solution."""
        ...


def _family(method: Any) -> Family | None:
    """That of a method; None where it has none, or its mesh is prescribed."""
    if isinstance(method, Ritz):
        return direct if method.plain else None
    from varcalc.methods.collocation.method import Collocation  # imported by the few solves that need it

    if method != Collocation():
        return None
    from varcalc.methods.collocation import batched

    return batched


class Neighbours:
    """The solutions of one problem at several parameter values, and what finds others from them.

    Made by :meth:`of`; ``tol`` is that of a solve, ``expected`` how many values belong together.
    """

    def __init__(
        self, form: Form, elsewhere: Elsewhere, method: Any, family: Family, tol: float, expected: int
    ) -> None:
        self.form, self.elsewhere, self.method, self.family, self.tol = form, elsewhere, method, family, tol
        self.compared = expected > FOR_THEMSELVES
        self.known: list[Known] = []

    @classmethod
    def of(cls, known: Solution, tol: float, expected: int) -> Neighbours | None:
        """The neighbourhood of a solution; None where the method, its mesh or the form needs more than is done here.

        ``expected`` is the number of values that are to be solved together or one after the other.
        """
        extremal, method, family = known.extremal, known.method, _family(known.method)
        if not known.status.ok or not isinstance(extremal, Extremal) or family is None:
            return None
        first = _first_of(extremal.form, family)
        if first is None or first.elsewhere is None or extremal.coefficients is None:
            return None
        found = cls(first, first.elsewhere, method, family, tol, expected)
        found.add(known)
        return found

    def add(self, known: Solution) -> None:
        """Take a solution among those to begin from, if it is one of the same form on one element."""
        extremal = known.extremal
        kin = isinstance(extremal, Extremal) and extremal.form.cache is self.form.cache
        if kin and known.status.ok and extremal.coefficients is not None:
            self._remember(known.problem.parameter_values, known.stats.degree, extremal.coefficients)

    def _remember(self, values: np.ndarray, degree: int, coefficients: np.ndarray) -> None:
        self.known.append(Known(values, degree, coefficients))
        del self.known[:-REMEMBERED_SOLUTIONS]

    def solved(self, values: np.ndarray) -> Answers:
        """What is found at ``values`` (K, parameters), each from the nearest solution; they are remembered."""
        answers = Answers.none(len(values))
        rows = np.flatnonzero(self._alike(values))
        if not len(rows):
            return answers
        places = self._placed(values[rows])
        nearest = [self.known[k] for k in self._nearest(values[rows])]
        degrees = np.array([k.degree for k in nearest])
        starts = [k.coefficients for k in nearest]
        with np.errstate(all="ignore"):
            found = self.family.solved(self.form, places, degrees, starts, self.tol, near=True)
            left = np.flatnonzero(~found.stands)
            if len(left) and not self.form.stated.is_lifted and not self.form.conditions.integrals:
                # afresh, as a solve of its own would begin
                degree, lines = self.family.straight_starts(self.form, places[left])
                again = self.family.solved(self.form, places[left], degree, lines, self.tol, near=False)
                found.enter(left, again)
        answers.enter(rows, found)
        for row in np.flatnonzero(answers.stands):
            self._remember(values[row], int(answers.degree[row]), answers.coefficients[row])
        return answers

    def solved_alone(self, problem: Functional) -> Solution | None:
        """The solution of ``problem`` from the nearest one; None where it is in doubt."""
        values, began = problem.parameter_values[None], time.perf_counter()
        if not self._alike(values)[0]:
            return None
        if self.family is direct and not self.form.conditions.integrals:
            known = self.known[self._nearest(values)[0]]
            form = self.elsewhere.form(problem)
            with np.errstate(all="ignore"):
                found = self.method.continued(form, known.degree, known.coefficients, self.tol)
            if found is not None and found.status.ok:
                return self._confirmed(found)
        answers = self.solved(values)
        return self.solution(problem, answers[0], time.perf_counter() - began) if answers.stands[0] else None

    def _alike(self, values: np.ndarray) -> np.ndarray:
        """At which ``values`` (K, parameters) the problem has this form; (K,) of bool.

        Where many belong together one function compares the forms at all of them.
        """
        if self.compared:
            return self.elsewhere.alike(values)
        return np.array([self._stated_alike(v) for v in values])

    def _stated_alike(self, values: np.ndarray) -> bool:
        """Whether the form that is tried first at ``values`` is this one, found for itself."""
        problem = self.form.problem
        try:
            first = forms(problem.with_parameters(dict(zip(problem.parameters, map(float, values), strict=True))))[0]
        except (Infinite, ValueError):  # a functional that is infinite, ends where none can be
            return False
        return first is not None and first.cache is self.form.cache

    def _nearest(self, values: np.ndarray) -> list[int]:
        """The number of the nearest solution, each parameter measured by the range it takes."""
        if len(self.known) == 1:
            return [0] * len(values)
        known = np.array([k.values for k in self.known])
        ranges = np.ptp(np.vstack([known, values]), axis=0)
        distances = np.zeros((len(values), len(known)))
        for column in np.flatnonzero(ranges):
            apart = np.abs(np.subtract.outer(values[:, column], known[:, column])) / ranges[column]
            np.maximum(distances, apart, out=distances)
        # of several at one distance the last
        return list(distances.shape[1] - 1 - distances[:, ::-1].argmin(1))

    def beyond_doubt(self, values: np.ndarray, answers: Answers) -> np.ndarray:
        """Which of the ``answers`` at ``values`` need no look at other curves, one by one; (K,) of bool.

        The shortest curve of a metric needs none; graphs are put to the tests of a solve, many at a time.
        """
        form, sure = self.form, answers.stands.copy()
        if form.coordinates.energetic and (isinstance(form.problem, Curve) or any(form.coordinates.singular)):
            return sure
        if form.stated.is_lifted or form.coordinates.energetic:
            return np.zeros_like(sure)
        for degree in np.unique(answers.degree[sure]):
            rows = np.flatnonzero(answers.stands & (answers.degree == degree))
            sure[rows] = self._tested(values[rows], [answers.coefficients[row] for row in rows], int(degree))
        return sure

    def _tested(self, values: np.ndarray, coefficients: list[np.ndarray], degree: int) -> np.ndarray:
        """Which graphs pass the tests for other slopes and for jumps at the ends; (K,) of bool."""
        problem, n = self.form.problem, self.form.n
        assert isinstance(problem, Problem)
        places = self._placed(values)
        with np.errstate(all="ignore"):
            x, y, slopes = self.family.sampled(self.form, places, degree, np.array(coefficients))
            some = np.linspace(0, x.shape[1] - 1, TRIED_PLACES).astype(int)
            passed = convinced(problem, x[:, some], y[:, some], slopes[:, some], values)
        if n == 1 and isinstance(self.method, Ritz):
            passed &= ~runs_level(x, y[:, :, 0], np.hstack([places.start, places.end]))
        return passed

    def _placed(self, values: np.ndarray) -> Places:
        return Places(*self.elsewhere.placed(values), values)

    def solution(self, problem: Functional, answer: Answer, seconds: float) -> Solution:
        """An answer as the Solution of ``problem``, held against curves with corners and jumps."""
        return self._confirmed(self.family.solution(self.elsewhere.form(problem), self.method, answer, seconds))

    def _confirmed(self, found: Solution) -> Solution:
        assert found.extremal is not None
        found = vouched(found, found.extremal.form)
        return with_rival(found) if found.status.ok and isinstance(self.method, Ritz) else found


def _first_of(form: Form, family: Family) -> Form | None:
    """The form that is tried first of the problem of ``form``, if it is stated as that one is and can be solved so.

    It is asked once of forms that share their expressions: where singular ends are what they are at one value, the
    first form is the same.
    """
    first = _first(form)
    return first if first is not None and family.applies(first) else None


@derived
def _first(form: Form) -> Form | None:
    first = forms(form.problem)[0]
    return first if first is not None and first.cache is form.cache else None


def _one_start(method: Any) -> Any:
    return replace(method, starts=1) if isinstance(method, Ritz) else method


def resolved(problem: Functional, method: Any, tol: float, known: Any) -> Solution | None:
    """The solution of ``problem`` begun from the ``known`` Solution of it at other parameter values.

    None where that is something else, or where the answer found from there is in doubt. A solution knows how many in
    a row were begun from one another; whoever asks for many in a row asks for more.
    """
    if not isinstance(known, Solution) or known.problem.templates is not problem.templates:
        return None
    # how many starting curves are tried is no matter where one is at hand
    if not (_one_start(method) == _one_start(known.method) or (method is None and isinstance(known.method, Ritz))):
        return None
    in_a_row = 1 if known.extremal is None else known.extremal.in_a_row + 1
    neighbours = Neighbours.of(known, tol, in_a_row)
    if neighbours is None:
        return None
    found = neighbours.solved_alone(problem)
    if found is None or not found.status.ok or found.extremal is None:
        return None
    return replace(found, extremal=replace(found.extremal, in_a_row=in_a_row))
