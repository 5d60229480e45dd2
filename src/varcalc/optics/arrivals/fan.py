"""The rays of one or more sources in a plane, as far as they may matter, laid out in cells.

A fan begins with rays all round each source. Where one of two neighbours
comes into the last medium and the other does not, the direction between them
that parts the two is closed in on. Behind the last surface the rays go from
wavefront to wavefront, in steps over which they turn little.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from varcalc.optics.arrivals.cells import MOVED, PATH, SLOPE_SHARE, Cells, P, R, beam_of, between, cell_states, parted
from varcalc.optics.media.medium import Field
from varcalc.optics.models.hamilton import HamiltonRays
from varcalc.optics.models.watch import MOST_SEARCHED, MOST_SEARCHED_TOGETHER, NOT_FOLLOWED, Watch, searching
from varcalc.optics.propagation.sequential import Noted, Propagator, UnderWay
from varcalc.optics.rays.beam import NOTHING, Beam, RayStatus, Rows, launched, stride
from varcalc.progress import Stage

FIRST_ANGLES = 64
"""Rays of a source to begin with."""
LOOKS = 16
"""By how many times more directions it is looked for surfaces, for jumps of the index, and for what bends rays."""
UNFORESEEN = 0.02
"""Of the scene, or radians: rays between two that are farther from where these foretell them met something narrow."""
AXES_OFF = 1e-3
"""By so much the first directions are off the axes of the scene."""
PARTS_OF_INTERVAL = 16
"""Parts into which the interval around a parting direction is cut, again and again."""
MOST_CUTS = 11
"""How often; the last interval is as narrow as round-off."""
FOLLOWED_CUTS = 5
"""Of these, those whose rays are followed past other surfaces, where no formula tells how they pass them."""
LEAST_ANGLE = 4 * float(np.spacing(2 * np.pi))
"""An interval of angles so narrow is not cut."""
FARTHER = 3.0
"""Neighbours come in no farther apart than so many times what their deviations tell."""
ON_THE_WALL = 1e-9
"""Of the scene: what is closer does not part."""
MOST_PARTINGS = 64
"""Parting directions of one source; where there are more, they are left to what looks into cells."""
SURELY = 2.0
"""Times what the middle between two rays is off a cubic: no more do rays between them differ from that."""
MOST_CLOSER = 40
"""Halvings of the interval between two rays that a surface lets through, or turns back."""
MOST_FOLLOWED = 20
"""The same where rays are followed past surfaces: they pass crests one after the other, and the next is not near."""
JUMPING = 4
"""After so many halvings what the middle is off tells jumps, where rays begin or cease to turn back to a surface."""
MOST_DOUBTFUL = 4096
"""Of these intervals at once, for each source; where there are more, they are given up and counted."""
NOT_ENTERED = -2.0
"""Courses of rays that do not come into the last medium are no larger: each way to end has a number."""
MOST_TURNED = 0.5
"""Radians: rays that leave the last surface in directions that are farther apart are no neighbours of one cell."""
MOST_WINDOWS = 8
"""How often it is looked for windows beside those that were found."""
STEP_SHARE = 0.25
"""How far a ray goes in one step: of the size of the scene, or of the distance from it."""
FRONT_SLACK = 0.25
"""Of n² at the source: how far the ends of cells are off wavefronts, which are crowded where n = 0."""
CELL_REACH = 1.0
"""A cell holds no point that is so many times its size away from all of its corners."""
LEAST_SHARE, MOST_SHARE = 0.1, 4.0
"""By how much less and more than it should a ray may go in order to keep step with the others."""
STEPS_TO_FRONT = 6
"""Newton's steps along a ray to a front."""
MOST_STEPS = 400
"""Steps of one ray."""


@dataclass(frozen=True)
class FanReach:
    """How far the rays of each of n sources are followed.

    ``path`` (n,) is the largest optical path and ``far`` (n,) the largest
    distance from ``middle`` (n, 2), the middle of the points to reach, which
    lie within ``reach`` (n,) of it; ``size`` (n,) is that of the scene.
    """

    path: np.ndarray
    far: np.ndarray
    middle: np.ndarray
    reach: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class AimedDirections:
    """Directions that a fan is to hold besides: ``angles`` (m,) of the numbers ``source`` (m,), in any order.

    ``looks`` is by how many times more directions it is looked for what bends rays.
    """

    source: np.ndarray
    angles: np.ndarray
    looks: int = LOOKS

    @classmethod
    def nowhere(cls) -> AimedDirections:
        """No directions besides the usual ones."""
        return cls(np.zeros(0, dtype=int), np.zeros(0))


