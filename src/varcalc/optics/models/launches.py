"""The rays of layers and centres that come a given distance far, by the passages that they are made of.

A ray that turns any number of times comes as far as

    S + 2aU + 2bD + 2m(S + U + D),    a and b 0 or 1, m whole,

so that three functions of one unknown decide everything. Chebyshev series stand for them, and every zero of every
combination less the distance asked for is found (:mod:`varcalc.numerics.proxies`), however weak or narrow the gradient.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from varcalc.numerics.proxies import Proxies, zeros
from varcalc.optics.models.height_pairs import COUNT, EPSILON, LAYERS, LEAST_BESIDE
from varcalc.optics.models.passage_tables import PassageTables, TabledPassages
from varcalc.optics.models.passages import RayPassages
from varcalc.optics.models.reduction import RayPotential
from varcalc.optics.models.spread import BREAK_OFFSET, Spread
from varcalc.optics.rays.beam import Rows

MOST_WINDINGS = 64
"""Times about a centre, either way; rays that go round more often are not looked for."""
SOME_ANGLES = 32
"""Angles at which it is asked how far round a centre rays come on a unit of optical path."""
MOST_TURNS = 2000
"""Whole periods of a ray that is caught between two heights; rays with more are not looked for."""
SOME_TURNS, BEYOND_COUNT = 100, 1000.0
"""The same of rays beside a kink, whose periods become less and less; and by how many times that may be more, then."""
TOUCHES_FOLD = 2e-13
"""Of the distance: a fold that comes so close to it touches it."""
FLAT_FAMILY = 1e-10
"""Of the distance: where it changes by less over a share of the angles, all those rays meet the point."""
CONTINUUM_SHARE = 0.25
"""Of the angles: where as many rays meet the point, all of them do."""
BROAD = 0.02
"""Angles, in radians, of rays that stand for a continuum."""
SAME_CONTINUUM = 1e-6
"""Optical paths of the rays of one continuum agree so well, relative to their size."""
SAME_RAY = 1e-9
"""Launches and optical paths, relative, closer than this are one ray."""
KINDS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""Of rays: a and b."""
CLEAR = 1e-5
"""Of the optical path: how much rays must spread to have their conjugate points counted by their turning points."""
TOLD, TOLD_WELL = 1e-6, 1e-12
"""Of the optical path, and of the distance: how well rays are told that cannot be carried, and those that need not."""
NEXT, GROWN = 0.02, 1e-6
"""A passage that grows so much, in units of the distance, over the last of the way to an angle grows for ever,"""
STEADY, ENDLESS = 0.6, 0.9
"""and so much of what it grew before: to where g has a corner rays come in time, as the root of the angle, and beside
several of them by no more than a geometric series has left."""
LOGARITHMIC = 0.02
"""Of how much a passage grows for each factor e: where it changes by less, passages grow as logarithms."""
PLACES_ROUNDED = 4.0
"""Of the round-off of one passage: what that of the three makes of the change of how fast they grow."""
UNTOLD = 1e300
"""A passage grows by no more, where nobody knows whether it grows for ever."""
BEYOND_NUMBERS = 700.0
"""Powers of e: beside a narrow wall, along which passages grow so slowly that it drowns in round-off, rays that rest
for longer spread beyond what numbers tell, however slowly."""
STEEPEST_RATE, SLOWEST = 1e300, 1e-300
"""Of how distances change with the angle, and of how slowly passages grow: beyond what numbers tell."""


@dataclass(frozen=True)
class Launch:
    """A ray found: its invariant ``c``, ``speed`` du/dτ at the first point and ``last`` at the second, optical path.

    ``way`` is 1 or -1, the sense about a centre, and ``distance`` how far it comes along the layers; ``noise`` is what
    round-off of its angle makes of that. ``index`` counts the conjugate points in its plane, -1 where that is not
    known; ``off`` is what the optical path may be off, infinite where the ray must be carried to tell, and ``well``
    says that it need not be. ``rate`` is by how much the distance changes with c.
    """

    c: float
    speed: float
    last: float
    path: float
    way: int
    touching: bool
    noise: float
    distance: float
    index: int
    off: float
    well: bool
    rate: float


