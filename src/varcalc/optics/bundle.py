"""What a trace gives back."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from varcalc.optics.beam import RayStatus


@dataclass(frozen=True)
class Bundle:
    """The ends of m rays in d dimensions, one row a ray.

    Attributes
    ----------
    points, directions : ndarray, shape (m, d)
        Where each ray ended, and the unit vector it was heading along.
    optical_path : ndarray, shape (m,)
        ∫ n ds from the start, in units of length.
    status : ndarray of int, shape (m,)
        Members of :class:`RayStatus`; the numbers of a ray that did not arrive are those of the last place known.
    spreading : ndarray, shape (m,), or None
        ``|dr⊥/dθ|`` in the plane, ``|dA/dΩ|`` in space, where it was asked for.
    model : str
        The models that carried the rays.
    """

    points: np.ndarray
    directions: np.ndarray
    optical_path: np.ndarray
    status: np.ndarray
    spreading: np.ndarray | None
    model: str

    def __len__(self) -> int:
        return len(self.points)

    @property
    def arrived(self) -> np.ndarray:
        """True (m,) for the rays that ended where they were to end."""
        return self.status == RayStatus.ARRIVED

    def __str__(self) -> str:
        counts = Counter(RayStatus(int(code)) for code in self.status)
        return "\n".join(f"{counts[status]} rays: {status.message}" for status in RayStatus if counts[status])
