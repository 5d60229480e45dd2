"""Rays that are known to go from one point to another, carried there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from varcalc.numerics.one_coordinate.quadrature import AGREED
from varcalc.optics.rays.beam import Rows
from varcalc.optics.rays.ray import Ray

CARRIED_WELL, MEETS = 1e-12, 1e-6
"""Of the distance of two points: a ray that misses the second by more is carried again, or was none."""
TOLD = 1e-10
"""Noise of a ray's angle beyond which carrying it more carefully gains nothing."""
ERROR_MARGIN = 4.0
"""By how many times the difference of two optical paths either may be off."""
READ = 1e-14
"""Of an optical path: what the passages that it is made of, read from tables, may be off."""
PANELS = 32
"""Panels whose errors, each within that to which they are integrated, may add up in an optical path."""


class Carry(Protocol):
    """What takes the rays of questions to their ends."""

    def __call__(
        self, question: np.ndarray, headings: np.ndarray, paths: np.ndarray, touching: np.ndarray,
        counts: np.ndarray,
    ) -> list[tuple[Ray | None, float]]:  # fmt: skip
        """The rays of questions (k,), as :data:`varcalc.optics.models.model.Builder` gives those of one.

        Last comes how many conjugate points they pass (k,), -1 where that is not known.
        """
        ...


@dataclass(frozen=True)
class Told(Rows):
    """k rays that answer ``question`` (k,) of which all is known that is told of rays, but how they spread.

    ``headings`` and ``arriving`` (k, d) are unit vectors along them at their ends, ``paths`` (k,) their optical paths,
    ``errors`` (k,) what these may be off, ``counts`` (k,) their conjugate points, and ``least`` (k,) is the cosine of
    the angle to the layers at the first point: of the index there no less than so much is left where they turn. Those
    that do not meet their targets when they are carried spread as ``spreads`` (k,) says, by how they were found.
    So much is known of those that are ``well`` told (k,) that they need not be carried.
    """

    question: np.ndarray
    headings: np.ndarray
    arriving: np.ndarray
    paths: np.ndarray
    errors: np.ndarray
    counts: np.ndarray
    least: np.ndarray
    spreads: np.ndarray
    well: np.ndarray


class Tell(Protocol):
    """What makes rays of what is known of them."""

    def __call__(self, told: Told) -> list[Ray]:
        """The rays, which are carried when somebody asks for more."""
        ...


@dataclass(frozen=True)
class Aimed(Rows):
    """k rays that answer ``question`` (k,): unit ``headings`` (k, d), optical ``paths`` (k,), and more.

    ``touching`` (k,) says that a ray touches a caustic at its end, ``noise`` (k,) what round-off of its heading makes
    of how far it comes, ``counts`` (k,) how many conjugate points it passes, -1 where that is not known.
    """

    question: np.ndarray
    headings: np.ndarray
    paths: np.ndarray
    touching: np.ndarray
    noise: np.ndarray
    counts: np.ndarray

    def carried(self, carry: Carry, careful: Carry | None) -> list[Ray | None]:
        """The rays (k,), None for those that do not meet the point.

        A ray that misses the point as ``carry`` takes it, since it went far out where digits are lost, is taken there
        the ``careful`` way, if there is one.
        """
        if len(self.question) == 0:
            return []
        built = carry(self.question, self.headings, self.paths, self.touching, self.counts)
        floor, miss = np.zeros(len(built)), np.array([miss for _, miss in built])
        again = np.flatnonzero((miss > CARRIED_WELL) & np.isfinite(miss) & (self.noise < TOLD))
        if careful is not None and len(again):
            floor[again] = PANELS * AGREED * self.paths[again]
            counts = np.array([ray.index for ray in (built[k][0] for k in again) if ray])  # the way is the same
            better = careful(
                self.question[again], self.headings[again], self.paths[again], self.touching[again], counts
            )
            for k, own in zip(again, better, strict=True):
                built[k] = own
        return [self._met(k, ray, off, float(floor[k])) for k, (ray, off) in enumerate(built)]

    def _met(self, k: int, ray: Ray | None, off: float, floor: float) -> Ray | None:
        """Ray ``k`` with what its optical path may be off, if it misses the point by no more than round-off."""
        if ray is None or not off <= MEETS:
            return None
        # two routes to one number, in one stroke and along the ray; what went astray did so along it as well
        apart = ERROR_MARGIN * abs(ray.optical_path - self.paths[k])
        return ray.known_to(float(max(ray.error, floor, apart, max(off, READ) * self.paths[k])))


def met(
    count: int, aimed: Aimed, told: Told | None, carry: Carry, careful: Carry | None, tell: Tell | None
) -> list[list[Ray]]:
    """The rays that meet the points of ``count`` questions, for each the shortest optical path first.

    Those that are told well are not carried, and those that go astray when they are carried, far out or beside rays
    that rest, are told if it is known what their optical paths may be off.
    """
    well = told.well if told is not None and tell is not None else np.zeros(len(aimed), dtype=bool)
    others = np.flatnonzero(~well)
    carried = aimed.take(others).carried(carry, careful)
    rays: list[list[Ray]] = [[] for _ in range(count)]
    if told is not None and tell is not None:
        missed = others[[ray is None for ray in carried]]
        rows = np.append(np.flatnonzero(well), missed[np.isfinite(told.errors[missed])]).astype(int)
        some = told.take(rows[np.lexsort((told.paths[rows], told.question[rows]))])
        own, ends = tell(some), np.searchsorted(some.question, np.arange(count + 1))
        rays = [own[first:last] for first, last in pairwise(ends.tolist())]
    for question, ray in zip(aimed.question[others], carried, strict=True):
        if ray is not None:
            rays[question].append(ray)
    for question in np.unique(aimed.question[others]):
        rays[question].sort(key=lambda ray: ray.optical_path)
    return rays
