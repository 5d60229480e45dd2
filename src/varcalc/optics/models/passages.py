"""How far rays of layers and centres come between two heights: three passages.

S goes from the start to the end, U from there to where a ray turns back beyond, D from the start to where it turns
behind. They are functions of the angle at the end with the smaller g: seen from there the other is never a turning
point (rays can be gone along backwards).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import (
    OTHER_SIDE,
    CoordinateMotion,
    NoTurn,
    OneTurn,
    TwoTurns,
    bounds,
    ways,
)
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import AGREED, TAU, integrals
from varcalc.optics.models.between_stops import passages_between_stops
from varcalc.optics.models.reduction import PATH, RayPotential

ROOM = 8
"""Parts of a range to which it is rounded outwards."""
AIMED, CLOSEST = 1e-6, 1e-9
"""Rays aimed at a centre, in radians, to within which optical paths, and angles about it, are told by their like."""
AT_A_TURN = 1e-13
"""Of the difference of two heights: so close to a turning point one is at it."""
SAME_MINIMUM = 1e-15
"""Of g: minima that differ by less are one."""
ALIKE = 64 * float(np.finfo(float).eps)
"""Of how much g varies: minima of so nearly one height are one, for g is not told much better over them all."""
CLOSE_BY = 0.1
"""Of the difference of two heights: farther beyond the end, a turning point is told as well from the start."""
DARK = 1e-6
"""Of g: where it is less, upright rays turn at an index that is all but nothing."""
STAYS_LEVEL = 1e-15
"""Of g: where it changes by less over the distance, a ray that starts level stays so."""
EPSILON = 2 * float(np.finfo(float).eps)
"""Round-off of g and of angles, relatively."""
TOGETHER = 2048
"""Angles whose passages are integrated together; bounds the memory."""
LAYERS, COUNT = 3, 6
"""RayPassages S, U and D: how far they come along the layers, and together with their optical paths."""


def outwards(low: np.ndarray, high: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ranges, rounded outwards to parts of a ``size``: those that are nearly the same are one, and share tables."""
    with np.errstate(all="ignore"):
        step = 2.0 ** np.ceil(np.log2(size)) / ROOM
        least, most = np.floor(low / step) * step, np.ceil(high / step) * step
    return np.where(np.isfinite(least), least, low), np.where(np.isfinite(most), most, high)


