"""Rays through tables of several coordinates, cell by cell: no step goes over a knot.

In a cell n² is a polynomial, whose coefficients a run is given as constants. A ray that comes to an edge goes on in the
next cell with its neighbours, which come there at another σ: where n² has a kink they are pulled otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import Flow, Landing
from varcalc.integrators.protocol import COMPLETED, NOT_FINITE, STOPPED, TOO_MANY_STEPS
from varcalc.optics.media.medium import Expression
from varcalc.optics.models.equations import force, ray_rates
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.grids import OnGrid

MOST_CROSSINGS = 20_000
"""Edges that one ray comes to."""
ON_EDGE = 1e-14
"""Of the extent of the grid: who is closer to an edge is on it."""


@dataclass
class GridFlow:
    """A flow through the cells of a ``grid``; ``stops`` are the caller's, of states and so many ``constants``."""

    grid: OnGrid
    dimension: int
    neighbours: int
    stops: Callable[[Expression, Expression], Expression]
    constants: int
    _own: int = field(init=False)
    _flow: Flow = field(init=False)

    def __post_init__(self) -> None:
        d, count = self.dimension, 2 * len(self.grid.axes)
        s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * d + 1 + 2 * d * self.neighbours)
        numbers = ca.SX.sym("c", self.constants + count + self.grid.constants.numel())
        given, edges, cell = np.split(np.arange(numbers.numel()), [self.constants, self.constants + count])
        position, pairs = self.grid.position, [self.grid.position, self.grid.constants]
        squared = ca.substitute([self.grid.expression], pairs, [state[:d], numbers[cell.tolist()]])[0]
        rates = ca.Function("rays", [s, state, numbers], [ray_rates(force(squared, state[:d]), state, d)])
        at = numbers[edges.tolist()]
        ends = [state[axis] - at[2 * k + side] for k, axis in enumerate(self.grid.axes) for side in (0, 1)]
        own = ca.SX(self.stops(state, numbers[given.tolist()]))
        self._own = int(own.numel())
        watched = ca.Function("stops", [s, state, numbers], [ca.vertcat(own, *ends)])
        self._flow = integrators.for_many().compile(rates, watched)
        slope = ca.gradient(self.grid.expression, position)
        self._slope = PointEvaluator(ca.Function("slope", pairs, [ca.densify(slope)]))

    def ensemble(
        self, states: np.ndarray, constants: np.ndarray, *, until: np.ndarray | float = np.inf,
        leaving: tuple[int, ...] = (),
    ) -> Landing:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""
        ends = Landing.at(states, outcome=TOO_MANY_STEPS)
        for _ in self._rounds(ends, constants, until, leaving):
            pass
        return ends

    def runs(self, state: np.ndarray, constants: np.ndarray) -> list[tuple[float, Flow, np.ndarray, np.ndarray]]:
        """The cells that one ray goes through: where each begins in σ, the flow, its constants, the state there."""
        ends = Landing.at(state[None, :])
        return [
            (float(ends.reached[0]), self._flow, np.append(constants, numbers[0]), ends.states[0].copy())
            for numbers in self._rounds(ends, constants[None, :], np.inf, ())
        ]

    def _rounds(
        self, ends: Landing, constants: np.ndarray, until: np.ndarray | float, leaving: tuple[int, ...]
    ) -> Iterator[np.ndarray]:
        """Carry all rays through one cell after the other, in place; the numbers (m, k) of the cells before each."""
        last = np.array(np.broadcast_to(np.asarray(until, dtype=float), (len(ends.states),)))
        cells, stuck = self._cells(ends.states)
        alive = self._entered(ends, cells, np.arange(len(ends.states)))
        ends.outcomes[stuck] = NOT_FINITE
        alive = alive[~stuck[alive]]
        for _ in range(MOST_CROSSINGS):
            if len(alive) == 0:
                return
            numbers = self._numbers(cells)
            yield numbers
            standing = self._standing(ends.states, cells)
            for on in np.unique(standing[alive], axis=0):
                some = alive[np.all(standing[alive] == on, axis=1)]
                edges = tuple(int(k) + self._own for k in np.flatnonzero(on))
                landing = self._flow.ensemble(
                    ends.states[some], np.column_stack([constants[some], numbers[some]]),
                    until=np.maximum(last[some] - ends.reached[some], 0.0), leaving=(*leaving, *edges),
                )  # fmt: skip
                ends.states[some], ends.outcomes[some] = landing.states, landing.outcomes
                ends.stopped_by[some] = landing.stopped_by
                done = landing.outcomes == COMPLETED  # the sum of the parts is not told so well
                ends.reached[some] = np.where(done, last[some], ends.reached[some] + landing.reached)
            alive, leaving = self._handed_on(ends, cells, alive), ()

    def _cells(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cells (m, axes) that rays are in or, on an edge, go into; and which (m,) both sides turn back to it."""
        cells, stuck = np.empty((len(states), len(self.grid.axes)), dtype=int), np.zeros(len(states), dtype=bool)
        level = []
        for k, (axis, edges) in enumerate(zip(self.grid.axes, self.grid.edges, strict=True)):
            cells[:, k] = np.searchsorted(edges, states[:, axis], "right") - 1
            on = (cells[:, k] >= 0) & (edges[np.maximum(cells[:, k], 0)] == states[:, axis])
            speed = states[:, self.dimension + axis]
            cells[:, k] -= on & (speed < 0)
            level.append(on & (speed == 0))
        for k, rows in enumerate(map(np.flatnonzero, level)):  # along an edge, to the side to which they are pulled
            if len(rows) == 0:
                continue
            below = cells[rows].copy()
            below[:, k] -= 1
            up, down = (self._slopes(states[rows], cell)[:, self.grid.axes[k]] for cell in (cells[rows], below))
            first, last = below[:, k] < 0, below[:, k] + 1 > len(self.grid.edges[k]) - 2
            cells[rows[((up < 0) & ~first) | last], k] -= 1
            stuck[rows[(up < 0) & (down > 0) & ~first & ~last]] = True
        return cells, stuck

    def _slopes(self, states: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """∇n² (m, d) at the places of rays, as it is in ``cells`` (m, axes), or in the nearest ones of the grid."""
        counts = np.array([len(edges) - 2 for edges in self.grid.edges])
        numbers = self.grid.numbers(np.clip(cells, 0, counts))
        return self._slope(len(states), states[:, : self.dimension], numbers)

    def _numbers(self, cells: np.ndarray) -> np.ndarray:
        """The edges of the cells, and their constants; of rays outside those of the nearest cells."""
        inside = np.stack([np.clip(c, 0, len(e) - 2) for c, e in zip(cells.T, self.grid.edges, strict=True)], axis=1)
        sides = [e[c + side] for c, e in zip(inside.T, self.grid.edges, strict=True) for side in (0, 1)]
        return np.column_stack([*sides, self.grid.numbers(inside)])

    def _standing(self, states: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """On which edges of their cells rays stand (m, 2 axes)."""
        parts = []
        for k, (axis, edges) in enumerate(zip(self.grid.axes, self.grid.edges, strict=True)):
            room = ON_EDGE * (edges[-1] - edges[0])
            inside = np.clip(cells[:, k], 0, len(edges) - 2)
            parts += [np.abs(states[:, axis] - edges[inside + side]) <= room for side in (0, 1)]
        return np.stack(parts, axis=1)

    def _handed_on(self, ends: Landing, cells: np.ndarray, alive: np.ndarray) -> np.ndarray:
        """Put the rays that have come to an edge into the next cell; those of ``alive`` that go on."""
        at = alive[(ends.outcomes[alive] == STOPPED) & (ends.stopped_by[alive] >= self._own)]
        d, number = self.dimension, ends.stopped_by[at] - self._own
        k, side = number // 2, number % 2
        before = cells[at].copy()
        for j, (axis, edges) in enumerate(zip(self.grid.axes, self.grid.edges, strict=True)):
            rows = at[k == j]
            ends.states[rows, axis] = edges[cells[rows, j] + side[k == j]]
        # those that only touch an edge stay where they are
        speed = ends.states[at, d + np.array(self.grid.axes)[k]]
        cells[at, k] += np.where((side == 1) & (speed > 0), 1, np.where((side == 0) & (speed < 0), -1, 0))
        going = self._entered(ends, cells, at)
        kept = np.isin(at, going)
        self._kicked(ends.states, at[kept], np.array(self.grid.axes)[k[kept]], before[kept], cells[at[kept]])
        return going

    def _entered(self, ends: Landing, cells: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Those of the ``rows`` that are in a cell; the others have left the grid."""
        counts = np.array([len(edges) - 1 for edges in self.grid.edges])
        inside = np.all((cells[rows] >= 0) & (cells[rows] < counts), axis=1)
        finite = np.all(np.isfinite(ends.states[rows]), axis=1)
        ends.outcomes[rows[~inside]], ends.stopped_by[rows[~inside]] = STOPPED, self._own
        ends.outcomes[rows[~finite]] = NOT_FINITE
        ends.outcomes[rows[inside & finite]] = TOO_MANY_STEPS
        return rows[inside & finite]

    def _kicked(
        self, states: np.ndarray, rows: np.ndarray, axis: np.ndarray, before: np.ndarray, after: np.ndarray
    ) -> None:
        """Give neighbours what the other pull beyond an edge makes of their coming to it at another σ, in place."""
        if len(rows) == 0 or self.neighbours == 0:
            return
        d, one = self.dimension, np.arange(len(rows))
        slopes = [self._slopes(states[rows], cell)[one, axis] for cell in (before, after)]
        speed = states[rows, d + axis]
        kick = np.divide((slopes[1] - slopes[0]) / 2, speed, out=np.zeros(len(rows)), where=speed != 0)
        for first in range(2 * d + 1, states.shape[1], 2 * d):
            states[rows, first + d + axis] += kick * states[rows, first + axis]
