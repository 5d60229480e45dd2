"""All rays between two points of layers or about a centre, by the range function.

A ray that starts with the invariant c comes to the height of the other end at
distances X = c τ that are integrals. The hits of that height have numbers,
and the distance of each is a smooth function of the launching angle, but
where c passes a value at which rays are caught along a layer. So X = the
distance asked for is an equation in one unknown for each number: nothing has
to be followed through space.

The search starts from the end with the smaller g: seen from there the other
is never a turning point (rays can be gone along backwards).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, OneTurn, TwoTurns, bounds, ways
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import AGREED, BY_C, TAU, half_periods, integrals
from varcalc.numerics.roots import FamilyValues, ZeroSearch
from varcalc.optics.media.medium import Medium, Radial
from varcalc.optics.models.model import Builder, DoesNotApply, Question
from varcalc.optics.models.reduction import PATH, Profile, ReducedRays, started_later
from varcalc.optics.rays.beam import frames
from varcalc.optics.rays.ray import Ray, Rays

MOST_PERIODS = 64
"""Whole periods of a ray that is caught between two heights; rays with more are not looked for."""
MOST_WINDINGS = 64
"""Times about a centre, either way; rays that go round more often are not looked for."""
TOUCHES_FOLD = 2e-13
"""Of the distance: a fold that comes so close to it touches it."""
FLAT_FAMILY = 1e-10
"""The same, for rays at many angles: integrals of steep rays have that much round-off."""
SOME_ANGLES = np.linspace(-1.4, 1.4, 60)
"""None of them level, which is a special case."""
CONTINUUM_SHARE = 0.25
"""Of these angles: where as many rays meet the point, all of them do."""
BREAKS_ALWAYS = np.array([-np.pi / 2, 0.0, np.pi / 2])
"""The angles, down, level and up, at which every range function may break."""
SAME_MINIMUM = 1e-11
"""Of g: minima that differ by less are one."""
STAYS_LEVEL = 1e-7
"""Of g: where it changes by less over the distance, rays that start level stay so, all but for round-off."""
SAME_CONTINUUM = 1e-6
"""Optical paths of the rays of one continuum agree so well, relative to their size."""
SAME_RAY = 1e-9
"""Launches and optical paths, relative, closer than this are one ray."""
UPRIGHT = 1e-13
"""Of the distance of two points: what they lie apart along layers is none."""
CARRIED_WELL, MEETS = 1e-11, 1e-6
"""Of the distance of two points: a ray that misses the second by more is carried again, or was none."""
ERROR_MARGIN = 4.0
"""By how many times the difference of two optical paths either may be off."""
PANELS = 32
"""Panels whose errors, each within that to which they are integrated, may add up in an optical path."""


@dataclass(frozen=True)
class Hits:
    """What rays at angles (m,) do at their first two hits of the height: (m, 2), not numbers where there is none.

    ``apart`` and ``later`` (m,) are the distance and the optical path from each to the next but one, zero where
    there is none.
    """

    distance: np.ndarray
    rate: np.ndarray
    path: np.ndarray
    speed: np.ndarray
    apart: np.ndarray
    apart_rate: np.ndarray
    later: np.ndarray


@dataclass(frozen=True)
class Range:
    """Rays from the height ``start`` to the height ``end`` of ``profile``, with g smaller at the start."""

    profile: Profile
    nodes: PotentialNodes
    start: float
    end: float

    @classmethod
    def between(cls, profile: Profile, ends: tuple[float, float]) -> tuple[Range, bool]:
        """The rays between two heights, and whether they start from the second."""
        g = profile.at(np.array(ends))[0]
        swapped = bool(g[1] < g[0])
        start, end = ends[::-1] if swapped else ends
        return cls(profile, profile.nodes(min(ends), max(ends), -np.inf, np.inf), start, end), swapped

    def easy(self, distance: float) -> bool:
        """Whether the range function has no logarithms: there is no end of detail near them.

        It has where rays are caught along a layer between others, and where those that start level stay so.
        """
        return len(self.breaks()) == len(BREAKS_ALWAYS) and not self._level(distance)

    def hits(self, angles: np.ndarray) -> Hits:
        """The hits of rays that start at ``angles`` (m,) from the layers, between ±π/2; rates are derivatives by it."""
        m = len(angles)
        u0 = np.full(m, self.start)
        g = self.profile.at(u0)[0]
        c, w = np.sqrt(g) * np.cos(angles), np.sqrt(g) * np.sin(angles)
        free = np.full(m, np.inf)
        sides = [bounds(self.profile, self.nodes, u0, w**2, c**2, free, sign) for sign in (-1, 1)]
        out = Hits(*(np.full((m, 2), np.nan) for _ in range(4)), *(np.zeros(m) for _ in range(3)))
        with np.errstate(all="ignore"):  # where there is no hit, or the way is not resolved, there is no number
            for rows, way, last in ways(self.profile, u0, w, *sides):
                self._on_ways(way, last, rows, c, w, out)
        return out

    def _on_ways(
        self, way: CoordinateMotion, last: np.ndarray, rows: np.ndarray, c: np.ndarray, w: np.ndarray, out: Hits
    ) -> None:
        """Write the hits of ``rows``, whose motions are ``way``, into ``out``."""
        c, w = c[rows], w[rows]
        c_rate, C_rate = -w, -2 * c * w  # by the angle: c = N cos, w = N sin
        start = way.at(way.start[:, None])
        nothing = np.zeros((len(c), 1))
        turned = ReducedRays(nothing[:, 0], w, c**2, nothing, c[:, None], C_rate[:, None])
        delay = (start.rate * started_later(turned, start))[:, 0]
        for k, q in enumerate(self._parameters(way, last)):
            sums = integrals(way, way.start, q)
            end = way.at(q[:, None])
            tau_rate = sums[:, BY_C] * C_rate - delay - end.u_by_c[:, 0] * C_rate / end.w[:, 0]
            out.distance[rows, k], out.path[rows, k] = c * sums[:, TAU], sums[:, PATH]
            out.rate[rows, k] = c_rate * sums[:, TAU] + c * tau_rate
            out.speed[rows, k] = end.w[:, 0]
        if isinstance(way, TwoTurns):
            half = half_periods(way)
            out.apart[rows], out.later[rows] = 2 * c * half[:, TAU], 2 * half[:, PATH]
            out.apart_rate[rows] = 2 * (c_rate * half[:, TAU] + c * half[:, BY_C] * C_rate)

    def _parameters(self, way: CoordinateMotion, last: np.ndarray) -> list[np.ndarray]:
        """The parameters (m,) of the first two hits; not numbers where there are none."""
        x = np.full(len(last), self.end) - self.start
        if isinstance(way, TwoTurns):
            height = x + (self.start - way.low)
            q = 2 * np.arctan2(np.sqrt(height), np.sqrt(way.span - height))
            q = np.abs(way.start) if self.start == self.end else q  # the start itself is no hit
            both = np.stack([_after(q, way.start), _after(-q, way.start)])
            return [both.min(axis=0), both.max(axis=0)]
        if isinstance(way, OneTurn):
            q = np.sqrt(way.sign * (way.offset + x))
            both = np.where(np.stack([-q, q]) > way.start, np.stack([-q, q]), np.nan)
            both = np.where(both <= last, both, np.nan)
            return [np.fmin(*both), np.where(np.all(np.isfinite(both), axis=0), both[1], np.nan)]
        q = way.reaching(x)
        return [np.where((q > 0) & (q <= last), q, np.nan), np.full(len(q), np.nan)]

    def _level(self, distance: float) -> bool:
        """True where a ray that starts along the layers stays there over the ``distance``, all but for round-off."""
        g, slope = self.profile.at(np.array([self.start]))
        return bool(np.abs(slope[0]) * (1.0 if self.profile.about_centre else distance) <= STAYS_LEVEL * g[0])

    def breaks(self) -> np.ndarray:
        """The angles, ascending from -π/2 to π/2, between which the hits are smooth functions."""
        g0 = float(self.profile.at(np.array([self.start]))[0][0])
        g = self.nodes.g
        levels = np.sort([*self.nodes.separatrices, g[0], g[-1]])
        levels = levels[(levels > 0) & (levels < g0 * (1 - SAME_MINIMUM))]  # a flat top is full of dips that are none
        levels = levels[np.diff(levels, prepend=0.0) > SAME_MINIMUM * levels]
        inner = np.unique(np.arccos(np.sqrt(levels / g0)))
        return np.unique(np.concatenate([BREAKS_ALWAYS, inner, -inner]))


def _after(q: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The first of q + 2πk after ``start``."""
    return q + 2 * np.pi * (np.floor((start - q) / (2 * np.pi)) + 1)


