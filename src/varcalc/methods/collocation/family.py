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
from varcalc.methods.collocation.error import CONTRACTION, EPSILON, NEGLIGIBLE, ROUNDING, SAFETY, richer_degree
from varcalc.methods.collocation.stationarity import stationarity
from varcalc.methods.collocation.system import Numbering, one_element
from varcalc.methods.ritz.batch import Places, positive
from varcalc.methods.ritz.degeneracy import SOFT
from varcalc.methods.ritz.family import Answer, Answers
from varcalc.numerics.damped_newton import CONVERGED
from varcalc.numerics.mesh import Space, basis_at_gauss, gauss
from varcalc.solution import ErrorEstimate, Solution, Stats
from varcalc.symbolic.columns import FewOrMany
from varcalc.symbolic.derived import derived

DEGREES = (10, 16, 25, 39)
"""Degrees that are climbed; each is followed by the one in which its error is told."""
ITERATIONS = 8
FROM_AFAR = 12
"""Newton steps after which a value is left to a solve of its own, begun close to a solution and from straight lines."""
SHRINKING = 0.5
"""Each full step is to be shorter than the one before by this factor, else damping is called for."""
SMOOTHNESS = 2


def applies(form: Form) -> bool:
    """Whether a form can be solved so: a first-order functional of one graph between fixed ends, nothing else asked."""
    bare = not (form.integrals or form.pathwise or form.knots or form.waypoints or form.corners or form.refused)
    plain = bare and form.ends is None and not form.periodic and not len(form.unknown_guess)
    fixed = not (np.isnan(form.fixed_start).any() or np.isnan(form.fixed_end).any())
    return form.order == 1 and form.n == 1 and plain and fixed and not any(form.singular) and not form.stated.is_lifted


@derived
def _interior(form: Form) -> FewOrMany:
    return FewOrMany(stationarity(form).interior)


