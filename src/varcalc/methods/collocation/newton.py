"""Newton's iteration for the stationarity conditions of a form: sizes, linear algebra, and what it may pass through."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from varcalc.methods.collocation.system import CollocationSystem, Residual
from varcalc.numerics.damped_newton import Ending, LinearisedEquations, damped_newton

NEWTON_ITERATIONS = 60
SPARSE_FROM = 160
"""Unknowns from which a sparse factorisation is faster than a dense one."""
BANDED_FROM = 48
"""The same for a banded one, where the equations of the interior are all there is."""
NULL_CONDITION = 1e-14
"""Reciprocal condition below which the null directions of a Jacobian are left out of a step."""

Solve = Callable[[np.ndarray], np.ndarray]


@dataclass
class Sizes:
    """The sizes in which corrections are measured: one for each unknown function and number.

    In one iteration they only ever grow, so that a curve on its way to zero keeps its unit.
    """

    functions: np.ndarray
    numbers: np.ndarray

    def grow(self, system: CollocationSystem, z: np.ndarray) -> bool:
        """Take the size of another curve into account; True when that changes anything."""
        state = system.unpack(z)
        size = np.abs(state.coefficients[system.at_vertices]).max((0, 1))
        larger = size > self.functions
        grown = bool(larger.any())
        if grown:
            self.functions = np.where(larger, size, self.functions)
        if len(state.unknowns):
            grown |= bool((np.abs(state.unknowns) > self.numbers).any())
            self.numbers = np.maximum(self.numbers, np.abs(state.unknowns))
        return grown

    def weights(self, system: CollocationSystem) -> np.ndarray:
        """Factors that turn a correction into relative changes; zero for multipliers, which enter linearly."""
        sizes = self.functions
        if sizes.min(initial=1.0) <= 0.0:
            sizes = np.where(sizes > 0, sizes, max(float(sizes.max(initial=0.0)), 1e-300))
        factor, function = system.sizes
        relative = factor / sizes[function]
        if system.size == len(relative):
            return relative
        out = np.zeros(system.size)
        out[: len(relative)] = relative
        count = system.counts.numbers
        # a number that is still zero has no size to be measured by
        known = np.flatnonzero(self.numbers[:count])
        out[len(relative) + known] = 1.0 / self.numbers[known]
        return out


@dataclass(frozen=True)
class Iterated:
    """Where an iteration ended; ``reason`` is empty when it converged."""

    z: np.ndarray
    residual: Residual
    iterations: int
    reason: str

    @property
    def converged(self) -> bool:
        """True when the last correction was negligible."""
        return not self.reason


def measure(weights: np.ndarray, step: np.ndarray) -> float:
    """Root mean square of the relative changes."""
    count = max(int(np.count_nonzero(weights)), 1)
    with np.errstate(over="ignore", invalid="ignore"):
        changes = weights * step
        return math.sqrt(float(changes @ changes) / count)


def factorised(
    system: CollocationSystem, residual: Residual, weights: np.ndarray, *, regular: bool = False
) -> Solve | None:
    """The inverse of the Jacobian, rows and columns scaled to one; None where it is not a matrix of numbers.

    None as well where it is to be ``regular`` and round-off alone tells it from a singular one.
    """
    columns = (
        1.0 / weights if weights.min() > 0.0 else np.divide(1.0, weights, np.ones_like(weights), where=weights > 0)
    )
    if system.plain and system.size >= BANDED_FROM and system.space.elements > 2:
        return _banded(system, residual, columns)
    if system.size >= SPARSE_FROM:
        return _sparse(system, residual, columns)
    matrix = system.dense(residual) * columns
    rows = np.abs(matrix).max(1)
    if not 0.0 < rows.min() <= rows.max() < math.inf:
        return None
    matrix /= rows[:, None]
    heights = np.abs(matrix).max(0)
    heights[heights == 0.0] = 1.0
    matrix /= heights
    inverse = _eliminated(matrix)
    if inverse is None and regular:
        return None
    inverse = inverse or _pseudo_inverse(matrix)
    scale = columns / heights
    return lambda b: scale * inverse(b / rows)


def _solver(matrix: np.ndarray) -> Solve:
    """The solution of linear equations: by elimination, by the pseudo-inverse where they are singular."""
    return _eliminated(matrix) or _pseudo_inverse(matrix)


def _pseudo_inverse(matrix: np.ndarray) -> Solve:
    inverse = np.linalg.pinv(matrix, rcond=NULL_CONDITION)
    return lambda b: inverse @ b


def _eliminated(matrix: np.ndarray) -> Solve | None:
    """The solution of linear equations by elimination; None where they are singular but for round-off."""
    from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

    # the transpose is what LAPACK takes without a copy
    factors, pivots, failed = dgetrf(matrix.T)
    if failed:
        return None
    condition, failed = dgecon(factors, float(np.abs(matrix).sum(1).max()))
    if failed or condition <= NULL_CONDITION:
        return None
    return lambda b: dgetrs(factors, pivots, b, trans=1)[0]


def _banded(system: CollocationSystem, residual: Residual, columns: np.ndarray) -> Solve | None:
    """The equations of the interior alone, element after element: a band about as wide as the degree."""
    from scipy.linalg.lapack import dgbtrf, dgbtrs

    i, j, values = system.triplets(residual)
    values = values * columns[j]
    below, above, starts = system.band
    rows = np.maximum.reduceat(np.abs(values), starts)
    if not 0.0 < rows.min() <= rows.max() < math.inf:
        return None
    band = np.zeros((system.size, 2 * below + above + 1))
    band[j, below + above + i - j] = values / rows[i]
    factors, pivots, failed = dgbtrf(band.T, below, above, overwrite_ab=1)
    if failed:  # exactly singular
        return None
    return lambda b: columns * dgbtrs(factors, below, above, b / rows, pivots)[0]


def _sparse(system: CollocationSystem, residual: Residual, columns: np.ndarray) -> Solve | None:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    i, j, values = system.triplets(residual)
    if not np.isfinite(values).all():
        return None
    values = values * columns[j]
    rows = np.zeros(system.size)
    np.maximum.at(rows, i, np.abs(values))
    if rows.min() == 0.0:
        return None
    matrix = csc_array((values / rows[i], (i, j)), shape=(system.size, system.size))
    try:
        factors = splu(matrix)
    except RuntimeError:  # exactly singular
        return None
    return lambda b: columns * factors.solve(b / rows)


def start_multipliers(system: CollocationSystem, z: np.ndarray, residual: Residual) -> np.ndarray:
    """The multipliers that make the residual of a starting curve least, in the sense of least squares."""
    linear = system.linear
    if len(linear) == 0:
        return z
    jacobian = system.dense(residual)[:, linear]
    used = np.abs(jacobian).max(1, initial=0.0) > 0
    if not np.isfinite(jacobian).all():
        return z
    change = np.linalg.lstsq(jacobian[used], -residual.rows[used], rcond=None)[0]
    out = z.copy()
    out[linear] += change
    return out


class _Conditions:
    """The stationarity conditions of a system, as :func:`damped_newton` takes them.

    Points are refused beyond which the Legendre condition, where it held at
    the start, does not: there lies another branch, or the edge of the
    Lagrangian's domain.
    """

    def __init__(self, system: CollocationSystem, scales: Sizes, first: Residual) -> None:
        # a copy: an iteration that runs away must not blow up the unit of those that follow
        self.system, self.scales = system, replace(scales)
        self._measure: Callable[[np.ndarray], float] | None = None
        self._guarded = first.legendre > 0.0 and system.counts.levels == 0

    def evaluate(self, z: np.ndarray) -> Residual | None:
        """The residual at unknowns ``z`` (N,); None where it is no number or beyond the Legendre condition."""
        residual = self.system.evaluate(z)
        return residual if residual.finite and not (self._guarded and residual.legendre <= 0.0) else None

    def linearised(self, z: np.ndarray, at: Residual) -> LinearisedEquations[Residual]:
        """The linear equations of a step from ``z`` (N,), and how corrections are measured."""
        measured = self._measure
        if measured is None or not self.system.still:
            grown = self.scales.grow(self.system, z)
            if measured is None or grown:
                self._measure = measured = self._measured()
        solve = factorised(self.system, at, self._weights)
        return LinearisedEquations(lambda point: None if solve is None else -solve(point.rows), measured)

    def _measured(self) -> Callable[[np.ndarray], float]:
        """:func:`measure` with the scales as they are."""
        self._weights = weights = self.scales.weights(self.system)
        share = 1.0 / max(int(np.count_nonzero(weights)), 1)

        def measured(step: np.ndarray) -> float:
            changes = weights * step
            return math.sqrt(share * float(changes @ changes))

        return measured


REASONS = {
    Ending.CONVERGED: "",
    Ending.SINGULAR: "the linearised conditions are singular",
    Ending.DAMPED_OUT: "no step along the Newton direction brings the conditions nearer",
    Ending.TOO_MANY: f"no convergence within {NEWTON_ITERATIONS} iterations",
}


def stationary(system: CollocationSystem, z: np.ndarray, scales: Sizes, residual: Residual | None = None) -> Iterated:
    """Iterate from ``z``, where the residual may be known, to a root of the system."""
    residual = system.evaluate(z) if residual is None else residual
    if not residual.finite:
        return Iterated(z, residual, 0, "the Euler-Lagrange equation is not a number on the starting curve")
    with np.errstate(all="ignore"):  # trial curves may lie far off; what is no number is rejected
        result = damped_newton(_Conditions(system, scales, residual), z, residual, NEWTON_ITERATIONS)
    return Iterated(result.z, result.at, result.iterations, REASONS[result.ending])


def index(system: CollocationSystem, z: np.ndarray, residual: Residual) -> int:
    """Number of directions in which the functional falls, as far as the mesh can tell.

    The Jacobian is the accessory (Jacobi) operator in its strong form; what is
    counted are its eigenvalues below zero, on the conditions' null space. A
    count on a coarse mesh is a hint, not a verdict.
    """
    if system.size >= SPARSE_FROM or _convex(system, residual):
        return 0
    matrix, mass = system.dense(residual), np.zeros((system.size, system.size))
    rows, columns, values = system.mass_triplets(z)
    mass[rows, columns] = values
    heights = np.abs(matrix).max(1)
    if not 0.0 < heights.min() <= heights.max() < math.inf:
        return 0
    operator = _solver(matrix / heights[:, None])(mass / heights[:, None])
    if not np.isfinite(operator).all():
        return 0
    inverse = np.linalg.eigvals(operator)
    tiny = 1e-12 * np.abs(inverse).max(initial=0.0)
    return int(np.count_nonzero((inverse.real < -tiny) & (np.abs(inverse.imag) <= 0.1 * np.abs(inverse.real))))


def _convex(system: CollocationSystem, residual: Residual) -> bool:
    """True when the second variation, the integral of P h'^2 + Q h^2, is positive by the least P and Q alone.

    The integral of h'^2 is at least (pi / length)^2 times that of h^2 (Wirtinger). The linearised Euler-Lagrange
    expression Q h - (P h')' shows Q as its derivative by y.
    """
    form = system.form
    if system.counts.functions != 1 or not system.plain or form.order != 1:
        return False
    wave = math.pi / (form.span[1] - form.span[0])
    return residual.legendre > 0.0 and residual.legendre * wave**2 + float(residual.interior[:, 2].min()) > 0.0
