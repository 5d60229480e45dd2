"""How far rays of layers and centres come between two heights: three passages, and series that stand for them.

S goes from the start to the end, U from there to where a ray turns back beyond, D from the start to where it turns
behind. They are functions of the angle at the end with the smaller g: seen from there the other is never a turning
point (rays can be gone along backwards).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, NoTurn, OneTurn, TwoTurns, bounds, ways
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import AGREED, TAU, integrals
from varcalc.numerics.proxies import Proxies, proxies
from varcalc.optics.models.reduction import PATH, Profile

AIMED, BESIDE_CENTRE = 1e-6, np.array([1e-5, 2e-5, 3e-5])
"""Rays aimed at a centre, in radians, to within which the logarithm of a radius has too few digits, and their like."""
AT_A_TURN = 1e-13
"""Of the difference of two heights: so close to a turning point one is at it."""
SAME_MINIMUM = 1e-15
"""Of g: minima that differ by less are one."""
STAYS_LEVEL = 1e-15
"""Of g: where it changes by less over the distance, a ray that starts level stays so."""
EPSILON = 2 * float(np.finfo(float).eps)
"""Round-off of g and of angles, relatively."""
NEAREST = 1e-10
"""How close to an angle at which rays come to rest is looked, in units of what is known of it to round-off."""
LEAST_SHARE, MOST_SHARE = 1e-14, 1e-2
"""The same in units of half the way to the next one, at least and at most."""
TOGETHER = 512
"""Angles whose passages are integrated together; bounds the memory."""
ROUGH_PLACES, ROOM = 240, 2.0
"""Heights at which the index is summed to say how high rays come, and by what factor that may be wrong."""
FARTHEST_LOG = 300.0
"""Of the logarithm of a radius."""
BESIDE = 1e-9
"""Of the unknown, that much beside a break the passages are those of its side."""
LAYERS, COUNT = 3, 6
"""Passages S, U and D: how far they come along the layers, and together with their optical paths."""


@dataclass(frozen=True)
class Passages:
    """Rays from the height ``start`` to the height ``end`` of ``profile``, with g smaller at the start."""

    profile: Profile
    nodes: PotentialNodes
    start: float
    end: float

    @classmethod
    def between(cls, profile: Profile, ends: tuple[float, float], within: float) -> tuple[Passages, bool]:
        """The rays between two heights up to an optical path, and whether they start from the second."""
        g = profile.at(np.array(ends))[0]
        swapped = bool(g[1] < g[0])
        start, end = ends[::-1] if swapped else ends
        low, high = (_farthest(profile, edge, way, within) for edge, way in ((min(ends), -1), (max(ends), 1)))
        return cls(profile, profile.nodes(min(ends), max(ends), low, high), start, end), swapped

    @cached_property
    def way(self) -> float:
        """1.0 where the end is above the start, or as high, -1.0 where it is below."""
        return 1.0 if self.end >= self.start else -1.0

    @cached_property
    def g(self) -> float:
        """g at the start."""
        return float(self.profile.at(np.array([self.start]))[0][0])

    def at(self, angles: np.ndarray) -> np.ndarray:
        """S, U, D and their optical paths (m, 6) at angles (m,) from 0 to π/2, not numbers where they do not exist.

        Those that exist and are not resolved are -∞.
        """
        out = np.full((len(angles), COUNT), np.nan)
        agreed = np.maximum(self.noise(angles), AGREED)
        for first in range(0, len(angles), TOGETHER):
            some = slice(first, first + TOGETHER)
            self._write(angles[some], agreed[some], out[some])
        aimed = np.flatnonzero(np.pi / 2 - angles < AIMED) if self.profile.about_centre else []
        if len(aimed):
            beside = np.pi / 2 - angles[aimed]
            out[aimed] = _through_three(self.at(np.pi / 2 - BESIDE_CENTRE), beside)
        return out

    @cached_property
    def higher(self) -> float:
        """How much larger g is at the end."""
        x = np.array([self.end - self.start])
        return max(float(self.profile(np.array([self.start]), x).gain[0]), 0.0)

    @cached_property
    def rounded(self) -> np.ndarray:
        """How well the angles of the breaks are known in comparison with others, but for level and upright: (b,).

        What is known to round-off is the largest change of g that adds up to that at a break.
        """
        variation = float(np.ptp(self.nodes.g[np.abs(self.nodes.g) < np.inf])) / self.g
        inner = self.breaks[1:-1]
        return EPSILON * np.maximum(inner**2, min(variation, 1.0)) / inner

    def noise(self, angles: np.ndarray) -> np.ndarray:
        """What round-off makes of the passages at angles (m,), relatively: much beside a break."""
        with np.errstate(all="ignore"):
            beside = self.rounded / np.abs(angles[..., None] - self.breaks[1:-1])
        return np.minimum(np.max(beside, axis=-1, initial=0.0), 1.0)

    def _write(self, angles: np.ndarray, agreed: np.ndarray, out: np.ndarray) -> None:
        u0 = np.full(len(angles), self.start)
        c, w = np.sqrt(self.g) * np.cos(angles), np.sqrt(self.g) * np.sin(angles)
        free = np.full(len(angles), np.inf)
        below, above = (bounds(self.profile, self.nodes, u0, w**2, c**2, free, sign) for sign in (-1, 1))
        # how far beyond the end rays turn is told from there: both ends may be turning points, all but for round-off
        there = np.full(len(angles), self.end)
        beyond = np.abs(bounds(self.profile, self.nodes, there, w**2 + self.higher, c**2, free, int(self.way)).x)
        x = self.end - self.start
        room = AT_A_TURN * abs(x)
        if x == 0:
            out[:, [0, LAYERS]] = 0.0
        with np.errstate(all="ignore"):  # where there is no passage, or it is not resolved, there is no number
            for rows, way, _ in ways(self.profile, u0, self.way * w, below, above):
                reaches = (below.x[rows] <= x + room) & (x - room <= above.x[rows])
                for k, (low, high) in enumerate(self._legs(way, x, beyond[rows])):
                    exists = reaches & np.isfinite(low) & np.isfinite(high)
                    part = np.flatnonzero(exists)
                    sums = integrals(way.take(part), low[part], high[part], agreed=agreed[rows[part]])
                    known = np.isfinite(sums[:, TAU]) & np.isfinite(sums[:, PATH])
                    out[rows[part], k] = np.where(known, c[rows[part]] * sums[:, TAU], -np.inf)
                    out[rows[part], LAYERS + k] = np.where(known, sums[:, PATH], -np.inf)

    def _legs(self, way: CoordinateMotion, x: float, beyond: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """From where to where S, U and D go, in the parameter of a way; not numbers where they do not exist.

        The end is at ``x`` from the start, and ``beyond`` (m,) before its turning point.
        """
        start, none = way.start, np.full(len(way.start), np.nan)
        if isinstance(way, NoTurn):
            return [(np.zeros(len(start)), np.full(len(start), self.way * x)), (none, none), (none, none)]
        if isinstance(way, OneTurn):
            zero, ahead = np.zeros(len(start)), way.sign != self.way
            q = start if x == 0 else np.where(ahead, -np.sqrt(beyond), np.sqrt(start**2 + abs(x)))
            return [
                (start, q),
                (np.where(ahead, q, np.nan), np.where(ahead, zero, np.nan)),
                (np.where(ahead, np.nan, zero), np.where(ahead, np.nan, start)),
            ]
        assert isinstance(way, TwoTurns)
        behind = way.span * np.where(self.way > 0, np.sin(start / 2), np.cos(start / 2)) ** 2  # as precise as the start
        far, near = (behind + abs(x), beyond) if self.way > 0 else (beyond, behind + abs(x))
        q = 2 * np.arctan2(np.sqrt(far), np.sqrt(near))
        q, begin = (np.abs(start) if x == 0 else q), np.abs(start)
        bottom, top = np.zeros(len(start)), np.full(len(start), np.pi)
        if self.way > 0:
            return [(begin, q), (q, top), (bottom, begin)]
        return [(q, begin), (bottom, q), (begin, top)]

    @cached_property
    def breaks(self) -> np.ndarray:
        """The angles, ascending from 0 to π/2, between which the passages are smooth."""
        u, g = self.nodes.u, self.nodes.g
        low, high = min(self.start, self.end), max(self.start, self.end)
        between = np.flatnonzero((u >= low) & (u <= high))
        above, below = np.flatnonzero(u >= high), np.flatnonzero(u <= low)[::-1]
        rests = np.concatenate([between[[int(np.argmin(g[between]))]], above[_held(g[above])], below[_held(g[below])]])
        # the change of g is known to its own round-off, however small
        lost = -self.profile(np.full(len(rests), self.start), u[rests] - self.start).gain
        lost = np.sort(lost[(lost > SAME_MINIMUM * self.g) & (lost < self.g)])
        lost = lost[np.diff(lost, prepend=0.0) > SAME_MINIMUM * lost]
        return np.unique(np.concatenate([[0.0], np.arcsin(np.sqrt(lost / self.g)), [np.pi / 2]]))

    def stays_level(self, distance: float) -> bool:
        """True where both points lie on a layer along which a ray stays that starts along it."""
        g, slope = self.profile.at(np.array([self.start]))
        room = STAYS_LEVEL * g[0] / (1.0 if self.profile.about_centre else max(distance, 1e-300))
        return bool(self.start == self.end and np.abs(slope[0]) <= room)


def _farthest(profile: Profile, edge: float, way: int, within: float) -> float:
    """The height beyond which no ray of an optical path ``within`` comes from an ``edge``, about; infinite for none."""
    if profile.about_centre and way < 0:
        return -np.inf
    away = np.append(0.0, np.geomspace(1e-6, 1e6, ROUGH_PLACES) * (1.0 if profile.about_centre else within))
    away = away[away <= FARTHEST_LOG] if profile.about_centre else away
    g = profile.at(edge + way * away)[0]
    with np.errstate(all="ignore"):
        paths = np.cumsum(np.sqrt(np.fmin(g[1:], g[:-1])) * np.diff(away))
    enough = np.flatnonzero(paths > ROOM * within)
    return edge + way * float(away[enough[0] + 1]) if len(enough) else way * np.inf


def _held(g: np.ndarray) -> np.ndarray:
    """The places, outwards, of minima lower than all before, where motions come to rest; and the last one's."""
    before = np.minimum.accumulate(g)
    rests = np.flatnonzero((g[:-1] <= before[:-1]) & (g[:-1] < g[1:]))
    return np.append(rests, len(g) - 1) if len(g) and g[-1] <= before[-1] else rests