class Batch:
    """The Euler-Lagrange equations of ``form`` at K ``places``, collocated by one polynomial of one degree each."""

    def __init__(self, form: Form, degree: int, places: Places) -> None:
        self.form, self.degree, self.places, self.n = form, degree, places, form.n
        self.points = degree + 1 - SMOOTHNESS
        self.table, self.scale = _tables(degree)
        space = Space(np.array([0.0, 1.0]), degree, self.n, SMOOTHNESS)
        self.numbers = space.numbers[0]
        held = np.zeros(space.size, dtype=bool)
        held[self.numbers[[0, SMOOTHNESS]]] = True
        self.numbering: Numbering = one_element(degree, self.n, SMOOTHNESS, held.tobytes())
        self.widths = places.spans[:, 1] - places.spans[:, 0]
        ends = np.stack([places.start, places.end], axis=1)
        self.sizes = np.maximum(np.abs(ends).max(1), 1e-300)

    def whole(self, z: np.ndarray) -> np.ndarray:
        """All coefficients (K, size), those of the ends included."""
        out = np.zeros((len(z), len(self.numbering.column)))
        out[:, self.numbers[0]], out[:, self.numbers[SMOOTHNESS]] = self.places.start, self.places.end
        out[:, self.numbering.free] = z
        return out

    def of_degree(self, coefficients: np.ndarray, degree: int) -> np.ndarray:
        """The unknowns of curves given by the coefficients (K, size) of a poorer degree, or of this one."""
        other = Space(np.array([0.0, 1.0]), degree, self.n, SMOOTHNESS).numbers[0]
        out = np.zeros((len(coefficients), len(self.numbering.column)))
        out[:, self.numbers[: degree + 1].ravel()] = coefficients[:, other.ravel()]
        return out[:, self.numbering.free]

    def restricted(self, rows: np.ndarray) -> Batch:
        """The batch of some of the values."""
        return self if rows.dtype == bool and rows.all() else Batch(self.form, self.degree, self.places[rows])

    def derivatives(self, z: np.ndarray, count: int, depth: int) -> np.ndarray:
        """The curves and their derivatives below ``depth`` at ``count`` Gauss points, (K, depth, count, n)."""
        local = self.whole(z)[:, self.numbers] * self.scale[:, None]
        table = basis_at_gauss(SMOOTHNESS, self.degree, count, SMOOTHNESS)[:depth]
        towers = table.reshape(depth * count, -1) @ local
        return towers.reshape(len(z), depth, count, self.n) * self._powers[:, :depth]

    @property
    def _powers(self) -> np.ndarray:
        return ((2.0 / self.widths)[:, None] ** np.arange(SMOOTHNESS + 1))[:, :, None, None]

    def abscissae(self, count: int) -> np.ndarray:
        """The Gauss points (K, count)."""
        return self.places.spans[:, :1] + 0.5 * self.widths[:, None] * (1 + gauss(count)[0])

    def evaluate(self, z: np.ndarray, count: int | None = None) -> np.ndarray:
        """What :class:`.stationarity.Stationarity` has of the interior, (K, points, rows)."""
        count = count or self.points
        towers = self.derivatives(z, count, SMOOTHNESS + 1)
        blank, total = np.zeros((1, 0)), len(z) * count
        columns = [towers[:, d].reshape(total, self.n) for d in range(SMOOTHNESS + 1)]
        parameters = np.repeat(self.places.parameters, count, axis=0)
        x = self.abscissae(count).reshape(-1, 1)
        out = _interior(self.form)(total, x, *columns, parameters, blank, blank, blank)
        return out.reshape(len(z), count, -1)

    def rows(self, at: np.ndarray) -> np.ndarray:
        """The residuals (K, N)."""
        return at[:, :, 1 : 1 + self.n].reshape(len(at), -1)

    def blocks(self, at: np.ndarray) -> np.ndarray:
        """Pointwise Jacobians by y, y' and y'', (K, points, n, 3, n)."""
        n = self.n
        return at[:, :, 1 + n :].reshape(*at.shape[:2], SMOOTHNESS + 1, n, n).transpose(0, 1, 4, 2, 3)

    def jacobians(self, at: np.ndarray) -> np.ndarray:
        """The Jacobians of the residuals, (K, N, N)."""
        n, P = self.n, self.degree + 1
        blocks = self.blocks(at) * self._powers[:, None, None, :, :, 0]
        towers = blocks.swapaxes(-1, -2) @ (self.table * self.scale)[:, None]
        flat = towers.swapaxes(-1, -2).reshape(len(at), self.points * n, P * n)
        return flat[:, :, self.numbering.local]

    def lengths(self, steps: np.ndarray) -> np.ndarray:
        """Root mean square (K,) of the relative changes, as :func:`.newton.measure` has it."""
        factors = np.zeros(len(self.numbering.column))
        factors[self.numbers] = self.scale[:, None]
        free = self.numbering.free
        relative = steps * factors[free] / self.units[:, self.numbering.functions]
        return np.sqrt((relative**2).mean(1))

    @property
    def units(self) -> np.ndarray:
        """The size (K, n) of each function, the length of the interval for one that is zero at both ends."""
        return np.where(self.sizes > 1e-200, self.sizes, np.maximum(self.sizes.max(1), self.widths)[:, None])

    def positive(self, at: np.ndarray) -> np.ndarray:
        """Where the second variation, the integral of P h'^2 + Q h^2, is positive and has no soft mode; (K,).

        The linearised Euler-Lagrange expression Q h - (P h')' shows P and Q; h are polynomials.
        """
        blocks = self.blocks(at)
        inertia, stiffness = -blocks[:, :, 0, 2, 0], blocks[:, :, 0, 0, 0]
        good = np.isfinite(inertia).all(1) & np.isfinite(stiffness).all(1) & (inertia.min(1) > 0.0)
        table = basis_at_gauss(1, self.points, self.points, 1)[:, :, 2:]  # slopes that the rule tells apart
        weights, per_length = gauss(self.points)[1], (2.0 / self.widths[:, None]) ** 2
        # no soft mode: positive with a part of the leading term, which weighs h on the interval's length, taken off
        first = (1.0 - SOFT) * inertia * per_length
        zeroth = stiffness - SOFT * inertia / self.widths[:, None] ** 2
        terms = [table[d].T @ ((weights * w)[good][:, :, None] * table[d]) for d, w in ((1, first), (0, zeroth))]
        good[good] = positive(terms[0] + terms[1])
        return good

    def values(self, z: np.ndarray) -> np.ndarray:
        """The functionals by a fine rule, (K,)."""
        count = 2 * self.degree + 4
        return self.integral(self.evaluate(z, count)[:, :, 0], count)

    def integral(self, densities: np.ndarray, count: int) -> np.ndarray:
        """The integrals (K,) of what is known at the Gauss points, (K, count)."""
        return 0.5 * self.widths * (densities @ gauss(count)[1])


