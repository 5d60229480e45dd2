"""Rays in a graded medium, by Hamilton's ray equations; in a table layer by layer.

dr/dσ = p, dp/dσ = ∇n²/2, dS/dσ = n², of the Hamiltonian (|p|² - n²)/2 = 0
(Born and Wolf, sect. 3.2; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 3.3): for many media polynomials. The deviations of neighbours obey
δr' = δp, δp' = H δr/2 with H the Hessian matrix of n² (the ray deviation
equation, Brizard sect. 1.4.3). In a table every height ends a run, and the
next begins with the next layer's cubic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Lock

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import NONE, OUTCOMES, Flow, Landing, RunOutcome
from varcalc.integrators.protocol import COMPLETED, NOT_FINITE, STOPPED, TOO_MANY_STEPS
from varcalc.optics.media.medium import Expression, Field, Medium, looking_up, switching
from varcalc.optics.media.tabulated import Layers
from varcalc.optics.models.equations import NO_RAY_STOPS, RayStops, force_of, ray_rates, ray_system
from varcalc.optics.models.grids import GridFlow
from varcalc.optics.models.jumps import jumping, layers_of
from varcalc.optics.models.model import Carrier, Model
from varcalc.optics.models.switched import SwitchedFlow
from varcalc.optics.models.watch import UNWATCHED, Watch
from varcalc.optics.rays.beam import DARK, NOTHING, Arrival, Beam, RayStatus, packed, unpacked
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Geometry
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.grids import OnGrid, on_grid

STATUS_OF_OUTCOME = np.full(len(OUTCOMES), int(RayStatus.SINGULAR))
"""How rays ended, by the number of the outcome of their integration."""
STATUS_OF_OUTCOME[[COMPLETED, STOPPED]] = RayStatus.ARRIVED
STATUS_OF_OUTCOME[TOO_MANY_STEPS] = RayStatus.TOO_MANY_STEPS
UNDER_WAY = (RayStatus.TOO_MANY_STEPS, RayStatus.INTERRUPTED)
"""Rays that have come to no end, but perhaps to a jump."""
MOST_CROSSINGS = 100_000
"""Heights of the table crossed by one ray."""
SHORTEST_RUN = 1e-13
"""Of a leg: the shortest part of it that is integrated."""
FAR_SPHERE = 1e6
"""Rays that have come so many times farther than the scene is large meet nothing any more."""
MOMENTUM_BROKEN = 1e-8
"""|p|² and n², which are equal along a ray, differ by so much of n² only where the index is singular."""
FLAT = 16.0
"""Of n² and its Hessian matrix, the square of its slope: for a power of n² above 1.1 it is no more beside a zero."""
FEW_BY_PATH = 5_000
"""Rays from which on the steps that find a stop pay for being compiled; then they take a third of the time."""
STEPS_BY_PATH = 192
"""Of one ray by its optical path: past what is so dark it takes more, for there they shrink, and it may be led over."""
SAME_SIGMA = 1e-14
"""Relative difference of σ and the sum of its parts that is round-off."""
SINGULAR = int(RayStatus.SINGULAR)
_ONE_AT_A_TIME = Lock()
"""Threads that need the same system wait for the one that builds it."""
_ONE_RUN = Lock()
"""heyoka's integrators hold states: a run by the optical path takes all cores itself."""


def compile_rays(
    medium: Medium,
    layers: Layers | OnGrid | None,
    dimension: int,
    neighbours: int,
    stops: RayStops,
) -> RayFlow:
    """Compile the rays of ``medium`` with ``stops``.

    In ``layers`` there is one stop more, the last: the ray has left them. Where n² has kinks or jumps they end runs.
    """
    d = dimension
    if isinstance(layers, OnGrid):
        return GridFlow(layers, d, neighbours, stops)
    if layers is None and switching(medium, d):
        return SwitchedFlow(medium, d, neighbours, stops)
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * d + 1 + 2 * d * neighbours)
    own = layers.constants(np.zeros(1, dtype=int)).shape[1] if layers else 0
    numbers = ca.SX.sym("c", stops.constants + own)
    if layers:
        layer, height = numbers[stops.constants :], state[d - 1]
        ends = ca.vertcat(height - layer[0], height - layer[1])
    else:
        layer, ends = ca.SX(0, 1), ca.SX(0, 1)
    here = force_of(medium, layers, state[:d], layer)
    rates = ca.Function("rays", [s, state, numbers], [ray_rates(here, state, d)])
    levels = ca.vertcat(stops.levels(state, numbers[: stops.constants], here.squared), ends)
    watched = ca.Function("stops", [s, state, numbers], [levels])
    flow = integrators.for_many().compile(rates, watched, at_ends=() if layers else stops.at_ends)
    return LayeredFlow(flow, layers, d, stops.count) if layers else flow


