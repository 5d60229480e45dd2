"""Minima of convex kinks, where no broken curve was found: every kink as bounds of a function of its own.

Several functions that a kink ties, kinks beside bounds and levels, ends that slide: whatever a smooth problem may have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.epigraph import epigraph_form
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

GAUSS_POINTS = 24
"""Points an element at which a curve's functional is summed again."""
HELD = 1e-7
"""Difference, relative to what is summed, of a curve's functional and what was found of it, which the sum may make."""
ORDINATE_ROUND_OFF = 1e-14
"""Relative round-off of the ordinates of a curve that lies on a kink."""


def above_kinks(form: Form, method: Ritz, tol: float, curve: Sampled) -> Solution | None:
    """The minimum near a ``curve`` in the form's coordinates; None where a kink is not convex, or where none is found.

    The answer's curve is held against the problem's own functional.
    """
    lifted = epigraph_form(form, curve)
    if lifted is None:
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = replace(method, starts=1).solve(lifted, tol=tol, guess=lifted.start.curve)
    if not found.status.ok or found.curve is None or found.extremal is None:
        return None
    evaluate = found.curve if form.stated.is_lifted else found.extremal.evaluate
    own = resampled(lambda x, k: evaluate(x, k)[: form.problem.n], found.x, 2)
    solution = replace(found, method=method, curve=own, extremal=None)
    problem = form.problem
    return solution if isinstance(problem, Problem) and as_held(problem, solution) else None


def as_held(problem: Problem, solution: Solution) -> bool:
    """Whether a curve's functional, with its switches where the curve puts them, is what was found of its parts."""
    assert solution.curve is not None
    if problem.end_cost is not None:
        return True  # the parts are held against one another by their ends' cost as well
    x, weights = composite_gauss(solution.x, GAUSS_POINTS)
    y, dy = solution.curve(x, 0), solution.curve(x, 1)
    values, others = (problem.integrand_values(x, y * near, dy) for near in (1.0, 1.0 + ORDINATE_ROUND_OFF))
    value, size, round_off = (float(v @ weights) for v in (values, np.abs(values), np.abs(others - values)))
    return abs(value - solution.value) <= solution.error.value + HELD * size + round_off
