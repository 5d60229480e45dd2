"""One segment of multiple shooting: from its initial state to both its vertices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from varcalc.integrators import Metered, Outcome, Run
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.methods.shooting.regular_arc import RegularEnd

Trajectory = Callable[[np.ndarray], np.ndarray]
"""Scaled states (m, D) at t (m,)."""


@dataclass(frozen=True)
class Stopped:
    """An integration that did not reach its end: where, in s, and how it ended."""

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
class Leg:
    """The segment from t = ``left`` to ``right`` with its scaled ``state`` (D,) at ``anchor``.

    ``regular`` is the singular end that it touches; then the anchor is the
    other vertex.
    """

    equations: EulerLagrangeFlow
    flow: Metered
    regular: RegularEnd | None
    left: float
    right: float
    anchor: float
    state: np.ndarray
    constants: np.ndarray

    def shoot(self, level: int) -> Shot | Stopped:
        """The states at both vertices, by integration or along a regular arc."""
        if self.regular is not None:
            return self._along_arc(self.regular, level)
        system, start = self.equations.system, self._start()
        ends = []
        for run in self._runs(level, dense=False):
            if run is not None and not run.completed:
                return self._stopped(run)
            ends.append(system.split(start if run is None else run.states[-1]))
        (left, left_by), (right, right_by) = ends
        return Shot(left, right, left_by, right_by)

    def _start(self) -> np.ndarray:
        return self.equations.system.start(np.concatenate([self.state, np.zeros(self.equations.integrals)]))

    def _runs(self, level: int, *, dense: bool) -> list[Run | None]:
        """From the anchor to the left and to the right vertex; None where there is no way to go."""
        return [
            None
            if stop == self.anchor
            else self.flow.run(np.array([self.anchor, stop]), self._start(), self.constants, level=level, dense=dense)
            for stop in (self.left, self.right)
        ]

    def _stopped(self, run: Run) -> Stopped:
        a, b = self.equations.form.span
        return Stopped(a + (b - a) * run.reached, run.outcome)

    def _unresolved(self) -> Stopped:
        a, b = self.equations.form.span
        return Stopped(a + (b - a) * self.anchor, Outcome.UNRESOLVED)

    def _along_arc(self, end: RegularEnd, level: int) -> Shot | Stopped:
        """The regular arc as a shot; it depends on the ordinates of the anchor, and demands its slope."""
        n, D, size = (
            self.equations.form.n,
            self.equations.dimension,
            self.equations.dimension + self.equations.integrals,
        )
        passage = end.passage(self.anchor, self.state[:n], self.constants, level, self.flow)
        if passage is None:
            return self._unresolved()
        columns = D + passage.near_by.shape[1] - n
        given = [*range(n), *range(D, columns)]
        near, far = np.zeros(size), np.concatenate([end.ordinates, passage.far, -passage.integrals])
        near[:D] = self.state
        near_by, far_by, by = np.eye(size, columns), np.zeros((size, columns)), np.eye(n, columns, n)
        near_by[:, D:] = 0.0
        far_by[n:D, given], far_by[D:, given] = passage.far_by, -passage.integrals_by
        by[:, given] -= passage.near_by
        closure = Closure(end.at, self.state[n:] - passage.near, by)
        if end.at == self.left:
            return Shot(far, near, far_by, near_by, closure)
        return Shot(near, far, near_by, far_by, closure)

    def trajectory(self, level: int) -> Trajectory | Stopped:
        """The states between the vertices."""
        end, ordinates = self.regular, self.state[: self.equations.form.n]
        if end is not None:
            passage = end.passage(self.anchor, ordinates, self.constants, level, self.flow)
            return self._unresolved() if passage is None else lambda t: end.states(self.anchor, passage, t)
        runs = self._runs(level, dense=True)
        for run in runs:
            if run is not None and not run.completed:
                return self._stopped(run)
        return lambda t: self._joined(runs, t)

    def _joined(self, runs: list[Run | None], t: np.ndarray) -> np.ndarray:
        """The states at t (m,) on the runs to either side of the anchor."""
        out = np.empty((len(t), self.equations.dimension))
        before = t <= self.anchor if self.left < self.anchor < self.right else np.full(len(t), runs[1] is None)
        for run, chosen in zip(runs, (before, ~before), strict=True):
            if run is not None and run.trajectory is not None and chosen.any():
                low, high = sorted((run.abscissae[0], run.abscissae[-1]))
                out[chosen] = run.trajectory(np.clip(t[chosen], low, high))[:, : self.equations.dimension]
        return out
