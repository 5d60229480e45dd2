"""Planes that hold all rays between two points in space: those of layers, of shells about a centre, of no force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from varcalc.optics.media.medium import Medium, Radial, Stratified
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.surfaces import Plane, Sphere, Surface

SAME_DIRECTION = 1e-14
"""Directions that differ by less, relative to the scene, are the same."""
UPWARDS = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PlaneSection:
    """The ``media`` and ``surfaces`` in the planes that hold all rays between two points of a scene in space.

    These are the vertical ones where all is in layers, and those through the ``centre`` where all is in shells about
    it; all that hold both points where there is neither.
    """

    media: tuple[Medium, ...]
    surfaces: tuple[Surface, ...]
    upright: bool
    centre: np.ndarray | None

    @classmethod
    def of(cls, media: Sequence[Medium], surfaces: Sequence[Surface]) -> PlaneSection | None:
        """That of a scene in space; None where no plane holds all rays."""
        varying = [medium for medium in media if not medium.is_uniform]
        if all(isinstance(m, Stratified | Tabulated) for m in varying) and all(map(_level, surfaces)):
            flat = [
                replace(s, point=(0.0, s.point[2]), normal=(0.0, float(np.sign(s.normal[2]))))
                for s in surfaces if isinstance(s, Plane)
            ]  # fmt: skip
            return cls(tuple(media), tuple(flat), bool(varying or flat), None)
        centres = [medium.middle(3) for medium in varying if isinstance(medium, Radial)]
        centres += [np.array(s.center) for s in surfaces if isinstance(s, Sphere)]
        round_ = len(centres) == len(varying) + len(surfaces)
        if not round_ or not all(np.array_equal(centre, centres[0]) for centre in centres):
            return None
        about = [replace(m, center=None) if isinstance(m, Radial) else m for m in media]
        circles = [replace(s, center=(0.0, 0.0)) for s in surfaces if isinstance(s, Sphere)]
        return cls(tuple(about), tuple(circles), False, centres[0])

    def between(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The plane that holds every ray from ``a`` to ``b``: an origin (3,) and orthonormal axes (2, 3).

        Where ``a`` and ``b`` do not fix the plane it is any of those that do, and its rays stand for those of the
        others.
        """
        if self.upright:
            return np.array([a[0], a[1], 0.0]), np.stack([_beside(UPWARDS, b - a), UPWARDS])
        if self.centre is not None:
            start, end = a - self.centre, b - self.centre
            first, other = (start, end) if np.linalg.norm(start) > 0 else (end, end)
            first = first / np.linalg.norm(first)
            return self.centre, np.stack([first, _beside(first, other)])
        ahead = (b - a) / np.linalg.norm(b - a)
        return a, np.stack([ahead, _beside(ahead, ahead)])

    def turning(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """True (k,) for points ``a`` and ``b`` (k, 3) that do not fix the plane: it may be turned about their line."""
        if not self.upright and self.centre is None:
            return np.ones(len(a), dtype=bool)
        start, end = (a - b, np.broadcast_to(UPWARDS, a.shape)) if self.upright else (a - self.centre, b - self.centre)
        sizes = np.linalg.norm(start, axis=1) * np.linalg.norm(end, axis=1)
        return np.linalg.norm(np.cross(start, end), axis=1) <= SAME_DIRECTION * sizes


def _level(surface: Surface) -> bool:
    return isinstance(surface, Plane) and not np.any(surface.normal[:-1])


def _beside(axis: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The unit vector at right angles to ``axis`` in the plane of both; any, where they are parallel."""
    rest = other - np.dot(other, axis) * axis
    if np.linalg.norm(rest) <= SAME_DIRECTION * np.linalg.norm(other):
        rest = np.eye(3)[np.argmin(np.abs(axis))]
        rest = rest - np.dot(rest, axis) * axis
    return rest / np.linalg.norm(rest)
