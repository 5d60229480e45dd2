"""The functional of a form on a space of piecewise polynomials: value, gradient, Hessian.

The unknowns are the free coefficients of the curve followed by the unknown
numbers of the form; the side conditions are the isoperimetric equalities
followed by the equations of the ends. CasADi supplies only the pointwise
derivatives of the integrands, all in one mapped call; the rest is a few
matrix products.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.ritz.element import OneElement
from varcalc.numerics.mesh import Space, basis_at_gauss
from varcalc.problem.lagrangian import Lagrangian
from varcalc.symbolic.buffered import BufferedCall
from varcalc.symbolic.derived import derived


@lru_cache(maxsize=64)
def _products(smoothness: int, degree: int, count: int, order: int) -> np.ndarray:
    """Products of all pairs of local functions and derivatives at the Gauss points.

    Shape (P^2, (order + 1)^2 count), the factor of a local matrix:
    entry (i P + j, (d D + e) count + q) is B_d[q, i] B_e[q, j].
    """
    table = basis_at_gauss(smoothness, degree, count, order)
    pairs = np.einsum("dqi,eqj->ijdeq", table, table)
    return np.ascontiguousarray(pairs.reshape((degree + 1) ** 2, -1))


@dataclass
class Evaluation:
    """The discrete functional and its derivatives at one point.

    ``value`` is what is minimised, ``scale`` the sum of the absolute
    contributions (the size of round-off), ``conditions`` the side conditions,
    zero on admissible curves, ``legendre`` the least eigenvalue of L_y'y' (of the highest slope) over
    all points. ``gradient`` and ``jacobian`` are for the free unknowns.
    """

    value: float
    scale: float
    conditions: np.ndarray
    gradient: np.ndarray
    jacobian: np.ndarray
    legendre: float
    pointwise: np.ndarray
    ends: list[np.ndarray] | None


@dataclass
class Reported:
    """The reported integrand (m,), ordinates (n, m), and where they differ from the form's own: dy/ds, x, dx/ds."""

    integrand: np.ndarray
    y: np.ndarray
    dy: np.ndarray | None = None
    x: np.ndarray | None = None
    dx: np.ndarray | None = None


