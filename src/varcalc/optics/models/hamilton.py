"""Rays in a graded medium, by Hamilton's ray equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import OUTCOMES, Flow, Landing, Outcome
from varcalc.optics.media.medium import Expression, Medium
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.model import Carrier, Model
from varcalc.optics.models.ray_equations import (
    STATUS_OF_OUTCOME,
    STOPPED,
    LayeredFlow,
    RayFlow,
    compile_rays,
    ray_system,
    runs,
)
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam, RayStatus, packed, unpacked
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Geometry
from varcalc.symbolic.evaluation import PointEvaluator

SHORTEST_RUN = 1e-13
"""Of a leg: the shortest part of it that is integrated."""
FAR_SPHERE = 1e6
"""Rays that have come so many times farther than the scene is large meet nothing any more."""
MOMENTUM_BROKEN = 1e-8
"""|p|² and n², which are equal along a ray, differ by so much of n² only where the index is singular."""
COMPLETED = OUTCOMES.index(Outcome.COMPLETED)
SINGULAR = int(RayStatus.SINGULAR)
_ONE_AT_A_TIME = Lock()
"""Threads that need the same system wait for the one that builds it."""


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
    _timed_flows: dict[int, Flow] = field(default_factory=dict, repr=False)

    name = "Hamilton's ray equations"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,), infinite where there is none.

        ``leaving`` is the number of the surface all of them start from.
        """
        states = packed(beam)
        struck = np.full(len(beam), NOTHING)
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        limited = bool(np.all(np.isfinite(limit)))
        constants = (limit if limited else np.full(len(beam), FAR_SPHERE * self._extent(beam.position)))[:, None]
        left = np.flatnonzero(limit > beam.optical_path)
        if not limited and self._steady:
            never = self._behind(beam, leaving != NOTHING)
            status[never] = RayStatus.MISSED
            left = np.flatnonzero(~never)
        if len(left):  # otherwise nothing need be compiled
            flow = self.stopped_flow(beam.deviations, limited)
            for rows, landing in runs(flow, self.surfaces, states, constants, {leaving: left}):
                struck[rows], status[rows] = self._told(landing, limited)
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
        state, limit = packed(beam), np.array([[path]])
        unhindered = self._unhindered.stopped_flow(beam.deviations, True)
        length = float(unhindered.ensemble(state, limit).reached[0])
        layered = isinstance(unhindered, LayeredFlow)
        pieces = unhindered.pieces(state[0], limit[0]) if layered else [(0.0, np.zeros(0), state[0])]
        starts, flow, trajectories = np.array([start for start, _, _ in pieces]), self._timed_flow(beam.deviations), []
        for (start, constants, begin), end in zip(pieces, [*starts[1:], length], strict=True):
            run = flow.trajectory(
                np.array([0.0, max(end - start, SHORTEST_RUN * length)]), begin, constants, dense=True
            )
            if run.outcome is not Outcome.COMPLETED or run.trajectory is None:
                raise ArithmeticError(f"a ray could not be followed a second time: {run.outcome.value}")
            trajectories.append(run.trajectory)

        def at(sigma: np.ndarray) -> Beam:
            part = np.maximum(np.searchsorted(starts, sigma, side="right") - 1, 0)
            states = np.empty((len(sigma), state.shape[1]))
            for k in np.unique(part):
                states[part == k] = trajectories[k](sigma[part == k] - starts[k])
            return unpacked(states, self.dimension)

        return Leg(at, length, tuple(starts[1:].tolist()))

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:
        """See :meth:`varcalc.optics.models.model.Carrier.onward`; in a table rays go to ``path``."""
        if not isinstance(self.medium, Tabulated):
            landing = self._timed_flow(beam.deviations).ensemble(packed(beam), np.zeros((len(beam), 0)), until=sigma)
            there = (landing.outcomes == COMPLETED) & (landing.reached == sigma)
            return self._known(np.where(there[:, None], landing.states, np.nan)), sigma
        states, grown = packed(beam), np.zeros(len(beam))
        ahead = np.flatnonzero(path > beam.optical_path)
        if len(ahead):
            landing = self._unhindered.stopped_flow(beam.deviations, True).ensemble(states[ahead], path[ahead, None])
            there = (landing.outcomes == STOPPED) & (landing.stopped_by == 0)
            states[ahead] = np.where(there[:, None], landing.states, np.nan)
            grown[ahead] = landing.reached
        return self._known(states), grown

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

    def _timed_flow(self, neighbours: int) -> Flow:
        """The compiled system for runs to known σ."""
        with _ONE_AT_A_TIME:
            if neighbours not in self._timed_flows:
                system = ray_system(self.medium, self.dimension, neighbours)
                self._timed_flows[neighbours] = integrators.for_many().compile(system)
            return self._timed_flows[neighbours]

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
        end = landing.stopped_by == len(self.surfaces)  # the limit, or the far sphere
        if not limited:
            status[end] = RayStatus.MISSED
        outside = landing.stopped_by > len(self.surfaces)
        status[outside] = RayStatus.OUTSIDE
        return np.where(end | outside, NOTHING, landing.stopped_by), status

    def stopped_flow(self, neighbours: int, limited: bool) -> RayFlow:
        """The compiled system; its last stop is the limit of the optical path, or a sphere far away."""
        with _ONE_AT_A_TIME:
            if (neighbours, limited) not in self._stopped_flows:
                self._stopped_flows[neighbours, limited] = self._compiled(neighbours, limited)
            return self._stopped_flows[neighbours, limited]

    def _compiled(self, neighbours: int, limited: bool) -> RayFlow:
        d = self.dimension

        def stops(state: Expression, bound: Expression) -> Expression:
            levels = [surface.surface.level(state[:d]) for surface in self.surfaces]
            end = state[2 * d] - bound if limited else (ca.sumsqr(state[:d]) / bound**2 - 1) / 2
            return ca.vertcat(*levels, end)

        return compile_rays(self.medium, d, neighbours, stops, 1)
