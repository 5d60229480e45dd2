"""Rays through tables, cell by cell of their arguments: no step goes over a knot.

In a cell n² is a polynomial, whose coefficients a run is given as constants. A ray that comes to an edge goes on in the
next cell with its neighbours, which come there at another σ: where n² has a kink they are pulled otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import Flow, Landing
from varcalc.integrators.protocol import NOT_FINITE, STOPPED, TOO_MANY_STEPS
from varcalc.optics.media.medium import Expression
from varcalc.optics.models.equations import Force, RayStops, ray_rates
from varcalc.optics.models.watch import UNWATCHED, Watch
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.grids import OnGrid

MOST_CROSSINGS = 20_000
"""Edges that one ray comes to."""
ON_EDGE = 1e-13
"""Of the extent of the grid: who is closer to an edge is on it."""


def _force(grid: OnGrid) -> Force:
    """The force of n² on a ``grid``, by the chain rule from what its tables tell of their derivatives."""
    position, values, arguments = grid.position, grid.values, grid.arguments
    count, slopes = arguments.numel(), ca.SX.sym("slope", len(grid.tables), arguments.numel())
    known = [values, ca.vec(slopes)]
    value, slope, bend = grid.told
    across = slopes @ ca.jacobian(arguments, position)
    pull = (ca.gradient(grid.expression, position) + across.T @ ca.gradient(grid.expression, values)) / 2

    def here(expression: Expression) -> Expression:
        return ca.substitute([expression], known, [value, ca.vec(slope)])[0]

    def along(moved: Expression) -> Expression:
        """The rate of the force while the position moves at the rate ``moved``."""
        shift = ca.jtimes(arguments, position, moved)
        turned = [bend[:, k * count : (k + 1) * count] @ shift for k in range(count)]
        rates = ca.vertcat(moved, slopes @ shift, *turned)
        return here(ca.jtimes(pull, ca.vertcat(position, *known), rates))

    return Force(here(grid.expression), here(pull), along)


@dataclass
class GridFlow:
    """A flow through the cells of a ``grid``; ``stops`` are the caller's."""

    grid: OnGrid
    dimension: int
    neighbours: int
    stops: RayStops
    _flow: Flow = field(init=False)

    def __post_init__(self) -> None:
        d, grid, position = self.dimension, self.grid, self.grid.position
        s, momentum = ca.SX.sym("s"), ca.SX.sym("p", d)
        state = ca.vertcat(position, momentum, ca.SX.sym("Y", 1 + 2 * d * self.neighbours))
        given, edges = ca.SX.sym("c", self.stops.constants), ca.SX.sym("e", 2 * len(grid.edges))
        numbers, here = ca.vertcat(given, edges, grid.constants), _force(grid)
        rates = ca.Function("rays", [s, state, numbers], [ray_rates(here, state, d)])
        ends = [grid.arguments[k // 2] - edges[k] for k in range(edges.numel())]
        own = ca.SX(self.stops.levels(state, given, here.squared))
        watched = ca.Function("stops", [s, state, numbers], [ca.vertcat(own, *ends)])
        self._flow = integrators.for_many().compile(rates, watched)
        across = ca.jacobian(grid.arguments, position)
        speed = across @ momentum
        bend = ca.jtimes(speed, position, momentum) + across @ here.pull
        self._slope = PointEvaluator(ca.Function("slope", [position, grid.constants], [ca.densify(2 * here.pull)]))
        self._across = PointEvaluator(ca.Function("across", [position], [ca.densify(across.T)]))
        told = [ca.densify(grid.arguments), ca.densify(speed)]
        self._arguments = PointEvaluator(ca.Function("arguments", [position, momentum], told))
        self._bend = PointEvaluator(ca.Function("bend", [position, momentum, grid.constants], [ca.densify(bend)]))

    def ensemble(
        self, states: np.ndarray, constants: np.ndarray, *, until: np.ndarray | float = np.inf,
        leaving: tuple[int, ...] = (), watch: Watch = UNWATCHED,
    ) -> Landing:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""
        ends = Landing.at(states, outcome=TOO_MANY_STEPS)
        with watch.stoppable():
            for _ in self._rounds(ends, constants, until, leaving, watch):
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
        self, ends: Landing, constants: np.ndarray, until: np.ndarray | float, leaving: tuple[int, ...],
        watch: Watch = UNWATCHED,
    ) -> Iterator[np.ndarray]:  # fmt: skip
        """Carry all rays through one cell after the other, in place; the numbers (m, k) of the cells before each."""
        last = np.array(np.broadcast_to(np.asarray(until, dtype=float), (len(ends.states),)))
        cells, standing, stuck = self._begun(ends.states)
        alive = self._entered(ends, cells, np.arange(len(ends.states)))
        ends.outcomes[stuck] = NOT_FINITE
        alive = alive[~stuck[alive]]
        for crossed in range(MOST_CROSSINGS):
            if len(alive) == 0 or not watch.lets_on(crossed, len(alive)):
                return
            with watch.going(ends, alive):
                numbers = self._numbers(cells)
                yield numbers
                for on in np.unique(standing[alive], axis=0):
                    some = alive[np.all(standing[alive] == on, axis=1)]
                    edges = tuple(int(k) + self.stops.count for k in np.flatnonzero(on))
                    landing = self._flow.ensemble(
                        ends.states[some], np.column_stack([constants[some], numbers[some]]),
                        until=np.maximum(last[some] - ends.reached[some], 0.0), leaving=(*leaving, *edges),
                    )  # fmt: skip
                    ends.carry_on(some, landing, last)
                alive, leaving = self._handed_on(ends, cells, standing, alive), ()

    def _told(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The arguments of the tables (m, J) on rays, and their derivatives by σ."""
        d, count = self.dimension, len(self.grid.edges)
        table = self._arguments(len(states), states[:, :d], states[:, d : 2 * d])
        return table[:, :count], table[:, count:]

    def _begun(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The cells (m, J) that rays are in or, on an edge, go into; on which edges they stand (m, 2 J).

        And which of them (m,) both sides of an edge turn back to it.
        """
        arguments, speed = self._told(states)
        cells, on = np.empty(arguments.shape, dtype=int), np.empty(arguments.shape, dtype=bool)
        for k, edges in enumerate(self.grid.edges):
            nearest = np.abs(arguments[:, k, None] - edges).argmin(axis=1)
            on[:, k] = np.abs(arguments[:, k] - edges[nearest]) <= ON_EDGE * (edges[-1] - edges[0])
            within = np.searchsorted(edges, arguments[:, k], "right") - 1
            cells[:, k] = np.where(on[:, k], nearest - (speed[:, k] < 0), within)
        stuck = np.zeros(len(states), dtype=bool)
        for k, edges in enumerate(self.grid.edges):  # along an edge, to the side to which they are pulled
            rows = np.flatnonzero(on[:, k] & (speed[:, k] == 0))
            if len(rows) == 0:
                continue
            below = cells[rows].copy()
            below[:, k] -= 1
            up, down = (self._bends(states[rows], cell)[:, k] for cell in (cells[rows], below))
            first, last = below[:, k] < 0, cells[rows, k] > len(edges) - 2
            cells[rows[((up < 0) & ~first) | last], k] -= 1
            stuck[rows[(up < 0) & (down > 0) & ~first & ~last]] = True
        return cells, self._standing(arguments, cells), stuck

    def _bends(self, states: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """The second derivatives of the arguments (m, J) by σ, as they are in ``cells``."""
        d = self.dimension
        return self._bend(len(states), states[:, :d], states[:, d : 2 * d], self.grid.numbers(self._inside(cells)))

    def _inside(self, cells: np.ndarray) -> np.ndarray:
        """The nearest cells of the grid."""
        return np.clip(cells, 0, np.array([len(edges) - 2 for edges in self.grid.edges]))

    def _numbers(self, cells: np.ndarray) -> np.ndarray:
        """The edges of the cells, and their constants; of rays outside those of the nearest cells."""
        inside = self._inside(cells)
        sides = [e[c + side] for c, e in zip(inside.T, self.grid.edges, strict=True) for side in (0, 1)]
        return np.column_stack([*sides, self.grid.numbers(inside)])

    def _standing(self, arguments: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """On which edges of their cells rays stand (m, 2 J)."""
        parts, inside = [], self._inside(cells)
        for k, edges in enumerate(self.grid.edges):
            room = ON_EDGE * (edges[-1] - edges[0])
            parts += [np.abs(arguments[:, k] - edges[inside[:, k] + side]) <= room for side in (0, 1)]
        return np.stack(parts, axis=1)

    def _handed_on(self, ends: Landing, cells: np.ndarray, standing: np.ndarray, alive: np.ndarray) -> np.ndarray:
        """Put the rays that have come to an edge into the next cell; those of ``alive`` that go on."""
        at = alive[(ends.outcomes[alive] == STOPPED) & (ends.stopped_by[alive] >= self.stops.count)]
        if len(at) == 0:
            return at
        number, one = ends.stopped_by[at] - self.stops.count, np.arange(len(at))
        k, side = number // 2, number % 2
        before = cells[at].copy()
        arguments, speed = self._told(ends.states[at])
        # those that only touch an edge stay where they are
        speed = speed[one, k]
        step = np.where((side == 1) & (speed > 0), 1, np.where((side == 0) & (speed < 0), -1, 0))
        cells[at, k] += step
        standing[at] = self._standing(arguments, cells[at])
        standing[at, 2 * k + np.where(step == 0, side, 1 - side)] = True
        going = self._entered(ends, cells, at)
        kept = np.isin(at, going)
        self._kicked(ends.states, at[kept], k[kept], before[kept], cells[at[kept]])
        return going

    def _entered(self, ends: Landing, cells: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Those of the ``rows`` that are in a cell; the others have left the grid."""
        counts = np.array([len(edges) - 1 for edges in self.grid.edges])
        inside = np.all((cells[rows] >= 0) & (cells[rows] < counts), axis=1)
        finite = np.all(np.isfinite(ends.states[rows]), axis=1)
        ends.outcomes[rows[~inside]], ends.stopped_by[rows[~inside]] = STOPPED, self.stops.count
        ends.outcomes[rows[~finite]] = NOT_FINITE
        ends.outcomes[rows[inside & finite]] = TOO_MANY_STEPS
        return rows[inside & finite]

    def _kicked(
        self, states: np.ndarray, rows: np.ndarray, number: np.ndarray, before: np.ndarray, after: np.ndarray
    ) -> None:
        """Give neighbours what the other pull beyond an edge makes of their coming to it at another σ, in place."""
        if len(rows) == 0 or self.neighbours == 0:
            return
        d, place = self.dimension, states[rows, : self.dimension]
        slopes = [self._slope(len(rows), place, self.grid.numbers(cell)) for cell in (before, after)]
        across = self._across(len(rows), place).reshape(len(rows), -1, d)[np.arange(len(rows)), number]
        speed = np.sum(across * states[rows, d : 2 * d], axis=1)[:, None]
        kick = np.divide((slopes[1] - slopes[0]) / 2, speed, out=np.zeros_like(place), where=speed != 0)
        for first in range(2 * d + 1, states.shape[1], 2 * d):
            late = np.sum(across * states[rows, first : first + d], axis=1)[:, None]
            states[rows, first + d : first + 2 * d] += kick * late
