"""The index from the Hessian of the discretised functional.

The number of its negative eigenvalues on the null space of the linearised
conditions is the index, once the space is rich enough to hold the variations
that lower the functional. Nothing here knows of Jacobi's equation: of the
extremal only the curve is used, the multipliers are found anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import Extremal, sample
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.numerics.mesh import Space, basis, lobatto
from varcalc.solution import Finding
from varcalc.verify.along_curve import TOUCHED_AT, at_limit
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.legendre import LegendreCondition
from varcalc.verify.verification import NULL, Index

EIGENVALUE_GAP = 1e3
"""Factor by which the other eigenvalues must exceed those that are zero."""
MODES = 240
"""Coefficients of the Ritz space on which the Hessian's signs are counted."""
SPACE_DEGREES = {1: (8, 40), 2: (9, 28)}
"""Lowest and highest degree of that space, by the order of the functional."""
FINE_DEGREES = {1: 5, 2: 5}
"""The lowest where the extremal's own mesh alone has that many coefficients."""
LEAST_WEIGHT = 1e-6
"""Least relative weight of a direction of the slope in the metric."""


@dataclass(frozen=True)
class RitzHessian(Check[Index]):
    """The index from the Hessian of the discretised functional."""

    name = "Ritz"

    def measure(self, candidate: Candidate) -> Index:
        """The index along the extremal."""
        own = candidate.own
        # where regularity alone decides at a singular end, the coordinates made for that are the better ones
        curve = own if own is not None and own.form.coordinates.weak_only else candidate.best or own
        return Index(None, 0, candidate.reason) if curve is None else index_by_ritz(curve)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """The index by this route, or why it is closed."""
        measured = candidate.measured(self)
        if candidate.measured(LegendreCondition()).leaves_open:
            route = "the Hessian of the discretised functional"
            yield measured.finding(route, f"{route} has {measured.index} negative eigenvalues")


def index_by_ritz(extremal: Extremal) -> Index:
    """The index as the number of negative eigenvalues of the Hessian on the conditions' null space."""
    # the expressions are differentiated by other checks too
    form = replace(extremal.form, coordinates=replace(extremal.form.coordinates, numbers=None))
    space = ritz_space(extremal)
    system = RitzSystem(form, space)
    coefficients = space.fit(lambda s: extremal.evaluate(s, 0))
    z = system.pack(coefficients, extremal.unknowns)
    with np.errstate(all="ignore"):
        at = system.evaluate(z)
        conditions, hessian = at.jacobian, np.zeros((system.size, system.size))
        if form.conditions.pathwise:
            rows, hessian = _pathwise(extremal, system)
            conditions = np.vstack([conditions, rows])
        known = _multipliers(at.gradient + _pathwise_gradient(extremal, system), at.jacobian)
        hessian = hessian + system.hessian(at, known)
        metric = _metric(system, at, known)
    if not (np.isfinite(hessian).all() and np.isfinite(conditions).all() and np.isfinite(metric).all()):
        return Index(None, 0, "the second derivatives of the Lagrangian are no numbers somewhere along the curve")
    try:
        values = _constrained_eigenvalues(hessian, metric, conditions)
    except np.linalg.LinAlgError:
        return Index(None, 0, "the Lagrangian depends on the slope in no way that gives variations a size")
    size = max(1.0, float(np.abs(np.median(values)))) if len(values) else 1.0
    null = np.abs(values) <= NULL * size
    # towards a singular end eigenvalues may pile up at zero: only what stands apart from the rest is a null direction
    apart = not (~null).any() or float(np.abs(values[~null]).min()) > EIGENVALUE_GAP * NULL * size
    return Index(int((values[~null] < 0).sum()), int(null.sum()) if apart else 0, "")


def _metric(system: RitzSystem, at: Evaluation, multipliers: np.ndarray) -> np.ndarray:
    """The product in which eigenvalues are taken: H^1 (H^2), each point weighted by its own H_y'y'.

    With a weight that follows H_y'y' where it tends to zero at a singular end, fewer eigenvalues pile up at zero.
    """
    n, D = system.n, system.order + 1
    hessian = system.combined(at, multipliers)
    top = slice(system.order * n, D * n)
    sizes, axes = np.linalg.eigh(hessian[:, top, top])
    weight = np.abs(sizes).max(1)
    sizes = np.maximum(np.abs(sizes), LEAST_WEIGHT * weight[:, None])
    length = system.space.vertices[-1] - system.space.vertices[0]
    block = system.metric_blocks(at)
    block[:, top, top] = (axes * sizes[:, None]) @ axes.transpose(0, 2, 1)
    for d in range(system.order):
        for a in range(d * n, (d + 1) * n):
            block[:, a, a] = weight * length ** (2.0 * (d - system.order))
    return system.assembled(block)


def ritz_space(extremal: Extremal) -> Space:
    """A space on the extremal's own mesh of some MODES coefficients."""
    form = extremal.form
    lowest, highest = SPACE_DEGREES[form.order]
    vertices = extremal.vertices
    share = MODES // (form.n * (len(vertices) - 1))
    lowest = lowest if share else FINE_DEGREES[form.order]
    degree = int(np.clip(share, max(lowest, form.coordinates.least_degree), highest))
    return Space(vertices, degree, form.n, form.order, form.ends.periodic)


