"""Minima that keep one level, by its multiplier from outside: the level's share is taken from L, and then it is let go.

The least curve of L less the multiplier times what is integrated is the least one on the level that it has (weak
duality: Luenberger, "Optimization by Vector Space Methods", ch. 8). That level grows with the multiplier, which is
a root therefore.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from varcalc.existence.least_paths import jumps
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution
from varcalc.symbolic.evaluation import PointEvaluator

TIMES_FURTHER, FURTHER = 14, 2.0
"""Times that multipliers go further until they have the level between them, and by what factor."""
MULTIPLIER_KNOWN, LEVEL_KEPT = 1e-14, 1e-9
"""How nearly the multiplier is looked for, and the level kept, in units of themselves and of the first step."""
MOST_LOOKS = 16
"""Multipliers at most that are tried where the best curve jumps."""
PIECES_SUMMED, POINTS_SUMMED = 64, 12
"""Pieces, and Gauss points on each, by which it is summed what level a curve has."""


def level_of(problem: Problem) -> float | None:
    """The one level that a problem of one function prescribes; None where it asks for more, or for less."""
    if problem.n > 1 or problem.order > 1 or problem.symbols.kind is not ca.SX or problem.unknowns:
        return None
    alone = problem.constraints[0] if len(problem.constraints) == 1 else None
    return alone.interval[0] if isinstance(alone, Isoperimetric) and alone.equality else None


def level_let_go(problem: Problem, multiplier: float) -> Problem:
    """The problem without its one level, whose share at a ``multiplier`` is taken from L."""
    s, names = problem.symbols, list(problem.parameters)
    summed = problem.integrand - multiplier * problem.traced[0].expression

    def reduced(x: Any, y: Any, dy: Any, *p: Any) -> Any:
        numbers = ca.vertcat(*(getattr(p[0], name) for name in names)) if names else ca.SX(0, 1)
        return ca.substitute(summed, ca.vertcat(s.x, s.y, s.dy, s.parameters), ca.vertcat(x, y, dy, numbers))

    def with_numbers(x: Any, y: Any, dy: Any, p: Any) -> Any:
        return reduced(x, y, dy, p)

    def without_numbers(x: Any, y: Any, dy: Any) -> Any:
        return reduced(x, y, dy)

    return Problem(
        with_numbers if names else without_numbers, problem.start, problem.end, parameters=problem.parameters,
        end_cost=problem.end_cost, maximise=problem.maximise, breakpoints=problem.breakpoints, name=problem.name,
    )  # fmt: skip


def least_on_level(
    problem: Problem, least: Callable[[Problem], Solution | Finding | None]
) -> Solution | Finding | None:
    """The least curve on the one level of a problem, by the ``least`` ones without it; None where none is found.

    Where the best curve jumps, and L is convex, it is told to.
    """
    level, sign = level_of(problem), problem.sign
    if level is None:
        return None
    found = dict[float, Solution | Finding | None]()

    def off(multiplier: float) -> float:
        known = found[multiplier] = least(level_let_go(problem, multiplier))
        return sign * (_summed(problem, known) - level) if isinstance(known, Solution) else math.nan

    begun = off(0.0)
    at_first = found[0.0]
    if at_first is None:
        return None
    size = at_first.value if isinstance(at_first, Solution) else at_first.numbers["limit"]
    step = (abs(size) or 1.0) / (max(abs(level), np.nan_to_num(abs(begun))) or 1.0)
    between = _about_root(off, begun, step) if math.isfinite(begun) else None
    if between is None:
        jumping = any(isinstance(known, Finding) for known in found.values())
        return _jumping(problem, level, step, least) if jumping and proved_jointly_convex(problem) else None
    try:
        multiplier = brentq(off, *between, xtol=MULTIPLIER_KNOWN * step, rtol=4 * np.finfo(float).eps)
    except ValueError:  # there is no curve in between
        return None
    missed = off(multiplier)
    known = found[multiplier]
    if not (isinstance(known, Solution) and abs(missed) <= LEVEL_KEPT * max(abs(level), abs(begun))):
        return None
    error = replace(known.error, value=known.error.value + abs(multiplier * missed))
    value = known.value + multiplier * level
    return replace(known, problem=problem, value=value, error=error, multipliers=(multiplier,))


def _jumping(
    problem: Problem, level: float, step: float, least: Callable[[Problem], Solution | Finding | None]
) -> Finding | None:
    """That the best curve on a level jumps, as it does at the best multiplier; None where it does not.

    What L less its share of the level comes to, and that share, are greatest together there.
    """

    def less(multiplier: float) -> float:
        """What the dual comes to at a multiplier, the other way round; infinite where it is not known."""
        known = least(level_let_go(problem, multiplier))
        if known is None:
            return math.inf
        value = known.value if isinstance(known, Solution) else known.numbers["limit"]
        return -problem.sign * (value + multiplier * level)

    best = minimize_scalar(less, (0.0, step), method="brent", options={"maxiter": MOST_LOOKS})
    known = least(level_let_go(problem, float(best.x)))
    if not isinstance(known, Finding):
        return None
    return jumps(problem, known.numbers["x"], known.numbers["height"], -problem.sign * float(best.fun))


def _about_root(off: Callable[[float], float], begun: float, step: float) -> tuple[float, float] | None:
    """Multipliers between which what is missed of a level, which grows with them, vanishes; None for none."""
    last, way = 0.0, -math.copysign(step, begun)
    for _ in range(TIMES_FURTHER):
        there = off(last + way)
        if not math.isfinite(there):
            way *= 0.5
        elif there * begun <= 0.0:
            return last, last + way
        else:
            last, way = last + way, FURTHER * way
    return None


def _summed(problem: Problem, solution: Solution) -> float:
    """What the level of a problem is along the curve of a solution."""
    s, curve = problem.symbols, solution.curve
    assert curve is not None
    density = PointEvaluator(
        ca.Function("density", [s.x, s.y, s.dy, s.parameters], [ca.densify(problem.traced[0].expression)])
    )
    mesh = np.union1d(np.linspace(*problem.span, PIECES_SUMMED + 1), solution.x)
    x, weights = composite_gauss(mesh, POINTS_SUMMED)
    columns = [x[:, None], curve(x, 0).T, curve(x, 1).T, problem.parameter_values[None]]
    return float(density(len(x), *columns)[:, 0] @ weights)
