"""Curves that drop straight down (or up) at their ends and run level between: Goldschmidt's solution.

Where L grows linearly with the slope, a jump from y to c at the abscissa x has
the finite cost of the integral of L's recession function, the limit of
L(x, eta, v) / |v|, over eta from y to c. Such a curve is a limit of graphs, so
a minimum above it is only local (Goldschmidt 1831; Gelfand and Fomin,
"Calculus of Variations", sect. 4, example 2).

One way a jump may earn something, as where the derivative of a function of x
and y is added to L: it is there and back that it must cost more than to stay,
or nothing bounds the functional.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeGuard

import numpy as np

from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import breaks
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict, local_only, refused

RECOGNISING_SLOPES = (1e6, 1e8)
"""Slopes, in units of the problem's own, at which linear growth is recognised."""
STEEPEST_SLOPE = 1e16
"""Slope, in units of the chord's, at which the cost of a jump is read before the problem's own unit is known."""
JUMP_SLOPE = 1e12
"""Slope, in units of the problem's own, at which it is read then: what L has besides is no part of it to round-off."""
JUMP_ROUND_OFF = 1e-15
"""Share of the costs of two jumps, there and back, that is round-off of their sum."""
LINEAR_GROWTH = 1e-4
"""Relative difference of L / |v| at the two slopes that is linear growth."""
SCANNED_LEVELS = 33
LEVEL_REACH = 3.0
"""How far beyond the ends levels are looked at, in units of the problem's size."""
FROM_ENDS = np.outer([-1.0, 1.0], np.geomspace(2.0**-8, 0.5, 12)).ravel()
"""Their distances from either end besides, in that unit: what L has that jumps do not change makes the size too large.
"""
JUMP_POINTS = 10
GRADES, FINE_POINTS = 26, (8, 12)
"""Halvings of the panels toward both ends of a jump, and points a panel, by which a value is made sure of."""
FAR_ABOVE = 1e-3
"""Relative distance above the ceiling of a value that is resolved but not made sure of."""
SCAN_POINTS, ROUGH_ERROR = 4, 1e-2
"""Points a part of a broken curve in a first scan of the levels, and the relative error that this may make."""
BESIDE_KINK = 1e-3
"""Distance from where kinks are, in units of the problem's size, at which levels are looked at as well."""
CLOSER_ROUNDS, CLOSER_LOOKS = 2, np.linspace(0.0, 1.0, 25)
"""Rounds of closer looks, and where each looks between two levels."""
SURELY_BELOW = 2.0
"""By how many times what separates a level from its neighbours a value between them may lie below its own."""
EVEN_LOOKS = np.linspace(0.0, 1.0, 9)[1:-1]
"""Where a round of the search for the best level looks, in shares of what is left; it leaves a quarter of that."""
CLOSE_LOOKS = np.outer([-1.0, 1.0], [0.0, 1e-2, 1e-5, 1e-9, 1e-13]).ravel()
"""Where else it looks: distances from the best level so far, in the same unit."""
LEVEL_ROUNDS = 24
NARROW_LEVELS, FLAT_VALUES = 1e-15, 1e-15
"""Width relative to the problem's size or its ordinates, and relative difference of values, that are round-off."""
REAL_JUMP = 1e-3
"""Height of a jump that is one, in units of the problem's size."""
NO_JUMP = 1e-9
"""Height of a jump, relative to the ordinates, that may be the error of a graph."""
LIKE_VALUES = 1e-7
"""Relative difference of the values of a graph and of the broken curve that it comes near."""
ALONG_LEVEL = 0.05
"""Distance from the level, in units of the jump, at which a graph runs along it."""
JUMP_SHARE, LEVEL_DEPARTURE = 0.1, 0.25
"""Share of the interval next to an end, and departure from the level beyond it in units of the jump, of a graph that
might be taken for a broken curve."""
RIVAL_MARGIN = 1e-9
"""Relative margin by which a broken curve has to be better: its own value is no more accurate."""


@dataclass(frozen=True)
class BrokenCurve:
    """The best curve that jumps to y = ``level`` at both ends, and its ``value`` (with the user's sign).

    ``jumps`` tells that one of the jumps is real: more than a graph between the ends might make.
    """

    value: float
    level: float
    jumps: bool = True

    @property
    def sentence(self) -> str:
        """What the curve is, for the user."""
        return f"the broken curve that drops to y = {self.level:.6g} at both ends has the value {self.value:.9g}"


