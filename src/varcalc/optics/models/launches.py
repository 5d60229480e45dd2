"""The rays of layers and centres that come a given distance far, by the passages that they are made of.

A ray that turns any number of times comes as far as

    S + 2aU + 2bD + 2m(S + U + D),    a and b 0 or 1, m whole,

so that three functions of one unknown decide everything. Chebyshev series stand for them, and every zero of every
combination less the distance asked for is found (:mod:`varcalc.numerics.proxies`), however weak or narrow the gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.numerics.proxies import Proxies, zeros
from varcalc.optics.models.passages import BESIDE, COUNT, LAYERS, Passages, Spread
from varcalc.optics.models.reduction import Profile

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
BROAD = 0.02
"""Angles, in radians, of rays that stand for a continuum."""
SAME_CONTINUUM = 1e-6
"""Optical paths of the rays of one continuum agree so well, relative to their size."""
SAME_RAY = 1e-9
"""Launches and optical paths, relative, closer than this are one ray."""
NEXT, GROWN = 0.02, 1e-6
"""A passage that grows so much, in units of the distance, over the last of the way to an angle grows for ever."""


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
