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
from varcalc.methods.answer import SEEN_FORWARD, TURNED, Extremal, answer
from varcalc.methods.ritz.batch import Basis, Batch, Evaluated, Places, Steps, positive
from varcalc.methods.ritz.bends import bends
from varcalc.methods.ritz.degeneracy import SOFT as SOFT_MODE
from varcalc.methods.ritz.error import ASTRAY, ASTRAY_SHARE, CURVE, ROUND_OFF, SAFETY, SOFT, UNMOVED
from varcalc.methods.ritz.levelled import Levelled
from varcalc.methods.ritz.quadrature import RESOLVED, missed
from varcalc.methods.ritz.rungs import DEGREES
from varcalc.methods.ritz.system import quadrature_points
from varcalc.numerics.mesh import Space
from varcalc.solution import ErrorEstimate, Solution, Stats

BEYOND = 1.5
"""Share of the highest degree beyond which no answer is looked for on one element."""
ROUNDED = 1e-15
"""Step of a curve, relative in the metric, that the round-off of L's derivatives makes: slopes in units of L's own."""


@dataclass(frozen=True)
class Answer:
    """What was found for one value, see :class:`Answers`."""

    value: float
    error: float
    curve: float
    degree: int
    coefficients: np.ndarray
    iterations: int
    multipliers: np.ndarray


@dataclass(frozen=True)
class Answers:
    """What was found for ``K`` values, each entry of shape (K,) or one a value.

    ``stands`` tells where there is an answer; ``value`` is in the sense that is minimised, ``error`` and ``curve``
    are the claimed errors, ``degree`` and ``coefficients`` the curve in the form's coordinates, ``multipliers`` those
    of the prescribed integrals.
    """

    stands: np.ndarray
    value: np.ndarray
    error: np.ndarray
    curve: np.ndarray
    degree: np.ndarray
    coefficients: list[np.ndarray]
    iterations: np.ndarray
    multipliers: list[np.ndarray]

    @classmethod
    def none(cls, count: int) -> Answers:
        """No answer yet for ``count`` values."""
        blank = np.full(count, np.nan)
        whole = np.zeros(count, dtype=int)
        empty: list[np.ndarray] = [np.empty(0)] * count
        stands = np.zeros(count, dtype=bool)
        return cls(stands, blank, blank.copy(), blank.copy(), whole, empty, whole.copy(), empty.copy())

    def __getitem__(self, row: int) -> Answer:
        """The answer for one value, which has one."""
        return Answer(
            float(self.value[row]), float(self.error[row]), float(self.curve[row]), int(self.degree[row]),
            self.coefficients[row], int(self.iterations[row]), self.multipliers[row],
        )  # fmt: skip

    def enter(self, rows: np.ndarray, others: Answers) -> None:
        """Put the answers for some of the values in their places."""
        for name, own in vars(self).items():
            for row, new in zip(rows, getattr(others, name), strict=True):
                own[row] = new


def applies(form: Form) -> bool:
    """Whether a form can be solved so: a first-order functional of curves between ends, under levels at most."""
    if not all(c.equality for c in form.integrals) or (form.integrals and not form.same_functional):
        return False
    bare = not (form.pathwise or form.knots or form.waypoints or form.corners or form.refused)
    return form.order == 1 and bare and form.ends is None and not form.periodic and not len(form.unknown_guess)


def batch_of(form: Form, degree: int, places: Places) -> Batch:
    """The discretised functionals of a form, with the integrals that it prescribes."""
    return Levelled(form, degree, places) if form.integrals else Batch(form, degree, places)


def straight_starts(form: Form, places: Places) -> tuple[np.ndarray, list[np.ndarray]]:
    """The first degree (K,) and the coefficients of straight lines between the ends; what is free at both is zero."""
    degree = next(d for d in DEGREES[form.order] if d >= form.least_degree)
    start, end = (np.where(np.isnan(a), np.nan_to_num(b), a) for a, b in (places.ends, places.ends[::-1]))
    basis = Basis.of(form, degree)
    coefficients = np.zeros((len(start), basis.size))
    coefficients[:, basis.numbers[0]], coefficients[:, basis.numbers[1]] = start, end
    return np.full(len(start), degree), list(coefficients)


