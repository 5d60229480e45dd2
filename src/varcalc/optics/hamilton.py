"""Hamilton's ray equations in a graded medium.

dr/dσ = p, dp/dσ = ∇n²/2, dS/dσ = n², of the Hamiltonian (|p|² - n²)/2 = 0
(Born and Wolf, sect. 3.2; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 3.3): for many media polynomials. The deviations of neighbours obey
δr' = δp, δp' = H δr/2 with H the Hessian matrix of n² (the ray deviation
equation, Brizard sect. 1.4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.engines import OUTCOMES, Engine, Fleet, Landing, Outcome, Swarm
from varcalc.optics.beam import NOTHING, Arrival, Beam, RayStatus
from varcalc.optics.layered import Expression, LayeredSwarm, compile_rays, ray_rates
from varcalc.optics.media import Field, Medium
from varcalc.optics.surfaces import Geometry
from varcalc.optics.tabulated import Tabulated, cubic

FAR = 1e6
"""Rays that have come so many times farther than the scene is large meet nothing any more."""
BROKEN = 1e-8
"""|p|² and n², which are equal along a ray, differ by so much of n² only where the index is singular."""
DRIFT = 1e-13
"""By as much they may differ before a ray is carried again in the regular parameter."""
COMPLETED = OUTCOMES.index(Outcome.COMPLETED)
ENDED = {
    OUTCOMES.index(Outcome.NOT_FINITE): RayStatus.SINGULAR,
    OUTCOMES.index(Outcome.BLOW_UP): RayStatus.SINGULAR,
    OUTCOMES.index(Outcome.TOO_MANY_STEPS): RayStatus.TOO_MANY_STEPS,
    OUTCOMES.index(Outcome.STOPPED): RayStatus.ARRIVED,
}


def ray_system(medium: Medium, dimension: int, neighbours: int) -> ca.Function:
    """Hamilton's ray equations with ``neighbours`` deviations, as the engines take a system.

    The state is r, p, S, then δr and δp of each neighbour. There are no
    constants, but for those of one layer where the medium is a table.
    """
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * dimension + 1 + 2 * dimension * neighbours)
    constants = ca.SX.sym("c", 6 if isinstance(medium, Tabulated) else 0)
    if isinstance(medium, Tabulated):
        squared = cubic(state[dimension - 1], constants)
    else:
        squared = medium.squared_index(state[:dimension])
    return ca.Function("rays", [s, state, constants], [ray_rates(squared, state, dimension)])


def packed(beam: Beam) -> np.ndarray:
    """The states (m, N) of :func:`ray_system` for the rays of ``beam``."""
    pairs = np.concatenate([beam.moved, beam.turned], axis=2).reshape(len(beam), -1)
    return np.column_stack([beam.position, beam.momentum, beam.optical_path, pairs])


def unpacked(states: np.ndarray, dimension: int) -> Beam:
    """The rays of the states (m, N)."""
    d = dimension
    pairs = states[:, 2 * d + 1 :].reshape(len(states), states.shape[1] // (2 * d) - 1, 2 * d)
    return Beam(states[:, :d], states[:, d : 2 * d], states[:, 2 * d], pairs[:, :, :d], pairs[:, :, d:])


@dataclass
class HamiltonRays:
    """The model for one graded medium, with the surfaces that rays in it may meet.

    Systems are compiled when they are first needed, and kept.
    """

    medium: Medium
    dimension: int
    surfaces: Sequence[Geometry]
    engine: Engine
    _swarms: dict[tuple[int, bool], Swarm] = field(default_factory=dict, repr=False)
    _fleets: dict[int, Fleet] = field(default_factory=dict, repr=False)
    _free: dict[tuple[int, bool], Swarm] = field(default_factory=dict, repr=False)

    name = "Hamilton's ray equations"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,), infinite where there is none.

        ``leaving`` is the number of the surface all of them start from.
        """
        states = packed(beam)
        struck = np.full(len(beam), NOTHING)
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        limited = bool(np.all(np.isfinite(limit)))
        swarm = self.swarm(beam.deviations, limited)
        constants = (limit if limited else np.full(len(beam), FAR * self._extent(beam.position)))[:, None]
        left = np.flatnonzero(limit > beam.optical_path)
        if limited and not self.surfaces and not isinstance(self.medium, Tabulated):
            left = self._along_the_path(states, limit, left)
        waiting = {leaving: left} if len(left) else {}
        while waiting:
            start, rows = waiting.popitem()
            landing = swarm.run(states[rows], constants[rows], () if start == NOTHING else (start,))
            states[rows] = landing.states
            struck[rows], status[rows] = self._told(landing, limited)
            for number in self._strangers(states, struck, rows):
                again = rows[(struck[rows] == number) & ~self._belong(states[rows], number)]
                waiting[number] = np.concatenate([waiting.get(number, again[:0]), again])
        carried = unpacked(states, self.dimension)
        return Arrival(carried, struck, self._checked(carried, status))

    def _extent(self, points: np.ndarray) -> float:
        """The size of the scene seen from ``points``: their distances from the origin and from the surfaces."""
        away = [np.abs(points).max(initial=0.0)]
        for surface in self.surfaces:
            with np.errstate(all="ignore"):
                distance = np.abs(surface.level(points)) / np.linalg.norm(surface.gradient(points), axis=1)
            away.append(distance[np.isfinite(distance)].max(initial=0.0))
        return float(max(away)) or 1.0

    def _along_the_path(self, states: np.ndarray, limit: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Carry ``rows`` of ``states``, in place, with S for the parameter; returns those that need σ.

        There is no stop to be looked for then, but the equations, divided by
        n², are singular where n is zero.
        """
        d = self.dimension
        landing = self._fleet(states.shape[1]).run(
            states[rows], np.zeros((len(rows), 0)), limit[rows] - states[rows, 2 * d]
        )
        with np.errstate(all="ignore"):
            squared, _, _ = Field(self.medium, d)(landing.states[:, :d])
            drift = np.abs(np.sum(landing.states[:, d : 2 * d] ** 2, axis=1) / squared - 1)
        sound = (landing.outcomes == COMPLETED) & (drift <= DRIFT)
        states[rows[sound]] = landing.states[sound]
        states[rows[sound], 2 * d] = limit[rows[sound]]
        return rows[~sound]

    def _fleet(self, size: int) -> Fleet:
        """The compiled system for ``size`` states with the optical path for its parameter."""
        if size not in self._fleets:
            d = self.dimension
            rates = ray_system(self.medium, d, size // (2 * d) - 1)
            s, state = ca.SX.sym("s"), ca.SX.sym("Y", size)
            divided = rates(s, state, ca.SX(0, 1)) / self.medium.squared_index(state[:d])
            self._fleets[size] = self.engine.compile_fleet(
                ca.Function("rays", [s, state, ca.SX.sym("c", 0)], [divided])
            )
        return self._fleets[size]

    def sigma(self, beam: Beam, path: float) -> float:
        """σ at which the one ray of ``beam`` has the optical path ``path``, whatever surfaces stand there."""
        landing = self._unhindered(beam).run(packed(beam), np.array([[path]]))
        return float(landing.reached[0])

    def pieces(self, beam: Beam, path: float) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """The layers of a table that the one ray of ``beam`` goes through: see :meth:`LayeredSwarm.pieces`."""
        swarm = self._unhindered(beam)
        return swarm.pieces(packed(beam)[0], np.array([path])) if isinstance(swarm, LayeredSwarm) else []

    def _unhindered(self, beam: Beam) -> Swarm:
        """The compiled system without the surfaces."""
        if not self.surfaces:
            return self.swarm(beam.deviations, True)
        return HamiltonRays(self.medium, self.dimension, (), self.engine, self._free).swarm(beam.deviations, True)

    def _told(self, landing: Landing, limited: bool) -> tuple[np.ndarray, np.ndarray]:
        """What a landing says: the surfaces struck, and the status of each ray."""
        status = np.array([int(ENDED[int(code)]) for code in landing.outcomes])
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

    def _checked(self, beam: Beam, status: np.ndarray) -> np.ndarray:
        """The status, SINGULAR where |p| = n no longer holds."""
        with np.errstate(all="ignore"):
            squared, _, _ = Field(self.medium, self.dimension)(beam.position)
            sound = np.abs(np.sum(beam.momentum**2, axis=1) - squared) <= BROKEN * np.abs(squared)
        return np.where(sound, status, int(RayStatus.SINGULAR))

    def swarm(self, neighbours: int, limited: bool) -> Swarm:
        """The compiled system; its last stop is the limit of the optical path, or a sphere far away."""
        if (neighbours, limited) not in self._swarms:
            d = self.dimension

            def stops(state: Expression, bound: Expression) -> Expression:
                levels = [surface.surface.level(state[:d]) for surface in self.surfaces]
                end = state[2 * d] - bound if limited else (ca.sumsqr(state[:d]) / bound**2 - 1) / 2
                return ca.vertcat(*levels, end)

            self._swarms[neighbours, limited] = compile_rays(self.engine, self.medium, d, neighbours, stops, 1)
        return self._swarms[neighbours, limited]
