"""Rays to a point in space where no plane is known to hold them.

The cells of a fan that may hold the point are parted, until in each the misses on a screen through the point are known
well enough to say that they vanish once at most, or nowhere. Their zeros are polished on the rays themselves.
Cells in which they keep more than one zero down to round-off are about a ray that touches a caustic at the point, or
about one of infinitely many rays to it.

Where rays go to and fro many times over, as in a long rod, cells that may hold the point become more from slab to slab
without end, and so do the rays. The slabs are searched in their order, so that all rays are known up to the optical
path at which there are more cells than can be looked into.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from varcalc.optics.arrivals.directions import STEP, headings
from varcalc.optics.arrivals.newton import ANGLE_ROUND_OFF, KNOWN
from varcalc.optics.arrivals.space_cells import COLUMNS, MOVED, PATH, P, R, SpaceCells, screen_misses
from varcalc.optics.arrivals.space_fan import LEAST_WIDTH, SpaceFan
from varcalc.optics.models.launches import SAME_CONTINUUM
from varcalc.optics.rays.beam import Rows
from varcalc.progress import Stage

MOST_HALVINGS = 18
"""Halvings of the first cells; misses next to a caustic, which are of second order, are round-off then."""
FEWEST_HALVINGS = 2
"""The same, where there are many."""
CROWDED = 6000
"""Cells left after a halving: where there are more, infinitely many rays may meet the point."""
MOST_PARTED, MOST_PARTED_SLOWLY = 24_000, 8_000
"""Cells that are parted for one point, and where it takes a hundred times longer to carry a ray."""
MOST_CENTRES = 600
"""Of cells that are given up: of so many the middle is polished still."""
MANY = 60
"""Of cells that are left: where so many are about rays that meet the point as they are, infinitely many do."""
AIMING_STEPS = 30
"""Newton's steps."""
MEETS = 4e-13
"""A ray that comes this close to the point, relative to the scene, meets it."""
MISS_ROUND_OFF = 1e-15
"""A miss so small, relative to the scene, is not worth another step."""
STEP_BACK = 0.75
"""Of a step to where no ray comes: how much of it is gone back."""
STRAYED = 3.0
"""Widths of a cell: a ray that goes farther from where it began belongs to another."""
SAME_RAY = 1e-8
"""Directions and optical paths, relative, closer than this are one ray."""
SINGULAR = 1e-6
"""Where the derivative of the misses shrinks to so little of what it is elsewhere, neighbours meet the point too."""


@dataclass(frozen=True)
class AimedRays(Rows):
    """k rays on their way to the point: the faces and places (k, 2) of their directions, σ and ``width`` of cells."""

    face: np.ndarray
    place: np.ndarray
    sigma: np.ndarray
    width: np.ndarray


@dataclass(frozen=True)
class Met(Rows):
    """k rays that meet the point: directions (k, 3), optical paths, and whether neighbours meet it too."""

    heading: np.ndarray
    path: np.ndarray
    touching: np.ndarray


