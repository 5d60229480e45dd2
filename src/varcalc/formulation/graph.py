"""Forms of graphs y(x): between fixed abscissae, and with ends that slide on curves."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.form import (
    Coordinates,
    Ends,
    Form,
    Start,
    Stated,
    conditions_of,
    end_conditions,
    extended,
    rewriter,
    straight,
    through,
)
from varcalc.formulation.numbers import AtPoints, Reported
from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Through
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import FEW_FUNCTIONS, Problem
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.tracing import Expression, trace


def graph_form(problem: Problem) -> Form:
    """Fixed abscissae: the user's own symbols serve as they are."""
    s, span = problem.symbols, problem.span
    integrand = problem.integrand if problem.sign > 0 else -problem.integrand
    few = problem.order == 1 and problem.n <= FEW_FUNCTIONS and not problem.unknowns
    start, end = fixed_values(problem)
    joint = end_conditions(problem, s, lambda k, y: (span[k], y))
    waypoints = tuple(
        sorted(((float(c.x), tuple(c.values.tolist())) for c in problem.of_type(Through)), key=lambda w: w[0])
    )
    line = through(span, straight(span, start[0], end[0]), waypoints)
    return Form(
        problem,
        Coordinates(Stated(s, integrand, integrand), span, numbers=GraphNumbers() if few else None),
        Ends(start, end, joint, problem.n if problem.start.periodic else 0),
        conditions_of(problem, lambda expression, _: expression, breaks(problem), waypoints),
        Start(line, problem.unknown_guesses, np.eye(problem.n)),
        # where ends are moved nothing else changes: the expressions are in the problem's own symbols
        cache=_graph_cache(problem, breaks(problem)) if joint is None else Cache(),
    )


@derived
def _graph_cache(problem: Problem, knots: tuple[float, ...]) -> Cache:
    """What is derived from the expressions of forms in the problem's own symbols, wherever its ends are.

    Parameters may move the ``knots`` of the mesh, with which much else is another.
    """
    return Cache()


def sliding_form(problem: Problem) -> Form:
    """Ends that slide on curves: s in [0, 1], the sliding abscissae among the unknowns."""
    symbols = extended(problem, problem.n, sum(problem.slides))
    x0, x1 = sliding_abscissae(problem, symbols)
    width, (a, b) = x1 - x0, problem.span
    slopes = [symbols.dy / width] + ([symbols.ddy / width**2] if problem.order == 2 else [])
    x = x0 + symbols.x * width
    rewrite = rewriter(problem, symbols, x, symbols.y, slopes, width)
    integrand = problem.sign * rewrite(problem.integrand, True)
    fixed = fixed_values(problem)
    line = straight(
        (0.0, 1.0),
        *(on_curve(e, problem) if e.slides else f[0] for e, f in zip((problem.start, problem.end), fixed, strict=True)),
    )
    return Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (x, symbols.y, width, symbols.dy)),
            pull=lambda curve: lambda s: curve(a + s * (b - a)),
            note="abscissa unknown",
        ),
        Ends(fixed[0], fixed[1], end_conditions(problem, symbols, lambda k, y: ((x0, x1)[k], y))),
        conditions_of(problem, rewrite),
        Start(line, np.array([*problem.unknown_guesses, *guessed_abscissae(problem)]), np.eye(problem.n)),
    )


def sliding_abscissae(problem: Problem, symbols: Symbols) -> tuple[Expression, Expression]:
    """The abscissae of both ends: the last of the unknowns where they slide."""
    first, last = problem.slides
    count = len(problem.unknowns)
    x0 = symbols.unknowns[count] if first else symbols.kind(problem.span[0])
    x1 = symbols.unknowns[count + first] if last else symbols.kind(problem.span[1])
    return x0, x1


def guessed_abscissae(problem: Problem) -> list[float]:
    """First guesses of the abscissae of the ends that slide."""
    return [x for x, slides in zip(problem.span, problem.slides, strict=True) if slides]


def on_curve(end: Any, problem: Problem) -> np.ndarray:
    """A point of phi(x, y) = 0 at the guessed abscissa, by Newton's method in y from several starts."""
    kind = problem.symbols.kind
    y = kind.sym("y", problem.n)
    phi = trace("phi", end.phi, problem.handed(kind(end.x), y), kind)
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


def fixed_values(problem: Problem) -> list[np.ndarray]:
    """Values and slopes fixed at the two ends, NaN where free; each of shape (order, n)."""
    return [np.array([e.values(problem.n), e.slopes(problem.n)][: problem.order]) for e in (problem.start, problem.end)]


class GraphNumbers:
    """A graph in the user's own variables."""

    def on(self, problem: Problem, s: np.ndarray) -> AtPoints:
        """The numbers at ``s`` (m,)."""
        return _GraphAtPoints(problem, s)


class _GraphAtPoints:
    transform: np.ndarray | None = None
    offset: np.ndarray | None = None

    def __init__(self, problem: Problem, s: np.ndarray) -> None:
        self.problem, self.s, self.n = problem, s, problem.n
        self.sign = problem.sign

    def derivatives(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """L as it is minimised, (m,), its gradient (m, 2n) and its Hessian (m, 2n, 2n) by y and y' at ``u`` (m, 2n)."""
        rows = self.problem.integrand_derivatives(self.s, u[:, : self.n].T, u[:, self.n :].T).rows
        rows, k = rows if self.sign > 0 else -rows, 1 + 2 * self.n
        return rows[:, 0], rows[:, 2 : 1 + k], rows[:, 1 + k :].reshape(-1, k, k)[:, 1:, 1:]

    def reported(self, u: np.ndarray) -> Reported:
        """What is integrated, and the curve, at ``u`` (m, 2n)."""
        y, dy = u[:, : self.n], u[:, self.n :]
        values = self.sign * self.problem.integrand_values(self.s, y.T, dy.T)
        return Reported(values, self.s, y, np.ones_like(self.s), dy)
