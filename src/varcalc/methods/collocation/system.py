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

import copy
import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.answer import Extremal
from varcalc.methods.collocation.boundary import NO_BOUNDARY, Boundary, BoundaryValues, Triplets
from varcalc.methods.collocation.scheme import numbered, one_element, scheme_on
from varcalc.methods.collocation.stationarity import stationarity
from varcalc.methods.ritz.system import Places
from varcalc.numerics.mesh import Space, gauss


def collocation_space(form: Form, vertices: np.ndarray, degree: int) -> Space:
    """The space in which a form is collocated on a mesh: 2 m - 1 times differentiable, broken at knots inside it."""
    broken = {int(np.argmin(np.abs(vertices - knot))) for knot in form.conditions.knots} - {0, len(vertices) - 1}
    return Space(vertices, degree, form.n, 2 * form.order, False, tuple(sorted(broken)), form.order)


@dataclass(frozen=True)
class State:
    """A curve with its numbers: coefficients, unknown numbers and every multiplier.

    Of a system at K places ``coefficients`` are those of K curves, (K, size).

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
    """The conditions of a ``system`` at one state: ``rows`` vanish on extremals.

    Of a system at K places all that is told here has K along its first axis.
    """

    system: CollocationSystem
    rows: np.ndarray
    interior: np.ndarray
    boundary: BoundaryValues

    @cached_property
    def finite(self) -> Any:
        """True when every condition is a number."""
        if self.system.places is not None:
            return np.isfinite(self.interior.reshape(len(self.rows), -1).sum(1))
        known = math.isfinite(np.add.reduce(self.interior, axis=None))
        return known and (self.system.plain or bool(np.isfinite(self.rows).all()))

    @property
    def value(self) -> Any:
        """The functional by the rule of the collocation points."""
        return self.system.integral(self.interior[:, 0])

    @property
    def size(self) -> Any:
        """The integral of its absolute value."""
        return self.system.integral(np.abs(self.interior[:, 0]))

    @cached_property
    def legendre(self) -> float:
        """The least eigenvalue of the Hessian of the Lagrangian function in the highest slope over all points."""
        return self.system.least_curvature(self.interior)


class CollocationSystem:
    """A form collocated on ``space``; the unknowns are one vector z.

    The system :meth:`at` K ``places`` holds K curves on one element, of a form of which nothing is asked but the
    Euler-Lagrange equation between fixed ends: z, residuals and Jacobians have K along their first axis. They take
    the place of the elements, so that the arithmetic is the same.
    """

    def __init__(self, form: Form, space: Space) -> None:
        scheme = scheme_on(form, space)
        self.form, self.space, self.weights = form, scheme.space, scheme.weights
        self._x, self.derive = scheme.x, scheme.derive
        self.flat_weights = self.weights.ravel()
        self.conditions = stationarity(form)
        self.counts = c = self.conditions.counts
        self.smoothness = 2 * form.order
        self.points = space.degree + 1 - self.smoothness
        self.levels = np.array([c.lower for c in form.conditions.integrals])
        self._row_count = c.functions + c.paths + c.levels + c.numbers
        self._column_count = c.tower + c.numbers + c.levels + c.paths
        self._parameters = form.problem.parameter_values
        self.places: Places | None = None
        self.stretch = np.ones((1, 1))
        self._where: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._fix()
        self._number()

    def at(self, places: Places) -> CollocationSystem:
        """The same equations at K places, where first-order curves between fixed ends run."""
        other, width = copy.copy(self), float(self.space.widths[0])
        other.places = places
        other.fixed = np.zeros((len(places.spans), self.space.size))
        other.fixed[:, self.at_vertices[0, 0]], other.fixed[:, self.at_vertices[0, 1]] = places.start, places.end
        widths = places.spans[:, 1] - places.spans[:, 0]
        stretch = width / (widths[:1] if np.ptp(widths) == 0.0 else widths)
        other.stretch = stretch[:, None] ** np.arange(self.smoothness + 1)
        other.derive = self.derive * other.stretch[:, None, :, None]
        other.weights = self.weights * (widths / width)[:, None]
        return other

    def restricted(self, rows: np.ndarray) -> CollocationSystem:
        """The system at some of its places."""
        assert self.places is not None
        if rows.dtype == bool and rows.all():
            return self
        other = copy.copy(self)
        other.places, other.fixed, other.weights = self.places[rows], self.fixed[rows], self.weights[rows]
        if len(self.stretch) > 1:
            other.stretch, other.derive = self.stretch[rows], self.derive[rows]
        return other

    # unknowns

    def _fix(self) -> None:
        """Which coefficients are free, and the values of the others."""
        space, m, order = self.space, self.smoothness, self.form.order
        demanded = np.full(space.size, np.nan)
        scale = space.vertex_scale ** np.arange(order)[:, None]
        demanded[space.numbers[0, :order]] = self.form.ends.start * scale
        demanded[space.numbers[-1, m : m + order]] = self.form.ends.end * scale
        for at, values in self.form.conditions.waypoints:
            vertex = int(np.argmin(np.abs(space.vertices - at)))
            for a, value in enumerate(values):
                demanded[space.vertex_number(vertex, 0, a)] = value
        fixed = ~np.isnan(demanded)
        self.fixed = np.where(fixed, demanded, 0.0)
        if space.elements == 1:
            places = one_element(space.degree, space.n, m, fixed.tobytes())
        else:
            places = numbered(space.numbers, fixed, self.points)
        self._numbering, self.free, self.place = places, places.free, places.column

    def _number(self) -> None:
        """Where each kind of unknown lies in z, and where each kind of row in the residual."""
        c, places = self.counts, self.space.elements * self.points
        on_ends = c.equations + len(c.caps)
        cuts = [0]
        for size in (len(self.free), c.numbers, c.levels, on_ends, places * c.paths):
            cuts.append(cuts[-1] + size)
        self._columns = [slice(a, b) for a, b in pairwise(cuts)]
        self.size = cuts[-1]
        self.boundary = Boundary(self.form, self.space, self.conditions, self.place, places * (c.functions + c.paths))
        self.first_integral = self.size - c.levels - c.numbers - on_ends
        self.plain = self.size == len(self.free) and not self.boundary.count
        """True when the equations of the interior are all there is."""
        self.still = bool(self.place[self.at_vertices].max() < 0)
        """True when no curve has other values at the vertices than another."""
        nothing = np.zeros(0)
        self._nothing = nothing, nothing, nothing, np.zeros((self.space.elements, self.points, 0))

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """For each free coefficient, its factor in the local basis and the function it belongs to."""
        factor = np.zeros(self.space.size)
        factor[self.space.numbers] = self.space.local_scale[:, :, None]
        return factor[self.free], self._numbering.functions

    @cached_property
    def at_vertices(self) -> np.ndarray:
        """Numbers of the coefficients that are the values at the two vertices of each element; (elements, 2, n)."""
        return self.space.numbers[:, [0, self.smoothness]]

    @property
    def band(self) -> tuple[int, int, np.ndarray]:
        """Of a plain system: diagonals below and above, and where each row begins among :meth:`triplets`."""
        return self._numbering.band

    def pack(self, state: State) -> np.ndarray:
        """A state as one vector."""
        free = state.coefficients[..., self.free]
        if self.size == len(self.free):
            return free
        return np.concatenate([free, state.unknowns, state.levels, state.ends, state.forces.ravel()])

    def unpack(self, z: np.ndarray) -> State:
        """The state that a vector stands for."""
        c, cols = self.counts, self._columns
        coefficients = self.fixed.copy()
        if self.plain:
            coefficients[..., self.free] = z
            return State(coefficients, *self._nothing)
        coefficients[self.free] = z[cols[0]]
        forces = z[cols[4]].reshape(self.space.elements, self.points, c.paths)
        return State(coefficients, z[cols[1]], z[cols[2]], z[cols[3]], forces)

    @property
    def linear(self) -> np.ndarray:
        """Positions in z of the multipliers, which enter the conditions linearly."""
        return np.arange(self._columns[2].start, self.size)

    # evaluation

    def evaluate(self, z: np.ndarray) -> Residual:
        """The residual of every condition; entries are inf or NaN outside the domain."""
        state, c, n = self.unpack(z), self.counts, self.counts.functions
        space, coefficients = self.space, state.coefficients
        local = coefficients[space.numbers] if self.places is None else coefficients[:, space.numbers[0]]
        tower = (self.derive @ local[:, None]).transpose(2, 0, 1, 3)
        if self.places is None:
            out = self.conditions.at(self._x, tower, (self._parameters, state.unknowns, state.levels), state.forces)
        else:
            out = self.conditions.at_many(self._abscissae(self.points), tower, self._repeated(self.points))
        pointwise = out[:, 1 : 1 + self._row_count]
        if self.plain:
            rows = pointwise.ravel() if self.places is None else pointwise.reshape(len(z), -1)
            return Residual(self, rows, out, NO_BOUNDARY)
        with np.errstate(invalid="ignore", over="ignore"):
            integrals = self.flat_weights @ pointwise[:, n + c.paths :]
        beside = self.boundary.evaluate(state.coefficients, state.unknowns, state.levels, state.ends)
        integrals[: c.levels] -= self.levels
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
        return Residual(self, rows, out, beside)

    def _abscissae(self, count: int) -> np.ndarray:
        """The Gauss points at all places, so many at each, as a column."""
        assert self.places is not None
        left, right = self.places.spans[:, :1], self.places.spans[:, 1:]
        return (left + 0.5 * (right - left) * (1 + gauss(count)[0])).reshape(-1, 1)

    def _repeated(self, count: int) -> np.ndarray:
        """The parameters at so many points of each place, one row a point."""
        assert self.places is not None
        return np.repeat(self.places.parameters, count, axis=0)

    def sampled(self, coefficients: np.ndarray, count: int, derivatives: int) -> list[np.ndarray]:
        """The curve and its derivatives at Gauss points: (elements, count, n), (K, count, n) at K places."""
        found = self.space.at_quadrature(coefficients, count, derivatives)
        if self.places is None:
            return found
        return [v[:, 0] * self.stretch[:, d, None, None] for d, v in enumerate(found)]

    def along(self, coefficients: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Abscissae, (K, count), ordinates and slopes of the curves at K places, (K, count, n)."""
        y, slopes = self.sampled(coefficients, count, 1)
        return self._abscissae(count).reshape(-1, count), y, slopes

    def integral(self, densities: np.ndarray) -> Any:
        """The integral of what is known at all collocation points."""
        if self.places is None:
            return float(self.flat_weights @ densities)
        return (self.weights * densities.reshape(self.weights.shape)).sum(1)

    def fine_value(self, state: State, count: int) -> Any:
        """The functional, without the cost of the ends, by ``count`` Gauss points an element."""
        tower = np.array(self.sampled(state.coefficients, count, self.smoothness))
        nodes, weights = self.space.quadrature(count)
        if self.places is None:
            numbers = (self._parameters, state.unknowns, state.levels)
            return float(weights.ravel() @ self.conditions.at(nodes.reshape(-1, 1), tower, numbers)[:, 0])
        values = self.conditions.at_many(self._abscissae(count), tower, self._repeated(count))[:, 0]
        shares = self.weights.sum(1) / weights.sum()
        return shares * (values.reshape(-1, count) @ weights[0])

    def integrals(self, residual: Residual) -> np.ndarray:
        """By how much the prescribed integrals exceed their levels."""
        return residual.rows[self.first_integral : self.first_integral + self.counts.levels]

    def pointwise_jacobian(self, residual: Residual) -> np.ndarray:
        """Pointwise Jacobian, shape (elements, points, rows, columns)."""
        flat = residual.interior[:, 1 + self._row_count :]
        shaped = flat.reshape(*self.weights.shape, self._column_count, self._row_count)
        return shaped.transpose(0, 1, 3, 2)

    def least_curvature(self, interior: np.ndarray) -> float:
        """:attr:`Residual.legendre`; minus infinity where it is not a number."""
        n, rows = self.counts.functions, self._row_count
        first = 1 + rows + self.smoothness * n * rows
        sign = -1.0 if self.form.order == 1 else 1.0  # the Euler-Lagrange expression has (-1)^m L_ww y^(2 m)
        block = sign * interior[:, first : first + n * rows]
        if n == 1:
            least = float(block[:, 0].min())
            return least if math.isfinite(least) else -math.inf
        block = block.reshape(-1, n, rows)[:, :, :n]
        return float(np.linalg.eigvalsh(block).min()) if np.isfinite(block).all() else -math.inf

    # Jacobian

    def triplets(self, residual: Residual) -> Triplets:
        """The Jacobian of the residual as rows, columns and values; repeated places add up."""
        if self.plain:
            rows, places, kept = self._numbering.plain
            return rows, places, self._curve_values(residual).ravel()[kept]
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
        if self.plain and self.space.elements == 1:
            shape = residual.rows.shape
            return self._curve_values(residual).reshape(*shape, -1)[..., self._numbering.local]
        rows, columns, values = self.triplets(residual)
        if self.plain:
            matrix = np.zeros((self.size, self.size))
            matrix[rows, columns] = values
            return matrix
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
        coefficients = self.unpack(z).coefficients
        size = np.abs(self.derive[:, :, 0] @ coefficients[space.numbers]).max((0, 1))
        size = np.where(size > 0, size, size.max() or 1.0)
        rows = np.arange(space.elements * self.points * n).reshape(space.elements, self.points, 1, n)
        columns = self.place[space.numbers][:, None]
        values = self.derive[:, :, 0][..., None] / size**2
        shape = np.broadcast_shapes(rows.shape, columns.shape, values.shape)
        rows, columns, values = (np.broadcast_to(v, shape).ravel() for v in (rows, columns, values))
        kept = columns >= 0
        return rows[kept], columns[kept], values[kept]

    def _curve_values(self, residual: Residual) -> np.ndarray:
        """The derivatives of the pointwise rows by the coefficients: (elements, points, rows, degree + 1, n)."""
        c, n = self.counts, self.counts.functions
        blocks = self.pointwise_jacobian(residual)[:, :, : n + c.paths, : c.tower]
        if n == 1:
            return (blocks @ self.derive)[..., None]
        towers = blocks.reshape(*blocks.shape[:3], -1, n).swapaxes(-1, -2)
        return (towers @ self.derive[:, :, None]).swapaxes(-1, -2)

    def _interior_values(self, residual: Residual) -> list[np.ndarray]:
        """The values that belong to the places of :meth:`_pattern`."""
        c, n = self.counts, self.counts.functions
        blocks, R, T = self.pointwise_jacobian(residual), c.functions + c.paths, c.tower
        weighted = blocks[:, :, R:] * self.weights[:, :, None, None]
        curve, integral = self._curve_values(residual), np.zeros(0)
        if weighted.shape[2]:
            for d in range(self.smoothness + 1):
                term = np.einsum("eqra,eqi->eria", weighted[:, :, :, d * n : (d + 1) * n], self.derive[:, :, d])
                integral = term if d == 0 else integral + term
        N = c.numbers + c.levels
        values = [
            curve, blocks[:, :, :R, T : T + N], blocks[:, :, :R, T + N :], integral,
            weighted[:, :, :, T : T + N].sum((0, 1)), weighted[:, :, :, T + N :],
        ]  # fmt: skip
        return [v.ravel() for v in values if v.size]

    # curves

    def fitted(self, curve: Sampled, unknowns: np.ndarray) -> State:
        """The state of the interpolant of a curve; multipliers zero; NaN for a curve with gaps."""
        c, space = self.counts, self.space
        with np.errstate(all="ignore"):
            coefficients = space.fit(curve)
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

    def extremal(self, state: State, factor: float = 1.0) -> Extremal:
        """The curve as an Extremal, the multipliers of pathwise conditions times ``factor``."""
        space = self.space
        return Extremal(
            form=self.form,
            evaluate=space.curve(state.coefficients),
            unknowns=state.unknowns.copy(),
            vertices=space.vertices,
            lambdas=state.levels.copy(),
            path={c.index: self.force(state, k, factor) for k, c in enumerate(self.form.conditions.pathwise)},
            coefficients=state.coefficients if space.elements == 1 else None,
        )

    def force(self, state: State, path: int, factor: float = 1.0) -> Sampled:
        """The multiplier of a pathwise condition, times ``factor``, as a function of s: the interpolants."""
        values, vertices = factor * state.forces[:, :, path], self.space.vertices
        nodes = gauss(self.points)[0]
        inverse = np.linalg.inv(np.polynomial.legendre.legvander(nodes, self.points - 1))
        coefficients = values @ inverse.T

        def multiplier(s: np.ndarray) -> np.ndarray:
            """The values (m,) at s (m,)."""
            element = np.clip(np.searchsorted(vertices, s, side="right") - 1, 0, len(vertices) - 2)
            local = 2 * (s - vertices[element]) / np.diff(vertices)[element] - 1
            return (np.polynomial.legendre.legvander(local, self.points - 1) * coefficients[element]).sum(1)

        return multiplier
