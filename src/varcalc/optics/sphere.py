"""Rays to a point in space, where no plane is known to hold them: Newton's iteration from many directions.

At its least distance from B a ray misses it by a vector across the ray, and
the neighbours' deviations are the derivative of that vector by the launching
direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from varcalc.optics.beam import Beam, frames
from varcalc.optics.sources import spread

DIRECTIONS = 1500
"""Directions looked at, 0.09 apart."""
NEIGHBOURS = 6
"""Nearest directions among which a miss is to be the least for Newton's iteration to begin there."""
ROUNDS = 30
"""Newton's steps."""
LONGEST = 0.2
"""The longest of them, in radians."""
MET = 4e-13
"""A ray that comes this close to B, relative to the scene, meets it."""
SAME = 1e-8
"""Directions and optical paths, relative, closer than this are one ray."""

Fan = Callable[[np.ndarray], tuple[np.ndarray, Beam]]
"""Takes directions (m, 3) to the rows of those that pass B and the rays at their passes."""


@dataclass(frozen=True)
class Found:
    """The launching directions (k, 3) and optical paths (k,) of rays that meet B; ``looked_at`` counts directions."""

    directions: np.ndarray
    paths: np.ndarray
    looked_at: int


def search(fan: Fan, target: np.ndarray, size: float) -> Found:
    """Rays to ``target`` (3,), each polished; one whose neighbourhood is finer than the net may be missed."""
    net = spread(DIRECTIONS, 3)
    headings, paths = _starts(fan, net, target)
    misses = np.full(len(headings), np.inf)
    count = len(net)
    for _ in range(ROUNDS):
        if len(headings) == 0:
            break
        headings, paths, misses, steps = _newton(fan, headings, paths, target)
        count += len(headings)
        if np.all(misses <= MET * size):
            break
        going = (misses > MET * size) & np.isfinite(misses)
        headings[going] += steps[going]
        headings /= np.linalg.norm(headings, axis=1)[:, None]
    kept: list[int] = []
    for k in np.argsort(paths):
        alike = [np.linalg.norm(headings[k] - headings[j]) + abs(paths[k] / paths[j] - 1) < SAME for j in kept]
        if misses[k] <= MET * size and not any(alike):
            kept.append(int(k))
    return Found(headings[kept], paths[kept], count)


def _starts(fan: Fan, net: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions and optical paths of the passes that come closer than those of the neighbouring directions."""
    rows, beam = fan(net)
    order = np.lexsort((beam.optical_path, rows))
    rows, paths = rows[order], beam.optical_path[order]
    misses = np.linalg.norm(beam.position[order] - target, axis=1)
    turn = np.arange(len(rows)) - np.searchsorted(rows, rows)  # the first pass of a ray, the second, ...
    starts = []
    near = np.argsort(-net @ net.T, axis=1)[:, 1 : NEIGHBOURS + 1]
    for k in range(int(turn.max(initial=-1)) + 1):
        of = np.full(len(net), np.inf)
        of[rows[turn == k]] = misses[turn == k]
        starts += [int(i) for i in np.flatnonzero((turn == k) & (of[rows] <= of[near[rows]].min(axis=1)))]
    return net[rows[starts]].copy(), paths[starts].copy()


def _newton(
    fan: Fan, headings: np.ndarray, paths: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same headings with the optical paths, misses and steps (k, 3) of the passes nearest to ``paths`` (k,)."""
    rows, beam = fan(headings)
    new, misses, steps = paths.copy(), np.full(len(headings), np.inf), np.zeros_like(headings)
    across = frames(headings)
    for k in range(len(headings)):
        own = np.flatnonzero(rows == k)
        if len(own) == 0:
            continue
        at = own[np.argmin(np.abs(beam.optical_path[own] - paths[k]))]
        tangent = beam.momentum[at] / np.linalg.norm(beam.momentum[at])
        screen = frames(tangent[None, :])[0]
        offset, by_heading = screen @ (beam.position[at] - target), screen @ beam.moved[at].T
        turn = -np.linalg.lstsq(by_heading, offset, rcond=None)[0]
        turn *= min(1.0, LONGEST / max(float(np.linalg.norm(turn)), LONGEST))
        new[k], misses[k], steps[k] = (
            beam.optical_path[at],
            np.linalg.norm(beam.position[at] - target),
            turn @ across[k],
        )
    return headings, new, misses, steps
