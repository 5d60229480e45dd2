"""Directions of space on the six faces of a cube about them: a lattice that may be halved again and again.

A direction has the number of its face and two whole coordinates, so that what is common to neighbours is the same to
the last bit. The lattice is even in the angles at the middle of a face (Ronchi, Iacono and Paolucci, J. Comput. Phys.
124 (1996) 93): cells at the corners are smaller by less than a third.
"""

from __future__ import annotations

import numpy as np

SIDE = 2**44
"""Steps of the lattice along one side of a face."""
STEP = np.pi / 2 / SIDE
"""One of them, at the middle of a face, in radians."""
TILT = np.linalg.qr(np.array([[1.0, 0.31, 0.17], [-0.23, 1.0, 0.41], [-0.13, -0.37, 1.0]]))[0]
"""How the cube stands: off the axes, on which many a scene has its symmetry."""
FACES = np.stack([sign * np.roll(np.eye(3), turn, axis=0) for sign in (1.0, -1.0) for turn in range(3)]) @ TILT
"""For each face its outward normal and its two axes, (6, 3, 3)."""


def headings(face: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (m, 3) at the ``place`` (m, 2) on each ``face`` (m,), and their derivatives (m, 2, 3) by it."""
    slope = np.tan((place - SIDE / 2) * STEP)
    of = FACES[face]
    outward = of[:, 0] + np.einsum("mk,mkd->md", slope, of[:, 1:])
    length = np.linalg.norm(outward, axis=1)[:, None]
    heading = outward / length
    rates = (STEP * (1 + slope**2) / length)[:, :, None] * of[:, 1:]
    return heading, rates - np.einsum("mkd,md->mk", rates, heading)[:, :, None] * heading[:, None, :]


def placed(heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The face (m,) and the place (m, 2) there of unit vectors (m, 3)."""
    along = heading @ FACES[:, 0].T
    face = np.argmax(along, axis=1)
    across = np.einsum("md,mkd->mk", heading, FACES[face, 1:])
    slope = across / along[np.arange(len(face)), face][:, None]
    return face, np.arctan(slope) / STEP + SIDE / 2