@dataclass(frozen=True)
class Launches:
    """The rays found from one point to another, and what was searched.

    ``resting`` counts rays that all but come to rest along a layer, closer to that than angles can be told;
    ``unresolved`` intervals in which a ray may have been passed over. ``endless`` says that there are more rays, with
    more turns, which become less and less.
    """

    found: list[Launch]
    continuum: bool
    looked_at: int
    resting: int
    unresolved: int
    endless: bool


@dataclass(frozen=True)
class Reaching(Rows):
    """Rays (k,) of the families ``names`` (k, 4) that come as far as is asked, by passages told at ``angles`` (k,).

    They leave themselves at angles larger by ``turned`` (k,), their distances change with the angle at ``rates`` (k,),
    and their optical paths are longer by ``gains`` (k,), which may be ``off`` (k,), than by those of the index along
    the layer for the distance between. ``touching`` (k,) says that they touch a caustic where they arrive.
    """

    angles: np.ndarray
    names: np.ndarray
    rates: np.ndarray
    touching: np.ndarray
    turned: np.ndarray
    gains: np.ndarray
    off: np.ndarray

    @classmethod
    def there(cls, angles: np.ndarray, names: np.ndarray, rates: np.ndarray, touching: np.ndarray) -> Reaching:
        """Those whose passages are told where they leave."""
        return cls(angles, names, rates, touching, *np.zeros((3, len(angles))))


