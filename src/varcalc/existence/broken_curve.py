"""Curves that drop straight down (or up) at their ends and run level between: Goldschmidt's solution.

Where L grows linearly with the slope, a jump from y to c at the abscissa x has
the finite cost of the integral of L's recession function, the limit of
L(x, eta, v) / |v|, over eta from y to c. Such a curve is a limit of graphs, so
a minimum above it is only local (Goldschmidt 1831; Gelfand and Fomin,
"Calculus of Variations", sect. 4, example 2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeGuard

import numpy as np

from varcalc.conditions import Fixed
from varcalc.functional import Functional
from varcalc.mesh import gauss
from varcalc.problem import Problem
from varcalc.solution import Solution, Status, Verdict

STEEP = (1e6, 1e8)
"""Slopes, in units of the problem's own, at which linear growth is recognised."""
LINEAR = 1e-4
"""Relative difference of L / |v| at the two slopes that is linear growth."""
LEVELS = 33
REACH = 3.0
"""How far beyond the ends levels are looked at, in units of the problem's size."""
POINTS = 10
GRADES, FINE_POINTS = 26, (8, 12)
"""Halvings of the panels toward both ends of a jump, and points a panel, by which a value is made sure of."""
NEAR = 0.2
"""Relative distance from the rival value within which a scan of the levels is followed up."""
CONTRACTIONS = 70
GOLDEN = 0.5 * (5**0.5 - 1)
STEP = 1e-3
"""Relative height of a jump that is one."""
LIKE = 1e-7
"""Relative difference of the values of a graph and of the broken curve that it comes near."""
ALONG = 0.05
"""Distance from the level, in units of the jump, at which a graph runs along it."""
RIVAL = 1e-9
"""Relative margin by which a broken curve has to be better: its own value is no more accurate."""


@dataclass(frozen=True)
class BrokenCurve:
    """The best curve that jumps to y = ``level`` at both ends, and its ``value`` (with the person's sign)."""

    value: float
    level: float

    @property
    def sentence(self) -> str:
        """What the curve is, for a person."""
        return f"the broken curve that drops to y = {self.level:.6g} at both ends has the value {self.value:.9g}"


def broken_curve(problem: Functional) -> BrokenCurve | None:
    """The best broken curve between two fixed ends; None where L does not grow linearly, or more is asked."""
    found = _broken_curves(problem, math.nan)
    return found[0] if found else None


def _broken_curves(problem: Functional, rival: float) -> list[BrokenCurve]:
    """The broken curves of locally best level, best first; none when a scan shows that none comes near ``rival``."""
    if not _simple(problem):
        return []
    with np.errstate(all="ignore"):
        family = _Family(problem)
        return family.best(rival) if family.linear else []


def _simple(problem: Functional) -> TypeGuard[Problem]:
    plain = isinstance(problem, Problem) and problem.n == problem.order == 1
    if not plain or problem.constraints or problem.unknowns or problem.end_cost or problem.breakpoints:
        return False
    return isinstance(problem.start, Fixed) and isinstance(problem.end, Fixed)


