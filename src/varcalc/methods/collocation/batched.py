"""Collocation at many neighbouring parameter values at once, begun from solutions that are known.

What a solve of its own asks of an answer is asked here of every value: a root, a correction in the next richer space
that is the error of the curve, a second one that is much smaller (see :mod:`.error`), and a second variation that is
positive. A value for which any of that is in doubt has no answer here; it is left to a solve of its own.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import Extremal, answer
from varcalc.methods.collocation.error import Correction, curve_distance, richer_degree, rounding, value_error
from varcalc.methods.collocation.system import CollocationSystem, Residual, collocation_space
from varcalc.methods.ritz.error import SOFT_MODE
from varcalc.methods.ritz.family import Answer, Answers
from varcalc.methods.ritz.system import Places
from varcalc.numerics.damped_newton import CONVERGED
from varcalc.numerics.mesh import basis_at_gauss, gauss
from varcalc.numerics.stacked import positive, solutions
from varcalc.problem.breaks import on_curve
from varcalc.solution import ErrorEstimate, Solution, Stats
from varcalc.symbolic.derived import derived

DEGREES = (10, 16, 25, 39)
"""Degrees that are climbed; each is followed by the one in which its error is told."""
BATCH_ITERATIONS = 8
FROM_AFAR = 12
"""Newton steps after which a value is left to a solve of its own, begun close to a solution and from straight lines."""
SHRINKING = 0.5
"""Each full step is to be shorter than the one before by this factor, else damping is called for."""


def applies(form: Form) -> bool:
    """Whether a form can be solved so: a first-order functional of one graph between fixed ends, nothing else asked."""
    graph = form.order == 1 and form.n == 1 and not form.stated.is_lifted and not any(form.coordinates.singular)
    fixed = not (np.isnan(form.ends.start).any() or np.isnan(form.ends.end).any())
    return graph and fixed and form.bare and not on_curve(form.problem) and not form.conditions.integrals


def system_at(form: Form, degree: int, places: Places) -> CollocationSystem:
    """The Euler-Lagrange equations of ``form`` at ``places``, collocated by one polynomial of a degree each."""
    return _on_one_element(form, degree).at(places)


@derived
def _on_one_element(form: Form, degree: int) -> CollocationSystem:
    return CollocationSystem(form, collocation_space(form, np.array(form.span), degree))


def straight_starts(form: Form, places: Places) -> tuple[np.ndarray, list[np.ndarray]]:
    """The first degree (K,) and the coefficients of straight lines between the ends."""
    space = collocation_space(form, np.array([0.0, 1.0]), DEGREES[0])
    coefficients = np.zeros((len(places.start), space.size))
    for end, values in ((0, places.start), (space.smoothness, places.end)):
        coefficients[:, space.numbers[0, end]] = values
        # a derivative at a vertex is counted in units of the interval
        coefficients[:, space.numbers[0, end + 1]] = places.end - places.start
    return np.full(len(coefficients), DEGREES[0]), list(coefficients)


def sampled(
    form: Form, places: Places, degree: int, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Abscissae (K, Q) between the ends, ordinates there and slopes, (K, Q, n), of curves given by coefficients."""
    system = system_at(form, degree, places)
    return system.along(coefficients, system.points)