@dataclass(frozen=True)
class BesideRests:
    """The places (k,) beside the angles at which rays of ``pair`` (k,) rest, as close as is told well.

    They are on the ``side`` 1 or -1 (k,) of these, where rays leave at ``angle`` (k,), with du/dτ = ``climb`` (k,),
    ``away`` (k,) from the one, and are ``here`` (k, COUNT). Nearer their passages may grow by as much ``more`` (k, 3):
    for ever where that is infinite, by ``pace`` (k, 3) for each factor e, which tells of rays that
    rest for longer than over ``powers`` (k,) of e. Optical paths may be
    ``off`` (k, 3) beside what they are for their distances.
    """

    pair: np.ndarray
    side: np.ndarray
    angle: np.ndarray
    climb: np.ndarray
    away: np.ndarray
    here: np.ndarray
    more: np.ndarray
    pace: np.ndarray
    powers: np.ndarray
    off: np.ndarray

    @classmethod
    def of(cls, spread: Spread) -> BesideRests:
        """Those where passages grow."""
        pair, number, way = cls._sides(spread)
        places = 2.0 * number + np.outer([0.0, 1.0, 2.0], way) + np.outer([BREAK_OFFSET, 0.0, 0.0], np.sign(way))
        here, beside, before = np.split(spread(np.tile(pair, 3), places.ravel()), 3)
        last, earlier = here[:, :LAYERS] - beside[:, :LAYERS], beside[:, :LAYERS] - before[:, :LAYERS]
        angles = np.stack([spread.angles(pair, place) for place in places])
        rest = spread.passages.breaks[pair, number]
        away, apart = np.abs(angles - rest), rest > LEAST_BESIDE  # where it is not, g may turn by round-off
        endless = spread.passages.endless[pair, number] & apart[:, None]
        with np.errstate(all="ignore"):
            share = last / earlier
            more = np.where((earlier > 0) & (share < ENDLESS), 2 * last * share / (1 - share), np.inf)
            nearer = np.diff(np.log(away), axis=0)[..., None]
            pace, before = last / nearer[0], earlier / nearer[1]
            logarithmic = (np.abs(pace - before) <= LOGARITHMIC * pace) & apart[:, None]
            rounded = (spread.noise(pair, places[0]) * np.abs(here))[:, :LAYERS] / nearer[0]
            drowned = endless & (np.abs(pace - before) <= PLACES_ROUNDED * rounded)
        growing = (last > GROWN * spread.distance[pair, None]) & ~(last <= STEADY * earlier)
        more = np.where(endless | (growing & logarithmic), np.inf, np.where(growing, np.minimum(more, UNTOLD), 0.0))
        growing |= endless
        steady, known = (np.all(~growing | told, axis=1) for told in (logarithmic, logarithmic | drowned))
        powers = np.where(steady, 0.0, np.where(known, BEYOND_NUMBERS, np.inf))
        pace = np.where(growing, np.maximum(pace, 0.0), 0.0)
        side, root = np.sign(way), np.sqrt(spread.passages.g)[pair]
        climb, c = root * np.sin(angles[0]), root * np.cos(angles)
        # what paths are longer than by the index along the layer changes by the distances for each change of that index
        with np.errstate(all="ignore"):
            kept = [part[:, LAYERS:] - one[:, None] * part[:, :LAYERS] for part, one in ((here, c[0]), (beside, c[1]))]
            further = (away[1] - away[0])[:, None]
            between = here[:, :LAYERS] * further - pace * (away[1][:, None] * nearer[0] - further)
            off = np.abs(kept[1] - kept[0] - (side * climb)[:, None] * between)
        whole = cls(pair, side, angles[0], climb, away[0], here, more, pace, powers, off)
        kept = np.flatnonzero(growing.any(axis=1))
        return cls(*(column[kept] for column in vars(whole).values()))

    @staticmethod
    def _sides(spread: Spread) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The pairs (n,) and the numbers (n,) of breaks at which rays may rest, and steps (n,) to either side."""
        number = _counted(np.zeros_like(spread.passages.count), spread.passages.count)
        pair = np.repeat(np.arange(len(spread.distance)), spread.passages.count)
        pair, number, way = np.tile(pair, 2), np.tile(number, 2), np.repeat([-NEXT, NEXT], len(number))
        inside = np.where(way < 0, number > 0, number < spread.passages.count[pair] - 1)
        rows = np.flatnonzero(inside & ~spread.mild(pair, number) & ~spread.level(pair, number))
        return pair[rows], number[rows], way[rows]

    def tell(self, place: np.ndarray, left: np.ndarray, most: np.ndarray, pace: np.ndarray) -> np.ndarray:
        """Whether there is one ray (n,) beyond each ``place`` (n,) that has a distance ``left`` (n,) to come.

        Its passages together grow by as much as ``most`` (k,) and by ``pace`` (k,) for each factor e.
        """
        with np.errstate(invalid="ignore"):
            return np.isinf(most[place]) & (left > self.powers[place] * pace[place])

    def rays(
        self,
        place: np.ndarray,
        left: np.ndarray,
        pace: np.ndarray,
        off: np.ndarray,
        name: tuple[int, int, int],
        aim: np.ndarray,
    ) -> Reaching:
        """Those, of one family, whose optical paths may be ``off`` (k,) at the places."""
        slowly = np.maximum(pace[place], SLOWEST)
        further = left / slowly
        with np.errstate(over="ignore"):
            rates = -self.side[place] * np.minimum(slowly / self.away[place] * np.exp(further), STEEPEST_RATE)
        beside = self.side[place] * self.away[place]
        gains = beside * self.climb[place] * slowly * (further + np.expm1(-further))
        names = np.column_stack([np.tile(name, (len(place), 1)), aim])
        touching = np.zeros(len(place), dtype=bool)
        return Reaching(self.angle[place], names, rates, touching, beside * np.expm1(-further), gains, off[place])


@dataclass(frozen=True)
class Distances:
    """n distances that rays are to come, each along one of the pairs of heights, up to an optical path ``within`` (n,).

    ``way`` (n,) is 1 or -1, the sense about a centre, and ``question`` the number of the two points asked about.
    """

    distance: np.ndarray
    pair: np.ndarray
    within: np.ndarray
    way: np.ndarray
    question: np.ndarray

    @classmethod
    def of(
        cls, tabled: TabledPassages, pair: np.ndarray, distance: np.ndarray, within: np.ndarray, longest: np.ndarray
    ) -> Distances:
        """From one point to another; about a centre both ways round, and with windings.

        There are as many of these as rays of optical paths up to ``longest`` (p,) may come round.
        """
        question = np.arange(len(pair))
        if not tabled.passages.profile.about_centre:
            return cls(distance, pair, within, np.ones(len(pair)), question)
        pairs = np.arange(len(tabled.passages.start))
        some = np.linspace(1e-3, np.pi / 2 - 1e-3, SOME_ANGLES)
        every = np.repeat(pairs, SOME_ANGLES)
        scale = np.repeat(np.stack([np.full(len(pairs), np.pi), longest], axis=1)[every], LAYERS, axis=1)
        asked = tabled.at(every, np.tile(some, len(pairs)), scale)
        with np.errstate(all="ignore"):
            round_ = (asked[:, :LAYERS] / asked[:, LAYERS:]).reshape(len(pairs), -1)
            farthest = (longest * np.nanmax(round_, axis=1, initial=0.0))[pair]
        turns = np.minimum((farthest / (2 * np.pi)).astype(int) + 2, MOST_WINDINGS)
        row = np.repeat(question, 2 * turns)
        number = np.arange(len(row)) - np.repeat(np.cumsum(2 * turns) - 2 * turns, 2 * turns)
        back = number >= turns[row]
        turn = 2 * np.pi * np.where(back, number - turns[row] + 1, number)
        distances = np.where(back, turn - distance[row], turn + distance[row])
        return cls(distances, pair[row], within[row], np.where(back, -1.0, 1.0), row)


@dataclass(frozen=True)
class Families(Rows):
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

    @property
    def name(self) -> np.ndarray:
        """Rows (k, 4) that are the same on all panels of one family."""
        return np.column_stack([self.beyond, self.behind, self.periods, self.aim])

    @classmethod
    def possible(cls, series: Proxies, aims: Distances) -> tuple[Families, np.ndarray]:
        """Those that may come as far as is asked, on the optical path that is allowed, by the series' bounds.

        And for which distances (n,) these are not all: there are more with more turns.
        """
        least, most = series.bounds
        start, stop = (np.searchsorted(series.family, aims.pair, side=side) for side in ("left", "right"))
        aim = np.repeat(np.arange(len(start)), stop - start)
        panel = _counted(start, stop - start)
        distance, within = aims.distance[aim], aims.within[aim]
        least, most = least[panel], most[panel]
        parts, endless = [], np.zeros(len(start), dtype=bool)
        for beyond, behind in KINDS:
            w = np.array([1.0, 2.0 * beyond, 2.0 * behind])
            near, far = (np.where(w > 0, bound[:, :LAYERS] * w, 0.0).sum(axis=1) for bound in (least, most))
            short = np.where(w > 0, least[:, LAYERS:] * w, 0.0).sum(axis=1)
            period = [2 * bound.sum(axis=1) for bound in (least[:, :LAYERS], most[:, :LAYERS], least[:, LAYERS:])]
            with np.errstate(all="ignore"):
                first = np.ceil((distance - far) / period[1] - 1e-9)
                last = np.floor((distance - near) / np.maximum(period[0], 1e-300) + 1e-9)
                longest = np.floor((within - short) / np.maximum(period[2], 1e-300) + 1e-9)
            periodic = np.isfinite(period[1])
            # without a period only the first passage counts, and whether it can come so far
            once = (near <= distance * (1 + 1e-9)) & (far >= distance * (1 - 1e-9))
            first = np.where(periodic, np.maximum(np.nan_to_num(first), 0), np.where(once, 0, 1))
            last = np.where(periodic, np.minimum(last, longest), 0)
            last = np.where(np.isfinite(near) & (short <= within), last, -1)
            more = last > np.maximum(MOST_TURNS, first)
            endless[aim[more]] = True
            some = np.where(last > BEYOND_COUNT * MOST_TURNS, first + SOME_TURNS, MOST_TURNS)
            last = np.where(more, np.minimum(some, MOST_TURNS), last)
            some = np.flatnonzero(last >= first)
            count = (last - first)[some].astype(int) + 1
            row = np.repeat(some, count)
            m = _counted(first[some].astype(int), count)
            parts.append((panel[row], np.full(len(row), beyond), np.full(len(row), behind), m, aim[row]))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True))), endless


def rounded_up(values: np.ndarray) -> np.ndarray:
    """To powers of two: what is alike for questions of a size is the same, however many are asked."""
    with np.errstate(divide="ignore"):
        return np.exp2(np.ceil(np.log2(values)))


def _greatest(number: np.ndarray, values: np.ndarray, least: np.ndarray) -> np.ndarray:
    """The greatest of the ``values`` (k,) of each ``number`` (k,), and no less than ``least`` (p,)."""
    out = least.astype(float)
    np.maximum.at(out, number, values)
    return out


def _counted(start: np.ndarray, count: np.ndarray) -> np.ndarray:
    """start, start + 1, ... so many of each, one after the other."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - start, count)


