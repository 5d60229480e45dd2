"""All rays between points, many pairs at once: the search, and what belongs to each ray that it finds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from varcalc.optics.arrivals.fan import Bounds, Fan
from varcalc.optics.arrivals.space import DIRECTIONS, Approaches, search
from varcalc.optics.arrivals.wavefront_construction import Arrivals, PlanePairs, WavefrontConstruction
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import RayStatus, launched, spreading
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.rows import Rows

FLAT_SPREADING = 1e-9
"""A spreading so small beside that of a uniform medium is that of a conjugate point."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class PointPairs(Rows):
    """k pairs of points: sources and targets (k, d), and ``within`` (k,), the largest optical paths of their rays.

    The planes that hold the rays go through ``origin`` (k, d) along ``axes`` (k, 2, d); (k, 0, d) where none does.
    """

    sources: np.ndarray
    targets: np.ndarray
    within: np.ndarray
    origin: np.ndarray
    axes: np.ndarray

    @property
    def in_planes(self) -> bool:
        """Whether planes hold the rays."""
        return self.axes.shape[1] > 0


@dataclass
class TwoPoint:
    """The rays between points of one scene; what is compiled is kept.

    ``planar`` is the scene in the plane of the search, ``full`` the scene itself; in the plane they are the same.
    """

    planar: Propagator
    full: Propagator

    def found(self, pairs: PointPairs) -> tuple[list[Rays], np.ndarray]:
        """All rays of each pair, in the planes that hold them or over the sphere of directions.

        Last comes True (k,) for pairs to which rays may come back from beyond the place up to which they were followed.
        """
        if pairs.in_planes:
            return self._in_planes(pairs)
        points = zip(pairs.sources, pairs.targets, pairs.within, strict=True)
        found = [self._over_the_sphere(pairs.take([k]), *ends) for k, ends in enumerate(points)]
        return found, np.zeros(len(pairs), dtype=bool)

    def _in_planes(self, ends: PointPairs) -> tuple[list[Rays], np.ndarray]:
        """See :meth:`found`."""
        flat = [np.einsum("kad,kd->ka", ends.axes, points - ends.origin) for points in (ends.sources, ends.targets)]
        distance = np.linalg.norm(ends.targets - ends.sources, axis=1)
        far = np.maximum(ends.within / self._largest_index(ends), 2 * distance)
        origins, source = np.unique(flat[0], axis=0, return_inverse=True)
        source = source.ravel()
        fan = Fan(self.planar, origins, _bounds(source, flat[1], ends.within, far, distance))
        found = WavefrontConstruction(fan, PlanePairs(source, flat[1], ends.within, distance)).run()
        rays = self._rays(ends, found)
        searched = f"all directions of the plane ({fan.looked_at} looked at, %d narrow cells left unresolved), "
        searched += "optical paths up to %.6g, no farther than %.6g from B"
        notes = [searched % note for note in zip(found.unresolved, ends.within, far, strict=True)]
        told = [
            _told(rays[k], fan.ends, fan.entered, notes[k], bool(found.continuum[k]), int(found.unresolved[k]))
            for k in range(len(ends))
        ]
        return told, fan.left_early[source]

    def _largest_index(self, ends: PointPairs) -> np.ndarray:
        """The larger index (k,) of both ends."""
        first, last = self.full.fields[0].index(ends.sources), self.full.fields[-1].index(ends.targets)
        return np.maximum(first, last)

    def _rays(self, ends: PointPairs, found: Arrivals) -> list[list[Ray]]:
        """The rays found, pair by pair."""
        aims = found.meeting.aims
        turned = np.column_stack([np.cos(aims.angle), np.sin(aims.angle)])
        heading = np.einsum("ma,mad->md", turned, ends.axes[aims.pair])
        path = found.meeting.state[:, 4]
        built = self.built(ends.take(aims.pair), heading, path, found.touching)
        rays: list[list[Ray]] = [[] for _ in range(len(ends))]
        for k, (ray, _) in zip(aims.pair, built, strict=True):
            if ray is not None:
                rays[k].append(ray)
        return rays

    def built(
        self, ends: PointPairs, headings: np.ndarray, path: np.ndarray, touching: np.ndarray
    ) -> list[tuple[Ray | None, float]]:
        """The rays that leave the sources along unit ``headings`` (k, d), to the optical paths ``path`` (k,).

        ``touching`` (k,) says that a ray is known to touch a caustic at its target. With every ray comes how far from
        its target it ends, relative to the distance of the pair; there is no ray where surfaces are not met in the
        order of the scene.
        """
        if len(headings) == 0:
            return []
        index = self.full.fields[0].index(ends.sources)
        beam = launched(ends.sources, headings, index, neighbours=True)
        passages, end, clear = self.full.through_all(beam, path)
        d, momentum = beam.dimension, np.linalg.norm(end.momentum, axis=1)
        away = ends.targets - end.position
        along, spread = np.sum(end.momentum * away, axis=1), spreading(end)
        flat = touching | (spread <= FLAT_SPREADING * (path / index**2) ** (d - 1))
        count = self.full.conjugate_points(passages, path, flat)
        with np.errstate(divide="ignore"):
            squared = np.where(flat, 0.0, np.sum(away**2, axis=1) * index**2 / spread)  # the path is stationary
        error = np.abs(along) + squared + 16 * EPS * path
        miss = np.linalg.norm(away, axis=1) / np.linalg.norm(ends.targets - ends.sources, axis=1)
        name, rays = self.full.name, []
        for k in range(len(beam)):
            if not clear[k]:
                rays.append((None, np.inf))
                continue
            ray = Ray(
                optical_path=float(end.optical_path[k] + along[k]),
                error=float(error[k]),
                index=int(count[k]),
                spreading=float(spread[k]),
                degenerate=bool(flat[k]),
                tangents=(headings[k], end.momentum[k] / momentum[k]),
                model=name,
                way=lambda k=k: self.full.followed(beam.take(np.array([k])), float(path[k]))[0],
                media=self.full.media,
                surfaces=self.full.surfaces,
            )
            rays.append((ray, float(miss[k])))
        return rays

    def _over_the_sphere(self, one: PointPairs, a: np.ndarray, b: np.ndarray, within: float) -> Rays:
        """All rays from ``a`` to ``b`` (3,) that a net of directions leads to."""
        distance = float(np.linalg.norm(b - a))
        far = max(within / float(self._largest_index(one)[0]), 2 * distance)
        fan = Approaches(self.full, a, b, within, far)
        found = search(fan.minima, b, distance)
        every = np.zeros(len(found.paths), dtype=int)
        built = self.built(one.take(every), found.directions, found.paths, every > 0)
        searched = (
            f"{DIRECTIONS} directions of space, and Newton's iteration from the best ({found.looked_at} rays), "
            f"optical paths up to {within:.6g}, no farther than {far:.6g} from B"
        )
        return _told([ray for ray, _ in built if ray is not None], fan.ends, fan.entered, searched)


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
