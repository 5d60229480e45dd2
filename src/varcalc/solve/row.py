"""The points of a sweep that one process solves, each from what it knows nearby.

An answer that was begun from a neighbour's curve lies in that one's valley. So at intervals along the way it is looked
whether another valley is lower by now, as a solve of its own would; where one is, all points about are looked at.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.existence.global_look import has_lattice
from varcalc.methods.ritz.family import Answers
from varcalc.problem.convexity import proved_least
from varcalc.problem.functional import check_functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution
from varcalc.solve.ladder import reconsidered, solve
from varcalc.solve.point import BROKEN_POINT, Measured, SweepPoint
from varcalc.solve.warm_start import Neighbours

BATCH = 512
"""Points solved together at most."""
GROWTH = 4
"""By how much more points are solved together each time, until they are that many."""
STRETCH = 16
"""Points begun from neighbours of which one is held against other valleys, as long as it stands."""
LONG_STRETCH = 128
"""The same of points solved together, each of which costs a fraction of that look."""
FRESH_STRETCH = 256
"""The same where the look is a solve from nothing."""

Values = dict[str, float]
"""The values of the parameters at a point, by name."""
Source = Problem | Curve | Callable[..., Problem | Curve | Solution | Measured]
"""A problem with parameters, or a function that makes it, from their values or once for all of them."""


def made_once(source: Source) -> bool:
    """Whether a source is a function without arguments."""
    return not isinstance(source, Problem | Curve) and not inspect.signature(source).parameters


@dataclass
class _Found:
    """A point, and the solution it stands for where it was begun from a neighbour's curve."""

    point: SweepPoint
    solution: Callable[[], Solution] | None = None


