"""The direct method at many neighbouring parameter values at once, begun from solutions that are known.

What a solve of its own asks of an answer is asked here of every value: a
minimum where the Legendre condition holds, a Newton step in the next richer
space that settles and is the error, no soft mode of the second variation, a
rule that resolves the integrand, a curve that is a graph. A value for which
any of that is in doubt has no answer here; it is left to a solve of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.mesh import Space
from varcalc.methods.answer import TURNED, Extremal, answer
from varcalc.methods.direct.batch import Basis, Batch, Evaluated, Places, minimise, positive
from varcalc.methods.direct.degeneracy import SOFT as SOFT_MODE
from varcalc.methods.direct.error import ASTRAY, ASTRAY_SHARE, CURVE, ROUND_OFF, SAFETY, SOFT, UNMOVED
from varcalc.methods.direct.quadrature import RESOLVED, missed
from varcalc.methods.direct.rungs import DEGREES, quadrature_points
from varcalc.solution import ErrorEstimate, Solution, Stats

SEEN_FORWARD = np.ones(1)
"""A speed dx/ds for curves that have been seen not to turn back."""


@dataclass(frozen=True)
class Answer:
    """What was found for one value, see :class:`Answers`."""

    value: float
    error: float
    curve: float
    degree: int
    coefficients: np.ndarray
    iterations: int


@dataclass(frozen=True)
class Answers:
    """What was found for ``K`` values, each entry of shape (K,) or one a value.

    ``stands`` tells where there is an answer; ``value`` is in the sense that is minimised, ``error`` and ``curve``
    are the claimed errors, ``degree`` and ``coefficients`` the curve in the form's coordinates.
    """

    stands: np.ndarray
    value: np.ndarray
    error: np.ndarray
    curve: np.ndarray
    degree: np.ndarray
    coefficients: list[np.ndarray]
    iterations: np.ndarray

    @classmethod
    def none(cls, count: int) -> Answers:
        """No answer yet for ``count`` values."""
        blank = np.full(count, np.nan)
        whole = np.zeros(count, dtype=int)
        empty: list[np.ndarray] = [np.empty(0)] * count
        return cls(np.zeros(count, dtype=bool), blank, blank.copy(), blank.copy(), whole, empty, whole.copy())

    def __getitem__(self, row: int) -> Answer:
        """The answer for one value, which has one."""
        return Answer(
            float(self.value[row]), float(self.error[row]), float(self.curve[row]), int(self.degree[row]),
            self.coefficients[row], int(self.iterations[row]),
        )  # fmt: skip

    def enter(self, rows: np.ndarray, others: Answers) -> None:
        """Put the answers for some of the values in their places."""
        for name, own in vars(self).items():
            for row, new in zip(rows, getattr(others, name), strict=True):
                own[row] = new


def applies(form: Form) -> bool:
    """Whether a form can be solved so: a first-order functional of curves between ends, and nothing else asked."""
    bare = not (form.integrals or form.pathwise or form.knots or form.waypoints or form.corners or form.refused)
    return form.order == 1 and bare and form.ends is None and not form.periodic and not len(form.unknown_guess)


def solved(
    form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray], tol: float, *, near: bool
) -> Answers:
    """The minima at ``places`` from curves of ``degrees`` (K,) with the coefficients ``starts``.

    Where these are ``near`` to minima and the functional is not convex there, something is wrong.

    ``form`` is the form of one of the values: its expressions serve all. The
    degree climbs where the error asks for it; up to the last but one of those a solve climbs.
    """
    answers = Answers.none(len(degrees))
    ladder = DEGREES[form.order][:-1]
    degrees, starts = degrees.copy(), list(starts)
    for degree, richer in pairwise(ladder):
        rows = np.flatnonzero(degrees == degree)
        if not len(rows):
            continue
        here, there = (Batch(form, d, places[rows]) for d in (degree, richer))
        z = np.array([starts[row] for row in rows])
        z, found, steps = minimise(here, here.of_degree(z, degree), shifting=not near)
        answers.iterations[rows] += steps
        rows, z = rows[found], z[found]
        if len(rows):
            climbing = _judged(answers, rows, here.restricted(found), there.restricted(found), z, tol)
            for row, coefficients in climbing.items():
                degrees[row], starts[row] = richer, coefficients
    return answers


def solution(form: Form, method: Any, found: Answer, seconds: float, build: float = 0.0) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``, and ``build`` before that."""
    vertices = np.array(form.span)

    def evaluate(s: np.ndarray, k: int) -> np.ndarray:
        return _space(form.span, found.degree, form.n).evaluate(found.coefficients, s, k)

    extremal = Extremal(form, evaluate, np.zeros(0), vertices, np.zeros(0), {}, SEEN_FORWARD, found.coefficients)
    unknowns = len(Basis.of(form, found.degree).free)
    stats = Stats(build, seconds, found.iterations, unknowns, 1, found.degree)
    rule = quadrature_points(found.degree)
    error = ErrorEstimate(found.error, found.curve)
    return answer(extremal, method, form.sign * found.value, error, vertices, stats, rule=rule)


@lru_cache(maxsize=64)
def _space(span: tuple[float, float], degree: int, n: int) -> Space:
    return Space(np.array(span), degree, n)


