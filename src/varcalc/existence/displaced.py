"""A lower curve whose step lies elsewhere, where the functional hardly says where it lies.

Where L is without x, a curve that rests near one level and then near another, a kink of a double well, may make the
step anywhere: far from both ends the functional changes by less than round-off as the step moves. What a direct
method ends at is then a matter of its start, and near an end the functional may be lower by far more than it claims.
A curve known only roughly, on a long interval, is the sign of it. Led through the middle of the step at a given place
the curve is well determined, and its value, by place, is looked through from either end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.formulation import Sampled, formulate
from varcalc.methods.ritz.method import Ritz
from varcalc.problem.conditions import Through
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

SOFT = 1e-9
"""Error of a curve, in units of its extent, from which on its place may not be fixed."""
PLACES_FOR_STEEPEST = 257
"""Abscissae at which the steepest place of a curve is looked for."""
LONG = 6.0
"""The least interval, in units of the extent over the steepest slope, on which a step could be elsewhere."""
SHARE = 0.9
"""The least share of the extent that a step makes within one of those units on either side."""
DRIVEN = 1e-3
"""Change of the functional by which a step that moves by one of those units knows where to go, relative to it."""
STRIDE = 0.25
"""Way between two places, in those units."""
MOST_STRIDES = 40
"""Places that are tried from either end."""
FLAT = 1e-12
"""Change of the value from place to place, relative to it, that says no more."""
NARROW = 1e-6
"""Error of the best place, in those units."""
PINNED = Ritz(elements=16, starts=1)
"""The direct method for a curve through a given point."""


@dataclass(frozen=True)
class MovableStep:
    """The steep part of a curve: its ``place`` x, its ``height`` y, and the extent over its slope as a unit of x."""

    solution: Solution
    place: float
    height: float
    unit: float

    @property
    def problem(self) -> Problem:
        """What is asked."""
        assert isinstance(self.solution.problem, Problem)
        return self.solution.problem

    def at(self, place: float) -> Solution:
        """The least curve that has the height of the step at a place."""
        problem, curve = self.problem, self.solution.curve
        assert curve is not None
        pinned = problem.restated(constraints=[Through(place, self.height)])
        (a, b), moved = problem.span, [self.place, place]
        start: Sampled = lambda x: curve(np.clip(np.asarray(x) + moved[0] - moved[1], a, b), 0)  # noqa: E731
        form = formulate(pinned)
        return PINNED.solve(form, tol=1e-10, guess=form.coordinates.pull(start))

    def value(self, place: float) -> float:
        """The least value with the step at a place; infinite where none is found."""
        found = self.at(place)
        return self.problem.sign * found.value if found.status.ok else np.inf

    def lower(self) -> Iterator[Solution]:
        """From either end, the curve with the step where the value is lowest, where it is lower than what is known."""
        known = self.problem.sign * self.solution.value
        noise = FLAT * max(abs(known), 1e-300)
        a, b = self.problem.span
        for end, way in ((a, STRIDE * self.unit), (b, -STRIDE * self.unit)):
            places, values = [end], [np.inf]
            while len(places) < MOST_STRIDES and abs(places[-1] - end) < 0.5 * (b - a):
                places.append(end + len(places) * way)
                values.append(self.value(places[-1]))
                if abs(values[-1] - values[-2]) <= noise:
                    break
            k = int(np.argmin(values))
            if values[k] < known - noise:
                yield self.at(self._within(places[k - 1], places[k + 1]) if k + 1 < len(places) else places[k])

    def _within(self, first: float, last: float) -> float:
        """The place of the lowest value between two."""
        from scipy.optimize import minimize_scalar  # few solves need it

        options = {"xatol": NARROW * self.unit}
        bounds = sorted([first, last])
        return float(minimize_scalar(self.value, bounds=bounds, method="bounded", options=options).x)


def _step(solution: Solution) -> MovableStep | None:
    """The step of a curve that may be anywhere; None where its place is fixed, or L has x.

    A step between levels on which L differs goes where it has to by itself.
    """
    problem, curve = solution.problem, solution.curve
    assert isinstance(problem, Problem)
    assert curve is not None
    if ca.depends_on(problem.integrand, problem.symbols.x):
        return None
    x = np.linspace(*problem.span, PLACES_FOR_STEEPEST)
    y = curve(x, 0)[0]
    extent, rises = float(np.ptp(y)), np.abs(np.diff(y))
    steepest = int(np.argmax(rises))
    unit = extent * (x[1] - x[0]) / float(rises[steepest]) if extent > 0 else np.inf
    place, height = (float(0.5 * (v[steepest] + v[steepest + 1])) for v in (x, y))
    if not (solution.error.curve > SOFT * extent and x[-1] - x[0] > LONG * unit):
        return None
    made = abs(float(np.diff(np.interp([place - unit, place + unit], x, y))[0]))
    rests = [np.array([np.median(side)]) for side in (y[: steepest + 1], y[steepest + 1 :])]
    before, after = (float(problem.integrand_on(x[:1], level, np.zeros(1))[0]) for level in rests)
    if made < SHARE * extent or unit * abs(after - before) > DRIVEN * abs(solution.value):
        return None
    return MovableStep(solution, place, height, float(unit))


def displaced(solution: Solution) -> Iterator[Sampled]:
    """Curves with the step where the functional is lower; none where its place is fixed or L has x."""
    step = _step(solution)
    if step is None:
        return
    for found in step.lower():
        if found.status.ok and (curve := found.curve) is not None:
            yield lambda x, curve=curve: curve(np.atleast_1d(x), 0)
