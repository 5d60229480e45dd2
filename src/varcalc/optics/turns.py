"""How many times the neighbours of rays cross them, for many rays at once."""

from __future__ import annotations

import numpy as np

from varcalc.optics.beam import Beam
from varcalc.optics.march import March
from varcalc.optics.straight import StraightRays
from varcalc.optics.strides import stride

FLAT = 1e-5
"""An offset so small beside that in a uniform medium, at the end of a ray on a caustic, is none."""
MOST_STEPS = 4000
"""Steps along one leg."""


def conjugate_points(
    march: March, beam: Beam, path: np.ndarray, across: np.ndarray, flat: np.ndarray
) -> tuple[np.ndarray, Beam, np.ndarray]:
    """The numbers (m,) of conjugate points of the rays of ``beam``, at their sources, and the rays at their ends.

    These are at the optical path ``path`` (m,), in the last medium; where ``flat`` (m,) they are conjugate points
    themselves, which do not count. ``across`` (m, d - 1, d) are the unit vectors along which each ray's neighbours
    start: one in the plane that all of the ray lies in, the other at right angles to it. Each neighbour then crosses
    the ray on its own account, where its distance from it, with its sign, changes that sign; at a surface both may
    change it together. Last comes True (m,) for rays that meet the surfaces of the scene in order, and no more.
    """
    count, clear = np.zeros(len(beam), dtype=int), np.ones(len(beam), dtype=bool)
    for number, before, after, sound in march.parts(beam, path):
        ends = _offsets(after, across)
        if number == len(march.models) - 1:
            ends[flat[:, None] & (np.abs(ends) <= FLAT * path[:, None])] = 0.0
        count += _on_leg(march, number, before, after, ends, across)
        clear &= sound
        beam = after
    return count, beam, clear


def _on_leg(march: March, number: int, beam: Beam, after: Beam, ends: np.ndarray, across: np.ndarray) -> np.ndarray:
    """The numbers (m,) of crossings in medium ``number``, from ``beam`` to ``after`` with the offsets ``ends``."""
    if isinstance(march.models[number], StraightRays):
        return _crossings(_offsets(beam, across), ends)
    return _along(march, number, beam, after, ends, across)


def _along(march: March, number: int, beam: Beam, after: Beam, ends: np.ndarray, across: np.ndarray) -> np.ndarray:
    """The numbers (m,) of crossings in the graded medium ``number``, from ``beam`` to ``after``."""
    count, rows = np.zeros(len(beam), dtype=int), np.arange(len(beam))
    before = _offsets(beam, across)
    for _ in range(MOST_STEPS):
        left = after.optical_path[rows] - beam.optical_path
        momentum = np.linalg.norm(beam.momentum, axis=1)
        step = stride(beam, march.fields[number], left / np.maximum(momentum, np.finfo(float).tiny))
        last = step * momentum**2 >= left
        moved = march.models[number].onward(beam, step, beam.optical_path + step * momentum**2)[0]
        last |= ~(moved.optical_path < after.optical_path[rows])
        now = np.where(last[:, None], ends[rows], _offsets(moved, across[rows]))
        count[rows] += _crossings(before, now)
        keep = np.flatnonzero(~last)
        if len(keep) == 0:
            break
        rows, beam, before = rows[keep], moved.take(keep), now[keep]
    return count


def _offsets(beam: Beam, across: np.ndarray) -> np.ndarray:
    """The distances (m, d - 1) of neighbours from their rays, with signs."""
    if beam.dimension == 2:
        p, moved = beam.momentum, beam.moved[:, 0]
        return (p[:, 0] * moved[:, 1] - p[:, 1] * moved[:, 0])[:, None]
    normal = across[:, 1]
    in_plane = np.sum(np.cross(normal, beam.momentum) * beam.moved[:, 0], axis=1)
    return np.stack([in_plane, np.sum(normal * beam.moved[:, 1], axis=1)], axis=1)


def _crossings(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How many of the offsets (m, d - 1) have changed their signs; those that start from a point have none yet."""
    return np.sum(before * after < 0, axis=1)
