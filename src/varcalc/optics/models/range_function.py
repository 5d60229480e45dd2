"""All rays between two points of layers or about a centre, by the range function: the question and its answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from varcalc.numerics.one_coordinate.quadrature import AGREED
from varcalc.optics.media.medium import Medium, Radial
from varcalc.optics.models.launches import Launch, launches
from varcalc.optics.models.model import Builder, DoesNotApply, Question
from varcalc.optics.models.reduction import Profile
from varcalc.optics.rays.beam import frames
from varcalc.optics.rays.ray import Ray, Rays

UPRIGHT = 1e-13
"""Of the distance of two points: what they lie apart along layers is none."""
CARRIED_WELL, MEETS = 1e-11, 1e-6
"""Of the distance of two points: a ray that misses the second by more is carried again, or was none."""
TOLD = 1e-10
"""Noise of a ray's angle beyond which carrying it more carefully gains nothing."""
ERROR_MARGIN = 4.0
"""By how many times the difference of two optical paths either may be off."""
PANELS = 32
"""Panels whose errors, each within that to which they are integrated, may add up in an optical path."""


def found_by_range(question: Question, *, careful: Builder | None = None) -> Rays:
    """The rays that answer ``question``, whose one medium is ``Stratified`` or ``Radial`` and has no surfaces.

    A ray that misses the point as the question carries it, since it went far out where digits are lost, is carried the
    ``careful`` way, if there is one.

    Raises :class:`DoesNotApply` where an end is the centre of the index.
    """
    frame = Frame(question.media[0], question.a, question.b)
    with np.errstate(invalid="ignore"):  # passages that do not exist, or are not known, are no numbers
        found = launches(frame.profile, frame.heights, frame.distance, question.within)
    carried = _carried(question, careful, frame, found.found)
    rays = sorted(carried, key=lambda ray: ray.optical_path)
    unresolved = found.unresolved + found.resting + len(found.found) - len(rays)
    resting = f"; {found.resting} rays that all but come to rest along a layer" if found.resting else ""
    searched = (
        f"all launching angles by the range function ({found.looked_at} looked at, {unresolved} narrow "
        f"intervals left unresolved{resting}), optical paths up to {question.within:.6g}"
    )
    reason = "" if rays else f"shadow: no ray of the source comes to B (searched: {searched})"
    return Rays(tuple(rays), reason, searched, found.continuum, unresolved)


def _carried(question: Question, careful: Builder | None, frame: Frame, found: list[Launch]) -> list[Ray]:
    """The rays of the launches but those that do not meet the point: radial ones, at the rim of the range function."""
    if not found:
        return []
    headings = np.array([frame.heading(launch) for launch in found])
    paths, touching = (np.array([getattr(launch, name) for launch in found]) for name in ("path", "touching"))
    built = question.built(headings, paths, touching)
    doubtful = [miss > CARRIED_WELL and launch.noise < TOLD for (_, miss), launch in zip(built, found, strict=True)]
    floor, again = np.zeros(len(found)), np.flatnonzero(doubtful)
    if careful is not None and len(again):
        floor[again] = PANELS * AGREED * paths[again]
        for k, better in zip(again, careful(headings[again], paths[again], touching[again]), strict=True):
            built[k] = better
    # two routes to one number: by quadrature to the point, and along the ray
    return [
        replace(ray, error=max(ray.error, floor[k], ERROR_MARGIN * abs(ray.optical_path - paths[k])))
        for k, (ray, miss) in enumerate(built)
        if ray is not None and miss <= MEETS
    ]


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
        upright = length <= UPRIGHT * np.linalg.norm(b - a)  # what is left of it has no direction
        self.ahead = frames(self.up[None, :])[0, 0] if upright else across / length

    def heading(self, launch: Launch) -> np.ndarray:
        """The unit vector along which a ray leaves the first point."""
        heading = launch.speed * self.up + launch.way * launch.c * self.ahead
        return heading / np.linalg.norm(heading)
