"""Least paths over a lattice of ordinates where L is linear in the slope but for kinks, and the lines they keep to.

They are seen by a dynamic programme over all ordinates, in which from one abscissa to the next a path is on the line of
one of the kinks and half way moves straight up or down, so that only the nearest ordinates matter, as ways in between
add up (Felzenszwalb and Huttenlocher, Theory of Computing 8, 2012, sect. 2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from varcalc.existence.linear_between import LinearBetweenKinks
from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.problem.breaks import breaks
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Verdict

PATH_PIECES, PATH_LEVELS, DRAWN_CLOSER = 256, 513, 3
"""Abscissae and ordinates of the lattice, and times that it is drawn closer about the least curve."""
PATH_MARGIN, WIDENED_BY, TIMES_WIDENED = 0.1, 3.0, 12
"""How far it reaches beyond what it is drawn about, in units of that; by what, and how often, it is widened."""
TIMES_DRAWN, MOST_DRAWN_CLOSER, FINE_LEVELS = 8, 500, (128, 1024)
"""Times that it is drawn about a path of several kinks, by what levels may come closer together, and on either side
the fewest and the most of them.
"""
LEVELS_ABOUT, STEEPEST_RISE, FINEST_LEVELS = 6.0, 0.6, 0.1
"""How far they reach, in levels of the path and in units of its steepest rise; how close they tell kinks apart, in
units of what lines of two kinks part by from one abscissa to the next.
"""
RESTING, OFF_EQUATION = 1.5, 4.0
"""How far off its equation a curve is, in levels, from which on it is at rest, and is at a jump for sure.