def solution(form: Form, method: Any, found: Answer, seconds: float) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``."""
    space, nothing = collocation_space(form, np.array(form.span), found.degree), np.zeros(0)
    extremal = Extremal(
        form, space.curve(found.coefficients), nothing, space.vertices, nothing, {},
        coefficients=found.coefficients,
    )  # fmt: skip
    stats = Stats(0.0, seconds, found.iterations, space.size - 2 * form.n, 1, found.degree)
    error = ErrorEstimate(found.error, found.curve)
    return answer(extremal, method, form.sign * found.value, error, space.vertices, stats, rule=2 * found.degree + 4)


def solved(
    form: Form, places: Places, degrees: np.ndarray, starts: list[np.ndarray], tol: float, *, near: bool
) -> Answers:
    """The extremals at ``places`` from curves of ``degrees`` (K,) with the coefficients ``starts``.

    Where these are ``near`` to extremals few steps have to do.
    """
    answers = Answers.none(len(degrees))
    degrees, starts = degrees.copy(), list(starts)
    for degree, richer in pairwise((*DEGREES, richer_degree(DEGREES[-1]))):
        rows = np.flatnonzero(degrees == degree)
        if not len(rows):
            continue
        here = system_at(form, degree, places[rows])
        z = np.array([starts[row] for row in rows])[:, here.free]
        z, found, steps = _roots(here, z, BATCH_ITERATIONS if near else FROM_AFAR)
        answers.iterations[rows] += steps
        if found.any():
            onward = _judged(answers, rows[found], here.restricted(found), richer, z[found], tol)
            for row, coefficients in onward.items():
                degrees[row], starts[row] = richer, coefficients
    return answers


def _roots(system: CollocationSystem, z: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray, int]:
    """At ``most`` so many full Newton steps from ``z`` (K, N): the roots, where they are, and the steps taken."""
    z, done = z.copy(), np.zeros(len(z), dtype=bool)
    rows, before = np.arange(len(z)), np.full(len(z), np.inf)
    for iteration in range(1, most + 1):
        at = system.evaluate(z[rows])
        step = -solutions(system.dense(at), at.rows)
        length = np.nan_to_num(_lengths(system, step), nan=np.inf)
        settled = length <= CONVERGED
        good = settled | (length <= SHRINKING * before)
        good &= np.isfinite(length)
        z[rows[good]] += step[good]
        last = good & settled
        done[rows[last]] = True
        left = good & ~last
        rows, before, system = rows[left], length[left], system.restricted(left)
        if not len(rows):
            return z, done, iteration
    return z, done, most


def _lengths(system: CollocationSystem, steps: np.ndarray) -> np.ndarray:
    """Root mean square (K,) of the relative changes, as :func:`.newton.measure` has it.

    The unit of a function is its size at the ends, the length of the interval for one that is zero at both.
    """
    places = system.places
    assert places is not None
    sizes = np.maximum(np.abs(np.stack([places.start, places.end])).max(0), 1e-300)
    widths = np.diff(places.spans)
    units = np.where(sizes > 1e-200, sizes, np.maximum(sizes.max(1, keepdims=True), widths))
    factors, functions = system.sizes
    return np.sqrt(((steps * factors / units[:, functions]) ** 2).mean(1))


def _judged(
    answers: Answers, rows: np.ndarray, here: CollocationSystem, richer: int, z: np.ndarray, tol: float
) -> dict[int, np.ndarray]:
    """Enter the roots ``z`` that stand among the answers; those that a richer space would mend, with where to begin."""
    assert here.places is not None
    there, state = system_at(here.form, richer, here.places), here.unpack(z)
    start = there.pack(here.transferred(state, there))
    before = there.evaluate(start)
    jacobians = there.dense(before)
    step = -solutions(jacobians, before.rows)
    correction = Correction.of(
        start, step, there, lambda right: solutions(jacobians, right), lambda change: _lengths(there, change)
    )
    sure = correction.trusted & np.isfinite(correction.following) & correction.after.finite & _positive(before)
    value, corrected = here.fine_value(state, 2 * here.space.degree + 4), there.unpack(start + step)
    change = corrected.coefficients - there.unpack(start).coefficients
    beyond = there.space.left_out(change, here.space.degree, here.form.order)
    error = value_error(value, before.value, correction.after.value, rounding(there, before, np.zeros(0)), beyond)
    met = error <= tol * np.maximum(1.0, np.abs(value))
    stands = sure & met
    kept = rows[stands]
    answers.stands[kept], answers.value[kept], answers.error[kept] = True, value[stands], error[stands]
    distances = curve_distance(there, there.unpack(start), corrected)
    answers.curve[kept], answers.degree[kept] = distances[stands], here.space.degree
    for row, found in zip(kept, state.coefficients[stands], strict=True):
        answers.coefficients[row] = found
    onward = there.unpack(start + step + correction.simplified).coefficients
    return {int(rows[k]): onward[k] for k in np.flatnonzero(sure & ~met)}


def _positive(at: Residual) -> np.ndarray:
    """Where the second variation, the integral of P h'^2 + Q h^2, is positive and has no soft mode; (K,).

    The linearised Euler-Lagrange expression Q h - (P h')' shows P and Q; h are polynomials.
    """
    system = at.system
    assert system.places is not None
    widths, points = np.diff(system.places.spans), system.points
    derivatives = system.pointwise_jacobian(at)[:, :, 0]
    stiffness, inertia = derivatives[:, :, 0], -derivatives[:, :, 2]
    good = np.isfinite(inertia).all(1) & np.isfinite(stiffness).all(1) & (inertia.min(1) > 0.0)
    table = basis_at_gauss(1, points, points, 1)[:, :, 2:]  # slopes that the rule tells apart
    # no soft mode: positive with a part of the leading term, which weighs h on the interval's length, taken off
    first = (1.0 - SOFT_MODE) * inertia * (2.0 / widths) ** 2
    zeroth = stiffness - SOFT_MODE * inertia / widths**2
    terms = [table[d].T @ ((gauss(points)[1] * w)[good][:, :, None] * table[d]) for d, w in ((1, first), (0, zeroth))]
    good[good] = positive(terms[0] + terms[1])
    return good
