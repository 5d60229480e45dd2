"""Functionals of which it is proved that a curve attains the least value, whatever a search finds.

L is convex in the slope and grows faster than its size, and is bounded below: by Tonelli's theorem there is a least
curve (Buttazzo, Giaquinta and Hildebrandt, "One-dimensional Variational Problems", 1998, ch. 3).
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.problem.breaks import switches_of
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.intervals import Interval, enclosures


def proved_attained(problem: Functional) -> bool:
    """Whether a smooth graph problem of first order, under no condition, is proved to have a least curve.

    L is a positive definite square of the slopes, and more that depends on the place alone and is enclosed from below,
    wherever the curve goes; an end is given, and ends cost nothing. False says that there is no proof.
    """
    plain = isinstance(problem, Problem) and problem.order == 1 and not (problem.constraints or problem.unknowns)
    if not plain or problem.symbols.kind is not ca.SX or problem.end_cost is not None or any(problem.slides):
        return False
    if not (problem.start.fixed or problem.end.fixed) or problem.start.periodic or switches_of(problem):
        return False
    s, L = problem.symbols, problem.sign * problem.integrand
    square, slope = ca.hessian(L, s.dy)
    if ca.depends_on(square, ca.vertcat(s.x, s.y, s.dy)):
        return False
    at_rest = ca.substitute([L, slope], [s.dy], [ca.SX.zeros(s.dy.shape)])
    if ca.depends_on(at_rest[1], ca.vertcat(s.x, s.y)):
        return False
    known = ca.Function("square", [s.parameters], [ca.densify(square), ca.densify(at_rest[1])])
    curvature, linear = (np.asarray(v) for v in known(problem.parameter_values))
    if not (np.linalg.eigvalsh(curvature) > 0).all() or linear.any():
        return False
    first, last = problem.span
    boxes: list[list[Interval]] = [[(np.array(first), np.array(last))]]
    boxes.append([(np.array(-np.inf), np.array(np.inf))] * problem.n)
    boxes.append([(np.array(v), np.array(v)) for v in problem.parameter_values])
    (enclosed,) = enclosures(ca.Function("at_rest", [s.x, s.y, s.parameters], [ca.densify(at_rest[0])]), boxes)
    return math.isfinite(float(enclosed[0][0]))
