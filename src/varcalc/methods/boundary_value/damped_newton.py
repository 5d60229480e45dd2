"""A damped Newton iteration for the stationarity conditions of a form.

Steps are accepted by the natural monotonicity test, which compares Newton
corrections and so does not depend on how the conditions are scaled (Deuflhard,
"Newton Methods for Nonlinear Problems", 2004, sect. 3.3, algorithm NLEQ-ERR),
and only as long as the Legendre condition, where it held at the start, keeps
holding: beyond lies another branch or the edge of the Lagrangian's domain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from varcalc.methods.boundary_value.system import CollocationSystem, Residual

CONVERGED = 1e-9
"""Relative correction after which one more step leaves only round-off."""
STALLED = 1e-7
"""Relative correction below which a failure to shrink is round-off."""
SMALLEST_DAMPING = 1e-6
ITERATIONS = 60
SPARSE_FROM = 160
"""Unknowns from which a sparse factorisation is faster than a dense inverse."""
SINGULAR = 1e-14
"""Reciprocal condition below which the null directions of a Jacobian are left out of a step."""

Solve = Callable[[np.ndarray], np.ndarray]


@dataclass
class Scales:
    """The sizes in which corrections are measured: one for each unknown function and number.

    They only ever grow, so that a curve on its way to zero keeps its unit.
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


def damped_newton(
    system: CollocationSystem, z: np.ndarray, scales: Scales, iterations: int = ITERATIONS, guarded: bool = True
) -> Outcome:
    """Iterate from ``z`` to a root of the system."""
    residual = system.evaluate(z)
    if not residual.finite:
        return Outcome(z, residual, 0, "the Euler-Lagrange equation is not a number on the starting curve")
    guard = guarded and residual.legendre > 0.0 and system.counts.levels == 0
    damping, before, iteration = 1.0, None, 0
    reason = f"no convergence within {iterations} iterations"
    while iteration < iterations:
        iteration += 1
        scales.grow(system, z)
        weights = scales.weights(system)
        solve = factorised(system, residual, weights)
        step = np.full(system.size, np.nan) if solve is None else -solve(residual.rows)
        length = measure(weights, step)
        if solve is None or not math.isfinite(length):
            reason = "the linearised conditions are singular"
            break
        if length <= CONVERGED:
            return _finish(system, z + step, Outcome(z, residual, iteration, ""))
        if before is not None:
            change = measure(weights, before[1] - step)
            damping = min(1.0, damping * before[0] * measure(weights, before[1]) / max(change * length, 1e-300))
        accepted = _search(system, z, step, length, damping, weights, solve, guard)
        if accepted is None:
            # a small correction is kept from shrinking by round-off, a large one by divergence
            reason = "" if length <= STALLED else "no step along the Newton direction brings the conditions nearer"
            break
        damping, z, residual, following = accepted
        if damping == 1.0 and measure(weights, following) <= CONVERGED:
            return _finish(system, z + following, Outcome(z, residual, iteration, ""))
        before = (length, following)
    return Outcome(z, residual, iteration, reason)


def _finish(system: CollocationSystem, z: np.ndarray, otherwise: Outcome) -> Outcome:
    residual = system.evaluate(z)
    return Outcome(z, residual, otherwise.iterations, "") if residual.finite else otherwise


def _search(
    system: CollocationSystem,
    z: np.ndarray,
    step: np.ndarray,
    length: float,
    damping: float,
    weights: np.ndarray,
    solve: Solve,
    guard: bool,
) -> tuple[float, np.ndarray, Residual, np.ndarray] | None:
    """The damping that passes the natural monotonicity test: with the point, its residual and next correction."""
    damping, grown = max(damping, SMALLEST_DAMPING), False
    while damping >= SMALLEST_DAMPING:
        trial = z + damping * step
        residual = system.evaluate(trial)
        if not residual.finite or (guard and residual.legendre <= 0.0):
            damping *= 0.5
            continue
        following = -solve(residual.rows)
        after = measure(weights, following)
        bent = measure(weights, following - (1.0 - damping) * step)
        proposed = 0.5 * length * damping**2 / max(bent, 1e-300)
        if not after < (1.0 - 0.25 * damping) * length:
            damping = min(proposed, 0.5 * damping) if math.isfinite(proposed) else 0.5 * damping
            continue
        proposed = min(1.0, proposed)
        if proposed >= 4.0 * damping and not grown:
            damping, grown = proposed, True
            continue
        return damping, trial, residual, following
    return None


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
