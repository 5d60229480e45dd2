"""Where light comes from: a point, or a plane wave; and the rays that leave it, with their neighbours."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.optics.media.medium import Field
from varcalc.optics.rays.beam import Beam, frames, launched
from varcalc.optics.validation import direction, numbers, point, unit_rows
from varcalc.problem.conditions import whole
from varcalc.showing import Brief
from varcalc.spelling import spelled


class Source(ABC):
    """A source of a wave: its rays leave at right angles to its first wavefront."""

    @property
    @abstractmethod
    def dimension(self) -> int:
        """2 or 3."""

    @abstractmethod
    def starts(self, rays: Any) -> tuple[np.ndarray, np.ndarray]:
        """Where the ``rays`` start and their unit directions, both (m, d)."""

    @abstractmethod
    def beam(self, field: Field, points: np.ndarray, directions: np.ndarray) -> Beam:
        """The rays with d - 1 neighbours of the same wave, in the medium of ``field``."""


@spelled
@dataclass(frozen=True, repr=False)
class PointSource(Brief, Source):
    """A point from which rays leave in all directions.

    Rays are named by their directions, an array (m, d) of vectors of any length; or by their number, which spreads
    them evenly over the circle or the sphere.

    Parameters
    ----------
    point : sequence of float
    """

    point: Sequence[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", point("point", self.point))

    @property
    def dimension(self) -> int:
        """That of the point."""
        return len(self.point)

    def starts(self, rays: Any) -> tuple[np.ndarray, np.ndarray]:
        """The point (m times), and the directions."""
        if isinstance(rays, int | np.integer) and not isinstance(rays, bool):
            headings = spread(whole("rays", rays), self.dimension)
        else:
            headings = unit_rows("rays", rays, self.dimension)
        return np.tile(self.point, (len(headings), 1)), headings

    def beam(self, field: Field, points: np.ndarray, directions: np.ndarray) -> Beam:
        """Rays whose neighbours leave the same point, one radian of direction away."""
        return launched(points, directions, field.index(points), neighbours=True)


@spelled
@dataclass(frozen=True, repr=False)
class PlaneWave(Brief, Source):
    """A wave whose phase is the same on a plane, which its rays leave at right angles.

    Rays are named by their offsets from ``point`` in that plane (a straight line, in the plane): an array (m,) in the
    plane, to the left of ``direction``; (m, 2) in space, along two axes at right angles to it.

    Raises TypeError or ValueError for what are no point and direction of as many coordinates.

    Parameters
    ----------
    point, direction : sequence of float
        A point of the plane, and the direction in which the wave goes.
    """

    point: Sequence[float]
    direction: Sequence[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", point("point", self.point))
        object.__setattr__(self, "direction", direction("direction", self.direction))
        if len(self.point) != len(self.direction):
            raise ValueError(
                f"point has {len(self.point)} coordinates and direction {len(self.direction)}; give both 2 or both 3"
            )

    @property
    def dimension(self) -> int:
        """That of the point."""
        return len(self.point)

    @property
    def axes(self) -> np.ndarray:
        """The unit vectors (d - 1, d) along which offsets are measured."""
        return frames(np.array([self.direction]))[0]

    def starts(self, rays: Any) -> tuple[np.ndarray, np.ndarray]:
        """Points of the plane, and the direction (m times)."""
        offsets = numbers("rays", rays)
        if self.dimension == 2:
            offsets = np.atleast_1d(offsets)[..., None]
        if offsets.ndim != 2 or offsets.shape[1] != self.dimension - 1:
            shape = "(m,), numbers" if self.dimension == 2 else "(m, 2), pairs of numbers"
            raise ValueError(f"rays of a plane wave are named by their offsets, of shape {shape}, not {rays!r}")
        return np.array(self.point) + offsets @ self.axes, np.tile(self.direction, (len(offsets), 1))

    def beam(self, field: Field, points: np.ndarray, directions: np.ndarray) -> Beam:
        """Rays whose neighbours leave the same plane, one unit of length away."""
        across = frames(directions)
        squared, gradient, _ = field(points)
        index = np.sqrt(squared)
        change = np.einsum("mkd,md->mk", across, gradient) / (2 * index[:, None])  # of n, from ray to neighbour
        return Beam(
            position=np.array(points),
            momentum=index[:, None] * directions,
            optical_path=np.zeros(len(points)),
            moved=across,
            turned=change[:, :, None] * directions[:, None, :],
        )


def spread(count: int, dimension: int) -> np.ndarray:
    """``count`` directions (count, d), evenly spread over the circle, or over the sphere by the golden angle."""
    turn = np.arange(count)
    if dimension == 2:
        angle = 2 * np.pi * turn / count
        return np.column_stack([np.cos(angle), np.sin(angle)])
    height = 1 - (2 * turn + 1) / count  # Swinbank, Purser, "Fibonacci grids", Q. J. R. Meteorol. Soc. 132 (2006)
    angle = np.pi * (1 + np.sqrt(5)) * (turn + 0.5)
    across = np.sqrt(1 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
