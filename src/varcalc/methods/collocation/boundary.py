"""Boundary and corner conditions as rows of a collocation system.

At an end the boundary terms of the first variation vanish for every variation
the end allows: momentum, plus the derivative of the end cost and of nu times
the end equations, is zero in each free component (natural conditions and
transversality; Gelfand and Fomin, "Calculus of Variations", sect. 6, 13 and
14). Between periodic ends and across a knot the momenta agree (Weierstrass and
Erdmann; sect. 15).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.collocation.stationarity import Stationarity
from varcalc.numerics.mesh import Space
from varcalc.symbolic.evaluation import PointEvaluator

KNOT_OFFSET = 4.0 * np.finfo(float).eps
"""Relative distance from a knot at which its two sides are evaluated."""

Triplets = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Rows, columns and values of entries of a matrix; columns below zero are dropped."""


@dataclass(frozen=True)
class BoundaryValues:
    """Momenta at the places of :class:`Boundary`, and the end terms, each with its Jacobian."""

    momentum: np.ndarray
    ends: tuple[np.ndarray, np.ndarray] | None


NO_BOUNDARY = BoundaryValues(np.zeros((0, 0)), None)
"""What there is to know where no row belongs to an end or a knot."""


class Boundary:
    """The boundary rows of a form on a space, numbered from ``first``.

    ``place`` gives the column of each coefficient, -1 where it is fixed.
    ``count`` is the number of rows.
    """

    def __init__(self, form: Form, space: Space, conditions: Stationarity, place: np.ndarray, first: int) -> None:
        self.form, self.space, self.place, self.first = form, space, place, first
        self.counts, self.conditions = conditions.counts, conditions
        self._at_ends = None if conditions.ends is None else PointEvaluator(conditions.ends)
        m = space.smoothness
        self._at = [(form.span[0], space.numbers[0, :m]), (form.span[1], space.numbers[-1, m : 2 * m])]
        self._terms: list[tuple[int, int, int, float]] = []
        """(row, place, momentum, sign)"""
        self._equal: list[tuple[int, int, int]] = []
        """(row, plus, minus): coefficients that must agree"""
        self._end_rows: list[tuple[int, int]] = []
        """(row, entry of the gradient of the end terms)"""
        self.count = 0
        for k in range(form.order):
            for a in range(form.n):
                if form.ends.periodic:
                    self._join(k, a)
                else:
                    self._free_ends(k, a)
        for vertex in space.broken:
            self._corner(vertex)
        if self.count or conditions.ends is not None:
            self._wire()

    def _join(self, k: int, a: int) -> None:
        """Periodic ends: the derivative agrees, and the momentum with it."""
        n, row = self.form.n, self.first + self.count
        self._equal.append((row, int(self._at[0][1][k, a]), int(self._at[1][1][k, a])))
        self._terms += [(row + 1, 0, k * n + a, -1.0), (row + 1, 1, k * n + a, 1.0)]
        self._end_rows += [(row + 1, a), (row + 1, n + a)] if k == 0 else []
        self.count += 2

    def _free_ends(self, k: int, a: int) -> None:
        """The natural condition at either end where the k-th derivative of function a is free."""
        n = self.form.n
        for end, sign in ((0, -1.0), (1, 1.0)):
            if self.place[self._at[end][1][k, a]] >= 0:
                row = self.first + self.count
                self._terms.append((row, end, k * n + a, sign))
                self._end_rows += [(row, end * n + a)] if k == 0 else []
                self.count += 1

    def _corner(self, vertex: int) -> None:
        """Momenta agree on both sides of a knot, but for what a waypoint prescribes there."""
        m, n, reach = self.space.smoothness, self.form.n, KNOT_OFFSET * max(map(abs, self.form.span))
        x = float(self.space.vertices[vertex])
        left, right = self.space.numbers[vertex - 1, m : 2 * m], self.space.numbers[vertex, :m]
        self._at += [(x - reach, left), (x + reach, right)]
        for k in range(self.form.order):
            for a in range(n):
                if self.place[left[k, a]] >= 0:
                    row, last = self.first + self.count, len(self._at) - 1
                    self._terms += [(row, last - 1, k * n + a, 1.0), (row, last, k * n + a, -1.0)]
                    self.count += 1

    def _wire(self) -> None:
        c, count = self.counts, len(self._at)
        momentum = None if self.conditions.momentum is None else PointEvaluator(self.conditions.momentum)
        order = "C" if momentum is None else momentum.order(count)
        self.numbers = np.array([numbers for _, numbers in self._at])
        powers = np.arange(self.space.smoothness)
        self._scale = self.space.vertex_scale ** (-1.0 * powers)
        self._inputs = [np.array([[x] for x, _ in self._at])]
        self._inputs += [np.zeros((count, c.functions), order=order) for _ in powers]
        self._inputs += [np.array(np.tile(self.form.problem.parameter_values, (count, 1)), order=order)]
        self._inputs += [np.zeros((count, width), order=order) for width in (c.numbers, c.levels)]
        rows, columns = c.order * c.functions, len(powers) * c.functions + c.numbers + c.levels
        self._output = np.zeros((count, rows * (1 + columns)), order=order)
        if momentum is not None:
            self._run = momentum.bound(self._inputs, self._output)

    def evaluate(
        self, coefficients: np.ndarray, unknowns: np.ndarray, levels: np.ndarray, ends: np.ndarray
    ) -> BoundaryValues:
        """Momenta and end terms for a curve, its unknown numbers and its multipliers."""
        if not self.count and self.conditions.ends is None:
            return NO_BOUNDARY
        momentum = self._output
        if self.conditions.momentum is not None:
            values = coefficients[self.numbers] * self._scale[None, :, None]
            for d in range(self.space.smoothness):
                self._inputs[1 + d][:] = values[:, d]
            self._inputs[-2][:], self._inputs[-1][:] = unknowns, levels
            self._run()
            momentum = self._output.copy()
        if self._at_ends is None:
            return BoundaryValues(momentum, None)
        first, last = coefficients[self.numbers[0, 0]], coefficients[self.numbers[1, 0]]
        given = (first, last, self.form.problem.parameter_values, unknowns, ends)
        out = self._at_ends(1, *(numbers[None] for numbers in given))[0]
        rows, columns = self._at_ends.function.size_out(1)
        return BoundaryValues(momentum, (out[:rows], out[rows:].reshape((rows, columns), order="F")))

    def rows(self, coefficients: np.ndarray, values: BoundaryValues) -> np.ndarray:
        """The residual of the boundary rows, shape (count,)."""
        rows = np.zeros(self.count)
        for row, place, item, sign in self._terms:
            rows[row - self.first] += sign * values.momentum[place, item]
        for row, plus, minus in self._equal:
            rows[row - self.first] = coefficients[plus] - coefficients[minus]
        if values.ends is not None:
            for row, entry in self._end_rows:
                rows[row - self.first] += values.ends[0][entry]
        return rows

    def triplets(self, values: BoundaryValues, numbers: np.ndarray) -> list[Triplets]:
        """Entries of the Jacobian but for the end terms; ``numbers`` are the columns of unknowns and levels."""
        parts: list[Triplets] = []
        scale = np.repeat(self._scale, self.form.n)
        count = self.counts.order * self.counts.functions
        for row, place, item, sign in self._terms:
            derivatives = values.momentum[place, count:].reshape(-1, count)[:, item] * sign
            derivatives[: len(scale)] *= scale
            columns = np.concatenate([self.place[self.numbers[place]].ravel(), numbers])
            parts.append((np.full(len(columns), row), columns, derivatives))
        for row, plus, minus in self._equal:
            parts.append((np.array([row, row]), self.place[[plus, minus]], np.array([1.0, -1.0])))
        return parts

    def end_triplets(
        self, values: BoundaryValues, unknowns: np.ndarray, multipliers: np.ndarray, first: int
    ) -> list[Triplets]:
        """Entries of the Jacobian from the end terms.

        ``unknowns`` and ``multipliers`` are columns, ``first`` is the row of
        the stationarity in the unknown numbers, which the end equations follow.
        """
        if values.ends is None:
            return []
        jacobian = values.ends[1]
        columns = np.concatenate(
            [self.place[self.numbers[0, 0]], self.place[self.numbers[1, 0]], unknowns, multipliers]
        )
        inner = 2 * self.form.n
        pairs = self._end_rows + [(first + j, inner + j) for j in range(jacobian.shape[0] - inner)]
        return [(np.full(len(columns), row), columns, jacobian[entry]) for row, entry in pairs]