def _through_three(values: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """What rays past a centre (3, 6) say of those closer to it (m, 6), by the parabola through them."""
    a, b, c = BESIDE_CENTRE
    shares = [
        (beside - b) * (beside - c) / ((a - b) * (a - c)),
        (beside - a) * (beside - c) / ((b - a) * (b - c)),
        (beside - a) * (beside - b) / ((c - a) * (c - b)),
    ]
    return np.stack(shares, axis=1) @ values


@dataclass(frozen=True)
class Spread:
    """The passages as functions of one unknown: of every interval between ``breaks`` two halves, one unit long each.

    At 0, 2, 4, .. are the breaks, at 1, 3, .. the middles between them. The passages are those that may be part of a
    ray of the optical path ``within`` that comes ``distance`` far.
    """

    passages: Passages
    distance: float
    within: float

    @property
    def breaks(self) -> np.ndarray:
        """See :attr:`Passages.breaks`."""
        return self.passages.breaks

    def angles(self, at: np.ndarray) -> np.ndarray:
        """The angles at the unknown (m,), crowded towards breaks but for level and upright rays."""
        interval = np.clip(np.floor(at / 2).astype(int), 0, len(self.breaks) - 2)
        low, half = self.breaks[interval], np.diff(self.breaks)[interval] / 2
        number, away = self._beside(at, interval)
        offset = half * self._share(number, half, away)
        upper = number > interval
        return np.where(away >= 1, low + half, np.where(upper, self.breaks[number] - offset, low + offset))

    def _beside(self, at: np.ndarray, interval: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The number of the nearer break, and how far from it the unknown is: 1 in the middle."""
        upper = at > 2 * interval + 1
        return interval + upper, np.where(upper, 2 * (interval + 1) - at, at - 2 * interval)

    def _share(self, number: np.ndarray, half: np.ndarray, away: np.ndarray) -> np.ndarray:
        """How far from a break, in halves of an interval, what is ``away`` from it is: doubly exponential."""
        own = np.concatenate([[0.0], self.passages.rounded, [EPSILON]])[number]
        least = np.clip(NEAREST / EPSILON * own / half, LEAST_SHARE, MOST_SHARE)
        return np.exp(1 - np.exp(np.log(1 - np.log(least)) * (1 - away)))

    def noise(self, at: np.ndarray) -> np.ndarray:
        """See :meth:`Passages.noise`, in the shape of ``at``."""
        return self.passages.noise(self.angles(at))

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """The passages (m, 6)."""
        return self.passages.at(self.angles(at))

    @property
    def scale(self) -> np.ndarray:
        """The distance and the optical path that are asked for."""
        return np.repeat([self.distance, self.within], LAYERS)

    def inside(self, at: np.ndarray, way: int) -> np.ndarray:
        """Next to a break, where ``at`` (P,) are breaks."""
        return np.where(at % 2 == 0, at + way * BESIDE, at)

    def beyond(self, values: np.ndarray) -> np.ndarray:
        """Which passages (P, 6) are longer than is asked for, in either way; S is part of every ray."""
        known = np.isfinite(values)
        least = np.where(known.any(axis=1), np.min(values, axis=1, initial=np.inf, where=known), -np.inf)
        longer = (least[:, :LAYERS] > self.distance) | (least[:, LAYERS:] > self.within)
        return np.tile(longer | longer[:, :1], 2)

    def series(self) -> Proxies:
        """Series that stand for them."""
        return proxies(self, np.linspace(0.0, 2.0 * (len(self.breaks) - 1), 4 * (len(self.breaks) - 1) + 1))