@dataclass(frozen=True)
class LayeredFlow:
    """A flow for one layer, handed on from layer to layer; ``stops`` is the number of stops beside the heights."""

    flow: Flow
    table: Layers
    dimension: int
    stops: int

    def ensemble(
        self, states: np.ndarray, constants: np.ndarray, *, leaving: tuple[int, ...] = (), watch: Watch = UNWATCHED
    ) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""
        ends = Landing.at(states, outcome=TOO_MANY_STEPS)
        with watch.stoppable():
            for _ in self._rounds(ends, constants, leaving, watch):
                pass
        return ends

    def runs(self, state: np.ndarray, constants: np.ndarray) -> list[tuple[float, Flow, np.ndarray, np.ndarray]]:
        """The layers that one ray goes through: where each begins in σ, the flow, its constants, the state there."""
        ends = Landing.at(state[None, :])
        return [
            (
                float(ends.reached[0]),
                self.flow,
                np.append(constants, self.table.constants(layer)[0]),
                ends.states[0].copy(),
            )
            for layer in self._rounds(ends, constants[None, :], ())
        ]

    def _rounds(
        self, ends: Landing, constants: np.ndarray, leaving: tuple[int, ...], watch: Watch = UNWATCHED
    ) -> Iterator[np.ndarray]:
        """Carry all rays through one layer after the other, in place; the layers (m,) before each is gone through."""
        d, alive = self.dimension, np.arange(len(ends.states))
        layer, on, stuck, outside = self.table.starts(ends.states[:, d - 1], ends.states[:, 2 * d - 1])
        start = np.where(on < 0, NONE, self.stops + on - layer)
        ends.outcomes[stuck], ends.outcomes[outside] = NOT_FINITE, STOPPED
        ends.stopped_by[outside] = self.stops
        alive = alive[~stuck & ~outside]
        for crossed in range(MOST_CROSSINGS):
            if not watch.lets_on(crossed, len(alive)):
                return
            with watch.going(ends, alive):
                yield layer
                for number in np.unique(start[alive]):
                    rows = alive[start[alive] == number]
                    known = np.column_stack([constants[rows], self.table.constants(layer[rows])])
                    height = () if number == NONE else (int(number),)
                    landing = self.flow.ensemble(ends.states[rows], known, leaving=(*leaving, *height))
                    ends.carry_on(rows, landing)
                alive, leaving = self._handed_on(ends, layer, start, alive), ()
                ends.outcomes[alive] = TOO_MANY_STEPS
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


