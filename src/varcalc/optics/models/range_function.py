"""All rays between two points of layers or about a centre, by the range function.

The invariant c of a ray decides how far it comes: S from the lower of the two indices to the other, U from there to
where it turns back beyond, D from the start to where it turns behind, all distances along the layers, or angles about
the centre. A ray that turns any number of times comes as far as

    S + 2aU + 2bD + 2m(S + U + D),    a and b 0 or 1, m whole,

so that three functions of c decide everything. Between values of c at which rays come to rest along a layer, or meet
an end of the medium, they are smooth: there Chebyshev series stand for them, and every zero of every combination less
the distance asked for is found (:mod:`varcalc.numerics.proxies`), however weak or narrow the gradient.

The unknown is the angle at the end with the smaller g: seen from there the other is never a turning point (rays can be
gone along backwards).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, NoTurn, OneTurn, TwoTurns, bounds, ways
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import AGREED, TAU, integrals
from varcalc.numerics.proxies import Proxies, proxies, zeros
from varcalc.optics.media.medium import Medium, Radial
from varcalc.optics.models.model import Builder, DoesNotApply, Question
from varcalc.optics.models.reduction import PATH, Profile
from varcalc.optics.rays.beam import frames
from varcalc.optics.rays.ray import Ray, Rays

MOST_WINDINGS = 64
"""Times about a centre, either way; rays that go round more often are not looked for."""
SOME_ANGLES = 64
"""Angles at which it is asked how far round a centre rays come on a unit of optical path."""
MOST_TURNS = 2000
"""Whole periods of a ray that is caught between two heights; rays with more are not looked for."""
TOUCHES_FOLD = 2e-13
"""Of the distance: a fold that comes so close to it touches it."""
FLAT_FAMILY = 1e-10
"""Of the distance: where it changes by less over a share of the angles, all those rays meet the point."""
CONTINUUM_SHARE = 0.25
"""Of the angles: where as many rays meet the point, all of them do."""
AIMED, BESIDE_CENTRE = 1e-6, np.array([1e-5, 2e-5, 3e-5])
"""Rays aimed at a centre, in radians, to within which the logarithm of a radius has too few digits, and their like."""
BROAD = 0.02
"""Angles, in radians, of rays that stand for a continuum."""
AT_A_TURN = 1e-13
"""Of the difference of two heights: so close to a turning point one is at it."""
SAME_MINIMUM = 1e-15
"""Of g: minima that differ by less are one."""
STAYS_LEVEL = 1e-15
"""Of g: where it changes by less over the distance, a ray that starts level stays so."""
SAME_CONTINUUM = 1e-6
"""Optical paths of the rays of one continuum agree so well, relative to their size."""
SAME_RAY = 1e-9
"""Launches and optical paths, relative, closer than this are one ray."""
UPRIGHT = 1e-13
"""Of the distance of two points: what they lie apart along layers is none."""
CARRIED_WELL, MEETS = 1e-11, 1e-6
"""Of the distance of two points: a ray that misses the second by more is carried again, or was none."""
TOLD = 1e-10
"""Noise of a ray's angle beyond which carrying it more carefully gains nothing."""
ERROR_MARGIN = 4.0
"""By how many times the difference of two optical paths either may be off."""
PANELS = 32
"""Panels whose errors, each within that to which they are integrated, may add up in an optical path."""
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
NEXT, GROWN = 0.02, 1e-6
"""A passage that grows so much, in units of the distance, over the last of the way to an angle grows for ever."""
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
        """S, U, D and their optical paths (m, 6) at angles (m,) from 0 to π/2, not numbers where they do not exist."""
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
                    out[rows[part], k] = c[rows[part]] * sums[:, TAU]
                    out[rows[part], LAYERS + k] = sums[:, PATH]

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
        """Which passages (P, 6) are longer than is asked for."""
        paths = np.nanmin(values[..., LAYERS:], axis=1, initial=np.inf)
        return np.tile((paths > self.within) | (paths[:, :1] > self.within), 2)  # S is part of every ray

    def series(self) -> Proxies:
        """Series that stand for them."""
        return proxies(self, np.linspace(0.0, 2.0 * (len(self.breaks) - 1), 4 * (len(self.breaks) - 1) + 1))


