"""Problems that are convex in the arc length: of curves of one length the least in a height that each element bears."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.breaks import whole
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.convexity import shapes
from varcalc.symbolic.derived import derived
from varcalc.symbolic.separation import separates

SAME_SCALE = 1e-12
"""Relative difference of two scales that is round-off."""
IN_ARC_LENGTH = "in the curve by its arc length, which is given"
"""In what :func:`proved_in_arc_length` proves the functional convex."""


def proved_in_arc_length(problem: Functional, multipliers: Sequence[Any], y: np.ndarray) -> bool:
    """Whether an extremal with ordinates y (m,) is least of all curves that are as long, L = f(y) w, w² = 1 + k y'².

    By its length s a curve has the slopes x' and y' with x'² + k y'² = 1, and the functional is the integral of f(y).
    With no more than 1 the slopes are a convex set, so that where f is convex an extremal whose multiplier there,
    f - λ, is not negative is least (Troutman, "Variational Calculus and Optimal Control", ch. 3): a chain that hangs,
    and not the arch that it makes upside down.
    """
    plain = isinstance(problem, Problem) and problem.n == problem.order == 1 and problem.symbols.kind is ca.SX
    if not plain or any(problem.slides) or problem.start.periodic or problem.end_cost_expression is not None:
        return False
    if problem.symbols.unknowns.numel() or len(problem.constraints) != 1 or not multipliers:
        return False
    values = tuple(problem.parameters.values())
    if not isinstance(multipliers[0], float) or not _weighs_length(problem, problem.span, values):
        return False
    still, steep = (np.array([_told(problem, values, float(height), v) for height in y]).T for v in (0.0, 1.0))
    heaviest = int(np.argmax(np.abs(still[0])))
    with np.errstate(all="ignore"):
        first, other = ((steep[:, heaviest] / still[:, heaviest]) ** 2 - 1.0).tolist()
        tension = problem.sign * (still[0] - multipliers[0] * still[1])
    return abs(first - other) <= SAME_SCALE * other and bool((tension > 0.0).all())


def _told(problem: Functional, values: Sequence[float], y: float, v: float) -> list[float]:
    """L and what is levelled at the start of the interval."""
    return [float(part) for part in whole(problem)(problem.span[0], y, v, [], [*values], [])]


@derived
def _weighs_length(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> bool:
    """Whether L is f(y) w with a convex f, or a concave one for what is made greatest, and the one level that of w."""
    (traced,), s = problem.traced, problem.symbols
    low, high = traced.constraint.interval if isinstance(traced.constraint, Isoperimetric) else (0.0, 1.0)
    if low != high:
        return False
    level = ca.Function("level", s.all, [traced.expression])
    if ca.depends_on(traced.expression, s.y) or not separates(level, values) or not separates(whole(problem), values):
        return False
    (at_rest,), *_ = shapes(whole(problem), [[span], [None], [0.0], [], [*values], []])
    return at_rest.concave if problem.maximise else at_rest.convex