def launches(
    profile: RayPotential,
    tables: PassageTables,
    ends: np.ndarray,
    pair: np.ndarray,
    distance: np.ndarray,
    within: np.ndarray,
) -> list[Launches]:
    """The rays between q pairs of points that come ``distance`` (q,) far, about a centre either way round.

    They go from the first to the second of the heights ``ends`` (p, 2), of which each question asks about one
    ``pair`` (q,), up to optical paths ``within`` (q,). What stands for the rays between two heights serves all
    questions about them.
    """
    longest = rounded_up(_greatest(pair, within, np.zeros(len(ends))))
    passages, swapped = RayPassages.between(profile, ends, longest)
    tabled = TabledPassages(passages, tables)
    aims = Distances.of(tabled, pair, distance, within, longest)
    size = rounded_up(_greatest(aims.pair, aims.distance, np.abs(ends[:, 1] - ends[:, 0])))
    nearest, farthest = -_greatest(aims.pair, -aims.distance, -size), _greatest(aims.pair, aims.distance, 0 * size)
    spread = Spread.of(tabled, nearest, farthest, size, longest)
    series = spread.series()
    touch = TOUCHES_FOLD * size[aims.pair]
    families, endless = Families.possible(series, aims)
    whole, families = _continua(spread, series, families, aims)
    weights, offset = families.weights, aims.distance[families.aim]
    found = zeros(series, families.panel, weights, offset, touch[families.aim])
    which = families.take(found.which)
    upright, (resting, doubtful) = _upright(tabled, aims, touch), _resting(spread, aims)
    with np.errstate(all="ignore"):  # at a break, from which angles are not told, there is no number
        rates = found.rates / spread.angle_rates(aims.pair[which.aim], found.at)
    at = spread.angles(aims.pair[which.aim], found.at)
    parts = [
        Reaching.there(*whole, np.zeros(len(whole[0])), np.ones(len(whole[0]), dtype=bool)),
        Reaching.there(at, which.name, rates, found.touching),
        Reaching.there(np.full(len(upright), np.pi / 2), upright, np.zeros(len(upright)), np.zeros(len(upright), bool)),
        resting,
    ]
    rays = _launched(tabled, Reaching.joined(parts), aims, swapped)
    own: list[tuple[list[Launch], ...]] = [([], [], []) for _ in pair]
    for (n, launch), kind in zip(rays, np.repeat([0, 1, 1, 2], [len(part) for part in parts]), strict=True):
        if launch.path <= aims.within[n]:
            own[aims.question[n]][kind].append(launch)
    for n, launch in _staying(passages, aims):
        own[aims.question[n]][1].append(launch)
    unresolved = series.given_up[pair] + np.bincount(aims.question[families.aim[found.lost]], minlength=len(pair))
    without_end = np.bincount(aims.question[endless], minlength=len(pair)) > 0
    return [
        Launches(*_apart(*own[q]), int(series.looked_at[pair[q]]), int(doubtful[q]), int(unresolved[q]), bool(end))
        for q, end in enumerate(without_end)
    ]


