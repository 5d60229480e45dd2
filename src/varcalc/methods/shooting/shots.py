"""Where the segments of multiple shooting lead: integrated all together, or along a regular arc at a singular end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from varcalc.integrators import OUTCOMES, Flow, Landing, Outcome
from varcalc.integrators.protocol import COMPLETED
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.methods.shooting.regular_arc import Passage, RegularEnd, Work


@dataclass(frozen=True)
class Failure:
    """Integrations that did not reach their ends: the segments, where (in s) and how the first of them ended."""

    segments: tuple[int, ...]
    s: float
    outcome: Outcome


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
class Shot:
    """A segment's states at its two vertices with their sensitivities; integrals run from left to right."""

    left: np.ndarray
    right: np.ndarray
    left_by: np.ndarray
    right_by: np.ndarray
    closure: Closure | None = None


@dataclass(frozen=True)
class Paths:
    """The ways from the anchors t = ``anchors`` (N,) of the segments to both their ``vertices`` (N + 1,).

    Each sets out from its anchor's scaled state (N, D) with its ``constants`` (N, c). ``regular`` are the singular ends
    at the start and at the end, each the business of the segment that touches it, whose anchor is the other vertex.
    ``usual`` are the steps that the integrations take at level 0, where they are known.
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
    usual: np.ndarray | None = None

    def end(self, i: int) -> RegularEnd | None:
        """The singular end that segment i touches."""
        if i == 0 and self.regular[0] is not None:
            return self.regular[0]
        return self.regular[1] if i == len(self.anchors) - 1 else None

    def shots(self, *, every: bool) -> tuple[list[Shot], np.ndarray] | Failure:
        """The states at all vertices and the steps that took, or the first failure (``every``: with all)."""
        arcs = {i: self._along_arc(i) for i in range(len(self.anchors)) if self.end(i) is not None}
        failures = {i: arc for i, arc in arcs.items() if isinstance(arc, Failure)}
        runs, landing = self.carried(dense=False)
        a, b = self.equations.form.span
        for row in np.flatnonzero(landing.outcomes != COMPLETED)[::-1]:
            outcome = OUTCOMES[landing.outcomes[row]]
            failures[int(runs[row, 0])] = Failure((), a + (b - a) * float(landing.reached[row]), outcome)
        if failures:
            failed = sorted(failures)
            first = failures[failed[0]]
            return Failure(tuple(failed if every else failed[:1]), first.s, first.outcome)
        shots = self._assembled(runs, landing, {i: arc for i, arc in arcs.items() if isinstance(arc, Shot)})
        return shots, landing.steps

    def carried(self, *, dense: bool) -> tuple[np.ndarray, Landing]:
        """All integrations: the segment and the vertex (0 left, 1 right) of each (m, 2), and where they came to."""
        ways = np.column_stack([self.vertices[:-1], self.vertices[1:]])
        going = ways != self.anchors[:, None]
        going[[i for i in (0, len(ways) - 1) if self.end(i) is not None]] = False
        runs = np.argwhere(going)
        segment = runs[:, 0]
        landing = self.flow.ensemble(
            self._starts()[segment], self.constants[segment], start=self.anchors[segment], until=ways[going],
            level=self.level, usual=self.usual, dense=dense,
        )  # fmt: skip
        self.work.add(landing)
        return runs, landing

    def _starts(self) -> np.ndarray:
        state = np.zeros((len(self.states), self.equations.dimension + self.equations.integrals))
        state[:, : self.equations.dimension] = self.states
        return self.equations.system.start(state)

    def _assembled(self, runs: np.ndarray, landing: Landing, arcs: dict[int, Shot]) -> list[Shot]:
        ends = np.repeat(self._starts()[:, None], 2, axis=1)
        ends[runs[:, 0], runs[:, 1]] = landing.states
        states, by = self.equations.system.split(ends)
        return [
            arcs[i] if i in arcs else Shot(states[i, 0], states[i, 1], by[i, 0], by[i, 1]) for i in range(len(ends))
        ]

    def passage(self, i: int) -> Passage | None:
        """The regular arc of segment i; None where none is found."""
        end, n = self.end(i), self.equations.form.n
        assert end is not None
        return end.passage(float(self.anchors[i]), self.states[i, :n], self.constants[i], self.level, self.work)

    def _along_arc(self, i: int) -> Shot | Failure:
        """The regular arc as a shot; it depends on the ordinates of the anchor, and demands its slope."""
        n, D = self.equations.form.n, self.equations.dimension
        size, end, passage = D + self.equations.integrals, self.end(i), self.passage(i)
        assert end is not None
        if passage is None:
            a, b = self.equations.form.span
            return Failure((i,), a + (b - a) * float(self.anchors[i]), Outcome.UNRESOLVED)
        columns = D + passage.near_by.shape[1] - n
        given = [*range(n), *range(D, columns)]
        near, far = np.zeros(size), np.concatenate([end.ordinates, passage.far, -passage.integrals])
        near[:D] = self.states[i]
        near_by, far_by, by = np.eye(size, columns), np.zeros((size, columns)), np.eye(n, columns, n)
        near_by[:, D:] = 0.0
        far_by[n:D, given], far_by[D:, given] = passage.far_by, -passage.integrals_by
        by[:, given] -= passage.near_by
        closure = Closure(end.at, self.states[i, n:] - passage.near, by)
        if end.at == self.vertices[i]:
            return Shot(far, near, far_by, near_by, closure)
        return Shot(near, far, near_by, far_by, closure)


@dataclass
class Trajectories:
    """The states between all vertices, integrated once more when they are first asked for."""

    paths: Paths
    _dense: dict[tuple[int, int], Any] = field(default_factory=dict, repr=False)
    _arcs: dict[int, Passage] = field(default_factory=dict, repr=False)
    _known: bool = False

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """The scaled states (D, m) at t (m,)."""
        self._integrated()
        paths, D = self.paths, self.paths.equations.dimension
        at = np.clip(np.searchsorted(paths.vertices, t, side="right") - 1, 0, len(paths.anchors) - 1)
        out = np.empty((D, len(t)))
        for i in map(int, np.unique(at)):
            end, anchor = paths.end(i), float(paths.anchors[i])
            if end is not None:
                out[:, at == i] = end.states(anchor, self._arcs[i], t[at == i]).T
                continue
            before = (at == i) & ((t < anchor) | (anchor == paths.vertices[i + 1]))
            for side, chosen in ((0, before), (1, (at == i) & ~before)):
                if chosen.any():
                    low, high = sorted((anchor, float(paths.vertices[i + side])))
                    out[:, chosen] = self._dense[i, side](np.clip(t[chosen], low, high))[:, :D].T
        return out

    def _integrated(self) -> None:
        """Integrate all segments, which have arrived at their vertices before."""
        if self._known:
            return
        runs, landing = self.paths.carried(dense=True)
        assert landing.dense is not None
        self._dense.update({(int(i), int(side)): run for (i, side), run in zip(runs, landing.dense, strict=True)})
        for i in range(len(self.paths.anchors)):
            if self.paths.end(i) is not None and (arc := self.paths.passage(i)) is not None:
                self._arcs[i] = arc
        self._known = True
