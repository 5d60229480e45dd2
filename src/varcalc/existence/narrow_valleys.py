"""Whether a narrow valley far from the known curve is lower: no lattice shows what is narrower than its meshes.

On some vertical lines the place is looked for to which the known curve would best be shifted, there and back included.
Along a line L is enclosed between departures, so that no valley is too narrow to be seen; what the way there and back
adds is told at points.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.existence.directions import Departures, polygonal, stated
from varcalc.existence.polygons import Valley
from varcalc.existence.together import AlongAxes
from varcalc.formulation import Sampled
from varcalc.numerics.branch_and_bound import boxes_about, least_points
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.problem import Curve
from varcalc.solution import Solution
from varcalc.symbolic.intervals import enclosures
from varcalc.symbolic.narrow import RULES
from varcalc.symbolic.variation import SWITCHED, Between, Rules, excess

MOST_FUNCTIONS = 3
"""Functions that are looked at together."""
LINES = 32
"""Vertical lines on which the place is looked for."""
SHARES_OF_WAYS = (0.06, 0.2, 0.6)
"""How much of the interval the ways there and back may take together."""
PIECES_OF_WAY = 4
"""Pieces of each along which L is summed."""
WAY_COUNTED = 0.9
"""Share that is counted of what the way there and back adds: a straight one is not the best."""
PIECES_OF_TURN, PIECES_OF_VALLEY = 64, 1024
"""The same of the polygons that are handed out, on the way and in the valley."""
LEAST_WAY, MOST_OF_WAY = 1e-5, 0.9
"""Shares among which those of the best ways are looked for."""
WAYS_TRIED, TIMES_CLOSER = 16, 6
"""Shares that are tried at a time, and how often between closer ones: the logarithm of the best is found to 3e-5.

The curve turns into a valley as sharply as that is narrow, and the mesh for it is finest where this one turns.
"""
MESH_OF_VALLEY, FINER, CLOSEST_TO_TURN = 9, 8.0, 10
"""Points of the mesh for curves there, and by what factor it is finer, and how often, toward a turn."""
FIRST_LINES = {1: 8, 2: 4, 3: 2}
"""How many of them are asked first, of so many functions, whether there is anything at all."""
SHELLS = {
    1: 2.0 ** np.concatenate([np.arange(-6, 6.25, 0.5), np.arange(7, 27)]),
    2: np.concatenate([2.0 ** np.arange(-3, 6), 4.0 ** np.arange(3, 14)]),
    3: np.concatenate([4.0 ** np.arange(-1, 3), 16.0 ** np.arange(2, 7)]),
}
"""Departures between which boxes lie, either way, of so many functions, in units of the larger of size and interval.

They go on far beyond a lattice: the interval says nothing of heights where the two have unlike units."""
LOWER_VALLEY, SHARE_TOLD = 1e-2, 1e-2
"""How much lower, relative to what is summed, a shifted curve has to be, and how nearly the lowest one is told: to
that, or to a share of how much lower it is."""
WORTH_SHIFTED = 0.1
"""How far above the known curve a shifted one may lie to be followed, in units of what the larger one sums."""
HIDING: Rules = {**RULES, **SWITCHED}
"""By what factor operations may go too far between samples for nothing to hide there."""
SAME_DEPARTURE, ELSEWHERE = 1e-4, 2
"""Difference, in units of the largest departure, of polygons in one place; lines on which one polygon may not be so."""
Boxes = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Shifts (k, m) and (k, m) between which there may be something, and the number (m,) of the line each box lies on."""