@dataclass(frozen=True)
class RayPassages:
    """Rays of p pairs from the heights ``start`` (p,) to the heights ``end`` of ``profile``, g smaller at the start.

    They go no higher than ``high`` (p,) and no deeper than ``low`` (p,).
    """

    profile: RayPotential
    nodes: PotentialNodes
    start: np.ndarray
    end: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def between(cls, profile: RayPotential, ends: np.ndarray, within: np.ndarray) -> tuple[RayPassages, np.ndarray]:
        """The rays between heights (p, 2) up to optical paths (p,), and which pairs (p,) start from the second."""
        g = profile.at(ends)[0]
        swapped = g[:, 1] < g[:, 0]
        start, end = np.where(swapped, *ends.T[::-1]), np.where(swapped, *ends.T)
        lower, upper = ends.min(axis=1), ends.max(axis=1)
        with np.errstate(all="ignore"):
            size = within / np.sqrt(g.max(axis=1))
        reach = profile.distances(lower, upper, size)[:, -1]
        free = np.full(len(ends), np.inf)
        low = np.maximum(profile.farthest(lower, -1, within, free), lower - reach)
        high = np.minimum(profile.farthest(upper, 1, within, free), upper + reach)
        low, high = outwards(low, low, lower - low)[0], outwards(high, high, high - upper)[1]
        return cls(profile, profile.nodes(lower, upper, low, high, size), start, end, low, high), swapped

    @cached_property
    def way(self) -> np.ndarray:
        """1.0 (p,) where the end is above the start, or as high, -1.0 where it is below."""
        return np.where(self.end >= self.start, 1.0, -1.0)

    @cached_property
    def g(self) -> np.ndarray:
        """g (p,) at the start."""
        return self.profile.at(self.start)[0]

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

    @cached_property
    def higher(self) -> np.ndarray:
        """How much larger g is at the end (p,)."""
        return np.maximum(self.profile(self.start, self.end - self.start).gain, 0.0)

    @cached_property
    def rounded(self) -> np.ndarray:
        """How well the angles of the breaks are known in comparison with others (p, b), 0 where nothing is lost.

        What is known to round-off is the largest change of g that adds up to that at a break.
        """
        with np.errstate(all="ignore"):
            known = EPSILON * np.maximum(self.breaks**2, np.minimum(self._variation[0], 1.0)[:, None]) / self.breaks
        return np.where(self._inner.any(axis=2), known, 0.0)

    @cached_property
    def _variation(self) -> tuple[np.ndarray, np.ndarray]:
        """How much g varies (p,), and its least value (p,), in units of that at the start."""
        sides = np.column_stack([self.low, np.nextafter(self.high, np.inf)])
        slices, finite = np.searchsorted(self.nodes.u, sides).ravel(), np.abs(self.nodes.g) < np.inf
        own = [np.append(np.where(finite, self.nodes.g, none), none) for none in (np.inf, -np.inf)]
        least, most = (f.reduceat(g, slices)[::2] for f, g in zip((np.minimum, np.maximum), own, strict=True))
        varies = most - least
        return varies / self.g, least / self.g

    @cached_property
    def _inner(self) -> np.ndarray:
        """At which of the breaks which of S, U and D (p, b, 3) lose digits.

        Those do at whose end rays come to rest, and all of upright ones at an index of 0.
        """
        number, last = np.arange(self.breaks.shape[1]), self.count[:, None] - 1
        dark = (number == last) & (self._variation[1] <= DARK)[:, None]
        rests = (number > 0) & (number < last) & ~self.mild
        return (rests[..., None] & self._broken[2]) | dark[..., None]

    def noise(self, pair: np.ndarray, angles: np.ndarray, plain: np.ndarray | None = None) -> np.ndarray:
        """What round-off makes of S, U and D and their optical paths (m, 6) of pairs (m,) at angles (m,), relatively.

        It is much beside a break at which they come to rest; not so beside upright rays of those that are ``plain``
        (m,) there.
        """
        if not np.any(self._inner):
            return np.zeros((len(angles), COUNT))
        worst = np.zeros((len(angles), LAYERS))
        for k in np.flatnonzero(self._inner.any(axis=(0, 2))):
            lost = self._inner[pair, k]
            if plain is not None:
                lost &= ~(plain & (k == self.count[pair] - 1))[:, None]
            with np.errstate(all="ignore"):
                beside = self.rounded[pair, k] / np.abs(angles - self.breaks[pair, k])
            worst = np.maximum(worst, np.where(lost, beside[:, None], 0.0))
        return np.tile(np.minimum(worst, 1.0), 2)

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
                sides = [bounds(self.profile, self.nodes, u, w, c**2, free, sign) for sign in (-1, 1)]
                far = np.where(way > 0, sides[1].x, -sides[0].x) / 2
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
        free = np.full(len(angles), np.inf)
        below, above = (bounds(self.profile, self.nodes, u0, w**2, c**2, free, sign) for sign in (-1, 1))
        beyond, there, last = np.empty(len(angles)), self.end[pair], w**2 + self.higher[pair]
        turns = np.empty((2, len(angles)), dtype=bool)
        for sign in (-1, 1):
            some = np.flatnonzero(to == sign)
            turned = bounds(self.profile, self.nodes, there[some], last[some], c[some] ** 2, free[some], sign)
            beyond[some] = np.abs(turned.x)
            turns[:, some] = (above if sign < 0 else below).turning[some], turned.turning
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
        straight = NoTurn(self.profile, np.zeros_like(x), u0, w**2, to, c**2)
        with np.errstate(all="ignore"):  # where there is no passage, or it is not resolved, there is no number
            reaches = (below.x <= x + room) & (x - room <= above.x)
            for rows, way, _ in ways(self.profile, u0, to * w, below, above):
                legs = _legs(way, to[rows], np.abs(x[rows]), beyond[rows], [jump[rows] for jump in jumps])
                alone = straight.take(rows), (np.zeros(len(rows)), np.abs(x[rows])), far[rows], 0
                shared = [(way, leg, ~far[rows] | (k > 0), k) for k, leg in enumerate(legs)]
                for motion, (low, high), own, k in (alone, *shared):
                    asked = own & reaches[rows] & wanted[rows, k]
                    exists = np.flatnonzero(asked & np.isfinite(low) & np.isfinite(high))
                    part = rows[exists]
                    sums = self._along(motion.take(exists), c[part] ** 2, low[exists], high[exists], agreed[part, k])
                    known = np.isfinite(sums[:, TAU]) & np.isfinite(sums[:, PATH])
                    out[part, k] = np.where(known, c[part] * sums[:, TAU], -np.inf)
                    out[part, LAYERS + k] = np.where(known, sums[:, PATH], -np.inf)

    def _along(
        self, motion: CoordinateMotion, C: np.ndarray, low: np.ndarray, high: np.ndarray, agreed: np.ndarray
    ) -> np.ndarray:
        """τ and the optical paths on motions, and what else is integrated with them."""
        if len(self.profile.stops):  # between these g is smooth
            return passages_between_stops(self.profile, motion, C, low, high, agreed)
        return integrals(motion, low, high, agreed=agreed)

    @property
    def count(self) -> np.ndarray:
        """How many breaks there are (p,)."""
        return np.count_nonzero(np.isfinite(self.breaks), axis=1)

    @property
    def breaks(self) -> np.ndarray:
        """The angles, ascending from 0 to π/2, between which the passages are smooth: (p, b), infinite after these."""
        return self._broken[0]

    @property
    def mild(self) -> np.ndarray:
        """At which breaks (p, b) the passages are smooth in the root of the angle from there: rays turn at stops."""
        return self._broken[1]

    @cached_property
    def _broken(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The breaks (p, b), whether they are mild, and which of S, U and D come to rest there (p, b, 3)."""
        upper, lower = np.maximum(self.start, self.end), np.minimum(self.start, self.end)
        sides = [np.searchsorted(self.nodes.u, place) for place in (lower, self.low)]
        sides += [np.searchsorted(self.nodes.u, place, side="right") - 1 for place in (upper, self.high)]
        rests = [self._rests(*ends) for ends in zip(*(side.tolist() for side in sides), strict=True)]
        pair, node = np.repeat(np.arange(len(rests)), [len(r) for r in rests]), np.concatenate(rests)
        u = self.nodes.u[node]
        above, below, up = u >= upper[pair], u <= lower[pair], self.way[pair] > 0
        at_rest = np.stack([~above & ~below, np.where(up, above, below), np.where(up, below, above)], axis=1)
        # the change of g is known to its own round-off, however small
        base = self.start[pair]
        gain, told = self.profile(base, self.nodes.u[node] - base).gain, self.nodes.g[node] - self.g[pair]
        # beside a jump round-off puts the place on either side
        torn = np.abs(gain - told) > OTHER_SIDE * np.maximum(self.g[pair], np.abs(self.nodes.g[node]))
        fallen = -np.where(torn, told, gain) / self.g[pair]
        mild = self._stops[node] & ~np.isin(node, self.nodes.upwards.turns)
        # at a jump g is steep on either side, and motions do not rest there
        mild |= np.isin(self.nodes.u[node], self.profile.jumps) & (self.profile.at(self.nodes.u[node])[1] != 0)
        # a window between two places of one kind, of heights alike but for what g is told to, is none
        alike = ALIKE * np.minimum(self._variation[0], 1.0)
        return _padded(pair, fallen, mild, at_rest, alike)

    def _rests(self, first: int, bottom: int, last: int, top: int) -> np.ndarray:
        """The nodes from ``bottom`` to ``top`` at which rays come to rest, or turn where g is less smooth.

        They go from the node ``first`` to ``last`` or back.
        """
        g, own = self.nodes.g, self._own
        above = np.concatenate([[last], own[(own > last) & (own < top)], [top]])
        below = np.concatenate([[first], own[::-1][(own[::-1] < first) & (own[::-1] > bottom)], [bottom]])
        between = first + int(np.argmin(g[first : last + 1]))
        return np.concatenate([[between], *(side[_held(g[side], self._stops[side])] for side in (above, below))])

    @cached_property
    def _stops(self) -> np.ndarray:
        """Which nodes are stops, or at a jump."""
        return np.isin(self.nodes.u, np.append(self.profile.stops, self.profile.jumps))

    @cached_property
    def _own(self) -> np.ndarray:
        """The nodes, ascending, at which g turns or is less smooth."""
        return np.union1d(self.nodes.upwards.turns, np.flatnonzero(self._stops))

    def stays_level(self, pair: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """True (n,) where the points of pairs (n,) lie on a layer along which a ray stays that starts so, so far."""
        g, slope = (values[pair] for values in self.profile.at(self.start))
        room = STAYS_LEVEL * g / (1.0 if self.profile.about_centre else np.maximum(distance, 1e-300))
        return (self.start == self.end)[pair] & (np.abs(slope) <= room)


def _padded(
    pair: np.ndarray, fallen: np.ndarray, mild: np.ndarray, at_rest: np.ndarray, alike: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The breaks of pairs in rows, ascending from 0 to π/2, whether they are mild, and what comes to rest there.

    They lie where g is ``fallen`` (n,) so far from that of the ``pair`` (n,); those alike are one, and so are those at
    which rays rest, or those at which they turn where g is less smooth, that differ by no more than is ``alike`` (p,).
    """
    order = np.lexsort((fallen, pair))
    order = order[(fallen[order] > SAME_MINIMUM) & (fallen[order] < 1.0)]
    place, row = fallen[order], pair[order]
    before = np.where(np.diff(row, prepend=-1) == 0, np.roll(place, 1), 0.0)
    both_so = (before > 0) & (mild[order] == np.roll(mild[order], 1))
    same = np.maximum(SAME_MINIMUM * place, np.where(both_so, alike[row], 0.0))
    first = np.flatnonzero(place - before > same)
    row = row[first]
    number, count = 1 + np.arange(len(row)) - np.searchsorted(row, row), np.bincount(row, minlength=pair[-1] + 1)
    shape = len(count), int(count.max()) + 2
    places, gentle, resting = np.full(shape, np.inf), np.zeros(shape, bool), np.zeros((*shape, LAYERS), bool)
    places[:, 0], places[np.arange(len(count)), count + 1] = 0.0, np.pi / 2
    places[row, number] = np.arcsin(np.sqrt(place[first]))
    gentle[row, number] = np.logical_and.reduceat(mild[order], first)
    resting[row, number] = np.logical_or.reduceat(at_rest[order], first)
    return places, gentle, resting


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


def _held(g: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """The places, outwards, of minima lower than all before, where motions come to rest; and the last one's.

    So are stops that are lower: beyond them motions turn back where g is less smooth than elsewhere.
    """
    before = np.minimum.accumulate(g)
    rests = np.flatnonzero((g[:-1] <= before[:-1]) & ((g[:-1] < g[1:]) | stop[:-1]))
    return np.append(rests, len(g) - 1) if len(g) and g[-1] <= before[-1] else rests


def past_centre(pair: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Three rays past the centre for every one of the pairs (m,) at ``angles`` (m,): pairs and angles (3m,)."""
    beside = np.column_stack([_past(angles), np.full(len(angles), AIMED), np.full(len(angles), 2 * AIMED)])
    return np.repeat(pair, 3), np.pi / 2 - beside.ravel()


def _past(angles: np.ndarray) -> np.ndarray:
    """How far past the centre rays at ``angles`` (m,) are aimed, or those closest to it of which this is told."""
    return np.maximum(np.pi / 2 - angles, CLOSEST)
