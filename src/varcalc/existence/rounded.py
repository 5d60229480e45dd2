"""A coarse minimum with everything that switches rounded off: near what a curve comes that is broken there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from varcalc.formulation import Form, Sampled, Stated, conditions_of, formulate
from varcalc.methods.crossings import ARGUMENT_ROUND_OFF
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.switches import smoothed, units
from varcalc.symbolic.tracing import Expression

Points = Sequence[Sequence[np.ndarray]]

ROUNDED = (0.3, 0.05, 0.01, 2e-3)
"""Widths over which switches are rounded off, in turn, relative to the size of what switches."""
WIDER = (10.0, 1e3, 1e5)
"""Those that are tried in turn where the first is too narrow for any curve to be found."""
COARSE = Ritz(elements=24, degree=3, refine=False)
PLACES_FOR_SIZES = 33
"""Places of a line at which it is seen how large what switches is."""


class Rounded(NamedTuple):
    """A curve with switches rounded off over the last ``width``, where the units of that were taken, in which.

    ``stands`` says whether it is a minimum for all that its mesh tells.
    """

    curve: CurveOrSlope
    width: float
    sizes: np.ndarray
    stands: bool


def rounded(problem: Problem, guess: Sampled | None) -> Rounded | None:
    """A coarse minimum with all switches rounded off, less and less, in the end; None where there is none.

    The units in which a width is meant are those along the last curve. A line that all but keeps to a switch is none to
    take them from: what is rounded off too little to begin with is rounded off more.
    """
    plain = formulate(problem)
    points = points_along(problem, plain.start.curve)
    found: Rounded | None = None
    widths = list(ROUNDED)
    wider = list(WIDER)
    while widths:
        form = _smooth(problem, plain, widths[0], points)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            solution = COARSE.solve(form, tol=1e-6, guess=guess)
        if solution.curve is not None and np.isfinite(solution.value):
            found = Rounded(solution.curve, widths.pop(0), sizes_at(problem, points), solution.status.ok)
            guess = ordinates_of(solution.curve)
            points = points_along(problem, guess)
        elif found is None and wider:
            widths.insert(0, wider.pop(0))
        else:
            break
    return found


def ordinates_of(curve: CurveOrSlope) -> Sampled:
    """A curve as a guess."""
    return lambda x: curve(x, 0)


def sizes_at(problem: Problem, points: Points) -> np.ndarray:
    """How large what switches on a curve is at points."""
    return np.array(units([switch.argument for switch in on_curve(problem)], problem.symbols.all, points)[0])


def points_along(problem: Problem, line: Sampled) -> Points:
    """What L depends on, along a line: one array for each entry of a symbol."""
    x = np.linspace(*problem.span, PLACES_FOR_SIZES)
    y = line(x)
    slopes = np.gradient(y, x, axis=1)
    slopes = np.where(
        np.abs(slopes) * np.ptp(x) <= ARGUMENT_ROUND_OFF * np.abs(y).max(), 0.0, slopes
    )  # made of round-off
    bends = np.gradient(slopes, x, axis=1)[: problem.symbols.ddy.numel()]
    numbers = [[np.array(v) for v in values] for values in (problem.parameter_values, problem.unknown_guesses)]
    return [[x], list(y), list(slopes), list(bends), *numbers]


def rounded_off(problem: Functional, expression: Expression, width: float, points: Points) -> Expression:
    """An expression with what switches in it smooth over a ``width``, in units of what that is at points."""
    s = problem.symbols
    sizes = units([expression], s.all, points)[1]
    return smoothed([expression], s.all, [width * size for size in sizes])[0]


def _smooth(problem: Problem, plain: Form, width: float, points: Points) -> Form:
    s = problem.symbols

    def rewrite(expression: Expression, _: bool) -> Expression:
        return rounded_off(problem, expression, width, points)

    integrand = problem.sign * rewrite(problem.integrand, True)
    coordinates = replace(plain.coordinates, stated=Stated(s, integrand, integrand), numbers=None)
    conditions = conditions_of(problem, rewrite, plain.conditions.knots, plain.conditions.waypoints)
    return replace(plain, coordinates=coordinates, conditions=conditions, cache=Cache(), elsewhere=None)
