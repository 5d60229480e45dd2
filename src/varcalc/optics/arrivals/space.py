"""Rays to a point in space where no plane is known to hold them: Newton's iteration from many directions.

Along a ray the distance to B is stationary where g = p·(r - B) = 0, and least
where g grows. At that closest approach a ray misses B by a vector across the
ray, and the neighbours' deviations are the derivative of that vector by the
launching direction.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import islice

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import STOPPED
from varcalc.optics.media.medium import Expression
from varcalc.optics.models.hamilton import RayFlow, compile_rays, runs
from varcalc.optics.models.straight import StraightRays
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import NOTHING, Beam, RayStatus, frames, launched, moved_on, packed, unpacked
from varcalc.optics.rays.sources import spread

DIRECTIONS = 1500
"""Directions looked at, 0.09 apart."""
NEAREST_DIRECTIONS = 6
"""Nearest directions among which a miss is to be the least for Newton's iteration to begin there."""
AIMING_STEPS = 30
"""Newton's steps."""
LONGEST_STEP = 0.2
"""The longest of them, in radians."""
MEETS = 4e-13
"""A ray that comes this close to B, relative to the scene, meets it."""
SAME_RAY = 1e-8
"""Directions and optical paths, relative, closer than this are one ray."""

MOST_APPROACHES = 200
"""Of one ray; a ray that is caught in a small circle would go on for ever."""

Minima = Callable[[np.ndarray], tuple[np.ndarray, Beam]]
"""Takes directions (m, 3) to the rows of those that pass B and the rays at their closest approaches."""


@dataclass(frozen=True)
class SphereSearch:
    """The launching directions (k, 3) and optical paths (k,) of rays that meet B; ``looked_at`` counts directions."""

    directions: np.ndarray
    paths: np.ndarray
    looked_at: int


@dataclass
class Approaches:
    """Where rays of ``source`` (d,) come closest to ``target`` (d,); remembers what became of the others.

    They are followed to the optical path ``within`` and the distance ``far`` from the target, where the last medium is
    graded by the ``flow`` that :func:`approaching` compiles, the same for all targets.
    """

    propagator: Propagator
    flow: Callable[[], RayFlow]
    source: np.ndarray
    target: np.ndarray
    within: float
    far: float
    ends: Counter[RayStatus] = field(default_factory=Counter)
    entered: int = 0

    def minima(self, headings: np.ndarray) -> tuple[np.ndarray, Beam]:
        """The rows of ``headings`` (m, d) whose rays pass the target, and the rays there."""
        propagator = self.propagator
        start = np.tile(self.source, (len(headings), 1))
        beam = launched(start, headings, propagator.fields[0].index(start), neighbours=True)
        beam, status, alive = propagator.into_last_medium(beam, np.full(len(headings), self.within))
        self.ends.update(RayStatus(int(code)) for code in status[~alive])
        rows = np.flatnonzero(alive)
        self.entered += len(rows)
        leaving = propagator.shapes[-1] if propagator.shapes else NOTHING
        last = propagator.models[-1]
        entry = beam.take(rows)
        found, at = (
            self._straight(last, entry, leaving) if isinstance(last, StraightRays) else self._bent(entry, leaving)
        )
        return rows[found], at

    def _straight(self, model: StraightRays, beam: Beam, leaving: int) -> tuple[np.ndarray, Beam]:
        """The rows of ``beam`` that pass the target in a uniform medium, and the rays there."""
        squared = model.squared_index
        sigma = np.sum((self.target - beam.position) * beam.momentum, axis=1) / squared
        there = moved_on(beam, sigma, squared)
        near = np.linalg.norm(there.position - self.target, axis=1) <= self.far
        end = model.advance(beam, np.full(len(beam), self.within), leaving).beam.optical_path
        end = np.where(end > beam.optical_path, end, self.within)  # nothing is met: only the limit counts
        rows = np.flatnonzero(near & (sigma > 0) & (there.optical_path <= end))
        return rows, there.take(rows)

    def _bent(self, beam: Beam, leaving: int) -> tuple[np.ndarray, Beam]:
        """The same in a graded medium; a row for each time that a ray passes the target."""
        surfaces, least = self.propagator.geometries, len(self.propagator.geometries)
        states, d = packed(beam), self.propagator.dimension
        constants = np.tile([*self.target, self.within, self.far], (len(beam), 1))
        waiting = {leaving: np.flatnonzero(beam.optical_path < self.within)}
        found: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros(0, dtype=int), states[:0])]
        for rows, landing in islice(runs(self.flow(), surfaces, states, constants, waiting), MOST_APPROACHES):
            nearest = rows[(landing.outcomes == STOPPED) & (landing.stopped_by == least)]
            if len(nearest):
                minimum = nearest[self._grows(states[nearest])]
                found.append((minimum, states[minimum]))
                waiting[least] = np.concatenate([waiting.get(least, nearest[:0]), nearest])
        return np.concatenate([r for r, _ in found]), unpacked(np.concatenate([s for _, s in found]), d)

    def _grows(self, states: np.ndarray) -> np.ndarray:
        """True where g = p·(r - B) grows along the ray: the distance is least."""
        d = self.propagator.dimension
        _, gradient, _ = self.propagator.fields[-1](states[:, :d])
        return np.sum(states[:, d : 2 * d] ** 2 + gradient / 2 * (states[:, :d] - self.target), axis=1) > 0