class _Family:
    """Broken curves of one problem by their level, in the sense that is minimised."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.sign = -1.0 if problem.maximise else 1.0
        a, b = problem.span
        ends: list[Any] = [problem.start, problem.end]
        self.y = np.array([float(np.ravel(e.y)[0]) for e in ends])
        self.size = max(float(np.ptp(self.y)), float(np.abs(self.y).max())) or b - a
        self.steep = self.size / (b - a)
        self.coarse = _graded(0, POINTS)
        x = a + (b - a) * np.array([0.0, 0.5, 1.0])
        y = np.array([self.y[0], self.y.mean(), self.y[1]])
        rows = [self._recession(x, y, slope * self.steep * side) for slope in STEEP for side in (1.0, -1.0)]
        low, high = np.array(rows[:2]), np.array(rows[2:])
        finite = np.isfinite(low).all() and np.isfinite(high).all() and bool((high > 0).all())
        self.linear = finite and bool((np.abs(high - low) <= LINEAR * high).all())

    def _values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        x, y, v = np.broadcast_arrays(x, y, v)
        values = self.problem.integrand_values(x.ravel(), y.reshape(1, -1), v.reshape(1, -1))
        return self.sign * values.reshape(x.shape)

    def _recession(self, x: Any, y: Any, slope: Any) -> np.ndarray:
        slope = np.asarray(slope, dtype=float)
        return self._values(np.asarray(x), np.asarray(y), slope) / np.abs(slope)

    def at(self, levels: np.ndarray, rule: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
        """The functional of the broken curves at levels (m,); NaN beyond where a jump no longer costs anything."""
        a, b = self.problem.span
        nodes, weights = self.coarse if rule is None else rule
        total = (b - a) * (self._values(a + (b - a) * nodes, levels[:, None], np.zeros(1)) @ weights)
        for x, y, outward in ((a, self.y[0], 1.0), (b, self.y[1], -1.0)):
            jump = levels - y
            slope = STEEP[1] * self.steep * outward * np.where(jump < 0, -1.0, 1.0)
            costs = self._recession(x, y + jump[:, None] * [*nodes, 1.0], slope[:, None])
            total = total + np.where((costs >= 0).all(1), np.abs(jump) * (costs[:, :-1] @ weights), np.nan)
        return total

    def best(self, rival: float) -> list[BrokenCurve]:
        """The levels of least value, from a scan and golden sections about each of its lowest places; best first."""
        low, high = self.y.min() - REACH * self.size, self.y.max() + REACH * self.size
        levels = np.unique(np.concatenate([np.linspace(low, high, LEVELS), self.y]))
        values = self.at(levels)
        if not np.isfinite(values).any() or np.nanmin(values) > self.sign * rival + NEAR * abs(rival):
            return []
        around = np.concatenate([[np.inf], np.nan_to_num(values, nan=np.inf), [np.inf]])
        lowest = np.isfinite(values) & (around[1:-1] <= around[:-2]) & (around[1:-1] <= around[2:])
        places = [self._least(levels, k) for k in map(int, np.flatnonzero(lowest))]
        found = sorted((value, level) for level in places if (value := self._sure(level)) is not None)
        return [BrokenCurve(self.sign * value, level) for value, level in found]

    def _sure(self, level: float) -> float | None:
        """The value at a level by rules that resolve what a jump costs near its ends; None where two of them differ."""
        one, other = (float(self.at(np.array([level]), _graded(GRADES, n))[0]) for n in FINE_POINTS)
        return other if abs(one - other) <= 0.1 * RIVAL * abs(other) else None

    def _least(self, levels: np.ndarray, k: int) -> float:
        """The level of least value between the neighbours of the level k."""
        left, right = levels[max(k - 1, 0)], levels[min(k + 1, len(levels) - 1)]
        for _ in range(CONTRACTIONS):
            inner = np.array([right - GOLDEN * (right - left), left + GOLDEN * (right - left)])
            one, other = np.nan_to_num(self.at(inner), nan=np.inf)
            if np.isinf(one) and np.isinf(other):
                # both beyond the edge of what costs anything: toward the level known to be admissible
                left, right = (inner[1], right) if levels[k] > inner[1] else (left, inner[0])
            elif one <= other:
                right = inner[1]
            else:
                left = inner[0]
        tried = np.array([left, 0.5 * (left + right), right, levels[k]])
        return float(tried[int(np.nanargmin(self.at(tried)))])


@lru_cache(maxsize=8)
def _graded(grades: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1] of Gauss rules on panels that are halved ``grades`` times toward both ends."""
    toward = 0.5 ** np.arange(grades + 1, 0, -1)
    edges = np.concatenate([[0.0], toward, 1.0 - toward[-2::-1], [1.0]]) if grades else np.array([0.0, 1.0])
    half = 0.5 * np.diff(edges)[:, None]
    nodes, weights = gauss(points)
    return (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


def with_rival(solution: Solution) -> Solution:
    """A minimum, marked local when a broken curve, which jumps at its ends, comes lower.

    Refused where it is that broken curve itself, as near as graphs come to it.
    """
    extremal = solution.extremal
    if solution.local or (extremal is not None and extremal.form.energetic and any(extremal.form.singular)):
        return solution
    rivals = _broken_curves(solution.problem, solution.value)
    for same in rivals:
        if _is_rival(solution, same):
            message = (
                f"the infimum is not attained: graphs come as near as one likes to one that is none; {same.sentence}"
            )
            return replace(solution, status=Status.REFUSED, verdict=Verdict.NOT_ATTAINED, message=message)
    sign = -1.0 if solution.problem.maximise else 1.0
    margin = solution.error.value + RIVAL * abs(solution.value)
    if not rivals or sign * rivals[0].value > sign * solution.value - margin:
        return solution
    rival = rivals[0]
    message = f"a local {'maximum' if sign < 0 else 'minimum'} only: {rival.sentence}"
    return replace(solution, local=True, lower=rival.value, message=message)


def _is_rival(solution: Solution, rival: BrokenCurve) -> bool:
    """Whether a graph has the value of a broken curve with a real jump, and runs at its level."""
    first, last = (float(solution.y(x)) for x in solution.interval)
    jump = max(abs(rival.level - first), abs(rival.level - last))
    size = max(abs(first), abs(last), abs(rival.level))
    if jump <= STEP * size or abs(solution.value - rival.value) > LIKE * abs(rival.value):
        return False
    return abs(float(solution.y(0.5 * sum(solution.interval))) - rival.level) <= ALONG * jump