def solved(
    form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray], tol: float, *, near: bool
) -> Answers:
    """The minima at ``places`` from curves of ``degrees`` (K,) with the coefficients ``starts``.

    A start may be several curves, shape (W, size): the lowest of the minima they lead to is taken, if all of them do.
    Where these are ``near`` to minima and the functional is not convex there, something is wrong; but under prescribed
    integrals the lowest bend is tried beside them.

    ``form`` is the form of one of the values: its expressions serve all. The
    degree climbs where the error asks for it, to the one at which the
    decay of the coefficients promises that it suffices.
    """
    if near and form.integrals:
        starts, near = with_bends(form, places, degrees, starts), False
    answers = Answers.none(len(degrees))
    ladder = DEGREES[form.order]
    degrees, starts = degrees.copy(), list(starts)
    made: dict[int, Batch] = {}  # of all values
    for degree, richer in pairwise(ladder):
        rows = np.flatnonzero(degrees == degree)
        if not len(rows):
            continue
        if len(rows) < len(degrees):
            here, there = (batch_of(form, d, places[rows]) for d in (degree, richer))
        else:
            here = made[degree] if degree in made else batch_of(form, degree, places)
            there = made[richer] = batch_of(form, richer, places)
        z, multipliers, found, steps = _minima(here, [starts[row] for row in rows], shifting=not near)
        answers.iterations[rows] += steps
        rows = rows[found]
        if len(rows):
            trial = z[found], multipliers[found]
            climbing = _judged(answers, rows, here.restricted(found), there.restricted(found), trial, tol)
            for row, (following, coefficients) in climbing.items():
                degrees[row], starts[row] = following, coefficients
    return answers


def with_bends(form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray]) -> list[np.ndarray]:
    """Each start with the lowest bend that meets the levels beside it, as where nothing is known: shapes (2, size).

    What is nearest may have ceased to be the lowest.
    """
    lowest = min(DEGREES[form.order])
    batch = Levelled(form, lowest, places)
    first, last = batch.basis.numbers[:2]
    lines = np.zeros((len(degrees), batch.basis.size))
    for numbers, own, other in ((first, places.start, places.end), (last, places.end, places.start)):
        lines[:, numbers] = np.nan_to_num(np.where(np.isnan(own), other, own))
    bent = batch.coefficients(bends(batch, batch.of_degree(lines, lowest)).unknowns[:, 0])
    return [
        np.array([start, continued(form, arch, lowest, int(degree))])
        for start, arch, degree in zip(starts, bent, degrees, strict=True)
    ]


def continued(form: Form, coefficients: np.ndarray, degree: int, richer: int) -> np.ndarray:
    """The coefficients of the same curve in a space of higher degree."""
    here, there = Basis.of(form, degree), Basis.of(form, richer)
    out = np.zeros(there.size)
    out[there.numbers[: degree + 1]] = coefficients[here.numbers]
    return out


