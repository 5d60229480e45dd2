"""Hamilton's ray equations as the integrators take a system, in one medium or in a table layer by layer.

dr/dσ = p, dp/dσ = ∇n²/2, dS/dσ = n², of the Hamiltonian (|p|² - n²)/2 = 0
(Born and Wolf, sect. 3.2; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 3.3): for many media polynomials. The deviations of neighbours obey
δr' = δp, δp' = H δr/2 with H the Hessian matrix of n² (the ray deviation
equation, Brizard sect. 1.4.3). In a table every height ends a run, and the
next begins with the next layer's cubic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import NONE, OUTCOMES, Flow, Landing, Outcome
from varcalc.optics.media.medium import Expression, Medium
from varcalc.optics.media.tabulated import Tabulated, cubic
from varcalc.optics.rays.beam import NOTHING, RayStatus
from varcalc.optics.surfaces import Geometry

STOPPED = OUTCOMES.index(Outcome.STOPPED)
NOT_FINITE = OUTCOMES.index(Outcome.NOT_FINITE)
TOO_MANY = OUTCOMES.index(Outcome.TOO_MANY_STEPS)
STATUS_OF_OUTCOME = np.full(len(OUTCOMES), int(RayStatus.SINGULAR))
"""How rays ended, by the number of the outcome of their integration."""
STATUS_OF_OUTCOME[[OUTCOMES.index(Outcome.COMPLETED), STOPPED]] = RayStatus.ARRIVED
STATUS_OF_OUTCOME[TOO_MANY] = RayStatus.TOO_MANY_STEPS
MOST_CROSSINGS = 100_000
"""Heights of the table crossed by one ray."""


@dataclass(frozen=True)
class Force:
    """n² (a scalar), ∇n²/2 (d,) and the latter's derivative along a deviation, as expressions of a position."""

    squared: Expression
    pull: Expression
    along: Callable[[Expression], Expression]


def force(squared: Expression, position: Expression) -> Force:
    """The force of any n², an expression of the symbols ``position``."""
    pull = ca.gradient(squared, position) / 2
    return Force(squared, pull, lambda moved: ca.jtimes(pull, position, moved))


def force_through(function: ca.Function, u: Expression, position: Expression) -> Force:
    """The force of n² = F(u), by the chain rule; ∇u and u's second derivatives are simple."""
    symbol = ca.SX.sym("u")
    squared = function(symbol)
    half = ca.gradient(squared, symbol) / 2
    orders = ca.Function("orders", [symbol], [squared, half, ca.gradient(half, symbol)])
    squared, half, bend = orders(u)
    slope = ca.gradient(u, position)
    hessian = ca.jacobian(slope, position)

    def along(moved: Expression) -> Expression:
        return half * (hessian @ moved) + (bend * ca.dot(slope, moved)) * slope

    return Force(squared, half * slope, along)


def ray_rates(force: Force, state: Expression, dimension: int) -> Expression:
    """Hamilton's ray equations: of r, p, S, then δr and δp of each neighbour."""
    d = dimension
    rates = [state[d : 2 * d], force.pull, force.squared]
    for first in range(2 * d + 1, state.numel(), 2 * d):
        rates += [state[first + d : first + 2 * d], force.along(state[first : first + d])]
    return ca.cse(ca.densify(ca.vertcat(*rates)))


def force_of(medium: Medium, position: Expression, constants: Expression) -> Force:
    """The force of ``medium``; of one layer of a table, whose ``constants`` are given."""
    if isinstance(medium, Tabulated):
        return force(cubic(position[position.numel() - 1], constants), position)
    known = medium.through(position)
    return force(medium.squared_index(position), position) if known is None else force_through(*known, position)