def _staying(passages: RayPassages, aims: Distances) -> Iterator[tuple[int, Launch]]:
    """The rays that stay on the layer of both points, each with the number of its aim."""
    root = np.sqrt(passages.g)[aims.pair]
    for n in np.flatnonzero(passages.stays_level(aims.pair, aims.distance)):
        c, distance = float(root[n]), float(aims.distance[n])
        if c * distance <= aims.within[n]:
            path, way = c * distance, int(aims.way[n])
            yield int(n), Launch(c, 0.0, 0.0, path, way, False, 0.0, distance, -1, np.inf, False, 0.0)


def _apart(level_ones: list[Launch], others: list[Launch], resting: list[Launch]) -> tuple[list[Launch], bool]:
    """The rays of a question, one of each family that all meet the point, and whether there are such families."""
    continua = _one_each(level_ones)
    alone = [
        one for one in others
        if not any(abs(one.path - other.path) <= SAME_CONTINUUM * other.path for other in continua)
    ]  # fmt: skip
    return continua + _distinct(alone) + resting, len(continua) > 0


def _continua(
    spread: Spread, series: Proxies, families: Families, aims: Distances
) -> tuple[tuple[np.ndarray, np.ndarray], Families]:
    """The most level ray (angle and family's name) of each family all of whose rays meet the point, and the others."""
    weights = families.weights
    used = np.where(weights[:, :, None] != 0, series.coefficients[families.panel], 0.0)
    c = np.einsum("kf,kfn->kn", weights, used)
    c[:, 0] -= aims.distance[families.aim]
    flat = np.abs(c).sum(axis=1) <= FLAT_FAMILY * spread.distance[aims.pair[families.aim]]
    if not np.any(flat):
        return (np.zeros(0), np.zeros((0, 4), int)), families
    names, number = np.unique(families.name, axis=0, return_inverse=True)
    number = number.ravel()
    pair = series.family[families.panel]
    low, high = (spread.angles(pair, edge[families.panel]) for edge in (series.low, series.high))
    share = np.bincount(number, np.where(flat, np.abs(high - low), 0.0), minlength=len(names)) / (np.pi / 2)
    whole = np.flatnonzero(share > CONTINUUM_SHARE)
    low, high = np.minimum(low, high), np.maximum(low, high)
    broad = flat & (high - low > BROAD)
    angles = [(low + high)[broad & (number == k)].min(initial=np.pi / 2) / 2 for k in whole]
    return (np.array(angles), names[whole]), families.take(np.flatnonzero(~np.isin(number, whole)))