def _tables(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """The basis at the collocation points, (points, derivatives, degree + 1), and factors from coefficients to it."""
    table = basis_at_gauss(SMOOTHNESS, degree, degree + 1 - SMOOTHNESS, SMOOTHNESS).transpose(1, 0, 2)
    return table, Space(np.array([0.0, 1.0]), degree, 1, SMOOTHNESS).local_scale[0]


def straight_starts(form: Form, places: Places) -> tuple[np.ndarray, list[np.ndarray]]:
    """The first degree (K,) and the coefficients of straight lines between the ends."""
    space = Space(np.array([0.0, 1.0]), DEGREES[0], form.n, SMOOTHNESS)
    coefficients = np.zeros((len(places.start), space.size))
    for end, values in ((0, places.start), (SMOOTHNESS, places.end)):
        coefficients[:, space.numbers[0, end]] = values
        # a derivative at a vertex is counted in units of the interval
        coefficients[:, space.numbers[0, end + 1]] = places.end - places.start
    return np.full(len(coefficients), DEGREES[0]), list(coefficients)


def sampled(
    form: Form, places: Places, degree: int, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Abscissae (K, Q) between the ends, ordinates there and slopes, (K, Q, n), of curves given by coefficients."""
    batch = Batch(form, degree, places)
    y, slopes = batch.derivatives(batch.of_degree(coefficients, degree), batch.points, 2).swapaxes(0, 1)
    return batch.abscissae(batch.points), y, slopes


def solution(form: Form, method: Any, found: Answer, seconds: float) -> Solution:
    """An answer as the Solution by ``method`` of the form's problem; it took ``seconds``."""
    space, nothing = Space(np.array(form.span), found.degree, form.n, SMOOTHNESS), np.zeros(0)
    extremal = Extremal(
        form, lambda s, k: space.evaluate(found.coefficients, s, k), nothing, space.vertices, nothing, {},
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
        here = Batch(form, degree, places[rows])
        z = here.of_degree(np.array([starts[row] for row in rows]), degree)
        z, found, steps = _roots(here, z, ITERATIONS if near else FROM_AFAR)
        answers.iterations[rows] += steps
        rows, z = rows[found], z[found]
        if len(rows):
            for row, coefficients in _judged(answers, rows, here.restricted(found), richer, z, tol).items():
                degrees[row], starts[row] = richer, coefficients
    return answers


def _roots(batch: Batch, z: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray, int]:
    """At ``most`` so many full Newton steps from ``z`` (K, N): the roots, where they are, and the steps taken."""
    z, done = z.copy(), np.zeros(len(z), dtype=bool)
    rows, before = np.arange(len(z)), np.full(len(z), np.inf)
    for iteration in range(1, most + 1):
        at = batch.evaluate(z[rows])
        good = np.isfinite(at.sum((1, 2)))
        step, length = _step(batch, at, good)
        settled = length <= CONVERGED
        good &= settled | (length <= SHRINKING * before)
        z[rows[good]] += step[good]
        last = good & settled
        done[rows[last]] = True
        left = good & ~last
        rows, before, batch = rows[left], length[left], batch.restricted(left)
        if not len(rows):
            return z, done, iteration
    return z, done, most


def _step(batch: Batch, at: np.ndarray, good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Newton's steps (K, N) and their lengths, infinite where there is none."""
    step, length = np.zeros((len(at), len(batch.numbering.free))), np.full(len(at), np.inf)
    if good.any():
        step[good] = -_solve(batch.restricted(good).jacobians(at[good]), batch.rows(at[good]))
        length[good] = batch.restricted(good).lengths(step[good])
    return step, np.where(np.isfinite(length), length, np.inf)


def _solve(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of linear equations (K, N), not numbers where one of the matrices is singular."""
    try:
        return np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)


def _judged(
    answers: Answers, rows: np.ndarray, here: Batch, richer: int, z: np.ndarray, tol: float
) -> dict[int, np.ndarray]:
    """Enter the roots ``z`` that stand among the answers; those that a richer space would mend, with where to begin.

    See :func:`varcalc.methods.boundary_value.error.assess`, of which this is the case of plain systems.
    """
    there = Batch(here.form, richer, here.places)
    coefficients = here.whole(z)
    start = there.of_degree(coefficients, here.degree)
    before = there.evaluate(start)
    jacobians = there.jacobians(before)
    step = -_solve(jacobians, there.rows(before))
    after = there.evaluate(start + step)
    simplified = -_solve(jacobians, there.rows(after))
    correction, smaller = there.lengths(step), there.lengths(simplified)
    trusted = (correction <= NEGLIGIBLE) | (smaller <= CONTRACTION * correction)
    sure = trusted & np.isfinite(smaller) & np.isfinite(after).all((1, 2)) & there.positive(before)
    value = here.values(z)
    coarse, fine = (there.integral(at[:, :, 0], there.points) for at in (before, after))
    floor = ROUNDING * EPSILON * there.integral(np.abs(before[:, :, 0]), there.points)
    error = SAFETY * (np.abs(fine - coarse) + np.abs(value - coarse)) + floor
    met = error <= tol * np.maximum(1.0, np.abs(value))
    stands = sure & met
    kept = rows[stands]
    answers.stands[kept], answers.value[kept], answers.error[kept] = True, value[stands], error[stands]
    answers.curve[kept], answers.degree[kept] = _distances(there, start, step)[stands], here.degree
    for row, found in zip(kept, coefficients[stands], strict=True):
        answers.coefficients[row] = found
    onward = there.whole(start + step + simplified)
    return {int(rows[k]): onward[k] for k in np.flatnonzero(sure & ~met)}


def _distances(batch: Batch, z: np.ndarray, step: np.ndarray) -> np.ndarray:
    """How far the steps move the curves, with the round-off of the ordinates; (K,)."""
    count = batch.points + 3
    old, new = (batch.derivatives(at, count, 1) for at in (z, z + step))
    return np.abs(new - old).max((1, 2, 3)) + ROUNDING * EPSILON * np.abs(old).max((1, 2, 3))