def approaching(propagator: Propagator) -> RayFlow:
    """The ray system of the last medium with all neighbours; constants are the target and the two limits."""
    d = propagator.dimension

    def stops(state: Expression, constants: Expression) -> Expression:
        levels = [surface.surface.level(state[:d]) for surface in propagator.geometries]
        offset = state[:d] - constants[:d]
        away = (ca.sumsqr(offset) / constants[d + 1] ** 2 - 1) / 2
        return ca.vertcat(*levels, ca.dot(state[d : 2 * d], offset), state[2 * d] - constants[d], away)

    return compile_rays(propagator.media[-1], d, d - 1, stops, d + 2)


def search(minima: Minima, target: np.ndarray, size: float) -> SphereSearch:
    """Rays to ``target`` (3,), each polished; one whose neighbourhood is finer than the net may be missed."""
    net = spread(DIRECTIONS, 3)
    headings, paths = _starts(minima, net, target)
    misses = np.full(len(headings), np.inf)
    count = len(net)
    for _ in range(AIMING_STEPS):
        if len(headings) == 0:
            break
        headings, paths, misses, steps = _newton(minima, headings, paths, target)
        count += len(headings)
        if np.all(misses <= MEETS * size):
            break
        going = (misses > MEETS * size) & np.isfinite(misses)
        headings[going] += steps[going]
        headings /= np.linalg.norm(headings, axis=1)[:, None]
    kept: list[int] = []
    for k in np.argsort(paths):
        alike = [np.linalg.norm(headings[k] - headings[j]) + abs(paths[k] / paths[j] - 1) < SAME_RAY for j in kept]
        if misses[k] <= MEETS * size and not any(alike):
            kept.append(int(k))
    return SphereSearch(headings[kept], paths[kept], count)


def _starts(minima: Minima, net: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions and optical paths of the passes that come closer than those of the neighbouring directions."""
    rows, beam = minima(net)
    order = np.lexsort((beam.optical_path, rows))
    rows, paths = rows[order], beam.optical_path[order]
    misses = np.linalg.norm(beam.position[order] - target, axis=1)
    turn = np.arange(len(rows)) - np.searchsorted(rows, rows)  # the first pass of a ray, the second, ...
    starts = []
    near = np.argsort(-net @ net.T, axis=1)[:, 1 : NEAREST_DIRECTIONS + 1]
    for k in range(int(turn.max(initial=-1)) + 1):
        of = np.full(len(net), np.inf)
        of[rows[turn == k]] = misses[turn == k]
        starts += [int(i) for i in np.flatnonzero((turn == k) & (of[rows] <= of[near[rows]].min(axis=1)))]
    return net[rows[starts]].copy(), paths[starts].copy()


def _newton(
    minima: Minima, headings: np.ndarray, paths: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same headings with the optical paths, misses and steps (k, 3) of the passes nearest to ``paths`` (k,)."""
    rows, beam = minima(headings)
    new, misses, steps = paths.copy(), np.full(len(headings), np.inf), np.zeros_like(headings)
    across = frames(headings)
    for k in range(len(headings)):
        own = np.flatnonzero(rows == k)
        if len(own) == 0:
            continue
        at = own[np.argmin(np.abs(beam.optical_path[own] - paths[k]))]
        tangent = beam.momentum[at] / np.linalg.norm(beam.momentum[at])
        screen = frames(tangent[None, :])[0]
        offset, by_heading = screen @ (beam.position[at] - target), screen @ beam.moved[at].T
        turn = -np.linalg.lstsq(by_heading, offset, rcond=None)[0]
        turn *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(turn)), LONGEST_STEP))
        new[k], misses[k], steps[k] = (
            beam.optical_path[at],
            np.linalg.norm(beam.position[at] - target),
            turn @ across[k],
        )
    return headings, new, misses, steps