def _judged(
    answers: Answers, rows: np.ndarray, here: Batch, there: Batch, z: np.ndarray, tol: float
) -> dict[int, np.ndarray]:
    """Enter the minima ``z`` that stand among the answers; those that a richer space would mend, with where to begin.

    See :func:`varcalc.methods.direct.error.estimate`, of which this is the case without conditions.
    """
    form = here.form
    coefficients = here.coefficients(z)
    start = there.of_degree(coefficients, here.degree)
    at = there.evaluate(start)
    soft = at.blocks - SOFT_MODE * there.leading(at)
    good = at.sound & np.isfinite(soft).all((1, 2, 3))
    # what is positive with a part of the leading term taken off has no soft mode, and is no saddle
    good[good] = positive(there.restricted(good).assembled(soft[good]))
    if not good.any():
        return {}
    rows, here, there, at = rows[good], here.restricted(good), there.restricted(good), at[good]
    coefficients, start = coefficients[good], start[good]
    step = -np.linalg.solve(there.assembled(at.blocks), at.gradient[:, :, None])[:, :, 0]
    decrement, size = -0.5 * np.einsum("kn,kn->k", step, at.gradient), 0.5 * there.squared(at, step)
    sure = (size <= UNMOVED**2 * at.scale) | (decrement >= SOFT * size)
    own = here.evaluate(z[good]).value if form.same_functional else at.value
    reports = _reports(there, start, step, own, at)
    largest = np.maximum(np.abs(there.variables(start)[:, :, : form.n]).max((1, 2)), 1e-300)
    enough = met(reports, largest, tol)
    stands = sure & enough & reports.resolved & reports.graph
    kept = rows[stands]
    answers.stands[kept], answers.value[kept] = True, reports.value[stands]
    answers.error[kept] = (reports.error + ROUND_OFF * reports.scale)[stands]
    answers.curve[kept], answers.degree[kept] = np.maximum(reports.curve, 4e-16 * largest)[stands], here.degree
    for row, coefficient in zip(kept, coefficients[stands], strict=True):
        answers.coefficients[row] = coefficient
    onward = there.coefficients(start + step)
    return {int(rows[k]): onward[k] for k in np.flatnonzero(sure & ~enough)}


@dataclass(frozen=True)
class Reports:
    """What is reported of trial curves, shapes (K,): see :class:`varcalc.methods.direct.error.Estimate`.

    ``resolved`` tells that the rule was fine enough, ``graph`` that the curve does not turn back.
    """

    value: np.ndarray
    error: np.ndarray
    scale: np.ndarray
    curve: np.ndarray
    resolved: np.ndarray
    graph: np.ndarray


def _reports(there: Batch, z: np.ndarray, step: np.ndarray, own: np.ndarray, at: Evaluated) -> Reports:
    """Values and errors of the curves ``z``, which the step mends; ``own`` is their value by the poorer rule."""
    variables, moved = there.variables(z), there.moved(step)
    here, beyond = (there.reported(v) for v in (variables, variables + moved))
    decrement = -0.5 * np.einsum("kn,kn->k", step, at.gradient)
    lengths = np.diff(there.places.spans, axis=1)[:, 0]
    missing = np.abs(decrement) + np.abs(at.value - own)
    return reports_of(there.form, there.weights, moved[:, :, : there.n], lengths, here, beyond, missing, at.scale)


def reports_of(
    form: Form,
    weights: np.ndarray,
    moved: np.ndarray,
    lengths: np.ndarray,
    here: np.ndarray,
    beyond: np.ndarray,
    missing: np.ndarray,
    scale: np.ndarray,
) -> Reports:
    """The reports of curves over intervals of ``lengths`` (K,) from the rows ``here`` and, mended, ``beyond``.

    Rows are those of :meth:`Batch.reported`, (K, Q, rows); ``moved`` (K, Q, n) is by how much the functions are
    mended, ``missing`` (K,) by how much what is minimised is too high, ``scale`` (K,) the size of its contributions.
    """
    n = form.problem.n
    values = (weights * here[:, :, 0]).sum(1)
    error = missing
    if not form.same_functional:
        error, scale = np.abs(values - (weights * beyond[:, :, 0]).sum(1)), np.abs(values)
    if form.lifted is None:
        curve, graph = SAFETY * np.abs(moved).reshape(len(values), -1).max(1), np.ones(len(values), dtype=bool)
    else:
        forward = here[:, :, 2 + n]
        slope = np.where(forward[:, :, None] != 0, here[:, :, 3 + n :] / forward[:, :, None], 0.0)
        move = beyond[:, :, 2 : 2 + n] - here[:, :, 2 : 2 + n] - slope * (beyond[:, :, 1:2] - here[:, :, 1:2])
        curve = SAFETY * np.abs(move).max((1, 2))
        # a curve whose own parameter is not the abscissa may turn back in it
        width = (weights * forward).sum(1)
        graph = forward.min(1) >= -(1e-9 + TURNED * curve / width) * np.abs(forward).max(1)
    resolved = missed(here[:, :, 0]) * 0.5 * lengths <= RESOLVED * scale
    return Reports(values, SAFETY * error, scale, curve, resolved, graph)


def met(reports: Reports, size: Any, tol: float) -> np.ndarray:
    """Whether value and curve are as good as a climb asks of them, and not limited by round-off.

    ``size`` is the largest ordinate of each curve, (K,) or a number.
    """
    whole = np.maximum(1.0, np.abs(reports.value))
    target = np.minimum(tol * np.minimum(whole, 10 * reports.scale), tol * whole - ROUND_OFF * reports.scale)
    settled = reports.curve <= np.minimum(max(ASTRAY, ASTRAY_SHARE * tol**0.5), max(CURVE * tol**0.5, 1e-14)) * size
    return (reports.error <= target) & settled