class SweepRow:
    """The points of a sweep that are solved in one process; ``expected`` is how many there are in all."""

    def __init__(self, source: Source, method: Any, tol: float, expected: int) -> None:
        self.source: Any = source
        if callable(source) and made_once(source):
            self.source = source()
            check_functional(self.source)
        self.method, self.tol, self.expected = method, tol, expected
        self.built = isinstance(self.source, Problem | Curve)
        self.long_stretch = LONG_STRETCH if self.built and has_lattice(self.source) else FRESH_STRETCH
        self.last: Solution | None = None
        self.neighbours: Neighbours | None = None

    def groups(self, points: list[Values]) -> Iterator[list[SweepPoint]]:
        """What is found at the points, one after the other or many together, in their order."""
        if self.built and points and (strange := points[0].keys() - self.source.parameters.keys()):
            self.source.with_parameters(dict.fromkeys(strange, 0.0))  # which says that there are none of that name
        size, done = 1 if self.neighbours is None else BATCH, 0
        while done < len(points):
            together = points[done : done + size]
            yield self._solved(together)
            done += len(together)
            # the first of the points are far from what is known
            size = min(GROWTH * size, BATCH) if self.neighbours is not None else 1

    def _solved(self, points: list[Values]) -> list[SweepPoint]:
        found = self._together(points)
        each = [known or self._alone(values) for values, known in zip(points, found, strict=True)]
        return self._held_against_other_valleys(points, each)

    # ---- many at a time

    def _together(self, points: list[Values]) -> list[_Found | None]:
        """Those of the points that stand when they are solved together."""
        if self.neighbours is None:
            return [None] * len(points)
        began = time.perf_counter()
        values = np.array([list((self.source.parameters | given).values()) for given in points])
        answers = self.neighbours.solved(values)
        sure = self.neighbours.beyond_doubt(values, answers).tolist()
        value, error = (self.neighbours.form.sign * answers.value).tolist(), answers.error.tolist()
        steps = answers.iterations.tolist()
        each = (time.perf_counter() - began) / len(points)
        found: list[_Found | None] = [None] * len(points)
        for row in np.flatnonzero(answers.stands).tolist():
            if sure[row]:
                point = SweepPoint(tuple(points[row].values()), "solved", value[row], error[row], steps[row], each)
                found[row] = _Found(point, lambda row=row: self._as_solution(points[row], answers, row, each))
            else:
                found[row] = self._examined(points[row], answers, row, each)
        return found

    def _as_solution(self, values: Values, answers: Answers, row: int, seconds: float) -> Solution:
        """A point that was solved with others, as the solution it is; held against curves with corners and jumps."""
        assert self.neighbours is not None
        return self.neighbours.solution(self.source.with_parameters(values), answers[row], seconds)

    def _examined(self, values: Values, answers: Answers, row: int, seconds: float) -> _Found | None:
        """A point that was solved with others, held against other curves; None where it does not stand up to that."""
        began = time.perf_counter()
        solution = self._as_solution(values, answers, row, seconds)
        if not solution.status.ok:
            return None
        return _Found(SweepPoint.of(values, solution, seconds + time.perf_counter() - began), lambda: solution)

    # ---- one at a time

    def _alone(self, values: Values) -> _Found:
        """A point solved for itself, from the last curve if that leads anywhere."""
        began = time.perf_counter()
        try:
            made = self.source.with_parameters(values) if self.built else self.source(**values)
            if isinstance(made, Measured):
                return _Found(made.point(values, time.perf_counter() - began))
            solution, warm = (made, False) if isinstance(made, Solution) else self._from_the_last(made)
        except BROKEN_POINT as error:
            message = f"{type(error).__name__}: {error}"
            return _Found(SweepPoint.failed(values, message, time.perf_counter() - began))
        self._remember(solution)
        point = SweepPoint.of(values, solution, time.perf_counter() - began)
        return _Found(point, (lambda: solution) if warm else None)

    def _from_the_last(self, problem: Problem | Curve) -> tuple[Solution, bool]:
        """The solution of a problem, and whether it was begun from the last one."""
        if self.last is not None and _alike(problem, self.last):
            solution = solve(problem, self.method, tol=self.tol, throw=False, guess=self.last, progress=False)
            if solution.status.ok:
                return solution, True
        return solve(problem, self.method, tol=self.tol, throw=False, progress=False), False

    def _remember(self, solution: Solution) -> None:
        if not solution.status.ok:
            return
        self.last = solution
        if self.neighbours is not None:
            self.neighbours.add(solution)
        elif self.built:
            self.neighbours = Neighbours.of(solution, self.tol, self.expected)

    # ---- other valleys

    def _held_against_other_valleys(self, points: list[Values], found: list[_Found]) -> list[SweepPoint]:
        """The points, those that were begun in a valley that is no longer the lowest solved anew."""
        doubtful, length = False, STRETCH if self.neighbours is None else self.long_stretch
        for first in range(0, len(found), length):
            stretch = [k for k in range(first, min(first + length, len(found))) if found[k].solution is not None]
            if not stretch:
                continue
            left = self._leave(points, found, stretch[-1])
            if left or doubtful:
                for k in stretch[:-1]:
                    self._leave(points, found, k)
            doubtful = left
        return [each.point for each in found]

    def _leave(self, points: list[Values], found: list[_Found], k: int) -> bool:
        """Whether a point's valley was not the lowest; the point is then what a solve of its own says of it."""
        known = found[k].solution
        assert known is not None
        began = time.perf_counter()
        if self.built and proved_least(self.source.with_parameters(points[k])):
            return False
        solution = known()
        better = reconsidered(solution, self.method, self.tol)
        if better is solution:
            return False
        self._remember(better)
        seconds = found[k].point.seconds + time.perf_counter() - began
        found[k] = _Found(SweepPoint.of(points[k], better, seconds))
        return True


def _alike(problem: Problem | Curve, last: Solution) -> bool:
    """Whether the last curve is one of this problem's kind, over the same interval."""
    other = last.problem
    if problem.templates is other.templates:
        return True
    return type(problem) is type(other) and (problem.n, problem.span) == (other.n, last.interval)
