"""The direct method at many neighbouring parameter values at once, begun from solutions that are known.

What a solve of its own asks of an answer is asked here of every value: a
minimum where the Legendre condition holds, a Newton step in the next richer
space that settles and is the error, no soft mode of the second variation, a
rule that resolves the integrand, a curve that is a graph. A value for which
any of that is in doubt has no answer here; it is left to a solve of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import SEEN_FORWARD, Extremal, answer, speed_error, unsettled, with_ends
from varcalc.methods.ritz.error import (
    CURVE,
    PANEL_MISS,
    SOFT,
    SOFT_MODE,
    UNMOVED,
    NewtonEstimate,
    correction,
    missed,
)
from varcalc.methods.ritz.method import DEGREES, first_degree
from varcalc.methods.ritz.newton import Minima, QuadraticModel, minima, sound
from varcalc.methods.ritz.starts import bends
from varcalc.methods.ritz.system import Places, RitzSystem, least_eigenvalue, quadrature_points
from varcalc.numerics.mesh import Space, on_one_element
from varcalc.numerics.stacked import positive, solutions
from varcalc.problem.breaks import on_curve
from varcalc.solution import ErrorEstimate, Solution, Stats

ONE_ELEMENT_SHARE = 1.5
"""Share of the highest degree beyond which no answer is looked for on one element."""
STEP_ROUND_OFF = 1e-15
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
    levels = form.conditions.integrals
    if levels and not (form.same_functional and all(c.equality for c in levels)):
        return False
    return form.order == 1 and form.bare and not on_curve(form.problem)


def system_at(form: Form, degree: int, places: Places) -> RitzSystem:
    """The functional of a form on polynomials of a degree, at many places."""
    return RitzSystem(form, on_one_element(*form.span, degree, form.n), places=places)


def straight_starts(form: Form, places: Places) -> tuple[np.ndarray, list[np.ndarray]]:
    """The first degree (K,) and the coefficients of straight lines between the ends; what is free at both is zero."""
    degree = first_degree(form)
    return np.full(len(places.start), degree), list(_lines(on_one_element(*form.span, degree, form.n), places))


def _lines(space: Space, places: Places) -> np.ndarray:
    coefficients = np.zeros((len(places.start), space.size))
    for vertex, own, other in zip(space.numbers[0], places.ends, places.ends[::-1], strict=False):
        coefficients[:, vertex] = np.nan_to_num(np.where(np.isnan(own), other, own))
    return coefficients


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
    if near and form.conditions.integrals:
        starts, near = _with_bends(form, places, degrees, starts), False
    answers = Answers.none(len(degrees))
    degrees, starts = degrees.copy(), list(starts)
    made: dict[int, RitzSystem] = {}  # of all values
    for degree, richer in pairwise(DEGREES[form.order]):
        rows = np.flatnonzero(degrees == degree)
        if not len(rows):
            continue
        if len(rows) < len(degrees):
            here, there = (system_at(form, d, places[rows]) for d in (degree, richer))
        else:
            here = made[degree] if degree in made else system_at(form, degree, places)
            there = made[richer] = system_at(form, richer, places)
        trial = _minima(here, [starts[row] for row in rows], shifting=not near)
        answers.iterations[rows] += trial.iterations
        found = trial.found
        if found.any():
            climbing = _judged(answers, rows[found], here.restricted(found), there.restricted(found), trial[found], tol)
            for row, (following, coefficients) in climbing.items():
                degrees[row], starts[row] = following, coefficients
    return answers


def _with_bends(form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray]) -> list[np.ndarray]:
    """Each start with the lowest bend that meets the levels beside it, as where nothing is known: shapes (2, size).

    What is nearest may have ceased to be the lowest.
    """
    lowest = min(DEGREES[form.order])
    system = system_at(form, lowest, places)
    bent = system.coefficients(bends(system, _lines(system.space, places)[:, system.free]).unknowns[:, 0])
    return [
        np.array([start, _continued(form, arch, lowest, int(degree))])
        for start, arch, degree in zip(starts, bent, degrees, strict=True)
    ]


def _continued(form: Form, coefficients: np.ndarray, degree: int, richer: int) -> np.ndarray:
    """The coefficients of the same curves in a space of higher degree."""
    return on_one_element(*form.span, degree, form.n).prolonged(
        coefficients, on_one_element(*form.span, richer, form.n)
    )


def _minima(here: RitzSystem, starts: list[np.ndarray], *, shifting: bool) -> Minima:
    """The lowest minimum that the curves of each value lead to, found where all of them lead to one."""
    stacked = [np.atleast_2d(start) for start in starts]
    owner = np.repeat(np.arange(len(starts)), [len(start) for start in stacked])
    trial = minima(here.restricted(owner), np.concatenate(stacked)[:, here.free], shifting=shifting)
    if len(owner) == len(starts):
        return trial
    order = np.lexsort((np.where(trial.found, trial.value, np.inf), owner))
    lowest = trial[order[np.searchsorted(owner[order], np.arange(len(starts)))]]
    return replace(lowest, found=np.bincount(owner, ~trial.found, len(starts)) == 0)


def sampled(
    form: Form, places: Places, degree: int, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Abscissae (K, Q) between the ends, ordinates there and slopes, (K, Q, n), of curves given by coefficients."""
    system = system_at(form, degree, places)
    variables = system.variables(coefficients[:, system.free])
    return system.x, variables[:, :, : form.n], variables[:, :, form.n :]


