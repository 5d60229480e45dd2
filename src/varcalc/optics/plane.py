"""The plane in which the rays between two points lie."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.optics.media import Medium, Radial, Stratified

FLAT = 1e-14
"""Directions that differ by less, relative to the scene, are the same."""


@dataclass(frozen=True)
class Section:
    """A plane through ``origin`` (d,) along two orthonormal ``axes`` (2, d)."""

    origin: np.ndarray
    axes: np.ndarray

    def into(self, point: np.ndarray) -> np.ndarray:
        """Coordinates (2,) in the plane of a point (d,) of it."""
        return self.axes @ (point - self.origin)

    def out(self, direction: np.ndarray) -> np.ndarray:
        """A direction (d,) from its components (2,) in the plane."""
        return direction @ self.axes


def whole_plane() -> Section:
    """The plane itself, for scenes in the plane."""
    return Section(np.zeros(2), np.eye(2))


def section(medium: Medium, a: np.ndarray, b: np.ndarray) -> tuple[Section, Medium] | None:
    """The plane that holds every ray from ``a`` to ``b`` in space, with the medium in it; None where there is none.

    Layers keep a ray in the vertical plane of its direction, a centre in the
    plane through it. Where ``a`` and ``b`` do not fix the plane it is any of
    them, and its rays stand for those of the others.
    """
    if medium.is_uniform:
        ahead = (b - a) / np.linalg.norm(b - a)
        return Section(a, np.stack([ahead, _across(ahead, ahead)])), medium
    if isinstance(medium, Stratified):
        up = np.array([0.0, 0.0, 1.0])
        origin = np.array([a[0], a[1], 0.0])
        return Section(origin, np.stack([_across(up, b - a), up])), medium
    if isinstance(medium, Radial):
        center = medium.middle(3)
        first, other = (a - center, b - center) if np.linalg.norm(a - center) > 0 else (b - center, b - center)
        first = first / np.linalg.norm(first)
        return Section(center, np.stack([first, _across(first, other)])), replace(medium, center=None)
    return None


def _across(axis: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The unit vector at right angles to ``axis`` in the plane of both; any, where they are parallel."""
    rest = other - np.dot(other, axis) * axis
    if np.linalg.norm(rest) <= FLAT * np.linalg.norm(other):
        rest = np.eye(3)[np.argmin(np.abs(axis))]
        rest = rest - np.dot(rest, axis) * axis
    return rest / np.linalg.norm(rest)
