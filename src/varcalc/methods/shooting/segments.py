"""Multiple shooting: the interval cut into segments, an initial state in each, and what must match.

Each segment has an anchor, the abscissa of its initial state, from which it is
integrated to both its vertices; usually the anchor is the left vertex. An
anchor inside the segment lets an end stay unevaluated where the
integrand is not a number there. Next to a singular end a segment is no integration but
a regular arc, anchored at the other vertex. Ascher, Mattheij, Russell, "Numerical Solution
of Boundary Value Problems for Ordinary Differential Equations", sect. 4.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.integrators import Flow, Outcome
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales
from varcalc.methods.shooting.linear_systems import solve_dense, solve_sparse
from varcalc.methods.shooting.regular_arc import RegularEnd, Work
from varcalc.methods.shooting.shots import Failure, Paths, Shot

DENSE = 240
"""Unknowns up to which the linear systems are solved as dense ones."""
MODERATE = 1e6
"""Growth across a segment up to which small singular values are taken for symmetries, not for lost digits."""


@dataclass(frozen=True)
class Evaluation:
    """The mismatch at given unknowns: ``residual`` (M,), its Jacobian by blocks, and what the runs told.

    ``blocks`` are (row, column, matrix) of the Jacobian; ``totals`` the
    running integrals over the whole interval, scaled; ``growth`` (N,) the
    largest factor by which a segment magnifies an error of its initial state; ``summed`` (M,)
    the size of the integrals that a row is made of; ``steps`` what the integrations took.
    """

    residual: np.ndarray
    blocks: list[tuple[int, int, np.ndarray]]
    totals: np.ndarray
    growth: np.ndarray
    shots: list[Shot]
    summed: np.ndarray
    steps: np.ndarray


@dataclass(frozen=True)
class Segments:
    """The unknowns are the anchors' states (N, D), then unknown numbers, lambdas, nus.

    ``vertices`` (N + 1,) and ``anchors`` (N,) are in t; ``knots`` gives, by
    vertex, the condition that takes the place of plain continuity; ``regular``
    the start and the end where they are singular.
    """

    equations: EulerLagrangeFlow
    flow: Flow
    work: Work
    scales: Scales
    vertices: np.ndarray
    anchors: np.ndarray
    knots: dict[int, ca.Function]
    regular: tuple[RegularEnd | None, RegularEnd | None] = (None, None)

    @cached_property
    def count(self) -> int:
        """Number of segments N."""
        return len(self.anchors)

    @property
    def dimension(self) -> int:
        """States of one segment D."""
        return self.equations.dimension

    @cached_property
    def shared(self) -> int:
        """Unknown numbers and lambdas together."""
        return self.equations.unknowns + len(self.equations.form.conditions.integrals)

    @property
    def size(self) -> int:
        """Number of unknowns M."""
        return self.count * self.dimension + self.shared + self.equations.end_equations

    def parts(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Anchor states (N, D), unknown numbers, lambdas and nus of the unknowns x (M,)."""
        cut = self.count * self.dimension
        u = cut + self.equations.unknowns
        return x[:cut].reshape(self.count, -1), x[cut:u], x[u : cut + self.shared], x[cut + self.shared :]

    def constants(self, x: np.ndarray) -> np.ndarray:
        """The constants (N, c) of the scaled system at x, a row for each segment."""
        _, unknowns, lambdas, _ = self.parts(x)
        lines = [
            self.equations.line(self.vertices[i], self.vertices[i + 1], (i in self.knots, i + 1 in self.knots))
            for i in range(self.count)
        ]
        shared = np.concatenate([self.scales.all, self._parameters, unknowns, lambdas])
        return np.column_stack([np.array(lines), np.tile(shared, (self.count, 1))])

    @property
    def _parameters(self) -> np.ndarray:
        return self.equations.form.problem.parameter_values

    def paths(self, x: np.ndarray, level: int, usual: np.ndarray | None = None) -> Paths:
        """All segments with their initial states at x; ``usual`` are the steps of level 0, where they are known."""
        return Paths(
            self.equations, self.flow, self.work, self.vertices, self.anchors, self.parts(x)[0], self.constants(x),
            self.regular, level, usual,
        )  # fmt: skip

    def evaluate(
        self, x: np.ndarray, *, level: int = 0, every: bool = False, usual: np.ndarray | None = None
    ) -> Evaluation | Failure:
        """The mismatch at x with its Jacobian, or the first integration that failed (``every``: all that fail)."""
        shot = self.paths(x, level, usual).shots(every=every)
        if isinstance(shot, Failure):
            return shot
        shots, steps = shot
        D = self.dimension
        totals = np.sum([s.right[D:] - s.left[D:] for s in shots], axis=0)
        blocks: list[tuple[int, int, np.ndarray]] = []
        rows = [self._match(i, shots, x, blocks) for i in range(1, self.count)]
        closing, integrals = self._close(shots, totals, x, blocks)
        rows.append(closing)
        growth = np.array([max(self._growth(s.left_by), self._growth(s.right_by)) for s in shots])
        residual = np.concatenate(rows)
        if not (np.all(np.isfinite(residual)) and all(np.all(np.isfinite(m)) for _, _, m in blocks)):
            return self._not_finite(residual)
        summed = np.concatenate([np.zeros(len(residual) - len(closing)), integrals])
        return Evaluation(residual, blocks, totals, growth, shots, summed, steps)

    def _growth(self, by: np.ndarray) -> float:
        """How much y is magnified by y, y' by y', and so on: row sums of the diagonal blocks, free of units."""
        n = self.equations.form.n
        blocks = (by[k : k + n, k : k + n] for k in range(0, self.dimension, n))
        return max(float(np.abs(block).sum(axis=1).max()) for block in blocks)

    def _not_finite(self, residual: np.ndarray) -> Failure:
        first = int(np.argmax(~np.isfinite(residual))) // self.dimension
        a, b = self.equations.form.span
        here = a + (b - a) * float(self.vertices[min(first + 1, self.count)])
        return Failure((min(first, self.count - 1),), here, Outcome.NOT_FINITE)

    def _match(self, i: int, shots: list[Shot], x: np.ndarray, blocks: list[tuple[int, int, np.ndarray]]) -> np.ndarray:
        """The rows of vertex i: plain continuity, or the condition of a knot."""
        D = self.dimension
        before, after = shots[i - 1], shots[i]
        by = (before.right_by[:D], after.left_by[:D])
        if i not in self.knots:
            value, direct = before.right[:D] - after.left[:D], None
            terms = (by[0], -by[1])
        else:
            _, unknowns, lambdas, _ = self.parts(x)
            arguments = [self.scales.all, self._parameters, before.right[:D], after.left[:D], unknowns, lambdas]
            out = self.knots[i](*arguments)
            value, jacobian = np.asarray(out[0]).ravel(), np.asarray(out[1])
            direct = jacobian[:, 2 * D :]
            terms = (jacobian[:, :D] @ by[0], jacobian[:, D : 2 * D] @ by[1])
        row, cut = (i - 1) * D, self.count * D
        blocks += [(row, (i - 1) * D, terms[0][:, :D]), (row, i * D, terms[1][:, :D])]
        if self.shared:
            shared = terms[0][:, D:] + terms[1][:, D:]
            blocks.append((row, cut, shared if direct is None else shared + direct))
        return value

    def _close(
        self, shots: list[Shot], totals: np.ndarray, x: np.ndarray, blocks: list[tuple[int, int, np.ndarray]]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The rows that tie the ends, the integrals and the unknown numbers, and the integrals' part of their size."""
        D, N, Q = self.dimension, self.count, self.equations.integrals
        _, unknowns, lambdas, nus = self.parts(x)
        first, last = shots[0], shots[-1]
        out = self.equations.conditions(
            self.scales.all, self._parameters, first.left[:D], last.right[:D], totals, unknowns, lambdas, nus
        )
        value, jacobian = np.asarray(out[0]).ravel(), np.asarray(out[1])
        by_first, by_last = jacobian[:, :D], jacobian[:, D : 2 * D]
        by_totals, direct = jacobian[:, 2 * D : 2 * D + Q], jacobian[:, 2 * D + Q :]
        row = (N - 1) * D
        shared = np.zeros((len(value), self.shared))
        for i, shot in enumerate(shots):
            term = by_totals @ (shot.right_by[D:] - shot.left_by[D:])
            if i == 0:
                term = term + by_first @ first.left_by[:D]
            if i == N - 1:
                term = term + by_last @ last.right_by[:D]
            if shot.closure is not None:
                n = self.equations.form.n
                place = slice(0, n) if shot.closure.at == 0.0 else slice(n, 2 * n)  # the rows of the singular end
                value[place], term[place] = shot.closure.residual, shot.closure.by
            if np.any(term[:, :D]):
                blocks.append((row, i * D, term[:, :D]))
            shared += term[:, D:]
        if direct.shape[1]:
            direct = direct.copy()
            direct[:, : self.shared] += shared
            blocks.append((row, N * D, direct))
        return value, np.abs(by_totals) @ np.abs(totals)

    def _matrix(self, at: Evaluation) -> np.ndarray:
        """The Jacobian (M, M) as a dense matrix."""
        matrix = np.zeros((self.size, self.size))
        for row, column, block in at.blocks:
            matrix[row : row + block.shape[0], column : column + block.shape[1]] += block
        return matrix

    def condition(self, at: Evaluation) -> float:
        """The condition number of the Jacobian with its rows scaled; 1 where it is too large to be looked at."""
        if self.size > DENSE:
            return 1.0
        matrix = self._matrix(at)
        rows = np.abs(matrix).max(axis=1)
        return float(np.linalg.cond(matrix / np.where(rows == 0.0, 1.0, rows)[:, None]))

    def left_open(self, at: Evaluation, x: np.ndarray) -> float:
        """The largest residual relative to its row of the Jacobian: what steps in a singular system cannot reach."""
        rows = self._rows(at, self._sizes(x))
        return float(np.max(np.abs(at.residual) / np.where(rows == 0.0, 1.0, rows)))

    def shaken(self, at: Evaluation, x: np.ndarray, weights: np.ndarray, share: float) -> np.ndarray | None:
        """The Newton step (M,) from residuals of random sign that are a ``share`` of their rows of the Jacobian."""
        signs = np.where(np.random.default_rng(0).random(self.size) < 0.5, -1.0, 1.0)
        return self.solve(at, share * signs * self._rows(at, self._sizes(x)), weights)

    def _sizes(self, x: np.ndarray) -> np.ndarray:
        """The size (M,) of each unknown, of a state's component the largest it has in any segment.

        That is what its rounding is like everywhere: a segment leads from the largest to the smallest.
        """
        sizes = np.abs(x)
        states = sizes[: self.count * self.dimension].reshape(self.count, self.dimension)
        states[:] = np.maximum(states.max(axis=0), 1.0)
        return sizes

    def _rows(self, at: Evaluation, weights: np.ndarray) -> np.ndarray:
        """The largest entry of each row (M,) of the Jacobian, the unknowns being of sizes ``weights`` (M,).

        A prescribed integral has the rounding of what it is summed from, however little it depends on the unknowns.
        """
        rows = at.summed.copy()
        for row, column, block in at.blocks:
            here, there = slice(row, row + block.shape[0]), slice(column, column + block.shape[1])
            rows[here] = np.maximum(rows[here], np.abs(block * weights[there]).max(axis=1, initial=0.0))
        return rows

    def solve(self, at: Evaluation, right: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        """The solution of Jacobian . dx = right; None when the Jacobian is singular to working precision.

        ``weights`` (M,) are the sizes of the unknowns. A problem with a
        symmetry, such as a closed curve that may be shifted along itself,
        leaves dx open: there the shortest is taken.
        """
        if self.size <= DENSE:
            out = solve_dense(self._matrix(at) * weights, right, bool(at.growth.max() < MODERATE))
            return None if out is None else weights * out
        return solve_sparse(self.size, at.blocks, right, weights)

    def halved(
        self, x: np.ndarray, marked: np.ndarray, state_at: Callable[[int, float], np.ndarray]
    ) -> tuple[Segments, np.ndarray]:
        """Cut the ``marked`` segments in two; ``state_at(segment, t)`` gives the new anchors' states (D,)."""
        states, unknowns, lambdas, nus = self.parts(x)
        vertices, anchors, out = [self.vertices[0]], [], []
        knots: dict[int, ca.Function] = {}
        for i in range(self.count):
            left, right, anchor = self.vertices[i], self.vertices[i + 1], self.anchors[i]
            if i in self.knots:
                knots[len(vertices) - 1] = self.knots[i]
            if marked[i]:
                middle = 0.5 * (left + right)
                share = 0.0 if anchor == left else 1.0 if anchor == right else 0.5
                for lower, upper in ((left, middle), (middle, right)):
                    own = lower + share * (upper - lower)
                    anchors.append(own)
                    out.append(states[i] if own == anchor else state_at(i, own))
                    vertices.append(upper)
            else:
                anchors.append(anchor)
                out.append(states[i])
                vertices.append(right)
        finer = replace(self, vertices=np.array(vertices), anchors=np.array(anchors), knots=knots)
        return finer, np.concatenate([np.concatenate(out), unknowns, lambdas, nus])
