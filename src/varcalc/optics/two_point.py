"""All rays between points, many pairs at once: the search, and what belongs to each ray that it finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.optics import sphere
from varcalc.optics.arrivals import Arrivals, Pairs, Search
from varcalc.optics.beam import NOTHING, Beam, RayStatus, frames, launched, spreading
from varcalc.optics.fan import Bounds, Fan
from varcalc.optics.march import March
from varcalc.optics.plane import Section
from varcalc.optics.ray import AT_END, Ray, Rays
from varcalc.optics.space import Approaches, last_leg
from varcalc.optics.tracks import followed
from varcalc.optics.turns import conjugate_points

FLAT = 1e-9
"""A spreading so small beside that of a uniform medium is that of a conjugate point."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Ends:
    """k pairs of points: sources and targets (k, d), and ``within`` (k,), the largest optical paths of their rays."""

    sources: np.ndarray
    targets: np.ndarray
    within: np.ndarray

    def __len__(self) -> int:
        return len(self.sources)

    def take(self, rows: Sequence[int]) -> Ends:
        """The pairs of ``rows``."""
        return Ends(self.sources[rows], self.targets[rows], self.within[rows])


@dataclass
class TwoPoint:
    """The rays between points of one scene; what is compiled is kept.

    ``march`` is the scene in the plane of the search, ``full`` the scene itself; in the plane they are the same.
    """

    march: March
    full: March

    def found(self, ends: Ends, sections: Sequence[Section]) -> list[Rays]:
        """All rays of each pair; without ``sections`` that hold them, over the sphere of directions."""
        if sections:
            return self.in_planes(ends, sections)
        return [self.over_the_sphere(*pair) for pair in zip(ends.sources, ends.targets, ends.within, strict=True)]

    def in_planes(self, ends: Ends, sections: Sequence[Section]) -> list[Rays]:
        """All rays of each pair, which lie in the plane of its section."""
        flat = [
            np.array([section.into(point) for section, point in zip(sections, points, strict=True)])
            for points in (ends.sources, ends.targets)
        ]
        distance = np.linalg.norm(ends.targets - ends.sources, axis=1)
        far = np.maximum(ends.within / self._largest_index(ends), 2 * distance)
        origins, source = np.unique(flat[0], axis=0, return_inverse=True)
        source = source.ravel()
        fan = Fan(self.march, origins, _bounds(source, flat[1], ends.within, far, distance))
        found = Search(fan, Pairs(source, flat[1], ends.within, distance)).run()
        rays = self._rays(ends, sections, found)
        searched = f"all directions of the plane ({fan.looked_at} looked at, %d narrow cells left unresolved), "
        searched += "optical paths up to %.6g, no farther than %.6g from B"
        notes = [searched % note for note in zip(found.unresolved, ends.within, far, strict=True)]
        return [
            _told(rays[k], fan.ends, fan.entered, notes[k], bool(found.continuum[k]), int(found.unresolved[k]))
            for k in range(len(ends))
        ]

    def _largest_index(self, ends: Ends) -> np.ndarray:
        """The larger index (k,) of both ends."""
        first, last = self.full.fields[0].index(ends.sources), self.full.fields[-1].index(ends.targets)
        return np.maximum(first, last)

    def _rays(self, ends: Ends, sections: Sequence[Section], found: Arrivals) -> list[list[Ray]]:
        """The rays found, pair by pair."""
        aims = found.meeting.aims
        pair = aims.pair
        axes = np.array([section.axes for section in sections])[pair]
        heading = np.column_stack([np.cos(aims.angle), np.sin(aims.angle)])
        normal = np.column_stack([-heading[:, 1], heading[:, 0]])
        heading = np.einsum("ma,mad->md", heading, axes)
        across = np.einsum("ma,mad->md", normal, axes)[:, None]
        if self.full.dimension == 3:
            across = np.concatenate([across, np.cross(heading, across[:, 0])[:, None]], axis=1)
        path = found.meeting.state[:, 4]
        beam = _launched(self.full, ends.sources[pair], heading, across)
        rays: list[list[Ray]] = [[] for _ in range(len(ends))]
        for ray, k in zip(self._described(beam, aims.sigma, path, across, ends.targets[pair], found.touching), pair,
                          strict=True):  # fmt: skip
            if ray is not None:
                rays[k].append(ray)
        return rays

    def _described(
        self, beam: Beam, sigma: np.ndarray, path: np.ndarray, across: np.ndarray, targets: np.ndarray,
        touching: np.ndarray,
    ) -> list[Ray | None]:  # fmt: skip
        """The rays of ``beam``, at their sources, with what belongs to them; None for one that meets a surface."""
        if len(beam) == 0:
            return []
        d = beam.dimension
        index = np.linalg.norm(beam.momentum, axis=1)
        usual = path / index**2
        count, end = conjugate_points(self.full, beam, sigma, path, across, touching)
        away = targets - end.position
        along = np.sum(end.momentum * away, axis=1)
        spread = spreading(end)
        flat = touching | (spread <= FLAT * usual ** (d - 1))
        with np.errstate(divide="ignore"):
            squared = np.where(flat, 0.0, np.sum(away**2, axis=1) * index**2 / spread)  # the path is stationary
        error = np.abs(along) + squared + 16 * EPS * path
        tangent = end.momentum / np.linalg.norm(end.momentum, axis=1)[:, None]
        clear, name = self._clear(beam, path), self.full.name
        rays: list[Ray | None] = []
        for k in range(len(beam)):
            if not clear[k]:
                rays.append(None)
                continue
            ray = Ray(
                optical_path=float(end.optical_path[k] + along[k]),
                error=float(error[k]),
                index=int(count[k]),
                spreading=float(spread[k]),
                degenerate=bool(flat[k]),
                tangents=(beam.momentum[k] / index[k], tangent[k]),
                model=name,
                way=lambda k=k: followed(self.full, beam.take(np.array([k])), float(path[k]))[0],
                media=self.full.media,
                surfaces=self.full.surfaces,
            )
            rays.append(ray)
        return rays

    def _clear(self, beam: Beam, path: np.ndarray) -> np.ndarray:
        """True (m,) for rays that meet no surface after the last."""
        clear = np.ones(len(beam), dtype=bool)
        if self.full.surfaces:
            entry, _, alive = self.full.to_last_medium(beam, path)
            rows = np.flatnonzero(alive)
            arrival = self.full.models[-1].advance(entry.take(rows), path[rows], self.full.shapes[-1])
            clear[~alive] = False
            clear[rows] = arrival.struck == NOTHING
        return clear

    def over_the_sphere(self, a: np.ndarray, b: np.ndarray, within: float) -> Rays:
        """All rays from ``a`` to ``b`` (3,) that a net of directions leads to."""
        distance = float(np.linalg.norm(b - a))
        far = max(within / float(self._largest_index(Ends(a[None], b[None], np.zeros(1)))[0]), 2 * distance)
        fan = Approaches(self.full, last_leg(self.full), a, b, within, far)
        found = sphere.search(fan.minima, b, distance)
        rays = [self.ray(a, b, *one, touching=False) for one in zip(found.directions, found.paths, strict=True)]
        searched = (
            f"{sphere.DIRECTIONS} directions of space, and Newton's iteration from the best ({found.looked_at} rays), "
            f"optical paths up to {within:.6g}, no farther than {far:.6g} from B"
        )
        return _told(rays, fan.ends, fan.entered, searched)

    def ray(self, a: np.ndarray, b: np.ndarray, heading: np.ndarray, path: float, touching: bool) -> Ray:
        """The ray along ``heading`` (d,), with the conjugate points that its legs tell.

        ``touching`` says that it is known to touch a caustic at ``b``.
        """
        index = float(self.full.fields[0].index(a[None, :])[0])
        beam = _launched(self.full, a[None, :], heading[None, :], frames(heading[None, :]))
        legs, end, _ = followed(self.full, beam, path)
        away = b - end.position[0]
        along, spread = float(np.dot(end.momentum[0], away)), float(spreading(end)[0])
        flat = touching or spread <= FLAT * (path / index**2) ** (len(a) - 1)
        squared = 0.0 if flat else float(np.dot(away, away)) * index**2 / spread  # the path is stationary
        last = path * (1 - AT_END) if flat else np.inf
        return Ray(
            optical_path=float(end.optical_path[0]) + along,
            error=abs(along) + squared + 16 * EPS * path,
            index=sum(where < last for leg in legs for where, _ in leg.foci()),
            spreading=spread,
            degenerate=flat,
            tangents=(heading, end.momentum[0] / np.linalg.norm(end.momentum[0])),
            model=self.full.name,
            way=lambda: legs,
            media=self.full.media,
            surfaces=self.full.surfaces,
        )