@dataclass(frozen=True)
class Launch:
    """A ray found: its invariant ``c``, its ``speed`` du/dτ at the first point, its optical path, the ``way`` round.

    The way is 1 or -1, the sense about a centre.
    """

    c: float
    speed: float
    path: float
    way: int
    touching: bool


@dataclass(frozen=True)
class Launches:
    """The rays found, and what was searched: see :class:`varcalc.numerics.roots.Zeros`."""

    found: list[Launch]
    continuum: bool
    looked_at: int
    unresolved: int


def launches(profile: Profile, ends: tuple[float, float], distance: float, within: float) -> Launches:
    """The rays from the first height to the second that come ``distance`` far, about a centre either way round."""
    spread, swapped = Range.between(profile, ends)
    some = spread.hits(SOME_ANGLES)
    turns = _most_periods(some, within)
    distances = _distances(profile, distance, _farthest(some, within, turns))
    wanted = np.array([distance for distance, _ in distances])
    touch = TOUCHES_FOLD * float(max(wanted.max(), abs(ends[1] - ends[0])))

    family = _families(some, wanted, within, turns)
    alike = np.abs(family.value) <= FLAT_FAMILY / TOUCHES_FOLD * touch
    whole = np.mean(alike, axis=1) > CONTINUUM_SHARE
    # the most level ray of a continuum goes least far
    numbers, first = np.flatnonzero(whole), np.argmin(np.where(alike, np.abs(SOME_ANGLES), np.inf)[whole], axis=1)
    near = family.bound[numbers, first] <= 0
    numbers, first = numbers[near], first[near]

    def asked_for(angles: np.ndarray) -> FamilyValues:
        family = _families(spread.hits(angles), wanted, within, turns)
        return FamilyValues(np.where(whole[:, None], np.nan, family.value), family.rate, family.bound)

    zeros = ZeroSearch(asked_for, spread.breaks(), touch).run()
    angles, touching = np.append(SOME_ANGLES[first], zeros.at), np.append(np.full(len(first), 1.0), zeros.touching) > 0
    found = _launched(spread, angles, np.append(numbers, zeros.number), distances, turns, touching, swapped=swapped)
    isolated = [f for f in found[len(first) :] if f.path <= within]
    return Launches(
        _one_each(found[: len(first)]) + _distinct(isolated), len(first) > 0, zeros.looked_at, zeros.unresolved
    )


