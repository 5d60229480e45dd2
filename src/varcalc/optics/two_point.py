"""All rays between two points: the search in a plane, and each ray carried once more for what belongs to it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from varcalc import engines
from varcalc.optics import sphere
from varcalc.optics.arrivals import Search
from varcalc.optics.beam import NOTHING, Beam, RayStatus, launched, spreading
from varcalc.optics.march import March
from varcalc.optics.passes import HamiltonLeg, LastLeg, Passes, StraightLeg, passes
from varcalc.optics.plane import Section
from varcalc.optics.ray import Ray, Rays
from varcalc.optics.straight import StraightRays
from varcalc.optics.tracks import Tracks

FLAT = 1e-9
"""A spreading so small beside that of a uniform medium is that of a conjugate point."""
AT_END = 1e-6
"""Conjugate points so close to the end of a ray on a caustic, in its optical path, are the end itself."""


@dataclass
class TwoPoint:
    """The rays from one point to others in one scene; what is compiled is kept.

    ``march`` is the scene in the plane of the search, ``full`` the scene itself; in the plane they are the same.
    """

    march: March
    full: March
    leg: LastLeg = field(init=False, repr=False)
    tracks: Tracks = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.tracks = Tracks(self.full)
        last = self.march.models[-1]
        if isinstance(last, StraightRays):
            self.leg = StraightLeg(last)
        else:
            self.leg = HamiltonLeg(self.march.media[-1], self.march.dimension, self.march.geometries, engines.default())

    def between(self, a: np.ndarray, b: np.ndarray, section: Section | None, within: float) -> Rays:
        """All rays from ``a`` to ``b`` (d,) whose optical path is at most ``within``.

        ``section`` is the plane that holds them; without one the search goes over the sphere of directions.
        """
        largest = max(float(self.full.fields[k].index(end[None, :])[0]) for k, end in ((0, a), (-1, b)))
        far = max(within / largest, 2 * float(np.linalg.norm(b - a)))
        if section is None:
            rays, fan, how, continuum = self._over_the_sphere(a, b, within, far)
        else:
            rays, fan, how, continuum = self._in_the_plane(a, b, section, within, far)
        searched = f"{how}, optical paths up to {within:.6g}, no farther than {far:.6g} from B"
        reason = "" if rays else f"{fan.reason()} (searched: {searched})"
        return Rays(tuple(sorted(rays, key=lambda ray: ray.optical_path)), reason, searched, continuum)

    def _in_the_plane(
        self, a: np.ndarray, b: np.ndarray, section: Section, within: float, far: float
    ) -> tuple[list[Ray], _Fan, str, bool]:
        fan = _Fan(self, section.into(a), section.into(b), within, far)
        found = Search(fan.passes, float(np.linalg.norm(b - a))).run()
        rays = [
            self._ray(a, b, section.out(np.array([np.cos(angle), np.sin(angle)])), path, touching)
            for angle, path, touching in zip(found.angles, found.paths, found.touching, strict=True)
        ]
        how = (
            f"all directions of the plane ({found.looked_at} looked at, "
            f"{found.unresolved} narrow intervals left unresolved)"
        )
        return rays, fan, how, found.continuum

    def _over_the_sphere(
        self, a: np.ndarray, b: np.ndarray, within: float, far: float
    ) -> tuple[list[Ray], _Fan, str, bool]:
        fan = _Fan(self, a, b, within, far)
        found = sphere.search(lambda headings: fan.minima(headings, within), b, float(np.linalg.norm(b - a)))
        rays = [
            self._ray(a, b, heading, float(path), False)
            for heading, path in zip(found.directions, found.paths, strict=True)
        ]
        how = f"{sphere.DIRECTIONS} directions of space, and Newton's iteration from the best ({found.looked_at} rays)"
        return rays, fan, how, False

    def _ray(self, a: np.ndarray, b: np.ndarray, heading: np.ndarray, path: float, touching: bool) -> Ray:
        """The ray along ``heading`` (d,) with its neighbours, in the dimensions of the scene."""
        index = self.full.fields[0].index(a[None, :])
        beam = launched(a[None, :], heading[None, :], index, neighbours=True)
        legs, end, _ = self.tracks.legs(beam, path)
        away = b - end.position[0]
        along = float(np.dot(end.momentum[0], away))
        spread = float(spreading(end)[0])
        flat = touching or spread <= FLAT * (path / float(index[0]) ** 2) ** (len(a) - 1)
        foci = [focus for leg in legs for focus in leg.foci() if not flat or focus[0] < path * (1 - AT_END)]
        tangent = end.momentum[0] / np.linalg.norm(end.momentum[0])
        squared = 0.0 if flat else float(np.dot(away, away)) * float(index[0]) ** 2 / spread  # the path is stationary
        return Ray(
            optical_path=float(end.optical_path[0]) + along,
            error=abs(along) + squared + 16 * float(np.finfo(float).eps) * path,
            index=len(foci),
            conjugate_points=np.array([position for _, position in foci]).reshape(-1, len(a)),
            spreading=spread,
            degenerate=flat,
            tangents=(heading, tangent),
            model=self.full.name,
            legs=legs,
            media=self.full.media,
            surfaces=self.full.surfaces,
        )


@dataclass
class _Fan:
    """Directions to passes, for the searches; remembers what became of the rays."""

    problem: TwoPoint
    source: np.ndarray
    target: np.ndarray
    within: float
    far: float
    ends: Counter[RayStatus] = field(default_factory=Counter)
    passed: int = 0

    def passes(self, angles: np.ndarray, limit: float) -> Passes:
        """The passes of the rays of the plane at ``angles`` (m,)."""
        rows, at = self.minima(np.column_stack([np.cos(angles), np.sin(angles)]), limit)
        return passes(rows, at, self.problem.march.fields[-1], self.target)

    def minima(self, headings: np.ndarray, limit: float) -> tuple[np.ndarray, Beam]:
        """The rows of ``headings`` (m, d) whose rays pass the target, and the rays there."""
        march, limit = self.problem.march, min(limit, self.within)
        start = np.tile(self.source, (len(headings), 1))
        beam = launched(start, headings, march.fields[0].index(start), neighbours=True)
        beam, status, alive = march.to_last_medium(beam, np.full(len(headings), limit))
        self.ends.update(RayStatus(int(code)) for code in status[~alive])
        rows = np.flatnonzero(alive)
        self.passed += len(rows)
        leaving = march.shapes[-1] if march.shapes else NOTHING
        found, at = self.problem.leg.minima(beam.take(rows), self.target, limit, self.far, leaving)
        return rows[found], at

    def reason(self) -> str:
        """Why no ray was found."""
        if self.passed:
            return "shadow: no ray of the source comes to B"
        if self.ends[RayStatus.TOTAL_REFLECTION]:
            return "total reflection: no ray gets through the surfaces"
        return "blocked: no ray meets the surfaces in the order of the scene"