def solution(form: Form, method: Any, found: Answer, seconds: float) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``."""
    vertices = np.array(form.span)
    evaluate = on_one_element(*form.span, found.degree, form.n).curve(found.coefficients)
    extremal = Extremal(form, evaluate, np.zeros(0), vertices, found.multipliers, {}, SEEN_FORWARD, found.coefficients)
    fixed = np.logical_not(np.isnan([form.ends.start[0], form.ends.end[0]]))
    stats = Stats(0.0, seconds, found.iterations, found.coefficients.size - int(fixed.sum()), 1, found.degree)
    rule = quadrature_points(found.degree)
    error = ErrorEstimate(found.error, found.curve)
    return answer(extremal, method, form.sign * found.value, error, vertices, stats, rule=rule)


def _judged(
    answers: Answers, rows: np.ndarray, here: RitzSystem, there: RitzSystem, trial: Minima, tol: float
) -> dict[int, tuple[int, np.ndarray]]:
    """Enter the minima of a ``trial`` that stand among the answers; for those to be mended, a degree and a start in it.

    See :func:`varcalc.methods.ritz.error.estimate`.
    """
    form, n = here.form, here.n
    coefficients = here.coefficients(trial.z)
    z = here.space.prolonged(coefficients, there.space)[:, there.free]
    at = there.evaluate(z)
    curvature = there.combined(at, trial.multipliers)
    leading = there.leading(curvature)
    good = sound(there, at) & (least_eigenvalue(curvature[:, :, n:, n:]) > 0.0) & np.isfinite(curvature).all((1, 2, 3))
    model = QuadraticModel(at, there.hessian(at, trial.multipliers))
    # what is positive with a part of the leading term taken off has no soft mode, and is no saddle
    good[good] = positive(model.null.reduced(there.assembled(curvature - SOFT_MODE * leading))[good])
    steps = model.step(-solutions(model.reduced, model.slope))
    found = correction(there, z, at, steps.change, steps.multipliers, steps.decrement, trial.value, here.space.degree)
    size = 0.5 * there.squared(at, found.moved)
    good &= (size <= UNMOVED**2 * at.scale) | (steps.decrement >= SOFT * size)
    largest = np.maximum(np.abs(at.variables[:, :, :n]).max((1, 2)), 1e-300)
    last = here.space.degree == DEGREES[form.order][-2]
    short = _short_of(found, largest, tol, size <= STEP_ROUND_OFF**2 * at.scale, last=last)
    unresolved = missed(found.integrand) * 0.5 * there.lengths > PANEL_MISS * found.scale
    enough = (short <= 1) & ~unresolved
    stands = good & enough & _forwards(there, found)
    kept = rows[stands]
    answers.stands[kept], answers.value[kept] = True, found.value[stands]
    answers.error[kept], answers.degree[kept] = (found.error + found.floor)[stands], here.space.degree
    answers.curve[kept] = np.maximum(found.curve, 4e-16 * largest)[stands]
    for row, coefficient, lambdas in zip(kept, coefficients[stands], steps.multipliers[stands], strict=True):
        answers.coefficients[row], answers.multipliers[row] = coefficient, lambdas
    if last:
        return {}
    onward = there.coefficients(z + steps.change)
    promising = {
        int(rows[k]): _promising(here.space.degree, there, onward[k], float(short[k]))
        for k in np.flatnonzero(good & ~enough)
    }
    return {row: found for row, found in promising.items() if found is not None}


def _forwards(system: RitzSystem, found: NewtonEstimate) -> Any:
    """Where the curve does not turn back in the abscissa, which is not its own parameter; (K,) of bool."""
    if not system.form.stated.is_lifted:
        return True
    forward = with_ends(system.x, found.here.dx, system.form.span)
    return forward.min(1) >= -speed_error(found.value, found.error) * np.abs(forward).max(1)


def _short_of(found: NewtonEstimate, size: np.ndarray, tol: float, rounded: np.ndarray, *, last: bool) -> np.ndarray:
    """The factor by which the curve or, its root, the value is worse than a climb asks; inf where round-off limits it.

    ``size`` (K,) is the largest ordinate of each curve. On the ``last`` rung no more is asked of a curve
    than that it settles. One whose correction is ``rounded``, made of round-off, gains nothing from a climb.
    """
    whole = np.maximum(1.0, np.abs(found.value))
    target = np.minimum(tol * np.minimum(whole, 10 * found.scale), tol * whole - found.floor)
    value = np.where(target > 0, np.sqrt(found.error / np.where(target > 0, target, 1.0)), np.inf)
    astray = unsettled(tol)
    allowed = astray if last else min(astray, max(CURVE * tol**0.5, 1e-14))
    return np.where(rounded, value, np.maximum(value, found.curve / (allowed * size)))


def _promising(poorer: int, there: RitzSystem, onward: np.ndarray, short: float) -> tuple[int, np.ndarray] | None:
    """The degree at which a curve that is to be better by the factor ``short`` promises to be so, and the curve in it.

    It is taken to converge as the coefficients fall from the last that the
    space of the ``poorer`` degree has to those of the richer one, given by ``onward``. None where the degree is far
    beyond those of the ladder.
    """
    degree, ladder = there.space.degree, DEGREES[there.form.order][:-1]
    sizes = np.abs(onward[there.space.numbers[0]]).max(1)
    first, then = sizes[poorer - 1 : poorer + 1].max(), sizes[-2:].max()
    if not 0.0 < then < first:
        return degree, onward
    needed = poorer + (degree - poorer) * np.log(max(short, 1.0)) / np.log(first / then)
    if needed > ONE_ELEMENT_SHARE * ladder[-1]:
        return None
    following = min((d for d in ladder if d >= max(needed, degree)), default=degree)
    return following, _continued(there.form, onward, degree, following)
