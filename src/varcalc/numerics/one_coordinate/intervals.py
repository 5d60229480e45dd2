"""How far motions along one coordinate can go: to a turning point, to a surface, or to the end of the index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, NoTurn, OneTurn, TwoTurns
from varcalc.numerics.one_coordinate.potential import Potential, PotentialNodes, PotentialValues

ROWS = 2048
"""ReducedRays looked at together; bounds the memory."""


@dataclass(frozen=True)
class MotionBounds:
    """What bounds m motions on one side: ``x`` (m,) from their starts, and whether that is a turning point."""

    x: np.ndarray
    turning: np.ndarray


def bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: int,
) -> MotionBounds:
    """The bounds above (``sign`` 1) or below (-1) of motions from ``u0`` (m,) with w² = ``squared`` = g - C (m,).

    ``wall`` (m,) is the distance of the nearest surface there, infinite where there is none.
    """
    parts = [
        _bounds(potential, nodes, u0[k : k + ROWS], squared[k : k + ROWS], C[k : k + ROWS], wall[k : k + ROWS], sign)
        for k in range(0, len(u0), ROWS)
    ]
    return MotionBounds(np.concatenate([p.x for p in parts]), np.concatenate([p.turning for p in parts]))


def _bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: int,
) -> MotionBounds:
    u, g = nodes.u[::sign], nodes.g[::sign]
    rows = np.arange(len(u0))
    start, slope = potential.at(u0)
    away = sign * (u - u0[:, None])
    left = PotentialValues(g, g, g - start[:, None], g).above(C[:, None], squared[:, None])
    stopped = (away > 0) & (left <= 0)
    found = np.any(stopped, axis=1)
    first = np.argmax(stopped, axis=1)
    before = np.maximum(away[rows, np.maximum(first - 1, 0)], 0.0)
    before = np.where(first > 0, before, 0.0)
    at_once = (squared == 0) & (sign * slope < 0)
    looked_for = np.flatnonzero(found & ~at_once & (before < wall))
    x = np.maximum(away[:, -1], 0.0)
    low, high = sign * before[looked_for], sign * away[looked_for, first[looked_for]]
    x[looked_for] = sign * potential.zero(u0[looked_for], squared[looked_for], C[looked_for], low, high)
    x[at_once] = 0.0
    turning = (found | at_once) & (x < wall)
    return MotionBounds(sign * np.where(turning, x, np.minimum(x, wall)), turning)


def ways(
    potential: Potential, u0: np.ndarray, w0: np.ndarray, below: MotionBounds, above: MotionBounds
) -> list[tuple[np.ndarray, CoordinateMotion, np.ndarray]]:
    """The motions by kind: rows, way, and the last parameter (of the rows) on it."""
    out = []
    both = below.turning & above.turning
    rows = np.flatnonzero(both & (above.x > below.x))
    if len(rows):
        down, up = -below.x[rows], above.x[rows]
        start = 2 * np.arctan2(np.sqrt(down), np.sqrt(up))
        start = np.where(w0[rows] < 0, -start, start)
        way = TwoTurns(potential, start, u0[rows] - down, u0[rows] + up, down + up)
        out.append((rows, way, np.full(len(rows), np.inf)))
    for sign, here, other in ((1, below, above), (-1, above, below)):
        rows = np.flatnonzero(here.turning & ~both)
        if len(rows):
            offset = -here.x[rows]
            start = sign * np.where(w0[rows] < 0, -1.0, 1.0) * np.sqrt(np.abs(offset))
            way = OneTurn(potential, start, u0[rows] - offset, offset, np.full(len(rows), float(sign)))
            out.append((rows, way, way.reaching(other.x[rows])))
    rows = np.flatnonzero(~below.turning & ~above.turning & (w0 != 0))
    if len(rows):
        sign = np.where(w0[rows] < 0, -1.0, 1.0)
        way = NoTurn(potential, np.zeros(len(rows)), u0[rows], w0[rows] ** 2, sign)
        out.append((rows, way, way.reaching(np.where(sign > 0, above.x[rows], below.x[rows]))))
    return out
