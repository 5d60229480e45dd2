"""All arrivals: which rays of a plane lead from sources to points, many pairs at once.

The cells of a fan that may hold a point are halved, point by point, until the
miss in them is foretold well enough to be believed. Then each of its zeros is
polished, and each small extremum found: near a caustic that says whether
there are two rays, one or none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.optics.arrivals.cells import PATH, Cells, P, R
from varcalc.optics.arrivals.fan import FIRST_ANGLES, LEAST_ANGLE, Fan
from varcalc.optics.arrivals.misses import Misses, Seeds, misses, seeds
from varcalc.optics.arrivals.newton import MEETS, TOUCHES_CAUSTIC, Aims, ClosestApproach, as_they_are, flattest, met
from varcalc.optics.models.launches import SAME_CONTINUUM
from varcalc.optics.rays.beam import Rows
from varcalc.progress import Stage

MOST_HALVINGS = 24
"""Halvings of a cell."""
FEWEST_HALVINGS = 3
"""The same, where they do not come to an end: neighbouring rays that have gone far round come back out of step."""
CROWDED = 1500
"""Cells of one pair left after a halving: where there are more, they do not come to an end."""
UNSEEN_MARGIN = 0.25
"""Of the diagonal of a cell that nobody has looked into: how far beyond its box a point may yet be in it."""
NEARLY_MEETS = 1e-3
"""Rays that miss the point by less, relative to the scene, nearly meet it."""
CONTINUUM_SHARE = 0.25
"""Of all directions: where so many meet a point, infinitely many do."""
MEETS_UNAIMED = 1e-11
"""Of the scene: a ray that was aimed nowhere and comes so close to a point, to which a continuum leads, is of one."""
TOLD_APART = 4 * LEAST_ANGLE
"""Neighbouring angles that are cut no more."""
SIDES = 4
"""Corners of a cell."""
SAME_RAY = 1e-9
"""Angles, and optical paths relative to their size, that differ by less are of one ray."""


@dataclass(frozen=True)
class PlanePairs(Rows):
    """k pairs: the number of each one's source, the ``target`` (k, 2), the largest optical path and the scene's size.

    ``size`` (k,) is the distance of the two points.
    """

    source: np.ndarray
    target: np.ndarray
    within: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Arrivals:
    """What was found: ``pair`` (a,) is ascending, ``meeting`` holds the rays, ``touching`` those on a fold.

    ``continuum`` (k,) marks the pairs that infinitely many rays join; ``unresolved`` (k,) counts the cells that were
    given up.
    """

    meeting: ClosestApproach
    touching: np.ndarray
    continuum: np.ndarray
    unresolved: np.ndarray


@dataclass
class WavefrontConstruction:
    """One search for all pairs."""

    fan: Fan
    pairs: PlanePairs

    def __post_init__(self) -> None:
        self.continuum = np.zeros(len(self.pairs), dtype=bool)
        self.flat = [ClosestApproach.none()]
        self.unresolved = np.zeros(len(self.pairs), dtype=int)
        self.crossings: list[Aims] = []
        self.folds: list[Aims] = []
        self.fan.watch_anew(len(self.pairs))

    def run(self, stage: Stage | None = None) -> Arrivals:
        """All arrivals, those of one pair by ascending optical path; those that are known, where it is stopped."""
        stage = stage or Stage()
        with np.errstate(over="ignore", invalid="ignore"):  # cells of rays that go too far out for numbers, or to rest
            with stage.stoppable():
                if not stage.stopped:
                    self._settle_all(stage)
            self.unresolved += stage.stopped
        continua = self._continua()
        parts = [(continua, np.ones(len(continua.miss), dtype=bool)), *self._polished(continua)]
        meeting, touching = ClosestApproach.joined([found for found, _ in parts]), np.concatenate([t for _, t in parts])
        return self._told(meeting, touching, len(continua.miss))

    def _settle_all(self, stage: Stage) -> None:
        """Lay out the rays, and part cells until all are settled."""
        stage(0, "laying out rays")
        cells = self.fan.cells()
        self.unresolved += self.fan.given_up[self.pairs.source]
        cell, pair = self._first(cells)
        self._note_continua(cells, cell, pair)
        while len(cell) and not self.fan.spent:
            stage(0, f"{len(cell)} cells left")
            cells, cell, pair = self._round(cells, cell, pair)
        np.add.at(self.unresolved, pair, 1)
        self.fan.watch_anew(len(self.pairs))  # what was found is polished all the same

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
        unknown = np.where(cells.whole & cells.smooth, UNSEEN_MARGIN, 1.0) * diagonal
        room = np.where(np.isfinite(cells.error) & cells.smooth, cells.error, unknown)
        room += 1e-9 * diagonal
        return low - room[:, None], high + room[:, None]

    def _round(self, cells: Cells, cell: np.ndarray, pair: np.ndarray) -> tuple[Cells, np.ndarray, np.ndarray]:
        """Settle what can be settled; the halves of the other cells, with the pairs that may be in them."""
        known = np.flatnonzero(np.isfinite(cells.error[cell]) & cells.whole[cell] & cells.smooth[cell])
        again = np.ones(len(cell), dtype=bool)
        if len(known):
            again[known] = self._settled(cells.take(cell[known]), pair[known])
        cell, pair = cell[again], pair[again]
        crowded = np.bincount(pair, minlength=len(self.pairs)) > CROWDED
        deep = cells.depth[cell] >= np.where(crowded[pair], FEWEST_HALVINGS, MOST_HALVINGS)
        # between rays as close as angles can be told there is none where they part at a jump, nor far from where they
        # are: beside one at grazing incidence, where deviations are infinite, cubics say nothing
        told_apart = cells.angle[cell, 1] - cells.angle[cell, 0] <= TOLD_APART
        apart = ~cells.smooth[cell] & told_apart
        deep |= apart
        apart |= deep & told_apart & ~self._near(cells, cell, pair)
        np.add.at(self.unresolved, pair[deep & ~apart], 1)
        cell, pair = cell[~deep], pair[~deep]
        used, cell = np.unique(cell, return_inverse=True)
        if len(used) == 0:
            return cells, cell, pair
        parts, parent = self.fan.parted(cells.take(used))
        low, high = self._boxes(parts)
        first, last = np.searchsorted(parent, cell, side="left"), np.searchsorted(parent, cell, side="right")
        part, which = _ranges(first, last)
        return parts, *self._inside(low, high, parts.source, part, pair[which])

    def _near(self, cells: Cells, cell: np.ndarray, pair: np.ndarray) -> np.ndarray:
        """True (k,) where a cell may hold the point of the pair by its corners alone.

        Rays between two are not farther from these than they are from each other, and the point lies about as far
        across from all of them.
        """
        state, point = cells.state[cell], self.pairs.target[pair]
        corners, ahead = state[..., R], state[..., P]
        room = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=2).max(axis=1)[:, None]
        low, high = corners.min(axis=(1, 2)) - room, corners.max(axis=(1, 2)) + room
        about = np.all((point >= low) & (point <= high), axis=1)
        off = point[:, None, None] - corners
        across = (ahead[..., 0] * off[..., 1] - ahead[..., 1] * off[..., 0]) / np.linalg.norm(ahead, axis=3)
        least, most = np.abs(across).min(axis=(1, 2)), np.abs(across).max(axis=(1, 2))
        aside = (np.abs(np.sign(across).sum(axis=(1, 2))) == SIDES) & (least > most - least)
        return ~cells.whole[cell] | (about & ~aside)

    def _settled(self, cells: Cells, pair: np.ndarray) -> np.ndarray:
        """Note zeros and extrema of the misses in ``cells`` (k), one pair each; True (k,) where they are doubtful."""
        found = misses(cells, self.pairs.target[pair])
        beginnings, crowded = seeds(found, cells.sideways)
        crowded &= cells.depth < MOST_HALVINGS
        over = found.outside | self._of_continuum(cells, found, pair)
        doubtful = ~over & (~found.trusted | crowded)
        keep = ~(doubtful | over)[beginnings.pair]
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

    def _note_continua(self, cells: Cells, cell: np.ndarray, pair: np.ndarray) -> None:
        """Mark the pairs that infinitely many rays join: where many rays nearly meet the point, they are asked."""
        some = self._many(pair)[pair] & cells.whole[cell]
        cell, pair = cell[some], pair[some]
        near = cells.take(cell)
        found = misses(near, self.pairs.target[pair])
        flat = np.flatnonzero(~found.outside & self._flat(near, found, pair))
        flat = flat[self._many(pair[flat])[pair[flat]]]
        first = Seeds(flat, np.zeros(len(flat)), np.zeros(len(flat), dtype=bool))
        met, _ = as_they_are(self.fan, self._aims(near, pair, found, first), MEETS)
        self.continuum = self._many(met.aims.pair)
        self.flat = [met.take(np.flatnonzero(self.continuum[met.aims.pair]))]

    def _continua(self) -> ClosestApproach:
        """One ray of each continuum: all of its rays have the same optical path, since it is stationary."""
        met = ClosestApproach.joined(self.flat)
        met = met.take(np.lexsort((met.state[:, PATH], met.aims.pair)))
        path = met.state[:, PATH]
        other = (np.diff(met.aims.pair) > 0) | (np.diff(path) > SAME_CONTINUUM * path[1:])
        return met.take(np.flatnonzero(np.append(True, other)[: len(path)]))

    def _many(self, pair: np.ndarray) -> np.ndarray:
        """True for the pairs that stand in ``pair`` so often that infinitely many rays may join them."""
        return np.bincount(pair, minlength=len(self.pairs)) >= CONTINUUM_SHARE * FIRST_ANGLES

    def _flat(self, cells: Cells, found: Misses, pair: np.ndarray) -> np.ndarray:
        """True (k,) for cells all of whose rays nearly meet the point, for the range of angles they are of."""
        share = (cells.angle[:, 1] - cells.angle[:, 0]) * FIRST_ANGLES / (2 * np.pi)
        return found.range <= NEARLY_MEETS * np.minimum(share, 1.0) * self.pairs.size[pair]

    def _of_continuum(self, cells: Cells, found: Misses, pair: np.ndarray) -> np.ndarray:
        """True (k,) for cells whose rays belong to a continuum: one in the middle meets the point as it is."""
        rows = np.flatnonzero(self.continuum[pair] & ~found.outside)
        rows = rows[self._flat(cells, found, pair)[rows]]
        belongs = np.zeros(len(pair), dtype=bool)
        if len(rows):
            middle = Seeds(rows, np.full(len(rows), 0.5), np.zeros(len(rows), dtype=bool))
            met, which = as_they_are(self.fan, self._aims(cells, pair, found, middle), MEETS_UNAIMED)
            belongs[rows[which]] = True
            self.flat.append(met)
        return belongs

    def _polished(self, continua: ClosestApproach) -> list[tuple[ClosestApproach, np.ndarray]]:
        """The rays that meet their points, from all seeds, but for those of the ``continua``."""
        if not self.crossings:
            return []
        aims, folds = Aims.joined(self.crossings), Aims.joined(self.folds)
        flat, bend = flattest(self.fan, folds)
        touches = np.abs(flat.miss) <= TOUCHES_CAUSTIC * folds.size
        with np.errstate(all="ignore"):
            half = np.sqrt(-2 * flat.miss / bend)
        two = np.flatnonzero(~touches & np.isfinite(half))
        sides = [_beside(flat.take(two), sign * half[two]) for sign in (-1, 1)]
        meeting, lost = met(self.fan, Aims.joined([aims, *sides]))
        np.add.at(self.unresolved, lost, 1)
        touching = flat.take(np.flatnonzero(touches))
        touching, meeting = _beside_continua(touching, continua), _beside_continua(meeting, continua)
        return [(touching, np.ones(len(touching.miss), dtype=bool)), (meeting, np.zeros(len(meeting.miss), dtype=bool))]

    def _told(self, meeting: ClosestApproach, touching: np.ndarray, continua: int) -> Arrivals:
        """What was found, none twice, each pair's by optical path; the first stand for so many ``continua``."""
        aims = meeting.aims
        path = meeting.state[:, PATH]
        near = path <= self.pairs.within[aims.pair]
        continuum = np.bincount(aims.pair[:continua][near[:continua]], minlength=len(self.pairs)) > 0
        order = np.lexsort((path, aims.pair))
        order = order[near[order]]
        kept: list[int] = []
        for k in order:
            alike = False
            for j in reversed(kept):
                if aims.pair[j] != aims.pair[k] or path[k] - path[j] > SAME_RAY * path[k]:
                    break
                turn = abs(np.remainder(aims.angle[j] - aims.angle[k] + np.pi, 2 * np.pi) - np.pi)
                alike = alike or turn <= SAME_RAY
            if not alike:
                kept.append(int(k))
        rows = np.array(kept, dtype=int)
        return Arrivals(meeting.take(rows), touching[rows], continuum, self.unresolved)


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The numbers from each of ``first`` (k,) up to ``last``, one range after the other, and which each is of."""
    count = np.maximum(last - first, 0)
    which = np.repeat(np.arange(len(count)), count)
    return np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + first[which], which


def _beside(flat: ClosestApproach, turn: np.ndarray) -> Aims:
    """Aims at the angles ``turn`` (k,) away from the extrema of their misses."""
    aims, state = flat.aims, flat.state
    momentum = np.sum(state[:, 2:4] ** 2, axis=1)
    by_angle = np.sum(state[:, 2:4] * state[:, 5:7], axis=1)
    sigma = aims.sigma - turn * by_angle / momentum
    return Aims(aims.source, aims.pair, aims.target, aims.angle + turn, sigma, state[:, PATH], np.abs(turn), aims.size)


def _beside_continua(meeting: ClosestApproach, continua: ClosestApproach) -> ClosestApproach:
    """The rays of ``meeting`` that are of none of the ``continua``."""
    other = np.ones(len(meeting.miss), dtype=bool)
    for pair, path in zip(continua.aims.pair, continua.state[:, PATH], strict=True):
        other &= (meeting.aims.pair != pair) | (np.abs(meeting.state[:, PATH] - path) > SAME_CONTINUUM * path)
    return meeting.take(np.flatnonzero(other))
