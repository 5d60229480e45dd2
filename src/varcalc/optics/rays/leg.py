"""One ray, leg by leg: its points, and where its neighbours cross it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.numerics.resampled import Resampled, resampled
from varcalc.optics.rays.beam import Beam, caustics_between, moved_on, packed, unpacked

LEG_SAMPLES = 129
"""Places along a leg at which the neighbours are looked at."""
CUTS = 16
"""Into which a bracket is cut at a time: one integration goes through them all."""
CUT_ROUNDS = 40
"""Cuts of a bracket."""


@dataclass(frozen=True)
class Leg:
    """A ray between two surfaces: ``at`` takes σ (k,) in [0, ``length``] to the ray there, a beam of k rows.

    At the σ of ``breaks`` the ray is not smooth. ``known`` are its conjugate points, where they have been located
    before.
    """

    at: Callable[[np.ndarray], Beam]
    length: float
    breaks: tuple[float, ...] = ()
    known: list[tuple[float, np.ndarray]] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """The leg by its samples, with its conjugate points: what another process is given."""
        at = self.at
        if not isinstance(at, SampledBeam):
            start = at(np.zeros(1))
            rows = resampled(lambda sigma, _: packed(self.at(sigma)).T, [0.0, *self.breaks, self.length], 1)
            at = SampledBeam(rows, start.dimension)
        return Leg, (at, self.length, self.breaks, self.foci())

    def sampled(self) -> tuple[np.ndarray, Beam]:
        """σ (k,) from end to end, and the ray there."""
        sigma = np.linspace(0.0, self.length, LEG_SAMPLES)
        return sigma, self.at(sigma)

    def foci(self) -> list[tuple[float, np.ndarray]]:
        """Conjugate points inside the leg, as (optical path, position); a double one twice."""
        if self.known is not None:
            return self.known
        breaks = np.array(self.breaks)
        before = np.nextafter(breaks, 0.0)
        sigma = np.unique(np.concatenate([np.linspace(0.0, self.length, LEG_SAMPLES), before, breaks]))
        beam, found = self.at(sigma), []
        passed = caustics_between(beam.take(slice(None, -1)), beam.take(slice(1, None)))
        # where a ray is thrown back its neighbours change sides, and no conjugate point is passed
        passed[np.isin(sigma[1:], breaks)] = 0
        for k in np.flatnonzero(passed):
            for number in range(passed[k]):
                where = self._located(sigma[k], sigma[k + 1], number)
                at = self.at(np.array([where]))
                found.append((float(at.optical_path[0]), at.position[0]))
        return found

    def _located(self, low: float, high: float, number: int) -> float:
        """σ of conjugate point ``number`` after ``low``: the bracket is cut by how many have been passed."""
        before = self.at(np.full(CUTS - 1, low))
        for _ in range(CUT_ROUNDS):
            cuts = low + (high - low) * np.arange(CUTS + 1) / CUTS
            cuts[-1] = high
            if not low < cuts[CUTS // 2] < high:
                break
            done = np.append(caustics_between(before, self.at(cuts[1:-1])) > number, True)
            first = int(np.argmax(done))
            low, high = float(cuts[first]), float(cuts[first + 1])
        return (low + high) / 2


@dataclass(frozen=True, eq=False)
class SampledBeam:
    """A ray with its neighbours in ``dimension`` dimensions, as polynomials in σ."""

    rows: Resampled
    dimension: int

    def __call__(self, sigma: np.ndarray) -> Beam:
        """The ray at σ (k,), a beam of k rows."""
        return unpacked(self.rows(sigma, 0).T, self.dimension)


def straight_leg(beam: Beam, squared_index: float, length: float) -> Leg:
    """A leg in a uniform medium from ``beam``, one ray."""

    def at(sigma: np.ndarray) -> Beam:
        return moved_on(beam.take(np.zeros(len(sigma), dtype=int)), sigma, squared_index)

    return Leg(at, length)
