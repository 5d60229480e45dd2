"""How far rays of layers and centres come between two heights: three passages.

S goes from the start to the end, U from there to where a ray turns back beyond, D from the start to where it turns
behind. They are functions of the angle at the end with the smaller g: seen from there the other is never a turning
point (rays can be gone along backwards).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.numerics.one_coordinate.motions import (
    CoordinateMotion,
    NoTurn,
    OneTurn,
    TwoTurns,
    bounds,
    ways,
)
from varcalc.numerics.one_coordinate.quadrature import AGREED, TAU, integrals
from varcalc.optics.models.between_stops import passages_between_stops
from varcalc.optics.models.height_pairs import COUNT, LAYERS, HeightPairs
from varcalc.optics.models.reduction import PATH

AIMED, CLOSEST = 1e-6, 1e-9
"""Rays aimed at a centre, in radians, to within which optical paths, and angles about it, are told by their like."""
AT_A_TURN = 1e-13
"""Of the difference of two heights: so close to a turning point one is at it."""
CLOSE_BY = 0.1
"""Of the difference of two heights: farther beyond the end, a turning point is told as well from the start."""
TOGETHER = 2048
"""Angles whose passages are integrated together; bounds the memory."""


@dataclass(frozen=True)
class RayPassages(HeightPairs):
    """Rays of p pairs from the heights ``start`` (p,) to the heights ``end`` of ``profile``, g smaller at the start.

    They go no higher than ``high`` (p,) and no deeper than ``low`` (p,).
    """

    def at(self, pair: np.ndarray, angles: np.ndarray, wanted: np.ndarray | None = None) -> np.ndarray:
        """S, U, D and their optical paths (m, 6) of pairs (m,) at angles (m,) from 0 to π/2.

        They are not numbers where they do not exist or are not ``wanted`` (m, 3), and -∞ where they are not resolved.
        """
        wanted = np.ones((len(angles), LAYERS), dtype=bool) if wanted is None else wanted
        aimed = self.aimed(angles)
        own = wanted & ~np.isin(np.arange(len(angles)), aimed)[:, None]
        out = self.integrated(pair, angles, own)
        if len(aimed):
            three = self.integrated(*past_centre(pair[aimed], angles[aimed]), np.repeat(wanted[aimed], 3, axis=0))
            out[aimed] = self.of_past_centre(pair[aimed], angles[aimed], three)
        return out

    def integrated(self, pair: np.ndarray, angles: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """See :meth:`at`, of rays that are not aimed at a centre."""
        out = np.full((len(angles), COUNT), np.nan)
        agreed = np.maximum(self.noise(pair, angles)[:, :LAYERS], AGREED)
        for first in range(0, len(angles), TOGETHER):
            some = slice(first, first + TOGETHER)
            self._write(pair[some], angles[some], agreed[some], wanted[some], out[some])
        return out

    def of_past_centre(self, pair: np.ndarray, angles: np.ndarray, three: np.ndarray) -> np.ndarray:
        """What the rays of :func:`past_centre` (3m, 6) say of those at ``angles`` (m,) aimed at it: (m, 6).

        Those through a centre with an index turn by a quarter on either side of it, however n² varies beside it;
        where it is dark or singular that is told by rays past it, as straight on. From one ray to another optical paths
        change by the index times its sine for each angle about the centre.
        """
        beside, near = np.pi / 2 - angles, _past(angles)
        close, first, second = np.moveaxis(three.reshape(-1, 3, COUNT), 1, 0)
        through = 2 * first - second
        if 0 < self.profile.index_at_centre < np.inf:
            inwards = np.where(self.way[pair] > 0, 2, 1)  # of S, U and D the one that comes to the centre
            through[:, :LAYERS] = np.where(np.arange(LAYERS) == inwards[:, None], np.pi / 2, through[:, :LAYERS])
        out = through + (close - through) * (beside / near)[:, None]
        sine = np.sqrt(self.g[pair]) * (beside + AIMED) / 2
        out[:, LAYERS:] = first[:, LAYERS:] + sine[:, None] * (out - first)[:, :LAYERS]
        return out

    def aimed(self, angles: np.ndarray) -> np.ndarray:
        """Which of the rays at ``angles`` (m,) are aimed at the centre, all but for round-off."""
        return np.flatnonzero((np.pi / 2 - angles < AIMED) & self.profile.about_centre)

    def at_least(self, pair: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """What S is, and U and D are no less than (m, 6), told without their turning points.

        Beyond a kink a ray that is all but level turns within round-off of it. U and D are gone half the way to where
        they turn. Not numbers where there is no telling even so.
        """
        u0, to, root = self.start[pair], self.way[pair], np.sqrt(self.g[pair])
        c, squared = root * np.cos(angles), (root * np.sin(angles)) ** 2
        there, last = self.end[pair], squared + self.higher[pair]
        starts, speeds, ways_ = (u0, there, u0), (squared, last, squared), (to, to, -to)
        free, zero = np.full(len(angles), np.inf), np.zeros(len(angles))
        out = np.full((len(angles), COUNT), np.nan)
        for k, (u, w, way) in enumerate(zip(starts, speeds, ways_, strict=True)):
            if k == 0:
                far = np.abs(there - u0)
            else:
                far = np.abs(bounds(self.profile, self.nodes, u, w, c**2, free, way).x) / 2
            part = np.flatnonzero(np.isfinite(far) & (far >= 0))
            straight = NoTurn(self.profile, zero, u, w, way, c**2).take(part)
            with np.errstate(all="ignore"):
                sums = integrals(straight, zero[part], far[part])
            out[part, k], out[part, LAYERS + k] = c[part] * sums[:, TAU], sums[:, PATH]
        return out

    def _write(
        self, pair: np.ndarray, angles: np.ndarray, agreed: np.ndarray, wanted: np.ndarray, out: np.ndarray
    ) -> None:
        u0, to, root = self.start[pair], self.way[pair], np.sqrt(self.g[pair])
        c, w = root * np.cos(angles), root * np.sin(angles)
        there, last = self.end[pair], w**2 + self.higher[pair]
        u, squared, sign = np.concatenate([u0, u0, there]), np.concatenate([w**2, w**2, last]), np.full_like(to, -1.0)
        free, m = np.full(len(u), np.inf), len(angles)
        found = bounds(self.profile, self.nodes, u, squared, np.tile(c**2, 3), free, np.concatenate([sign, -sign, to]))
        below, above, turned = (found.take(slice(k * m, (k + 1) * m)) for k in range(3))
        beyond, turns = np.abs(turned.x), [np.where(to > 0, below.turning, above.turning), turned.turning]
        x = there - u0
        # how far beyond an end close by rays turn is told from there: both ends may be turning points, all but for
        # round-off; elsewhere from the start, so that a turning point that is not well known is one and the same
        ahead = np.where(to > 0, above.x - x, x - below.x)
        beyond = np.where(ahead > CLOSE_BY * np.abs(x), ahead, beyond)
        jumps = [np.where(to > 0, *sides) for sides in ((above.jump, below.jump), (below.jump, above.jump))]
        room = AT_A_TURN * np.abs(x)
        out[np.ix_(x == 0, [0, LAYERS])] = 0.0
        # where no turning point is near S, its ends are told better by their heights than on that motion
        away = np.where(turns, [np.where(to > 0, -below.x, above.x), beyond], np.inf)
        far = (away.min(axis=0) > np.abs(x)) & (x != 0)
        straight, moves = NoTurn(self.profile, np.zeros_like(x), u0, w**2, to, c**2), np.zeros(len(x), dtype=bool)
        with np.errstate(all="ignore"):  # where there is no passage, or it is not resolved, there is no number
            reaches = (below.x <= x + room) & (x - room <= above.x)
            asked = reaches[:, None] & wanted
            shared = asked & ~(far[:, None] & (np.arange(LAYERS) == 0))
            for rows, way, _ in ways(self.profile, u0, to * w, below, above):
                moves[rows] = True
                legs = _legs(way, to[rows], np.abs(x[rows]), beyond[rows], [jump[rows] for jump in jumps])
                ends = np.moveaxis(np.array(legs), 0, -1)
                which, k = np.nonzero(shared[rows] & np.all(np.isfinite(ends), axis=0))
                self._sum(out, rows[which], k, way.take(which), c, ends[:, which, k], agreed)
            alone = np.flatnonzero(asked[:, 0] & far & moves)
            ends = np.array([np.zeros(len(alone)), np.abs(x[alone])])
            self._sum(out, alone, np.zeros_like(alone), straight.take(alone), c, ends, agreed)

    def _sum(
        self,
        out: np.ndarray,
        rows: np.ndarray,
        k: np.ndarray,
        motion: CoordinateMotion,
        c: np.ndarray,
        ends: np.ndarray,
        agreed: np.ndarray,
    ) -> None:
        """Write down S, U or D, as ``k`` (n,) says, of ``rows`` (n,) on motions between ``ends`` (2, n)."""
        sums = self._along(motion, c[rows] ** 2, ends[0], ends[1], agreed[rows, k])
        known = np.isfinite(sums[:, TAU]) & np.isfinite(sums[:, PATH])
        out[rows, k] = np.where(known, c[rows] * sums[:, TAU], -np.inf)
        out[rows, LAYERS + k] = np.where(known, sums[:, PATH], -np.inf)

    def _along(
        self, motion: CoordinateMotion, C: np.ndarray, low: np.ndarray, high: np.ndarray, agreed: np.ndarray
    ) -> np.ndarray:
        """τ and the optical paths on motions, and what else is integrated with them."""
        if len(self.profile.stops):  # between these g is smooth
            return passages_between_stops(self.profile, motion, C, low, high, agreed)
        return integrals(motion, low, high, agreed=agreed)


def _legs(
    way: CoordinateMotion, to: np.ndarray, x: np.ndarray, beyond: np.ndarray, jumps: Sequence[np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """From where to where S, U and D go, in the parameter of a way; not numbers where they do not exist.

    The end is ``x`` (m,) from the start, on the side ``to``, and ``beyond`` (m,) before its turning point. At the
    ``jumps`` (m,), one beyond the end and one behind the start, motions are thrown back; not numbers for none.
    """
    start, zero = way.start, np.zeros(len(way.start))
    if isinstance(way, TwoTurns):
        return _legs_between_turns(way, to > 0, x, beyond)
    front, back = (way.height(jump[:, None])[:, 0] for jump in jumps)
    if isinstance(way, NoTurn):
        return [(zero, x), (x, front), (back, zero)]
    assert isinstance(way, OneTurn)
    ahead = way.sign != to
    q = np.where(x == 0, start, np.where(ahead, -np.sqrt(beyond), np.sqrt(start**2 + x)))
    return [(start, q), (q, np.where(ahead, zero, front)), (np.where(ahead, -back, zero), start)]


def _legs_between_turns(
    way: TwoTurns, up: np.ndarray, x: np.ndarray, beyond: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The same where motions go to and fro between two turning points; the end is above the start where ``up`` (m,)."""
    start = way.start
    behind = way.span * np.where(up, np.sin(start / 2), np.cos(start / 2)) ** 2  # as precise as the start
    far, near = np.where(up, behind + x, beyond), np.where(up, beyond, behind + x)
    begin = np.abs(start)
    q = np.where(x == 0, begin, 2 * np.arctan2(np.sqrt(far), np.sqrt(near)))
    bottom, top = np.zeros(len(start)), np.full(len(start), np.pi)
    legs = [((begin, q), (q, begin)), ((q, top), (bottom, q)), ((bottom, begin), (begin, top))]
    return [(np.where(up, a, c), np.where(up, b, d)) for (a, b), (c, d) in legs]


def past_centre(pair: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Three rays past the centre for every one of the pairs (m,) at ``angles`` (m,): pairs and angles (3m,)."""
    beside = np.column_stack([_past(angles), np.full(len(angles), AIMED), np.full(len(angles), 2 * AIMED)])
    return np.repeat(pair, 3), np.pi / 2 - beside.ravel()


def _past(angles: np.ndarray) -> np.ndarray:
    """How far past the centre rays at ``angles`` (m,) are aimed, or those closest to it of which this is told."""
    return np.maximum(np.pi / 2 - angles, CLOSEST)