def _most_periods(hits: Hits, within: float) -> int:
    """How many whole periods rays may go through on an optical path of ``within``, and one for the first hits."""
    later = hits.later[hits.later > 0]
    return int(min(within / later.min(), MOST_PERIODS)) + 1 if len(later) else 1


def _farthest(hits: Hits, within: float, turns: int) -> float:
    """The largest distance that one of the rays comes on an optical path of ``within``, about."""
    with np.errstate(all="ignore"):
        periods = np.clip(np.floor((within - hits.path) / hits.later[:, None]), 0, turns)
        far = hits.distance + np.where(np.isfinite(periods), periods, 0.0) * hits.apart[:, None]
    return float(np.max(far, where=np.isfinite(far), initial=0.0))


def _distances(profile: Profile, distance: float, farthest: float) -> list[tuple[float, int]]:
    """The distances from one point to the other, with the sense; about a centre both ways and with windings."""
    if not profile.about_centre:
        return [(distance, 1)]
    turns = range(min(int(farthest / (2 * np.pi)) + 2, MOST_WINDINGS))
    ahead = [(distance + 2 * np.pi * k, 1) for k in turns]
    return ahead + [(2 * np.pi * (k + 1) - distance, -1) for k in turns]


def _families(hits: Hits, wanted: np.ndarray, within: float, turns: int) -> FamilyValues:
    """The functions X - distance for every distance, number of whole periods and hit, in this order; (F, m)."""
    turn = np.arange(turns)[:, None, None]  # with periods only where there are any
    real = (turn == 0) | (hits.apart[:, None] > 0)
    distance = np.where(real, hits.distance + turn * hits.apart[:, None], np.nan)
    rate = np.where(real, hits.rate + turn * hits.apart_rate[:, None], np.nan)
    bound = hits.path + turn * hits.later[:, None] - within
    value = distance[None] - wanted[:, None, None, None]
    shape = value.shape

    def flat(a: np.ndarray) -> np.ndarray:
        return np.moveaxis(np.broadcast_to(a, shape), 3, 2).reshape(-1, shape[2])

    return FamilyValues(flat(value), flat(rate[None]), flat(bound[None]))


