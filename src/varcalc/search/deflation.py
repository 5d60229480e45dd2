"""Newton's iteration kept away from the roots that are known: deflation.

With the known roots r the conditions F(z) = 0 are multiplied by
eta(z) = product of (1 + 1 / |z - r|^2), which has no root there. The Newton
step of eta F is that of F times 1 / (1 - grad(log eta) . step), a number, so
that nothing else about the iteration changes (Farrell, Birkisson, Funke,
"Deflation techniques for finding distinct solutions of nonlinear partial
differential equations", SIAM J. Sci. Comput. 37 (2015), with shift 1 and power 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from varcalc.methods.collocation.newton import SPARSE_FROM, Sizes, factorised, measure, stationary
from varcalc.methods.collocation.system import CollocationSystem

DEFLATED_ITERATIONS = 50
LONGEST_CORRECTION = 3.0
"""Largest step, in units of the curve's own size."""
BASIN_REACHED = 1e-3
"""Relative length of a step from which the ordinary iteration takes over: its basin is reached."""
SINGULAR_RATIO = 1e-11
"""Ratio of the least to the largest singular value of a Jacobian, rows and columns scaled, that counts as zero."""
SAME_UNKNOWNS = 1e-6
"""Relative distance of two roots that count as one."""


def deflated_newton(
    system: CollocationSystem, z: np.ndarray, known: Sequence[np.ndarray], scales: Sizes
) -> np.ndarray | None:
    """A root of ``system`` other than the ``known`` ones, from ``z``; None when none is reached."""
    for _ in range(DEFLATED_ITERATIONS):
        residual = system.evaluate(z)
        if not residual.finite:
            return None
        weights = scales.weights(system)
        solve = factorised(system, residual, weights)
        if solve is None:
            return None
        step = -solve(residual.rows)
        length = measure(weights, step)
        if not math.isfinite(length):
            return None
        factor = _factor(z, step, known, weights)
        if abs(factor - 1.0) < 0.5 and length < BASIN_REACHED:
            return _settled(system, z, known, scales)
        reach = abs(factor) * length
        z = z + factor * LONGEST_CORRECTION / max(reach, LONGEST_CORRECTION) * step
    return None


def _factor(z: np.ndarray, step: np.ndarray, known: Sequence[np.ndarray], weights: np.ndarray) -> float:
    """By how much deflation lengthens a Newton step; negative where it turns it round."""
    slope = 0.0
    for root in known:
        apart = z - root
        square = max(measure(weights, apart) ** 2, 1e-300)
        count = max(int(np.count_nonzero(weights)), 1)
        # the derivative of log(1 + 1 / d^2) along the step
        slope -= 2.0 * float(np.sum(weights**2 * apart * step)) / count / (square * (1.0 + square))
    return 1.0 / (1.0 - slope) if slope != 1.0 else 1.0


def _settled(system: CollocationSystem, z: np.ndarray, known: Sequence[np.ndarray], scales: Sizes) -> np.ndarray | None:
    """The root that the ordinary iteration ends at, unless it is a known one."""
    outcome = stationary(system, z, scales)
    if not outcome.converged or is_known(outcome.z, known, scales.weights(system)):
        return None
    return outcome.z


def is_known(z: np.ndarray, known: Sequence[np.ndarray], weights: np.ndarray) -> bool:
    """True when ``z`` is one of the ``known`` roots."""
    return any(measure(weights, z - root) <= SAME_UNKNOWNS for root in known)


def is_singular(system: CollocationSystem, z: np.ndarray) -> bool:
    """True when the conditions leave a direction open at a root: it is one of a continuum, or two in one."""
    if system.size >= SPARSE_FROM:
        return False
    matrix = system.dense(system.evaluate(z))
    for axis in (1, 0, 1):
        sizes = np.abs(matrix).max(axis, keepdims=True)
        matrix = matrix / np.where(sizes > 0.0, sizes, 1.0)
    if not np.isfinite(matrix).all():
        return False
    values = np.linalg.svd(matrix, compute_uv=False)
    return bool(values[-1] <= SINGULAR_RATIO * values[0])