@dataclass(frozen=True)
class Launch:
    """A ray found: its invariant ``c``, its ``speed`` du/dτ at the first point, its optical path, the ``way`` round.

    The way is 1 or -1, the sense about a centre; ``noise`` is what round-off of its angle makes of its distance.
    """

    c: float
    speed: float
    path: float
    way: int
    touching: bool
    noise: float


@dataclass(frozen=True)
class Launches:
    """The rays found, and what was searched.

    ``resting`` counts rays that all but come to rest along a layer, closer to that than angles can be told;
    ``unresolved`` intervals in which a ray may have been passed over.
    """

    found: list[Launch]
    continuum: bool
    looked_at: int
    resting: int
    unresolved: int


@dataclass(frozen=True)
class Families:
    """k combinations of passages on ``panel`` (k,) of the series.

    ``beyond`` and ``behind`` are a and b, ``periods`` m, ``aim`` the number of the distance that each is to come.
    """

    panel: np.ndarray
    beyond: np.ndarray
    behind: np.ndarray
    periods: np.ndarray
    aim: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """What the passages S, U and D are taken by, and their optical paths, by nothing (k, 6)."""
        m = self.periods
        weights = np.column_stack([1 + 2 * m, 2 * (self.beyond + m), 2 * (self.behind + m)])
        return np.pad(weights.astype(float), ((0, 0), (0, COUNT - LAYERS)))

    def take(self, rows: np.ndarray) -> Families:
        """Some of them."""
        return Families(*(getattr(self, name)[rows] for name in ("panel", "beyond", "behind", "periods", "aim")))

    @property
    def name(self) -> np.ndarray:
        """Rows (k, 4) that are the same on all panels of one family."""
        return np.column_stack([self.beyond, self.behind, self.periods, self.aim])

    @classmethod
    def possible(cls, series: Proxies, distances: np.ndarray, within: float) -> Families:
        """Those that may come one of the distances (q,) far on an optical path of ``within``, by the series' bounds."""
        least, most = (np.where(np.isnan(bound), np.nan, bound) for bound in series.bounds)
        parts = []
        for beyond, behind in ((0, 0), (1, 0), (0, 1), (1, 1)):
            w = np.array([1.0, 2.0 * beyond, 2.0 * behind])
            near, far = (np.where(w > 0, bound[:, :LAYERS] * w, 0.0).sum(axis=1) for bound in (least, most))
            short = np.where(w > 0, least[:, LAYERS:] * w, 0.0).sum(axis=1)
            period = [2 * bound.sum(axis=1) for bound in (least[:, :LAYERS], most[:, :LAYERS], least[:, LAYERS:])]
            with np.errstate(all="ignore"):
                first = np.ceil((distances[:, None] - far) / period[1] - 1e-9)
                last = np.floor((distances[:, None] - near) / np.maximum(period[0], 1e-300) + 1e-9)
                longest = np.floor((within - short) / np.maximum(period[2], 1e-300) + 1e-9)
            periodic = np.isfinite(period[1])
            # without a period only the first passage counts, and whether it can come so far
            once = (near <= distances[:, None] * (1 + 1e-9)) & (far >= distances[:, None] * (1 - 1e-9))
            first = np.where(periodic, np.maximum(np.nan_to_num(first), 0), np.where(once, 0, 1))
            last = np.where(periodic, np.minimum(np.minimum(last, longest), MOST_TURNS), 0)
            last = np.where(np.isfinite(near) & (short <= within), last, -1)
            aim, panel = np.nonzero(last >= first)
            start, stop = first[aim, panel].astype(int), last[aim, panel].astype(int) + 1
            count = stop - start
            row = np.repeat(np.arange(len(count)), count)
            m = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + start[row]
            parts.append((panel[row], np.full(len(row), beyond), np.full(len(row), behind), m, aim[row]))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def launches(profile: Profile, ends: tuple[float, float], distance: float, within: float) -> Launches:
    """The rays from the first height to the second that come ``distance`` far, about a centre either way round."""
    passages, swapped = Passages.between(profile, ends, within)
    distances = _distances(profile, distance, passages, within)
    wanted = np.array([one for one, _ in distances])
    spread = Spread(passages, float(max(wanted.max(), abs(ends[1] - ends[0]))), within)
    series = spread.series()
    touch = TOUCHES_FOLD * spread.distance
    families = Families.possible(series, wanted, within)
    whole, families = _continua(spread, series, families, wanted)
    found = zeros(series, families.panel, families.weights, wanted[families.aim], touch)
    angles, which = spread.angles(found.at), families.take(found.which)
    upright, names = _upright(passages, wanted, touch, within)
    angles = np.concatenate([whole[0], angles, upright])
    touching = np.concatenate([np.ones(len(whole[0]), bool), found.touching, np.zeros(len(upright), bool)])
    which = np.concatenate([whole[1], which.name, names])
    rays = _launched(passages, angles, which, distances, touching, swapped=swapped)
    isolated = rays[len(whole[0]) :]
    if passages.stays_level(distance):
        root = float(np.sqrt(passages.g))
        isolated += [Launch(root, 0.0, root * one, way, False, 0.0) for one, way in distances]
    continua = _one_each([launch for launch in rays[: len(whole[0])] if launch.path <= within])
    isolated = [
        launch for launch in isolated
        if launch.path <= within
        and not any(abs(launch.path - other.path) <= SAME_CONTINUUM * other.path for other in continua)
    ]  # fmt: skip
    resting = _resting(spread, wanted)
    unresolved = len(series.given_up) + found.lost
    return Launches(continua + _distinct(isolated), len(continua) > 0, series.looked_at, resting, unresolved)


