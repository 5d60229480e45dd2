"""What periodic ends add to the index: the concavity form on the Jacobi fields that return to where they began.

Klingenberg, "Riemannian Geometry", sect. 2.5; Bott, "On the iteration of closed
geodesics and the Sturm intersection theory", Comm. Pure Appl. Math. 9 (1956).
"""

from __future__ import annotations

import numpy as np

from varcalc.verify.accessory import Accessory
from varcalc.verify.jacobi import Canonical, balanced
from varcalc.verify.verification import NULL, signs

SYMMETRIC = 1e-6
"""Relative residual with which a motion of the whole curve is a null direction."""


def concavity(system: Canonical, accessory: Accessory) -> tuple[int, int]:
    """What periodicity adds to the index of curves held at their start, and the null directions no symmetry explains.

    For a quadratic form on E and a subspace F with the orthogonal complement
    F' (here the Jacobi fields with X(a) = X(b)) the index on E is that on F,
    and on F', and the dimension of what F and F' share less what is null in E.
    """
    N = system.N
    flow = np.eye(2 * N)
    for panel in system.panels:
        flow = panel(panel.right) @ flow
    allowed = system.allowed(np.array([system.span[0]]))
    basis = np.eye(N) if allowed is None else allowed[0]
    held = {*range(accessory.levels.start, accessory.levels.stop), accessory.gauge}
    numbers = {*range(accessory.numbers.start, accessory.numbers.stop)} - held
    J = _span(basis @ basis.T @ np.eye(N)[:, [k for k in range(N) if k not in held]])
    M = _span(basis @ basis.T @ np.eye(N)[:, [k for k in range(N) if k not in numbers]])
    closing = basis.T @ np.hstack([(flow[:N, :N] - np.eye(N)) @ J, flow[:N, N:] @ M])
    jump = np.hstack([flow[N:, :N] @ J, (flow[N:, N:] - np.eye(N)) @ M])
    fields = _kernel(closing)
    form = fields[: J.shape[1]].T @ J.T @ jump @ fields
    negative = signs(0.5 * (form + form.T))[0]
    shared = _kernel(closing[:, J.shape[1] :])
    periodic = _kernel(np.vstack([closing[:, J.shape[1] :], J.T @ jump[:, J.shape[1] :]]))
    equations = np.vstack([closing, J.T @ jump])
    null = _kernel(equations).shape[1]
    symmetric = _symmetries(equations, J, M, accessory)
    return negative + shared.shape[1] - periodic.shape[1], max(0, null - symmetric)


def _span(columns: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the span of the columns."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, sizes > 0.5]


def _kernel(matrix: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the null space, as columns."""
    _, sizes, right = np.linalg.svd(matrix)
    rank = int((sizes > NULL * max(1.0, float(sizes.max(initial=0.0)))).sum())
    return right[rank:].T


def _symmetries(equations: np.ndarray, J: np.ndarray, M: np.ndarray, accessory: Accessory) -> int:
    """How many null directions shift the curve along itself or move it as a whole (first order)."""
    along, n, N = accessory.along, accessory.along.n, accessory.N
    if along.order != 1:
        return 0
    start = along.span[0]
    mixed = accessory.coefficients(np.array([start])).S[0]
    fields = [np.concatenate([unit, np.pad(mixed @ unit, (0, N - n))]) for unit in np.eye(N)[:n]]
    state, momentum, _ = accessory.rates(start)
    state[accessory.levels] = 0.0
    fields.append(np.concatenate([state, momentum]))
    null = []
    for field in fields:
        scaled = balanced(accessory, field[:, None])[:, 0]
        pair = np.concatenate([J.T @ scaled[:N], M.T @ scaled[N:]])
        pair /= max(float(np.linalg.norm(pair)), 1e-300)
        if np.linalg.norm(equations @ pair) <= SYMMETRIC * np.abs(equations).max():
            null.append(pair)
    return int(np.linalg.matrix_rank(np.array(null), 1e-6)) if null else 0
