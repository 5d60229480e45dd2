"""Rays through a table whose n² is linear between the heights: pieces of parabolas, in closed form.

In each layer dp/dσ = ∇n²/2 is constant, so that height is a quadratic and
optical path a cubic polynomial of σ, and neighbours move straight. At a
height of the table the force jumps, and with it the direction of neighbours
that come there earlier or later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from varcalc.numerics.roots import first_ahead, growing, quadratic_ahead
from varcalc.optics.media.medium import Medium
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam, RayStatus
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Geometry, Plane

MOST_LAYERS = 100_000
"""Layers gone through by one ray."""
MET_TOGETHER = 1e-14
"""A surface and a height of the table so close together, relative to σ, are met as one: the surface counts."""


@dataclass(frozen=True)
class Parabolas(Model):
    """Parabolic arcs in closed form: for ``Tabulated`` media with ``smooth=False`` and planes as surfaces."""

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        if not isinstance(medium, Tabulated) or medium.smooth:
            raise DoesNotApply(
                "Parabolas needs n² linear between heights, which is Tabulated(..., smooth=False), "
                f"not {type(medium).__name__}; take Hamilton()"
            )
        for geometry in surfaces:
            if not isinstance(geometry.surface, Plane):
                raise DoesNotApply(f"Parabolas needs planes as surfaces, not {geometry.surface}; take Hamilton()")
        return ParabolicRays(medium, dimension, surfaces)


@dataclass(frozen=True)
class ParabolicArc:
    """One ray in one layer: where it begins in σ, the ray there, and dp/dσ upwards."""

    start: float
    beam: Beam
    pull: np.ndarray


@dataclass(frozen=True)
class ParabolicRays:
    """The model for one table, with the planes that rays in it may meet."""

    table: Tabulated
    dimension: int
    surfaces: Sequence[Geometry]

    name = "parabolic arcs"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """See :meth:`varcalc.optics.models.model.Carrier.advance`."""
        return self._carried(beam, limit, leaving, [])[0]

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        pieces: list[ParabolicArc] = []
        free = replace(self, surfaces=())
        free._carried(beam, np.array([path]), NOTHING, pieces)  # noqa: SLF001  itself, without surfaces
        last = pieces[-1]
        length = last.start + float(self._to_path(last.beam, last.pull, np.array([path]))[0])
        starts = np.array([piece.start for piece in pieces])

        def at(sigma: np.ndarray) -> Beam:
            """The ray at σ (m,)."""
            number = np.maximum(np.searchsorted(starts, sigma, side="right") - 1, 0)
            out = beam.take(np.zeros(len(sigma), dtype=int))
            for k in np.unique(number):
                rows = np.flatnonzero(number == k)
                many = pieces[k].beam.take(np.zeros(len(rows), dtype=int))
                out.put(rows, self._moved(many, np.repeat(pieces[k].pull, len(rows)), sigma[rows] - starts[k]))
            return out

        return Leg(at, length, tuple(starts[1:].tolist()))

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:  # noqa: ARG002
        """See :meth:`varcalc.optics.models.model.Carrier.onward`."""
        ahead = np.flatnonzero(path > beam.optical_path)
        there, grown = beam.take(np.arange(len(beam))), np.zeros(len(beam))
        if len(ahead):
            free = replace(self, surfaces=())
            arrival, grown[ahead] = free._carried(beam.take(ahead), path[ahead], NOTHING, [])  # noqa: SLF001  itself
            there.put(ahead, arrival.beam.known(arrival.status == RayStatus.ARRIVED))
        return there, grown

    def _carried(
        self, beam: Beam, limit: np.ndarray, leaving: int, pieces: list[ParabolicArc]
    ) -> tuple[Arrival, np.ndarray]:
        """Carry the rays layer by layer, and add to ``pieces`` what the first ray goes through; σ (m,) at the ends."""
        m = len(beam)
        beam, travelled = beam.take(np.arange(m)), np.zeros(m)
        struck, status = np.full(m, NOTHING), np.full(m, int(RayStatus.TOO_MANY_STEPS))
        layer, knot, stuck, outside = self.table.starts(beam.position[:, -1], beam.momentum[:, -1])
        status[stuck], status[outside] = int(RayStatus.SINGULAR), int(RayStatus.OUTSIDE)
        alive, left = np.flatnonzero(~stuck & ~outside), np.full(m, leaving)
        for _ in range(MOST_LAYERS):
            if len(alive) == 0:
                break
            here, pull = beam.take(alive), self.table.coefficients[layer[alive], 1] / 2
            if alive[0] == 0:
                pieces.append(ParabolicArc(float(travelled[0]), here.take(np.zeros(1, dtype=int)), pull[:1]))
            ends = np.stack([
                *self._to_heights(here, pull, layer[alive], knot[alive]),
                self._to_path(here, pull, limit[alive]),
                *(self._to_plane(here, pull, geometry, left[alive] == k) for k, geometry in enumerate(self.surfaces)),
            ])  # fmt: skip
            ranked = ends.copy()
            ranked[:2] *= 1 + MET_TOGETHER
            first = np.argmin(ranked, axis=0)
            sigma = ends[first, np.arange(len(alive))]
            lost = ~np.isfinite(sigma)
            beam.put(alive, self._moved(here, pull, np.where(lost, 0.0, sigma)))
            travelled[alive] += sigma
            beam.optical_path[alive[first == 2]] = limit[alive[first == 2]]
            struck[alive] = np.where(first > 2, first - 3, NOTHING)
            status[alive] = np.where(lost, int(RayStatus.MISSED), int(RayStatus.ARRIVED))
            left[alive] = NOTHING
            crossing = (first < 2) & ~lost
            at, to = alive[crossing], layer[alive[crossing]] + np.where(first[crossing] == 1, 1, 0)
            alive = self._cross(beam, at, to, layer, knot, status)
        return Arrival(beam, struck, status), travelled

    def _to_heights(
        self, beam: Beam, pull: np.ndarray, layer: np.ndarray, knot: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """σ (m,) at which rays come to the lower and to the upper height of their layers."""
        knots, y, climb = np.asarray(self.table.heights), beam.position[:, -1], beam.momentum[:, -1]
        lower = first_ahead(quadratic_ahead(y - knots[layer], climb, pull, knot == layer))
        return lower, first_ahead(quadratic_ahead(y - knots[layer + 1], climb, pull, knot == layer + 1))

    def _to_plane(self, beam: Beam, pull: np.ndarray, geometry: Geometry, leaving: np.ndarray) -> np.ndarray:
        """σ (m,) at which rays come to a plane; infinite where they do not."""
        level, slope, _ = geometry.along(beam.position, beam.momentum)
        bend = pull * geometry.gradient(beam.position)[:, -1]
        return first_ahead(quadratic_ahead(level, slope, bend, leaving))

    def _to_path(self, beam: Beam, pull: np.ndarray, limit: np.ndarray) -> np.ndarray:
        """σ (m,) at which the optical path is ``limit``: the zero of a cubic that never falls."""
        wanted = limit - beam.optical_path
        finite = np.isfinite(wanted)
        wanted = np.where(finite, wanted, 1.0)
        squared, climb = np.sum(beam.momentum**2, axis=1), beam.momentum[:, -1]

        def beyond(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            rate = squared + 2 * pull * (climb * sigma + pull * sigma**2 / 2)
            return _path(squared, climb, pull, sigma) - wanted, rate

        return np.where(finite, growing(beyond, wanted / squared, 4 * np.finfo(float).eps), np.inf)

    def _moved(self, beam: Beam, pull: np.ndarray, sigma: np.ndarray) -> Beam:
        """The rays after ``sigma`` (m,) in their layers."""
        climb, squared = beam.momentum[:, -1], np.sum(beam.momentum**2, axis=1)
        position = beam.position + sigma[:, None] * beam.momentum
        position[:, -1] += pull * sigma**2 / 2
        momentum = beam.momentum.copy()
        momentum[:, -1] += pull * sigma
        path = beam.optical_path + _path(squared, climb, pull, sigma)
        return Beam(position, momentum, path, beam.moved + sigma[:, None, None] * beam.turned, beam.turned)

    def _cross(
        self, beam: Beam, rows: np.ndarray, to: np.ndarray, layer: np.ndarray, knot: np.ndarray, status: np.ndarray
    ) -> np.ndarray:
        """Put ``rows``, which have come to the heights ``to``, into the next layers, in place; those that go on."""
        beam.position[rows, -1] = np.asarray(self.table.heights)[to]
        following, inside, kick = self.table.crossed(layer[rows], to, beam.momentum[rows, -1])
        status[rows[~inside]] = int(RayStatus.OUTSIDE)
        rows, to, following, kick = rows[inside], to[inside], following[inside], kick[inside]
        beam.turned[rows, :, -1] += kick[:, None] * beam.moved[rows, :, -1]
        layer[rows], knot[rows] = following, to
        return rows


def _path(squared: np.ndarray, climb: np.ndarray, pull: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """∫ n² dσ with n² = |p|² at the start."""
    return sigma * (squared + pull * sigma * (climb + pull * sigma / 3))
