"""Where rays pass closest to a point.

Along a ray the distance to B is stationary where g = p·(r - B) = 0, and least
where g grows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import casadi as ca
import numpy as np

from varcalc.integrators import NONE, OUTCOMES, Engine, Outcome
from varcalc.optics.beam import NOTHING, Beam
from varcalc.optics.layered import Expression, RayFlow, compile_rays
from varcalc.optics.legs import moved_on
from varcalc.optics.media import Field, Medium
from varcalc.optics.straight import StraightRays
from varcalc.optics.surfaces import Geometry
from varcalc.optics.system import packed, unpacked

STOPPED = OUTCOMES.index(Outcome.STOPPED)
MOST_PASSES = 200
"""Passes of one ray; a ray that is caught in a small circle would go on for ever."""


class LastLeg(Protocol):
    """How rays go on in the medium that holds the point."""

    def minima(self, beam: Beam, target: np.ndarray, limit: float, far: float, leaving: int) -> tuple[np.ndarray, Beam]:
        """The rows of ``beam`` that pass ``target`` (d,), and the rays there.

        Rays are followed to the optical path ``limit`` and the distance ``far`` from the target.
        """
        ...


@dataclass(frozen=True)
class StraightLeg:
    """A last leg in a uniform medium."""

    model: StraightRays

    def minima(self, beam: Beam, target: np.ndarray, limit: float, far: float, leaving: int) -> tuple[np.ndarray, Beam]:
        """See :meth:`LastLeg.minima`."""
        squared = self.model.squared_index
        sigma = np.sum((target - beam.position) * beam.momentum, axis=1) / squared
        there = moved_on(beam, sigma, squared)
        near = np.linalg.norm(there.position - target, axis=1) <= far
        end = self.model.advance(beam, np.full(len(beam), limit), leaving).beam.optical_path
        end = np.where(end > beam.optical_path, end, limit)  # nothing is met: only the limit counts
        rows = np.flatnonzero(near & (sigma > 0) & (there.optical_path <= end))
        return rows, there.take(rows)


@dataclass
class HamiltonLeg:
    """A last leg in a graded medium; compiled when first needed, for every target and limit."""

    medium: Medium
    dimension: int
    surfaces: Sequence[Geometry]
    engine: Engine
    _swarm: RayFlow | None = field(default=None, repr=False)

    def minima(self, beam: Beam, target: np.ndarray, limit: float, far: float, leaving: int) -> tuple[np.ndarray, Beam]:
        """See :meth:`LastLeg.minima`."""
        swarm, least = self._compiled(), len(self.surfaces)
        states = packed(beam)
        constants = np.tile([*target, limit, far], (len(beam), 1))
        waiting = {leaving: np.flatnonzero(beam.optical_path < limit)}
        found: list[tuple[np.ndarray, np.ndarray]] = []
        for _ in range(MOST_PASSES):
            if not waiting:
                break
            start, rows = waiting.popitem()
            if len(rows) == 0:
                continue
            landing = swarm.ensemble(states[rows], constants[rows], leaving=() if start == NOTHING else (start,))
            states[rows] = landing.states
            stop = np.where(landing.outcomes == STOPPED, landing.stopped_by, NONE)
            nearest = rows[stop == least]
            if len(nearest):
                minimum = nearest[self._grows(states[nearest], target)]
                found.append((minimum, states[minimum]))
                waiting[least] = np.concatenate([waiting.get(least, nearest[:0]), nearest])
            for number in range(least):  # levels of surfaces where these do not reach
                strangers = rows[stop == number]
                strangers = strangers[~self.surfaces[number].belongs(states[strangers, : self.dimension])]
                if len(strangers):
                    waiting[number] = np.concatenate([waiting.get(number, strangers[:0]), strangers])
        rows = np.concatenate([r for r, _ in found]) if found else np.zeros(0, dtype=int)
        ends = np.concatenate([s for _, s in found]) if found else states[:0]
        return rows, unpacked(ends, self.dimension)

    def _grows(self, states: np.ndarray, target: np.ndarray) -> np.ndarray:
        """True where g = p·(r - B) grows along the ray: the distance is least."""
        d = self.dimension
        _, gradient, _ = Field(self.medium, d)(states[:, :d])
        return np.sum(states[:, d : 2 * d] ** 2 + gradient / 2 * (states[:, :d] - target), axis=1) > 0

    def _compiled(self) -> RayFlow:
        """The ray system with all neighbours; constants are the target and the two limits."""
        d = self.dimension
        if self._swarm is None:

            def stops(state: Expression, constants: Expression) -> Expression:
                levels = [surface.surface.level(state[:d]) for surface in self.surfaces]
                offset = state[:d] - constants[:d]
                away = (ca.sumsqr(offset) / constants[d + 1] ** 2 - 1) / 2
                return ca.vertcat(*levels, ca.dot(state[d : 2 * d], offset), state[2 * d] - constants[d], away)

            self._swarm = compile_rays(self.engine, self.medium, d, d - 1, stops, d + 2)
        return self._swarm