def _distances(profile: Profile, distance: float, passages: Passages, within: float) -> list[tuple[float, int]]:
    """The distances from one point to the other, with the sense; about a centre both ways and with windings."""
    if not profile.about_centre:
        return [(distance, 1)]
    some = passages.at(np.linspace(1e-3, np.pi / 2 - 1e-3, SOME_ANGLES))
    with np.errstate(all="ignore"):
        farthest = within * float(np.nanmax(some[:, :LAYERS] / some[:, LAYERS:], initial=0.0))
    turns = range(min(int(farthest / (2 * np.pi)) + 2, MOST_WINDINGS))
    ahead = [(distance + 2 * np.pi * k, 1) for k in turns]
    return ahead + [(2 * np.pi * (k + 1) - distance, -1) for k in turns]


def _continua(
    spread: Spread, series: Proxies, families: Families, wanted: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], Families]:
    """The most level ray (angle and family's name) of each family all of whose rays meet the point, and the others."""
    weights = families.weights
    used = np.where(weights[:, :, None] != 0, series.coefficients[families.panel], 0.0)
    c = np.einsum("kf,kfn->kn", weights, used)
    c[:, 0] -= wanted[families.aim]
    flat = np.abs(c).sum(axis=1) <= FLAT_FAMILY * spread.distance
    if not np.any(flat):
        return (np.zeros(0), np.zeros((0, 4), int)), families
    names, number = np.unique(families.name, axis=0, return_inverse=True)
    number = number.ravel()
    low, high = spread.angles(series.low[families.panel]), spread.angles(series.high[families.panel])
    share = np.bincount(number, np.where(flat, np.abs(high - low), 0.0), minlength=len(names)) / (np.pi / 2)
    whole = np.flatnonzero(share > CONTINUUM_SHARE)
    low, high = np.minimum(low, high), np.maximum(low, high)
    broad = flat & (high - low > BROAD)
    angles = [(low + high)[broad & (number == k)].min(initial=np.pi / 2) / 2 for k in whole]
    return (np.array(angles), names[whole]), families.take(np.flatnonzero(~np.isin(number, whole)))


