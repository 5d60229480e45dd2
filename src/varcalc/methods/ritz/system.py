"""The functional of a form on a space of piecewise polynomials: value, gradient, Hessian.

The unknowns are the free coefficients of the curve followed by the unknown
numbers of the form; the side conditions are the isoperimetric equalities
followed by the equations of the ends. The integrands' own derivatives at the
Gauss points (:mod:`.integrands`) between the matrices that take the unknowns
there (:class:`OneElement`, :class:`.Elements`) are those of the functional.

A system may stand for ``K`` values of the parameters, which move the ends or
change the integrand: then the arrays have one more axis, the first, for them. Unknowns may have
more leading axes than the system; every curve they stand for is evaluated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np

from varcalc.formulation import Form, Reported, Sampled
from varcalc.methods.ritz.elements import DENSE, Elements
from varcalc.methods.ritz.integrands import CompiledIntegrands, Integrands, NumericIntegrand, at_ends
from varcalc.numerics.mesh import Space, basis_at_gauss, gauss

SEVERAL = 4
"""Functions beyond which a matrix is assembled by pairs of them."""


def quadrature_points(degree: int) -> int:
    """Gauss points an element: half as many again as the degree, exact for cubes of the slope."""
    return degree + degree // 2 + 2


class OneElement:
    """One polynomial a function: ``matrix`` (Q, k, N) takes N free unknowns to k variables at Q points of [-1, 1].

    The variables are the functions, their derivatives up to ``order``, and ``extra`` unknown numbers, which are the
    last of the unknowns. On [-1, 1] all of it is the same for every length. ``free`` and ``held`` number the
    coefficients that may move, and those that the ends fix.
    """

    def __init__(self, n: int, degree: int, order: int, count: int, held: np.ndarray, extra: int) -> None:
        space = Space(np.array([-1.0, 1.0]), degree, n, order)
        self.numbers, self.held, self.free = space.numbers[0], held, np.delete(np.arange(space.size), held)
        self.n, self.count, self.order, self.k = n, count, order, (order + 1) * n + extra
        table = basis_at_gauss(order, degree, count, order) * space.local_scale[0]
        columns = np.zeros((count, self.k - extra, space.size))
        for d in range(order + 1):
            for a in range(n):  # all else is zero: of many functions almost everything
                columns[:, d * n + a, self.numbers[:, a]] = table[d]
        self.matrix = np.zeros((count, self.k, len(self.free) + extra))
        self.matrix[:, : self.k - extra, : len(self.free)] = columns[:, :, self.free]
        self.matrix[:, self.k - extra :, len(self.free) :] = np.eye(extra)
        self.flat = self.matrix.reshape(count * self.k, -1)
        known = np.zeros((count, self.k, len(held)))
        known[:, : self.k - extra] = columns[:, :, held]
        self.known = known.reshape(count * self.k, -1)
        self._pairs = None
        if n > SEVERAL and not extra:
            self._pairs = np.einsum("dqi,eqj->ijqde", table, table).reshape((degree + 1) ** 2, -1)
            self._order = np.argsort(self.numbers.ravel())[self.free]

    def fixed(self, coefficients: np.ndarray) -> np.ndarray:
        """What the coefficients (..., size) that are held add to the variables, (..., Q, k)."""
        held = coefficients[..., self.held]
        return (held @ self.known.T).reshape(*held.shape[:-1], self.count, self.k)

    def variables(self, z: np.ndarray) -> np.ndarray:
        """What unknowns (..., N) add to the variables, (..., Q, k)."""
        return (z @ self.flat.T).reshape(*z.shape[:-1], self.count, self.k)

    def gradient(self, rows: np.ndarray) -> np.ndarray:
        """Sums over the points of derivatives by the variables (..., Q, k) as derivatives by the unknowns, (..., N)."""
        return rows.reshape(*rows.shape[:-2], -1) @ self.flat

    def matrices(self, blocks: np.ndarray) -> np.ndarray:
        """The same for second derivatives (..., Q, k, k), which are matrices (..., N, N) of the unknowns.

        Each function has the same polynomials, so that the entries of all pairs of many functions are one product of
        what two polynomials contribute at a point: quadratic in their number, not cubic.
        """
        lead = blocks.shape[:-3]
        if self._pairs is None:
            return self.flat.T @ (blocks @ self.matrix).reshape(*lead, *self.flat.shape)
        n, depth, size = self.n, self.order + 1, len(self.numbers)
        rows = blocks.reshape(*lead, self.count, depth, n, depth, n).swapaxes(-3, -2).reshape(*lead, -1, n * n)
        whole = (self._pairs @ rows).reshape(*lead, size, size, n, n).swapaxes(-3, -2)
        return whole.reshape(*lead, size * n, size * n)[..., self._order[:, None], self._order]


@lru_cache(maxsize=256)
def _one_element(n: int, degree: int, order: int, count: int, held: tuple[int, ...], extra: int) -> OneElement:
    return OneElement(n, degree, order, count, np.array(held, dtype=int), extra)


def assembly(space: Space, order: int, count: int, held: np.ndarray, extra: int) -> OneElement | Elements:
    """What takes the unknowns of a space to points and back, where the coefficients of the numbers ``held`` are."""
    if space.elements > 1 or space.periodic:
        return Elements(space, order, count, np.delete(np.arange(space.size), held), extra)
    return _one_element(space.n, space.degree, order, count, tuple(held.tolist()), extra)


@dataclass(frozen=True)
class Places:
    """Where the curves of ``K`` values run: ``spans`` (K, 2) in s, what is fixed at the ends (K, n), parameters."""

    spans: np.ndarray
    start: np.ndarray
    end: np.ndarray
    parameters: np.ndarray

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """What is fixed at the start and at the end."""
        return self.start, self.end

    def __getitem__(self, rows: np.ndarray) -> Places:
        return Places(self.spans[rows], self.start[rows], self.end[rows], self.parameters[rows])


@dataclass
class Evaluation:
    """The discrete functional and its derivatives at one point, or at several: then all have more leading axes.

    ``value`` is what is minimised, ``scale`` the sum of the absolute
    contributions (the size of round-off), ``conditions`` (m,) the side conditions,
    zero on admissible curves, ``legendre`` the least eigenvalue of L_y'y' (of the highest slope) over
    all points. ``gradient`` (N,) and ``jacobian`` (m, N) are for the free unknowns. At the Q points ``variables``
    (Q, k) are the curve and its slopes, ``integrands`` (Q, 1 + levels), ``slopes`` (Q, 1 + levels, k) and
    ``hessians`` (Q, 1 + levels, k, k) what the integrands are there, ``summed`` (levels,) the integrals of the
    absolute values of those of the levels.
    """

    value: Any
    scale: Any
    conditions: np.ndarray
    gradient: np.ndarray
    jacobian: np.ndarray
    legendre: Any
    variables: np.ndarray
    integrands: np.ndarray
    slopes: np.ndarray
    hessians: np.ndarray
    summed: np.ndarray
    ends: list[np.ndarray] | None = None

    def __getitem__(self, rows: np.ndarray) -> Self:
        """Some of the evaluations along the first axis."""
        return replace(self, **{name: v[rows] for name, v in vars(self).items() if name != "ends"})

    def enter(self, rows: np.ndarray, other: Evaluation) -> None:
        """Put other evaluations in the places of some."""
        for name, values in vars(other).items():
            if name != "ends":
                getattr(self, name)[rows] = values


class RitzSystem:
    """A form discretised on ``space`` with ``count`` Gauss points an element; at ``places``, on one element, if given.

    With places the space is that of one value, which may be any: each has an interval of its own.
    """

    def __init__(self, form: Form, space: Space, count: int | None = None, places: Places | None = None) -> None:
        self.form, self.space, self.places = form, space, places
        self.count = quadrature_points(space.degree) if count is None else count
        self.order, self.n = form.order, form.n
        self.extra = len(form.start.unknowns)
        self.equalities = [c for c in form.conditions.integrals if c.equality]
        self.levels = np.array([c.lower for c in self.equalities])
        self.k = (self.order + 1) * self.n + self.extra
        self.top = slice(self.order * self.n, (self.order + 1) * self.n)
        self.fixed, held = self._held()
        self.assembly = assembly(space, self.order, self.count, held, self.extra)
        self.free, self.size = self.assembly.free, len(self.assembly.free) + self.extra
        self.x, self.weights, self.lengths, self.scale, self.first, self.second = self._placed()
        self.offset = self.assembly.fixed(self.fixed) * self.scale
        self.source = self.integrands_at(self.x)

    def _held(self) -> tuple[np.ndarray, np.ndarray]:
        """The coefficients, zero where they are free, and the numbers of those that the ends or waypoints hold."""
        form, space, m = self.form, self.space, self.space.smoothness
        powers: Any = space.vertex_scale ** np.arange(m)[:, None] if m > 1 else 1.0
        start, end = form.ends.start, form.ends.end
        marks = [(space.numbers[0, : len(start)], start), (space.numbers[-1, m : m + len(end)], end)]
        for at, demanded in form.conditions.waypoints:
            vertex = int(np.argmin(np.abs(space.vertices - at)))
            marks.append((space.numbers[vertex - 1, m : m + 1], np.array([demanded])))
        values = np.concatenate([(v * powers[: len(v)] if m > 1 else v).ravel() for _, v in marks])
        numbers, given = np.concatenate([own.ravel() for own, _ in marks]), ~np.isnan(values)
        fixed, held = np.zeros(space.size), numbers[given]
        fixed[held] = values[given]
        if self.places is not None:
            fixed = np.zeros((len(self.places.spans), space.size))
            for vertex, own in zip(space.numbers[0], self.places.ends, strict=False):
                fixed[:, vertex] = np.nan_to_num(own)
        return fixed, held

    def _placed(self) -> tuple[Any, ...]:
        """Abscissae, weights, lengths and factors of derivatives: see :func:`_rule`."""
        powers, space = (self.order, self.n, self.extra), self.space
        if self.places is not None:
            return _rule(self.places.spans[..., None], self.count, *powers)
        if space.elements == 1:
            return _rule_of_one(*space.vertices.tolist(), self.count, *powers)
        ends = np.stack([space.vertices[:-1], space.vertices[1:]])
        return _rule(ends, self.count, *powers)

    def integrands_at(self, s: np.ndarray) -> Integrands:
        """The integrands at abscissae (.., points)."""
        form = self.form
        if self.places is not None:
            return CompiledIntegrands(form, s, self.places.parameters[:, None])
        # beyond one element what is built pays
        if form.coordinates.numbers is not None and self.space.elements == 1 and not form.conditions.integrals:
            return NumericIntegrand(form, s)
        return CompiledIntegrands(form, s, form.problem.parameter_values[None])

    def restricted(self, rows: np.ndarray) -> RitzSystem:
        """The system of some of the values, which may be repeated."""
        if self.places is None or (rows.dtype == bool and rows.all()):
            return self
        other, places = object.__new__(type(self)), self.places[rows]
        other.__dict__ = self.__dict__ | {"places": places}
        for name in ("fixed", "x", "weights", "lengths", "scale", "offset", "first", "second"):
            setattr(other, name, getattr(self, name)[rows])
        other.source = other.integrands_at(other.x)
        return other

    @property
    def banded(self) -> bool:
        """Whether bands serve: many unknowns, several elements."""
        return self.size > DENSE and self.space.elements > 1

    @cached_property
    def coupled(self) -> np.ndarray:
        """The coefficients that are coupled across the mesh: by conditions of the ends, and where a curve closes."""
        closing = self.space.numbers[0, : self.space.smoothness if self.space.periodic else 0]
        across = closing if self.form.ends.joint is None else self.joint_numbers
        return np.concatenate([closing.ravel(), across.ravel()])

    # unknowns <-> coefficients

    def pack(self, coefficients: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
        """Free coefficients and unknown numbers as one vector."""
        return np.concatenate([coefficients[self.free], unknowns])

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """All coefficients, fixed ones included, of the unknowns ``z``."""
        c = np.broadcast_to(self.fixed, (*z.shape[:-1], self.space.size)).copy()
        c[..., self.free] = z[..., : len(self.free)]
        return c

    def fitted(self, curve: Sampled) -> np.ndarray:
        """The unknowns of a curve."""
        return self.gauged(self.pack(self.space.fit(curve), self.form.start.unknowns))

    def gauged(self, z: np.ndarray) -> np.ndarray:
        """Unknowns (.., N) in which the speed of the curve, where it is one of them, is that of the curve."""
        if self.form.coordinates.gauged:
            velocity = self.variables(z)[..., self.n : 2 * self.n]
            speed = np.sqrt((velocity**2).sum(-1).mean(-1))
            z[..., -1] = np.where(speed > 0, speed, z[..., -1])
        return z

    def unknowns(self, z: np.ndarray) -> np.ndarray:
        """The unknown numbers of the form in ``z``."""
        return z[..., len(self.free) :]

    def variables(self, z: np.ndarray) -> np.ndarray:
        """The curve, its slopes and the unknown numbers at the quadrature points, (.., points, k)."""
        return self.assembly.variables(z) * self.scale + self.offset

    def along(self, z: np.ndarray, s: np.ndarray) -> np.ndarray:
        """The same at abscissae s (m,), (m, k)."""
        coefficients, unknowns = self.coefficients(z), self.unknowns(z)
        rows = [self.space.evaluate(coefficients, s, d) for d in range(self.order + 1)]
        return np.vstack([*rows, np.repeat(unknowns[:, None], len(s), axis=1)]).T

    def moved(self, step: np.ndarray) -> np.ndarray:
        """By how much a step of the unknowns changes the variables."""
        return self.assembly.variables(step) * self.scale

    def ordinates(self, z: np.ndarray) -> np.ndarray:
        """The curve at the quadrature points, shape (points, n)."""
        return self.variables(z)[..., : self.n]

    def arguments(self, z: np.ndarray) -> list[np.ndarray]:
        """s, y, dy, ddy, parameters and unknowns at the quadrature points, one column a point."""
        rows, n, depth = self.variables(z).T, self.n, self.order + 1
        blank = np.zeros((0, len(self.x)))
        slopes = [rows[d * n : (d + 1) * n] for d in range(depth)] + [blank] * (3 - depth)
        parameters = np.repeat(self.form.problem.parameter_values[:, None], len(self.x), axis=1)
        return [self.x[None, :], *slopes, parameters, rows[depth * n :]]

    # evaluation

    def evaluate(self, z: np.ndarray) -> Evaluation:
        """Everything but the Hessian's assembly; entries are inf or NaN outside the domain."""
        at = self.integrated(z)
        if self.form.ends.joint is not None:
            self._add_ends(at, z)
        return at

    def integrated(self, z: np.ndarray) -> Evaluation:
        """The same without the cost and the equations of the ends."""
        variables = self.variables(z)
        integrands, slopes, hessians = self.source.derivatives(variables)
        with np.errstate(invalid="ignore", over="ignore"):
            values, sizes = self._sums(integrands), self._sums(np.abs(integrands))
            gradient = self.assembly.gradient(slopes[..., 0, :] * self.first)
            rows = [self.assembly.gradient(slopes[..., 1 + j, :] * self.first) for j in range(len(self.levels))]
            legendre = least_eigenvalue(hessians[..., 0, self.top, self.top])
        value = self._admitted(values[..., 0], variables, z)
        jacobian = np.stack(rows, axis=-2) if rows else np.empty((*gradient.shape[:-1], 0, self.size))
        return Evaluation(
            value, sizes[..., 0], values[..., 1:] - self.levels, gradient, jacobian, legendre, variables,
            integrands, slopes, hessians, sizes[..., 1:],
        )  # fmt: skip

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """The integrals of functions given at the points, (.., points, functions)."""
        return self.weights @ values if self.places is None else (self.weights[:, None] @ values)[:, 0]

    def _admitted(self, value: Any, variables: np.ndarray, z: np.ndarray) -> Any:
        """The value, infinite where what is positive is negative somewhere, or an end or a corner has passed others.

        Backwards, lengths are negative: a step that carries the end there would find no lower bound.
        """
        for a in self.form.coordinates.one_sided:
            value = np.where(variables[..., a].min(-1) < 0, np.inf, value)[()]
        if self.form.width is not None:
            numbers = self.unknowns(z)
            back = [self.form.runs_back(own) for own in numbers.reshape(-1, self.extra)]
            value = np.where(np.reshape(back, numbers.shape[:-1]), np.inf, value)[()]
        if corners := self.form.coordinates.corners:
            value = np.where(self._inside_out(self.unknowns(z)[..., -corners:]), np.inf, value)[()]
        return value

    def _inside_out(self, corners: np.ndarray) -> Any:
        """Whether the ``corners`` (.., k) of curves have passed each other, places that stand still, or the ends."""
        begun = self.form.start.unknowns[-corners.shape[-1] :]
        standing = np.setdiff1d([*self.form.conditions.knots, *self.form.span], begun)
        places = np.concatenate([corners, np.broadcast_to(standing, (*corners.shape[:-1], len(standing)))], axis=-1)
        order = np.argsort([*begun, *standing])
        return (np.diff(places[..., order], axis=-1) <= 0).any(-1)

    def measured(self, z: np.ndarray) -> tuple[Any, np.ndarray]:
        """The functional of curves ``z`` (K, N) and the integrals less their levels (K, levels), and no more."""
        variables = self.variables(z)
        with np.errstate(invalid="ignore", over="ignore"):
            values = self._sums(self.source.values(variables))
        value = self._admitted(values[..., 0], variables, z)
        if self.form.ends.joint is not None:
            value = value + np.array([self.end_cost(own) for own in z])
        return value, values[..., 1:] - self.levels

    def sizes(self, at: Evaluation) -> np.ndarray:
        """The size of each condition: its level or what is summed to meet it, and that of each equation of the ends."""
        levels = np.maximum(np.maximum(np.abs(self.levels), at.summed), 1e-300)
        return levels if at.ends is None else np.concatenate([levels, at.ends[-1]])

    def quadratic_size(self, at: Evaluation) -> float:
        """The sum of the squares of y, its slopes and the unknown numbers, each times its own second derivative of L.

        A functional may be zero by cancellation of terms of this size, each with its round-off. So may a slope, which
        is summed of ordinates over the interval.
        """
        diagonal, sizes = np.abs(at.hessians[:, 0].diagonal(0, 1, 2)), np.abs(at.variables)
        n, largest = self.n, sizes[:, : self.n].max(0)
        for k in range(1, 1 + self.order):
            least = largest / (self.form.span[1] - self.form.span[0]) ** k
            sizes[:, k * n : (k + 1) * n] = np.maximum(sizes[:, k * n : (k + 1) * n], least)
        return float(self.weights @ (diagonal * sizes**2).sum(1))

    def reported(self, at: Evaluation, moved: np.ndarray | None = None) -> Reported:
        """What is reported at the quadrature points of a curve, or of one whose variables are ``moved`` from there."""
        if self.form.plainly_reported:
            variables = at.variables if moved is None else at.variables + moved
            y, dy = variables[..., : self.n], variables[..., self.n : 2 * self.n]
            return Reported(at.integrands[..., 0], self.x, y, np.ones(1), dy)
        return self.source.reported(at.variables if moved is None else at.variables + moved)

    # Hessian

    def _lagrangian(self, at: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Pointwise Hessian of integrand + sum lambda_j g_j; shape (.., points, k, k)."""
        total = at.hessians[..., 0, :, :]
        for j in range(len(self.equalities)):
            total = total + multipliers[..., j, None, None, None] * at.hessians[..., 1 + j, :, :]
        return total

    def combined(self, at: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Pointwise Hessian of integrand + sum lambda_j g_j, weighted; shape (.., points, k, k)."""
        return self._lagrangian(at, multipliers) * self.weights[..., None, None]

    def assembled(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix (.., N, N) of pointwise (weighted) quadratic forms in the variables, (.., points, k, k)."""
        return self.assembly.matrices(blocks * (self.scale[..., None] * self.scale[..., None, :]))

    def parts(self, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same on several elements: element matrices, border (coefficients, extra), corner."""
        assert isinstance(self.assembly, Elements)
        return self.assembly.parts(blocks * (self.scale[..., None] * self.scale[..., None, :]))

    def hessian(self, at: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Dense Hessian of the Lagrangian function in the free unknowns."""
        full = self.assembly.matrices(self._lagrangian(at, multipliers) * self.second)
        if at.ends is not None:
            places, block = self.end_curvature(at, multipliers)
            full[np.ix_(places, places)] += block
        return full

    def leading(self, curvature: np.ndarray) -> np.ndarray:
        """The leading term of a (weighted) pointwise form: that of the highest slope, on the interval's length of y."""
        out, n = np.zeros_like(curvature), self.n
        lengths = np.asarray(self.lengths)[..., None, None, None]
        for d in range(self.order + 1):
            rows = slice(d * n, (d + 1) * n)
            out[..., rows, rows] = curvature[..., self.top, self.top] * lengths ** (2.0 * (d - self.order))
        return out

    def leading_term(self, at: Evaluation, z: np.ndarray) -> np.ndarray:
        """The Gram matrix of the leading term of L, in which an unknown number is measured by what it costs."""
        return self.assembled(self.leading_blocks(at, z))

    def leading_blocks(self, at: Evaluation, z: np.ndarray) -> np.ndarray:
        """The same as blocks (.., points, k, k); an unknown number's unit is the change that costs all of L."""
        hessians = at.hessians[..., 0, :, :]
        blocks = self.leading(hessians * self.weights[..., None, None])
        if self.extra:
            numbers = np.arange(self.k - self.extra, self.k)
            own = np.abs(self.weights @ hessians[:, numbers, numbers])
            own = np.maximum(own, at.scale / self._sizes_of_numbers(z) ** 2)
            blocks[:, numbers, numbers] = self._spread(own)
        return blocks

    def _spread(self, diagonal: np.ndarray) -> np.ndarray:
        """What belongs to the unknown numbers, (.., extra), in shares of the points, (.., points, extra)."""
        return diagonal[..., None, :] * (self.weights / self.weights.sum(-1, keepdims=True))[..., None]

    def _sizes_of_numbers(self, z: np.ndarray) -> np.ndarray:
        """A size for each unknown number: its own or its guess, for a sliding abscissa that of the interval."""
        form = self.form
        sizes = np.maximum(np.abs(self.unknowns(z)), np.abs(form.start.unknowns))
        sliding = slice(len(form.problem.unknowns), self.extra - form.coordinates.gauged)
        if sizes[sliding].size:
            sizes[sliding] = form.problem.span[1] - form.problem.span[0]
        return np.where(sizes > 0, sizes, 1.0)

    def metric_diagonal(self, at: Evaluation) -> np.ndarray:
        """A positive pointwise (weighted) quadratic form in the variables, which is diagonal: (.., points, k).

        It shifts a Newton step: an H^1 (H^2) product in which each function is
        weighted by its own L_y'y', so that units drop out; by the mean of its
        absolute value where that is not positive all along.
        """
        rest = self.k - self.extra
        diagonal = np.einsum("...aa->...a", at.hessians[..., 0, :, :])
        weight = np.abs(diagonal[..., self.top])
        mean = self._sums(weight) / self.weights.sum(-1)[..., None]
        largest = mean.max(-1, keepdims=True)
        mean = np.where(mean > 0, mean, np.where(largest > 0, largest, 1.0))
        falls = np.asarray(at.legendre <= 0.0)[..., None, None]
        weight = np.where(falls, mean[..., None, :], weight) * self.weights[..., None]
        lengths = np.asarray(self.lengths)[..., None, None]
        shares = [weight * lengths ** (2.0 * (d - self.order)) for d in range(self.order + 1)]
        if self.extra:
            shares.append(self._spread(np.maximum(np.abs(self._sums(diagonal[..., rest:])), 1e-12)))
        return np.concatenate(shares, axis=-1)

    def metric_blocks(self, at: Evaluation) -> np.ndarray:
        """The same as blocks (.., points, k, k)."""
        return self.metric_diagonal(at)[..., None] * np.eye(self.k)

    def metric(self, at: Evaluation) -> np.ndarray:
        """The same as a dense matrix of the size of the Hessian."""
        return self.assembled(self.metric_blocks(at))

    def squared(self, at: Evaluation, moved: np.ndarray) -> Any:
        """The squared length in the metric of a step that has ``moved`` the variables."""
        return (self.metric_diagonal(at) * moved**2).sum((-2, -1))

    # ends

    def _add_ends(self, at: Evaluation, z: np.ndarray) -> None:
        """Take the cost and the equations of the ends into an evaluation."""
        at.ends = ends = self._evaluate_ends(z)
        at.value, at.scale = at.value + float(ends[0][0, 0]), at.scale + abs(float(ends[0][0, 0]))
        places, of_ends = self._end_positions
        np.add.at(at.gradient, places, ends[1].ravel()[of_ends])
        at.conditions = np.concatenate([at.conditions, ends[2].ravel()])
        block = np.zeros((ends[2].size, self.size))
        for row, own in zip(block, ends[3], strict=True):
            np.add.at(row, places, own[of_ends])
        at.jacobian = np.vstack([at.jacobian, block])

    @cached_property
    def joint_numbers(self) -> np.ndarray:
        """Numbers of the coefficients (places, n) that the ends' cost and equations are about: at them, and inside."""
        space, joint = self.space, self.form.ends.joint
        places = [(0, 0), (space.elements, 0)]
        for s, derivative, _ in () if joint is None else joint.inside:
            places.append((int(np.argmin(np.abs(space.vertices - s))), derivative))
        return np.array([[space.vertex_number(v, k, a) for a in range(self.n)] for v, k in places])

    @cached_property
    def _end_positions(self) -> tuple[np.ndarray, np.ndarray]:
        """Places in z, and in (y_start, y_end, y at knots, unknowns), of the end variables that are free."""
        numbers = self.joint_numbers.ravel().tolist()
        place = {int(c): i for i, c in enumerate(self.free)}
        pairs = [(place[c], i) for i, c in enumerate(numbers) if c in place]
        pairs += [(len(self.free) + j, len(numbers) + j) for j in range(self.extra)]
        rows = np.array(pairs, dtype=int).reshape(-1, 2)
        return rows[:, 0], rows[:, 1]

    def _evaluate_ends(self, z: np.ndarray) -> list[np.ndarray]:
        """End cost, its gradient, the end equations, their Jacobian, all Hessians, and the sizes of the equations."""
        form = self.form
        c = self.coefficients(z)
        places = list(c[self.joint_numbers])
        ends = at_ends(form)
        [entries] = ends(1, *(v[None] for v in (*places, self.unknowns(z), form.problem.parameter_values)))
        shapes = [ends.function.size_out(k) for k in range(ends.function.n_out())]
        columns = np.split(entries, np.cumsum([rows * width for rows, width in shapes])[:-1])
        found = [column.reshape(shape, order="F") for column, shape in zip(columns, shapes, strict=True)]
        # by how much each equation changes when its variables change by the size of the largest
        reach = np.abs(np.concatenate([*places, self.unknowns(z)])).max(initial=0.0)
        sizes = np.abs(found[3]).max(1, initial=0.0) * reach
        return [*found, np.where(sizes > 0, sizes, 1.0)]

    def end_cost(self, z: np.ndarray) -> float:
        """The cost of the ends, 0 where there is none."""
        return 0.0 if self.form.ends.joint is None else float(self._evaluate_ends(z)[0][0, 0])

    def end_curvature(self, evaluation: Evaluation, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places among the unknowns, and the second derivatives there of what the ends add to the Lagrangian."""
        if evaluation.ends is None:
            return np.zeros(0, int), np.zeros((0, 0))
        total = evaluation.ends[4].copy()
        for r in range(evaluation.ends[2].size):
            total += multipliers[len(self.equalities) + r] * evaluation.ends[5 + r]
        z, v = self._end_positions
        return z, total[np.ix_(v, v)]


def _rule(spans: np.ndarray, count: int, order: int, n: int, extra: int) -> tuple[Any, ...]:
    """The Gauss rule of ``count`` points on each of the elements, which ``spans`` (.., 2, elements) begin and end.

    Abscissae and weights (.., points), the length of the whole, the factors (.., points, k) from derivatives on
    [-1, 1] to those of the variables, and the weights with one and with two of these.
    """
    nodes, weights = gauss(count)
    lead, widths = spans.shape[:-2], spans[..., 1, :] - spans[..., 0, :]
    half = 0.5 * widths[..., None]
    x = (spans[..., 0, :, None] + half * (1 + nodes)).reshape(*lead, -1)
    powers = np.concatenate([np.repeat(np.arange(order + 1.0), n), np.zeros(extra)])
    scale = np.repeat((1.0 / half) ** powers, count, axis=-2)
    weights = (half * weights).reshape(*lead, -1)
    first = weights[..., None] * scale
    return x, weights, widths.sum(-1), scale, first, first[..., None] * scale[..., None, :]


@lru_cache(maxsize=64)
def _rule_of_one(start: float, end: float, count: int, order: int, n: int, extra: int) -> tuple[Any, ...]:
    """:func:`_rule` on one element, kept for the life of the process."""
    return _rule(np.array([[start], [end]]), count, order, n, extra)


def least_eigenvalue(blocks: np.ndarray) -> Any:
    """The least eigenvalue of symmetric blocks (.., Q, n, n) over all points; -inf where they are no numbers."""
    n = blocks.shape[-1]
    if n == 1:
        least = blocks[..., 0, 0]
    elif n == 2:  # closed form of the lesser eigenvalue; eigvalsh costs a hundred times more
        middle = 0.5 * (blocks[..., 0, 0] + blocks[..., 1, 1])
        least = middle - np.hypot(0.5 * (blocks[..., 0, 0] - blocks[..., 1, 1]), blocks[..., 0, 1])
    else:
        finite: Any = np.isfinite(blocks).all((-2, -1))
        least = np.linalg.eigvalsh(np.where(finite[..., None, None], blocks, 0.0))[..., 0]
        least = np.where(finite, least, -np.inf)
    least = least.min(-1)
    if not least.ndim:
        return least if math.isfinite(least) else -math.inf
    return np.where(np.isfinite(least), least, -np.inf)
