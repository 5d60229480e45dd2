"""The ways through a scene, and where points are that rays start from or come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from varcalc.optics.caravan import CHUNK
from varcalc.optics.march import March
from varcalc.optics.media import Medium
from varcalc.optics.model import Model
from varcalc.optics.surfaces import Geometry, Surface

KEPT = 16
"""Ends of bundles for which compiled systems are kept."""
ON = 1e-12
"""A point is on a surface when it is no farther from it than this share of the scene's size."""


@dataclass
class Ways:
    """The media and surfaces of a scene in ``dimension`` dimensions, or either number; what is compiled is kept."""

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    dimension: int | None
    _kept: dict[tuple[Surface | None, int, Model | None], March] = field(default_factory=dict, init=False, repr=False)

    def march(self, until: Surface | None, dimension: int, model: Model | None = None) -> March:
        """The way through the scene; what has been compiled for it is kept, for a number of ends."""
        key = until, dimension, model
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = March(self.media, self.surfaces, until, dimension, model)
        return self._kept[key]

    def index_at_source(self, start: np.ndarray) -> np.ndarray:
        """n (m,) where the rays start; ValueError where it is no positive number."""
        index = _by_chunks(self.march(None, start.shape[1]).fields[0].index, start)
        bad = ~((index > 0) & np.isfinite(index))
        if np.any(bad):
            row = int(np.argmax(bad))
            raise ValueError(
                f"the index is {index[row]:g} at the source {tuple(start[row].tolist())}; rays start only "
                "where the index is a positive number"
            )
        return index


def _extent(points: np.ndarray) -> float:
    """The size of a scene seen from the points of its sources."""
    return max(float(points.max(initial=0.0)), -float(points.min(initial=0.0))) or 1.0


def _by_chunks(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """``function`` (m,) of points (m, d), so many at a time; of one that is there m times, once."""
    if points.strides[0] == 0:
        return np.broadcast_to(function(points[:1]), len(points))
    return np.concatenate([function(points[k : k + CHUNK]) for k in range(0, len(points), CHUNK)] or [np.zeros(0)])


def touched(surface: Surface, points: np.ndarray) -> np.ndarray:
    """True (m,) for points on ``surface`` to round-off."""
    geometry, within = Geometry(surface, points.shape[1]), ON * _extent(points)

    def on(some: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return (_distance(geometry, some) <= within) & geometry.belongs(some)

    return _by_chunks(on, points).astype(bool)


def away(surface: Surface, points: np.ndarray) -> np.ndarray:
    """The distance (m,) of points from ``surface``, to first order; not a number where its level is none."""
    return _distance(Geometry(surface, points.shape[1]), points)


def _distance(geometry: Geometry, points: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        return np.abs(geometry.level(points)) / np.linalg.norm(geometry.gradient(points), axis=1)


def in_row(which: np.ndarray) -> str:
    """Where the first of the rows is, for a message; nothing where there is only one."""
    return f" in row {int(np.argmax(which))}" if len(which) > 1 else ""
