"""Sectors of the slope of one function: between the slopes at which the Lagrangian has a kink or jumps it is smooth.

On a sector, its ends among them, what switches by the slope alone stays on one side. The slope at which L jumps is a
sector of its own, where L is what is written there: of that and of the two sides the lowest counts, as for an infimum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import answered
from varcalc.symbolic.switches import Switch, held
from varcalc.symbolic.tracing import Expression

SLOPES_TRIED = np.concatenate([-(2.0 ** np.arange(9, -11, -0.5)), [0.0], 2.0 ** np.arange(-10, 9.5, 0.5)])
"""Slopes between which levels are looked for: in units of 1 and of the chord's, about 0 and about the latter."""
MOST_LEVELS = 12
"""Slopes at which L switches that are told apart, those nearest to the chord's."""
NO_LOWER = 1e-12
"""Relative difference of L on both sides of a level that is none."""
AT_LEVEL = 1e-7
"""Distance from a level, in units of the slope or of the problem's own, within which a slope is at it."""


@dataclass(frozen=True)
class Level:
    """A slope at which L has a kink, or jumps: there the switch's argument is ``level``."""

    slope: float
    switch: Switch
    level: float

    def argument(self, problem: Problem, slope: float) -> float:
        """What decides the switch at a slope of its problem."""
        s = problem.symbols
        function = ca.Function("argument", [s.dy, s.parameters], [self.switch.argument])
        return float(function(slope, problem.parameter_values))


@dataclass(frozen=True)
class SlopeSectors:
    """What is summed, by sectors of the slope: number 2 k lies below level k, number 2 k + 1 is that level alone.

    ``edges`` (2, sectors) are the slopes that bound them; ``branches`` are, for each, what is minimised and what is
    levelled, in the problem's symbols. Without levels all slopes are one sector. The ``unit`` is the largest slope that
    is known, of the levels and of the chord.
    """

    levels: tuple[Level, ...]
    edges: np.ndarray
    branches: tuple[tuple[Expression, ...], ...]
    unit: float

    def of(self, slopes: np.ndarray) -> np.ndarray:
        """The sectors of slopes (m,): below a level and above it, which are the same beside one, and it; (3, m)."""
        levels = np.array([level.slope for level in self.levels])
        room = AT_LEVEL * np.maximum(self.unit, np.abs(slopes))
        below, above = np.searchsorted(levels, slopes - room), np.searchsorted(levels, slopes + room, "right")
        return np.array([2 * below, 2 * above, below + above])

    def lower_side(self, problem: Problem, level: Level, x: float, y: float) -> int:
        """The side of a level, -1 or 1, on which what is minimised is lower at a place; 0 where it is at it alone."""
        below, at, above, room = self._about(problem, level, x, y)
        return 0 if at < min(below, above) - room else 1 if above < below - room else -1

    def open_at(self, problem: Problem, level: Level, x: float, y: float) -> bool:
        """Whether what is minimised is higher at a level than it comes to beside it, at a place."""
        below, at, above, room = self._about(problem, level, x, y)
        return at > min(below, above) + room

    def _about(self, problem: Problem, level: Level, x: float, y: float) -> tuple[float, float, float, float]:
        """What is minimised below a level, at it and above it, and how far these are known."""
        summed, k = by_sector(problem, self.branches), self.levels.index(level)
        place = [x, y, level.slope, np.zeros(0), problem.parameter_values, np.zeros(0)]
        below, at, above = (float(summed(*place, 2 * k + number)[0]) for number in range(3))
        return below, at, above, NO_LOWER * max(abs(below), abs(above))

    def at(self, slope: float) -> Level | None:
        """The level that a slope is at; None for none."""
        room = AT_LEVEL * max(self.unit, abs(slope))
        return next((level for level in self.levels if abs(level.slope - slope) <= room), None)


