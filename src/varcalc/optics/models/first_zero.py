"""Where straight rays first meet a surface whose level is any function: no crest is gone through unseen.

A stretch of a ray is settled where an enclosure of the level there leaves zero out, or one of its slope does: the
signs at both ends then tell all. Other stretches are halved, the nearer ones first, until they are settled or as short
as round-off. Where no enclosure is known the signs at the ends of short stretches have to do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.numerics.roots import EPSILON, bracketed_newton
from varcalc.optics.rays.beam import Beam, Rows
from varcalc.optics.surfaces import Geometry

STRETCHES = np.concatenate([[0.0, 1e-3], np.geomspace(1e-2, 1e4, 42)])
"""Ends of the first stretches of a ray, in units of its distance from the surface and from the origin."""
SAMPLED = 0.025
"""Of the way to its end: a stretch so short is not halved where nothing encloses the level there."""
LEAST_SAMPLED = 1e-4
"""The same in those units, close to where a ray starts."""
TOUCHING_STRETCH = 1e-12
"""Of those units: two zeros in a shorter stretch are a ray that touches the surface."""
LOOKED_INTO = 16
"""Doubtful stretches of one ray that are looked at together, the nearest ones."""
MOST_STRETCHES = 4000
"""Stretches of one ray: where it takes more, as along ever so many crests, samples have to do beyond."""


@dataclass(frozen=True)
class _Stretches(Rows):
    """k stretches of the rays ``row`` from σ = ``low`` to ``high``, and the level at their ends."""

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray
    at_low: np.ndarray
    at_high: np.ndarray


@dataclass(frozen=True)
class FirstZero:
    """The search for the first change of sign of the level of ``geometry`` along the rays of ``beam``.

    ``unit`` (m,) is a unit of σ for each.
    """

    geometry: Geometry
    beam: Beam
    unit: np.ndarray

    @classmethod
    def of(cls, geometry: Geometry, beam: Beam) -> FirstZero:
        """The search along rays in units of their distances from the surface and from the origin."""
        away = geometry.distance(beam.position)
        momentum = np.linalg.norm(beam.momentum, axis=1)
        # a ray that has come far may stand at the origin, as at the vertex of a surface
        size = np.maximum(np.linalg.norm(beam.position, axis=1), beam.optical_path / momentum)
        unit = (np.where(np.isfinite(away), away, 0.0) + np.where(size > 0, size, 1.0)) / momentum
        return cls(geometry, beam, unit)

    def found(self, limit: np.ndarray, *, leaving: bool) -> np.ndarray:
        """σ (m,) at which the rays first meet the surface, not ``leaving`` it; infinite where not before ``limit``."""
        m = len(self.beam)
        nearest, far, looked = np.full(m, np.inf), np.full(m, np.inf), np.zeros(m, dtype=int)
        brackets: list[_Stretches] = []
        stretches, waiting = self._first(limit, leaving), None
        while len(stretches):
            changing, settled = self._changing(stretches), self._settled(stretches)
            np.minimum.at(nearest, stretches.row[changing], stretches.high[changing])
            settled |= looked[stretches.row] > MOST_STRETCHES
            looked += np.bincount(stretches.row, minlength=m)
            brackets.append(stretches.take(np.flatnonzero(changing & settled)))
            halves = self._halved(stretches.take(np.flatnonzero(~settled)))
            waiting = halves if waiting is None else _Stretches.joined([waiting, halves])
            waiting = waiting.take(np.flatnonzero(waiting.low < nearest[waiting.row]))
            now = _nearest(waiting)
            stretches, waiting = waiting.take(np.flatnonzero(now)), waiting.take(np.flatnonzero(~now))
        met = _Stretches.joined(brackets) if brackets else stretches
        met = met.take(np.lexsort((met.low, met.row)))
        met = met.take(np.unique(met.row, return_index=True)[1])
        far[met.row] = self._polished(met)
        return far

    def _first(self, limit: np.ndarray, leaving: bool) -> _Stretches:
        """The first stretches of all rays."""
        ends = np.minimum(self.unit[:, None] * STRETCHES, np.maximum(limit, 0.0)[:, None])
        m, n = ends.shape
        row = np.repeat(np.arange(m), n)
        level = self._level(row, ends.ravel()).reshape(m, n)
        if leaving:
            slope = np.sum(self.geometry.gradient(self.beam.position) * self.beam.momentum, axis=1)
            level[:, 0] = np.copysign(np.finfo(float).tiny, slope)
        row = row.reshape(m, n)[:, 1:].ravel()
        parts = ends[:, :-1], ends[:, 1:], level[:, :-1], level[:, 1:]
        stretches = _Stretches(row, *(part.ravel() for part in parts))
        return stretches.take(np.flatnonzero(stretches.high > stretches.low))

    def _level(self, row: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """The level (k,) at ``sigma`` (k,) along the rays ``row``; not a number where a zero is none of the surface."""
        places = self.beam.position[row] + sigma[:, None] * self.beam.momentum[row]
        belongs, level = self.geometry.belonging(places)
        return np.where(belongs, level, np.nan)

    def _changing(self, stretches: _Stretches) -> np.ndarray:
        """True (k,) where the level changes its sign from one end to the other."""
        with np.errstate(all="ignore"):
            product = np.sign(stretches.at_low) * stretches.at_high
        return (product <= 0) & np.isfinite(product)

    def _settled(self, stretches: _Stretches) -> np.ndarray:
        """True (k,) where the level changes its sign no oftener than the ends of a stretch tell, as far as is known."""
        p, r = self.beam.momentum[stretches.row], self.beam.position[stretches.row]
        ends = r + stretches.low[:, None] * p, r + stretches.high[:, None] * p
        (least, greatest), (down, up) = self.geometry.enclosed(np.minimum(*ends), np.maximum(*ends), p)
        length = stretches.high - stretches.low
        with np.errstate(all="ignore"):
            for at, sign in ((stretches.at_low, 1.0), (stretches.at_high, -1.0)):
                one, other = at + sign * length * down, at + sign * length * up
                least = np.fmax(least, np.fmin(np.fmin(one, other), at))
                greatest = np.fmin(greatest, np.fmax(np.fmax(one, other), at))
        ends_known = np.isfinite(stretches.at_low + stretches.at_high)
        settled = (least > 0) | (greatest < 0) | (ends_known & ((down > 0) | (up < 0)))
        known = ends_known & np.isfinite(down) & np.isfinite(up)
        unit = self.unit[stretches.row]
        sampled = np.maximum(SAMPLED * stretches.high, LEAST_SAMPLED * unit)
        return settled | (length <= np.where(known, TOUCHING_STRETCH * unit, sampled))

    def _halved(self, stretches: _Stretches) -> _Stretches:
        """Both halves of each."""
        row, low, high, at_low, at_high = vars(stretches).values()
        middle = (low + high) / 2
        between = self._level(row, middle)
        return _Stretches.joined([
            _Stretches(row, low, middle, at_low, between), _Stretches(row, middle, high, between, at_high)
        ])  # fmt: skip

    def _polished(self, met: _Stretches) -> np.ndarray:
        """The zeros (k,) of the level in stretches in which it changes its sign once."""
        sign, beam = np.sign(met.at_low), self.beam.take(met.row)

        def before(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            level, slope, _ = self.geometry.along(beam.position + at[:, None] * beam.momentum, beam.momentum)
            return sign * level, sign * slope

        middle = (met.low + met.high) / 2
        return bracketed_newton(before, met.low, met.high, middle, relative=4 * EPSILON)[0]


def _nearest(stretches: _Stretches) -> np.ndarray:
    """True (k,) for those of each ray that are nearest to where it starts."""
    order = np.lexsort((stretches.low, stretches.row))
    row = stretches.row[order]
    first = np.append(True, row[1:] != row[:-1])[: len(row)]
    start = np.maximum.accumulate(np.where(first, np.arange(len(row)), 0))
    near = np.empty(len(row), dtype=bool)
    near[order] = np.arange(len(row)) - start < LOOKED_INTO
    return near
