"""What the ends of a curve cost, and the momenta that this asks of free ends."""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator

EndPoints = tuple[np.ndarray, np.ndarray]
"""Abscissae (m,) and ordinates (n, m) of ends."""


@derived
def end_cost(problem: Functional) -> ca.Function | None:
    """The cost of the ends as a function of (x0, y0, x1, y1, parameters, unknowns); None where they cost nothing."""
    if problem.end_cost_expression is None:
        return None
    (ends, cost), s = problem.end_cost_expression, problem.symbols
    if len(ends) == 2:  # what a Curve's ends cost is a matter of their points alone
        ends = [s.kind.sym("t0"), ends[0], s.kind.sym("t1"), ends[1]]
    return ca.Function("end_cost", [*ends, s.parameters, s.unknowns], [cost])


@derived
def _at_points(problem: Functional) -> PointEvaluator | None:
    function = end_cost(problem)
    return None if function is None else PointEvaluator(function)


def costs_of_ends(problem: Functional, start: EndPoints, end: EndPoints, unknowns: np.ndarray) -> np.ndarray:
    """What ends cost, as it is minimised, (m,), with ``unknowns`` (m, k). What is given once serves for all."""
    places = [part for x, y in (start, end) for part in (x[:, None], y.T)]
    count, cost = max(len(given) for given in (*places, unknowns)), _at_points(problem)
    if cost is None:
        return np.zeros(count)
    return problem.sign * cost(count, *places, problem.parameter_values[None], unknowns)[:, 0]


def cost_along(problem: Functional, curve: CurveOrSlope, span: tuple[float, float], unknowns: np.ndarray) -> float:
    """What the ends of a curve over an interval cost, as it is minimised."""
    start, end = ((x, curve(x, 0)) for x in (np.array([v]) for v in span))
    return float(costs_of_ends(problem, start, end, unknowns[None])[0])


def natural_momenta(problem: Problem, curve: CurveOrSlope) -> tuple[float | None, float | None]:
    """The momentum of one function at each end that is free, by what its ordinate costs; None where that is given."""
    rates = [0.0, 0.0]
    if problem.end_cost_expression is not None:
        (ends, cost), s = problem.end_cost_expression, problem.symbols
        gradient = ca.densify(ca.gradient(cost, ca.vertcat(*ends[1::2])))
        function = ca.Function("rates", [*ends, s.parameters, s.unknowns], [gradient])
        places = [v for x in problem.span for v in (x, curve(np.array([x]), 0)[0])]
        found = np.asarray(function(*places, problem.parameter_values, problem.unknown_guesses)).ravel()
        rates = (problem.sign * found).tolist()
    return None if problem.start.fixed else rates[0], None if problem.end.fixed else -rates[1]