@answered
def slope_sectors(problem: Problem) -> SlopeSectors:
    """The sectors of a graph's slope; one where nothing switches by the slope alone."""
    s, chord = problem.symbols, _chord(problem)
    measures = [SLOPES_TRIED, abs(chord) * SLOPES_TRIED]
    tried = np.unique(np.concatenate([*measures, *(chord + m for m in measures)]))
    levels, beyond = _nearest(_levels(problem, tried), chord)
    stated = [problem.sign * problem.integrand]
    stated += [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    slopes = [level.slope for level in levels]
    edges = [beyond[0], *(slope for slope in slopes for _ in range(2)), beyond[1]]
    ends = [max(beyond[0], tried[0]), *slopes, min(beyond[1], tried[-1])] if slopes else []
    inside = np.insert([0.5 * (a + b) for a, b in pairwise(ends)], range(1, len(slopes) + 1), slopes)
    place = [np.array([0.5 * sum(problem.span)]), np.ones(1)]
    numbers = [np.zeros(0), problem.parameter_values, np.zeros(0)]
    branches = [held(stated, s.all, [*place, np.array([slope]), *numbers], moving=s.dy) for slope in inside]
    whole = tuple(tuple(branch) for branch in branches or [stated])
    unit = max(abs(chord), *map(abs, slopes), 0.0) or 1.0
    return SlopeSectors(tuple(levels), np.array([edges[:-1], edges[1:]]), whole, unit)


def _nearest(levels: list[Level], chord: float) -> tuple[list[Level], tuple[float, float]]:
    """The levels nearest to the chord's slope, in order, and between which others they lie."""
    order = sorted(levels, key=lambda level: abs(level.slope - chord))
    kept, others = sorted(order[:MOST_LEVELS], key=lambda level: level.slope), order[MOST_LEVELS:]
    below = [level.slope for level in others if level.slope < kept[0].slope]
    above = [level.slope for level in others if level.slope > kept[-1].slope]
    return kept, (max(below, default=-math.inf), min(above, default=math.inf))


def _chord(problem: Problem) -> float:
    """The slope of the line between the ends; 0 where one of them is free."""
    first, last = (float(end.values(1)[0]) for end in (problem.start, problem.end))
    return (last - first) / (problem.span[1] - problem.span[0]) if math.isfinite(last - first) else 0.0


def by_sector(problem: Problem, branches: Sequence[Sequence[Expression]]) -> ca.Function:
    """What is summed as a function of the problem's symbols and the number of a sector."""
    number = ca.SX.sym("sector")
    rows = [ca.if_else(number == k, ca.vertcat(*branch), 0) for k, branch in enumerate(branches)]
    summed = sum(rows[1:], rows[0]) if len(rows) > 1 else ca.vertcat(*branches[0])
    return ca.Function("summed", [*problem.symbols.all, number], [ca.densify(summed)])


def _levels(problem: Problem, tried: np.ndarray) -> list[Level]:
    """The slopes between those ``tried`` at which something switches; none where more than the slope decides."""
    s, numbers = problem.symbols, problem.parameter_values
    found: dict[float, Level] = {}
    for switch in on_curve(problem):
        if not switch.depends_on(s.dy):
            continue
        if switch.depends_on(ca.vertcat(s.x, s.y, s.unknowns)):
            return []
        argument = ca.Function("argument", [s.dy, s.parameters], [switch.argument])

        def above(slope: float, level: float, argument: ca.Function = argument) -> float:
            """How far above a level the argument is at a slope."""
            return float(argument(slope, numbers)) - level

        values = np.array([above(slope, 0.0) for slope in tried])
        for (low, a), (high, b) in pairwise(zip(tried, values, strict=True)):
            for level in switch.within(min(a, b), max(a, b))[: MOST_LEVELS + 1].tolist() if np.isfinite(a + b) else ():
                ends = [float(v) for v, at in ((low, a), (high, b)) if at == level]
                slope = ends[0] if ends else float(brentq(above, low, high, args=(level,)))
                found.setdefault(slope, Level(slope, switch, level))
    return list(found.values())
