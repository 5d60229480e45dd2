"""All arrivals: which rays of a plane lead from sources to points, many pairs at once.

The cells of a fan that may hold a point are halved, point by point, until the
miss in them is foretold well enough to be believed. Then each of its zeros is
polished, and each small extremum found: near a caustic that says whether
there are two rays, one or none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.optics.cells import PATH, Cells
from varcalc.optics.fan import FIRST_ANGLES, Fan
from varcalc.optics.misses import Misses, Seeds, misses, seeds
from varcalc.optics.polish import TOUCHING, Aims, Meeting, as_they_are, flattest, gathered, joined, met

DEEPEST = 24
"""Halvings of a cell."""
UNSEEN = 0.25
"""Of the diagonal of a cell that nobody has looked into: how far beyond its box a point may yet be in it."""
NEARLY = 1e-3
"""Rays that miss the point by less, relative to the scene, nearly meet it."""
CONTINUUM = 0.25
"""Of all directions: where so many meet a point, infinitely many do."""
SAME = 1e-9
"""Angles, and optical paths relative to their size, that differ by less are of one ray."""


@dataclass(frozen=True)
class Pairs:
    """k pairs: the number of each one's source, the ``target`` (k, 2), the largest optical path and the scene's size.

    ``size`` (k,) is the distance of the two points.
    """

    source: np.ndarray
    target: np.ndarray
    within: np.ndarray
    size: np.ndarray

    def __len__(self) -> int:
        return len(self.source)


@dataclass(frozen=True)
class Arrivals:
    """What was found: ``pair`` (a,) is ascending, ``meeting`` holds the rays, ``touching`` those on a fold.

    ``continuum`` (k,) marks the pairs that infinitely many rays join; ``unresolved`` (k,) counts the cells that were
    given up.
    """

    meeting: Meeting
    touching: np.ndarray
    continuum: np.ndarray
    unresolved: np.ndarray


@dataclass
class Search:
    """One search for all pairs."""

    fan: Fan
    pairs: Pairs

    def __post_init__(self) -> None:
        self.continuum = np.zeros(len(self.pairs), dtype=bool)
        self.unresolved = np.zeros(len(self.pairs), dtype=int)
        self.crossings: list[Aims] = []
        self.folds: list[Aims] = []

    def run(self) -> Arrivals:
        """All arrivals, those of one pair by ascending optical path."""
        cells = self.fan.cells()
        cell, pair = self._first(cells)
        parts = [self._continua(cells, cell, pair)]
        left = ~self.continuum[pair]
        cell, pair = cell[left], pair[left]
        while len(cell):
            cells, cell, pair = self._round(cells, cell, pair)
        parts += self._polished()
        meeting = gathered([found for found, _ in parts])
        return self._told(meeting, np.concatenate([touching for _, touching in parts]))

    def _first(self, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
        """Cells and pairs whose points may be in them."""
        low, high = self._boxes(cells)
        source, x = self.pairs.source, self.pairs.target[:, 0]
        least, span = x.min(), (np.ptp(x) or 1.0) * 1.01
        key = source + (x - least) / span  # by source, then by x
        order = np.argsort(key, kind="stable")
        ends = [cells.source + np.clip((edge[:, 0] - least) / span, -1e-6, 0.995) for edge in (low, high)]
        first = np.searchsorted(key[order], ends[0] - 1e-9 * np.maximum(1, cells.source), side="left")
        last = np.searchsorted(key[order], ends[1] + 1e-9 * np.maximum(1, cells.source), side="right")
        place, cell = _ranges(first, last)
        return self._inside(low, high, cells.source, cell, order[place])

    def _inside(
        self, low: np.ndarray, high: np.ndarray, source: np.ndarray, cell: np.ndarray, pair: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Those of the cells and pairs where the point is in the box."""
        point = self.pairs.target[pair]
        inside = np.all((point >= low[cell]) & (point <= high[cell]), axis=1) & (
            source[cell] == self.pairs.source[pair]
        )
        return cell[inside], pair[inside]

    def _boxes(self, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
        low, high = cells.boxes()
        with np.errstate(invalid="ignore"):
            diagonal = np.linalg.norm(high - low, axis=1)
        diagonal[~np.isfinite(diagonal)] = 0.0  # no corner at all: the box is empty
        unknown = np.where(cells.whole, UNSEEN, 1.0) * diagonal
        room = np.where(np.isfinite(cells.error), np.minimum(cells.error, unknown), unknown)
        room += 1e-9 * diagonal
        return low - room[:, None], high + room[:, None]

    def _round(self, cells: Cells, cell: np.ndarray, pair: np.ndarray) -> tuple[Cells, np.ndarray, np.ndarray]:
        """Settle what can be settled; the halves of the other cells, with the pairs that may be in them."""
        known = np.flatnonzero(np.isfinite(cells.error[cell]) & cells.whole[cell])
        again = np.ones(len(cell), dtype=bool)
        if len(known):
            again[known] = self._settled(cells.take(cell[known]), pair[known])
        cell, pair = cell[again], pair[again]
        deep = cells.depth[cell] >= DEEPEST
        np.add.at(self.unresolved, pair[deep], 1)
        cell, pair = cell[~deep], pair[~deep]
        used, cell = np.unique(cell, return_inverse=True)
        if len(used) == 0:
            return cells, cell, pair
        parts, parent = self.fan.parted(cells.take(used))
        low, high = self._boxes(parts)
        first, last = np.searchsorted(parent, cell, side="left"), np.searchsorted(parent, cell, side="right")
        part, which = _ranges(first, last)
        return parts, *self._inside(low, high, parts.source, part, pair[which])

    def _settled(self, cells: Cells, pair: np.ndarray) -> np.ndarray:
        """Note zeros and extrema of the misses in ``cells`` (k), one pair each; True (k,) where they are doubtful."""
        found = misses(cells, self.pairs.target[pair])
        beginnings, crowded = seeds(found, cells.sideways)
        crowded &= cells.depth < DEEPEST
        doubtful = ~found.outside & (~found.trusted | crowded)
        keep = ~(doubtful | found.outside)[beginnings.pair]
        chosen = Seeds(beginnings.pair[keep], beginnings.a[keep], beginnings.fold[keep])
        aims = self._aims(cells, pair, found, chosen)
        self.crossings.append(aims.take(np.flatnonzero(~chosen.fold)))
        self.folds.append(aims.take(np.flatnonzero(chosen.fold)))
        return doubtful

    def _aims(self, cells: Cells, pair: np.ndarray, found: Misses, chosen: Seeds) -> Aims:
        """What to begin Newton's iteration from."""
        k, a = chosen.pair, chosen.a
        width = cells.angle[k, 1] - cells.angle[k, 0]
        u = found.place[k, 0] + a * (found.place[k, 1] - found.place[k, 0])
        paths = cells.state[k, ..., PATH]
        path = (1 - a) * ((1 - u) * paths[:, 0, 0] + u * paths[:, 0, 1]) + a * (
            (1 - u) * paths[:, 1, 0] + u * paths[:, 1, 1]
        )
        sigma = found.sigma[k, 0] + a * (found.sigma[k, 1] - found.sigma[k, 0])
        return Aims(
            cells.source[k], pair[k], self.pairs.target[pair[k]], cells.angle[k, 0] + a * width, sigma, path, width,
            self.pairs.size[pair[k]],
        )  # fmt: skip

    def _continua(self, cells: Cells, cell: np.ndarray, pair: np.ndarray) -> tuple[Meeting, np.ndarray]:
        """One ray for each pair that infinitely many join: where many rays nearly meet the point, they are asked."""
        candidates = np.bincount(pair, minlength=len(self.pairs)) >= CONTINUUM * FIRST_ANGLES
        some = candidates[pair] & cells.whole[cell]
        cell, pair = cell[some], pair[some]
        near = cells.take(cell)
        found = misses(near, self.pairs.target[pair])
        flat = np.flatnonzero(~found.outside & (found.range <= NEARLY * self.pairs.size[pair]))
        crowd = np.bincount(pair[flat], minlength=len(self.pairs)) >= CONTINUUM * FIRST_ANGLES
        flat = flat[crowd[pair[flat]]]
        first = Seeds(flat, np.zeros(len(flat)), np.zeros(len(flat), dtype=bool))
        meeting = as_they_are(self.fan, self._aims(near, pair, found, first))
        there = np.bincount(meeting.aims.pair, minlength=len(self.pairs)) >= CONTINUUM * FIRST_ANGLES
        self.continuum = there
        rows = np.flatnonzero(there[meeting.aims.pair])
        _, one = np.unique(meeting.aims.pair[rows], return_index=True)
        return meeting.take(rows[one]), np.ones(len(one), dtype=bool)

    def _polished(self) -> list[tuple[Meeting, np.ndarray]]:
        """The rays that meet their points, from all seeds."""
        if not self.crossings:
            return []
        aims, folds = joined(self.crossings), joined(self.folds)
        flat, bend = flattest(self.fan, folds)
        touches = np.abs(flat.miss) <= TOUCHING * folds.size
        with np.errstate(all="ignore"):
            half = np.sqrt(-2 * flat.miss / bend)
        two = np.flatnonzero(~touches & np.isfinite(half))
        sides = [_beside(flat.take(two), sign * half[two]) for sign in (-1, 1)]
        touching, meeting = flat.take(np.flatnonzero(touches)), met(self.fan, joined([aims, *sides]))
        return [(touching, np.ones(len(touching.miss), dtype=bool)), (meeting, np.zeros(len(meeting.miss), dtype=bool))]

    def _told(self, meeting: Meeting, touching: np.ndarray) -> Arrivals:
        """What was found, none twice, each pair's by optical path."""
        aims = meeting.aims
        path = meeting.state[:, PATH]
        near = (path <= self.pairs.within[aims.pair]) & (touching | ~self.continuum[aims.pair])
        order = np.lexsort((path, aims.pair))
        order = order[near[order]]
        kept: list[int] = []
        for k in order:
            alike = False
            for j in reversed(kept):
                if aims.pair[j] != aims.pair[k] or path[k] - path[j] > SAME * path[k]:
                    break
                turn = abs(np.remainder(aims.angle[j] - aims.angle[k] + np.pi, 2 * np.pi) - np.pi)
                alike = alike or turn <= SAME
            if not alike:
                kept.append(int(k))
        rows = np.array(kept, dtype=int)
        return Arrivals(meeting.take(rows), touching[rows], self.continuum, self.unresolved)


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The numbers from each of ``first`` (k,) up to ``last``, one range after the other, and which each is of."""
    count = np.maximum(last - first, 0)
    which = np.repeat(np.arange(len(count)), count)
    return np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + first[which], which


def _beside(flat: Meeting, turn: np.ndarray) -> Aims:
    """Aims at the angles ``turn`` (k,) away from the extrema of their misses."""
    aims, state = flat.aims, flat.state
    momentum = np.sum(state[:, 2:4] ** 2, axis=1)
    by_angle = np.sum(state[:, 2:4] * state[:, 5:7], axis=1)
    sigma = aims.sigma - turn * by_angle / momentum
    return Aims(aims.source, aims.pair, aims.target, aims.angle + turn, sigma, state[:, PATH], np.abs(turn), aims.size)
