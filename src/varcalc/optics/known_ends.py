"""Rays whose ends need not be looked for, because the parameter there is known beforehand.

A given optical path is one: with S for the parameter the ray ends at it. A
plane towards which no force acts is another: the momentum across it is
constant, so that σ there is the distance over it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.engines import OUTCOMES, Engine, Fleet, Outcome
from varcalc.optics.media import Field, Medium
from varcalc.optics.surfaces import Geometry
from varcalc.optics.system import ray_system

DRIFT = 1e-13
"""|p|² and n² may differ by as much of n² before a ray is carried again, with a stop that is looked for."""
COMPLETED = OUTCOMES.index(Outcome.COMPLETED)


@dataclass
class KnownEnds:
    """The rays of one medium; systems are compiled when first needed, and kept."""

    medium: Medium
    dimension: int
    engine: Engine
    _fleets: dict[tuple[int, bool], Fleet] = field(default_factory=dict, init=False, repr=False)

    def to_path(self, states: np.ndarray, limit: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Carry ``rows`` of ``states`` to the optical path ``limit`` (m,), in place; returns those that failed.

        The equations, divided by n², are singular where n is zero.
        """
        place = 2 * self.dimension
        left = self._carry(states, rows, limit[rows] - states[rows, place], by_path=True)
        arrived = np.setdiff1d(rows, left)
        states[arrived, place] = limit[arrived]
        return left

    def to_sigma(self, states: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """The ``states`` (m, N) after ``sigma`` (m,), not a number where a ray does not come so far."""
        landing = self._fleet(states.shape[1], by_path=False).run(states, np.zeros((len(states), 0)), sigma)
        arrived = (landing.outcomes == COMPLETED) & (landing.reached == sigma)
        return np.where(arrived[:, None], landing.states, np.nan)

    def to_surface(
        self, states: np.ndarray, geometry: Geometry, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Carry ``rows`` of ``states`` to the surface, in place.

        Returns the rows that are there, those that never come to it, and
        those for which it has to be looked for.
        """
        d, nobody = self.dimension, rows[:0]
        if not self._steady(geometry):
            return nobody, nobody, rows
        level, slope, _ = geometry.along(states[rows, :d], states[rows, d : 2 * d])
        with np.errstate(all="ignore"):
            sigma = -level / slope
        ahead = np.isfinite(sigma) & (sigma > 0)
        left = self._carry(states, rows[ahead], sigma[ahead], by_path=False)
        return np.setdiff1d(rows[ahead], left), rows[~ahead], left

    def _steady(self, geometry: Geometry) -> bool:
        """Whether the surface's level grows along every ray at a constant rate."""
        d = self.dimension
        r, p = ca.SX.sym("r", d), ca.SX.sym("p", d)
        level = geometry.surface.level(r)
        slope = ca.jtimes(level, r, p)
        pull = ca.gradient(self.medium.squared_index(r), r) / 2
        return bool((ca.jtimes(slope, r, p) + ca.jtimes(slope, p, pull)).is_zero())

    def _carry(self, states: np.ndarray, rows: np.ndarray, until: np.ndarray, *, by_path: bool) -> np.ndarray:
        """Carry ``rows`` of ``states`` to ``until``, in place; returns those that failed, as they were."""
        if len(rows) == 0:
            return rows
        d = self.dimension
        landing = self._fleet(states.shape[1], by_path).run(states[rows], np.zeros((len(rows), 0)), until)
        with np.errstate(all="ignore"):
            squared, _, _ = Field(self.medium, d)(landing.states[:, :d])
            drift = np.abs(np.sum(landing.states[:, d : 2 * d] ** 2, axis=1) / squared - 1)
        sound = (landing.outcomes == COMPLETED) & (drift <= DRIFT)
        states[rows[sound]] = landing.states[sound]
        return rows[~sound]

    def _fleet(self, size: int, by_path: bool) -> Fleet:
        """The compiled system for ``size`` states, with the optical path or σ for its parameter."""
        if (size, by_path) not in self._fleets:
            d = self.dimension
            s, state, nothing = ca.SX.sym("s"), ca.SX.sym("Y", size), ca.SX.sym("c", 0)
            rates = ray_system(self.medium, d, size // (2 * d) - 1)(s, state, nothing)
            if by_path:
                rates /= self.medium.squared_index(state[:d])
            self._fleets[size, by_path] = self.engine.compile_fleet(ca.Function("rays", [s, state, nothing], [rates]))
        return self._fleets[size, by_path]
