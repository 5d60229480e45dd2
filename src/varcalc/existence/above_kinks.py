"""Minima of convex kinks, where no broken curve was found: every kink as bounds of a function of its own.

Several functions that a kink ties, kinks beside bounds and levels, ends that slide: whatever a smooth problem may have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.epigraph import epigraph_form
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.end_cost import cost_along
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

GAUSS_POINTS, POINTS_A_DEGREE = 24, 2
"""Points an element at which a curve's functional is summed again: so many, and so many of each of its degrees."""
ITERATIONS = 120
"""Iterations of IPOPT for one mesh."""
HELD = 1e-7
"""Difference, relative to what is summed, of a curve's functional and what was found of it, which the sum may make."""
ORDINATE_ROUND_OFF = 1e-14
"""Relative round-off of the ordinates of a curve that lies on a kink."""
JUMP_BY_ROUND_OFF = 1e-3
"""Change of L by it, in units of the largest L along the curve, that is a jump."""


def above_kinks(form: Form, method: Ritz, tol: float, curve: Sampled) -> Solution | None:
    """The minimum near a ``curve`` in the form's coordinates; None where a kink is not convex, or where none is found.

    The answer's curve is held against the problem's own functional.
    """
    lifted = epigraph_form(form, curve)
    if lifted is None:
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        # a program that takes long has no minimum to end at
        way = replace(method, starts=1, optimiser=Ipopt(iterations=ITERATIONS))
        found = way.solve(lifted, tol=tol, guess=lifted.start.curve)
    if not found.status.ok or found.curve is None or found.extremal is None:
        return None
    evaluate = found.curve if form.stated.is_lifted else found.extremal.evaluate
    problem = form.problem
    own = resampled(lambda x, k: evaluate(x, k)[: problem.n], found.x, 1 + problem.order)
    solution = replace(found, method=method, curve=own, extremal=None)
    return solution if isinstance(problem, Problem) and as_held(problem, solution) else None


def as_held(problem: Problem, solution: Solution) -> bool:
    """Whether a curve's functional, with its switches where the curve puts them, is what was found of its parts."""
    assert solution.curve is not None
    x, weights = composite_gauss(solution.x, max(GAUSS_POINTS, POINTS_A_DEGREE * solution.stats.degree))
    y, dy = solution.curve(x, 0), solution.curve(x, 1)
    ddy = solution.curve(x, 2) if problem.order == 2 else None
    unknowns = np.tile([solution.unknowns.get(name, np.nan) for name in problem.unknowns], (len(x), 1))
    values, others = (
        problem.integrand_values(x, y * near, dy, unknowns=unknowns, ddy=ddy)
        for near in (1.0, 1.0 + ORDINATE_ROUND_OFF)
    )
    felt = np.abs(others - values)
    # where round-off puts a curve on either side of a jump it runs along that, on which L is either
    felt[felt > JUMP_BY_ROUND_OFF * np.abs(values).max()] = 0.0
    value, size, round_off = (float(v @ weights) for v in (values, np.abs(values), felt))
    cost = problem.sign * cost_along(problem, solution.curve, solution.interval, solution.unknown_values)
    return abs(value + cost - solution.value) <= solution.error.value + HELD * (size + abs(cost)) + round_off