@dataclass
class SpaceSearch:
    """The search for all rays of ``fan`` to ``target`` (3,), ``distance`` away from the source.

    All are found up to the optical path ``complete``, which is infinite unless there were more cells than are parted.
    """

    fan: SpaceFan
    target: np.ndarray
    distance: float
    unresolved: int = 0
    continuum: bool = False
    complete: float = np.inf
    _parted: int = 0
    _met: list[Met] = field(default_factory=list)

    @property
    def given_up(self) -> bool:
        """Whether there were more cells than are parted: no more are looked into."""
        return np.isfinite(self.complete)

    def take_in(self, cells: SpaceCells, stage: Stage) -> None:
        """Look into all ``cells`` of one slab that may hold the point."""
        if len(cells) == 0 or self.given_up:
            return
        from_here, found = float(np.nanmin(cells.state[..., PATH])), len(self._met)
        while len(cells) and not self.given_up:
            stage(0, f"{len(cells)} cells left from the optical path {from_here:.4g} on")
            cells = self._round(cells, from_here)
        if len(self._met) > found + 1:
            self._met[found:] = [Met.joined(self._met[found:])]

    @property
    def met(self) -> Met:
        """The rays that meet the point, the shortest optical path first."""
        if not self._met:
            return Met(np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=bool))
        return _distinct(Met.joined(self._met))

    def _round(self, cells: SpaceCells, from_here: float) -> SpaceCells:
        """Settle what can be settled; the parts of the other cells that may hold the point."""
        known = np.flatnonzero(cells.whole & np.isfinite(cells.error))
        again = np.ones(len(cells), dtype=bool)
        if len(known):
            again[known] = self._settled(cells.take(known))
        cells = cells.take(np.flatnonzero(again))
        if len(cells) > CROWDED and cells.depth.min() >= FEWEST_HALVINGS:
            cells = self._without_continua(cells, from_here)
        deep = (cells.depth >= MOST_HALVINGS) | (cells.width <= LEAST_WIDTH)
        if np.any(deep):
            self._closed(cells.take(np.flatnonzero(deep)))
            cells = cells.take(np.flatnonzero(~deep))
        self._parted += len(cells)
        if self._parted > (MOST_PARTED_SLOWLY if self.fan.slow else MOST_PARTED):
            self._give_up(cells, from_here)
        if len(cells) == 0 or self.given_up:
            return cells
        parts, _ = self.fan.parted(cells)
        return self.fan.held(parts, self.target)

    def _give_up(self, cells: SpaceCells, from_here: float) -> None:
        """Keep the rays that the middles of ``cells`` lead to, or of some of them, and look into no more."""
        some = np.unique(np.linspace(0, len(cells) - 1, min(len(cells), MOST_CENTRES)).astype(int))
        self._met.append(self._polished(self._centres(cells.take(some)), spread=True)[0])
        self.complete = from_here
        self.unresolved += 1

    def _settled(self, cells: SpaceCells) -> np.ndarray:
        """Note the zeros of the misses of ``cells``; True (k,) where these are doubtful."""
        misses = screen_misses(cells, self.target)
        rows = np.flatnonzero(misses.one & ~misses.over)
        share = misses.zeros(rows)
        off = misses.off[rows] + 0.1
        inside = np.all((share >= -off) & (share <= 1 + off), axis=1)
        rows, share = rows[inside], share[inside]
        corner, length = misses.sigma[rows], cells.sigma[rows, 1] - cells.sigma[rows, 0]
        a, b = share.T
        sigma = (1 - a) * ((1 - b) * corner[:, 0, 0] + b * corner[:, 0, 1])
        sigma += a * ((1 - b) * corner[:, 1, 0] + b * corner[:, 1, 1])
        # rays that meet the screen beyond the ends belong to the cell before or behind
        early, late = cells.sigma[rows, 0] - sigma, sigma - cells.sigma[rows, 1]
        here = np.maximum(early, late) <= 0.1 * length
        rows, share, sigma = rows[here], share[here], sigma[here]
        width = cells.width[rows]
        place = cells.low[rows] + share * width[:, None]
        met, lost = self._polished(AimedRays(cells.face[rows], place, sigma, width.astype(float)))
        self._met.append(met)
        doubtful = ~misses.over & ~misses.one
        doubtful[rows] = lost
        return doubtful

    def _centres(self, cells: SpaceCells) -> AimedRays:
        return AimedRays(
            cells.face, cells.low + cells.width[:, None] / 2, cells.sigma.mean(axis=1), cells.width.astype(float)
        )

    def _closed(self, cells: SpaceCells) -> None:
        """Cells that are not settled down to round-off: about rays that touch a caustic, or else unresolved."""
        met, lost = self._polished(self._centres(cells), spread=True)
        if len(met):
            self._met.append(met)
        if np.all(lost):
            self.unresolved += 1

    def _without_continua(self, cells: SpaceCells, from_here: float) -> SpaceCells:
        """The ``cells`` that are not about infinitely many rays to the point; none where they do not come to an end."""
        some = np.unique(np.linspace(0, len(cells) - 1, min(len(cells), MOST_CENTRES)).astype(int))
        met, _ = self._polished(self._centres(cells.take(some)), spread=True)
        if len(met) < MANY or not np.any(met.touching):
            return cells
        met, lost = self._polished(self._centres(cells), spread=True)
        self.continuum = True
        self._met.append(_one_each(met))
        left = cells.take(np.flatnonzero(lost))
        if len(left) > CROWDED:
            self._give_up(left, from_here)
        return left

    def _polished(self, aims: AimedRays, *, spread: bool = False) -> tuple[Met, np.ndarray]:
        """Those of the ``aims`` that meet the point, by Newton's iteration, and True (k,) for those that do not.

        With ``spread`` neighbours may meet it too. Whatever strays from the cell it is of belongs to another.
        """
        course = _Course.begun(aims)
        for _ in range(AIMING_STEPS):
            rows = np.flatnonzero(course.going)
            if len(rows) == 0:
                break
            states = self.fan.at(aims.face[rows], course.place[rows], course.sigma[rows])
            course.looked(rows, states, self.target, self.distance)
        rate = sum(np.linalg.norm(course.state[:, by], axis=1) for by in MOVED) / STEP
        known = np.fmin(ANGLE_ROUND_OFF * rate, KNOWN * self.distance)
        strayed = np.abs(course.best_place - aims.place).max(axis=1, initial=0.0) > STRAYED * aims.width
        there = (course.miss <= MEETS * self.distance + known) & ~strayed
        rows = np.flatnonzero(there)
        heading, _ = headings(aims.face[rows], course.best_place[rows])
        state = course.state[rows]
        path = state[:, PATH] + np.sum((self.target - state[:, R]) * state[:, P], axis=1)
        behind = ~there & (course.sigma <= 0)  # the ray would have to come from behind the last surface
        return Met(heading, path, course.singular[rows] & spread), ~there & ~behind


