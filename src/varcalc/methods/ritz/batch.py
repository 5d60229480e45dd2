"""One form on one element at many ends and parameter values at once.

The arithmetic of a small problem costs less than the calls that carry it out.
Here every call serves all values: the leading axis of every array counts them.
The variables (y, y') at the Gauss points are a matrix times the unknowns, the
same for all values up to the length of the interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.ritz.integrands import integrands, pointwise, reported
from varcalc.methods.ritz.newton import ARMIJO, CONVERGED, NEARLY_SINGULAR, SHRINK, lowest_eigenvalue
from varcalc.methods.ritz.system import quadrature_points
from varcalc.numerics.mesh import Space, basis_at_gauss, gauss
from varcalc.symbolic.buffered import Pointwise
from varcalc.symbolic.columns import FewOrMany
from varcalc.symbolic.derived import derived

ITERATIONS = 12
"""Newton steps after which a value is left to a solve of its own: it begins close to a solution."""
HALVINGS = 6
FEW, CHUNK = 26, 128
"""Points evaluated in one go: as many as one curve of the lower degrees has, and of several curves."""
SEVERAL = 4
"""Functions beyond which a matrix is assembled by pairs of them."""


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
class Evaluated:
    """The functional (K,), the sum of its absolute contributions, gradients (K, N), and pointwise Hessians, weighted.

    ``blocks`` has shape (K, Q, k, k) in the variables that the matrix gives, ``legendre`` (K,) is the least
    eigenvalue of L_y'y', ``integrand`` (K, Q) what was summed. ``conditions`` (K, m) are the
    prescribed integrals less their levels, ``integrands`` (K, Q, m) what was summed for those.
    """

    value: np.ndarray
    integrand: np.ndarray
    scale: np.ndarray
    gradient: np.ndarray
    blocks: np.ndarray
    legendre: np.ndarray
    conditions: np.ndarray
    integrands: np.ndarray

    @property
    def sound(self) -> np.ndarray:
        """Where everything is a number and the Legendre condition holds; (K,) of bool."""
        return np.isfinite(self.value) & np.isfinite(self.gradient).all(1) & (self.legendre > 0.0)

    @property
    def met(self) -> np.ndarray:
        """Where every level is met; (K,) of bool."""
        return np.ones(len(self.value), dtype=bool)

    def reduced(self, matrices: np.ndarray) -> np.ndarray:
        """The matrices (K, N, N) on the directions in which the curves may move."""
        return matrices

    def __getitem__(self, rows: np.ndarray) -> Self:
        return type(self)(*(v[rows] for v in vars(self).values()))


@dataclass
class Steps:
    """Newton steps (K, N), the multipliers (K, m) that come with them, and what the functionals fall by (K,)."""

    change: np.ndarray
    multipliers: np.ndarray
    decrement: np.ndarray


@lru_cache(maxsize=64)
def _tables(n: int, degree: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (degree + 1, n) of the coefficients on [-1, 1], and the matrix (Q, 2 n, size) from them to (y, y')."""
    space = Space(np.array([-1.0, 1.0]), degree, n, 1)
    numbers, table = space.numbers[0], basis_at_gauss(1, degree, count, 1)
    whole = np.zeros((count, 2 * n, space.size))
    for a in range(n):  # all else is zero: of many functions almost everything
        for derivative in (0, 1):
            whole[:, derivative * n + a, numbers[:, a]] = table[derivative]
    return numbers, whole


class Basis:
    """What a batch of one degree has in common for all values: which coefficients are ``held`` at the ends, which free.

    ``matrix`` (Q, 2 n, N) takes the free ones to (y, y') at the Gauss points of [-1, 1], ``known`` those of the ends.
    """

    def __init__(self, held: tuple[bool, ...], degree: int) -> None:
        n, self.degree, self.count = len(held) // 2, degree, quadrature_points(degree)
        self.numbers, whole = _tables(n, degree, self.count)
        self.size = self.numbers.size
        self.held_ends = np.array(held)
        self.held = np.concatenate([self.numbers[0], self.numbers[1]])[self.held_ends]
        self.free = np.delete(np.arange(self.size), self.held)
        self.matrix = np.ascontiguousarray(whole[:, :, self.free])
        points = self.count * 2 * n
        self.flat = self.matrix.reshape(points, len(self.free))
        self.known = whole[:, :, self.held].reshape(points, len(self.held)).T
        self._n, self._pairs = n, None
        if n > SEVERAL:
            own = whole[:, ::n, self.numbers[:, 0]]
            self._pairs = np.einsum("qdi,qej->ijqde", own, own).reshape(len(self.numbers) ** 2, -1)
            self._order = np.argsort(self.numbers.ravel())[self.free]

    def assembled(self, blocks: np.ndarray) -> np.ndarray:
        """The matrices (K, N, N) of pointwise quadratic forms (K, Q, k, k) on [-1, 1].

        Each function has the same polynomials, so that the entries of all pairs of several functions are one
        product of what two polynomials contribute at a point: quadratic in their number, not cubic.
        """
        count, n = len(blocks), self._n
        if self._pairs is None:
            return self.flat.T @ (blocks @ self.matrix).reshape(count, *self.flat.shape)
        rows = blocks.reshape(count, self.count, 2, n, 2, n).swapaxes(3, 4).reshape(count, -1, n * n)
        size = len(self.numbers)
        whole = (self._pairs @ rows).reshape(count, size, size, n, n).swapaxes(2, 3).reshape(count, size * n, size * n)
        return whole[:, self._order[:, None], self._order]

    @staticmethod
    def of(form: Form, degree: int) -> Basis:
        """The basis of a form, kept for the life of the process."""
        held = np.logical_not(np.isnan([*form.fixed_start[0], *form.fixed_end[0]]))
        return _basis(tuple(held.tolist()), degree)


