"""One problem at parameter values near to those at which it is solved.

What has been built for one value serves the others: the expressions, their
functions, the singular ends and the degree that sufficed. Each value begins
from the nearest solution and is held to what a solve asks of an answer; one
for which that is in doubt has none here.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from varcalc.existence.broken_curve import with_rival
from varcalc.formulation import Elsewhere, Form
from varcalc.functional import Functional
from varcalc.mesh import Space
from varcalc.methods.answer import Extremal, answer
from varcalc.methods.direct.batch import Places
from varcalc.methods.direct.newton import Newton
from varcalc.methods.direct.rungs import quadrature_points
from varcalc.methods.family import Answers, applies, solved
from varcalc.methods.ritz import Ritz
from varcalc.problem import Problem
from varcalc.singular import forms
from varcalc.singular.alike import Ends
from varcalc.solution import ErrorEstimate, Solution, Stats
from varcalc.verify.weierstrass import vouched

REMEMBERED = 512
"""Solutions among which the nearest is looked for: the last ones."""


class Neighbours:
    """The solutions of one problem at several parameter values, and what finds others from them.

    Made by :meth:`of`; ``tol`` is that of a solve.
    """

    def __init__(self, form: Form, elsewhere: Elsewhere, method: Ritz, tol: float) -> None:
        self.form, self.elsewhere, self.method, self.tol = form, elsewhere, method, tol
        self.places: list[np.ndarray] = []
        self.degrees: list[int] = []
        self.coefficients: list[np.ndarray] = []

    @classmethod
    def of(cls, solution: Solution, tol: float) -> Neighbours | None:
        """The neighbourhood of a solution; None where the method, its mesh or the form needs more than is done here."""
        extremal, method, problem = solution.extremal, solution.method, solution.problem
        if extremal is None or not solution.status.ok or not _plainly(method) or not isinstance(problem, Problem):
            return None
        first = forms(problem)[0]
        kept = isinstance(extremal, Extremal) and first is not None and extremal.form.built is first.built
        if not kept or first.elsewhere is None or not applies(first) or solution.stats.elements != 1:
            return None
        found = cls(first, first.elsewhere, method, tol)
        found.add(solution)
        return found

    def add(self, solution: Solution) -> None:
        """Take a solution among those to begin from, if it is one of the same form on one element."""
        extremal = solution.extremal
        if not isinstance(extremal, Extremal) or extremal.form.built is not self.form.built:
            return
        if solution.status.ok and solution.stats.elements == 1:
            space = self._space(extremal.form, solution.stats.degree)
            self._remember(solution.problem.parameter_values, solution.stats.degree, space.fit(_curve(extremal)))

    def _remember(self, values: np.ndarray, degree: int, coefficients: np.ndarray) -> None:
        for kept, new in ((self.places, values), (self.degrees, degree), (self.coefficients, coefficients)):
            kept.append(new)
            del kept[:-REMEMBERED]

    def solved(self, values: np.ndarray) -> Answers:
        """What is found at ``values`` (K, parameters), each from the nearest solution; they are remembered."""
        problem = self.form.problem
        assert isinstance(problem, Problem)
        answers = Answers.none(len(values))
        rows = np.flatnonzero(self.elsewhere.alike(values))
        if not len(rows):
            return answers
        points = Ends(problem, values[rows]).points
        places = Places(*self.elsewhere.placed(points), values[rows])
        nearest = self._nearest(values[rows])
        degrees = np.array([self.degrees[k] for k in nearest])
        with np.errstate(all="ignore"):
            found = solved(self.form, places, degrees, [self.coefficients[k] for k in nearest], self.tol)
        answers.enter(rows, found)
        for row in np.flatnonzero(answers.stands):
            self._remember(values[row], int(answers.degree[row]), answers.coefficients[row])
        return answers

    def _nearest(self, values: np.ndarray) -> list[int]:
        """The number of the nearest solution, each parameter measured by the range it takes."""
        known = np.array(self.places)
        both = np.vstack([known, values])
        unit = np.where(np.ptp(both, axis=0) > 0, np.ptp(both, axis=0), 1.0)
        distances = np.abs((values[:, None] - known) / unit).max(2, initial=0.0)
        # of several at one distance the last
        return list(distances.shape[1] - 1 - distances[:, ::-1].argmin(1))

    @property
    def beyond_doubt(self) -> bool:
        """Whether a minimum in this form needs no look at other curves: the shortest of a metric."""
        return self.form.energetic and any(self.form.singular)

    def solution(self, problem: Functional, answers: Answers, row: int, seconds: float) -> Solution:
        """An answer as the Solution of ``problem``, held against curves with corners and jumps."""
        form = self.elsewhere.form(problem)
        degree, coefficients = int(answers.degree[row]), answers.coefficients[row]
        space = self._space(form, degree)
        extremal = Extremal(
            form, lambda s, k: space.evaluate(coefficients, s, k), np.zeros(0), space.vertices, np.zeros(0), {}
        )
        error = ErrorEstimate(float(answers.error[row]), float(answers.curve[row]))
        free = int(np.isnan(form.fixed_start[0]).sum() + np.isnan(form.fixed_end[0]).sum())
        stats = Stats(0.0, seconds, int(answers.iterations[row]), space.size - 2 * form.n + free, 1, degree)
        found = answer(
            extremal, self.method, form.sign * float(answers.value[row]), error, space.vertices, stats,
            rule=quadrature_points(degree),
        )  # fmt: skip
        found = vouched(found, form)
        return with_rival(found) if found.status.ok else found

    def _space(self, form: Form, degree: int) -> Space:
        return Space(np.array(form.span), degree, form.n, form.order)


def _curve(extremal: Extremal) -> Any:
    return lambda s: extremal.evaluate(s, 0)


def _plainly(method: Any) -> bool:
    """Whether a method is the direct one with Newton's iteration and a mesh that is its own affair."""
    plain = isinstance(method, Ritz) and method.refine and method.degree is None and method.elements == 1
    return plain and (method.optimiser is None or method.optimiser == Newton())


def resolved(problem: Functional, method: Any, tol: float, known: Any) -> Solution | None:
    """The solution of ``problem`` begun from the ``known`` Solution of it at other parameter values.

    None where that is something else, or where the answer found from there is in doubt.
    """
    if not isinstance(known, Solution) or known.problem.templates is not problem.templates:
        return None
    if method is not None and method != known.method:
        return None
    began = time.perf_counter()
    neighbours = Neighbours.of(known, tol)
    if neighbours is None:
        return None
    answers = neighbours.solved(problem.parameter_values[None])
    if not answers.stands[0]:
        return None
    found = neighbours.solution(problem, answers, 0, time.perf_counter() - began)
    return found if found.status.ok else None
