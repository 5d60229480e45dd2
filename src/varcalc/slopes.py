"""Whether an extremal can be a minimum at all, judged by other slopes at its own points.

The two pointwise tests that cost next to nothing: the Lagrangian must depend
on the slope in a way that fixes a curve, and Weierstrass's excess
E(w) = L(w) - L(v) - (w - v) L_v(v) must not be negative, else curves close by
but with other slopes are lower (Gelfand and Fomin, "Calculus of Variations",
sect. 9 and 34).
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.problem import Problem
from varcalc.solution import Solution, Status, Verdict

TURNS = np.concatenate([-np.geomspace(1e-2, 1e2, 9), [0.0], np.geomspace(1e-2, 1e2, 9)])
"""Slopes tried, in units of the larger of 1 and the extremal's own."""
NOISE = 1e-9
"""Relative excess below zero that is round-off or the curve's own error."""
PLACES = 9
JUMP = 1e-3
"""Relative jump of the slope that is a corner, not the error of the curve."""


def vouched(solution: Solution, form: Form) -> Solution:
    """The solution, refused when other slopes at its points show that it is no strong minimum.

    Only scalar first-order graphs without side conditions are tested; the
    others are returned as they are.
    """
    problem = solution.problem
    simple = isinstance(problem, Problem) and problem.n == 1 and problem.order == 1 and not problem.constraints
    if not simple or form.energetic or solution.curve is None:
        return solution
    s = problem.symbols
    if "slopes" not in problem.built:
        slope = ca.gradient(problem.integrand, s.dy)
        problem.built["slopes"] = ca.Function("slopes", s.all, [problem.integrand, slope, ca.gradient(slope, s.dy)])
    low, high = (float(v) for v in (solution.x.min(), solution.x.max()))
    x = low + (high - low) * (np.arange(PLACES) + 0.5) / PLACES
    y, v = solution.curve(x, 0)[0], solution.curve(x, 1)[0]
    tried = v[:, None] + TURNS * np.maximum(1.0, np.abs(v))[:, None]
    count = len(TURNS)
    unknowns = np.array(list(solution.unknowns.values()))
    numbers = [np.repeat(p[:, None], PLACES * count, axis=1) for p in (problem.parameter_values, unknowns)]
    arguments = [
        np.repeat(x, count)[None],
        np.repeat(y, count)[None],
        tried.reshape(1, -1),
        np.zeros((0, PLACES * count)),
    ]
    values, slopes, curvature = (
        np.asarray(r).reshape(PLACES, count) for r in problem.built["slopes"](*arguments, *numbers)
    )
    if not curvature.any():
        return _refused(
            solution, Verdict.SINGULAR,
            "the Lagrangian is linear in the slope: nothing in it fixes a curve between these ends",
        )  # fmt: skip
    here = count // 2
    sign = -1.0 if problem.maximise else 1.0
    step = tried - v[:, None]
    excess = sign * (values - values[:, [here]] - step * slopes[:, [here]])
    size = np.abs(values) + np.abs(values[:, [here]]) + np.abs(step * slopes[:, [here]])
    worst = np.unravel_index(np.nanargmin(excess / np.where(size > 0, size, 1.0)), excess.shape)
    if excess[worst] < -NOISE * size[worst]:
        return _refused(
            solution, Verdict.WEAK_MINIMUM,
            f"a weak minimum only: at x = {x[worst[0]]:.4g} Weierstrass's excess is {excess[worst]:.3g} for the slope "
            f"{tried[worst]:.4g} instead of {v[worst[0]]:.4g}, so curves with corners come lower",
        )  # fmt: skip
    if (sign * curvature < 0).any() and (corner := _corner(solution)) is not None:
        return _refused(
            solution, Verdict.WEAK_MINIMUM,
            f"a weak minimum only: the Lagrangian is not convex in the slope, and the curve found has a corner at "
            f"x = {corner:.6g} where the mesh allows one; more corners may come lower still",
        )  # fmt: skip
    return solution


def _corner(solution: Solution) -> float | None:
    """An inner vertex, not one of the problem's own, at which the slope jumps."""
    assert solution.curve is not None
    inner = np.array([x for x in solution.x[1:-1] if x not in solution.problem.breakpoints])
    if not len(inner):
        return None
    step = 1e-9 * (solution.x[-1] - solution.x[0])
    left, right = (solution.curve(inner + side * step, 1)[0] for side in (-1, 1))
    jumps = np.abs(right - left) > JUMP * np.maximum(1.0, np.abs(left) + np.abs(right))
    return float(inner[np.argmax(jumps)]) if jumps.any() else None


def _refused(solution: Solution, verdict: Verdict, message: str) -> Solution:
    return replace(solution, status=Status.REFUSED, verdict=verdict, message=message)
