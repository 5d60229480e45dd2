"""One ray, leg by leg: its points, and where its neighbours cross it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from varcalc.integrators import Flow, Outcome
from varcalc.numerics.resampled import Resampled, resampled
from varcalc.optics.beam import Beam, caustics_between, packed, unpacked

SAMPLES = 129
"""Places along a leg at which the neighbours are looked at."""
TINY = 1e-13
"""Of a leg: the shortest part of it that is integrated."""
PARTS = 16
"""Into which a bracket is cut at a time: one integration goes through them all."""
ROUNDS = 40
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
        sigma = np.linspace(0.0, self.length, SAMPLES)
        return sigma, self.at(sigma)

    def foci(self) -> list[tuple[float, np.ndarray]]:
        """Conjugate points inside the leg, as (optical path, position); a double one twice."""
        if self.known is not None:
            return self.known
        sigma, beam = self.sampled()
        found = []
        passed = caustics_between(beam.take(slice(None, -1)), beam.take(slice(1, None)))
        for k in np.flatnonzero(passed):
            for number in range(passed[k]):
                where = self._located(sigma[k], sigma[k + 1], number)
                at = self.at(np.array([where]))
                found.append((float(at.optical_path[0]), at.position[0]))
        return found

    def _located(self, low: float, high: float, number: int) -> float:
        """σ of conjugate point ``number`` after ``low``: the bracket is cut by how many have been passed."""
        before = self.at(np.full(PARTS - 1, low))
        for _ in range(ROUNDS):
            cuts = low + (high - low) * np.arange(PARTS + 1) / PARTS
            cuts[-1] = high
            if not low < cuts[PARTS // 2] < high:
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


def moved_on(beam: Beam, sigma: np.ndarray, squared_index: float) -> Beam:
    """The rays after ``sigma`` (m,) on their straight lines."""
    return replace(
        beam,
        position=beam.position + sigma[:, None] * beam.momentum,
        optical_path=beam.optical_path + sigma * squared_index,
        moved=beam.moved + sigma[:, None, None] * beam.turned,
    )


def straight_leg(beam: Beam, squared_index: float, length: float) -> Leg:
    """A leg in a uniform medium from ``beam``, one ray."""

    def at(sigma: np.ndarray) -> Beam:
        return moved_on(beam.take(np.zeros(len(sigma), dtype=int)), sigma, squared_index)

    return Leg(at, length)


def hamilton_leg(
    pieces: Sequence[tuple[float, np.ndarray, np.ndarray]],
    flow: Flow,
    dimension: int,
    length: float,
) -> Leg:
    """A leg in a graded medium; ``flow`` is the compiled ray system with its neighbours.

    ``pieces`` are σ, the system's constants and the state where each of its
    parts begins: the layers of a table, otherwise one.
    """
    starts = np.array([start for start, _, _ in pieces])
    trajectories = []
    for (start, constants, state), end in zip(pieces, [*starts[1:], length], strict=True):
        run = flow.trajectory(np.array([0.0, max(end - start, TINY * length)]), state, constants, dense=True)
        if run.outcome is not Outcome.COMPLETED or run.trajectory is None:
            raise ArithmeticError(f"a ray could not be followed a second time: {run.outcome.value}")
        trajectories.append(run.trajectory)

    def at(sigma: np.ndarray) -> Beam:
        part = np.maximum(np.searchsorted(starts, sigma, side="right") - 1, 0)
        states = np.empty((len(sigma), len(pieces[0][2])))
        for k in np.unique(part):
            states[part == k] = trajectories[k](sigma[part == k] - starts[k])
        return unpacked(states, dimension)

    return Leg(at, length, tuple(starts[1:].tolist()))
