"""Random pairs of points with a rod of a graded index between two plane faces, and their rays in closed form.

In the rod, n² = n0² (1 - (a y)²), rays are y = y0 cos wσ + p/w sin wσ with w = n0 a, between faces L = p_x σ apart.
Where rays are totally reflected at the second face there is none: the angles at which rays get through lie in windows,
narrower and narrower towards rays that all but stand still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from campaigns.arrival_pairs import Drawn
from varcalc import optics

ANGLES, CLOSER = 500_001, 20_001
"""Launching angles of the fan, and between two of them where a ray may come to the receiver, or rays end."""
JUMPS = 0.1
"""Between closer neighbours: farther apart they are on two sides of rays that do not get through."""


@dataclass(frozen=True)
class GradedLens:
    """The indices before, on the axis of and behind a rod of ``length``, and how its index falls."""

    before: float
    axis: float
    behind: float
    fall: float
    length: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> GradedLens:
        """At random."""
        return cls(
            rng.uniform(1, 1.6), rng.uniform(1.3, 1.8), rng.uniform(1, 1.6), rng.uniform(0.2, 0.9), rng.uniform(0.5, 8)
        )

    def scene(self) -> optics.Scene:
        """The same for rays to be traced in."""
        rod = optics.Stratified(lambda y: self.axis * ca.sqrt(1 - (self.fall * y) ** 2))
        media = [optics.Uniform(self.before), rod, optics.Uniform(self.behind)]
        return optics.Scene(media, [optics.Plane((0, 0), (1, 0)), optics.Plane((self.length, 0), (1, 0))])

    def ends(self, a: np.ndarray, x: float, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights at ``x`` of rays from ``a`` (2,), their optical paths and p_y; not numbers where none gets there."""
        with np.errstate(all="ignore"):
            y, p = a[1] - np.tan(angles) * a[0], self.before * np.sin(angles)
            ahead = np.sqrt(self.axis**2 * (1 - (self.fall * y) ** 2) - p**2)
            w = self.axis * self.fall
            sigma = self.length / ahead
            cos, sin = np.cos(w * sigma), np.sin(w * sigma)
            last, climb = y * cos + p / w * sin, p * cos - w * y * sin
            out = np.sqrt(self.behind**2 - climb**2)
            squares = (
                (y**2 + (p / w) ** 2) * sigma / 2 + (y**2 - (p / w) ** 2) * sin * cos / (2 * w) + y * p * (sin / w) ** 2
            )
            path = self.axis**2 * (sigma - self.fall**2 * squares)
            path += -self.before * a[0] / np.cos(angles) + self.behind**2 * (x - self.length) / out
            return last + (x - self.length) * climb / out, path, climb


def graded_lens_pair(rng: np.random.Generator) -> tuple[GradedLens, Drawn, float]:
    """A lens, a pair of points and the optical path up to which its rays are known."""
    lens = GradedLens.drawn(rng)
    a = np.array([-rng.uniform(0.05, 3), rng.uniform(-0.8, 0.8) / lens.fall])
    b = np.array([lens.length + rng.uniform(0.05, 3), rng.uniform(-0.8, 0.8) / lens.fall])
    within = 1.8 * rng.uniform(0.8, 2) * float(np.hypot(*(b - a)))

    def off(angles: np.ndarray) -> np.ndarray:
        return lens.ends(a, b[0], angles)[0] - b[1]

    angles = np.linspace(-np.pi / 2, np.pi / 2, ANGLES)[1:-1]
    paths: list[float] = []
    for first in _suspects(off(angles)):
        near = np.linspace(angles[first], angles[first + 1], CLOSER)
        paths += [float(_path(lens, a, b, off, *near[k : k + 2])) for k in _crossed(off(near))]
    kept = sorted(path for path in paths if path < within)
    return lens, Drawn(tuple(a.tolist()), tuple(b.tolist()), tuple(kept), np.inf), within


def _suspects(off: np.ndarray) -> np.ndarray:
    known = np.isfinite(off)
    return np.flatnonzero((off[1:] * off[:-1] < 0) | (known[1:] != known[:-1]))


def _crossed(off: np.ndarray) -> np.ndarray:
    return np.flatnonzero((off[1:] * off[:-1] < 0) & (np.abs(np.diff(off)) < JUMPS))


def _path(
    lens: GradedLens, a: np.ndarray, b: np.ndarray, off: Callable[[np.ndarray], np.ndarray], low: float, high: float
) -> float:
    """The optical path of the ray between two angles, with 18 digits; infinite where it does not get through."""
    ends = np.array([low, high], dtype=np.longdouble)
    sign = np.sign(off(ends[:1]))[0]
    for _ in range(80):
        middle = ends.mean(keepdims=True)
        ends[0 if np.sign(off(middle)[0]) == sign else 1] = middle[0]
    height, path, climb = (values[0] for values in lens.ends(a, b[0], ends[:1]))
    return float(path + climb * (b[1] - height)) if abs(height - b[1]) < 1e-6 else np.inf
