"""Curves that a kink of L in the ordinate holds: dead cores, as contacts with a bound.

Where L rises to both sides of a level, as c abs(y) does of y = 0, a curve may rest on it. On one side of the level L
is smooth, and the level is a bound of that side's problem; what rests there is a contact, with ends that the direct
method places (Kinderlehrer and Stampacchia, "An Introduction to Variational Inequalities", 1980, ch. 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import switches_of
from varcalc.problem.conditions import Bound
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.switches import Switch, held
from varcalc.symbolic.tracing import Expression

Curve = Callable[[np.ndarray, int], np.ndarray]

BUMPS = (1e-2, 1e-4)
"""Heights of the bumps, in units of the curve's extent, by which it is seen that a level holds a curve."""
GAUSS_POINTS = 24
SAMPLES = 101


def resting(problem: Problem, method: Ritz, tol: float, curve: Curve, found: list[Crossing]) -> Solution | None:
    """The least curve that rests where ``curve`` follows a kink, and stays on one side of it; None for another."""
    switch = _level(problem, found)
    if switch is None:
        return None
    side = _side(problem, switch, curve)
    if side == 0.0:
        return None
    inner = _one_sided(problem, switch, side, curve)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        solution = replace(method, starts=1).solve(formulate(inner), tol=tol, guess=lambda x: curve(x, 0))
    if not solution.status.ok or solution.curve is None or not _holds(problem, solution.curve, solution, found):
        return None
    lasting = resampled(solution.curve, solution.x.tolist(), 1 + problem.order)
    return replace(solution, problem=problem, method=method, multipliers=(), curve=lasting, extremal=None)


def _level(problem: Problem, found: list[Crossing]) -> Switch | None:
    """The one kink of the problem, where it is one in the ordinate that the curve follows; None for anything else."""
    switches = switches_of(problem)
    more = problem.constraints or problem.unknowns or problem.end_cost is not None or problem.n > 1
    if more or len(switches) != 1 or not any(c.until is not None for c in found):
        return None
    switch, s = switches[0], problem.symbols
    moves = switch.jumps or switch.stepped or switch.depends_on(s.dy) or not switch.depends_on(s.y)
    return None if moves else switch


def _argument(problem: Problem, switch: Switch, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    s = problem.symbols
    function = ca.Function("argument", [s.x, s.y, s.parameters], [switch.argument])
    numbers = np.tile(problem.parameter_values[:, None], (1, len(x)))
    return np.asarray(function(x[None], y, numbers)).ravel()


def _side(problem: Problem, switch: Switch, curve: Curve) -> float:
    """The side of the level on which the curve starts and ends, that of the larger departure; 0 where it changes."""
    x = np.linspace(*problem.span, SAMPLES)
    values = _argument(problem, switch, x, curve(x, 0))
    side = float(np.sign(values[np.argmax(np.abs(values))]))
    return side if min(side * values[0], side * values[-1]) >= 0.0 else 0.0


def _one_sided(problem: Problem, switch: Switch, side: float, curve: Curve) -> Problem:
    """The problem of one side of the level, which is a bound of it."""
    s = problem.symbols
    x = np.linspace(*problem.span, SAMPLES)
    at = int(np.argmax(side * _argument(problem, switch, x, curve(x, 0))))
    point = [x[at : at + 1], curve(x[at : at + 1], 0)[:, 0], curve(x[at : at + 1], 1)[:, 0], np.zeros(s.ddy.numel())]
    numbers = [problem.parameter_values, problem.unknown_guesses]
    smooth = held([problem.integrand], s.all, [*point, *numbers])[0]
    names = tuple(problem.parameters)

    def stated(expression: Expression) -> Callable[..., Expression]:
        """An expression of the problem's symbols as a user states it, a function of (x, y, dy[, p])."""
        function = ca.Function("stated", s.all, [expression])

        def handed(x: Any, y: Any, dy: Any, p: Any = None) -> Expression:
            values = [getattr(p, name) for name in names]
            return function(x, y, dy, np.zeros(s.ddy.numel()), ca.vertcat(*values), np.zeros(s.unknowns.numel()))

        return handed

    bound = Bound(stated(side * switch.argument), lower=0.0)
    return Problem(
        stated(smooth), problem.start, problem.end, [bound], parameters=problem.parameters,
        maximise=problem.maximise, breakpoints=problem.breakpoints, name=problem.name,
    )  # fmt: skip


def _holds(problem: Problem, curve: Curve, solution: Solution, found: list[Crossing]) -> bool:
    """Whether bumps either way, where the curve rests, make the problem's own functional worse."""
    x, weights = composite_gauss(np.linspace(*problem.span, 4 * SAMPLES), GAUSS_POINTS)
    y, slope = curve(x, 0), curve(x, 1)
    extent = max(float(np.ptp(y)), float(np.abs(y).max()) * 1e-3)

    def value(departure: np.ndarray, rise: np.ndarray) -> float:
        return problem.sign * float(problem.integrand_values(x, y + departure, slope + rise) @ weights)

    own = problem.sign * solution.value
    for ride in found:
        if ride.until is None:
            continue
        width = ride.until - ride.x
        part = (x - ride.x) / width
        inside = (part > 0) & (part < 1)
        arch = np.where(inside, part * (1 - part), 0.0)
        rise = np.where(inside, (1 - 2 * part) / width, 0.0)
        for height in BUMPS:
            for way in (height * extent, -height * extent):
                if value(way * arch, way * rise) < own - 1e-12 * abs(own):
                    return False
    return True
