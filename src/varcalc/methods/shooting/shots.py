"""Where the segments of multiple shooting lead: integrated all together, or along a regular arc at a singular end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np

from varcalc.integrators import OUTCOMES, Flow, Landing, RunOutcome
from varcalc.integrators.protocol import COMPLETED
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.methods.shooting.regular_arc import Passage, RegularEnd, Work


@dataclass(frozen=True)
class Failure:
    """Integrations that did not reach their ends: the segments, where (in s) and how the first of them ended."""

    segments: tuple[int, ...]
    s: float
    outcome: RunOutcome


@dataclass(frozen=True)
class Closure:
    """What a regular arc demands in the place of conditions on the singular end t = ``at``.

    The anchor has the slope of the arc: ``residual`` (n,) with its Jacobian
    ``by`` the segment's columns.
    """

    at: float
    residual: np.ndarray
    by: np.ndarray


@dataclass(frozen=True)
class Shots:
    """The segments' states (N, size) at their two vertices with their sensitivities (N, size, columns).

    The integrals run from left to right. ``closures`` are those of the segments that are regular arcs.
    """

    left: np.ndarray
    right: np.ndarray
    left_by: np.ndarray
    right_by: np.ndarray
    closures: dict[int, Closure]

    def totals(self, dimension: int) -> np.ndarray:
        """The integrals, which follow the ``dimension`` other states, over all segments together."""
        return np.sum(self.right[:, dimension:] - self.left[:, dimension:], axis=0)

    def moved(self, states: np.ndarray, numbers: np.ndarray) -> Shots:
        """To first order, after small changes of the initial ``states`` (N, D) and of the ``numbers`` they share."""
        change = np.concatenate([states, np.broadcast_to(numbers, (len(states), len(numbers)))], axis=1)[:, :, None]
        left, right = ((by @ change)[:, :, 0] for by in (self.left_by, self.right_by))
        return replace(self, left=self.left + left, right=self.right + right)


@dataclass(frozen=True)
class Paths:
    """The ways from the anchors t = ``anchors`` (N,) of the segments to both their ``vertices`` (N + 1,).

    Each sets out from its anchor's scaled state (N, D) with its ``constants`` (N, c). ``regular`` are the singular ends
    at the start and at the end, each the business of the segment that touches it, whose anchor is the other vertex.
    ``taken`` are numbers of steps; twice as many at least are to be taken.
    """

    equations: EulerLagrangeFlow
    flow: Flow
    work: Work
    vertices: np.ndarray
    anchors: np.ndarray
    states: np.ndarray
    constants: np.ndarray
    regular: tuple[RegularEnd | None, RegularEnd | None]
    level: int
    taken: np.ndarray | int | None = None

    def end(self, i: int) -> RegularEnd | None:
        """The singular end that segment i touches."""
        if i == 0 and self.regular[0] is not None:
            return self.regular[0]
        return self.regular[1] if i == len(self.anchors) - 1 else None

    @property
    def arcs(self) -> list[int]:
        """The segments that are regular arcs."""
        return [i for i in sorted({0, len(self.anchors) - 1}) if self.end(i) is not None]

    def shots(self, *, every: bool) -> tuple[Shots, np.ndarray] | Failure:
        """The states at all vertices and the steps that took, or the first failure (``every``: with all)."""
        arcs = {i: self.passage(i) for i in self.arcs}
        failures = {i: arc for i, arc in arcs.items() if isinstance(arc, Failure)}
        runs, landing = self.carried(dense=False)
        self.work.add(landing)
        failures |= self._failures(runs, landing)
        if failures:
            failed = sorted(failures)
            first = failures[failed[0]]
            return Failure(tuple(failed if every else failed[:1]), first.s, first.outcome)
        return self._assembled(runs, landing, {i: a for i, a in arcs.items() if isinstance(a, Passage)}), landing.steps

    def _failures(self, runs: np.ndarray, landing: Landing) -> dict[int, Failure]:
        """By segment, where and how integrations ended that did not reach their vertices."""
        a, b = self.equations.form.span
        return {
            int(runs[row, 0]): Failure(
                (int(runs[row, 0]),), a + (b - a) * float(landing.reached[row]), OUTCOMES[landing.outcomes[row]]
            )
            for row in np.flatnonzero(landing.outcomes != COMPLETED)[::-1]
        }

    def trajectories(self) -> Trajectories | Failure:
        """The states everywhere, integrated once more; another integrator than before may get less far."""
        runs, landing = self.carried(dense=True)
        if failures := self._failures(runs, landing):
            return failures[min(failures)]
        assert landing.dense is not None
        found: list[tuple[float, Any]] = [
            (float(min(self.anchors[i], self.vertices[i + side])), run)
            for (i, side), run in zip(runs, landing.dense, strict=True)
        ]
        for i in self.arcs:
            end, passage = self.end(i), self.passage(i)
            assert end is not None
            if isinstance(passage, Failure):
                return passage
            found.append((float(self.vertices[i]), end.arc(float(self.anchors[i]), passage)))
        found.sort(key=itemgetter(0))
        edges = np.array([*(edge for edge, _ in found), 1.0])
        return Trajectories(edges, [piece for _, piece in found], self.equations.dimension)

    def carried(self, *, dense: bool) -> tuple[np.ndarray, Landing]:
        """All integrations: the segment and the vertex (0 left, 1 right) of each (m, 2), and where they came to."""
        ways = np.column_stack([self.vertices[:-1], self.vertices[1:]])
        going = ways != self.anchors[:, None]
        going[self.arcs] = False
        runs = np.argwhere(going)
        return runs, self._carried(runs[:, 0], ways[going], dense=dense)

    def _carried(self, segment: np.ndarray, until: np.ndarray, *, dense: bool) -> Landing:
        """Integrations from the anchors of some segments (m,) to t = ``until`` (m,)."""
        longest = None if self.taken is None else np.abs(until - self.anchors[segment]) / (2 * self.taken + 1)
        return self.flow.ensemble(
            self._starts()[segment], self.constants[segment], start=self.anchors[segment], until=until,
            level=self.level, longest=longest, dense=dense,
        )  # fmt: skip

    def states_at(self, segment: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The scaled states (m, D) at t (m,), each in a segment that can be crossed."""
        landing = self._carried(segment, t, dense=False)
        self.work.add(landing)
        out = landing.states[:, : self.equations.dimension]
        for i in self.arcs:
            end, passage, own = self.end(i), self.passage(i), segment == i
            if end is not None and isinstance(passage, Passage) and own.any():
                out[own] = end.arc(float(self.anchors[i]), passage)(t[own])
        return out

    def _starts(self) -> np.ndarray:
        state = np.zeros((len(self.states), self.equations.dimension + self.equations.integrals))
        state[:, : self.equations.dimension] = self.states
        return self.equations.system.start(state)

    def _assembled(self, runs: np.ndarray, landing: Landing, arcs: dict[int, Passage]) -> Shots:
        ends = np.repeat(self._starts()[:, None], 2, axis=1)
        ends[runs[:, 0], runs[:, 1]] = landing.states
        states, by = self.equations.system.split(ends)
        shots = Shots(states[:, 0], states[:, 1], by[:, 0], by[:, 1], {})
        for i, passage in arcs.items():
            self._along_arc(i, passage, shots)
        return shots

    def passage(self, i: int) -> Passage | Failure:
        """The regular arc of segment i, or that none is found."""
        end, n, anchor = self.end(i), self.equations.form.n, float(self.anchors[i])
        assert end is not None
        passage = end.passage(anchor, self.states[i, :n], self.constants[i], max(self.level, 0), self.work)
        a, b = self.equations.form.span
        return passage or Failure((i,), a + (b - a) * anchor, RunOutcome.UNRESOLVED)

    def _along_arc(self, i: int, passage: Passage, shots: Shots) -> None:
        """Put the regular arc of segment i among the ``shots``.

        It depends on the ordinates of the anchor, and demands its slope.
        """
        n, D, end = self.equations.form.n, self.equations.dimension, self.end(i)
        assert end is not None
        columns = D + passage.near_by.shape[1] - n
        given = [*range(n), *range(D, columns)]
        left = end.at == self.vertices[i]
        far, far_by = (shots.left[i], shots.left_by[i]) if left else (shots.right[i], shots.right_by[i])
        far[:], far_by[:] = np.concatenate([end.ordinates, passage.far, -passage.integrals]), 0.0
        far_by[n:D, given], far_by[D:, given] = passage.far_by, -passage.integrals_by
        by = np.eye(n, columns, n)
        by[:, given] -= passage.near_by
        shots.closures[i] = Closure(end.at, self.states[i, n:] - passage.near, by)


@dataclass(frozen=True)
class Trajectories:
    """The states between all vertices: ``edges`` (K + 1,) in t, and in between ``pieces`` (K), functions of t (m,)."""

    edges: np.ndarray
    pieces: Sequence[Any]
    dimension: int

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """The scaled states (D, m) at t (m,)."""
        edges, pieces = self.edges, self.pieces
        at = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(pieces) - 1)
        out = np.empty((self.dimension, len(t)))
        for i in map(int, np.unique(at)):
            own = at == i
            out[:, own] = pieces[i](np.clip(t[own], edges[i], edges[i + 1]))[:, : len(out)].T
        return out
