"""All rays between two points of layers or about a centre: the range function, asked for two points of space."""

from __future__ import annotations

import numpy as np

from varcalc.optics.beam import frames
from varcalc.optics.media import Medium, Radial
from varcalc.optics.model import DoesNotApply, Question
from varcalc.optics.profile import Profile
from varcalc.optics.ranges import Launch, Range, launches
from varcalc.optics.ray import Ray, Rays

ROUND_OFF = 1e-13
"""Of the distance of two points: what they lie apart along layers is none."""
MET = 1e-6
"""Of the distance of two points: a ray that misses the second by more was none."""


def found_by_range(question: Question, *, easy: bool = False) -> Rays:
    """The rays that answer ``question``, whose one medium is ``Stratified`` or ``Radial`` and has no surfaces.

    Raises :class:`DoesNotApply` where an end is the centre of the index and, if asked for ``easy`` questions only,
    where the range function has logarithms.
    """
    frame = Frame(question.media[0], question.a, question.b)
    if easy and not Range.between(frame.profile, frame.heights)[0].easy(frame.distance):
        raise DoesNotApply(
            "some rays come to rest along a layer, and the range function is no simple one; take Hamilton()"
        )
    found = launches(frame.profile, frame.heights, frame.distance, question.within)
    carried = [question.ray(frame.heading(launch), launch.path, launch.touching) for launch in found.found]
    rays = sorted((ray for ray in carried if _arrives(ray, question)), key=lambda ray: ray.optical_path)
    unresolved = found.unresolved + len(carried) - len(rays)
    searched = (
        f"all launching angles by the range function ({found.looked_at} looked at, {unresolved} narrow "
        f"intervals left unresolved), optical paths up to {question.within:.6g}"
    )
    reason = "" if rays else f"shadow: no ray of the source comes to B (searched: {searched})"
    return Rays(tuple(rays), reason, searched, found.continuum, unresolved)


def _arrives(ray: Ray, question: Question) -> bool:
    """Whether a ray, carried, meets the point: radial ones, at the rim of the range function, may not."""
    if not ray.legs:
        return False
    last = ray.legs[-1]
    miss = np.linalg.norm(last.at(np.array([last.length])).position[0] - question.b)
    return bool(miss <= MET * np.linalg.norm(question.b - question.a))


class Frame:
    """Two points as heights in a profile, and the distances between them along the layers."""

    def __init__(self, medium: Medium, a: np.ndarray, b: np.ndarray) -> None:
        if isinstance(medium, Radial):
            offsets = [end - medium.middle(len(a)) for end in (a, b)]
            radii = [float(np.linalg.norm(offset)) for offset in offsets]
            if min(radii) == 0:
                raise DoesNotApply(
                    "Invariants needs points off the centre of the index, about which all turns; take Hamilton()"
                )
            self.up = offsets[0] / radii[0]
            unit = float(2.0 ** np.round(np.log2(radii[0])))
            self.profile = Profile(medium, unit, 0.0)
            self.heights = float(np.log(radii[0] / unit)), float(np.log(radii[1] / unit))
            across = offsets[1] - np.dot(offsets[1], self.up) * self.up
            self.distance = float(np.arctan2(np.linalg.norm(across), np.dot(offsets[1], self.up)))
        else:
            self.up = np.eye(len(a))[-1]
            self.profile = Profile(medium, 1.0, float(a[-1]))
            self.heights = float(a[-1]), float(b[-1])
            across = np.append((b - a)[:-1], 0.0)
            self.distance = float(np.linalg.norm(across))
        length = float(np.linalg.norm(across))
        upright = length <= ROUND_OFF * np.linalg.norm(b - a)  # what is left of it has no direction
        self.ahead = frames(self.up[None, :])[0, 0] if upright else across / length

    def heading(self, launch: Launch) -> np.ndarray:
        """The unit vector along which a ray leaves the first point."""
        heading = launch.speed * self.up + launch.way * launch.c * self.ahead
        return heading / np.linalg.norm(heading)