def _upright(
    passages: Passages, wanted: np.ndarray, touch: float, within: float
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Rays at right angles to the layers, where they come as far as is asked for: the angles and names of families."""
    here = passages.at(np.array([np.pi / 2]))[0]
    rows = []
    for beyond, behind in ((0, 0), (1, 0), (0, 1), (1, 1)):
        for m in range(MOST_TURNS):
            w = np.array([1.0 + 2 * m, 2.0 * (beyond + m), 2.0 * (behind + m)])
            came, path = (np.where(w > 0, w * half, 0.0).sum() for half in (here[:LAYERS], here[LAYERS:]))
            if not (path <= within and (m == 0 or path > 0)):  # what does not exist is no number
                break
            rows += [(beyond, behind, m, aim) for aim in np.flatnonzero(np.abs(came - wanted) <= touch)]
    return np.full(len(rows), np.pi / 2), np.array(rows, dtype=int).reshape(-1, 4)


def _resting(spread: Spread, wanted: np.ndarray) -> int:
    """How many rays come to rest along a layer more closely than angles can be told: passages grow up to there."""
    breaks = 2.0 * np.arange(len(spread.breaks))
    sides = [(at, way) for at in breaks for way in (-NEXT, NEXT) if breaks[0] <= at + way <= breaks[-1]]
    count, root = 0, np.sqrt(spread.passages.g)
    for at, way in sides:
        here, inside = spread(np.array([at, at + way]) + np.array([np.sign(way), 0.0]) * BESIDE)
        growing = here[:LAYERS] - inside[:LAYERS] > GROWN * spread.distance
        if np.any(growing):
            c = root * float(np.cos(spread.angles(np.array([at]))[0]))
            count += sum(
                _left_over(here, growing, np.array([1.0, 2.0 * beyond, 2.0 * behind]), wanted, (c, spread.within))
                for beyond, behind in ((0, 0), (1, 0), (0, 1), (1, 1))
            )
    return count


def _left_over(
    here: np.ndarray, growing: np.ndarray, weights: np.ndarray, wanted: np.ndarray, rest: tuple[float, float]
) -> int:
    """How many of the rays with so many passages, and periods more, have not come far enough where they all but rest.

    ``rest`` is the index along the layer and the optical path that is asked for.
    """
    count = 0
    for _ in range(MOST_TURNS):
        used = weights > 0
        came, path = (np.where(used, weights * half, 0.0).sum() for half in (here[:LAYERS], here[LAYERS:]))
        left = wanted - came
        still = (left > 0) & (path + rest[0] * left <= rest[1])
        if not np.any(still):  # whatever is no number has come nowhere
            break
        count += int(np.count_nonzero(still)) if np.any(growing & used) else 0
        weights = weights + 2.0
    return count


def _launched(
    passages: Passages, angles: np.ndarray, names: np.ndarray, distances: list[tuple[float, int]],
    touching: np.ndarray, *, swapped: bool,
) -> list[Launch]:  # fmt: skip
    """The rays of the families ``names`` (k, 4) at ``angles`` (k,)."""
    if len(angles) == 0:
        return []
    beyond, behind, m, aim = names.T
    weights = Families(aim, beyond, behind, m, aim).weights[:, :LAYERS]
    there = passages.at(angles)[:, LAYERS:]
    path = np.where(weights > 0, weights * there, 0.0).sum(axis=1)
    c, w = np.sqrt(passages.g) * np.cos(angles), np.sqrt(passages.g) * np.sin(angles)
    last = np.sqrt(passages.higher + w**2)
    leaving = passages.way * np.where(behind == 1, -w, w)
    arriving = passages.way * np.where(beyond == 1, -last, last)
    speed, noise = (-arriving if swapped else leaving), passages.noise(angles)
    return [
        Launch(float(c[k]), float(speed[k]), float(path[k]), distances[aim[k]][1], bool(touching[k]), float(noise[k]))
        for k in range(len(angles))
    ]


def _one_each(continua: list[Launch]) -> list[Launch]:
    """One ray of each continuum, all rays of which have the same optical path, either way round a centre."""
    kept: list[Launch] = []
    for launch in sorted(continua, key=lambda f: f.path):
        if not kept or launch.path - kept[-1].path > SAME_CONTINUUM * launch.path:
            kept.append(launch)
    return kept


def _distinct(found: list[Launch]) -> list[Launch]:
    """None twice."""
    kept: list[Launch] = []
    for launch in sorted(found, key=lambda f: f.path):
        scale = float(np.hypot(launch.c, launch.speed))
        if not any(
            abs(launch.speed - other.speed) <= SAME_RAY * scale
            and abs(launch.way * launch.c - other.way * other.c) <= SAME_RAY * scale
            and abs(launch.path - other.path) <= SAME_RAY * launch.path
            for other in kept
        ):
            kept.append(launch)
    return kept


def found_by_range(question: Question, *, careful: Builder | None = None) -> Rays:
    """The rays that answer ``question``, whose one medium is ``Stratified`` or ``Radial`` and has no surfaces.

    A ray that misses the point as the question carries it, since it went far out where digits are lost, is carried the
    ``careful`` way, if there is one.

    Raises :class:`DoesNotApply` where an end is the centre of the index.
    """
    frame = Frame(question.media[0], question.a, question.b)
    found = launches(frame.profile, frame.heights, frame.distance, question.within)
    carried = _carried(question, careful, frame, found.found)
    rays = sorted(carried, key=lambda ray: ray.optical_path)
    unresolved = found.unresolved + found.resting + len(found.found) - len(rays)
    resting = f"; {found.resting} rays that all but come to rest along a layer" if found.resting else ""
    searched = (
        f"all launching angles by the range function ({found.looked_at} looked at, {unresolved} narrow "
        f"intervals left unresolved{resting}), optical paths up to {question.within:.6g}"
    )
    reason = "" if rays else f"shadow: no ray of the source comes to B (searched: {searched})"
    return Rays(tuple(rays), reason, searched, found.continuum, unresolved)


def _carried(question: Question, careful: Builder | None, frame: Frame, found: list[Launch]) -> list[Ray]:
    """The rays of the launches but those that do not meet the point: radial ones, at the rim of the range function."""
    if not found:
        return []
    headings = np.array([frame.heading(launch) for launch in found])
    paths, touching = (np.array([getattr(launch, name) for launch in found]) for name in ("path", "touching"))
    built = question.built(headings, paths, touching)
    doubtful = [miss > CARRIED_WELL and launch.noise < TOLD for (_, miss), launch in zip(built, found, strict=True)]
    floor, again = np.zeros(len(found)), np.flatnonzero(doubtful)
    if careful is not None and len(again):
        floor[again] = PANELS * AGREED * paths[again]
        for k, better in zip(again, careful(headings[again], paths[again], touching[again]), strict=True):
            built[k] = better
    # two routes to one number: by quadrature to the point, and along the ray
    return [
        replace(ray, error=max(ray.error, floor[k], ERROR_MARGIN * abs(ray.optical_path - paths[k])))
        for k, (ray, miss) in enumerate(built)
        if ray is not None and miss <= MEETS
    ]


class Frame:
    """Two points as heights in a profile, and the distances between them along the layers."""

    def __init__(self, medium: Medium, a: np.ndarray, b: np.ndarray) -> None:
        if isinstance(medium, Radial):
            offsets = [end - medium.middle(len(a)) for end in (a, b)]
            radii = [float(np.linalg.norm(offset)) for offset in offsets]
            if min(radii) == 0:
                raise DoesNotApply(
                    "Invariants needs points off the centre of the index, about which all turns; take Hamilton()"
                )
            self.up = offsets[0] / radii[0]
            unit = float(2.0 ** np.round(np.log2(radii[0])))
            self.profile = Profile(medium, unit, 0.0)
            self.heights = float(np.log(radii[0] / unit)), float(np.log(radii[1] / unit))
            across = offsets[1] - np.dot(offsets[1], self.up) * self.up
            self.distance = float(np.arctan2(np.linalg.norm(across), np.dot(offsets[1], self.up)))
        else:
            self.up = np.eye(len(a))[-1]
            self.profile = Profile(medium, 1.0, float(a[-1]))
            self.heights = float(a[-1]), float(b[-1])
            across = np.append((b - a)[:-1], 0.0)
            self.distance = float(np.linalg.norm(across))
        length = float(np.linalg.norm(across))
        upright = length <= UPRIGHT * np.linalg.norm(b - a)  # what is left of it has no direction
        self.ahead = frames(self.up[None, :])[0, 0] if upright else across / length

    def heading(self, launch: Launch) -> np.ndarray:
        """The unit vector along which a ray leaves the first point."""
        heading = launch.speed * self.up + launch.way * launch.c * self.ahead
        return heading / np.linalg.norm(heading)
