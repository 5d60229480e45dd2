"""Forms of graphs y(x): between fixed abscissae, and with ends that slide on curves."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.form import (
    Form,
    Stated,
    end_conditions,
    extended,
    rewriter,
    side_conditions,
    straight,
    through,
)
from varcalc.formulation.numbers import AtPoints, Reported
from varcalc.problem.conditions import Fixed, OnCurve, Periodic, Through, components
from varcalc.problem.functional import Functional
from varcalc.problem.problem import FEW_FUNCTIONS, Problem
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.tracing import trace


def graph_form(problem: Problem) -> Form:
    """Fixed abscissae: the person's own symbols serve as they are."""
    s = problem.symbols
    sign = -1.0 if problem.maximise else 1.0
    integrand = problem.integrand if sign > 0 else -problem.integrand
    start, end = _fixed_values(problem, problem.start), _fixed_values(problem, problem.end)
    ends = None
    if problem.end_cost is not None:
        y0, y1 = s.kind.sym("y0", problem.n), s.kind.sym("y1", problem.n)
        ends = end_conditions(problem, s, y0, y1, *problem.span, [])
    waypoints = _waypoints(problem)
    return Form(
        problem=problem,
        stated=Stated(s, integrand, integrand),
        sign=sign,
        span=problem.span,
        **side_conditions(problem, lambda expression, _: expression),
        fixed_start=start,
        fixed_end=end,
        ends=ends,
        periodic=isinstance(problem.start, Periodic),
        knots=tuple(sorted({*problem.breakpoints, *(w[0] for w in waypoints)})),
        waypoints=waypoints,
        unknown_guess=problem.unknown_guesses,
        baseline=through(problem.span, straight(problem.span, start[0], end[0]), waypoints),
        bumps=np.eye(problem.n),
        pull=lambda curve: curve,
        # where ends are moved nothing else changes: the expressions are in the problem's own symbols
        cache=_graph_cache(problem) if ends is None else Cache(),
        numbers=GraphNumbers() if problem.order == 1 and problem.n <= FEW_FUNCTIONS and not problem.unknowns else None,
    )


@derived
def _graph_cache(problem: Problem) -> Cache:
    """What is derived from the expressions of forms in the problem's own symbols, wherever its ends are."""
    return Cache()


def sliding_form(problem: Problem) -> Form:
    """Ends that slide on curves: s in [0, 1], the sliding abscissae among the unknowns."""
    sliding = problem.slides
    symbols = extended(problem, problem.n, sum(sliding))
    count = len(problem.unknowns)
    kind = symbols.kind
    x0 = symbols.unknowns[count] if sliding[0] else kind(problem.span[0])
    x1 = symbols.unknowns[count + sliding[0]] if sliding[1] else kind(problem.span[1])
    width = x1 - x0
    slopes = [symbols.dy / width] + ([symbols.ddy / width**2] if problem.order == 2 else [])
    x = x0 + symbols.x * width
    rewrite = rewriter(problem, symbols, x, symbols.y, slopes, width)
    y0, y1 = kind.sym("y0", problem.n), kind.sym("y1", problem.n)
    equations = [
        trace(f"{label}.phi", e.phi, [at, y[0] if problem.scalar else y], kind)
        for label, e, at, y in (("start", problem.start, x0, y0), ("end", problem.end, x1, y1))
        if isinstance(e, OnCurve)
    ]
    sign = -1.0 if problem.maximise else 1.0
    integrand = sign * rewrite(problem.integrand, True)
    start, end = _fixed_values(problem, problem.start), _fixed_values(problem, problem.end)
    guesses = [
        on_curve(e, problem) if isinstance(e, OnCurve) else f[0]
        for e, f in ((problem.start, start), (problem.end, end))
    ]
    guess = np.array([*problem.unknown_guesses, *(v for v, sl in zip(problem.span, sliding, strict=True) if sl)])
    a, b = problem.span
    return Form(
        problem=problem,
        stated=Stated(symbols, integrand, integrand, (x, symbols.y, width, symbols.dy)),
        sign=sign,
        span=(0.0, 1.0),
        **side_conditions(problem, rewrite),
        fixed_start=start,
        fixed_end=end,
        ends=end_conditions(problem, symbols, y0, y1, x0, x1, equations),
        periodic=False,
        knots=(),
        waypoints=(),
        unknown_guess=guess,
        baseline=straight((0.0, 1.0), *guesses),
        bumps=np.eye(problem.n),
        pull=lambda curve: lambda s: curve(a + s * (b - a)),
        note="abscissa unknown",
    )


def on_curve(end: OnCurve, problem: Problem) -> np.ndarray:
    """A point of phi(x, y) = 0 at the guessed abscissa, by Newton's method in y from several starts."""
    kind = problem.symbols.kind
    y = kind.sym("y", problem.n)
    phi = trace("phi", end.phi, [kind(end.x), y[0] if problem.scalar else y], kind)
    function = ca.Function("phi", [y], [phi, ca.gradient(phi, y)])
    unit = problem.span[1] - problem.span[0]
    for start in (0.0, 1.0, -1.0, 10.0, -10.0):
        point = np.full(problem.n, start * unit)
        for _ in range(30):
            value, gradient = (np.asarray(v).ravel() for v in function(point))
            square = float(gradient @ gradient)
            if not (math.isfinite(square) and square > 0.0):
                break
            point = point - value[0] * gradient / square
            if abs(value[0]) <= 1e-10 * math.sqrt(square) * max(unit, float(np.abs(point).max())):
                return point
    return np.full(problem.n, np.nan)


def _fixed_values(problem: Problem, end: Any) -> np.ndarray:
    """Values and slopes fixed at an end, NaN where free; shape (order, n)."""
    fixed = np.full((problem.order, problem.n), np.nan)
    if isinstance(end, Fixed):
        fixed[0] = [np.nan if v is None else v for v in components("y", end.y)]
        if end.dy is not None:
            fixed[1] = [np.nan if v is None else v for v in components("dy", end.dy)]
    return fixed


def _waypoints(problem: Functional) -> tuple[tuple[float, tuple[float | None, ...]], ...]:
    return tuple(sorted(((float(c.x), components("y", c.y)) for c in problem.of_type(Through)), key=lambda w: w[0]))


class GraphNumbers:
    """A graph in the person's own variables."""

    def on(self, problem: Problem, s: np.ndarray) -> AtPoints:  # noqa: D102
        return _GraphAtPoints(problem, s)


class _GraphAtPoints:
    transform: np.ndarray | None = None
    offset: np.ndarray | None = None

    def __init__(self, problem: Problem, s: np.ndarray) -> None:
        self.problem, self.s, self.n = problem, s, problem.n
        self.sign = -1.0 if problem.maximise else 1.0

    def derivatives(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rows = self.problem.integrand_derivatives(self.s, u[:, : self.n].T, u[:, self.n :].T).rows
        rows, k = rows if self.sign > 0 else -rows, 1 + 2 * self.n
        return rows[:, 0], rows[:, 2 : 1 + k], rows[:, 1 + k :].reshape(-1, k, k)[:, 1:, 1:]

    def reported(self, u: np.ndarray) -> Reported:
        y, dy = u[:, : self.n], u[:, self.n :]
        values = self.sign * self.problem.integrand_values(self.s, y.T, dy.T)
        return Reported(values, self.s, y, np.ones_like(self.s), dy)
