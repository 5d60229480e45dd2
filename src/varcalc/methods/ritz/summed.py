"""The discretised functional as CasADi expressions, summed up from pointwise derivatives.

Where nothing but the functional is asked for, its gradient and Hessian are the
pointwise ones between the matrices that take the unknowns to the Gauss points.
Handing these to IPOPT spares it the differentiation of the whole program,
which takes longer than its solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from varcalc.methods.ritz.assembly import OneElement
from varcalc.methods.ritz.integrands import pointwise
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import basis_at_gauss


@dataclass(frozen=True)
class Summed:
    """The value as an expression in ``unknowns``, and the ``options`` that give a solver its derivatives."""

    unknowns: Any
    value: Any
    options: dict[str, Any]


def summed_up(system: RitzSystem, scale: np.ndarray, size: float) -> Summed:
    """The functional of ``system`` in units of ``size``, its unknowns in units of ``scale`` (unknowns,)."""
    n, order, k, count = system.n, system.order, system.k, len(system.weights)
    w = ca.MX.sym("w", system.size)
    matrix, constant = _to_points(system)
    whole = ca.mtimes(matrix, ca.diag(ca.DM(scale)))
    variables = ca.reshape(ca.mtimes(whole, w) + constant, k, count)
    columns = [variables[d * n : (d + 1) * n, :] for d in range(order + 1)]
    columns += [] if order == 2 else [ca.MX(0, count)]
    parameters = np.repeat(system.form.problem.parameter_values[:, None], count, axis=1)
    s = system.space.quadrature(system.count)[0].reshape(1, -1)
    out = pointwise(system.form).map(count)(s, *columns, parameters, ca.MX(0, count))
    out = ca.mtimes(out, ca.diag(ca.DM(system.weights / size)))
    value = ca.sum2(out[0, :])
    blocks = ca.MX(_block_diagonal(count, k), ca.vec(out[1 + k :, :]))
    hessian = ca.mtimes(whole.T, ca.mtimes(blocks, whole))
    p, lam_f, lam_g = ca.MX.sym("p", 0), ca.MX.sym("lam_f"), ca.MX.sym("lam_g", 0)
    gradient = ca.Function(
        "grad_f", [w, p], [value, ca.mtimes(whole.T, ca.vec(out[1 : 1 + k, :]))], ["x", "p"], ["f", "grad_f_x"]
    )
    second = ca.Function(
        "hess_lag", [w, p, lam_f, lam_g], [ca.triu(lam_f * hessian)],
        ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
    )  # fmt: skip
    return Summed(w, value, {"grad_f": gradient, "hess_lag": second})


@lru_cache(maxsize=64)
def _block_diagonal(count: int, k: int) -> ca.Sparsity:
    """``count`` dense blocks of k by k along the diagonal."""
    return ca.diagcat(*[ca.Sparsity.dense(k, k)] * count)


def _to_points(system: RitzSystem) -> tuple[ca.DM, np.ndarray]:
    """From the free coefficients to (y, y', ..) at all points, one point after the other: matrix and fixed part."""
    if isinstance(system.assembly, OneElement):
        return ca.DM(system.scale.reshape(-1, 1) * system.assembly.flat), system.offset.ravel()
    space, n = system.space, system.n
    table = basis_at_gauss(space.smoothness, space.degree, system.count, system.order)
    pairs = [placement(system, table, d) for d in range(system.order + 1)]
    # from derivatives, points, functions to points, derivatives, functions
    places = np.arange(len(pairs) * len(system.weights) * n).reshape(len(pairs), -1, n).transpose(1, 0, 2).ravel()
    matrix, constant = ca.vertcat(*(m for m, _ in pairs)), np.concatenate([c for _, c in pairs])
    return matrix[places.tolist(), :], constant[places]


def placement(system: RitzSystem, table: np.ndarray, derivative: int) -> tuple[ca.DM, np.ndarray]:
    """Sparse matrix from free coefficients to values at points of every element, and the fixed part.

    Rows run over elements, points, functions.
    """
    space, n = system.space, system.n
    factor = (2.0 / space.widths[:, None, None]) ** derivative * space.local_scale[:, None, :]
    entries = table[derivative][None] * factor
    E, Q, P = entries.shape
    values = np.broadcast_to(entries[:, :, :, None], (E, Q, P, n))
    rows = np.broadcast_to((np.arange(E * Q).reshape(E, Q)[:, :, None, None] * n + np.arange(n)), (E, Q, P, n))
    columns = np.broadcast_to(space.numbers[:, None], (E, Q, P, n))
    place = np.full(space.size, -1)
    place[system.free] = np.arange(len(system.free))
    free = place[columns] >= 0
    constant = np.zeros(E * Q * n)
    np.add.at(constant, rows[~free], values[~free] * system.fixed[columns[~free]])
    matrix = ca.DM.triplet(
        rows[free].tolist(), place[columns][free].tolist(), ca.DM(values[free]), E * Q * n, len(system.free)
    )
    return matrix, constant