@dataclass
class _Course:
    """Newton's iterations of k ``aims``: where each looks next, by which ``step``, and the best place it has seen."""

    aims: AimedRays
    place: np.ndarray
    sigma: np.ndarray
    step: np.ndarray
    going: np.ndarray
    miss: np.ndarray
    state: np.ndarray
    best_place: np.ndarray
    singular: np.ndarray

    @classmethod
    def begun(cls, aims: AimedRays) -> _Course:
        """The iterations of ``aims`` before the first look."""
        k = len(aims)
        return cls(
            aims, aims.place.copy(), np.maximum(aims.sigma, 0.0), np.zeros((k, 3)), np.ones(k, dtype=bool),
            np.full(k, np.inf), np.full((k, COLUMNS), np.nan), aims.place.copy(), np.zeros(k, dtype=bool),
        )  # fmt: skip

    def looked(self, rows: np.ndarray, states: np.ndarray, target: np.ndarray, distance: float) -> None:
        """Take in what the ``rows`` have seen, and say where they look next; a step too far is gone back a part of."""
        off = states[:, R] - target
        miss = np.linalg.norm(off, axis=1)
        there = np.isfinite(miss)
        better = there & (miss < self.miss[rows])
        won, seen, unseen = rows[better], rows[there], rows[~there]
        self.miss[won], self.state[won], self.best_place[won] = miss[better], states[better], self.place[won]
        self.step[seen], singular = _newton(states[there], off[there], self.aims.width[seen])
        self.singular[won] = singular[better[there]]
        self.step[unseen] *= -STEP_BACK
        self.place[rows] += self.step[rows, :2]
        self.sigma[rows] = np.maximum(self.sigma[rows] + self.step[rows, 2], 0.0)
        self.step[unseen] *= -(1 - STEP_BACK) / STEP_BACK  # what is left of it
        strayed = np.abs(self.place[rows] - self.aims.place[rows]).max(axis=1) > STRAYED * self.aims.width[rows]
        done = (self.miss[rows] <= MISS_ROUND_OFF * distance) | ((self.miss[rows] <= MEETS * distance) & ~better)
        self.going[rows] = ~strayed & ~done


def _newton(state: np.ndarray, off: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Newton's steps (k, 3) of the place and σ, no longer than a cell, and whether neighbours meet the point too."""
    rates = np.stack([width[:, None] * state[:, by] for by in MOVED], axis=2)
    ahead = state[:, P] / np.linalg.norm(state[:, P], axis=1)[:, None]
    across = rates - np.einsum("kd,ke,kec->kdc", ahead, ahead, rates)
    miss = off - np.sum(off * ahead, axis=1)[:, None] * ahead
    u, s, v = np.linalg.svd(across, full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.einsum("kdc,kd->kc", u, miss) / s
    along = np.where(np.isfinite(along), along, 0.0)
    turn = -np.einsum("kcj,kc->kj", v, along)
    longest = np.abs(turn).max(axis=1, keepdims=True)
    turn *= np.minimum(1.0, 1 / np.maximum(longest, 1e-300))
    after = off + np.einsum("kdc,kc->kd", rates, turn)
    squared = np.sum(state[:, P] ** 2, axis=1)
    shift = -np.sum(after * state[:, P], axis=1) / squared
    return np.column_stack([turn * width[:, None], shift]), s[:, -1] <= SINGULAR * s[:, 0]


def _one_each(met: Met) -> Met:
    """One ray of each continuum: all of its rays have the same optical path, since it is stationary."""
    met = met.take(np.argsort(met.path, kind="stable"))
    return met.take(np.flatnonzero(np.append(True, np.diff(met.path) > SAME_CONTINUUM * met.path[1:])))


def _distinct(met: Met) -> Met:
    """The rays, none twice, by ascending optical path."""
    kept: list[int] = []
    met = met.take(np.lexsort((~met.touching, met.path)))
    for k in range(len(met)):
        same = False
        for j in reversed(kept):
            if met.path[k] - met.path[j] > 1e3 * SAME_RAY * met.path[k]:
                break
            same |= bool(np.linalg.norm(met.heading[k] - met.heading[j]) < SAME_RAY)
        if not same:
            kept.append(k)
    return met.take(kept)
