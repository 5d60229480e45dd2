"""Rays in a graded medium, by Hamilton's ray equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import OUTCOMES, Engine, Flow, Landing, Outcome
from varcalc.optics.beam import NOTHING, Arrival, Beam, RayStatus, packed, unpacked
from varcalc.optics.leg import Leg, hamilton_leg
from varcalc.optics.media import Medium
from varcalc.optics.model import Carrier, Model
from varcalc.optics.ray_equations import Expression, LayeredSwarm, RayFlow, compile_rays, ray_system
from varcalc.optics.surfaces import Geometry
from varcalc.optics.tabulated import Tabulated
from varcalc.symbolic.instructions import Vectorised

FAR = 1e6
"""Rays that have come so many times farther than the scene is large meet nothing any more."""
BROKEN = 1e-8
"""|p|² and n², which are equal along a ray, differ by so much of n² only where the index is singular."""
ENDED = {
    OUTCOMES.index(Outcome.NOT_FINITE): RayStatus.SINGULAR,
    OUTCOMES.index(Outcome.BLOW_UP): RayStatus.SINGULAR,
    OUTCOMES.index(Outcome.TOO_MANY_STEPS): RayStatus.TOO_MANY_STEPS,
    OUTCOMES.index(Outcome.STOPPED): RayStatus.ARRIVED,
}
MEANING = np.array([int(ENDED.get(code, RayStatus.SINGULAR)) for code in range(len(OUTCOMES))])
"""The status for each outcome of a run."""

COMPLETED = OUTCOMES.index(Outcome.COMPLETED)
SINGULAR = int(RayStatus.SINGULAR)
_ONE_AT_A_TIME = Lock()
"""Threads that need the same system wait for the one that builds it."""


@dataclass(frozen=True)
class Hamilton(Model):
    """Hamilton's ray equations, integrated: for every medium and all surfaces."""

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        return HamiltonRays(medium, dimension, surfaces, integrators.for_many())