class NarrowValleys:
    """The known curve, and the lowest ones that are shifted into a valley, as polygons of departures."""

    def __init__(self, departures: Departures, boxes: Boxes) -> None:
        """Of the lines that are asked first the ``boxes`` are known."""
        self._departures, self._axes, self._first = departures, departures.axes, boxes
        self.landscape = AlongAxes(departures, self._axes)
        self._length = departures.span[1] - departures.span[0]
        self._lines = _lines(departures)
        self._curve, self._slopes = (departures.curve(self._lines, k) for k in (0, 1))
        own = self.landscape.values(self._lines, *np.zeros((2, LINES, len(self._axes))))
        self.summed, self.own_value = (float(v.mean()) * self._length for v in (np.abs(own), own))
        self._own = np.minimum(own, own.mean())
        ways = 1 if sum(self.landscape.held) == 1 and not self.landscape.waypoints else 2
        self._bounds_of_share = math.log(LEAST_WAY), math.log(MOST_OF_WAY / ways)
        ends = [(x, way) for x, way, kept in zip(departures.span, (1, -1), self.landscape.held, strict=True) if kept]
        kept = [*ends, *((x, way) for x in self.landscape.waypoints for way in (-1, 1))]
        self._kept, self._way_on = np.array(kept, dtype=float).reshape(-1, 2).T
        self._ways = [self._way(share / ways) for share in SHARES_OF_WAYS]
        self._known = [self.landscape.values(x, *np.zeros((2, len(x), len(self._axes)))) for x, *_ in self._ways]

    def distinct(self) -> list[Valley]:
        """Curves into valleys, the lowest first: shifted evenly, at rest, and through the best places of all lines."""
        near = LOWER_VALLEY * self.summed
        low, high, number = self._first
        few = _first_lines(len(self._axes))[number]
        if not np.isfinite(self._least(low, high, few, near)[0]).any():
            return []
        places, least = self._least(*_boxes(self._departures, self._lines), near)
        seen = np.isfinite(places[0])
        if not seen.any():
            return []
        best = int(np.argmin(least))
        shifts = [lambda x: np.repeat(places[:, [best]], len(x), axis=1), self._at_rest(places[:, best], best)]
        if seen.sum() > 1 and not self.landscape.closed:  # a closed curve is shifted evenly, or rests
            shifts.append(self._through(places[:, seen], self._lines[seen]))
        kept: list[Valley] = []
        for valley in sorted(map(self._valley, shifts), key=lambda valley: valley.value):
            known = any(self._alike(valley, other) for other in kept)
            if valley.value < self.own_value + WORTH_SHIFTED * max(self.summed, valley.size) and not known:
                kept.append(valley)
        return kept

    def _alike(self, valley: Valley, other: Valley) -> bool:
        """Whether two polygons are one but for how they come into the valley."""
        one, another = valley(self._lines), other(self._lines)
        apart = np.abs(one - another).max(axis=0) > SAME_DEPARTURE * np.abs(another).max()
        return int(np.count_nonzero(apart)) <= ELSEWHERE

    def _least(
        self, low: np.ndarray, high: np.ndarray, number: np.ndarray, near: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The best shifts (k, lines) on all lines, and by how much they are higher; NaN where none is lower."""
        return least_points(low, high, number, self._value, self._bound, np.full(LINES, -near), near, SHARE_TOLD)

    def _at_rest(self, place: np.ndarray, line: int) -> Sampled:
        """The shifts to the ordinates that a shift by ``place`` (k,) leads to on one of the lines."""
        ordinates = self._curve[:, line] + self._axes.T @ place
        to_shifts = np.linalg.pinv(self._axes.T)
        return lambda x: to_shifts @ (ordinates[:, None] - self._departures.curve(x, 0))

    def _through(self, places: np.ndarray, lines: np.ndarray) -> Sampled:
        """The shifts through ``places`` (k, m) on some ``lines`` (m,), which change no more beyond."""
        from scipy.interpolate import CubicSpline  # few curves are shifted

        beside = self._length / LINES
        through = CubicSpline(lines, places, axis=1)
        return lambda x: through(np.clip(x, lines[0] - beside, lines[-1] + beside))

    def _valley(self, shifted: Sampled) -> Valley:
        """The polygon that is ``shifted``, with the best ways there and back."""
        shares = self._best_shares(shifted)
        x = self._abscissae(shares)
        away, h = (shifted(x) * self._taper(x, shares)).T, np.diff(x)
        middle, between = 0.5 * (x[1:] + x[:-1]), 0.5 * (away[1:] + away[:-1])
        values = self.landscape.values(middle, between, np.diff(away, axis=0) / h[:, None])
        known = self.landscape.values(middle, np.zeros_like(between), np.zeros_like(between))
        higher = float(np.where(np.isfinite(values), values - known, np.inf) @ h)
        return Valley(x, away, self.own_value + higher, False, self._marks(shares), size=float(np.abs(values) @ h))

    def _best_shares(self, shifted: Sampled) -> np.ndarray:
        """How much of the interval each way there or back takes (t,) at its cheapest; the others change nothing."""
        low, high = (np.full(len(self._kept), log) for log in self._bounds_of_share)
        if len(low) == 0:  # where nothing is kept no way leads back
            return low
        best = low
        for _ in range(TIMES_CLOSER):
            logs, column = np.linspace(low, high, WAYS_TRIED), np.arange(len(low))
            least = np.argmin(self._added(shifted, np.exp(logs)), axis=0)
            best = logs[least, column]
            low, high = logs[np.maximum(least - 1, 0), column], logs[np.minimum(least + 1, WAYS_TRIED - 1), column]
        return np.exp(best)

    def _added(self, shifted: Sampled, shares: np.ndarray) -> np.ndarray:
        """What ways there or back that take such ``shares`` (s, t) sum (s, t), less what the shift does there."""
        part = np.linspace(0.0, 1.0, PIECES_OF_TURN + 1)[:, None, None]
        x = self._kept + self._way_on * self._length * shares * part
        whole = shifted(np.clip(x, *self._departures.span).ravel()).reshape(-1, *x.shape)
        h, middle = np.diff(x, axis=0), 0.5 * (x[1:] + x[:-1])

        def along(away: np.ndarray) -> np.ndarray:
            """L in the middle of each piece of what departs by ``away``."""
            rates, between = np.diff(away, axis=1) / h, 0.5 * (away[:, 1:] + away[:, :-1])
            columns = (v.reshape(len(away), -1).T for v in (between, rates))
            return self.landscape.values(middle.ravel(), *columns).reshape(middle.shape)

        there, beyond = along(whole * part), along(whole)
        more = np.where(np.isfinite(there), there - np.where(np.isfinite(beyond), beyond, 0.0), np.inf)
        a, b = self._departures.span
        return np.sum(np.abs(h) * more, axis=0, where=(a < middle) & (middle < b))

    def _abscissae(self, shares: np.ndarray) -> np.ndarray:
        """The vertices of a polygon that is shifted within ``shares`` (t,) of the interval beside what it keeps."""
        ways = [np.linspace(kept, turn, PIECES_OF_TURN + 1) for kept, turn in self._turns(shares)]
        x = np.concatenate([np.linspace(*self._departures.span, PIECES_OF_VALLEY + 1), *ways])
        return np.unique(np.clip(x, *self._departures.span))

    def _turns(self, shares: np.ndarray | float) -> list[tuple[float, float]]:
        """The places that a shifted curve keeps, each with where it turns into the valley: the ends and waypoints."""
        return list(zip(self._kept, self._kept + self._way_on * self._length * shares, strict=True))

    def _marks(self, shares: np.ndarray) -> tuple[float, ...]:
        """The vertices of a mesh that is ever finer toward where the curve turns into the valley and out of it."""
        if isinstance(self._departures.problem, Curve):
            return ()
        a, b = self._departures.span
        found = set(np.linspace(a, b, MESH_OF_VALLEY)[1:-1].tolist())
        for kept, turn in self._turns(shares):
            beyond = turn + math.copysign(0.5 * self._length, turn - kept)
            found |= {turn + (to - turn) * FINER**-k for to in (kept, beyond) for k in range(1, CLOSEST_TO_TURN)}
            found.add(turn)
        return tuple(sorted(x for x in found if a < x < b))

    def _taper(self, x: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """The share (m,) at x of a shift that is made beside the places that are kept."""
        rises = [np.abs(x - kept) / abs(turn - kept) for kept, turn in self._turns(shares)]
        return np.min([np.ones(len(x)), *rises], axis=0)

    def _way(self, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Middles x (p,) of pieces of the way there and back, shares of a shift and their rates, a piece's length."""
        h, at = share * self._length / PIECES_OF_WAY, (np.arange(PIECES_OF_WAY) + 0.5) / PIECES_OF_WAY
        turns = self._turns(share)
        x = np.array([kept + at * (turn - kept) for kept, turn in turns]).ravel()
        rates = np.repeat([1 / (turn - kept) for kept, turn in turns], PIECES_OF_WAY)
        return x, np.tile(at, len(turns)), rates, h

    def _by_way(self, lower_by: np.ndarray, away: np.ndarray) -> np.ndarray:
        """What each way there and back, (w, m), adds to shifts by ``away`` (k, m) that lower L by so much (m,)."""
        found = []
        for (x, share, rate, h), known in zip(self._ways, self._known, strict=True):
            shifted = self.landscape.values(x, share[:, None] * away.T[:, None], rate[:, None] * away.T[:, None])
            higher = np.where(np.isfinite(shifted), shifted - known, np.inf).sum(1) * h
            found.append(WAY_COUNTED * higher + lower_by * (self._length - len(x) * h))
        return np.array(found)

    def _value(self, away: np.ndarray, number: np.ndarray) -> np.ndarray:
        """What curves are higher by that are shifted by ``away`` (k, m), were L everywhere as on a line."""
        return self._by_way(self._level(away, away, number) - self._own[number], away).min(0)

    def _bound(self, low: np.ndarray, high: np.ndarray, number: np.ndarray) -> np.ndarray:
        """The same at least between two shifts, (k, m) each."""
        level = self._level(low, high, number)
        unknown = np.isneginf(level)  # where L ends in a box nothing is known of it but what it is at points
        if unknown.any():
            at_corners = [self._level(at[:, unknown], at[:, unknown], number[unknown]) for at in (low, high)]
            level = level.copy()
            level[unknown] = np.min([np.where(np.isfinite(v), v, np.inf) for v in at_corners], axis=0)
        level = level - self._own[number]
        nearest = np.where(np.abs(low) < np.abs(high), low, high)  # of the way there this is the cheapest
        return self._by_way(level, nearest).min(0)

    def _level(self, low: np.ndarray, high: np.ndarray, number: np.ndarray) -> np.ndarray:
        """The least that L is on lines (m,) between two shifts, (k, m) each; infinite beyond a bound."""
        problem, x = self._departures.problem, self._lines[number]
        y, v = self._curve[:, number], self._slopes[:, number]
        place = list(zip(*(y + shift for shift in _between(self._axes, low, high)), strict=True))
        numbers = [[(np.array(v), np.array(v)) for v in row] for row in self._departures.numbers]
        found = enclosures(stated(problem), [[(x, x)], place, [(row, row) for row in v], [], *numbers])
        return np.broadcast_to(self._departures.least([column[0] for column in found]), number.shape)


def narrow_valleys(
    solution: Solution, ordinates: Sampled | None = None, breadth: float | None = None
) -> NarrowValleys | None:
    """The valleys that may be too narrow for a lattice, at first order; None where L has nothing narrow.

    Their shifts are told from a polygon beside the curve where its ``ordinates`` (n, m) are given as a function.
    """
    curve = None if ordinates is None else _polygon(solution, ordinates)
    return narrow_about(Departures.of(solution, curve, breadth))


def narrow_about(departures: Departures) -> NarrowValleys | None:
    """The same of departures from any curve."""
    problem = departures.problem
    if problem.symbols.kind is not ca.SX or problem.order > 1 or problem.n > MOST_FUNCTIONS:
        return None
    a, b = departures.span
    if LEAST_WAY * (b - a) <= np.spacing(max(abs(a), abs(b))):  # a curve between ends that met has no way
        return None
    boxes = _boxes(departures, _lines(departures)[_first_lines(len(departures.axes))])
    return NarrowValleys(departures, boxes) if len(boxes[2]) else None


def _polygon(solution: Solution, ordinates: Sampled) -> CurveOrSlope:
    """Through the curve on all lines and at its ends, with its slopes."""
    x = np.linspace(*solution.interval, 2 * LINES + 1)
    return polygonal(x, ordinates(x))


def _lines(departures: Departures) -> np.ndarray:
    """Abscissae of the lines, evenly between the ends."""
    a, b = departures.span
    return a + (b - a) * (np.arange(LINES) + 0.5) / LINES


def _first_lines(functions: int) -> np.ndarray:
    """The numbers of those that are asked first."""
    apart = LINES // FIRST_LINES[functions]
    return np.arange(apart // 2, LINES, apart)


def _boxes(departures: Departures, lines: np.ndarray) -> Boxes:
    """Shifts, (k, m) each, between which L may hide something on one of the ``lines``, and the number (m,) of that.

    Where L is no number at one of both it hides nothing.
    """
    problem, axes = departures.problem, departures.axes
    shells = SHELLS[len(axes)]
    low, high = boxes_about(np.concatenate([-shells[::-1], [0.0], shells]), len(axes))
    number = np.repeat(np.arange(len(lines)), low.shape[1])
    units = np.abs(axes) @ departures.units / np.abs(axes).sum(1)
    low, high = (np.tile(side, len(lines)) * units[:, None] for side in (low, high))
    x = lines[number]
    y, slopes = (departures.curve(lines, k)[:, number] for k in (0, 1))
    place = [Between((a, b), a, b) for a, b in zip(*(y + shift for shift in _between(axes, low, high)), strict=True)]
    at, slope, *numbers = ([_fixed(row) for row in rows] for rows in ([x], slopes, *departures.numbers))
    over = excess(stated(problem), [at, place, slope, [], *numbers], x.shape, HIDING)
    hides = np.flatnonzero(over > 1.0)
    if len(hides):
        still = [np.zeros(len(hides))] * problem.n
        known = [departures.known(x[hides], list(axes.T @ side[:, hides]), still) for side in (low, high)]
        # of what is beyond a bound nothing need be left out: it costs infinitely much
        hides = hides[np.all(known, axis=0)]
    return low[:, hides], high[:, hides], number[hides]


def _between(axes: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and greatest shifts (n, m) of the functions between two (k, m) along the ``axes`` (k, n)."""
    ends = axes.T[:, :, None] * low, axes.T[:, :, None] * high
    return np.minimum(*ends).sum(1), np.maximum(*ends).sum(1)


def _fixed(value: np.ndarray | float) -> Between:
    known = np.asarray(value)
    return Between((known, known), known, known)