def _launched(
    spread: Range, angles: np.ndarray, numbers: np.ndarray, distances: list[tuple[float, int]], turns: int,
    touching: np.ndarray, *, swapped: bool,
) -> list[Launch]:  # fmt: skip
    """The rays that are the zeros of the functions ``numbers`` (k,) at ``angles`` (k,)."""
    which, rest = np.divmod(numbers.astype(int), 2 * turns)
    turn, hit = np.divmod(rest, 2)
    if len(angles) == 0:
        return []
    hits = spread.hits(angles)
    root = float(np.sqrt(spread.profile.at(np.array([spread.start]))[0][0]))
    rows = np.arange(len(angles))
    path = hits.path[rows, hit] + turn * hits.later
    speed = -hits.speed[rows, hit] if swapped else root * np.sin(angles)
    return [
        Launch(
            float(root * np.cos(angles[k])), float(speed[k]), float(path[k]), distances[which[k]][1], bool(touching[k])
        )
        for k in rows
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


def found_by_range(question: Question, *, careful: Builder | None = None, easy: bool = False) -> Rays:
    """The rays that answer ``question``, whose one medium is ``Stratified`` or ``Radial`` and has no surfaces.

    A ray that misses the point as the question carries it, since it went far out where digits are lost, is carried the
    ``careful`` way, if there is one.

    Raises :class:`DoesNotApply` where an end is the centre of the index and, if asked for ``easy`` questions only,
    where the range function has logarithms.
    """
    frame = Frame(question.media[0], question.a, question.b)
    if easy and not Range.between(frame.profile, frame.heights)[0].easy(frame.distance):
        raise DoesNotApply(
            "some rays come to rest along a layer, and the range function is no simple one; take Hamilton()"
        )
    found = launches(frame.profile, frame.heights, frame.distance, question.within)
    carried = _carried(question, careful, frame, found.found)
    rays = sorted(carried, key=lambda ray: ray.optical_path)
    unresolved = found.unresolved + len(found.found) - len(rays)
    searched = (
        f"all launching angles by the range function ({found.looked_at} looked at, {unresolved} narrow "
        f"intervals left unresolved), optical paths up to {question.within:.6g}"
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
    floor, again = np.zeros(len(found)), np.flatnonzero([miss > CARRIED_WELL for _, miss in built])
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