def _minima(here: Batch, starts: list[np.ndarray], *, shifting: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """The lowest minimum that the curves of each value lead to: unknowns, multipliers, where it is, the steps taken."""
    stacked = [np.atleast_2d(start) for start in starts]
    if all(len(start) == 1 for start in stacked):
        return here.minimise(here.of_degree(np.concatenate(stacked), here.degree), shifting=shifting)
    owner = np.repeat(np.arange(len(starts)), [len(start) for start in stacked])
    many = here.restricted(owner)
    z, multipliers, found, steps = many.minimise(
        many.of_degree(np.concatenate(stacked), here.degree), shifting=shifting
    )
    values = np.where(found, many.evaluate(z, multipliers).value, np.inf)
    order = np.lexsort((values, owner))
    lowest = order[np.searchsorted(owner[order], np.arange(len(starts)))]
    whole = np.bincount(owner, ~found, len(starts)) == 0
    return z[lowest], multipliers[lowest], whole, steps


def sampled(
    form: Form, places: Places, degree: int, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Abscissae (K, Q) between the ends, ordinates there and slopes, (K, Q, n), of curves given by coefficients."""
    batch = Batch(form, degree, places)
    variables = batch.variables(batch.of_degree(coefficients, degree))
    return batch.x, variables[:, :, : form.n], variables[:, :, form.n :]


def solution(form: Form, method: Any, found: Answer, seconds: float, build: float = 0.0) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``, and ``build`` before that."""
    vertices = np.array(form.span)
    evaluate = _space(form.span, found.degree, form.n).curve(found.coefficients)
    extremal = Extremal(form, evaluate, np.zeros(0), vertices, found.multipliers, {}, SEEN_FORWARD, found.coefficients)
    unknowns = len(Basis.of(form, found.degree).free)
    stats = Stats(build, seconds, found.iterations, unknowns, 1, found.degree)
    rule = quadrature_points(found.degree)
    error = ErrorEstimate(found.error, found.curve)
    return answer(extremal, method, form.sign * found.value, error, vertices, stats, rule=rule)


@lru_cache(maxsize=64)
def _space(span: tuple[float, float], degree: int, n: int) -> Space:
    return Space(np.array(span), degree, n)


def _judged(
    answers: Answers, rows: np.ndarray, here: Batch, there: Batch, trial: tuple[np.ndarray, np.ndarray], tol: float
) -> dict[int, tuple[int, np.ndarray]]:
    """Enter the minima of a ``trial`` that stand among the answers; for those to be mended, a degree and a start in it.

    The trial is the unknowns and the multipliers. See :func:`varcalc.methods.direct.error.estimate`, of which this is
    the case without conditions but for levels.
    """
    (z, multipliers), form = trial, here.form
    coefficients = here.coefficients(z)
    start = there.of_degree(coefficients, here.degree)
    at = there.evaluate(start, multipliers)
    soft = at.blocks - SOFT_MODE * there.leading(at)
    good = at.sound & (at.legendre > 0) & np.isfinite(soft).all((1, 2, 3))
    own, kept_levels = here.checked(z, multipliers) if form.same_functional else (at.value, at.met)
    good &= kept_levels
    # what is positive with a part of the leading term taken off has no soft mode, and is no saddle
    good[good] = positive(at[good].reduced(there.assembled(soft[good])))
    if not good.any():
        return {}
    if not good.all():
        rows, there, at, own = rows[good], there.restricted(good), at[good], own[good]
        coefficients, start, multipliers = coefficients[good], start[good], multipliers[good]
    steps = there.newton(at)
    size = 0.5 * there.squared(at, steps.change)
    sure = (size <= UNMOVED**2 * at.scale) | (steps.decrement >= SOFT * size)
    reports = _reports(there, start, steps, own, at)
    largest = np.maximum(np.abs(there.variables(start)[:, :, : form.n]).max((1, 2)), 1e-300)
    last = here.degree == DEGREES[form.order][-2]
    short = short_of(reports, largest, tol, size <= ROUNDED**2 * at.scale, last=last)
    enough = (short <= 1) & reports.resolved
    stands = sure & enough & reports.graph
    kept = rows[stands]
    answers.stands[kept], answers.value[kept] = True, reports.value[stands]
    answers.error[kept] = (reports.error + ROUND_OFF * reports.scale)[stands]
    answers.curve[kept], answers.degree[kept] = np.maximum(reports.curve, 4e-16 * largest)[stands], here.degree
    for row, coefficient, lambdas in zip(kept, coefficients[stands], multipliers[stands], strict=True):
        answers.coefficients[row], answers.multipliers[row] = coefficient, lambdas
    onward = there.coefficients(start + steps.change)
    if last:
        return {}
    unmet = np.flatnonzero(sure & ~enough)
    promising = {int(rows[k]): _promising(here, there, onward[k], float(short[k])) for k in unmet}
    return {row: found for row, found in promising.items() if found is not None}


@dataclass(frozen=True)
class Reports:
    """What is reported of trial curves, shapes (K,): see :class:`varcalc.methods.ritz.error.Estimate`.

    ``resolved`` tells that the rule was fine enough, ``graph`` that the curve does not turn back.
    """

    value: np.ndarray
    error: np.ndarray
    scale: np.ndarray
    curve: np.ndarray
    resolved: np.ndarray
    graph: np.ndarray


def _reports(there: Batch, z: np.ndarray, steps: Steps, own: np.ndarray, at: Evaluated) -> Reports:
    """Values and errors of the curves ``z``, which the steps mend; ``own`` is their value by the poorer rule."""
    form, moved = there.form, there.moved(steps.change)
    if form.plainly_reported:
        here = beyond = at.integrand[:, :, None]
    else:
        variables = there.variables(z)
        here, beyond = (there.reported(v) for v in (variables, variables + moved))
    levels = steps.multipliers @ there.levels
    if form.integrals:
        # the Lagrangian function of the mended multipliers is stationary to higher order than the functional
        here = beyond = here + (at.integrands * steps.multipliers[:, None]).sum(2)[:, :, None]
    value = (there.weights * here[:, :, 0]).sum(1) - levels
    missing = np.abs(steps.decrement) + np.abs(value - own)
    lengths = np.diff(there.places.spans, axis=1)[:, 0]
    scale = at.scale + np.abs(steps.multipliers) @ np.abs(there.levels)
    return reports_of(form, there.weights, moved[:, :, : there.n], lengths, here, beyond, missing, scale, levels)


def reports_of(
    form: Form,
    weights: np.ndarray,
    moved: np.ndarray,
    lengths: np.ndarray,
    here: np.ndarray,
    beyond: np.ndarray,
    missing: np.ndarray,
    scale: np.ndarray,
    levels: np.ndarray | float = 0.0,
) -> Reports:
    """The reports of curves over intervals of ``lengths`` (K,) from the rows ``here`` and, mended, ``beyond``.

    Rows are those of :meth:`Batch.reported`, (K, Q, rows); ``moved`` (K, Q, n) is by how much the functions are
    mended, ``missing`` (K,) by how much what is minimised is too high, ``scale`` (K,) the size of its contributions;
    ``levels`` (K,) are to be taken off the integrals of the first row.
    """
    n = form.problem.n
    values = (weights * here[:, :, 0]).sum(1) - levels
    error = missing
    if not form.same_functional:
        error, scale = np.abs(values - (weights * beyond[:, :, 0]).sum(1)), np.abs(values)
    if not form.stated.is_lifted:
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


def short_of(
    reports: Reports, size: Any, tol: float, rounded: np.ndarray | bool = False, *, last: bool = False
) -> np.ndarray:
    """The factor by which the curve or, its root, the value is worse than a climb asks; inf where round-off limits it.

    ``size`` is the largest ordinate of each curve, (K,) or a number. On the ``last`` rung no more is asked of a curve
    than that it settles. One whose correction is ``rounded``, made of round-off, gains nothing from a climb.
    """
    whole = np.maximum(1.0, np.abs(reports.value))
    target = np.minimum(tol * np.minimum(whole, 10 * reports.scale), tol * whole - ROUND_OFF * reports.scale)
    value = np.where(target > 0, np.sqrt(reports.error / np.where(target > 0, target, 1.0)), np.inf)
    astray = max(ASTRAY, ASTRAY_SHARE * tol**0.5)
    allowed = astray if last else min(astray, max(CURVE * tol**0.5, 1e-14))
    return np.where(rounded, value, np.maximum(value, reports.curve / (allowed * size)))


def _promising(here: Batch, there: Batch, onward: np.ndarray, short: float) -> tuple[int, np.ndarray] | None:
    """The degree at which a curve that is to be better by the factor ``short`` promises to be so, and the curve in it.

    It is taken to converge as the coefficients fall from the last that the
    poorer space has to those of the richer one, given by ``onward``. None where the degree is far
    beyond those of the ladder.
    """
    numbers, ladder = there.basis.numbers, DEGREES[here.form.order][:-1]
    sizes = np.abs(onward[numbers]).max(1)
    first, then = sizes[here.degree - 1 : here.degree + 1].max(), sizes[-2:].max()
    if not 0.0 < then < first:
        return there.degree, onward
    needed = here.degree + (there.degree - here.degree) * np.log(max(short, 1.0)) / np.log(first / then)
    if needed > BEYOND * ladder[-1]:
        return None
    degree = min((d for d in ladder if d >= max(needed, there.degree)), default=there.degree)
    return degree, continued(here.form, onward, there.degree, degree)