def ray_system(medium: Medium, dimension: int, neighbours: int) -> ca.Function:
    """Hamilton's ray equations with ``neighbours`` deviations, as the engines take a system.

    The state is r, p, S, then δr and δp of each neighbour. There are no
    constants, but for those of one layer where the medium is a table.
    """
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * dimension + 1 + 2 * dimension * neighbours)
    constants = ca.SX.sym("c", 6 if isinstance(medium, Tabulated) else 0)
    here = force_of(medium, state[:dimension], constants)
    return ca.Function("rays", [s, state, constants], [ray_rates(here, state, dimension)])


def compile_rays(
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
    flow = integrators.for_many().compile(rates, ca.Function("stops", [s, state, numbers], [levels]))
    return LayeredFlow(flow, table, d, levels.numel() - 2) if table else flow


@dataclass(frozen=True)
class LayeredFlow:
    """A flow for one layer, handed on from layer to layer; ``stops`` is the number of stops beside the heights."""

    flow: Flow
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
        for _ in range(MOST_CROSSINGS):
            yield layer
            for number in np.unique(start[alive]):
                rows = alive[start[alive] == number]
                known = np.column_stack([constants[rows], self.table.constants(layer[rows])])
                height = () if number == NONE else (int(number),)
                landing = self.flow.ensemble(ends.states[rows], known, leaving=(*leaving, *height))
                ends.states[rows], ends.outcomes[rows] = landing.states, landing.outcomes
                ends.stopped_by[rows] = landing.stopped_by
                ends.reached[rows] += landing.reached
            alive, leaving = self._handed_on(ends, layer, start, alive), ()
            if len(alive) == 0:
                return

    def _handed_on(self, ends: Landing, layer: np.ndarray, start: np.ndarray, alive: np.ndarray) -> np.ndarray:
        """Put the rays that have come to a height into the next layer; those of ``alive`` that go on."""
        at = alive[(ends.outcomes[alive] == STOPPED) & (ends.stopped_by[alive] >= self.stops)]
        knot = layer[at] + (ends.stopped_by[at] - self.stops)
        d = self.dimension
        ends.states[at, d - 1] = np.asarray(self.table.heights)[knot]
        following, inside, kick = self.table.crossed(layer[at], knot, ends.states[at, 2 * d - 1])
        for first in range(2 * d + 1, ends.states.shape[1], 2 * d):
            turned, moved = first + 2 * d - 1, first + d - 1
            ends.states[at[inside], turned] += kick[inside] * ends.states[at[inside], moved]
        ends.stopped_by[at[~inside]] = self.stops
        layer[at[inside]] = following[inside]
        start[at] = self.stops + knot - following
        return at[inside]


RayFlow = Flow | LayeredFlow
"""Rays of one medium: integrated at once, or layer by layer."""


def runs(
    flow: RayFlow,
    surfaces: Sequence[Geometry],
    states: np.ndarray,
    constants: np.ndarray,
    waiting: dict[int, np.ndarray],
) -> Iterator[tuple[np.ndarray, Landing]]:  # fmt: skip
    """Carry rays, in place, each to its next stop; the first stops are the levels of ``surfaces``.

    ``waiting`` holds the rows to be carried, by the number of the stop that they start from. Rays that come to a
    level where the surface itself does not reach are carried on; the caller may put others back into ``waiting``.
    Yields the rows of each run and how they landed.
    """
    dimension = surfaces[0].dimension if surfaces else 0
    while waiting:
        start, rows = waiting.popitem()
        if len(rows) == 0:
            continue
        landing = flow.ensemble(states[rows], constants[rows], leaving=() if start == NOTHING else (start,))
        states[rows] = landing.states
        struck = np.where(landing.outcomes == STOPPED, landing.stopped_by, NONE)
        for number in np.unique(struck[(struck != NONE) & (struck < len(surfaces))]):
            there = rows[struck == number]
            strangers = there[~surfaces[number].belongs(states[there, :dimension])]
            if len(strangers):
                waiting[int(number)] = np.concatenate([waiting.get(int(number), strangers[:0]), strangers])
        yield rows, landing
