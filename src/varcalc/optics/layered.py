"""Rays through a table, layer by layer: every height of it ends a run, and the next begins with the next cubic."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators import NONE, OUTCOMES, Engine, Flow, Landing, Outcome
from varcalc.optics.media import Medium
from varcalc.optics.system import force_of, ray_rates
from varcalc.optics.tabulated import Tabulated

Expression = Any
"""A CasADi SX expression."""
STOPPED = OUTCOMES.index(Outcome.STOPPED)
NOT_FINITE = OUTCOMES.index(Outcome.NOT_FINITE)
TOO_MANY = OUTCOMES.index(Outcome.TOO_MANY_STEPS)
CROSSINGS = 100_000
"""Heights of the table crossed by one ray."""


def compile_rays(
    engine: Engine,
    medium: Medium,
    dimension: int,
    neighbours: int,
    stops: Callable[[Expression, Expression], Expression],
    constants: int,
) -> RayFlow:
    """Compile the rays of ``medium`` with ``stops``, of the state and so many ``constants``.

    In a table there is one stop more, the last: the ray has left it.
    """
    d = dimension
    table = medium if isinstance(medium, Tabulated) else None
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * d + 1 + 2 * d * neighbours)
    numbers = ca.SX.sym("c", constants + (6 if table else 0))
    if table:
        layer, height = numbers[constants:], state[d - 1]
        ends = ca.vertcat(height - layer[0], height - layer[1])
    else:
        layer, ends = ca.SX(0, 1), ca.SX(0, 1)
    here = force_of(medium, state[:d], layer)
    rates = ca.Function("rays", [s, state, numbers], [ray_rates(here, state, d)])
    levels = ca.vertcat(stops(state, numbers[:constants]), ends)
    swarm = engine.compile(rates, ca.Function("stops", [s, state, numbers], [levels]))
    return LayeredSwarm(swarm, table, d, levels.numel() - 2) if table else swarm


@dataclass(frozen=True)
class LayeredSwarm:
    """A swarm for one layer, handed on from layer to layer; ``stops`` is the number of stops beside the heights."""

    swarm: Flow
    table: Tabulated
    dimension: int
    stops: int

    def ensemble(self, states: np.ndarray, constants: np.ndarray, *, leaving: tuple[int, ...] = ()) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""
        ends = Landing.at(states, outcome=TOO_MANY)
        for _ in self._rounds(ends, constants, leaving):
            pass
        return ends

    def pieces(self, state: np.ndarray, constants: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """The layers that one ray goes through: where each begins, its :meth:`Tabulated.constants`, the state there."""
        ends = Landing.at(state[None, :])
        return [
            (float(ends.reached[0]), self.table.constants(layer)[0], ends.states[0].copy())
            for layer in self._rounds(ends, constants[None, :], ())
        ]

    def _rounds(self, ends: Landing, constants: np.ndarray, leaving: tuple[int, ...]) -> Iterator[np.ndarray]:
        """Carry all rays through one layer after the other, in place; the layers (m,) before each is gone through."""
        d, alive = self.dimension, np.arange(len(ends.states))
        layer, on, stuck, outside = self.table.starts(ends.states[:, d - 1], ends.states[:, 2 * d - 1])
        start = np.where(on < 0, NONE, self.stops + on - layer)
        ends.outcomes[stuck], ends.outcomes[outside] = NOT_FINITE, STOPPED
        ends.stopped_by[outside] = self.stops
        alive = alive[~stuck & ~outside]
        for _ in range(CROSSINGS):
            yield layer
            for number in np.unique(start[alive]):
                rows = alive[start[alive] == number]
                known = np.column_stack([constants[rows], self.table.constants(layer[rows])])
                height = () if number == NONE else (int(number),)
                landing = self.swarm.ensemble(ends.states[rows], known, leaving=(*leaving, *height))
                ends.states[rows], ends.outcomes[rows] = landing.states, landing.outcomes
                ends.stopped_by[rows] = landing.stopped_by
                ends.reached[rows] += landing.reached
            alive, leaving = self._handed_on(ends, layer, start, alive), ()
            if len(alive) == 0:
                return

    def _kick(self, states: np.ndarray, rows: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """Turn the neighbours of ``rows`` that come to a kink of n² at another σ than the ray, in place."""
        d, knots = self.dimension, np.asarray(self.table.heights)
        height, climb = states[rows, d - 1], states[rows, 2 * d - 1]
        slopes = [self.table.slope(layer, height - knots[layer]) for layer in (before, after)]
        kick = np.divide((slopes[1] - slopes[0]) / 2, climb, out=np.zeros(len(rows)), where=climb != 0)
        for first in range(2 * d + 1, states.shape[1], 2 * d):
            states[rows, first + 2 * d - 1] += kick * states[rows, first + d - 1]

    def _handed_on(self, ends: Landing, layer: np.ndarray, start: np.ndarray, alive: np.ndarray) -> np.ndarray:
        """Put the rays that have come to a height into the next layer; those of ``alive`` that go on."""
        at = alive[(ends.outcomes[alive] == STOPPED) & (ends.stopped_by[alive] >= self.stops)]
        knot = layer[at] + (ends.stopped_by[at] - self.stops)
        climbing = ends.states[at, 2 * self.dimension - 1] > 0
        ends.states[at, self.dimension - 1] = np.asarray(self.table.heights)[knot]
        following = np.where(climbing, knot, knot - 1)
        inside = (following >= 0) & (following < self.table.layers)
        self._kick(ends.states, at[inside], layer[at[inside]], following[inside])
        ends.stopped_by[at[~inside]] = self.stops
        layer[at[inside]] = following[inside]
        start[at] = np.where(climbing, self.stops, self.stops + 1)
        return at[inside]


RayFlow = Flow | LayeredSwarm
"""Rays of one medium: integrated at once, or layer by layer."""
