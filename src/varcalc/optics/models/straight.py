"""Straight rays in a uniform medium: where they meet surfaces.

Along a straight ray the level of a plane, sphere or conic is a polynomial of
second degree, and its zeros are written down; that of any other surface is
enclosed (:mod:`varcalc.optics.models.first_zero`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.numerics.roots import first_ahead, quadratic_ahead
from varcalc.optics.media.medium import Field, Medium
from varcalc.optics.models.first_zero import FirstZero
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam, first_met, moved_on
from varcalc.optics.rays.leg import Leg, straight_leg
from varcalc.optics.surfaces import Geometry

MOST_REST = 1e-3
"""Of the way to a surface: by how much more, or less, round-off can be to blame for."""
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
        end = (limit - beam.optical_path) / self.squared_index
        far = [self._distance(beam, k, end, leaving == k) for k in range(len(self.surfaces))]
        struck, sigma, status = first_met(far, end)
        return Arrival(moved_on(beam, sigma, self.squared_index), struck, status)

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:  # noqa: ARG002
        """See :meth:`varcalc.optics.models.model.Carrier.onward`."""
        return moved_on(beam, sigma, self.squared_index), sigma

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        return straight_leg(beam, self.squared_index, (path - float(beam.optical_path[0])) / self.squared_index)

    def _distance(self, beam: Beam, number: int, end: np.ndarray, leaving: bool) -> np.ndarray:
        """σ (m,) at which each ray first meets surface ``number``; infinite where not before ``end``."""
        geometry = self.surfaces[number]
        if geometry.quadric:
            return _first_of_two(beam, geometry, leaving)
        far = np.empty(len(beam))
        for first in range(0, len(beam), ROWS_TOGETHER):
            part = beam.take(np.arange(first, min(first + ROWS_TOGETHER, len(beam))))
            rows = slice(first, first + len(part))
            far[rows] = FirstZero.of(geometry, part).found(end[rows], leaving=leaving)
        return far


def _first_of_two(beam: Beam, geometry: Geometry, leaving: bool) -> np.ndarray:
    """The smaller positive zero of a quadratic level that belongs to the surface, without cancellation."""
    constant, slope, bend = geometry.along(beam.position, beam.momentum)
    with np.errstate(all="ignore"):
        candidates = quadratic_ahead(constant, slope, bend, leaving)
        met = np.isfinite(candidates) & (candidates > 0)
        for row, valid in zip(candidates, met, strict=True):
            where = np.flatnonzero(valid)
            valid[where] = geometry.belongs(beam.position[where] + row[where, None] * beam.momentum[where])
    first = first_ahead(np.where(met, candidates, np.inf))
    rows = np.flatnonzero(np.isfinite(first))
    if len(rows):
        first[rows] += _rest(beam, geometry, rows, first[rows])
    return first


def _rest(beam: Beam, geometry: Geometry, rows: np.ndarray, far: np.ndarray) -> np.ndarray:
    """How far rays (k,) are from a quadratic level's zero where they are said to meet it after ``far`` (k,).

    From afar a small surface is told by the difference of two large numbers, from its own place it is not.
    """
    momentum = beam.momentum[rows]
    level, slope, bend = geometry.along(beam.position[rows] + far[:, None] * momentum, momentum)
    with np.errstate(all="ignore"):
        root = np.sqrt(slope**2 - 2 * bend * level)
        rest = -2 * level / (slope + np.copysign(root, slope))
    return np.where(np.abs(rest) < MOST_REST * far, rest, 0.0)
