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

from varcalc.integrators import Flow, RunOutcome
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales
from varcalc.methods.shooting.linear_systems import RANK, ROUGH_RANK, Jacobian
from varcalc.methods.shooting.regular_arc import RegularEnd, Work
from varcalc.methods.shooting.shots import Failure, Paths, Shots
from varcalc.problem.breaks import switches_of

MODERATE = 1e6
"""Growth across a segment up to which small singular values are taken for symmetries, not for lost digits."""


@dataclass(frozen=True)
class Mismatch:
    """What is left open at given unknowns: ``residual`` (M,) with its Jacobian, and what the runs told.

    ``totals`` are the running integrals over the whole interval, scaled; ``growth`` (N,) the
    largest factor by which a segment magnifies an error of its initial state; ``summed`` (M,)
    the size of the integrals that a row is made of; ``steps`` what the integrations took.
    """

    residual: np.ndarray
    jacobian: Jacobian
    totals: np.ndarray
    growth: np.ndarray
    shots: Shots
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

    @cached_property
    def _lines(self) -> np.ndarray:
        """Origin and stretch of the abscissa (N, 2)."""
        return np.array([
            self.equations.line(self.vertices[i], self.vertices[i + 1], (self._apart(i), self._apart(i + 1)))
            for i in range(self.count)
        ])  # fmt: skip

    def _apart(self, i: int) -> bool:
        """Whether the integrand may jump at vertex i: a knot, or an end at which a switch may go over as well."""
        return i in self.knots or (i in (0, self.count) and bool(switches_of(self.equations.form.problem)))

    def constants(self, x: np.ndarray) -> np.ndarray:
        """The constants (N, c) of the scaled system at x, a row for each segment."""
        _, unknowns, lambdas, _ = self.parts(x)
        shared = np.concatenate([self.scales.all, self._parameters, unknowns, lambdas])
        return np.concatenate([self._lines, np.broadcast_to(shared, (self.count, len(shared)))], axis=1)

    @property
    def _parameters(self) -> np.ndarray:
        return self.equations.form.problem.parameter_values

    def paths(self, x: np.ndarray, level: int, taken: np.ndarray | int | None = None) -> Paths:
        """All segments with their initial states at x; ``taken`` are steps of which twice as many are to be taken."""
        return Paths(
            self.equations, self.flow, self.work, self.vertices, self.anchors, self.parts(x)[0], self.constants(x),
            self.regular, level, taken,
        )  # fmt: skip

    def evaluate(
        self, x: np.ndarray, *, level: int = 0, every: bool = False, taken: np.ndarray | int | None = None
    ) -> Mismatch | Failure:
        """The mismatch at x with its Jacobian, or the first integration that failed (``every``: all that fail)."""
        shot = self.paths(x, level, taken).shots(every=every)
        if isinstance(shot, Failure):
            return shot
        shots, steps = shot
        totals = shots.totals(self.dimension)
        inner, before, after, shared = self._match(shots, x)
        closing, terms, direct, summed = self._close(shots, totals, x)
        D = self.dimension
        residual = np.concatenate([inner.ravel(), closing])
        jacobian = Jacobian(before, after, shared, terms[:, :, :D], direct, RANK if level >= 0 else ROUGH_RANK)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian.values).all()):
            return self._not_finite(residual)
        summed = np.concatenate([np.zeros(inner.size), summed])
        growth = np.maximum(self._growth(shots.left_by), self._growth(shots.right_by))
        return Mismatch(residual, jacobian, totals, growth, shots, summed, steps)

    def _growth(self, by: np.ndarray) -> np.ndarray:
        """How much y is magnified by y, y' by y', and so on (N,): row sums of the diagonal blocks, free of units."""
        n = self.equations.form.n
        blocks = (np.abs(by[:, k : k + n, k : k + n]) for k in range(0, self.dimension, n))
        return np.max([block.sum(axis=2).max(axis=1) for block in blocks], axis=0)

    def _not_finite(self, residual: np.ndarray) -> Failure:
        first = int(np.argmax(~np.isfinite(residual))) // self.dimension
        a, b = self.equations.form.span
        here = a + (b - a) * float(self.vertices[min(first + 1, self.count)])
        return Failure((min(first, self.count - 1),), here, RunOutcome.NOT_FINITE)

    def _match(self, shots: Shots, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """The rows (N - 1, D) of the inner vertices, and their derivatives as a Jacobian takes them.

        That is plain continuity, or the condition of a knot.
        """
        D = self.dimension
        value = shots.right[:-1, :D] - shots.left[1:, :D]
        before, after = shots.right_by[:-1, :D].copy(), -shots.left_by[1:, :D]
        direct = np.zeros((self.count - 1, D, self.shared + self.equations.end_equations))
        _, unknowns, lambdas, _ = self.parts(x)
        for i, condition in self.knots.items():
            sides = shots.right[i - 1, :D], shots.left[i, :D]
            out = condition(self.scales.all, self._parameters, *sides, unknowns, lambdas)
            jacobian = np.asarray(out[1])
            value[i - 1] = np.asarray(out[0]).ravel()
            before[i - 1] = jacobian[:, :D] @ before[i - 1]
            after[i - 1] = -jacobian[:, D : 2 * D] @ after[i - 1]
            direct[i - 1, :, : self.shared] = jacobian[:, 2 * D :]
        direct[:, :, : self.shared] += before[:, :, D:] + after[:, :, D:]
        return value, before[:, :, :D], after[:, :, :D], direct

    def _close(self, shots: Shots, totals: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """The rows (R,) that tie the ends, the integrals and the unknown numbers, and the integrals' share of them.

        Between the two come their derivatives by the states of the segments (R, N, D) and by all else.
        """
        D, n = self.dimension, self.equations.form.n
        _, unknowns, lambdas, nus = self.parts(x)
        given = [self.scales.all, self._parameters, shots.left[0, :D], shots.right[-1, :D]]
        value, jacobian = self.equations.closed(*given, totals, unknowns, lambdas, nus)
        by_first, by_last, by_totals, direct = np.split(jacobian, np.cumsum([D, D, len(totals)]), axis=1)
        terms = by_totals @ (shots.right_by[:, D:] - shots.left_by[:, D:])
        terms[0] += by_first @ shots.left_by[0, :D]
        terms[-1] += by_last @ shots.right_by[-1, :D]
        for i, closure in shots.closures.items():
            place = slice(0, n) if closure.at == 0.0 else slice(n, 2 * n)  # the rows of the singular end
            value[place], terms[i, place] = closure.residual, closure.by
        direct = direct.copy()
        direct[:, : self.shared] += terms[:, :, D:].sum(axis=0)
        return value, terms.swapaxes(0, 1), direct, np.abs(by_totals) @ np.abs(totals)

    def left_open(self, at: Mismatch, x: np.ndarray) -> float:
        """The largest residual relative to its row of the Jacobian: what steps in a singular system cannot reach."""
        rows = self._rows(at, self._sizes(x))
        return float(np.max(np.abs(at.residual) / np.where(rows == 0.0, 1.0, rows)))

    def shaken(self, at: Mismatch, x: np.ndarray, weights: np.ndarray, share: float) -> np.ndarray | None:
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

    def _rows(self, at: Mismatch, weights: np.ndarray) -> np.ndarray:
        """The largest entry of each row (M,) of the Jacobian, the unknowns being of sizes ``weights`` (M,).

        A prescribed integral has the rounding of what it is summed from, however little it depends on the unknowns.
        """
        return np.maximum(at.summed, at.jacobian.rows(weights))

    def solve(self, at: Mismatch, right: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        """The solution of Jacobian . dx = right; None when the Jacobian is singular to working precision.

        ``weights`` (M,) are the sizes of the unknowns. A problem with a
        symmetry, such as a closed curve that may be shifted along itself,
        leaves dx open: there the shortest is taken.
        """
        return at.jacobian.solve(right, weights, symmetries=bool(at.growth.max() < MODERATE))

    def halved(
        self, x: np.ndarray, marked: np.ndarray, states_at: Callable[[np.ndarray, np.ndarray], np.ndarray]
    ) -> tuple[Segments, np.ndarray]:
        """Cut the ``marked`` segments in two; ``states_at(segments, t)`` gives the new anchors' states (m, D)."""
        states, unknowns, lambdas, nus = self.parts(x)
        left, right = self.vertices[:-1], self.vertices[1:]
        vertices = np.sort(np.concatenate([self.vertices, 0.5 * (left + right)[marked]]))
        own = np.repeat(np.arange(self.count), np.where(marked, 2, 1))
        share = ((self.anchors - left) / (right - left))[own]
        inner = np.where(share == 1.0, vertices[1:], vertices[:-1] + share * np.diff(vertices))
        anchors = np.where(marked[own], inner, self.anchors[own])
        new = np.flatnonzero(anchors != self.anchors[own])
        states = states[own]
        states[new] = states_at(own[new], anchors[new])
        knots = {int(np.searchsorted(vertices, self.vertices[i])): knot for i, knot in self.knots.items()}
        finer = replace(self, vertices=vertices, anchors=anchors, knots=knots)
        return finer, np.concatenate([states.ravel(), unknowns, lambdas, nus])
