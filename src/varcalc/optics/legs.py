"""One ray, leg by leg: its points, and where its neighbours cross it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from varcalc.integrators import Flow, Outcome
from varcalc.numerics.resampled import Resampled, resampled
from varcalc.optics.beam import Beam
from varcalc.optics.system import unpacked

SAMPLES = 129
"""Places along a leg at which the neighbours are looked at."""
STARTING = 1e-6
"""Phases are this close to π where all neighbours start from one point."""
TINY = 1e-13
"""Of a leg: the shortest part of it that is integrated."""
PARTS = 16
"""Into which a bracket is cut at a time: one integration goes through them all."""
ROUNDS = 40
"""Cuts of a bracket."""


@dataclass(frozen=True)
class Leg:
    """A ray between two surfaces: ``at`` takes σ (k,) in [0, ``length``] to the ray there, a beam of k rows.

    ``pull`` takes positions (k, d) to dp/dσ = ∇n²/2 (k, d); at the σ of ``breaks`` the ray is not smooth.
    """

    at: Callable[[np.ndarray], Beam]
    pull: Callable[[np.ndarray], np.ndarray]
    length: float
    breaks: tuple[float, ...] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        beam = self.at(np.zeros(1))
        rows = resampled(lambda sigma, _: _flat(self.at(sigma)).T, [0.0, *self.breaks, self.length], 1)
        at = SampledBeam(rows, beam.dimension, beam.deviations)
        return KnownLeg, (at, np.zeros_like, self.length, self.breaks, self.foci())

    def sampled(self) -> tuple[np.ndarray, Beam]:
        """σ (k,) from end to end, and the ray there."""
        sigma = np.linspace(0.0, self.length, SAMPLES)
        return sigma, self.at(sigma)

    def foci(self) -> list[tuple[float, np.ndarray]]:
        """Conjugate points inside the leg, as (optical path, position); a double one twice.

        The positions' and momenta's deviations A and B, with the ray's own
        motion as one more column of each, span a Lagrangian plane, and the
        unitary matrix (A - iB)(A + iB)^-1 has the eigenvalue -1 where A is
        singular. The eigenvalues turn one way only (Arnold, "Mathematical
        Methods of Classical Mechanics", appendix 11), so that none is missed
        where two come together.
        """
        sigma, beam = self.sampled()
        scale = float(np.linalg.norm(beam.turned) / max(np.linalg.norm(beam.moved), np.finfo(float).tiny))
        scale = scale or 1 / self.length  # neighbours that are parallel all the way have none of their own
        phases = self._phases(beam, scale)
        if not np.any(beam.moved[0]):  # all neighbours start together: that is no conjugate point
            phases[0] = np.where(np.abs(phases[0] - np.pi) < STARTING, np.pi, phases[0])
        found = []
        passed = _passed(phases[:-1], phases[1:])
        for k in np.flatnonzero(passed > 0):
            for number in range(passed[k]):
                where = self._located(sigma[k], sigma[k + 1], phases[k], scale, number)
                at = self.at(np.array([where]))
                found.append((float(at.optical_path[0]), at.position[0]))
        return found

    def _phases(self, beam: Beam, scale: float) -> np.ndarray:
        """The phases (k, d) of the eigenvalues in [0, 2π), ascending; π where a neighbour crosses the ray."""
        a = np.concatenate([scale * beam.moved, scale * beam.momentum[:, None, :]], axis=1)
        b = np.concatenate([beam.turned, self.pull(beam.position)[:, None, :]], axis=1)
        a, b = np.swapaxes(a, 1, 2), np.swapaxes(b, 1, 2)
        size = np.linalg.norm(np.concatenate([a, b], axis=1), axis=1)[:, None, :]
        a, b = a / size, b / size
        values = np.linalg.eigvals((a - 1j * b) @ np.linalg.inv(a + 1j * b))
        return np.sort(np.mod(np.angle(values), 2 * np.pi), axis=1)

    def _located(self, low: float, high: float, before: np.ndarray, scale: float, number: int) -> float:
        """σ at which eigenvalue ``number`` of those that pass -1 does so: the bracket is cut by how many have."""
        for _ in range(ROUNDS):
            cuts = low + (high - low) * np.arange(PARTS + 1) / PARTS
            cuts[-1] = high
            if not low < cuts[PARTS // 2] < high:
                break
            done = np.append(_passed(before, self._phases(self.at(cuts[1:-1]), scale)) > number, True)
            first = int(np.argmax(done))
            low, high = float(cuts[first]), float(cuts[first + 1])
        return (low + high) / 2


@dataclass(frozen=True)
class KnownLeg(Leg):
    """A leg by its samples, with its conjugate points: what another process is given."""

    found: list[tuple[float, np.ndarray]] = field(default_factory=list)

    def foci(self) -> list[tuple[float, np.ndarray]]:
        """Those found where the leg was followed."""
        return self.found

    def __reduce__(self) -> tuple[Any, ...]:
        return KnownLeg, (self.at, self.pull, self.length, self.breaks, self.found)


@dataclass(frozen=True, eq=False)
class SampledBeam:
    """A ray with its ``deviations`` in ``dimension`` dimensions, as polynomials in σ."""

    rows: Resampled
    dimension: int
    deviations: int

    def __call__(self, sigma: np.ndarray) -> Beam:
        """The ray at σ (k,), a beam of k rows."""
        d, rows = self.dimension, self.rows(sigma, 0).T
        moved, turned = rows[:, 1 + 2 * d :].reshape(len(rows), 2, self.deviations, d).swapaxes(0, 1)
        return Beam(rows[:, :d], rows[:, d : 2 * d], rows[:, 2 * d], moved, turned)


def _flat(beam: Beam) -> np.ndarray:
    """Position, momentum, optical path and deviations side by side, one row a ray."""
    parts = (beam.position, beam.momentum, beam.optical_path, beam.moved, beam.turned)
    return np.hstack([np.reshape(part, (len(beam), -1)) for part in parts])


def _passed(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How many phases pass π on the shortest way from ``before`` to ``after``, (..., d) ascending in [0, 2π).

    Which goes where is unknown, but they keep their order round the circle.
    """
    unrolled = np.concatenate([after - 2 * np.pi, after, after + 2 * np.pi], axis=-1)
    moves = np.lib.stride_tricks.sliding_window_view(unrolled, after.shape[-1], axis=-1)
    least = np.argmin(np.sum(np.abs(moves - before[..., None, :]), axis=-1), axis=-1)
    moved = np.take_along_axis(moves, least[..., None, None], axis=-2)[..., 0, :]
    return np.sum(moved >= np.pi, axis=-1) - np.sum(before >= np.pi, axis=-1)


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

    return Leg(at, np.zeros_like, length)


def hamilton_leg(
    pieces: Sequence[tuple[float, np.ndarray, np.ndarray]],
    flow: Flow,
    dimension: int,
    pull: Callable[[np.ndarray], np.ndarray],
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

    return Leg(at, pull, length, tuple(starts[1:].tolist()))
