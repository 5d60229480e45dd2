"""The quadrature route: an ignorable ordinate or abscissa gives a first integral, and the curve by quadrature."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import Deferred
from varcalc.methods.first_integral.answers import EndValues, NotFound, Reduced, Unsuitable
from varcalc.methods.first_integral.autonomous import Autonomous
from varcalc.methods.first_integral.cyclic import Cyclic
from varcalc.methods.first_integral.integrands import ReducedIntegrands, Stopwatch
from varcalc.methods.first_integral.reduction import Reduction
from varcalc.methods.first_integral.shore import Shore, landed
from varcalc.methods.moved_ends import by_what_moves
from varcalc.problem.conditions import Isoperimetric, components
from varcalc.problem.functional import Functional
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Problem
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, defined, no_answer
from varcalc.spelling import spelled

ACCEPTABLE = 1e-6
"""Relative error of the value up to which an answer short of the tolerance still counts as one."""


@spelled
@dataclass(frozen=True)
class FirstIntegral:
    """Quadrature of a first integral, for one unknown function with y or x ignorable.

    Where y does not occur in L the momentum L_y' = c is constant and the slope
    follows at every x; where x does not occur Euler's second equation
    L - y' L_y' = C holds, the slope follows at every y, and x is the integral
    of dy / y' (Gelfand and Fomin, "Calculus of Variations", sect. 4). Every
    extremal with at most one turning point is looked for; the one with the
    best value is returned. Isoperimetric levels are met by a multiplier.
    Values come to double precision whatever the tolerance.
    """

    def solve(self, form: Form, *, tol: float, guess: Any) -> Solution:  # noqa: ARG002
        """The best extremal found for the problem of ``form``, in its own coordinates; ``guess`` is not needed.

        ``tol`` bounds the error of the value relative to max(1, abs(value)).
        Never raises for a failure of the method: the Solution says why.
        """
        problem = form.problem
        began, building = time.perf_counter(), Stopwatch()
        try:
            checked = suitable(problem)
            best = _best(checked, building)
        except Unsuitable as reason:
            return no_answer(problem, self, Status.REFUSED, str(reason))
        except NotFound as reason:
            stats = _stats(began, building)
            return no_answer(problem, self, Status.NOT_CONVERGED, str(reason), stats=stats)
        return _solution(checked, self, best, tol, _stats(began, building))


def _stats(began: float, building: Stopwatch) -> Stats:
    return Stats(build=building.seconds, solve=time.perf_counter() - began - building.seconds)


def suitable(problem: Functional) -> Problem:
    """The problem itself when a first integral may answer it; Unsuitable, with the reason, otherwise."""
    if not isinstance(problem, Problem):
        raise Unsuitable("FirstIntegral wants a graph y(x), not a Curve; use Ritz or Collocation")
    if problem.n != 1 or problem.order != 1:
        raise Unsuitable("FirstIntegral wants one unknown function and a Lagrangian of first order; use Collocation")
    if problem.symbols.kind is not ca.SX:
        raise Unsuitable("FirstIntegral wants a Lagrangian that is a formula, not interpolated data; use Collocation")
    if problem.unknowns or problem.end_cost is not None:
        raise Unsuitable("FirstIntegral does not optimise unknowns or end costs with the curve; use Ritz")
    for i, c in enumerate(problem.constraints):
        if not (isinstance(c, Isoperimetric) and c.equality):
            raise Unsuitable(
                f"FirstIntegral takes isoperimetric equalities only, not constraints[{i}] = {c!r}; use Ritz"
            )
    if problem.start.periodic:
        raise Unsuitable("FirstIntegral wants two ends, and the curve is periodic; use Ritz or Collocation")
    if any(problem.slides) and not (problem.start.fixed or problem.end.fixed):
        raise Unsuitable("FirstIntegral wants one end fixed where the other slides on a curve; use Ritz or Collocation")
    return problem


def _ends(problem: Problem) -> EndValues:
    known = [float(e.values(1)[0]) for e in (problem.start, problem.end)]
    y = [None if math.isnan(value) else value for value in known]
    if y == [None, None]:
        raise Unsuitable("both ends are free, so FirstIntegral has no point to start from; use Ritz or Collocation")
    return EndValues(problem.span[0], y[0], problem.span[1], y[1])


def reduction_of(problem: Problem, ends: EndValues, building: Stopwatch) -> Reduction:
    """The reduction the Lagrangian and the isoperimetric integrands allow, by structure."""
    with building:
        parts = [Lagrangian(problem.symbols, e) for e in (problem.integrand, *(t.expression for t in problem.traced))]
        integrands = ReducedIntegrands(problem, ends.mean_slope, building)
        without_y, without_x = all(p.ignorable for p in parts), all(p.ignorable_abscissa for p in parts)
    if without_y and not (without_x and steep(ends)):
        return Cyclic(integrands)
    if without_x:
        return Autonomous(integrands)
    raise Unsuitable("both x and y occur in the Lagrangian, so it has no first integral to integrate; use Collocation")


def steep(ends: EndValues) -> bool:
    """True when x(y) keeps more digits than y(x), which decides where both variables are ignorable."""
    return ends.y0 is not None and ends.y1 is not None and ends.mean_slope > 1 and ends.y0 != ends.y1


def _best(problem: Problem, building: Stopwatch) -> Reduced:
    if any(problem.slides):
        return _best_sliding(problem, building)
    return _best_between_given(problem, _ends(problem), building)


def _best_between_given(problem: Problem, ends: EndValues, building: Stopwatch) -> Reduced:
    if ends.width <= 0:
        raise NotFound("the curve an end slides on does not lie on the far side of the other end")
    reduction = reduction_of(problem, ends, building)
    best = best_between(reduction, ends)
    if best is None:
        raise _not_found(reduction)
    return best


def _not_found(reduction: Reduction) -> NotFound:
    level = " at the level demanded" if reduction.integrands.problem.traced else ""
    return NotFound(
        f"the quadrature found {reduction.searched} that joins the ends{level}; Ritz and Collocation look for others"
    )


def _best_sliding(problem: Problem, building: Stopwatch) -> Reduced:
    """One end slides on a curve: the extremal to each point of it, and the point where transversality holds."""
    at_end = problem.end.slides
    fixed = problem.start if at_end else problem.end
    (y,) = components("y", fixed.y)
    assert y is not None
    vertical = Shore.abscissa(problem, problem.end if at_end else problem.start)
    if vertical is not None:
        x0 = float(fixed.x)
        straight = EndValues(x0, y, vertical, None) if at_end else EndValues(vertical, None, x0, y)
        return _best_between_given(problem, straight, building)
    shore = Shore.of(problem, problem.end if at_end else problem.start, np.array([fixed.x, y]))

    def ends(point: np.ndarray) -> EndValues:
        x1, y1 = map(float, point)
        return EndValues(float(fixed.x), y, x1, y1) if at_end else EndValues(x1, y1, float(fixed.x), y)

    first = ends(shore.points[0])
    reduction = reduction_of(problem, first, building)

    def best(point: np.ndarray) -> Reduced | None:
        return best_between(reduction, ends(point)) if ends(point).width > 0 else None

    def gradient(found: Reduced, point: np.ndarray) -> np.ndarray:
        return np.array(reduction.end_gradient(found, ends(point), at_end))

    found = landed(shore, best, gradient, first.width, problem.sign)
    if found is None:
        raise _not_found(reduction)
    return found


def best_between(reduction: Reduction, ends: EndValues) -> Reduced | None:
    """The extremal of best value between two ends; None when there is none of the kind looked for."""
    sense = reduction.integrands.problem.sign
    rough = sorted(((sense * reduction.value(j, ends), k, j) for k, j in enumerate(reduction.all_curves(ends))))
    level = reduction.level(ends)
    for value, _, candidate in rough:
        if level is not None and sense * level.value <= value:
            break
        answer = reduction.answer(candidate, ends)
        if answer is not None:
            return answer
    return level


def _solution(problem: Problem, method: FirstIntegral, best: Reduced, tol: float, stats: Stats) -> Solution:
    allowed = tol * max(1.0, abs(best.value))
    status = Status.SOLVED if best.value_error <= allowed else Status.ROUND_OFF
    message = ""
    if not best.value_error <= max(allowed, ACCEPTABLE * max(1.0, abs(best.value))) or not math.isfinite(best.value):
        status = Status.NOT_CONVERGED
        message = f"the quadrature left an error of {best.value_error:.1e}; use Ritz or Collocation"
    elif best.doubt:
        status, message = Status.NOT_CONVERGED, f"{best.doubt}; use Ritz or Collocation"
    levels = tuple(-float(m) for m in best.multipliers)
    found = Solution(
        problem=problem,
        method=method,
        status=status,
        value=best.value,
        error=ErrorEstimate(best.value_error, best.curve_error),
        x=best.nodes,
        curve=best.curve,
        multipliers=levels,
        sensitivities=Deferred(
            tuple(problem.parameters),
            lambda: best.partials + by_what_moves(problem, best.curve, levels, problem.unknown_guesses),
        ),
        stats=replace(stats, unknowns=1 + len(best.multipliers), elements=best.points),
        message=message,
    )
    return defined(found, best.curve(best.nodes, 0))