@dataclass
class Fan:
    """Rays of ``sources`` (n, 2) through the scene ``propagator``; remembers how many were looked at and their ends."""

    propagator: Propagator
    sources: np.ndarray
    bounds: FanReach
    aimed: AimedDirections = field(default_factory=AimedDirections.nowhere)
    stage: Stage = field(default_factory=Stage)
    looked_at: int = 0
    ends: Counter[RayStatus] = field(default_factory=Counter)
    entered: int = 0
    given_up: np.ndarray = field(init=False)
    """How many rays of each source (n,) took more steps than are allowed."""

    def __post_init__(self) -> None:
        self.given_up = np.zeros(len(self.sources), dtype=int)
        self._gaps = np.zeros(0, dtype=bool)
        self._not_followed = False
        self._looking = searching(self.stage, len(self.sources))
        self.watch_anew(len(self.sources))

    def watch_anew(self, pairs: int) -> None:
        """Forget what rays have come to so far on their way from front to front; they are for so many ``pairs``."""
        self._moving = searching(self.stage, pairs)

    @property
    def spent(self) -> bool:
        """Whether rays have come to so many pieces of the index that no more of them are followed."""
        return self._moving.left <= 0

    def entries(self, source: np.ndarray, angles: np.ndarray) -> Beam:
        """The rays (m,) at ``angles`` where they come into the last medium; not a number where they do not."""
        return self._entered(source, angles)[0]

    def _entered(
        self, source: np.ndarray, angles: np.ndarray, *, noted: bool = False, followed: bool = False
    ) -> tuple[Beam, UnderWay]:
        """See :meth:`entries`; and how the rays came there or ended before."""
        start = self.sources[source]
        headings = np.column_stack([np.cos(angles), np.sin(angles)])
        beam = launched(start, headings, self.propagator.fields[0].index(start), neighbours=True)
        self.looked_at += len(angles)
        self.stage(0, f"laying out rays, {self.looked_at} looked at")
        watch = Watch(self.stage, MOST_SEARCHED)  # what threads count together depends on which is first
        last = len(self.propagator.surfaces)
        rays = self.propagator.into_medium(last, beam, self.bounds.path[source], watch, noted=noted, followed=followed)
        beam, alive = rays.beam, rays.alive
        self.ends.update(RayStatus(int(code)) for code in rays.status[~alive])
        self.entered += int(np.sum(alive))
        # one that touches a surface without going through it parts its neighbours: it is the edge of those that come in
        return beam.known(alive & np.all(np.isfinite(beam.moved), axis=(1, 2))), rays

    def at(self, source: np.ndarray, angles: np.ndarray, sigma: np.ndarray, path: np.ndarray) -> Beam:
        """The rays (m,) at ``angles``, ``sigma`` behind the last surface; ``path`` is their optical path there, about.

        Not a number where a ray does not come so far.
        """
        entry = self.entries(source, angles)
        return beam_of(self._moved(cell_states(entry), sigma, path)[0], 2)

    def _moved(self, states: np.ndarray, sigma: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Carry ``states`` (m, 10) in the last medium: see :class:`Carrier`. What is none stays none."""
        ends, grown = np.full_like(states, np.nan), np.zeros(len(states))
        rows = np.flatnonzero(np.isfinite(states[:, PATH]) & np.isfinite(path))
        if len(rows):
            last, begin = self.propagator.models[-1], beam_of(states[rows], 2)
            if isinstance(last, HamiltonRays):
                beam, grown[rows] = last.onward(begin, sigma[rows], path[rows], self._moving)
            else:
                beam, grown[rows] = last.onward(begin, sigma[rows], path[rows])
            ends[rows] = cell_states(beam)
        return ends, grown

    def cells(self) -> Cells:
        """The first cells of all sources."""
        source, angles, entry = self._first_rays()
        # as close as angles can be told, nothing comes in between rays that part
        told_apart = np.diff(angles) <= 2 * LEAST_ANGLE
        self._gaps = np.append(told_apart & self._far_apart(source, angles, entry), np.False_)
        parts = [self._between(rays) for rays in self._steps(source, angles, entry)]
        return Cells.joined([Cells.none(), *parts])

    def parted(self, cells: Cells) -> tuple[Cells, np.ndarray]:
        """The parts of the cells, which know of their errors by a look into the middle, and which cell each is of."""
        q = len(cells)
        state, sigma = np.empty((q, 3, 3, 10)), np.empty((q, 3, 3))
        state[:, ::2, ::2], sigma[:, ::2, ::2] = cells.state, cells.sigma
        middle = between(cells.angle[:, 1] - cells.angle[:, 0], cells.sigma, cells.delay)
        middle = np.maximum(middle, 0.0)
        middle[:, 1] = np.maximum(middle[:, 1], middle[:, 0])
        first, last = cells.state[:, :, 0, PATH].T
        path = (np.where(np.isfinite(first), first, last) + np.where(np.isfinite(last), last, first)) / 2
        entry = cell_states(self.entries(cells.source, cells.angle.mean(axis=1)))
        state[:, 1, 0], sigma[:, 1, 0] = self._moved(entry, middle[:, 0], path)
        self._halve(state, sigma, 1, (middle[:, 1] - middle[:, 0]) / 2, (0, 1))
        for side in (0, 2):
            self._halve(state, sigma, side, (sigma[:, side, 2] - sigma[:, side, 0]) / 2, (0,))
        return parted(cells, sigma, state, self._pull(state))

    def _halve(self, state: np.ndarray, sigma: np.ndarray, side: int, half: np.ndarray, steps: tuple[int, ...]) -> None:
        """Carry the rays at one ``side`` of cells half their lengths on, into the next place, once or twice."""
        for k in steps:
            begin = state[:, side, k]
            path = begin[:, PATH] + half * np.sum(begin[:, P] ** 2, axis=1)
            state[:, side, k + 1], grown = self._moved(begin, half, path)
            sigma[:, side, k + 1] = sigma[:, side, k] + grown

    def _pull(self, states: np.ndarray) -> np.ndarray:
        """dp/dσ (..., 2) of states (..., 10) in the last medium."""
        with np.errstate(all="ignore"):
            _, gradient, _ = self.propagator.fields[-1](states[..., R].reshape(-1, 2))
        return gradient.reshape(*states.shape[:-1], 2) / 2

    def _first_rays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Source, angle and entry (m, 10) of rays all round each source, ascending, the first once more at the end."""
        source, angles, usual = self._first_angles()
        looks = self._looked(source, angles)
        # what was looked at for something narrow alone stays where it found it
        usual = usual | self._unforeseen(source, angles, looks.entry, usual)
        apart = self._apart(looks)
        through = self._at_windows(looks, np.ones(len(looks), dtype=bool))
        looks = looks.take(np.flatnonzero(usual | np.append(apart, False) | np.append(False, apart)))
        looks = self._closed_in(_FanRays.joined([looks, through]).ordered())
        fresh = np.ones(len(looks), dtype=bool)
        for _ in range(MOST_WINDOWS if self.propagator.surfaces else 0):  # beside one there may be others, narrower
            through = self._at_windows(looks, fresh)
            if len(through) == 0:
                break
            before, looks = looks, self._closed_in(_FanRays.joined([looks, through]).ordered())
            fresh = looks.none_of(before)
        return looks.source, looks.angles, looks.entry

    def _looked(self, source: np.ndarray, angles: np.ndarray, *, followed: bool = True) -> _FanRays:
        """The rays (m,) at ``angles``, and what became of them."""
        beam, rays = self._entered(source, angles, noted=True, followed=followed)
        entry = cell_states(beam)
        assert rays.noted is not None
        way = rays.status * (len(self.propagator.surfaces) + 1) + rays.met
        ended = NOT_ENTERED - way * (len(self.propagator.geometries) + 1) - (rays.struck - NOTHING)
        course = np.where(np.isfinite(entry[:, PATH]), self._course(source, entry), ended)
        lost = ~np.isfinite(course)
        if np.any(lost):
            np.add.at(self.given_up, source[lost], 1)
            course[lost], self._not_followed = NOT_FOLLOWED, True
        return _FanRays(source, angles, entry, course, rays.noted)

    def _closed_in(self, looks: _FanRays) -> _FanRays:
        """The ``looks`` and closer ones on either side of directions that part them."""
        before, wider = looks, looks
        for cut in range(MOST_CUTS if self._parting else 0):
            parted = np.flatnonzero(self._apart(looks))
            parted = parted[looks.angles[parted + 1] - looks.angles[parted] > LEAST_ANGLE]
            if len(parted) > MOST_PARTINGS * len(self.sources):  # those of rays that end before come last
                parted = parted[np.maximum(looks.course[parted], looks.course[parted + 1]) > NOT_ENTERED]
            if len(parted) == 0 or len(parted) > MOST_PARTINGS * len(self.sources) or self._looking.left <= 0:
                break
            share = np.arange(1, PARTS_OF_INTERVAL) / PARTS_OF_INTERVAL
            low, high = looks.angles[parted, None], looks.angles[parted + 1, None]
            more = self._looked(
                np.repeat(looks.source[parted], len(share)), (low + share * (high - low)).ravel(), followed=False
            )
            looks = _FanRays.joined([looks, more]).ordered()
            wider = looks if cut < FOLLOWED_CUTS else wider
        if len(looks) == len(before) or all(self.propagator.told_at_once):
            return looks
        # all together take a fraction of the time
        new, followed = looks.none_of(before), ~looks.none_of(wider)
        again = self._looked(looks.source[new & followed], looks.angles[new & followed])
        return _FanRays.joined([before, again, looks.take(np.flatnonzero(new & ~followed))]).ordered()

    def _at_windows(self, looks: _FanRays, fresh: np.ndarray) -> _FanRays:
        """Rays (k,) that surfaces lead otherwise than both neighbours, or far apart.

        What is left of the normal momentum behind a surface is smooth in the angle, however often a graded medium turns
        rays on the way, and so is how far straight rays pass a surface: the derivatives tell whether it may come to
        nothing between two, and the middle, whether it is as they foretell; where it may, or is not, both halves are
        looked at. So they are where rays leave a surface in directions that are too far apart for a cell. What
        lies between two that are not ``fresh`` (m,) is known.
        """
        low = np.flatnonzero((looks.source[1:] == looks.source[:-1]) & (fresh[1:] | fresh[:-1]))
        found, (left, right) = [looks.take([])], (looks.take(low), looks.take(low + 1))
        met = left.same_way(right)
        left, right = left.take(met), right.take(met)
        for halving in range(MOST_CLOSER):
            wide = np.flatnonzero(right.angles - left.angles > LEAST_ANGLE)
            if len(wide) == 0:
                break
            if halving and len(wide) > MOST_DOUBTFUL * len(self.sources):
                np.add.at(self.given_up, np.unique(left.source[wide]), 1)
                break
            left, right = left.take(wide), right.take(wide)
            middle = self._looked(left.source, (left.angles + right.angles) / 2)
            coarse = middle.coarse(left, right)
            alike = np.zeros(len(middle), dtype=bool)
            alike[left.same_way(middle)] = True
            found.append(middle.take(np.flatnonzero(~alike | coarse)))
            closely = halving < MOST_FOLLOWED or all(self.propagator.told_at_once)
            doubtful = middle.doubtful(left, right, closely=closely, jumping=halving >= JUMPING)
            again = np.flatnonzero(alike & (coarse | doubtful))
            left, middle, right = left.take(again), middle.take(again), right.take(again)
            left, right = _FanRays.joined([left, middle]), _FanRays.joined([middle, right])
        return _FanRays.joined(found)

    def _apart(self, looks: _FanRays) -> np.ndarray:
        """True (m - 1,) for neighbouring rays of one source that part: by their course or where they come in.

        One meets a surface before a crest, the other behind it: they come in farther apart than neighbours do.
        """
        source, course = looks.source, looks.course
        far = self._far_apart(source, looks.angles, looks.entry)
        return (source[1:] == source[:-1]) & ((course[1:] != course[:-1]) | far)

    def _far_apart(self, source: np.ndarray, angles: np.ndarray, entry: np.ndarray) -> np.ndarray:
        """True (m - 1,) for neighbouring rays that come in farther apart than their deviations foretell."""
        if not self.propagator.surfaces:
            return np.zeros(max(len(angles) - 1, 0), dtype=bool)
        rate = np.linalg.norm(entry[:, MOVED], axis=1)
        room = FARTHER * np.diff(angles) * np.maximum(rate[1:], rate[:-1]) + ON_THE_WALL * self.bounds.size[source[1:]]
        return np.linalg.norm(np.diff(entry[:, R], axis=0), axis=1) > room

    def _first_angles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sources and angles to begin with, ascending, and which of them stay whatever is found there.

        Surfaces and jumps may be seen under small angles, and what bends rays: more directions are looked at, and
        those of the middles of surfaces.
        """
        n, more = len(self.sources), self.aimed.looks if self._parting or self._bending else 1
        angles = np.linspace(0.0, 2 * np.pi, more * FIRST_ANGLES + 1)
        usual = np.tile(np.arange(len(angles)) % more == 0, n)
        source, angles = np.repeat(np.arange(n), len(angles)), np.tile(angles, n)
        middles = [middle for one in self.propagator.surfaces if (middle := one.middle) is not None]
        for middle in dict.fromkeys(tuple(np.asarray(middle, dtype=float)) for middle in middles):
            away = np.array(middle) - self.sources
            toward = np.mod(np.arctan2(away[:, 1], away[:, 0]) - AXES_OFF, 2 * np.pi)
            source, angles = np.append(source, np.arange(n)), np.append(angles, toward)
            usual = np.append(usual, np.full(n, fill_value=False))
        source, angles = np.append(source, self.aimed.source), np.append(angles + AXES_OFF, self.aimed.angles)
        usual = np.append(usual, np.full(len(self.aimed.angles), fill_value=True))
        order = np.lexsort((angles, source))
        return source[order], angles[order], usual[order]

    @property
    def resolution(self) -> str:
        """What is said of surfaces and of jumps inside the medium."""
        if not self._parting:
            return ""
        said = f", surfaces and jumps that are seen under more than {360 / LOOKS / FIRST_ANGLES:.2g}°"
        if self._not_followed or self.spent:
            said += f", rays through no more than {MOST_SEARCHED} pieces of the index"
            said += f" each and {MOST_SEARCHED_TOGETHER} for each pair of points"
        return said

    @property
    def _bending(self) -> bool:
        """Whether rays are bent in the one medium by what may be narrow."""
        last = self.propagator.models[-1]
        return not self.propagator.surfaces and isinstance(last, HamiltonRays)

    def _unforeseen(self, source: np.ndarray, angles: np.ndarray, entry: np.ndarray, usual: np.ndarray) -> np.ndarray:
        """Which rays (m,) lie between two of the ``usual`` ones that do not foretell where all between them end."""
        out = np.zeros(len(angles), dtype=bool)
        if self._parting or not self._bending:
            return out
        path = self.bounds.path[source]
        ends, _ = self._moved(entry, path / np.sum(entry[:, P] ** 2, axis=1), path)
        number = np.cumsum(usual) - 1  # of the usual ray before
        first = np.flatnonzero(usual)
        low, high = first[number], first[np.minimum(number + 1, len(first) - 1)]
        width = angles[high] - angles[low]
        with np.errstate(all="ignore"):
            t, h = ((angles - angles[low]) / width)[:, None], width[:, None]
            a, b = ends[low], ends[high]
            foretold = (1 + 2 * t) * (1 - t) ** 2 * a[:, R] + t**2 * (3 - 2 * t) * b[:, R]
            foretold = foretold + h * t * (1 - t) * ((1 - t) * a[:, MOVED] - t * b[:, MOVED])
            off = np.linalg.norm(ends[:, R] - foretold, axis=1) > UNFORESEEN * self.bounds.size[source]
        off &= ~usual & (source[low] == source[high])
        narrow = np.zeros(len(first), dtype=bool)
        narrow[number[off]] = True
        return narrow[number]

    @property
    def _parting(self) -> bool:
        """Whether neighbouring rays may part."""
        return bool(self.propagator.surfaces) or self._jumps

    @cached_property
    def _jumps(self) -> bool:
        """Whether the index of the last medium jumps inside it."""
        last = self.propagator.models[-1]
        return isinstance(last, HamiltonRays) and last.jumps

    def _course(self, source: np.ndarray, entry: np.ndarray) -> np.ndarray:
        """What tells rays (m,) apart that are no neighbours: whether they come in, and through which jumps."""
        last = self.propagator.models[-1]
        if not (isinstance(last, HamiltonRays) and self._jumps):
            return np.isfinite(entry[:, PATH]).astype(float)
        course = np.full(len(entry), -1.0)
        rows = np.flatnonzero(np.isfinite(entry[:, PATH]))
        course[rows] = last.crossed(beam_of(entry[rows], 2), self.bounds.path[source[rows]], self._looking)
        return course

    def _steps(self, source: np.ndarray, angles: np.ndarray, entry: np.ndarray) -> list[_Stretch]:
        """The rays step by step; each is carried on as long as it or a neighbour is within the bounds."""
        sigma, states, rows = np.zeros(len(angles)), entry, np.arange(len(angles))
        stretches = []
        for _ in range(MOST_STEPS):
            within = self._within(source[rows], states)
            near = np.zeros(len(angles) + 2, dtype=bool)
            near[rows + 1] = within
            going = near[rows + 1] | near[rows] | near[rows + 2]
            rows, sigma, states = rows[going], sigma[going], states[going]
            if not np.any(within) or self.spent:
                break
            step = self._step(source[rows], sigma, states)
            path = states[:, PATH] + step * np.sum(states[:, P] ** 2, axis=1)
            after, grown = self._moved(states, step, path)
            grown = np.where(np.isfinite(after[:, PATH]), grown, step)
            stretches.append(_Stretch(source, angles, rows, sigma, states, sigma + grown, after))
            sigma, states = sigma + grown, after
        within = self._within(source[rows], states)
        np.add.at(self.given_up, source[rows[within]], 1)
        return stretches

    def _between(self, rays: _Stretch) -> Cells:
        """The cells between neighbours of a stretch."""
        first = np.flatnonzero((np.diff(rays.rows) == 1) & (np.diff(rays.source[rays.rows]) == 0))
        started = np.isfinite(rays.start[:, PATH])
        first = first[started[first] | started[first + 1]]
        first = first[~self._gaps[rays.rows[first]]]
        first = first[self._may_matter(rays, first)]
        pairs = np.stack([first, first + 1], axis=1)
        state = np.stack([rays.start[pairs], rays.end[pairs]], axis=2)
        source, before = rays.source[rays.rows[first]], rays.before[pairs]
        delay = self._delay(source, state)
        # what ends a cell may be any line through its corners: at one to which no ray comes it has no slope of its own
        delay[~np.isfinite(delay)] = 0.0
        delay[:, :, 0][before == 0] = 0.0  # the last surface is no front: σ begins there, however rays come in
        return Cells(
            source,
            rays.angles[rays.rows[pairs]],
            np.stack([before, rays.after[pairs]], axis=2),
            state,
            self._pull(state),
            delay,
            np.full(len(first), np.inf),
            np.full(len(first), np.inf),
            np.zeros(len(first), dtype=int),
        )

    def _may_matter(self, rays: _Stretch, first: np.ndarray) -> np.ndarray:
        """True (k,) for cells between the rays ``first`` (k,) and the next which are not far from every point."""
        source = rays.source[rays.rows[first]]
        corners = np.stack([rays.start[first], rays.start[first + 1], rays.end[first], rays.end[first + 1]], axis=1)
        width = rays.angles[rays.rows[first + 1]] - rays.angles[rays.rows[first]]
        away = np.linalg.norm(corners[..., R] - self.bounds.middle[source, None], axis=2)
        p, moved = corners[..., P], corners[..., MOVED]
        across = width[:, None] * np.abs(p[..., 0] * moved[..., 1] - p[..., 1] * moved[..., 0])
        across /= np.linalg.norm(p, axis=2)
        along = np.linalg.norm(corners[:, 2:, R] - corners[:, :2, R], axis=2)
        # rays that come in at grazing incidence do so far from each other, along the surface
        apart = np.linalg.norm(corners[:, 1::2, R] - corners[:, ::2, R], axis=2)
        size = np.maximum(across.max(axis=1), apart.max(axis=1)) + along.max(axis=1)
        far = away.min(axis=1) > self.bounds.reach[source] + CELL_REACH * size
        return ~far  # also where a corner is missing

    def _within(self, source: np.ndarray, states: np.ndarray) -> np.ndarray:
        """True (m,) for rays that may still come to a point."""
        away = np.linalg.norm(states[:, R] - self.bounds.middle[source], axis=1)
        with np.errstate(invalid="ignore"):
            inside = (states[:, PATH] < self.bounds.path[source]) & (away < self.bounds.far[source])
        return inside & np.isfinite(away)

    def _step(self, source: np.ndarray, sigma: np.ndarray, states: np.ndarray) -> np.ndarray:
        """How far in σ (m,) each ray goes, so that all of a source come to one wavefront, about, and turn little."""
        away = np.linalg.norm(states[:, R] - self.bounds.middle[source], axis=1) - self.bounds.reach[source]
        length = STEP_SHARE * np.maximum(self.bounds.size[source], away)
        beam, last = beam_of(states, 2), self.propagator.fields[-1]
        slack = self._slack[source]
        ahead = states[:, PATH] + slack * sigma
        gain = stride(beam.position, beam.momentum, last, length) * (np.sum(states[:, P] ** 2, axis=1) + slack)
        front = _medians(source, ahead + gain, gain > 0)[source]
        return _to_front(beam, last, front - ahead, gain, slack)

    def _delay(self, source: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The derivatives of σ by the launching angle along the fronts through ``states`` (q, ..., 10)."""
        p, moved = states[..., P], states[..., MOVED]
        slack = self._slack[source].reshape(-1, *[1] * (states.ndim - 2))
        return -np.sum(p * moved, axis=-1) / (np.sum(p**2, axis=-1) + slack)

    @cached_property
    def _slack(self) -> np.ndarray:
        """What is added to n² (n,) in ∫ n² dσ, that its level lines be smooth also where n = 0."""
        return FRONT_SLACK * self.propagator.fields[0].index(self.sources) ** 2


@dataclass(frozen=True)
class _FanRays(Rows):
    """m rays of the fan where they come into the last medium: sources, angles, states (m, 10) and courses.

    What is ``noted`` is what surfaces did to them.
    """

    source: np.ndarray
    angles: np.ndarray
    entry: np.ndarray
    course: np.ndarray
    noted: Noted

    def none_of(self, others: _FanRays) -> np.ndarray:
        """True (m,) for rays that are none of the ``others``."""
        return ~np.isin(self.source + 1j * self.angles, others.source + 1j * others.angles)

    def same_way(self, other: _FanRays) -> np.ndarray:
        """The numbers of the rays that come to the same surfaces as those of ``other``, and as far through them."""
        own, others = self.noted.behind[..., 0], other.noted.behind[..., 0]
        alike = np.all((np.isfinite(own) == np.isfinite(others)) & ((own > 0) == (others > 0)), axis=1)
        return np.flatnonzero(alike & (np.minimum(self.course, -1.0) == np.minimum(other.course, -1.0)))

    def doubtful(self, left: _FanRays, right: _FanRays, *, closely: bool, jumping: bool) -> np.ndarray:
        """Where (m,) a surface may do otherwise to rays between ``left`` and ``right``; these are the middle ones.

        How ``closely`` rays pass surfaces counts if it is wanted. If what they tell may be ``jumping``, what is off by
        more than the slopes can make up for has nothing to do with edges unless these lead to one.
        """
        third = (right.angles - left.angles)[:, None, None] / 3
        told = slice(None if closely else 1)
        (low, rise), (middle, rate), (high, fall) = (rays.noted.smooth[..., told] for rays in (left, self, right))
        # a surface that only some of them come close to has been passed by others, about so
        known = np.isfinite(middle)
        low, rise = np.where(known & np.isnan(low), [middle - 1.5 * third * rate, rate], [low, rise])
        high, fall = np.where(known & np.isnan(high), [middle + 1.5 * third * rate, rate], [high, fall])
        # a cubic lies between its control points
        points = np.stack([low, low + third * rise, high - third * fall, high])
        foretold = points[:2].sum(axis=0) / 8 + points[1:3].sum(axis=0) / 4 + points[2:].sum(axis=0) / 8
        off = np.abs(middle - foretold)
        with np.errstate(invalid="ignore"):
            parting = (points.min(axis=0) <= 0) & (points.max(axis=0) >= 0)
            near = np.abs(np.append(points, middle[None], axis=0)).min(axis=0) <= SURELY * off
            reach = 3 * SURELY * third * np.abs([rise, rate, fall])
            jump = jumping & (off > reach.max(axis=0)) & np.all(np.abs([low, middle, high]) > reach, axis=0)
            # of two on either side of an edge it is known that something is between
            return np.any((parting | near) & (low * high > 0) & ~jump, axis=(1, 2))

    def coarse(self, left: _FanRays, right: _FanRays) -> np.ndarray:
        """Where (m,) rays between ``left`` and ``right`` leave a surface too far apart for a cell, or unforeseen.

        These are the middle ones; what is asked is their direction, and how it changes with the launching angle.
        """
        width = (right.angles - left.angles)[:, None]
        (before, low), (middle, here), (after, high) = (
            np.moveaxis(rays.noted.headings, 2, 0) for rays in (left, self, right)
        )
        first, last = (np.remainder(turn + np.pi, 2 * np.pi) - np.pi for turn in (middle - before, after - middle))
        low, here, high = width * low, width * here, width * high
        off = np.abs(first - last - (low - high) / 4) / 2
        off += SLOPE_SHARE * np.abs(1.5 * (first + last) - (low + high) / 4 - here)
        with np.errstate(invalid="ignore"):
            far = np.abs([first, last, low, here, high]).max(axis=0) > MOST_TURNED
            return np.any(far | (off > UNFORESEEN), axis=1)

    def ordered(self) -> _FanRays:
        """By source, then by angle."""
        return self.take(np.lexsort((self.angles, self.source)))


@dataclass(frozen=True)
class _Stretch:
    """One step of the ``rows`` of all rays, which are ascending: σ and states before and after it."""

    source: np.ndarray
    angles: np.ndarray
    rows: np.ndarray
    before: np.ndarray
    start: np.ndarray
    after: np.ndarray
    end: np.ndarray


def _medians(source: np.ndarray, values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """The middle one of each source's ``values`` (m,) that are ``counted``; zero where there is none."""
    number = int(source.max(initial=-1)) + 1
    rows = np.flatnonzero(counted)
    rows = rows[np.lexsort((values[rows], source[rows]))]
    count = np.bincount(source[rows], minlength=number)
    medians = np.zeros(number)
    some = count > 0
    medians[some] = values[rows[(np.cumsum(count) - count + count // 2)[some]]]
    return medians


def _to_front(beam: Beam, field: Field, path: np.ndarray, usual: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """σ (m,) over which ∫ (n² + slack) dσ grows by about ``path`` (m,), at least by a share of ``usual``.

    By the Taylor polynomial of the third degree; dS/dσ = n², the square of the momentum.
    """
    _, gradient, hessian = field(beam.position)
    p, pull = beam.momentum, gradient / 2
    path = np.clip(path, LEAST_SHARE * usual, MOST_SHARE * usual)
    first, second = np.sum(p**2, axis=1) + slack, np.sum(p * pull, axis=1)
    third = (np.sum(pull**2, axis=1) + np.einsum("mi,mij,mj->m", p, hessian, p) / 2) / 3
    with np.errstate(all="ignore"):
        sigma = path / first
        for _ in range(STEPS_TO_FRONT):
            off = sigma * (first + sigma * (second + sigma * third)) - path
            slope = first + sigma * (2 * second + 3 * sigma * third)
            new = sigma - off / slope
            sigma = np.where((slope > 0) & (new > 0), new, sigma / 2)
    return np.where(np.isfinite(sigma), sigma, 0.0)