@lru_cache(maxsize=64)
def _basis(held: tuple[bool, ...], degree: int) -> Basis:
    return Basis(held, degree)


class Batch:
    """The discretised functionals of ``form`` at ``places``, polynomials of one degree."""

    levels = np.zeros(0)
    """The values (m,) that integrals have to have."""

    def __init__(self, form: Form, degree: int, places: Places) -> None:
        self.form, self.places, self.n = form, places, form.n
        self.basis = Basis.of(form, degree)
        self.degree, self.count = degree, self.basis.count
        self.matrix, self.flat = self.basis.matrix, self.basis.flat
        self.fixed = np.hstack([places.start, places.end])[:, self.basis.held_ends]
        self.offset = self.fixed @ self.basis.known
        half = 0.5 * (places.spans[:, 1:] - places.spans[:, :1])
        nodes, weights = gauss(self.count)
        self.x = places.spans[:, :1] + half * (1 + nodes)
        self.weights = half * weights
        self.scale = np.repeat(np.hstack([np.ones_like(half), 1 / half]), self.n, axis=1)[:, None, :]
        self.first = self.weights[:, :, None] * self.scale
        self.second = self.first[:, :, :, None] * self.scale[:, :, None, :]

    def restricted(self, rows: np.ndarray) -> Self:
        """The batch of some of the values."""
        if rows.dtype == bool and rows.all():
            return self
        other = object.__new__(type(self))
        other.__dict__ = self.__dict__ | {
            "places": self.places[rows],
            **{
                name: getattr(self, name)[rows]
                for name in ("fixed", "offset", "x", "weights", "scale", "first", "second")
            },
        }
        return other

    # unknowns

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """All coefficients, those of the ends included; (K, size)."""
        out = np.empty((len(z), self.basis.size))
        out[:, self.basis.free], out[:, self.basis.held] = z, self.fixed
        return out

    def of_degree(self, coefficients: np.ndarray, degree: int) -> np.ndarray:
        """The unknowns of curves given by coefficients (K, size) of another degree; bubbles beyond are left out."""
        if degree == self.degree:
            return coefficients[:, self.basis.free]
        other = Basis.of(self.form, degree).numbers
        common = min(self.degree, degree) + 1
        out = np.zeros((len(coefficients), self.basis.size))
        out[:, self.basis.numbers[:common].ravel()] = coefficients[:, other[:common].ravel()]
        return out[:, self.basis.free]

    # evaluation

    def variables(self, z: np.ndarray) -> np.ndarray:
        """(y, y') at the Gauss points; (K, Q, 2 n)."""
        shape = (len(z), self.count, 2 * self.n)
        return (self.offset + z @ self.flat.T).reshape(shape) * self.scale

    def moved(self, step: np.ndarray) -> np.ndarray:
        """By how much a step of the unknowns changes them."""
        return (step @ self.flat.T).reshape(len(step), self.count, 2 * self.n) * self.scale

    def _called(self, make: Callable[[Form], ca.Function], variables: np.ndarray) -> np.ndarray:
        points = self.x.size
        rows = variables.reshape(points, -1)
        blank = np.zeros((1, 0))
        parameters = np.repeat(self.places.parameters, self.count, axis=0)
        out = _at_points(self.form, make, FEW if self.x.size <= CHUNK else CHUNK)(
            points, self.x.reshape(-1, 1), rows[:, : self.n], rows[:, self.n :], blank, parameters, blank
        )
        return out.reshape(*self.x.shape, -1)

    def evaluate(self, z: np.ndarray, multipliers: np.ndarray | None = None) -> Evaluated:  # noqa: ARG002  no levels
        """The functionals and their derivatives; inf or NaN outside the domain.

        ``multipliers`` (K, m) are those of the levels; see :class:`varcalc.methods.ritz.levelled.Levelled`.
        """
        k, variables = 2 * self.n, self.variables(z)
        out = self._called(pointwise, variables)
        value = (self.weights * out[:, :, 0]).sum(1)
        scale = (self.weights * np.abs(out[:, :, 0])).sum(1)
        if self.form.one_sided:
            value = np.where((variables[:, :, self.form.one_sided] < 0).any((1, 2)), np.inf, value)
        gradient = (out[:, :, 1 : 1 + k] * self.first).reshape(len(z), -1) @ self.flat
        hessians = out[:, :, 1 + k :].reshape(*self.x.shape, k, k)
        legendre = least_eigenvalue(hessians[:, :, self.n :, self.n :])
        none = np.zeros((*self.x.shape, 0))
        return Evaluated(
            value, out[:, :, 0], scale, gradient, hessians * self.second, legendre, none[:, 0], none
        )  # fmt: skip

    def checked(self, z: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # noqa: ARG002
        """What is minimised alone, and whether the levels are met; (K,) each."""
        value = (self.weights * self._called(integrands, self.variables(z))[:, :, 0]).sum(1)
        return value, np.ones(len(z), dtype=bool)

    def newton(self, at: Evaluated) -> Steps:
        """The Newton steps, where the second variation is positive."""
        step = -solutions(self.assembled(at.blocks), at.gradient)
        return Steps(step, np.zeros((len(step), 0)), -0.5 * np.einsum("kn,kn->k", step, at.gradient))

    def minimise(self, z: np.ndarray, *, shifting: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """The minima from ``z``, their multipliers (K, m), where they are, and the steps taken: :func:`minimise`."""
        z, found, steps = minimise(self, z, shifting=shifting)
        return z, np.zeros((len(z), 0)), found, steps

    def assembled(self, blocks: np.ndarray) -> np.ndarray:
        """The matrices (K, N, N) of pointwise quadratic forms (K, Q, k, k)."""
        return self.basis.assembled(blocks)

    def leading(self, at: Evaluated) -> np.ndarray:
        """Pointwise blocks of the leading term: L_y'y' in the slopes, and in y on the interval's length."""
        n, length = self.n, np.diff(self.places.spans, axis=1)[:, :, None, None]
        blocks = np.zeros_like(at.blocks)
        top = at.blocks[:, :, n:, n:]
        blocks[:, :, n:, n:] = top
        # the weights hold the factor of the slopes' scale, which y has not
        blocks[:, :, :n, :n] = top / (self.scale[:, :, None, -1:] * length) ** 2
        return blocks

    def _weights(self, at: Evaluated) -> np.ndarray:
        """The diagonal (K, Q, 2 n) of the metric, which weighs each function by its own L_y'y'."""
        n, length = self.n, np.diff(self.places.spans, axis=1)[:, :, None]
        weight = np.abs(np.einsum("kqaa->kqa", at.blocks[:, :, n:, n:]))
        return np.concatenate([weight / (self.scale[:, :, -1:] * length) ** 2, weight], axis=2)

    def metric(self, at: Evaluated) -> np.ndarray:
        """Pointwise blocks of the metric."""
        return self._weights(at)[:, :, :, None] * np.eye(2 * self.n)

    def squared(self, at: Evaluated, step: np.ndarray) -> np.ndarray:
        """The squared length of steps in the metric; (K,)."""
        moved = (step @ self.flat.T).reshape(len(step), self.count, 2 * self.n)
        return (self._weights(at) * moved**2).sum((1, 2))

    def reported(self, variables: np.ndarray) -> np.ndarray:
        """The reported integrand and, where the form is lifted, x, y, dx/ds, dy/ds; (K, Q, rows)."""
        return self._called(reported, variables)


def prepare(form: Form) -> None:
    """Build the functions that batches of a form call; they are kept with it."""
    pointwise(form)
    integrands(form)
    if not form.plainly_reported:
        reported(form)


@derived
def _at_points(form: Form, make: Callable[[Form], ca.Function], chunk: int) -> Pointwise | FewOrMany:
    """A function of the form at points, in pieces of the size of one curve or of many."""
    return Pointwise(make(form), chunk) if chunk < CHUNK else FewOrMany(make(form), chunk)


def least_eigenvalue(blocks: np.ndarray) -> np.ndarray:
    """The least eigenvalue of symmetric blocks (K, Q, n, n) over all points; -inf where they are no numbers."""
    n = blocks.shape[-1]
    if n == 1:
        least = blocks[:, :, 0, 0]
    elif n == 2:
        middle = 0.5 * (blocks[:, :, 0, 0] + blocks[:, :, 1, 1])
        least = middle - np.hypot(0.5 * (blocks[:, :, 0, 0] - blocks[:, :, 1, 1]), blocks[:, :, 0, 1])
    else:
        finite = np.all(np.isfinite(blocks), axis=(2, 3), keepdims=True)
        least = np.linalg.eigvalsh(np.where(finite, blocks, 0.0))[:, :, 0]
        least = np.where(finite[:, :, 0, 0], least, -np.inf)
    return np.min(np.where(np.isfinite(least), least, -np.inf), axis=1)


def positive(matrices: np.ndarray) -> np.ndarray:
    """Which of the symmetric matrices (K, N, N) are positive definite; (K,) of bool."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.zeros(1, dtype=bool)
        half = len(matrices) // 2
        return np.concatenate([positive(matrices[:half]), positive(matrices[half:])])
    return np.ones(len(matrices), dtype=bool)


def solutions(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solutions (K, N) of linear equations, not numbers where a matrix is singular."""
    try:
        return np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([solutions(matrices[k : k + 1], right[k : k + 1]) for k in range(len(matrices))])


def minimise(batch: Batch, z: np.ndarray, *, shifting: bool) -> tuple[np.ndarray, np.ndarray, int]:
    """Newton's guarded iteration from ``z`` (K, N) for all values; the minima, where they are, and the steps taken.

    Where a Hessian is not positive it is shifted by a multiple of the metric, as in
    :mod:`varcalc.methods.ritz.newton`, or, without ``shifting``, the value is given up; so is one
    where no step descends.
    """
    z = z.copy()
    done = np.zeros(len(z), dtype=bool)
    at = batch.evaluate(z)
    rows = np.flatnonzero(at.sound)
    batch, at = batch.restricted(rows), at[rows]
    for iteration in range(1, ITERATIONS + 1):
        if not len(rows):
            return z, done, iteration - 1
        hessians = batch.assembled(at.blocks)
        definite = positive(hessians)
        if shifting and not definite.all():
            hessians = _shifted(batch, at, hessians, definite)
        elif not definite.all():
            rows, batch, at, hessians = rows[definite], batch.restricted(definite), at[definite], hessians[definite]
            definite = definite[definite]
        step = -solutions(hessians, at.gradient)
        decrement = -0.5 * np.einsum("kn,kn->k", step, at.gradient)
        last = definite & (decrement <= CONVERGED * at.scale)
        if last.any():
            z[rows[last]] += step[last]
            done[rows[last]] = True
            rows, batch, at, step = rows[~last], batch.restricted(~last), at[~last], step[~last]
        if len(rows):
            found, z[rows], at = _search(batch, z[rows], at, step)
            rows, batch, at = rows[found], batch.restricted(found), at[found]
    return z, done, ITERATIONS


def _shifted(batch: Batch, at: Evaluated, hessians: np.ndarray, definite: np.ndarray) -> np.ndarray:
    """The Hessians with those that are not positive made so."""
    bad = np.flatnonzero(~definite)
    metrics = batch.restricted(bad).assembled(batch.restricted(bad).metric(at[bad]))
    out = hessians.copy()
    for k, metric in zip(bad, metrics, strict=True):
        lowest = lowest_eigenvalue(hessians[k], metric)
        # along a symmetry, or where there is no metric, nothing tells how far to go
        shift = -1.5 * lowest if lowest < -NEARLY_SINGULAR else np.nan
        out[k] = hessians[k] + shift * metric
    return out


def _search(batch: Batch, z: np.ndarray, at: Evaluated, step: np.ndarray) -> tuple[np.ndarray, np.ndarray, Evaluated]:
    """Backtrack to where the functional falls, inside the guarded domain; where that was found, and what is there."""
    fall = np.einsum("kn,kn->k", step, at.gradient)
    noise = 1e-14 * (at.scale + np.abs(at.value))
    length = 1.0
    moved = z + step
    trial = batch.evaluate(moved)
    found = trial.sound & (trial.value <= at.value + ARMIJO * fall + noise)
    for _ in range(HALVINGS):
        left = np.flatnonzero(~found)
        if not len(left):
            break
        length *= SHRINK
        shorter = z[left] + length * step[left]
        there = batch.restricted(left).evaluate(shorter)
        good = there.sound & (there.value <= at.value[left] + ARMIJO * length * fall[left] + noise[left])
        moved[left[good]] = shorter[good]
        for name, values in vars(there).items():
            getattr(trial, name)[left[good]] = values[good]
        found[left[good]] = True
    return found, moved, trial