def broken_curve(problem: Functional) -> BrokenCurve | None:
    """The best broken curve between two fixed ends; None where L does not grow linearly, or more is asked."""
    found = _broken_curves(problem, math.inf)
    return found[0] if found else None


def _broken_curves(problem: Functional, ceiling: float) -> list[BrokenCurve]:
    """The broken curves of locally best level, best first, of which those above ``ceiling`` may be left out.

    The ceiling is a value in the sense that is minimised.
    """
    if not between_two_points(problem):
        return []
    with np.errstate(all="ignore"):
        family = _Family(problem)
        return family.best(ceiling) if family.linear else []


def between_two_points(problem: Functional) -> TypeGuard[Problem]:
    """Whether one function of first order is sought between two given points, and nothing else is asked."""
    if not isinstance(problem, Problem) or problem.n > 1 or problem.order > 1:
        return False
    more = problem.constraints or problem.unknowns or problem.end_cost or breaks(problem)
    return problem.start.fixed and problem.end.fixed and not more


class _Family:
    """Broken curves of one problem by their level, in the sense that is minimised."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.sign = problem.sign
        a, b = problem.span
        self.y = np.concatenate([problem.start.values(1), problem.end.values(1)])
        self.coarse = _graded(0, JUMP_POINTS)
        x, y = a + (b - a) * np.array([0.0, 0.5, 1.0]), np.array([self.y[0], self.y.mean(), self.y[1]])
        self.worth = self._worth(x, y)
        self.size = max(float(np.ptp(self.y)), self.worth)
        self.narrow = NARROW_LEVELS * max(self.size, float(np.abs(self.y).max()))
        self.steep = self.size / (b - a)
        slopes = np.repeat(np.outer(RECOGNISING_SLOPES, [1.0, -1.0]).ravel() * self.steep, 3)
        growth = self._values(np.tile(x, 4), np.tile(y, 4), slopes) / np.abs(slopes)
        low, high = growth.reshape(2, 2, 3)
        there_and_back = high.sum(0)
        finite = np.isfinite(growth).all() and bool((there_and_back > 0).all())
        self.linear = finite and bool((np.abs(high - low) <= 0.5 * LINEAR_GROWTH * there_and_back).all())

    def _worth(self, x: np.ndarray, y: np.ndarray) -> float:
        """The height of a jump that costs as much as a level curve across the interval, about as much as may pay.

        It is a length of the problem's own, whatever the origin and the units of x and y; the largest at points x and
        y.
        """
        a, b = self.problem.span
        steepest = STEEPEST_SLOPE * (float(np.ptp(self.y)) / (b - a) or 1.0)
        slopes = np.repeat([0.0, steepest, -steepest], len(x))
        level, up, down = self._values(np.tile(x, 3), np.tile(y, 3), slopes).reshape(3, -1)
        worth = np.abs(2 * level / (up + down) * steepest)
        found = float(worth[np.isfinite(worth)].max(initial=0.0)) * (b - a)
        return found or float(np.ptp(self.y)) or b - a

    def _values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L at points, all of shape (m,)."""
        return self.sign * self.problem.integrand_values(x, y[None], v[None])

    def at(self, levels: np.ndarray, rule: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
        """The functional of the broken curves at levels (m,); NaN beyond where a jump no longer costs anything."""
        a, b = self.problem.span
        nodes, weights = self.coarse if rule is None else rule
        count, steep = len(nodes), JUMP_SLOPE * self.steep
        jumps = levels[:, None] - self.y
        # along the level, then down (or up) at the start and at the end; the last of a jump's points is the level
        share = np.append(nodes, 1.0)
        y = np.hstack(
            [np.repeat(levels[:, None], count, axis=1), *(self.y[k] + jumps[:, k : k + 1] * share for k in (0, 1))]
        )
        x = np.concatenate([a + (b - a) * nodes, np.full(count + 1, a), np.full(count + 1, b)])
        down = np.repeat(np.where(jumps < 0, -steep, steep) * [1.0, -1.0], count + 1, axis=1)
        # and the jumps twice more: the other way, and staying where they are
        x, y = np.append(x, np.tile(x[count:], 2)), np.hstack([y, y[:, count:], y[:, count:]])
        v = np.hstack([np.zeros((len(levels), count)), down, -down, np.zeros_like(down)])
        values = self._values(np.tile(x, len(levels)), y.ravel(), v.ravel()).reshape(y.shape)
        costs, back, stay = values[:, count:].reshape(len(levels), 3, 2, -1).swapaxes(0, 1) / steep
        sound = (_there_and_back(costs, back, stay) >= 0).all(2)
        paid = np.where(sound, np.abs(jumps) * (costs[:, :, :-1] @ weights), np.nan)
        return (b - a) * (values[:, :count] @ weights) + paid.sum(1)

    def _jump(self, levels: np.ndarray) -> np.ndarray:
        """The least cost of a jump there and back at either end, at levels (m,)."""
        steep = JUMP_SLOPE * self.steep
        x, v = np.tile(self.problem.span, 3), np.repeat([steep, -steep, 0.0], 2)
        values = self._values(np.tile(x, len(levels)), np.repeat(levels, 6), np.tile(v, len(levels)))
        return _there_and_back(*values.reshape(-1, 3, 2).swapaxes(0, 1) / steep).min(1)

    def _edge(self, ends: np.ndarray) -> float:
        """Where a jump ceases to cost anything between two levels, on the side where it still does.

        By secants and sections of the interval.
        """
        costs = self._jump(ends)
        for _ in range(LEVEL_ROUNDS):
            width = float(ends[1] - ends[0])
            secant = float(ends[0] + width * np.nan_to_num(costs[0] / (costs[0] - costs[1]), nan=0.5))
            tried: np.ndarray = np.concatenate([ends[0] + width * EVEN_LOOKS, secant + width * CLOSE_LOOKS])
            inner: np.ndarray = np.sort(np.clip(tried, ends.min(), ends.max()))
            row: np.ndarray = np.concatenate([ends[:1], inner, ends[1:]])
            known: np.ndarray = np.concatenate([costs[:1], self._jump(inner), costs[1:]])
            change = np.flatnonzero((known >= 0)[1:] != (known >= 0)[:-1])
            if not len(change):
                break  # what ceases to cost anything is met on the way to the level, not at it
            k = int(change[0])
            ends, costs = row[k : k + 2], known[k : k + 2]
            if abs(ends[1] - ends[0]) <= self.narrow or not costs.all():
                break
        return float(ends[0] if costs[0] >= 0 else ends[1])

    def best(self, ceiling: float) -> list[BrokenCurve]:
        """The levels of least value, from a scan and searches about each of its lowest places; best first."""
        low, high = self.y.min() - LEVEL_REACH * self.size, self.y.max() + LEVEL_REACH * self.size
        from_ends = np.add.outer(self.y, self.size * FROM_ENDS).ravel()
        levels = np.unique(np.concatenate([np.linspace(low, high, SCANNED_LEVELS), from_ends, self._about(self.y)]))
        rough = ceiling + ROUGH_ERROR * abs(ceiling) if math.isfinite(ceiling) else ceiling
        values = self._scanned(levels)
        places = self._lowest(values, rough)
        last = len(levels) - 1
        edges = [(k, j) for k in places for j in (k - 1, k + 1) if 0 <= j <= last and math.isinf(values[j])]
        if edges:
            edged = self._about(np.array([self._edge(np.sort(levels[list(pair)])) for pair in edges]))
            levels, order = np.unique(np.concatenate([levels, edged]), return_index=True)
            values = np.concatenate([values, self._scanned(edged)])[order]
            places = self._lowest(values, rough)
        places = self._narrowed(levels, places, rough)
        lowest = self._least(levels, places, ceiling) if len(places) else []
        lowest = [level if abs(level) > self.narrow else 0.0 for level in lowest]
        found = [(value, level) for level in lowest if (value := self._sure(level, ceiling)) is not None]
        return [BrokenCurve(self.sign * value, level, self._jumps(level)) for value, level in sorted(found)]

    def _jumps(self, level: float) -> bool:
        return float(np.abs(level - self.y).max()) > REAL_JUMP * self.size

    def _about(self, kinks: np.ndarray) -> np.ndarray:
        """Levels at which the value may have kinks (m,), and those next to them; (3 m,)."""
        return np.add.outer(kinks, self.size * np.array([-BESIDE_KINK, 0.0, BESIDE_KINK])).ravel()

    def _scanned(self, levels: np.ndarray) -> np.ndarray:
        """The values at levels (m,) in a first scan, infinite where a jump costs nothing."""
        return np.nan_to_num(self.at(levels, _graded(0, SCAN_POINTS)), nan=np.inf)

    def _lowest(self, values: np.ndarray, ceiling: float) -> np.ndarray:
        """Which of the values at ascending levels (m,) may be locally least, as far as they fall below the ceiling."""
        edged = np.pad(values, 1, constant_values=np.inf)
        places = np.flatnonzero((values <= edged[:-2]) & (values <= edged[2:]) & np.isfinite(values))
        return places[_least_between(edged, 1 + places) <= ceiling]

    def _narrowed(self, levels: np.ndarray, places: np.ndarray, ceiling: float) -> np.ndarray:
        """Those of the ``places`` (m,) that a few closer looks at what lies about them cannot show to be above."""
        between = _Between(places, *_neighbours(levels, places))
        for _ in range(CLOSER_ROUNDS if math.isfinite(ceiling) else 0):
            if not len(between.known):
                break
            between = self._narrower(between, ceiling)
        return between.known

    def _narrower(self, at: _Between, ceiling: float) -> _Between:
        """One closer look of :meth:`_narrowed`; ``known`` are the places."""
        grid = at.left[:, None] + (at.right - at.left)[:, None] * CLOSER_LOOKS
        values = self._scanned(grid.ravel()).reshape(grid.shape)
        number = np.clip(values.argmin(1), 1, len(CLOSER_LOOKS) - 2)
        rows = np.arange(len(grid))
        least = [
            _least_between(row, k) if row[k] <= row.min() else -np.inf for row, k in zip(values, number, strict=True)
        ]
        found = _Between(at.known, grid[rows, number - 1], grid[rows, number + 1])
        return found.only(np.array(least) <= ceiling)

    def _sure(self, level: float, ceiling: float) -> float | None:
        """The value at a level by rules that resolve what a jump costs near its ends; None where two of them differ.

        None as well where the first of them is far above the ``ceiling``.
        """
        places = np.array([level])
        one = float(self.at(places, _graded(GRADES, FINE_POINTS[0]))[0])
        if math.isfinite(ceiling) and one > ceiling + FAR_ABOVE * abs(ceiling):
            return None
        other = float(self.at(places, _graded(GRADES, FINE_POINTS[1]))[0])
        return other if abs(one - other) <= 0.1 * RIVAL_MARGIN * abs(other) else None

    def _least(self, levels: np.ndarray, places: np.ndarray, ceiling: float) -> list[float]:
        """The levels of least value between the neighbours of the levels ``places`` (m,), all searched together.

        Those above the ceiling are given up.

        Every round looks evenly between two levels and close to the best one, which may be a kink (no jump at an end,
        no cost beyond), and goes on between the neighbours of the best. Where there is none that costs anything, it
        goes on toward the level that is known to be admissible.
        """
        between = _Between(levels[places], *_neighbours(levels, places))
        for _ in range(LEVEL_ROUNDS):
            between, values = self._closer(between, ceiling)
            if not len(between.known):
                return []
            flat = np.ptp(values, axis=1) <= FLAT_VALUES * np.abs(values).min(1)
            if np.all((between.right - between.left <= self.narrow) | flat):
                break
        tried = np.array([between.known, between.left, between.best, between.right])
        found = np.nan_to_num(self.at(tried.ravel()), nan=np.inf).reshape(tried.shape)
        least = found <= found.min(0) + 10 * FLAT_VALUES * np.abs(found.min(0))
        return [float(v) for v in tried[least.argmax(0), np.arange(tried.shape[1])]]

    def _closer(self, at: _Between, ceiling: float) -> tuple[_Between, np.ndarray]:
        """One round of :meth:`_least`: the searches that go on (m,), and the values that each saw (m, looks)."""
        left, right = at.left[:, None], at.right[:, None]
        looked = np.hstack([left + (right - left) * EVEN_LOOKS, at.best[:, None] + (right - left) * CLOSE_LOOKS])
        inner = np.sort(np.clip(looked, left, right), axis=1)
        values = np.nan_to_num(self.at(inner.ravel()), nan=np.inf).reshape(inner.shape)
        nearest = np.abs(inner - at.known[:, None]).argmin(1)
        number = np.where(np.isinf(values).all(1), nearest, values.argmin(1))
        grid, rows = np.hstack([left, inner, right]), np.arange(len(inner))
        edged = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
        kept = np.array([_least_between(row, k + 1) <= ceiling for row, k in zip(edged, number, strict=True)])
        found = _Between(at.known, grid[rows, number], grid[rows, number + 2], inner[rows, number])
        return found.only(kept), values[kept]


def _there_and_back(there: np.ndarray, back: np.ndarray, stay: np.ndarray) -> np.ndarray:
    """By how much two jumps, there and back, cost more than to stay, where that is known; zero for round-off."""
    more = there + back - 2 * np.where(np.isfinite(stay), stay, 0.0)
    return np.where(np.abs(more) <= JUMP_ROUND_OFF * (np.abs(there) + np.abs(back)), 0.0, more)


class _Between:
    """Searches (m,) for levels of least value: ``known`` to be admissible, the ``best`` so far and its neighbours."""

    def __init__(self, known: np.ndarray, left: np.ndarray, right: np.ndarray, best: np.ndarray | None = None) -> None:
        self.known, self.left, self.right = known, left, right
        self.best = known if best is None else best

    def only(self, kept: np.ndarray) -> _Between:
        """Those of them that are ``kept``."""
        return _Between(self.known[kept], self.left[kept], self.right[kept], self.best[kept])


def _neighbours(levels: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The levels below and above those at ``places`` (m,)."""
    return levels[np.maximum(places - 1, 0)], levels[np.minimum(places + 1, len(levels) - 1)]


def _least_between(values: np.ndarray, at: Any) -> Any:
    """Below what the values between the neighbours of an entry, or of several, will not fall; -inf for a lone one."""
    fall = np.stack([values[at - 1], values[at + 1]]) - values[at]
    fall = np.where(np.isfinite(fall), fall, -np.inf).max(0)
    return np.where(fall >= 0, values[at] - SURELY_BELOW * fall, -np.inf)


@lru_cache(maxsize=8)
def _graded(grades: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1] of Gauss rules on panels that are halved ``grades`` times toward both ends."""
    toward = 0.5 ** np.arange(grades + 1, 0, -1)
    edges = np.concatenate([[0.0], toward, 1.0 - toward[-2::-1], [1.0]]) if grades else np.array([0.0, 1.0])
    return composite_gauss(edges, points)


def with_rival(solution: Solution) -> Solution:
    """A minimum, marked local when a broken curve, which jumps at its ends, comes lower.

    Refused where it is that broken curve itself, as near as graphs come to it.
    """
    extremal = solution.extremal
    if solution.local or (
        extremal is not None and extremal.form.coordinates.energetic and any(extremal.form.coordinates.singular)
    ):
        return solution
    sign = solution.problem.sign
    rivals = _broken_curves(solution.problem, sign * solution.value + 2 * LIKE_VALUES * abs(solution.value))
    for same in rivals:
        if _is_rival(solution, same):
            message = (
                f"the infimum is not attained: graphs come as near as one likes to one that is none; {same.sentence}"
            )
            return refused(solution, Finding(Verdict.NOT_ATTAINED, message))
    margin = solution.error.value + RIVAL_MARGIN * abs(solution.value)
    if not rivals or sign * rivals[0].value > sign * solution.value - margin:
        return solution
    return local_only(solution, rivals[0].sentence, rivals[0].value)


def runs_level(x: np.ndarray, y: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Which of ``K`` graphs might be a broken curve, as near as graphs come to it; (K,) of bool.

    Those that run along one level but for a tenth of the interval next to each end, and jump to it there: x and y
    (K, P) are points of the graphs in their order, ``ends`` (K, 2) the ordinates at their ends.
    """
    middle = y[:, [y.shape[1] // 2]]
    jump = np.abs(middle - ends).max(1)
    share = (x - x[:, :1]) / (x[:, -1:] - x[:, :1])
    away = np.where((share > JUMP_SHARE) & (share < 1 - JUMP_SHARE), np.abs(y - middle), 0.0).max(1)
    real = jump > NO_JUMP * np.maximum(np.abs(ends).max(1), np.abs(middle[:, 0]))
    return real & (away <= LEVEL_DEPARTURE * jump)


def _is_rival(solution: Solution, rival: BrokenCurve) -> bool:
    """Whether a graph has the value of a broken curve with a real jump, and runs at its level."""
    if not rival.jumps or abs(solution.value - rival.value) > LIKE_VALUES * abs(rival.value):
        return False
    first, last = (float(solution.y(x)) for x in solution.interval)
    jump = max(abs(rival.level - first), abs(rival.level - last))
    return abs(float(solution.y(0.5 * sum(solution.interval))) - rival.level) <= ALONG_LEVEL * jump
