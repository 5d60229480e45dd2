"""Straight rays in a uniform medium: where they meet surfaces.

Along a straight ray the level of a plane, sphere or conic is a polynomial of
second degree, and its zeros are written down; that of any other surface is
looked at in many places, and its first change of sign bracketed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.numerics.roots import EPSILON, bracketed_newton, first_ahead, quadratic_ahead
from varcalc.optics.media.medium import Field, Medium
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam, first_met, moved_on
from varcalc.optics.rays.leg import Leg, straight_leg
from varcalc.optics.surfaces import Geometry

SAMPLE_DISTANCES = np.concatenate([np.geomspace(1e-6, 1e-2, 20, endpoint=False), np.geomspace(1e-2, 1e4, 600)])
"""Where a general surface is looked for along a ray, in units of the ray's distance from it and from the origin."""
ROWS_TOGETHER = 1024
"""Rays looked at together; bounds the memory."""


@dataclass(frozen=True)
class Straight(Model):
    """Straight segments, refracted and reflected in closed form: for ``Uniform`` media and all surfaces."""

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        if not medium.is_uniform:
            raise DoesNotApply(
                f"Straight needs uniform media, and rays are curved in {type(medium).__name__}; take Hamilton()"
            )
        squared, _, _ = Field(medium, dimension)(np.zeros((1, dimension)))
        return StraightRays(float(squared[0]), surfaces)


@dataclass(frozen=True)
class StraightRays:
    """The model for one uniform medium, with the surfaces that rays in it may meet."""

    squared_index: float
    surfaces: Sequence[Geometry]

    name = "straight segments"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,), infinite where there is none.

        ``leaving`` is the number of the surface all of them start from.
        """
        far = [self._distance(beam, k, leaving == k) for k in range(len(self.surfaces))]
        struck, sigma, status = first_met(far, (limit - beam.optical_path) / self.squared_index)
        return Arrival(moved_on(beam, sigma, self.squared_index), struck, status)

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:  # noqa: ARG002
        """See :meth:`varcalc.optics.models.model.Carrier.onward`."""
        return moved_on(beam, sigma, self.squared_index), sigma

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        return straight_leg(beam, self.squared_index, (path - float(beam.optical_path[0])) / self.squared_index)

    def _distance(self, beam: Beam, number: int, leaving: bool) -> np.ndarray:
        """σ (m,) at which each ray first meets surface ``number``; infinite where it does not."""
        geometry = self.surfaces[number]
        if geometry.quadric:
            return _first_of_two(beam, geometry, leaving)
        parts = [beam.take(np.arange(k, min(k + ROWS_TOGETHER, len(beam)))) for k in range(0, len(beam), ROWS_TOGETHER)]
        return np.concatenate([np.zeros(0), *(_first_of_many(part, geometry, leaving) for part in parts)])


def _first_of_two(beam: Beam, geometry: Geometry, leaving: bool) -> np.ndarray:
    """The smaller positive zero of a quadratic level that belongs to the surface, without cancellation."""
    constant, slope, bend = geometry.along(beam.position, beam.momentum)
    with np.errstate(all="ignore"):
        candidates = quadratic_ahead(constant, slope, bend, leaving)
        met = np.isfinite(candidates) & (candidates > 0)
        for row, valid in zip(candidates, met, strict=True):
            where = np.flatnonzero(valid)
            valid[where] = geometry.belongs(beam.position[where] + row[where, None] * beam.momentum[where])
    return first_ahead(np.where(met, candidates, np.inf))


def _first_of_many(beam: Beam, geometry: Geometry, leaving: bool) -> np.ndarray:
    """The first change of sign of a general level along each ray."""
    m, d = beam.position.shape
    level, slope, _ = geometry.along(beam.position, beam.momentum)
    away = geometry.distance(beam.position)
    # a ray that has come far may stand at the origin, as at the vertex of a surface
    size = np.maximum(
        np.linalg.norm(beam.position, axis=1), beam.optical_path / np.sum(beam.momentum**2, axis=1) ** 0.5
    )
    unit = (np.where(np.isfinite(away), away, 0.0) + np.where(size > 0, size, 1.0)) / np.linalg.norm(
        beam.momentum, axis=1
    )
    sigma = unit[:, None] * SAMPLE_DISTANCES
    places = beam.position[:, None, :] + sigma[:, :, None] * beam.momentum[:, None, :]
    levels = geometry.level(places.reshape(-1, d)).reshape(m, -1)
    first = np.sign(slope if leaving else level)
    levels = np.column_stack([first, levels])
    sigma = np.column_stack([np.zeros(m), sigma])
    belongs = np.column_stack([np.ones(m, bool), geometry.belongs(places.reshape(-1, d)).reshape(m, -1)])
    with np.errstate(all="ignore"):
        crossed = (levels[:, 1:] * levels[:, :-1] <= 0) & np.isfinite(levels[:, 1:] * levels[:, :-1]) & belongs[:, 1:]
    rows, far = np.flatnonzero(np.any(crossed, axis=1)), np.full(m, np.inf)
    place, met = np.argmax(crossed[rows], axis=1), beam.take(rows)
    low, high, sign = sigma[rows, place], sigma[rows, place + 1], np.sign(levels[rows, place])

    def before(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        level, slope, _ = geometry.along(met.position + at[:, None] * met.momentum, met.momentum)
        return sign * level, sign * slope

    far[rows], _ = bracketed_newton(before, low, high, (low + high) / 2, relative=4 * EPSILON)
    return far