def _launched(march: March, sources: np.ndarray, headings: np.ndarray, across: np.ndarray) -> Beam:
    """Rays whose neighbours start along the unit vectors ``across`` (m, d - 1, d)."""
    index = march.fields[0].index(sources)
    beam = launched(sources, headings, index, neighbours=False)
    return Beam(beam.position, beam.momentum, beam.optical_path, np.zeros_like(across), index[:, None, None] * across)


def _bounds(
    source: np.ndarray, targets: np.ndarray, within: np.ndarray, far: np.ndarray, distance: np.ndarray
) -> Bounds:
    """How far the rays of each source are followed for all of its targets (k, 2)."""
    n = int(source.max()) + 1

    def gathered(ufunc: np.ufunc, values: np.ndarray, start: float) -> np.ndarray:
        out = np.full((n, *values.shape[1:]), start)
        ufunc.at(out, source, values)
        return out

    middle = (gathered(np.minimum, targets, np.inf) + gathered(np.maximum, targets, -np.inf)) / 2
    reach = gathered(np.maximum, np.linalg.norm(targets - middle[source], axis=1), 0.0)
    size = np.maximum(reach, gathered(np.minimum, distance, np.inf))
    return Bounds(gathered(np.maximum, within, 0.0), gathered(np.maximum, far, 0.0) + reach, middle, reach, size)


def _told(
    rays: list[Ray], ends: Counter[RayStatus], entered: int, searched: str, continuum: bool = False, unresolved: int = 0
) -> Rays:
    """The rays of one pair, or why there is none."""
    if rays:
        return Rays(tuple(sorted(rays, key=lambda ray: ray.optical_path)), "", searched, continuum, unresolved)
    if entered:
        reason = "shadow: no ray of the source comes to B"
    elif ends[RayStatus.TOTAL_REFLECTION]:
        reason = "total reflection: no ray gets through the surfaces"
    else:
        reason = "blocked: no ray meets the surfaces in the order of the scene"
    return Rays((), f"{reason} (searched: {searched})", searched, unresolved=unresolved)