@dataclass
class HamiltonRays:
    """The model for one graded medium, with the surfaces that rays in it may meet.

    Systems are compiled when they are first needed, and kept.
    """

    medium: Medium
    dimension: int
    surfaces: Sequence[Geometry]
    engine: Engine
    _swarms: dict[tuple[int, bool], RayFlow] = field(default_factory=dict, repr=False)
    _free: dict[tuple[int, bool], RayFlow] = field(default_factory=dict, repr=False)
    _fleets: dict[int, Flow] = field(default_factory=dict, repr=False)

    name = "Hamilton's ray equations"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,), infinite where there is none.

        ``leaving`` is the number of the surface all of them start from.
        """
        states = packed(beam)
        struck = np.full(len(beam), NOTHING)
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        limited = bool(np.all(np.isfinite(limit)))
        constants = (limit if limited else np.full(len(beam), FAR * self._extent(beam.position)))[:, None]
        left = np.flatnonzero(limit > beam.optical_path)
        if not limited and self._steady:
            never = self._behind(beam, leaving != NOTHING)
            status[never] = RayStatus.MISSED
            left = np.flatnonzero(~never)
        waiting = {leaving: left} if len(left) else {}
        while waiting:
            start, rows = waiting.popitem()
            swarm = self.swarm(beam.deviations, limited)
            landing = swarm.ensemble(states[rows], constants[rows], leaving=() if start == NOTHING else (start,))
            states[rows] = landing.states
            struck[rows], status[rows] = self._told(landing, limited)
            for number in self._strangers(states, struck, rows):
                again = rows[(struck[rows] == number) & ~self._belong(states[rows], number)]
                waiting[number] = np.concatenate([waiting.get(number, again[:0]), again])
        return Arrival(unpacked(states, self.dimension), struck, np.where(self._sound(states), status, SINGULAR))

    @cached_property
    def _steady(self) -> bool:
        """Whether the level of the one surface grows along every ray at a constant rate: no force acts across it."""
        if len(self.surfaces) != 1 or isinstance(self.medium, Tabulated):
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
        """See :meth:`varcalc.optics.model.Carrier.leg`."""
        pieces = self.pieces(beam, path) or [(0.0, np.zeros(0), packed(beam)[0])]
        return hamilton_leg(pieces, self._fleet(self.dimension - 1), self.dimension, self.sigma(beam, path))

    def sigma(self, beam: Beam, path: float) -> float:
        """σ at which the one ray of ``beam`` has the optical path ``path``, whatever surfaces stand there."""
        landing = self._unhindered(beam).ensemble(packed(beam), np.array([[path]]))
        return float(landing.reached[0])

    def pieces(self, beam: Beam, path: float) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """The layers of a table that the one ray of ``beam`` goes through: see :meth:`LayeredSwarm.pieces`."""
        swarm = self._unhindered(beam)
        return swarm.pieces(packed(beam)[0], np.array([path])) if isinstance(swarm, LayeredSwarm) else []

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:
        """See :meth:`varcalc.optics.model.Carrier.onward`; in a table rays go to ``path``."""
        if not isinstance(self.medium, Tabulated):
            landing = self._fleet(beam.deviations).ensemble(packed(beam), np.zeros((len(beam), 0)), until=sigma)
            there = (landing.outcomes == COMPLETED) & (landing.reached == sigma)
            return self._known(np.where(there[:, None], landing.states, np.nan)), sigma
        states, grown = packed(beam), np.zeros(len(beam))
        ahead = np.flatnonzero(path > beam.optical_path)
        if len(ahead):
            landing = self._unhindered(beam).ensemble(states[ahead], path[ahead, None])
            there = (landing.outcomes == OUTCOMES.index(Outcome.STOPPED)) & (landing.stopped_by == 0)
            states[ahead] = np.where(there[:, None], landing.states, np.nan)
            grown[ahead] = landing.reached
        return self._known(states), grown

    def _sound(self, states: np.ndarray) -> np.ndarray:
        """True (m,) for rays of which |p| = n still holds."""
        d = self.dimension
        with np.errstate(all="ignore"):
            squared = self._squared(states[:, :d])
            return np.abs(np.sum(states[:, d : 2 * d] ** 2, axis=1) - squared) <= BROKEN * np.abs(squared)

    def _known(self, states: np.ndarray) -> Beam:
        """The rays of ``states``, in place not a number where |p| = n no longer holds."""
        states[~self._sound(states)] = np.nan
        return unpacked(states, self.dimension)

    def _fleet(self, neighbours: int) -> Flow:
        """The compiled system for runs to known σ."""
        with _ONE_AT_A_TIME:
            if neighbours not in self._fleets:
                system = ray_system(self.medium, self.dimension, neighbours)
                self._fleets[neighbours] = self.engine.compile(system)
            return self._fleets[neighbours]

    def _unhindered(self, beam: Beam) -> RayFlow:
        """The compiled system without the surfaces."""
        if not self.surfaces:
            return self.swarm(beam.deviations, True)
        return HamiltonRays(self.medium, self.dimension, (), self.engine, self._free).swarm(beam.deviations, True)

    @cached_property
    def _squared(self) -> Callable[[np.ndarray], np.ndarray]:
        """n² (m,) at points (m, d)."""
        position = ca.SX.sym("r", self.dimension)
        call = Vectorised(ca.Function("squared", [position], [ca.densify(self.medium.squared_index(position))]))
        return lambda points: call.table(points)[:, 0]

    def _told(self, landing: Landing, limited: bool) -> tuple[np.ndarray, np.ndarray]:
        """What a landing says: the surfaces struck, and the status of each ray."""
        status = MEANING[landing.outcomes]
        end = landing.stopped_by == len(self.surfaces)  # the limit, or the far sphere
        if not limited:
            status[end] = RayStatus.MISSED
        outside = landing.stopped_by > len(self.surfaces)
        status[outside] = RayStatus.OUTSIDE
        return np.where(end | outside, NOTHING, landing.stopped_by), status

    def _strangers(self, states: np.ndarray, struck: np.ndarray, rows: np.ndarray) -> list[int]:
        """The surfaces on whose levels, but not on which themselves, some of the rays have stopped."""
        numbers = [int(k) for k in np.unique(struck[rows]) if k != NOTHING]
        return [k for k in numbers if not np.all(self._belong(states[rows[struck[rows] == k]], k))]

    def _belong(self, states: np.ndarray, number: int) -> np.ndarray:
        return self.surfaces[number].belongs(states[:, : self.dimension])

    def swarm(self, neighbours: int, limited: bool) -> RayFlow:
        """The compiled system; its last stop is the limit of the optical path, or a sphere far away."""
        with _ONE_AT_A_TIME:
            if (neighbours, limited) not in self._swarms:
                self._swarms[neighbours, limited] = self._compiled(neighbours, limited)
            return self._swarms[neighbours, limited]

    def _compiled(self, neighbours: int, limited: bool) -> RayFlow:
        d = self.dimension

        def stops(state: Expression, bound: Expression) -> Expression:
            levels = [surface.surface.level(state[:d]) for surface in self.surfaces]
            end = state[2 * d] - bound if limited else (ca.sumsqr(state[:d]) / bound**2 - 1) / 2
            return ca.vertcat(*levels, end)

        return compile_rays(self.engine, self.medium, d, neighbours, stops, 1)
