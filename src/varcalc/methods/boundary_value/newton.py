"""Newton's iteration for the stationarity conditions of a form: sizes, linear algebra, and what it may pass through."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from varcalc.methods.boundary_value.system import CollocationSystem, Residual
from varcalc.methods.damped_newton import Ending, Linearised, damped_newton

ITERATIONS = 60
SPARSE_FROM = 160
"""Unknowns from which a sparse factorisation is faster than a dense inverse."""
SINGULAR = 1e-14
"""Reciprocal condition below which the null directions of a Jacobian are left out of a step."""

Solve = Callable[[np.ndarray], np.ndarray]


@dataclass
class Scales:
    """The sizes in which corrections are measured: one for each unknown function and number.

    In one iteration they only ever grow, so that a curve on its way to zero keeps its unit.
    """

    functions: np.ndarray
    numbers: np.ndarray

    def grow(self, system: CollocationSystem, z: np.ndarray) -> None:
        """Take the size of another curve into account."""
        state = system.unpack(z)
        size = np.abs(state.coefficients[system.space.numbers[:, :: system.smoothness][:, :2]]).max((0, 1))
        self.functions = np.where(size > self.functions, size, self.functions)
        self.numbers = np.maximum(self.numbers, np.abs(state.unknowns))

    def weights(self, system: CollocationSystem) -> np.ndarray:
        """Factors that turn a correction into relative changes; zero for multipliers, which enter linearly."""
        sizes = np.where(self.functions > 0, self.functions, max(float(self.functions.max(initial=0.0)), 1e-300))
        factor, function = system.sizes
        out = np.zeros(system.size)
        out[: len(system.free)] = factor / sizes[function]
        count = system.counts.numbers
        # a number that is still zero has no size to be measured by
        known = np.flatnonzero(self.numbers[:count])
        out[len(system.free) + known] = 1.0 / self.numbers[known]
        return out


@dataclass(frozen=True)
class Outcome:
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
        return math.sqrt(float(np.sum((weights * step) ** 2)) / count)


def factorised(system: CollocationSystem, residual: Residual, weights: np.ndarray) -> Solve | None:
    """The inverse of the Jacobian, rows and columns scaled to one; None where it is not a matrix of numbers."""
    columns = np.where(weights > 0, 1.0 / np.where(weights > 0, weights, 1.0), 1.0)
    if system.size >= SPARSE_FROM:
        return _sparse(system, residual, columns)
    matrix = system.dense(residual) * columns
    rows = np.abs(matrix).max(1)
    if not (np.isfinite(rows).all() and rows.min() > 0.0):
        return None
    matrix /= rows[:, None]
    heights = np.abs(matrix).max(0)
    heights = np.where(heights > 0.0, heights, 1.0)
    inverse = _inverse(matrix / heights)
    return lambda b: columns / heights * (inverse @ (b / rows))


def _inverse(matrix: np.ndarray) -> np.ndarray:
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(matrix, rcond=SINGULAR)
    with np.errstate(over="ignore"):
        condition = np.abs(matrix).sum(1).max() * np.abs(inverse).sum(1).max()
    if not condition < 1.0 / SINGULAR:
        return np.linalg.pinv(matrix, rcond=SINGULAR)
    return inverse


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

    def __init__(self, system: CollocationSystem, scales: Scales, first: Residual) -> None:
        # a copy: an iteration that runs away must not blow up the unit of those that follow
        self.system, self.scales = system, replace(scales)
        self._guarded = first.legendre > 0.0 and system.counts.levels == 0

    def evaluate(self, z: np.ndarray) -> Residual | None:
        residual = self.system.evaluate(z)
        return residual if residual.finite and not (self._guarded and residual.legendre <= 0.0) else None

    def linearised(self, z: np.ndarray, at: Residual) -> Linearised[Residual]:
        self.scales.grow(self.system, z)
        weights = self.scales.weights(self.system)
        solve = factorised(self.system, at, weights)
        return Linearised(
            lambda point: None if solve is None else -solve(point.rows), lambda step: measure(weights, step)
        )


REASONS = {
    Ending.CONVERGED: "",
    Ending.SINGULAR: "the linearised conditions are singular",
    Ending.DAMPED_OUT: "no step along the Newton direction brings the conditions nearer",
    Ending.TOO_MANY: f"no convergence within {ITERATIONS} iterations",
}


def stationary(system: CollocationSystem, z: np.ndarray, scales: Scales) -> Outcome:
    """Iterate from ``z`` to a root of the system."""
    residual = system.evaluate(z)
    if not residual.finite:
        return Outcome(z, residual, 0, "the Euler-Lagrange equation is not a number on the starting curve")
    result = damped_newton(_Conditions(system, scales, residual), z, residual, ITERATIONS)
    return Outcome(result.z, result.at, result.iterations, REASONS[result.ending])


def index(system: CollocationSystem, z: np.ndarray, residual: Residual) -> int:
    """Number of directions in which the functional falls, as far as the mesh can tell.

    The Jacobian is the accessory (Jacobi) operator in its strong form; what is
    counted are its eigenvalues below zero, on the conditions' null space. A
    count on a coarse mesh is a hint, not a verdict.
    """
    if system.size >= SPARSE_FROM:
        return 0
    solve = factorised(system, residual, np.ones(system.size))
    if solve is None:
        return 0
    mass = np.zeros((system.size, system.size))
    rows, columns, values = system.mass_triplets(z)
    mass[rows, columns] = values
    operator = np.column_stack([solve(column) for column in mass.T])
    if not np.isfinite(operator).all():
        return 0
    inverse = np.linalg.eigvals(operator)
    tiny = 1e-12 * np.abs(inverse).max(initial=0.0)
    return int(np.count_nonzero((inverse.real < -tiny) & (np.abs(inverse.imag) <= 0.1 * np.abs(inverse.real))))