def _upright(tabled: TabledPassages, aims: Distances, touch: np.ndarray) -> np.ndarray:
    """The names (k, 4) of families of rays at right angles to the layers that come as far as is asked for."""
    pairs = np.arange(len(tabled.passages.start))
    here = tabled.at(pairs, np.full(len(pairs), np.pi / 2), np.zeros((len(pairs), COUNT)))[aims.pair]
    rows = []
    for beyond, behind in KINDS:
        once = np.array([1.0, 2.0 * beyond, 2.0 * behind])
        came, path = (np.where(once > 0, once * half, 0.0).sum(axis=1) for half in (here[:, :LAYERS], here[:, LAYERS:]))
        further, longer = 2 * here[:, :LAYERS].sum(axis=1), 2 * here[:, LAYERS:].sum(axis=1)
        with np.errstate(all="ignore"):  # what does not exist is no number
            most = np.where(longer > 0, np.minimum((aims.within - path) / longer, MOST_TURNS), 0.0)
        count = np.where(path <= aims.within, np.nan_to_num(most).astype(int) + 1, 0)
        aim, m = np.repeat(np.arange(len(count)), count), _counted(np.zeros_like(count), count)
        there = came[aim] + np.where(m > 0, m * further[aim], 0.0)
        met = np.flatnonzero(np.abs(there - aims.distance[aim]) <= touch[aim])
        rows.append(np.column_stack([np.full(len(met), beyond), np.full(len(met), behind), m[met], aim[met]]))
    return np.concatenate(rows)


def _resting(spread: Spread, aims: Distances) -> tuple[Reaching, np.ndarray]:
    """The rays that rest along a layer more closely than angles can be told, and how many more (questions,) may.

    Passages grow there as the logarithm of how far off an angle is, so that there is one ray; or by no more than a kink
    allows, and nobody knows.
    """
    count, found = (
        np.zeros(int(aims.question.max(initial=-1)) + 1, dtype=int),
        [Reaching.there(np.zeros(0), np.zeros((0, 4), int), np.zeros(0), np.zeros(0, bool))],
    )
    places = BesideRests.of(spread)
    order = np.argsort(aims.pair, kind="stable")
    start, stop = (np.searchsorted(aims.pair[order], places.pair, side=side) for side in ("left", "right"))
    every = np.repeat(np.arange(len(start)), stop - start), order[_counted(start, stop - start)]
    slow = (np.sqrt(spread.passages.g)[places.pair] * np.cos(places.angle))[every[0]]
    for beyond, behind in KINDS:
        (place, aim), c = every, slow
        for periods in range(MOST_TURNS):
            name = beyond, behind, periods
            weights = np.array([1.0 + 2 * periods, 2.0 * (beyond + periods), 2.0 * (behind + periods)])
            used = weights > 0
            came, path = (half[:, used] @ weights[used] for half in np.split(places.here, 2, axis=1))
            left = aims.distance[aim] - came[place]
            still = np.flatnonzero((left > 0) & (path[place] + c * left <= aims.within[aim]))
            place, aim, c, left = place[still], aim[still], c[still], left[still]
            if len(still) == 0:  # whatever is no number has come nowhere
                break
            most, pace, off = (own[:, used] @ weights[used] for own in (places.more, places.pace, places.off))
            met = np.flatnonzero(left <= most[place])
            known = met[places.tell(place[met], left[met], most, pace)]
            np.add.at(count, aims.question[aim[np.setdiff1d(met, known)]], 1)
            found.append(places.rays(place[known], left[known], pace, off, name, aim[known]))
    return Reaching.joined(found), count