def flown(rates: ca.SX, state: ca.SX, states: np.ndarray, until: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Carry ``states`` (m, N) by dstate/ds = ``rates`` from s = 0 to ``until`` (m,); the ends and their status.

    Those that have not arrived keep the last state that is known.
    """
    system = ca.Function("rays", [ca.SX.sym("s"), state, ca.SX.sym("c", 0)], [ca.densify(rates)])
    landing = integrators.for_many().compile(system).ensemble(states, np.zeros((len(states), 0)), until=np.array(until))
    return landing.states, STATUS_OF_OUTCOME[landing.outcomes].astype(np.int8)


RayFlow = Flow | LayeredFlow | GridFlow | SwitchedFlow
"""Rays of one medium: integrated at once, or layer by layer, cell by cell, or piece by piece."""


def runs(
    flow: RayFlow,
    belongs: Sequence[Callable[[np.ndarray], np.ndarray]],
    states: np.ndarray,
    constants: np.ndarray,
    waiting: dict[int, np.ndarray],
    watch: Watch = UNWATCHED,
) -> Iterator[tuple[np.ndarray, Landing]]:  # fmt: skip
    """Carry rays, in place, each to its next stop.

    ``waiting`` holds the rows to be carried, by the number of the stop that they start from. Rays that come to one of
    the first stops in states (k, N) that do not ``belong`` to it are carried on; the caller may put others back into
    ``waiting``. Yields the rows of each run and how they landed.
    """
    while waiting:
        start, rows = waiting.popitem()
        if len(rows) == 0:
            continue
        leaving = () if start == NOTHING else (start,)
        if isinstance(flow, LayeredFlow | GridFlow | SwitchedFlow):
            landing = flow.ensemble(states[rows], constants[rows], leaving=leaving, watch=watch)
        else:
            landing = flow.ensemble(states[rows], constants[rows], leaving=leaving)
        states[rows] = landing.states
        struck = np.where(landing.outcomes == STOPPED, landing.stopped_by, NONE)
        for number in np.unique(struck[(struck != NONE) & (struck < len(belongs))]):
            there = rows[struck == number]
            strangers = there[~belongs[number](states[there])]
            if len(strangers):
                waiting[int(number)] = np.concatenate([waiting.get(int(number), strangers[:0]), strangers])
        yield rows, landing


@dataclass(frozen=True)
class Hamilton(Model):
    """Hamilton's ray equations, integrated: for every medium and all surfaces."""

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        return HamiltonRays(medium, dimension, surfaces)


@dataclass
class HamiltonRays:
    """The model for one graded medium, with the surfaces that rays in it may meet.

    Systems are compiled when they are first needed, and kept.
    """

    medium: Medium
    dimension: int
    surfaces: Sequence[Geometry]
    _stopped_flows: dict[tuple[int, bool], RayFlow] = field(default_factory=dict, repr=False)
    _timed_flows: dict[int, Flow | GridFlow | SwitchedFlow] = field(default_factory=dict, repr=False)
    _path_flows: dict[int, Flow] = field(default_factory=dict, repr=False)

    name = "Hamilton's ray equations"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING, watch: Watch = UNWATCHED) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,), infinite where there is none.

        ``leaving`` is the number of the surface all of them start from. A ``watch`` goes with them over kinks, jumps
        and knots.
        """
        states = packed(beam)
        struck = np.full(len(beam), NOTHING)
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        limited = bool(np.all(np.isfinite(limit)))
        bound = limit if limited else np.full(len(beam), FAR_SPHERE * self._extent(beam.position))
        constants = np.column_stack([bound, DARK * np.sum(beam.momentum**2, axis=1)])
        left = np.flatnonzero(limit > beam.optical_path)
        if not limited and self._steady:
            never = self._behind(beam, leaving != NOTHING)
            status[never] = RayStatus.MISSED
            left = np.flatnonzero(~never)
        few = 0 < len(left) < FEW_BY_PATH
        if limited and few and not self.surfaces and not self._pieced and integrators.compiles():
            left = left[~self._by_path(states, limit, left, beam.deviations)]
        if len(left):  # otherwise nothing need be compiled
            flow = self.stopped_flow(beam.deviations, limited)
            for rows, landing in runs(flow, self._belonging, states, constants, {leaving: left}, watch):
                struck[rows], status[rows] = self._told(landing, limited)
        if watch.kept and watch.stage.stopped:
            status[status == RayStatus.TOO_MANY_STEPS] = RayStatus.INTERRUPTED
        on_jump = np.isin(status, UNDER_WAY)  # and n² is that on one side of it
        status = np.where(self._sound(states) | on_jump, status, SINGULAR)
        return Arrival(unpacked(states, self.dimension), struck, status)

    def _by_path(self, states: np.ndarray, limit: np.ndarray, rows: np.ndarray, neighbours: int) -> np.ndarray:
        """Carry ``rows`` of the states, in place, to optical paths ``limit`` (m,); which of them have come there.

        With the optical path for the abscissa there is no stop to be found, but the equations are of second order only
        with σ, by which they take a quarter of the steps where nothing is compiled. Where the index all but vanishes
        rays take very many steps in the optical path: those are left as they were.
        """
        d = self.dimension
        with _ONE_AT_A_TIME:
            if neighbours not in self._path_flows:
                system = ray_system(self.medium, d, neighbours, by_path=True)
                self._path_flows[neighbours] = integrators.for_many().compile(system)
            flow = self._path_flows[neighbours]
        none, start = np.zeros((len(rows), 0)), states[rows, 2 * d]
        with _ONE_RUN:
            landing = flow.ensemble(states[rows], none, start=start, until=limit[rows])
        there = (landing.outcomes == COMPLETED) & np.all(np.isfinite(landing.states), axis=1)
        there &= landing.steps <= STEPS_BY_PATH
        states[rows[there]] = landing.states[there]
        states[rows[there], 2 * d] = limit[rows[there]]
        return there

    @cached_property
    def _layers(self) -> Layers | None:
        """The layers of a table, or of an index of the height with tables in it."""
        return layers_of(self.medium, self.dimension)

    @cached_property
    def _grid(self) -> OnGrid | None:
        """The cells of tables of several coordinates in n², where it has no kinks besides."""
        if self._layers is not None or switching(self.medium, self.dimension):
            return None
        if not looking_up(self.medium, self.dimension):
            return None
        position = ca.SX.sym("r", self.dimension)
        return on_grid(ca.SX(self.medium.squared_index(position)), position)

    @cached_property
    def steps_over_knots(self) -> bool:
        """Whether n² is looked up in tables of several arguments, or of no height: steps go over their knots."""
        return self._layers is None and self._grid is None and looking_up(self.medium, self.dimension)

    @cached_property
    def _pieced(self) -> bool:
        """Whether rays are carried piece by piece, from one height of a table or kink of the index to the next."""
        return self._layers is not None or self._grid is not None or switching(self.medium, self.dimension)

    @cached_property
    def _steady(self) -> bool:
        """Whether the level of the one surface grows along every ray at a constant rate: no force acts across it."""
        if len(self.surfaces) != 1 or self._layers is not None or self._grid is not None:
            return False
        r, p = ca.SX.sym("r", self.dimension), ca.SX.sym("p", self.dimension)
        level = self.surfaces[0].surface.level(r)
        slope = ca.jtimes(level, r, p)
        pull = ca.gradient(self.medium.squared_index(r), r) / 2
        return bool((ca.jtimes(slope, r, p) + ca.jtimes(slope, p, pull)).is_zero())

    def _behind(self, beam: Beam, leaving: bool) -> np.ndarray:
        """True (m,) for rays that never come to the one surface, where they approach it at a constant rate."""
        level, slope, _ = self.surfaces[0].along(beam.position, beam.momentum)
        return np.full(len(beam), fill_value=True) if leaving else ~(level * slope < 0)

    def _extent(self, points: np.ndarray) -> float:
        """The size of the scene seen from ``points``: their distances from the origin and from the surfaces."""
        away = [np.abs(points).max(initial=0.0)]
        for surface in self.surfaces:
            distance = surface.distance(points)
            away.append(distance[np.isfinite(distance)].max(initial=0.0))
        return float(max(away)) or 1.0

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        state, limit = packed(beam), _up_to(np.array([path]))
        unhindered = self._unhindered.stopped_flow(beam.deviations, True)
        length = float(unhindered.ensemble(state, limit).reached[0])
        pieced = isinstance(unhindered, LayeredFlow | GridFlow | SwitchedFlow)
        runs_ = unhindered.runs(state[0], limit[0]) if pieced else [(0.0, unhindered, limit[0], state[0])]
        starts, trajectories = np.array([start for start, *_ in runs_]), []
        for (start, flow, constants, begin), end in zip(runs_, [*starts[1:], length], strict=True):
            run = flow.trajectory(
                np.array([0.0, max(end - start, SHORTEST_RUN * length)]), begin, constants, dense=True
            )
            if run.outcome is not RunOutcome.COMPLETED or run.trajectory is None:
                raise ArithmeticError(f"a ray could not be followed a second time: {run.outcome.value}")
            trajectories.append(run.trajectory)

        def at(sigma: np.ndarray) -> Beam:
            """The ray at σ (m,)."""
            part = np.maximum(np.searchsorted(starts, sigma, side="right") - 1, 0)
            states = np.empty((len(sigma), state.shape[1]))
            for k in np.unique(part):
                states[part == k] = trajectories[k](sigma[part == k] - starts[k])
            return unpacked(states, self.dimension)

        return Leg(at, length, tuple(starts[1:].tolist()))

    def onward(
        self, beam: Beam, sigma: np.ndarray, path: np.ndarray, watch: Watch = UNWATCHED
    ) -> tuple[Beam, np.ndarray]:
        """See :meth:`varcalc.optics.models.model.Carrier.onward`; in a table rays go to ``path``."""
        if self._layers is None:
            flow = self._timed_flow(beam.deviations)
            begin, none, crossed = packed(beam), np.zeros((len(beam), 0)), beam.crossed
            if isinstance(flow, SwitchedFlow):
                landing, crossed = flow.crossing(begin, none, until=sigma, crossed=crossed, watch=watch)
            else:
                landing = flow.ensemble(begin, none, until=sigma)
            there = (landing.outcomes == COMPLETED) & (np.abs(landing.reached - sigma) <= SAME_SIGMA * sigma)
            return replace(self._known(np.where(there[:, None], landing.states, np.nan)), crossed=crossed), sigma
        states, grown = packed(beam), np.zeros(len(beam))
        ahead = np.flatnonzero(path > beam.optical_path)
        if len(ahead):
            landing = self._unhindered.stopped_flow(beam.deviations, True).ensemble(states[ahead], _up_to(path[ahead]))
            there = (landing.outcomes == STOPPED) & (landing.stopped_by == 1)
            states[ahead] = np.where(there[:, None], landing.states, np.nan)
            grown[ahead] = landing.reached
        return self._known(states), grown

    def smooth(self, beam: Beam, end: Beam) -> Iterator[tuple[np.ndarray, Beam, Beam]]:
        """The way of rays to their ``end`` in parts between jumps of the index: rows, and both ends of each."""
        flow = self._unhindered.stopped_flow(beam.deviations, True) if self.jumps else None
        if not isinstance(flow, SwitchedFlow):
            yield np.arange(len(beam)), beam, end
            return
        for piece in flow.pieces(packed(beam), _up_to(end.optical_path)):
            yield piece.rows, unpacked(piece.first, self.dimension), unpacked(piece.last, self.dimension)

    @cached_property
    def jumps(self) -> bool:
        """Whether the index jumps inside the medium, so that neighbouring rays may part."""
        return jumping(self.medium, self.dimension)

    def crossed(self, beam: Beam, limit: np.ndarray, watch: Watch = UNWATCHED) -> np.ndarray:
        """What rays have come through (m,) at optical paths ``limit`` (m,), whatever surfaces there are: see `Beam`.

        Not a number for rays that the ``watch`` has not let on so far.
        """
        flow = self._unhindered.stopped_flow(beam.deviations, True)
        if not isinstance(flow, SwitchedFlow):
            return beam.crossed
        landing, crossed = flow.crossing(packed(beam), _up_to(limit), crossed=beam.crossed, watch=watch)
        return np.where(landing.outcomes == TOO_MANY_STEPS, np.nan, crossed)

    def _sound(self, states: np.ndarray) -> np.ndarray:
        """True (m,) for rays of which |p| = n still holds."""
        d = self.dimension
        with np.errstate(all="ignore"):
            squared = self._squared(states[:, :d])
            return np.abs(np.sum(states[:, d : 2 * d] ** 2, axis=1) - squared) <= MOMENTUM_BROKEN * np.abs(squared)

    def _known(self, states: np.ndarray) -> Beam:
        """The rays of ``states``, in place not a number where |p| = n no longer holds."""
        states[~self._sound(states)] = np.nan
        return unpacked(states, self.dimension)

    def _timed_flow(self, neighbours: int) -> Flow | GridFlow | SwitchedFlow:
        """The compiled system for runs to known σ."""
        with _ONE_AT_A_TIME:
            if neighbours not in self._timed_flows:
                self._timed_flows[neighbours] = self._timed(neighbours)
            return self._timed_flows[neighbours]

    def _timed(self, neighbours: int) -> Flow | GridFlow | SwitchedFlow:
        if self._grid is not None:
            return GridFlow(self._grid, self.dimension, neighbours, NO_RAY_STOPS)
        if self._layers is None and self._pieced:
            return SwitchedFlow(self.medium, self.dimension, neighbours, NO_RAY_STOPS)
        return integrators.for_many().compile(ray_system(self.medium, self.dimension, neighbours))

    @cached_property
    def _unhindered(self) -> HamiltonRays:
        """The model without the surfaces."""
        return HamiltonRays(self.medium, self.dimension, ()) if self.surfaces else self

    @cached_property
    def _squared(self) -> Callable[[np.ndarray], np.ndarray]:
        """n² (m,) at points (m, d)."""
        position = ca.SX.sym("r", self.dimension)
        call = PointEvaluator(ca.Function("squared", [position], [ca.densify(self.medium.squared_index(position))]))
        return lambda points: call(len(points), points)[:, 0]

    def _told(self, landing: Landing, limited: bool) -> tuple[np.ndarray, np.ndarray]:
        """What a landing says: the surfaces struck, and the status of each ray."""
        status = STATUS_OF_OUTCOME[landing.outcomes]
        stop, dark = np.where(landing.outcomes == STOPPED, landing.stopped_by, NONE), len(self.surfaces)
        status[stop == dark] = SINGULAR
        if not limited:
            status[stop == dark + 1] = RayStatus.MISSED
        status[stop > dark + 1] = RayStatus.OUTSIDE
        return np.where(stop >= dark, NOTHING, stop), status

    @cached_property
    def _belonging(self) -> list[Callable[[np.ndarray], np.ndarray]]:
        """Whether states in which rays come to a surface are on it, and those of all but no momentum where it is dark.

        Where n² vanishes and its slope does not rays come to rest and turn back, as a stone does.
        """
        d = self.dimension

        def on(surface: Geometry) -> Callable[[np.ndarray], np.ndarray]:
            return lambda states: surface.belongs(states[:, :d])

        def flat(states: np.ndarray) -> np.ndarray:
            """Whether n² is level at states (k, 2d + ...), next to how it bends and how slow the ray is."""
            _, gradient, hessian = self._field(states[:, :d])
            bend, squared = np.linalg.norm(hessian, axis=(1, 2)), np.sum(states[:, d : 2 * d] ** 2, axis=1)
            return np.sum(gradient**2, axis=1) <= FLAT * bend * squared

        return [*map(on, self.surfaces), flat]

    @cached_property
    def _field(self) -> Field:
        """n² with its derivatives."""
        return Field(self.medium, self.dimension)

    def stopped_flow(self, neighbours: int, limited: bool) -> RayFlow:
        """The compiled system; its last stops are where n² is its last constant, and the limit of the optical path.

        Or, in place of the limit, a sphere far away.
        """
        with _ONE_AT_A_TIME:
            if (neighbours, limited) not in self._stopped_flows:
                self._stopped_flows[neighbours, limited] = self._compiled(neighbours, limited)
            return self._stopped_flows[neighbours, limited]

    def _compiled(self, neighbours: int, limited: bool) -> RayFlow:
        d, dark = self.dimension, len(self.surfaces)

        def levels(state: Expression, constants: Expression, squared: Expression) -> Expression:
            """What vanishes where a ray ends: the surfaces' levels, where it is dark and how far it is followed."""
            here, bound = [surface.surface.level(state[:d]) for surface in self.surfaces], constants[0]
            end = state[2 * d] - bound if limited else (ca.sumsqr(state[:d]) / bound**2 - 1) / 2
            return ca.vertcat(*here, squared - constants[1], end)

        stops = RayStops(levels, dark + 2, 2, at_ends=(dark,))  # rays come to where it is dark in the limit alone
        return compile_rays(self.medium, self._layers or self._grid, d, neighbours, stops)


def _up_to(path: np.ndarray) -> np.ndarray:
    """The constants (m, 2) of runs to optical paths ``path`` (m,) that nothing dark ends."""
    return np.column_stack([path, np.full(len(path), -1.0)])
