"""The direct method at many neighbouring parameter values at once, begun from solutions that are known.

What a solve of its own asks of an answer is asked here of every value: a
minimum where the Legendre condition holds, a Newton step in the next richer
space that settles and is the error, no soft mode of the second variation, a
rule that resolves the integrand, a curve that is a graph. A value for which
any of that is in doubt has no answer here; it is left to a solve of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.mesh import Space
from varcalc.methods.answer import TURNED, Extremal, answer
from varcalc.methods.direct.batch import Batch, Evaluated, Places, minimise, positive
from varcalc.methods.direct.degeneracy import SOFT as SOFT_MODE
from varcalc.methods.direct.error import ASTRAY, ASTRAY_SHARE, CURVE, ROUND_OFF, SAFETY, SOFT, UNMOVED
from varcalc.methods.direct.quadrature import RESOLVED, missed
from varcalc.methods.direct.rungs import DEGREES, quadrature_points
from varcalc.solution import ErrorEstimate, Solution, Stats

SEEN_FORWARD = np.ones(1)
"""A speed dx/ds for curves that have been seen not to turn back."""


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


def solution(form: Form, method: Any, answers: Answers, row: int, seconds: float, build: float = 0.0) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``, and ``build`` before that."""
    degree, coefficients = int(answers.degree[row]), answers.coefficients[row]
    space = Space(np.array(form.span), degree, form.n, form.order)
    extremal = Extremal(
        form, lambda s, k: space.evaluate(coefficients, s, k), np.zeros(0), space.vertices, np.zeros(0), {},
        SEEN_FORWARD, coefficients,
    )  # fmt: skip
    error = ErrorEstimate(float(answers.error[row]), float(answers.curve[row]))
    free = int(np.isnan(form.fixed_start[0]).sum() + np.isnan(form.fixed_end[0]).sum())
    stats = Stats(build, seconds, int(answers.iterations[row]), space.size - 2 * form.n + free, 1, degree)
    value, rule = form.sign * float(answers.value[row]), quadrature_points(degree)
    return answer(extremal, method, value, error, space.vertices, stats, rule=rule)


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
    met = _met(reports, largest, tol)
    stands = sure & met & reports.resolved & reports.graph
    kept = rows[stands]
    answers.stands[kept], answers.value[kept] = True, reports.value[stands]
    answers.error[kept] = (reports.error + ROUND_OFF * reports.scale)[stands]
    answers.curve[kept], answers.degree[kept] = np.maximum(reports.curve, 4e-16 * largest)[stands], here.degree
    for row, coefficient in zip(kept, coefficients[stands], strict=True):
        answers.coefficients[row] = coefficient
    onward = there.coefficients(start + step)
    return {int(rows[k]): onward[k] for k in np.flatnonzero(sure & ~met)}


@dataclass(frozen=True)
class _Reports:
    """What is reported of trial curves, shapes (K,): see :class:`varcalc.methods.direct.error.Estimate`.

    ``resolved`` tells that the rule was fine enough, ``graph`` that the curve does not turn back.
    """

    value: np.ndarray
    error: np.ndarray
    scale: np.ndarray
    curve: np.ndarray
    resolved: np.ndarray
    graph: np.ndarray


def _reports(there: Batch, z: np.ndarray, step: np.ndarray, own: np.ndarray, at: Evaluated) -> _Reports:
    """Values and errors of the curves ``z``, which the step mends; ``own`` is their value by the poorer rule."""
    form, n = there.form, there.form.problem.n
    variables = there.variables(z)
    here, beyond = (there.reported(v) for v in (variables, variables + there.moved(step)))
    values, beyond_values = ((there.weights * r[:, :, 0]).sum(1) for r in (here, beyond))
    decrement = -0.5 * np.einsum("kn,kn->k", step, at.gradient)
    if form.same_functional:
        error, scale = np.abs(decrement) + np.abs(at.value - own), at.scale
    else:
        error, scale = np.abs(values - beyond_values), np.abs(values)
    forward = np.ones_like(there.x)
    if form.lifted is None:
        move = there.moved(step)[:, :, : there.n]
    else:
        forward = here[:, :, 2 + n]
        slope = np.where(forward[:, :, None] != 0, here[:, :, 3 + n :] / forward[:, :, None], 0.0)
        move = beyond[:, :, 2 : 2 + n] - here[:, :, 2 : 2 + n] - slope * (beyond[:, :, 1:2] - here[:, :, 1:2])
    curve = SAFETY * np.abs(move).max((1, 2), initial=0.0)
    # a curve whose own parameter is not the abscissa may turn back in it
    width = (there.weights * forward).sum(1)
    graph = forward.min(1) >= -(1e-9 + TURNED * curve / width) * np.abs(forward).max(1)
    lengths = np.diff(there.places.spans, axis=1)[:, 0]
    resolved = missed(here[:, :, 0]) * 0.5 * lengths <= RESOLVED * scale
    return _Reports(values, SAFETY * error, scale, curve, resolved, graph)


def _met(reports: _Reports, size: np.ndarray, tol: float) -> np.ndarray:
    """Whether value and curve are as good as a climb asks of them, and not limited by round-off."""
    whole = np.maximum(1.0, np.abs(reports.value))
    target = np.minimum(tol * np.minimum(whole, 10 * reports.scale), tol * whole - ROUND_OFF * reports.scale)
    settled = reports.curve <= np.minimum(max(ASTRAY, ASTRAY_SHARE * tol**0.5), max(CURVE * tol**0.5, 1e-14)) * size
    return (reports.error <= target) & settled