One that moves goes from one level to the next.
"""
SEAMS_AT_ONCE = 16
"""Ordinates at once at which it is tried where a closed curve begins."""
SHORTEST_REST, JOINED = 3.0, 1.0
"""Pieces of the lattice that a rest is longer than that is seen, and that may lie between two lines which meet."""
PLACES_OF_LINE = 17
"""Places of a line at which it is seen whether a curve would move there."""
FALLS_SURELY = 1e-9
"""Part of what is missed of an equation by which it falls, from one level to the next, that is no round-off."""


@dataclass(frozen=True)
class Chain:
    """Lines of the ``kinks`` (k,) one after the other, between ``corners`` (k + 1,), the first at an ``ordinate``.

    The curve comes to them from a piece of L and leaves to one; ``sides`` are their numbers, None at an end of the
    interval.
    """

    corners: tuple[float, ...]
    ordinate: float
    kinks: tuple[int, ...]
    sides: tuple[int | None, int | None]

    def moved(self, by: float) -> Chain:
        """The same at other abscissae."""
        return replace(self, corners=tuple(x + by for x in self.corners))

    def followed_by(self, other: Chain) -> Chain:
        """The lines of both, which meet half way between them."""
        middle = 0.5 * (self.corners[-1] + other.corners[0])
        corners = (*self.corners[:-1], middle, *other.corners[1:])
        return Chain(corners, self.ordinate, (*self.kinks, *other.kinks), (self.sides[0], other.sides[1]))

    def together_with(self, other: Chain, kinks: int) -> Iterator[Chain]:
        """The chains that both may be, of so many ``kinks``, if the curve does not move on the piece of L in between.

        Lines of one kink are one, or there is a line of the other kink beside that piece.
        """
        (kink, following), piece = (self.kinks[-1], other.kinks[0]), self.sides[1]
        if piece is None or piece != other.sides[0]:
            return
        sides = self.sides[0], other.sides[1]
        if abs(kink - following) == 1:
            yield self.followed_by(other)
        elif kink == following:
            corners = (*self.corners[:-1], *other.corners[1:])
            yield Chain(corners, self.ordinate, (*self.kinks, *other.kinks[1:]), sides)
            further = piece - 1 if kink == piece else piece
            if 0 <= further < kinks:
                yield Chain((*self.corners, *other.corners), self.ordinate, (*self.kinks, further, *other.kinks), sides)

    def closed(self, width: float) -> Chain | None:
        """The lines of a closed curve that moves nowhere, of which the first follows the last; None where none does."""
        inner, ordinate = self.corners[1:-1], self.ordinate
        if len(self.kinks) > 2 and self.kinks[0] == self.kinks[-1]:
            return Chain((*inner, inner[0] + width), ordinate, self.kinks[1:], (None, None))
        if len(self.kinks) > 1 and abs(self.kinks[0] - self.kinks[-1]) == 1:
            seam = 0.5 * (self.corners[0] + self.corners[-1] - width)
            return Chain((seam, *inner, seam + width), ordinate, self.kinks, (None, None))
        return None


@dataclass(frozen=True)
class _LeastWay:
    """A way over the lattice, by the numbers of the levels that it has at the abscissae (m + 1,).

    ``straight`` (m, 2) are those before and after it moves straight up or down half way to the next, ``lines`` (2 m,)
    the numbers of the kinks on whose lines it is from place to place.
    """

    chosen: np.ndarray
    straight: np.ndarray
    lines: np.ndarray
    value: float

    @property
    def rises(self) -> np.ndarray:
        """How many levels it goes straight up."""
        return self.straight[:, 1] - self.straight[:, 0]


@dataclass(frozen=True)
class LeastPath:
    """The least way over the ``levels`` (k,) of a lattice at abscissae x (m + 1,), above a ``base`` (2 m + 1,).

    That has ordinates half way from one abscissa to the next as well.
    """

    kinks: LinearBetweenKinks
    x: np.ndarray
    levels: np.ndarray
    base: np.ndarray
    way: _LeastWay

    @property
    def step(self) -> float:
        """From one level to the next."""
        return float(self.levels[1] - self.levels[0])

    @property
    def inside(self) -> bool:
        """Whether it keeps off the first and the last of the levels."""
        seen = np.append(self.way.straight.ravel(), self.way.chosen)
        return bool(seen.min() > 1 and seen.max() < len(self.levels) - 2)

    @property
    def ordinates(self) -> np.ndarray:
        """Those of the path at x."""
        return self.levels[self.way.chosen] + self.base[::2]

    def jump(self) -> Finding | None:
        """What is found where it leaves a level at once for another that a curve which moves would come to later."""
        rises = self.way.rises
        for piece in np.flatnonzero(np.abs(rises) > OFF_EQUATION).tolist():
            if self._at_given_end(piece) if piece in (0, len(rises) - 1) else self._across(piece):
                value = self.kinks.problem.sign * (self.way.value - self._at_end_alone(piece))
                return jumps(self.kinks.problem, self.x[piece + (piece > 0)], rises[piece] * self.step, value)
        return None

    def _at_given_end(self, piece: int) -> bool:
        """Whether it begins or ends on the side of a curve which moves that it goes to: else it rests for a moment."""
        at, end, way = (0, self.kinks.problem.start, 1) if piece == 0 else (-1, self.kinks.problem.end, -1)
        rise = float(way * self.way.rises[piece])
        side, nearer = -1 if way * rise > 0 else 0, math.copysign(OFF_EQUATION * self.step, rise)
        missed = self.kinks.beside(self.x[[at]], self.ordinates[[at]] + nearer).missed[side, 0]
        return end.fixed and -math.copysign(1.0, rise) * missed > 0.0

    def _at_end_alone(self, piece: int) -> float:
        """What is summed of L at a given end that the path leaves at once, where a jump has no width."""
        if 0 < piece < len(self.x) - 2:
            return 0.0
        at, way = (0, 1) if piece == 0 else (-1, -1)
        ordinates = self.levels[self.way.straight[piece]] + self.base[at]
        there, beside = self.kinks.summed(np.repeat(self.x[at], 2), ordinates)[0][0][::way]
        return float(0.5 * (self.x[1] - self.x[0]) * (there - beside))

    def _across(self, piece: int) -> bool:
        """Whether it leads across a hill, or L changes there: elsewhere a jump pays nowhere but at a given end."""
        if any(self.x[piece] <= place <= self.x[piece + 1] for place in breaks(self.kinks.problem)):
            before, rise, after = np.abs(self.way.rises[piece - 1 : piece + 2])
            return bool(rise > OFF_EQUATION + 2 * max(before, after))  # what moves there moves beside it as well
        first, last = self.way.straight[piece]
        levels = self.levels[min(first, last) : max(first, last) + 1]
        middle = np.full(len(levels), 0.5 * (self.x[piece] + self.x[piece + 1]))
        missed = self.kinks.beside(middle, levels + self.base[2 * piece + 1]).missed[-1 if last > first else 0]
        return bool((np.diff(missed) < -FALLS_SURELY * np.abs(missed).max()).any())

    def piece_alone(self) -> int:
        """The piece on which it is if it keeps to no line: that of its mean slope."""
        slope = np.ptp(self.ordinates[[0, -1]]) * np.sign(self.ordinates[-1] - self.ordinates[0])
        return int(np.searchsorted(self.kinks.slopes, slope / (self.x[-1] - self.x[0])))

    def chains(self) -> list[Chain]:
        """The lines that the path keeps to, though no curve which moves would be there.

        Others, however short, are where it goes from one piece to another. Of a closed curve one may begin before the
        start.
        """
        width, problem = self.x[-1] - self.x[0], self.kinks.problem
        found = list(filter(self._rests, self._runs()))
        if not found:
            return []
        kept = [found[0]]
        for run in found[1:]:
            kept[-1:] = self._joined(kept[-1], run)
        if not problem.start.periodic or found[0].sides == (None, None):
            return kept
        around = self._joined(kept[-1], kept[0].moved(width))
        if len(around) == 1 < len(kept):
            return [around[0].moved(-width), *kept[1:-1]]
        return [*kept, *around[1:-1]]

    def _runs(self) -> list[Chain]:
        """The lines that it keeps to from move to move."""
        x = np.linspace(self.x[0], self.x[-1], 2 * len(self.x) - 1)
        lines, problem = self.way.lines, self.kinks.problem
        sides = np.sign(np.append(np.diff(lines), 0))
        sides[::2] = np.where(self.way.rises != 0, np.sign(self.way.rises), sides[::2])
        edges = np.flatnonzero((np.diff(lines) != 0) | (sides[:-1] != 0)).tolist()
        numbers = [0, *(e + 1 for e in edges), len(lines)]
        runs = []
        for first, last in pairwise(numbers):
            kink = int(lines[first])
            before = None if first == 0 else self._side(kink, first - 1, lines[first - 1])
            after = None if last == len(lines) else self._side(kink, last - 1, lines[last])
            level = self.way.straight[first // 2, 1] if first % 2 else self.way.chosen[first // 2]
            ordinate = float(self.levels[level] + self.base[first])
            runs.append(Chain((float(x[first]), float(x[last])), ordinate, (kink,), (before, after)))
        if not problem.start.periodic or len(runs) == 1:
            return runs
        first, last = runs[0], runs[-1]
        width = x[-1] - x[0]
        if first.kinks == last.kinks:
            whole = Chain((last.corners[0] - width, first.corners[1]), last.ordinate, first.kinks,
                          (last.sides[0], first.sides[1]))  # fmt: skip
            return [whole, *runs[1:-1]]
        lower, upper = sorted((first.kinks[0], last.kinks[0]))
        first = replace(first, sides=(first.kinks[0] + int(first.kinks[0] == lower), first.sides[1]))
        last = replace(last, sides=(last.sides[0], last.kinks[0] + int(last.kinks[0] < upper)))
        return [first, *runs[1:-1], last]

    def _side(self, kink: int, place: int, other: int) -> int:
        """The piece beside a kink to which the path goes, or from which it comes, at a place between half steps."""
        rise = self.way.rises[place // 2] if place % 2 == 0 else 0
        return (len(self.kinks.slopes) if rise > 0 else 0) if rise else kink + int(other > kink)

    def _rests(self, run: Chain) -> bool:
        """Whether a curve is at rest along what the path keeps to: else it moves, from level to level."""
        (start, end), (kink,), (before, after) = run.corners, run.kinks, run.sides
        problem = self.kinks.problem
        free = [not (end.fixed or end.periodic) for end in (problem.start, problem.end)]
        # the momentum goes on to another piece, or comes to zero at a free end
        if any(f and side is None for f, side in zip(free, run.sides, strict=True)):
            return True
        if before is not None and after is not None and (before > kink) != (after > kink):
            return True
        x = np.linspace(start, end, PLACES_OF_LINE)
        y = run.ordinate + self.kinks.slopes[kink] * (x - start)
        lower, upper = (
            np.array([self.kinks.beside(x, y + way * self._room(p)).missed[p] for p in (kink, kink + 1)])
            for way in (-1.0, 1.0)
        )
        above, below = (lower > 0.0).all(axis=0).any(), (upper < 0.0).all(axis=0).any()
        # to go on as it came the momentum falls and rises again, or the other way round
        off = (above and below) if (before is None) == (after is None) else (above or below)
        return bool(off) and end - start > SHORTEST_REST * (self.x[1] - self.x[0])

    def _room(self, piece: int) -> float:
        """How far off its equation a path is at most where it moves: by levels, and by what lines of two kinks part."""
        among = 0 < piece < len(self.kinks.slopes)
        apart = float(self.kinks.slopes[piece] - self.kinks.slopes[piece - 1]) if among else 0.0
        return RESTING * self.step + 0.5 * apart * float(self.x[1] - self.x[0])

    def _joined(self, run: Chain, other: Chain) -> list[Chain]:
        """Two lines one after the other, as one chain where they meet, or with those between that a curve goes by."""
        (after, before), (kink, following) = (run.sides[1], other.sides[0]), (run.kinks[-1], other.kinks[0])
        last, first = run.corners[-1], other.corners[0]
        piece = self.x[1] - self.x[0]
        assert after is not None
        assert before is not None
        if after != before:
            between = range(after, before) if after < before else range(after - 1, before - 1, -1)
            kinks = tuple(between)
            middle = 0.5 * (last + first)
            corners = tuple(middle + 0.5 * piece * np.linspace(-1.0, 1.0, len(kinks) + 1))
            y = float(np.interp(corners[0], self.x, self.ordinates))
            return [run, Chain(corners, y, kinks, (after, before)), other]
        if abs(kink - following) == 1 and first - last <= JOINED * piece and self._off(last, after):
            return [run.followed_by(other)]
        return [run, other]

    def _off(self, x: float, piece: int) -> bool:
        """Whether at a place the path is where no curve that moves on a piece would be."""
        y = np.interp(x, self.x, self.ordinates) + self._room(piece) * np.array([-1.0, 1.0])
        lower, upper = self.kinks.beside(np.repeat(x, 2), y).missed[piece]
        return bool(lower > 0.0 or upper < 0.0)


def jumps(problem: Problem, x: float, height: float, value: float) -> Finding:
    """That the best curve has a jump at x, and what functional curves come near to that have none."""
    sentence = (
        f"the {'infimum' if problem.sign > 0 else 'supremum'} is not attained: graphs that are ever steeper near "
        f"x = {x:.6g}, where the best curve jumps by about {height:.3g}, come as near as one likes to about {value:.3g}"
    )
    return Finding(Verdict.NOT_ATTAINED, sentence, {"limit": value, "x": x, "height": height})


def least_path(kinks: LinearBetweenKinks) -> LeastPath | None:
    """The least path over a lattice that is drawn close about it; None where it leads out of all of them."""
    form = formulate(kinks.problem)
    x = np.linspace(*kinks.problem.span, PATH_PIECES + 1)
    base = kinks.slopes[0] * (np.linspace(*kinks.problem.span, 2 * PATH_PIECES + 1) - x[0])
    u = form.start.curve(x)[0] - base[::2]
    half, closer, several = 0.5 * np.ptp(u) + height(form), 0, len(kinks.slopes) > 1
    for _ in range(TIMES_WIDENED):
        path = _over(kinks, x, base, 0.5 * (u.max() + u.min()) + half * np.linspace(-1.0, 1.0, PATH_LEVELS))
        if path is None:
            return None
        inside = path.inside
        if inside and (closer == DRAWN_CLOSER or several):
            return path
        closer = closer + 1 if inside else 0
        u = path.levels[path.way.chosen]
        half = 0.5 * np.ptp(u) + (PATH_MARGIN if inside else WIDENED_BY) * half
    return None


def drawn_finely(path: LeastPath) -> LeastPath | None:
    """The least path near another one, over levels so close together that they tell the kinks apart; None for none."""
    apart = float(np.diff(path.kinks.slopes).min(initial=math.inf)) * (path.x[1] - path.x[0])
    if path.step > MOST_DRAWN_CLOSER * FINEST_LEVELS * apart:
        return None
    for _ in range(TIMES_DRAWN):
        if path.step <= FINEST_LEVELS * apart and path.inside:
            return path
        # half way between abscissae it leaves the straight line between them
        aside = STEEPEST_RISE * float(np.abs(path.way.rises).max()) * path.step
        aside += float(np.ptp(path.kinks.slopes)) * (path.x[1] - path.x[0])
        half = max(LEVELS_ABOUT * path.step if path.inside else 2 * float(path.levels[-1]), aside)
        fewest, most = FINE_LEVELS
        count = int(np.clip(math.ceil(half / (FINEST_LEVELS * apart)), fewest, most if path.inside else fewest))
        base = np.interp(np.arange(2 * len(path.x) - 1), 2 * np.arange(len(path.x)), path.ordinates)
        finer = _over(path.kinks, path.x, base, half * np.linspace(-1.0, 1.0, 2 * count + 1))
        if finer is None:
            return None
        path = finer
    return None


@dataclass(frozen=True)
class _OverLevels:
    """What a path sums half way from abscissae, or to them, on the line of each kink, (kinks, m + 1, k).

    To come to each level from below and from above costs ``up`` and ``down`` (m, k); ``climbed`` (kinks, 2 m) is by how
    many levels lines rise.
    """

    on_lines: np.ndarray
    up: np.ndarray
    down: np.ndarray
    climbed: np.ndarray

    def least(self, start: np.ndarray, end: np.ndarray) -> _LeastWay | None:
        """The least of all paths, or None for none; ``start`` and ``end`` (paths, k) are what levels cost there."""
        numbers, count = np.arange(start.shape[1]), len(self.up)
        least, came = start, list[tuple[np.ndarray, np.ndarray, np.ndarray]]()
        for i in range(count):
            least, first = self._half(least, i, 2 * i)
            below, from_below = _least_before(least - self.up[i], numbers)
            above, from_above = (v[:, ::-1] for v in _least_before((least - self.down[i])[:, ::-1], numbers[::-1]))
            upwards, downwards = below + self.up[i], above + self.down[i]
            straight = np.where(upwards <= downwards, from_below, from_above)
            least, last = self._half(np.minimum(upwards, downwards), i + 1, 2 * i + 1)
            came.append((first, straight, last))
        value = float((least + end).min())
        if not math.isfinite(value):
            return None
        path, level = np.unravel_index(int(np.argmin(least + end)), least.shape)
        chosen, moved, lines = [int(level)], list[list[int]](), list[int]()
        for i in range(count - 1, -1, -1):
            first, straight, last = came[i]
            line = int(last[path, chosen[-1]])
            after = chosen[-1] - int(self.climbed[line, 2 * i + 1])
            before = int(straight[path, after])
            begun = int(first[path, before])
            chosen.append(before - int(self.climbed[begun, 2 * i]))
            moved.append([before, after])
            lines += [line, begun]
        return _LeastWay(np.array(chosen[::-1]), np.array(moved[::-1]), np.array(lines[::-1]), value)

    def _half(self, values: np.ndarray, node: int, half: int) -> tuple[np.ndarray, np.ndarray]:
        """The least that there is to each level after half a step on lines, and the number of the line."""
        if len(self.on_lines) == 1:
            return values + self.on_lines[0, node], np.zeros(values.shape, dtype=np.int8)
        leaves = half % 2 == 0
        ways = [
            _shifted(values + cost, climbed) if leaves else _shifted(values, climbed) + cost
            for cost, climbed in zip(self.on_lines[:, node], self.climbed[:, half].tolist(), strict=True)
        ]
        stacked = np.array(ways)
        return stacked.min(axis=0), stacked.argmin(axis=0).astype(np.int8)


def _shifted(values: np.ndarray, by: int) -> np.ndarray:
    """Values (paths, k) moved on by a number of levels; to what lies beyond nothing leads."""
    if by == 0:
        return values
    out = np.full_like(values, math.inf)
    if by > 0:
        out[:, by:] = values[:, :-by]
    else:
        out[:, :by] = values[:, -by:]
    return out


def _over(kinks: LinearBetweenKinks, x: np.ndarray, base: np.ndarray, levels: np.ndarray) -> LeastPath | None:
    """The least path over ``levels`` above a base at abscissae x; None where L is no number, or a kink points up."""
    width, problem = x[1] - x[0], kinks.problem
    on_lines = 0.5 * width * _on_lattice(kinks, x, levels, base[::2])[0]
    momenta = _on_lattice(kinks, x[:-1] + 0.5 * width, levels, base[1::2])[1]
    if not np.isfinite(on_lines).all() or not (np.diff(momenta, axis=0) >= 0.0).all():
        return None
    up, down = (
        np.hstack([np.zeros((len(v), 1)), np.cumsum(0.5 * (v[:, 1:] + v[:, :-1]) * np.diff(levels), axis=1)])
        for v in (momenta[-1], momenta[0])
    )
    halves = np.linspace(0.0, x[-1] - x[0], 2 * len(x) - 1)
    above_base = (np.outer(kinks.slopes, halves) - base) / (levels[1] - levels[0])
    climbed = np.clip(np.diff(np.rint(above_base), axis=1), -len(levels), len(levels)).astype(int)
    lattice = _OverLevels(on_lines, up, down, climbed)
    if problem.start.periodic:
        way = _least_closed(levels, base, lattice)
        return None if way is None else LeastPath(kinks, x, levels, base, way)
    ends = [
        _given(float(end.values(1)[0]), levels + base[at])[None]
        for end, at in zip((problem.start, problem.end), (0, -1), strict=True)
    ]
    way = lattice.least(*ends)
    return None if way is None else LeastPath(kinks, x, levels, base, way)


def _least_closed(levels: np.ndarray, base: np.ndarray, lattice: _OverLevels) -> _LeastWay | None:
    """The least path that ends at the ordinate at which it began."""
    best, apart = len(levels) // 2, (len(levels) - 1) // SEAMS_AT_ONCE
    while True:
        around = best + apart * np.arange(-(SEAMS_AT_ONCE // 2), SEAMS_AT_ONCE // 2 + 1)
        seams = np.unique(np.clip(around, 0, len(levels) - 1))
        starts = np.where(np.arange(len(levels)) == seams[:, None], 0.0, math.inf)
        ends = np.array([_given(levels[seam] + base[0], levels + base[-1]) for seam in seams])
        way = lattice.least(starts, ends)
        if way is None:
            return None
        best, apart = int(way.chosen[0]), apart // (SEAMS_AT_ONCE // 4)
        if not apart:
            return way


def _on_lattice(
    kinks: LinearBetweenKinks, x: np.ndarray, levels: np.ndarray, base: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """L on the line of each kink, and the momenta of the pieces, on a lattice: (.., m, k)."""
    values, momenta = kinks.summed(np.repeat(x, len(levels)), (base[:, None] + levels).ravel())
    return values.reshape(-1, len(x), len(levels)), momenta.reshape(-1, len(x), len(levels))


def _least_before(values: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least of all values (paths, k) up to each, and its number."""
    least = np.minimum.accumulate(values, axis=1)
    new = np.hstack([np.ones((len(values), 1), dtype=bool), values[:, 1:] < least[:, :-1]])
    return least, numbers[np.maximum.accumulate(np.where(new, np.arange(values.shape[1]), 0), axis=1)]


def _given(y: float, ordinates: np.ndarray) -> np.ndarray:
    """What ordinates (k,) cost at an end: of those where one is given the nearest, if one is, is free."""
    if math.isnan(y):
        return np.zeros(len(ordinates))
    off = np.abs(ordinates - y)
    nearest = (np.arange(len(ordinates)) == np.argmin(off)) & (off <= ordinates[1] - ordinates[0])
    return np.where(nearest, 0.0, math.inf)