class RitzSystem:
    """A form discretised on ``space`` with ``count`` Gauss points an element."""

    def __init__(self, form: Form, space: Space, count: int) -> None:
        self.form, self.space, self.count = form, space, count
        self.order, self.n = form.order, form.n
        self.extra = len(form.unknown_guess)
        self.equalities = [c for c in form.integrals if c.equality]
        self.levels = np.array([c.lower for c in self.equalities])
        self.k = (self.order + 1) * self.n + self.extra
        self._fix()
        self._wire()

    def _fix(self) -> None:
        """Which coefficients are free, and the values of the others."""
        self.fixed = np.full(self.space.size, np.nan)
        last = self.space.elements
        marks: list[tuple[int, np.ndarray]] = [(0, self.form.fixed_start), (last, self.form.fixed_end)]
        for at, demanded in self.form.waypoints:
            vertex = int(np.argmin(np.abs(self.space.vertices - at)))
            marks.append((vertex, np.array([[np.nan if v is None else v for v in demanded]])))
        for vertex, values in marks:
            for k in range(values.shape[0]):
                for a in range(self.n):
                    if not np.isnan(values[k, a]):
                        number = self.space.vertex_number(vertex, k, a)
                        self.fixed[number] = values[k, a] * self.space.vertex_scale**k
        self.free = np.flatnonzero(np.isnan(self.fixed))
        self.fixed = np.nan_to_num(self.fixed)
        self.size = len(self.free) + self.extra

    def _wire(self) -> None:
        """The mapped pointwise function on buffers of its own, so that a call costs microseconds."""
        points = self.space.elements * self.count
        x, weights = self.space.quadrature(self.count)
        self.weights = weights.ravel()
        parameters = self.form.problem.parameter_values
        acceleration = self.n if self.order == 2 else 0
        self._arguments = [
            np.ascontiguousarray(x.ravel()),
            np.zeros((points, self.n)),
            np.zeros((points, self.n)),
            np.zeros((points, acceleration)),
            np.tile(parameters, (points, 1)),
            np.zeros((points, self.extra)),
        ]
        self._out = np.zeros((points, (1 + len(self.equalities)) * (1 + self.k + self.k**2)))
        self._pointwise = BufferedCall(pointwise(self.form).map(points), self._arguments, self._out)
        self.single: OneElement | None = None
        if self.space.elements == 1 and not self.space.periodic:
            self.single = OneElement(self.space, self.count, self.order, self.free, self.fixed, self.extra)
        self._slope_scale = [(2.0 / self.space.widths[:, None, None]) ** d for d in range(self.order + 1)]

    # unknowns <-> coefficients

    def pack(self, coefficients: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
        """Free coefficients and unknown numbers as one vector."""
        return np.concatenate([coefficients[self.free], unknowns])

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """All coefficients, fixed ones included, of the unknowns ``z``."""
        c = self.fixed.copy()
        c[self.free] = z[: len(self.free)]
        return c

    def unknowns(self, z: np.ndarray) -> np.ndarray:
        """The unknown numbers of the form in ``z``."""
        return z[len(self.free) :]

    def ordinates(self, z: np.ndarray) -> np.ndarray:
        """The curve at the quadrature points, shape (points, n)."""
        return self.space.at_quadrature(self.coefficients(z), self.count, 0)[0].reshape(-1, self.n)

    # evaluation

    def _fill(self, z: np.ndarray) -> None:
        """Put the curve of ``z`` into the arguments of the pointwise functions."""
        if self.single is not None:
            values, n = self.single.values(z), self.n
            for d in range(self.order + 1):
                self._arguments[1 + d][:] = values[:, d * n : (d + 1) * n]
            self._arguments[5][:] = values[:, (self.order + 1) * n :]
            return
        table = basis_at_gauss(self.space.smoothness, self.space.degree, self.count, self.order)
        local = self.space.local(self.coefficients(z))
        for d in range(self.order + 1):
            self._arguments[1 + d][:] = (self._slope_scale[d] * (table[d] @ local)).reshape(-1, self.n)
        if self.extra:
            self._arguments[5][:] = self.unknowns(z)

    def arguments(self, z: np.ndarray) -> list[np.ndarray]:
        """s, y, dy, ddy, parameters and unknowns at the quadrature points, one column a point."""
        self._fill(z)
        return [self._arguments[0][None, :], *(a.T.copy() for a in self._arguments[1:])]

    def reported(self, z: np.ndarray) -> Reported:
        """What is reported of a curve at the quadrature points, in the person's coordinates."""
        self._fill(z)
        form = self.form
        out = self._reporter()
        if form.lifted is None:
            return Reported(out[:, 0], self._arguments[1].T.copy())
        n = form.problem.n
        return Reported(out[:, 0], out[:, 2 : 2 + n].T, out[:, 3 + n :].T, out[:, 1], out[:, 2 + n])

    @cached_property
    def _reporter(self) -> Callable[[], np.ndarray]:
        """The reported functional and the lifted curve at the points last filled in."""
        function, points = reported(self.form), len(self.weights)
        out = np.zeros((points, function.size1_out(0)))
        call = BufferedCall(function.map(points), self._arguments, out)

        def run() -> np.ndarray:
            call()
            return out.copy()

        return run

    def evaluate(self, z: np.ndarray) -> Evaluation:
        """Everything but the Hessian's assembly; entries are inf or NaN outside the domain."""
        self._fill(z)
        self._pointwise()
        out = self._out.copy()
        stride = 1 + self.k + self.k**2
        with np.errstate(invalid="ignore", over="ignore"):
            values = self.weights @ out[:, ::stride]
            scale = float(self.weights @ np.abs(out[:, 0]))
            rows = [
                self.assembled_gradient(out[:, j * stride + 1 : j * stride + 1 + self.k]) for j in range(len(values))
            ]
        if self.form.one_sided and (self._arguments[1][:, self.form.one_sided] < 0).any():
            values[0] = np.inf
        conditions = values[1:] - self.levels
        value, gradient, jacobian = float(values[0]), rows[0], np.array(rows[1:]).reshape(len(rows) - 1, self.size)
        ends = None
        if self.form.ends is not None:
            ends = self._evaluate_ends(z)
            value += float(ends[0][0, 0])
            scale += abs(float(ends[0][0, 0]))
            where = self._end_positions()
            np.add.at(gradient, where[0], ends[1].ravel()[where[1]])
            conditions = np.concatenate([conditions, ends[2].ravel()])
            block = np.zeros((ends[2].size, self.size))
            for r in range(ends[2].size):
                np.add.at(block[r], where[0], ends[3][r][where[1]])
            jacobian = np.vstack([jacobian, block])
        return Evaluation(value, scale, conditions, gradient, jacobian, self._legendre(out), out, ends)

    def quadratic_size(self, z: np.ndarray) -> float:
        """The sum of the squares of y, its slopes and the unknown numbers, each times its own second derivative of L.

        A functional may be zero by cancellation of terms of this size, each with its round-off.
        """
        k = self.k
        pointwise = self.evaluate(z).pointwise
        values = np.hstack([self._arguments[d] for d in (*range(1, self.order + 2), 5)])
        diagonal = np.abs(pointwise[:, 1 + k : 1 + k + k * k : k + 1])
        return float(self.weights @ (diagonal * values**2).sum(1))

    def integrands(self, evaluation: Evaluation) -> np.ndarray:
        """The integrand and those of the levels at the quadrature points, shape (points, 1 + levels)."""
        return evaluation.pointwise[:, :: 1 + self.k + self.k**2]

    def assembled_gradient(self, rows: np.ndarray) -> np.ndarray:
        """The gradient in the free unknowns of an integral, from that of its integrand in (y, y', .., unknowns)."""
        weighted = rows * self.weights[:, None]
        if self.single is not None:
            return self.single.gradient(weighted)
        elements, n = self.space.elements, self.n
        table = basis_at_gauss(self.space.smoothness, self.space.degree, self.count, self.order)
        total = np.zeros((elements, self.space.degree + 1, n))
        for d in range(self.order + 1):
            part = weighted[:, d * n : (d + 1) * n].reshape(elements, self.count, n)
            total += self._slope_scale[d] * (table[d].T @ part)
        total *= self.space.local_scale[:, :, None]
        full = np.bincount(self.space.numbers.ravel(), total.ravel(), self.space.size)
        return np.concatenate([full[self.free], weighted[:, (self.order + 1) * n :].sum(0)])

    def _legendre(self, out: np.ndarray) -> float:
        """Least eigenvalue of the Hessian of the integrand in the highest slope over all points."""
        n, k = self.n, self.k
        hessian = out[:, 1 + k : 1 + k + k * k].reshape(-1, k, k)
        block = hessian[:, self.order * n : (self.order + 1) * n, self.order * n : (self.order + 1) * n]
        if not np.isfinite(block).all():
            return -np.inf
        if n == 1:
            return float(block.min())
        if n == 2:  # closed form of the lesser eigenvalue; eigvalsh costs a hundred times more
            half = 0.5 * (block[:, 0, 0] + block[:, 1, 1])
            gap = np.hypot(0.5 * (block[:, 0, 0] - block[:, 1, 1]), block[:, 0, 1])
            return float((half - gap).min())
        return float(np.linalg.eigvalsh(block).min())

    # Hessian

    def combined(self, evaluation: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Pointwise Hessian of integrand + sum lambda_j g_j, weighted; shape (points, k, k)."""
        k, stride = self.k, 1 + self.k + self.k**2
        out = evaluation.pointwise
        total = out[:, 1 + k : stride].copy()
        for j in range(len(self.equalities)):
            total += multipliers[j] * out[:, (j + 1) * stride + 1 + k : (j + 2) * stride]
        return (total * self.weights[:, None]).reshape(-1, k, k)

    def local_matrices(self, blocks: np.ndarray) -> np.ndarray:
        """Element matrices of a pointwise (weighted) quadratic form in (y, y', ..); (E, P n, P n)."""
        E, Q, n, D, P = self.space.elements, self.count, self.n, self.order + 1, self.space.degree + 1
        shaped = blocks.reshape(E, Q, D, n, D, n).transpose(0, 2, 4, 1, 3, 5)
        factor = np.empty((E, D, D, 1, 1, 1))
        for d in range(D):
            for e in range(D):
                factor[:, d, e, 0, 0, 0] = (2.0 / self.space.widths) ** (d + e)
        shaped = (shaped * factor).reshape(E, D * D * Q, n * n)
        local = _products(self.space.smoothness, self.space.degree, Q, self.order) @ shaped
        local = local.reshape(E, P, P, n, n).transpose(0, 1, 3, 2, 4)
        s = self.space.local_scale
        return (local * s[:, :, None, None, None] * s[:, None, None, :, None]).reshape(E, P * n, P * n)

    def hessian_parts(
        self, evaluation: Evaluation, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Hessian of the Lagrangian function: element matrices, border (coefficients, extra), corner."""
        n, D = self.n, self.order + 1
        combined = self.combined(evaluation, multipliers)
        local = self.local_matrices(combined[:, : D * n, : D * n])
        border, corner = np.zeros((self.space.size, self.extra)), np.zeros((self.extra, self.extra))
        if self.extra:
            table = basis_at_gauss(self.space.smoothness, self.space.degree, self.count, self.order)
            mixed = combined[:, : D * n, D * n :].reshape(self.space.elements, self.count, D, n, self.extra)
            for j in range(self.extra):
                total = sum(self._slope_scale[d] * (table[d].T @ mixed[:, :, d, :, j]) for d in range(D))
                total = total * self.space.local_scale[:, :, None]
                border[:, j] = np.bincount(self.space.numbers.ravel(), total.ravel(), self.space.size)
            corner = combined[:, D * n :, D * n :].sum(0)
        return local, border, corner

    def hessian(self, evaluation: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Dense Hessian of the Lagrangian function in the free unknowns."""
        if self.single is not None:
            full = self.single.hessian(self.combined(evaluation, multipliers))
        else:
            full = self.dense(*self.hessian_parts(evaluation, multipliers))
        return full if evaluation.ends is None else full + self._end_hessian(evaluation, multipliers)

    def dense(self, local: np.ndarray, border: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Assemble element matrices and a border into one dense matrix for the free unknowns."""
        size, free = self.space.size, len(self.free)
        numbers = self.space.numbers.reshape(self.space.elements, -1)
        if self.space.elements == 1 and not self.space.periodic:
            full = np.empty((size, size))
            full[np.ix_(numbers[0], numbers[0])] = local[0]
        else:
            flat = numbers[:, :, None] * size + numbers[:, None, :]
            full = np.bincount(flat.ravel(), local.ravel(), size * size).reshape(size, size)
        out = np.empty((self.size, self.size))
        out[:free, :free] = full[np.ix_(self.free, self.free)]
        out[:free, free:] = border[self.free]
        out[free:, :free] = border[self.free].T
        out[free:, free:] = corner
        return out

    def metric_blocks(self, evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """A positive pointwise (weighted) quadratic form, and a diagonal for the unknown numbers.

        It shifts a Newton step: an H^1 (H^2) product in which each function is
        weighted by its own L_y'y', so that units drop out; by the mean of its
        absolute value where that is not positive all along.
        """
        n, D, k = self.n, self.order + 1, self.k
        diagonal = np.einsum("qaa->qa", evaluation.pointwise[:, 1 + k : 1 + k + k * k].reshape(-1, k, k))
        weight = np.abs(diagonal[:, self.order * n : D * n])
        if evaluation.legendre <= 0.0:
            mean = self.weights @ weight / self.weights.sum()
            weight = np.where(mean > 0, mean, mean.max() if mean.max() > 0 else 1.0) * np.ones_like(weight)
        length = self.space.vertices[-1] - self.space.vertices[0]
        block = np.zeros((len(self.weights), D * n, D * n))
        for d in range(D):
            for a in range(n):
                block[:, d * n + a, d * n + a] = weight[:, a] * length ** (2.0 * (d - self.order)) * self.weights
        corner = np.abs(self.weights @ diagonal[:, D * n :])
        return block, np.diag(np.maximum(corner, 1e-12))

    def metric(self, evaluation: Evaluation) -> np.ndarray:
        """:meth:`metric_blocks` as a dense matrix of the size of the Hessian."""
        block, corner = self.metric_blocks(evaluation)
        return self.dense(self.local_matrices(block), np.zeros((self.space.size, self.extra)), corner)

    # ends

    def _end_positions(self) -> tuple[np.ndarray, np.ndarray]:
        """Places in z, and in (y_start, y_end, unknowns), of the end variables that are free."""
        last = self.space.elements
        numbers = [self.space.vertex_number(v, 0, a) for v in (0, last) for a in range(self.n)]
        place = {int(c): i for i, c in enumerate(self.free)}
        pairs = [(place[c], i) for i, c in enumerate(numbers) if c in place]
        pairs += [(len(self.free) + j, 2 * self.n + j) for j in range(self.extra)]
        rows = np.array(pairs, dtype=int).reshape(-1, 2)
        return rows[:, 0], rows[:, 1]

    def _evaluate_ends(self, z: np.ndarray) -> list[np.ndarray]:
        """End cost, its gradient, the end equations, their Jacobian, all Hessians, and the sizes of the equations."""
        form = self.form
        c = self.coefficients(z)
        first, last = (
            np.array([c[self.space.vertex_number(v, 0, a)] for a in range(self.n)]) for v in (0, self.space.elements)
        )
        out: Any = _at_ends(form)(first, last, self.unknowns(z), form.problem.parameter_values)
        found = [np.asarray(o) for o in out]
        # by how much each equation changes when its variables change by the size of the largest
        reach = np.abs(np.concatenate([first, last, self.unknowns(z)])).max(initial=0.0)
        sizes = np.abs(found[3]).max(1, initial=0.0) * reach
        return [*found, np.where(sizes > 0, sizes, 1.0)]

    def _end_hessian(self, evaluation: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        assert evaluation.ends is not None
        total = evaluation.ends[4].copy()
        for r in range(evaluation.ends[2].size):
            total += multipliers[len(self.equalities) + r] * evaluation.ends[5 + r]
        z, v = self._end_positions()
        out = np.zeros((self.size, self.size))
        out[np.ix_(z, z)] = total[np.ix_(v, v)]
        return out


@derived
def pointwise(form: Form) -> ca.Function:
    """The integrand and those of the prescribed integrals, with their derivatives: :meth:`.Lagrangian.pointwise`."""
    return Lagrangian(form.symbols, form.integrand).pointwise([c.expression for c in form.integrals if c.equality])


@derived
def integrands(form: Form) -> ca.Function:
    """The integrand and those of the prescribed integrals alone."""
    rows = [form.integrand, *(c.expression for c in form.integrals if c.equality)]
    return ca.Function("integrands", form.symbols.all, [ca.densify(ca.vertcat(*rows))])


@derived
def reported(form: Form) -> ca.Function:
    """The reported functional's integrand and, where the form is lifted, x, y, dx/ds, dy/ds."""
    outputs = [form.functional, *(form.lifted or ())]
    return ca.Function("reported", form.symbols.all, [ca.densify(ca.vertcat(*outputs))])


@derived
def _at_ends(form: Form) -> ca.Function:
    """The cost of the ends and their equations, with derivatives in (start, end, unknowns)."""
    assert form.ends is not None
    e, u = form.ends, form.symbols.unknowns
    v = ca.vertcat(e.start, e.end, u)
    conditions = ca.vertsplit(e.equations) if e.equations.numel() else []
    hessians = [ca.hessian(h, v)[0] for h in (e.cost, *conditions)]
    outputs = [e.cost, ca.gradient(e.cost, v), e.equations, ca.jacobian(e.equations, v), *hessians]
    return ca.Function("ends", [e.start, e.end, u, form.symbols.parameters], [ca.densify(o) for o in outputs])
