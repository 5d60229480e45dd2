"""Newton steps for many elements: cost linear in their number.

The coefficients are numbered along the mesh, so the Hessian is banded but for
a border of the unknown numbers and the side conditions. It is factored by
banded Cholesky and the border eliminated (bordered systems: Govaerts,
"Numerical Methods for Bifurcations of Dynamical Equilibria", sect. 3.4); by
Haynsworth's inertia formula the small Schur complement tells whether the
Hessian is positive on the conditions' null space.
"""

from __future__ import annotations

import numpy as np

from varcalc.methods.ritz.system import Evaluation, RitzSystem

SHIFTS = (0.0, 1e-8, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)
"""Multiples of the metric added until the model is convex."""


def bands(system: RitzSystem, local: np.ndarray) -> np.ndarray:
    """Element matrices as the lower bands of the matrix in the free coefficients; (width, free)."""
    place = np.full(system.space.size, -1)
    place[system.free] = np.arange(len(system.free))
    numbers = place[system.space.numbers.reshape(system.space.elements, -1)]
    rows = np.broadcast_to(numbers[:, :, None], local.shape)
    columns = np.broadcast_to(numbers[:, None, :], local.shape)
    keep = (rows >= columns) & (columns >= 0)
    below, across = (rows - columns)[keep], columns[keep]
    width, count = int(below.max()) + 1, len(system.free)
    flat = np.bincount(below * count + across, local[keep], width * count)
    return flat.reshape(width, count)


def solvable(system: RitzSystem) -> bool:
    """Whether the banded route applies: several elements, no wrap-around, no cost or equation that couples the ends."""
    return system.space.elements > 1 and not system.space.periodic and system.form.ends is None


def banded_step(
    system: RitzSystem, at: Evaluation, multipliers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, float] | None:
    """Change of the unknowns, new multipliers, predicted decrease and shift; None when no shift makes it convex."""
    import scipy.linalg

    local, border, corner = system.parts(system.combined(at, multipliers))
    free, extra, count = len(system.free), system.extra, len(at.conditions)
    matrix = bands(system, local)
    metric, metric_corner = _metric_bands(system, at)
    small = np.zeros((extra + count, extra + count))
    small[:extra, extra:] = at.jacobian[:, free:].T
    small[extra:, :extra] = at.jacobian[:, free:]
    sides = np.column_stack([border[system.free], at.jacobian[:, :free].T])
    right = np.column_stack([-at.gradient[:free], sides])
    below = np.concatenate([-at.gradient[free:], -at.conditions])
    for shift in SHIFTS:
        try:
            factor = scipy.linalg.cholesky_banded(matrix + shift * metric, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
        solved = scipy.linalg.cho_solve_banded((factor, True), right, check_finite=False)
        small[:extra, :extra] = corner + shift * metric_corner
        schur = small - sides.T @ solved[:, 1:]
        eigenvalues = np.linalg.eigvalsh(schur) if len(schur) else np.zeros(0)
        if (eigenvalues < 0).sum() != count or not np.isfinite(solved).all():
            continue
        tail = np.linalg.solve(schur, below - sides.T @ solved[:, 0]) if len(schur) else np.zeros(0)
        change = np.concatenate([solved[:, 0] - solved[:, 1:] @ tail, tail[:extra]])
        new = tail[extra:]
        # half the squared length of the step in the Hessian, from the first row of the system
        slope = at.gradient + new @ at.jacobian if count else at.gradient
        return change, new, -0.5 * float(change @ slope), shift
    return None


def _metric_bands(system: RitzSystem, at: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    blocks, corner = system.metric_blocks(at)
    whole = np.zeros((*blocks.shape[:-2], system.k, system.k))
    whole[:, : blocks.shape[1], : blocks.shape[2]] = blocks
    return bands(system, system.parts(whole)[0]), corner