def _multipliers(gradient: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    """The multipliers that make the discrete functional stationary, in the sense of least squares."""
    if not len(jacobian):
        return np.zeros(0)
    sizes = np.maximum(np.abs(jacobian).max(1), 1e-300)
    return np.linalg.lstsq((jacobian / sizes[:, None]).T, -gradient, rcond=None)[0] / sizes


def _constrained_eigenvalues(hessian: np.ndarray, metric: np.ndarray, conditions: np.ndarray) -> np.ndarray:
    """Eigenvalues of the Hessian relative to the metric on the conditions' null space, ascending."""
    import scipy.linalg

    factor = np.linalg.cholesky(metric)
    reduced = scipy.linalg.solve_triangular(factor, hessian, lower=True)
    reduced = scipy.linalg.solve_triangular(factor, reduced.T, lower=True)
    if len(conditions):
        rows = scipy.linalg.solve_triangular(factor, conditions.T, lower=True)
        left, sizes, _ = np.linalg.svd(rows)
        rank = int((sizes > 1e-10 * sizes.max(initial=0.0)).sum())
        free = left[:, rank:]
        reduced = free.T @ reduced @ free
    return np.linalg.eigvalsh(0.5 * (reduced + reduced.T))


def _pathwise(extremal: Extremal, system: RitzSystem) -> tuple[np.ndarray, np.ndarray]:
    """The linearised pathwise conditions at as many points as the space can follow, and their part of the Hessian."""
    form, space = extremal.form, system.space
    s = space.quadrature(system.count)[0].ravel()
    _, hessians = _pathwise_values(extremal, form, s)
    blocks = np.zeros((len(s), system.k, system.k))
    blocks[:, : 2 * form.n, : 2 * form.n] = hessians * system.weights[:, None, None]
    whole, extra = system.assembled(blocks), system.extra
    nodes = lobatto(space.degree)
    places = space.vertices[:-1, None] + 0.5 * space.widths[:, None] * (1 + nodes)
    gradients, _ = _pathwise_values(extremal, form, places.ravel())
    table = basis(form.order, space.degree, nodes, 1)
    rows = []
    shaped = gradients.reshape(space.elements, len(nodes), len(form.conditions.pathwise), 2, form.n)
    for e in range(space.elements):
        for q in range(len(nodes)):
            for r in range(len(form.conditions.pathwise)):
                row = np.zeros(space.size)
                scale = space.local_scale[e]
                for d in range(2):
                    factor = table[d, q] * scale * (2.0 / space.widths[e]) ** d
                    np.add.at(row, space.numbers[e], factor[:, None] * shaped[e, q, r, d])
                rows.append(np.concatenate([row[system.free], np.zeros(extra)]))
    active = _active(extremal, form, places.ravel()).reshape(-1)
    return np.array(rows)[active], whole


def _active(extremal: Extremal, form: Form, s: np.ndarray) -> np.ndarray:
    """Which pathwise conditions hold as equations at s (m,); shape (m, conditions)."""
    function = ca.Function("phi", form.symbols.all, [ca.vertcat(*(c.expression for c in form.conditions.pathwise))])
    values = np.asarray(function(*sample(extremal, s))).T
    equality = np.array([c.equality for c in form.conditions.pathwise])
    return equality | at_limit(values, form.conditions.pathwise, 10 * TOUCHED_AT)


def _pathwise_values(extremal: Extremal, form: Form, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients in (y, y') of the pathwise conditions (m, conditions, 2 n), and the Hessian of sum mu phi."""
    sy = form.symbols
    variables = ca.vertcat(sy.y, sy.dy)
    mu = sy.kind.sym("mu", len(form.conditions.pathwise))
    expressions = ca.vertcat(*(c.expression for c in form.conditions.pathwise))
    outputs = [ca.jacobian(expressions, variables), ca.hessian(ca.dot(mu, expressions), variables)[0]]
    function = ca.Function("paths", [*sy.all, mu], [ca.vec(ca.densify(o)) for o in outputs])
    forces = np.array([extremal.path.get(c.index, np.zeros_like)(s) for c in form.conditions.pathwise])
    out = function.call([*sample(extremal, s), forces])
    gradient, hessian = (np.asarray(v).T for v in out)
    k = 2 * form.n
    return gradient.reshape(len(s), k, -1).transpose(0, 2, 1), hessian.reshape(len(s), k, k)


def _pathwise_gradient(extremal: Extremal, system: RitzSystem) -> np.ndarray:
    """The gradient of the integral of sum mu phi in the free unknowns."""
    form = extremal.form
    if not form.conditions.pathwise:
        return np.zeros(system.size)
    s = system.space.quadrature(system.count)[0].ravel()
    gradients, _ = _pathwise_values(extremal, form, s)
    forces = np.array([extremal.path.get(c.index, np.zeros_like)(s) for c in form.conditions.pathwise])
    rows = np.einsum("jm,mjk->mk", forces, gradients)
    padded = np.zeros((len(s), system.k))
    padded[:, : 2 * form.n] = rows
    return system.assembly.gradient(padded * system.first)
