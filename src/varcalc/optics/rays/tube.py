"""The ray tube: a ray with its infinitely near neighbours, which says how light spreads along it.

The flux through a tube's cross-section is the same all along it, so that the
intensity is in inverse proportion to the area (Brizard, "An Introduction to
Lagrangian Mechanics", eq. 1.55; Born and Wolf, "Principles of Optics",
sect. 3.1.2). The cross-section is that of the solutions of the ray deviation
equation; where it is zero the ray touches a caustic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from varcalc.optics.rays.beam import Beam, RayStatus, spreading
from varcalc.optics.rays.leg import Leg
from varcalc.problem.conditions import reals, told
from varcalc.showing import Shown

STEPS_TO_PATH = 8
"""Newton's steps from a sampled σ to one at a given optical path."""
ON_CAUSTIC = 1e-9
"""Of the tube's optical path: places so close to a conjugate point are on the caustic."""


@dataclass(frozen=True, repr=False, eq=False)
class Intensity(Shown):
    """The intensity of light at k places of a ray.

    Attributes
    ----------
    values : ndarray, shape (k,)
        The power through a unit of length across the ray in the plane, of area in space: of a point source that sends
        a unit of power into each radian, or steradian; of a plane wave in units of its intensity at the start.
        Reflection losses at surfaces are not counted. Infinite on a caustic.
    caustics : ndarray of int, shape (k,)
        The number of conjugate points before each place (the KMAH index): with it the phase falls by a quarter of a
        period each time.
    on_caustic : ndarray of bool, shape (k,)
        True where the place is a conjugate point, or a point source itself, and geometrical optics gives no intensity.
    """

    values: np.ndarray
    caustics: np.ndarray
    on_caustic: np.ndarray


@dataclass(frozen=True, repr=False)
class RayTube(Shown):
    """A ray of a wave with its neighbours, from the source on; places are named by their optical path from there.

    Attributes
    ----------
    status : RayStatus
        How the ray ended. One that comes to a singular index is followed to the last surface before only.
    legs : sequence
        Its parts from surface to surface.
    """

    status: RayStatus
    legs: Sequence[Leg] = field(repr=False)

    @cached_property
    def optical_path(self) -> float:
        """That of the whole ray."""
        last = self.legs[-1] if self.legs else None
        return float(last.at(np.array([last.length])).optical_path[0]) if last else 0.0

    def point(self, s: float | np.ndarray) -> np.ndarray:
        """The point of the ray at the optical path ``s``, shape ``np.shape(s) + (d,)``.

        Raises ValueError for ``s`` beyond the ends of the ray.
        """
        beam = self.at(s)
        return beam.position.reshape(np.shape(s) + beam.position.shape[1:])

    def direction(self, s: float | np.ndarray) -> np.ndarray:
        """The unit vector along the ray at the optical path ``s``, shape ``np.shape(s) + (d,)``."""
        momentum = self.at(s).momentum
        ahead = momentum / np.linalg.norm(momentum, axis=1)[:, None]
        return ahead.reshape(np.shape(s) + momentum.shape[1:])

    def spreading(self, s: float | np.ndarray) -> np.ndarray:
        """``|dr⊥/dθ|`` at ``s`` in the plane, ``|dA/dΩ|`` in space; of a plane wave the ratio of cross-sections."""
        return spreading(self.at(s)).reshape(np.shape(s))

    def intensity(self, s: float | np.ndarray) -> Intensity:
        """The intensity at the optical paths ``s``, with what it cannot say flagged."""
        places, width = np.atleast_1d(reals("s", s)).ravel(), spreading(self.at(s))
        foci = np.array([path for path, _ in self.foci])
        near = np.abs(places[:, None] - foci) <= ON_CAUSTIC * self.optical_path
        on_caustic = np.any(near, axis=1) | (width == 0)
        with np.errstate(divide="ignore"):
            values = np.where(on_caustic, np.inf, 1 / width)
        before = np.sum((foci < places[:, None]) & ~near, axis=1)
        shape = np.shape(s)
        return Intensity(values.reshape(shape), before.reshape(shape), on_caustic.reshape(shape))

    @cached_property
    def foci(self) -> list[tuple[float, np.ndarray]]:
        """Conjugate points as (optical path, position (d,)), in the order they are met; a double one twice."""
        return [focus for leg in self.legs for focus in leg.foci()]

    def at(self, s: float | np.ndarray) -> Beam:
        """The ray with its neighbours at the optical paths ``s``, one row each; ValueError beyond its ends."""
        wanted = np.atleast_1d(reals("s", s)).ravel()
        if not self.legs:
            raise ValueError(f"the ray could not be followed anywhere: {self.status.message}")
        if not np.all((wanted >= 0) & (wanted <= self.optical_path * (1 + 1e-12))):
            raise ValueError(f"s must lie between 0 and the ray's optical path {self.optical_path}, not {told(s)}")
        beam = self.legs[0].at(np.zeros(len(wanted)))
        for leg in self.legs:
            start = float(leg.at(np.zeros(1)).optical_path[0])
            rows = np.flatnonzero(wanted >= start)
            if len(rows):
                beam.put(rows, _at_path(leg, wanted[rows]))
        return beam


def _at_path(leg: Leg, wanted: np.ndarray) -> Beam:
    """The ray at the optical paths ``wanted`` (k,), none before the leg; beyond its end it is its end."""
    sampled, beam = leg.sampled()
    sigma = np.interp(wanted, beam.optical_path, sampled)
    for _ in range(STEPS_TO_PATH):
        here = leg.at(sigma)
        step = (wanted - here.optical_path) / np.sum(here.momentum**2, axis=1)
        sigma = np.clip(sigma + step, 0.0, leg.length)
        if np.all(np.abs(step) <= 4 * np.finfo(float).eps * leg.length):
            break
    return leg.at(sigma)
