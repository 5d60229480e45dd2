"""One problem at parameter values near to those at which it is solved.

What has been built for one value serves the others: the expressions, their
functions, the singular ends and the degree that sufficed. Each value begins
from the nearest solution and is held to what a solve asks of an answer; one
for which that is in doubt has none here.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from varcalc.existence.broken_curve import runs_level, with_rival
from varcalc.formulation import Elsewhere, Form
from varcalc.functional import Functional
from varcalc.methods.answer import Extremal
from varcalc.methods.direct.batch import Batch, Places
from varcalc.methods.family import Answer, Answers, applies, solution, solved, straight_starts, with_bends
from varcalc.methods.family_of_one import One
from varcalc.methods.ritz import Ritz
from varcalc.problem import Curve, Problem
from varcalc.singular import Infinite, forms
from varcalc.solution import Solution
from varcalc.verify.weierstrass import PLACES, convinced, vouched

REMEMBERED = 256
"""Solutions among which the nearest is looked for: the last ones."""

FOR_THEMSELVES = 8
"""Values for which a form is found for itself before the function is built that tells whether it is the same."""


@dataclass(frozen=True)
class Known:
    """A solution to begin from: parameter values, degree and coefficients on one element."""

    values: np.ndarray
    degree: int
    coefficients: np.ndarray


class Neighbours:
    """The solutions of one problem at several parameter values, and what finds others from them.

    Made by :meth:`of`; ``tol`` is that of a solve.
    """

    def __init__(self, form: Form, elsewhere: Elsewhere, method: Ritz, tol: float) -> None:
        self.form, self.elsewhere, self.method, self.tol = form, elsewhere, method, tol
        self.known: list[Known] = []

    @classmethod
    def of(cls, known: Solution, tol: float) -> Neighbours | None:
        """The neighbourhood of a solution; None where the method, its mesh or the form needs more than is done here."""
        extremal, method = known.extremal, known.method
        if not (known.status.ok and isinstance(extremal, Extremal) and isinstance(method, Ritz) and method.plain):
            return None
        first = _first_of(extremal.form)
        if first is None or first.elsewhere is None or extremal.coefficients is None:
            return None
        found = cls(first, first.elsewhere, method, tol)
        found.add(known)
        return found

    def add(self, known: Solution) -> None:
        """Take a solution among those to begin from, if it is one of the same form on one element."""
        extremal = known.extremal
        kin = isinstance(extremal, Extremal) and extremal.form.built is self.form.built
        if kin and known.status.ok and extremal.coefficients is not None:
            self._remember(known.problem.parameter_values, known.stats.degree, extremal.coefficients)

    def _remember(self, values: np.ndarray, degree: int, coefficients: np.ndarray) -> None:
        self.known.append(Known(values, degree, coefficients))
        del self.known[:-REMEMBERED]

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
            if self.form.integrals:
                starts = with_bends(self.form, places, degrees, starts)
            found = solved(self.form, places, degrees, starts, self.tol, near=not self.form.integrals)
            left = np.flatnonzero(~found.stands)
            if len(left) and self.form.lifted is None and not self.form.integrals:
                # afresh, as a solve of its own would begin
                degree, lines = straight_starts(self.form, places[left])
                found.enter(left, solved(self.form, places[left], degree, lines, self.tol, near=False))
        answers.enter(rows, found)
        for row in np.flatnonzero(answers.stands):
            self._remember(values[row], int(answers.degree[row]), answers.coefficients[row])
        return answers

    def solved_alone(self, values: np.ndarray) -> Answer | None:
        """What is found at ``values`` (parameters,), from the nearest solution; None where it is in doubt."""
        if not self._alike(values[None])[0]:
            return None
        known = self.known[self._nearest(values[None])[0]]
        one = One.of(self.form, known.degree)
        if one is not None:
            spans, start, end = self.elsewhere.placed(values[None])
            with np.errstate(all="ignore"):
                found = one.solved(spans[0], np.append(start, end), values, known.coefficients, self.tol)
            if found is not None:
                return found
        answers = self.solved(values[None])
        return answers[0] if answers.stands[0] else None

    def _alike(self, values: np.ndarray) -> np.ndarray:
        """At which ``values`` (K, parameters) the problem has this form; (K,) of bool.

        To build the function that measures it costs as much as finding the forms of some values for themselves.
        """
        built = self.form.built
        built["values measured"] = built.get("values measured", 0) + len(values)
        if built["values measured"] > FOR_THEMSELVES:
            return self.elsewhere.alike(values)
        return np.array([self._stated_alike(v) for v in values])

    def _stated_alike(self, values: np.ndarray) -> bool:
        """Whether the form that is tried first at ``values`` is this one, found for itself."""
        problem = self.form.problem
        try:
            first = forms(problem.with_parameters(dict(zip(problem.parameters, map(float, values), strict=True))))[0]
        except (Infinite, ValueError):  # a functional that is infinite, ends where none can be
            return False
        return first is not None and first.built is self.form.built

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
        if form.energetic and (isinstance(form.problem, Curve) or any(form.singular)):
            return sure
        if form.lifted is not None or form.energetic:
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
        batch = Batch(self.form, degree, places)
        variables = batch.variables(batch.of_degree(np.array(coefficients), degree))
        some = np.linspace(0, batch.count - 1, PLACES).astype(int)
        with np.errstate(all="ignore"):
            passed = convinced(problem, batch.x[:, some], variables[:, some, :n], variables[:, some, n:], values)
        if n == 1:
            passed &= ~runs_level(batch.x, variables[:, :, 0], np.hstack([places.start, places.end]))
        return passed

    def _placed(self, values: np.ndarray) -> Places:
        return Places(*self.elsewhere.placed(values), values)

    def solution(self, problem: Functional, answer: Answer, seconds: float) -> Solution:
        """An answer as the Solution of ``problem``, held against curves with corners and jumps."""
        form = self.elsewhere.form(problem)
        found = solution(form, self.method, answer, seconds)
        found = vouched(found, form)
        return with_rival(found) if found.status.ok else found


def _first_of(form: Form) -> Form | None:
    """The form that is tried first of the problem of ``form``, if it is stated as that one is and can be solved so.

    It is asked once of forms that share their expressions: where singular ends are what they are at one value, the
    first form is the same.
    """
    if "first" not in form.built:
        first = forms(form.problem)[0]
        alike = first is not None and first.built is form.built and applies(first)
        form.built["first"] = first if alike else None
    return form.built["first"]


def _one_start(method: Any) -> Any:
    return replace(method, starts=1) if isinstance(method, Ritz) else method


def resolved(problem: Functional, method: Any, tol: float, known: Any) -> Solution | None:
    """The solution of ``problem`` begun from the ``known`` Solution of it at other parameter values.

    None where that is something else, or where the answer found from there is in doubt.
    """
    if not isinstance(known, Solution) or known.problem.templates is not problem.templates:
        return None
    # how many starting curves are tried is no matter where one is at hand
    if not (method is None or method == known.method or _one_start(method) == _one_start(known.method)):
        return None
    began = time.perf_counter()
    neighbours = Neighbours.of(known, tol)
    if neighbours is None:
        return None
    answer = neighbours.solved_alone(problem.parameter_values)
    if answer is None:
        return None
    found = neighbours.solution(problem, answer, time.perf_counter() - began)
    return found if found.status.ok else None
