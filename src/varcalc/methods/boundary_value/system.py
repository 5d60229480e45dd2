"""The stationarity conditions of a form, collocated on a space of piecewise polynomials.

The Euler-Lagrange equation of order 2 m is collocated at the Gauss points of
each element by functions of class C^(2 m - 1), as many points as make the
system square (de Boor and Swartz, "Collocation at Gaussian points", SIAM J.
Numer. Anal. 10 (1973); Ascher, Mattheij and Russell, "Numerical Solution of
Boundary Value Problems for ODEs", ch. 5). Boundary conditions, corner
conditions, isoperimetric levels and the stationarity in unknown numbers are
further rows; multipliers are further unknowns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from varcalc.buffered import BufferedCall
from varcalc.formulation import Form, Sampled
from varcalc.mesh import Space, basis_at_gauss, gauss
from varcalc.methods.boundary_value.boundary import Boundary, BoundaryValues, Triplets
from varcalc.methods.boundary_value.stationarity import stationarity


def collocation_space(form: Form, vertices: np.ndarray, degree: int) -> Space:
    """The space in which a form is collocated on a mesh: 2 m - 1 times differentiable, broken at knots."""
    broken = tuple(int(np.argmin(np.abs(vertices - knot))) for knot in form.knots)
    return Space(vertices, degree, form.n, 2 * form.order, False, broken, form.order)


@dataclass(frozen=True)
class State:
    """A curve with its numbers: coefficients, unknown numbers and every multiplier.

    ``levels`` belong to the isoperimetric conditions, ``ends`` to the
    conditions on the end points, ``forces`` of shape (elements, points, paths)
    to the pathwise conditions at the collocation points.
    """

    coefficients: np.ndarray
    unknowns: np.ndarray
    levels: np.ndarray
    ends: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class Residual:
    """The conditions at one state: ``rows`` vanish on extremals.

    ``value`` is the functional by the rule of the collocation points, ``size``
    the integral of its absolute value, ``legendre`` the least eigenvalue of
    the Hessian of the Lagrangian function in the highest slope over all points.
    """

    rows: np.ndarray
    value: float
    size: float
    legendre: float
    interior: np.ndarray
    boundary: BoundaryValues

    @property
    def finite(self) -> bool:
        """True when every condition is a number."""
        return bool(np.isfinite(self.rows).all() and np.isfinite(self.interior).all())


class CollocationSystem:
    """A form collocated on ``space``; the unknowns are one vector z."""

    def __init__(self, form: Form, space: Space) -> None:
        self.form, self.space = form, space
        self.conditions = stationarity(form)
        self.counts = self.conditions.counts
        self.smoothness = 2 * form.order
        self.points = space.degree + 1 - self.smoothness
        self.levels = np.array([c.lower for c in form.integrals])
        self._where: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._fix()
        self._number()
        self._wire()

    # unknowns

    def _fix(self) -> None:
        """Which coefficients are free, and the values of the others."""
        self.fixed = np.full(self.space.size, np.nan)
        marks = [(0, self.form.fixed_start), (self.space.elements, self.form.fixed_end)]
        for at, demanded in self.form.waypoints:
            row = np.array([[np.nan if v is None else v for v in demanded]])
            marks.append((int(np.argmin(np.abs(self.space.vertices - at))), row))
        for vertex, values in marks:
            for k, a in zip(*np.nonzero(~np.isnan(values)), strict=True):
                number = self.space.vertex_number(vertex, int(k), int(a))
                self.fixed[number] = values[k, a] * self.space.vertex_scale ** int(k)
        self.free = np.flatnonzero(np.isnan(self.fixed))
        self.fixed = np.nan_to_num(self.fixed)

    def _number(self) -> None:
        """Where each kind of unknown lies in z, and where each kind of row in the residual."""
        c, places = self.counts, self.space.elements * self.points
        on_ends = c.equations + len(c.caps)
        sizes = [len(self.free), c.numbers, c.levels, on_ends, places * c.paths]
        cuts = [0, *map(int, np.cumsum(sizes))]
        self._columns = [slice(a, b) for a, b in pairwise(cuts)]
        self.size = cuts[-1]
        self.place = np.full(self.space.size, -1)
        self.place[self.free] = np.arange(len(self.free))
        self.boundary = Boundary(self.form, self.space, self.conditions, self.place, places * (c.functions + c.paths))
        self.first_integral = self.size - c.levels - c.numbers - on_ends

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """For each free coefficient, its factor in the local basis and the function it belongs to."""
        factor, function = np.zeros(self.space.size), np.zeros(self.space.size, dtype=int)
        factor[self.space.numbers] = self.space.local_scale[:, :, None]
        function[self.space.numbers] = np.arange(self.counts.functions)
        return factor[self.free], function[self.free]

    def pack(self, state: State) -> np.ndarray:
        """A state as one vector."""
        parts = [state.coefficients[self.free], state.unknowns, state.levels, state.ends, state.forces.ravel()]
        return np.concatenate(parts)

    def unpack(self, z: np.ndarray) -> State:
        """The state that a vector stands for."""
        c, cols = self.counts, self._columns
        coefficients = self.fixed.copy()
        coefficients[self.free] = z[cols[0]]
        forces = z[cols[4]].reshape(self.space.elements, self.points, c.paths)
        return State(coefficients, z[cols[1]], z[cols[2]], z[cols[3]], forces)

    @property
    def linear(self) -> np.ndarray:
        """Positions in z of the multipliers, which enter the conditions linearly."""
        return np.arange(self._columns[2].start, self.size)

    # evaluation

    def _wire(self) -> None:
        """The mapped functions on buffers of their own, so that a call costs microseconds."""
        c, space = self.counts, self.space
        x, self.weights = space.quadrature(self.points)
        count = x.size
        self._slope = [(2.0 / space.widths[:, None, None]) ** d for d in range(self.smoothness + 1)]
        self._table = basis_at_gauss(self.smoothness, space.degree, self.points, self.smoothness)
        parameters = self.form.problem.parameter_values
        self._inputs = [np.ascontiguousarray(x.ravel())]
        self._inputs += [np.zeros((count, c.functions)) for _ in range(self.smoothness + 1)]
        self._inputs += [np.tile(parameters, (count, 1)), np.zeros((count, c.numbers))]
        self._inputs += [np.zeros((count, c.levels)), np.zeros((count, c.paths))]
        self._row_count = c.functions + c.paths + c.levels + c.numbers
        self._column_count = c.tower + c.numbers + c.levels + c.paths
        self._output = np.zeros((count, 1 + self._row_count * (1 + self._column_count)))
        self._run = BufferedCall(self.conditions.interior.map(count), self._inputs, self._output)

    def evaluate(self, z: np.ndarray) -> Residual:
        """The residual of every condition; entries are inf or NaN outside the domain."""
        state, c, n = self.unpack(z), self.counts, self.counts.functions
        local = self.space.local(state.coefficients)
        for d in range(self.smoothness + 1):
            self._inputs[1 + d][:] = (self._slope[d] * (self._table[d] @ local)).reshape(-1, n)
        self._inputs[-3][:], self._inputs[-2][:] = state.unknowns, state.levels
        self._inputs[-1][:] = state.forces.reshape(self._inputs[-1].shape)
        self._run()
        out = self._output.copy()
        pointwise = out[:, 1 : 1 + self._row_count]
        weights = self.weights.ravel()
        with np.errstate(invalid="ignore", over="ignore"):
            integrals = weights @ pointwise[:, n + c.paths :]
            value, size = float(weights @ out[:, 0]), float(weights @ np.abs(out[:, 0]))
        integrals[: c.levels] -= self.levels
        beside = self.boundary.evaluate(state.coefficients, state.unknowns, state.levels, state.ends)
        ends = beside.ends
        rows = np.concatenate([
            pointwise[:, :n].ravel(),
            pointwise[:, n : n + c.paths].ravel(),
            self.boundary.rows(state.coefficients, beside),
            integrals,
            np.zeros(0) if ends is None else ends[0][2 * n + c.numbers :],
        ])  # fmt: skip
        if ends is not None and c.numbers:
            first = self.first_integral + c.levels
            rows[first : first + c.numbers] += ends[0][2 * n : 2 * n + c.numbers]
        return Residual(rows, value, size, self._legendre(out), out, beside)

    def integrals(self, residual: Residual) -> np.ndarray:
        """By how much the prescribed integrals exceed their levels."""
        return residual.rows[self.first_integral : self.first_integral + self.counts.levels]

    def pointwise_jacobian(self, residual: Residual) -> np.ndarray:
        """Pointwise Jacobian, shape (elements, points, rows, columns)."""
        flat = residual.interior[:, 1 + self._row_count :]
        shaped = flat.reshape(self.space.elements, self.points, self._column_count, self._row_count)
        return shaped.transpose(0, 1, 3, 2)

    def _legendre(self, out: np.ndarray) -> float:
        n, rows = self.counts.functions, self._row_count
        first = 1 + rows + self.smoothness * n * rows
        block = out[:, first : first + n * rows].reshape(-1, n, rows)[:, :, :n]
        if not np.isfinite(block).all():
            return -np.inf
        block = -block if self.form.order == 1 else block  # the Euler-Lagrange expression has (-1)^m L_ww y^(2 m)
        return float(block.min() if n == 1 else np.linalg.eigvalsh(block).min())

    # Jacobian

    def triplets(self, residual: Residual) -> Triplets:
        """The Jacobian of the residual as rows, columns and values; repeated places add up."""
        c, columns = self.counts, self._columns
        parts = []
        if self.boundary.count or residual.boundary.ends is not None:
            known = [np.arange(part.start, part.stop) for part in columns]
            parts = [
                *self.boundary.triplets(residual.boundary, np.concatenate(known[1:3])),
                *self.boundary.end_triplets(residual.boundary, known[1], known[3], self.first_integral + c.levels),
            ]
        values = np.concatenate([*self._interior_values(residual), *(part[2] for part in parts)])
        if self._where is None:  # the places do not change, only the values
            pattern = [*self._pattern(), *(part[:2] for part in parts)]
            rows, places = (np.concatenate(p) for p in zip(*pattern, strict=True))
            kept = places >= 0
            self._where = rows[kept], places[kept], kept
        rows, places, kept = self._where
        return rows, places, values[kept]

    def dense(self, residual: Residual) -> np.ndarray:
        """The Jacobian of the residual as an array."""
        rows, columns, values = self.triplets(residual)
        flat = np.bincount(rows * self.size + columns, values, self.size * self.size)
        return flat.reshape(self.size, self.size)

    def _pattern(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows and columns of the parts of the interior's Jacobian, in the order their values are made."""
        c, space = self.counts, self.space
        E, K, P, n = space.elements, self.points, space.degree + 1, c.functions
        place = np.arange(E * K).reshape(E, K)
        equations = place[:, :, None] * n + np.arange(n)
        paths = E * K * n + place[:, :, None] * c.paths + np.arange(c.paths)
        pointwise = np.concatenate([equations, paths], axis=2)
        curve = np.broadcast_to(self.place[space.numbers][:, None, None], (E, K, pointwise.shape[2], P, n))
        numbers = np.arange(len(self.free), len(self.free) + c.numbers + c.levels)
        forces = self._columns[4].start + place[:, :, None] * c.paths + np.arange(c.paths)
        integral = self.first_integral + np.arange(c.levels + c.numbers)
        R, G, N = pointwise.shape[2], len(integral), len(numbers)
        shapes: list[tuple[np.ndarray, np.ndarray, tuple[int, ...]]] = [
            (pointwise[:, :, :, None, None], curve, (E, K, R, P, n)),
            (pointwise[:, :, :, None], numbers, (E, K, R, N)),
            (pointwise[:, :, :, None], forces[:, :, None, :], (E, K, R, c.paths)),
            (integral[None, :, None, None], self.place[space.numbers][:, None], (E, G, P, n)),
            (integral[:, None], numbers, (G, N)),
            (integral[None, None, :, None], forces[:, :, None, :], (E, K, G, c.paths)),
        ]
        return [
            (np.broadcast_to(r, shape).ravel(), np.broadcast_to(q, shape).ravel())
            for r, q, shape in shapes
            if math.prod(shape)
        ]

    def mass_triplets(self, z: np.ndarray) -> Triplets:
        """The curve's own values in the rows of the Euler-Lagrange equation, as rows, columns and values.

        Each function is weighted by the square of its inverse size at ``z``, so that units drop out.
        """
        n, space = self.counts.functions, self.space
        local = space.local(self.unpack(z).coefficients)
        size = np.abs(self._table[0] @ local).max((0, 1))
        size = np.where(size > 0, size, size.max() or 1.0)
        rows = np.arange(space.elements * self.points * n).reshape(space.elements, self.points, 1, n)
        columns = self.place[space.numbers][:, None]
        values = (self._table[0][None] * space.local_scale[:, None, :])[..., None] / size**2
        shape = np.broadcast_shapes(rows.shape, columns.shape, values.shape)
        rows, columns, values = (np.broadcast_to(v, shape).ravel() for v in (rows, columns, values))
        kept = columns >= 0
        return rows[kept], columns[kept], values[kept]

    def _interior_values(self, residual: Residual) -> list[np.ndarray]:
        """The values that belong to the places of :meth:`_pattern`."""
        c, n = self.counts, self.counts.functions
        blocks, R, T = self.pointwise_jacobian(residual), c.functions + c.paths, c.tower
        scale = self.space.local_scale
        weighted = blocks[:, :, R:] * self.weights[:, :, None, None]
        curve, integral = np.zeros(1), np.zeros(0)
        for d in range(self.smoothness + 1):
            part = slice(d * n, (d + 1) * n)
            table = self._table[d][None] * (self._slope[d] * scale[:, None, :])
            curve = curve + blocks[:, :, :R, None, part] * table[:, :, None, :, None]
            if weighted.shape[2]:
                term = np.einsum("eqra,eqi->eria", weighted[:, :, :, part], table)
                integral = term if d == 0 else integral + term
        N = c.numbers + c.levels
        values = [
            curve, blocks[:, :, :R, T : T + N], blocks[:, :, :R, T + N :], integral,
            weighted[:, :, :, T : T + N].sum((0, 1)), weighted[:, :, :, T + N :],
        ]  # fmt: skip
        return [v.ravel() for v in values if v.size]

    # curves

    def fitted(self, curve: Sampled, unknowns: np.ndarray) -> State:
        """The state of a curve given by its values, by least squares; multipliers zero; NaN for a curve with gaps."""
        c, space = self.counts, self.space
        count = space.degree + 1
        scalar = Space(space.vertices, space.degree, 1, space.smoothness, False, space.broken, space.break_order)
        s = space.quadrature(count)[0]
        table = basis_at_gauss(space.smoothness, space.degree, count, 0)[0]
        rows = np.arange(s.size).reshape(s.shape)[:, :, None]
        matrix = np.zeros((s.size, scalar.size))
        matrix[rows, scalar.numbers[:, None, :, 0]] = table[None] * scalar.local_scale[:, None, :]
        values = curve(s.ravel())
        if np.isfinite(values).all():
            solution = np.linalg.lstsq(matrix, values.T, rcond=None)[0]
        else:
            solution = np.full((scalar.size, c.functions), np.nan)
        coefficients = np.empty(space.size)
        for a in range(c.functions):
            coefficients[space.numbers[:, :, a]] = solution[scalar.numbers[:, :, 0], a]
        ends = np.zeros(c.equations + len(c.caps))
        forces = np.zeros((space.elements, self.points, c.paths))
        return State(coefficients, np.array(unknowns, dtype=float), np.zeros(c.levels), ends, forces)

    def transferred(self, state: State, target: CollocationSystem) -> State:
        """The same curve on a richer space: a higher degree, or a mesh that contains this one."""
        space, coefficients = self.space, state.coefficients
        if len(target.space.vertices) != len(space.vertices):
            space, coefficients = space.remeshed(coefficients, target.space.vertices)
        if target.space.degree != space.degree:
            coefficients = space.prolonged(coefficients, target.space)
        forces = state.forces
        if self.counts.paths:
            s = target.space.quadrature(target.points)[0].ravel()
            values = [self.force(state, k)(s) for k in range(self.counts.paths)]
            forces = np.stack(values, axis=-1).reshape(target.space.elements, target.points, -1)
        return State(coefficients, state.unknowns, state.levels, state.ends, forces)

    def force(self, state: State, path: int) -> Sampled:
        """The multiplier of a pathwise condition as a function of s: on each element the interpolant."""
        values, vertices = state.forces[:, :, path], self.space.vertices
        nodes = gauss(self.points)[0]
        inverse = np.linalg.inv(np.polynomial.legendre.legvander(nodes, self.points - 1))
        coefficients = values @ inverse.T

        def multiplier(s: np.ndarray) -> np.ndarray:
            element = np.clip(np.searchsorted(vertices, s, side="right") - 1, 0, len(vertices) - 2)
            local = 2 * (s - vertices[element]) / np.diff(vertices)[element] - 1
            return (np.polynomial.legendre.legvander(local, self.points - 1) * coefficients[element]).sum(1)

        return multiplier