def _launched(tabled: TabledPassages, rays: Reaching, aims: Distances, swapped: np.ndarray) -> list[tuple[int, Launch]]:
    """The ``rays`` as they leave, each with the number of its aim."""
    if len(rays) == 0:
        return []
    angles, rates = rays.angles, rays.rates
    beyond, behind, m, aim = rays.names.T
    passages, pair = tabled.passages, aims.pair[aim]
    weights = Families(aim, beyond, behind, m, aim).weights[:, :LAYERS]
    root, way, distance = np.sqrt(passages.g)[pair], passages.way[pair], aims.distance[aim]
    c = root * np.cos(angles)
    scale = np.repeat(np.column_stack([distance, c * distance]), LAYERS, axis=1)
    here = tabled.at(pair, angles, scale)
    came, path = (np.where(weights > 0, weights * part, 0.0).sum(axis=1) for part in np.split(here, 2, axis=1))
    known = np.isfinite(came)
    short = np.where(known, distance - came, 0.0)
    # the optical path changes by c times the distance from ray to ray, and by c's change over that once more
    path = path + c * short + rays.gains
    c, w = root * np.cos(angles + rays.turned), root * np.sin(angles + rays.turned)
    last = np.sqrt(passages.higher[pair] + w**2)
    leaving, arriving = way * np.where(behind == 1, -w, w), way * np.where(beyond == 1, -last, last)
    speed, end = (np.where(swapped[pair], -one, two) for one, two in ((arriving, leaving), (leaving, arriving)))
    noise = np.max(passages.noise(pair, angles)[:, :LAYERS], axis=1, initial=0.0, where=weights > 0)
    with np.errstate(all="ignore"):
        off = (np.abs(short) + noise * distance) ** 2 * w / np.abs(rates)
        clear = known & ~rays.touching & (np.abs(rates) * last > CLEAR * path)
        clear &= len(passages.profile.jumps) == 0  # turning points do not tell what those do to neighbours
        # heights are told from the one end, to its round-off, where the path may grow fast at the other
        rounded = EPSILON * np.abs(passages.end - passages.start)[pair] * np.sqrt(root**2 + passages.higher[pair])
        well = (noise < TOLD_WELL) & (off < TOLD_WELL * path)
        off = np.where(well, off + noise * path, off + rays.off) + rounded
        off = np.where(clear & (off <= TOLD * path), off, np.inf)
    index = np.where(clear, _conjugate_points(2 * m + beyond + behind, rates), -1)
    columns = (
        c, speed, end, path, aims.way[aim].astype(int), rays.touching, noise, distance, index, off, well,
        np.abs(rates / w),
    )  # fmt: skip
    return [(int(n), Launch(*row)) for n, *row in zip(aim, *(column.tolist() for column in columns), strict=True)]


def _conjugate_points(turns: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """How many conjugate points (k,) rays pass in their plane that turn so often and whose distances so change.

    dX/dc grows along every stretch between two turning points, by g / (g - c²)^(3/2), from -∞ to ∞: there is one in
    each. It begins with 0, so that there is none before the first turning point, and after the last there is one if
    dX/dc has become positive. X falls with the angle where it grows with c.
    """
    return np.where(turns > 0, turns - 1 + (rates < 0), 0)


def _one_each(continua: list[Launch]) -> list[Launch]:
    """One ray of each continuum, all rays of which have the same optical path, either way round a centre."""
    kept: list[Launch] = []
    for launch in sorted(continua, key=lambda f: f.path):
        if not kept or launch.path - kept[-1].path > SAME_CONTINUUM * launch.path:
            kept.append(launch)
    return kept


def _distinct(found: list[Launch]) -> list[Launch]:
    """None twice: rays alike start with about the same speed, in whose order they come."""
    kept: list[Launch] = []
    for launch in sorted(found, key=lambda f: f.speed):
        near = SAME_RAY * math.hypot(launch.c, launch.speed)
        beside = takewhile(lambda other, launch=launch, near=near: launch.speed - other.speed <= near, reversed(kept))
        if not any(
            abs(launch.way * launch.c - other.way * other.c) <= near
            and abs(launch.path - other.path) <= SAME_RAY * launch.path
            for other in beside
        ):
            kept.append(launch)
    return kept
