"""The form in which a problem is solved: coordinates, gauge, ends and side conditions.

Methods never look at a :class:`Problem` directly. They are given a
:class:`Form`: an integrand on a fixed interval of a reference variable s, a
number of unknown functions and of unknown numbers, and conditions on them. An
abscissa that slides, a curve that is no graph, a maximum, a singular end are
all turned into that one shape here (and in :mod:`varcalc.singular`), so that no
method knows of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.conditions import (
    At,
    Bound,
    Fixed,
    Holonomic,
    Isoperimetric,
    OnCurve,
    OnSurface,
    Periodic,
    Through,
    components,
)
from varcalc.problem import Curve, Functional, Problem, Symbols
from varcalc.tracing import Expression, trace

Sampled = Callable[[np.ndarray], np.ndarray]
"""A curve to start from: abscissae (m,) to ordinates (n, m)."""


@dataclass(frozen=True)
class SideCondition:
    """``lower <= expression <= upper``, integrated (isoperimetric) or at every point (pathwise)."""

    expression: Expression
    lower: float
    upper: float
    index: int
    """Position of the constraint in ``problem.constraints``."""

    @property
    def equality(self) -> bool:
        """True when both bounds coincide."""
        return self.lower == self.upper


@dataclass(frozen=True)
class EndConditions:
    """Cost of the ends and equations between them, in symbols of their own.

    ``equations`` (a column, zero on admissible curves) and ``cost`` (a scalar)
    are expressions in ``start`` and ``end``, the unknown functions at the two
    ends, and in the parameters and unknowns of the form.
    """

    start: Expression
    end: Expression
    equations: Expression
    cost: Expression


@dataclass(frozen=True)
class Form:
    """A functional on a fixed interval, ready for any method.

    ``integrand`` is minimised; ``functional`` is what is reported, times
    ``sign``. ``fixed_start[k, a]`` is the value of the k-th derivative of
    function a at the start, NaN where it is free. ``knots`` are abscissae that
    must be vertices of every mesh, where slopes may jump; ``waypoints`` pairs of a knot
    and the values demanded there. ``baseline`` is the first curve to try and
    ``bumps`` the directions in which to bend it. ``lift`` takes (s, y, dy, u, p) to the person's
    abscissa, ordinates and their derivatives by s; None when they are the same.
    """

    problem: Functional
    symbols: Symbols
    integrand: Expression
    functional: Expression
    sign: float
    span: tuple[float, float]
    integrals: tuple[SideCondition, ...]
    pathwise: tuple[SideCondition, ...]
    fixed_start: np.ndarray
    fixed_end: np.ndarray
    ends: EndConditions | None
    periodic: bool
    knots: tuple[float, ...]
    waypoints: tuple[tuple[float, tuple[float | None, ...]], ...]
    unknown_guess: np.ndarray
    baseline: Sampled
    bumps: np.ndarray
    pull: Callable[[Sampled], Sampled]
    lift: ca.Function | None = None
    note: str = ""
    energetic: bool = False
    """True when the integral of the square of the functional's integrand is what is minimised."""
    least_degree: int = 1
    """Degree of a polynomial below which the extremal is known not to be resolved."""
    singular: tuple[bool, bool] = (False, False)
    """Ends where abscissa and ordinate were given powers, so that their derivatives by s vanish."""
    weak_only: bool = False
    """True when regularity alone decides at a singular end: no boundary condition exists for an indirect method."""
    gauged: bool = False
    """True when the last unknown number is the constant speed of a Curve."""
    built: dict[Any, Any] = field(default_factory=dict, repr=False)
    """What methods derive from the expressions; shared by copies for other parameter values."""

    @property
    def n(self) -> int:
        """Number of unknown functions of the form."""
        return int(self.symbols.y.numel())

    @property
    def order(self) -> int:
        """Highest derivative in the integrand."""
        return self.problem.order

    @property
    def same_functional(self) -> bool:
        """True when what is minimised is what is reported."""
        return self.functional is self.integrand

    @property
    def has_inequalities(self) -> bool:
        """True when an interior-point method is called for."""
        return bool(self.pathwise) or any(not c.equality for c in self.integrals)


def formulate(problem: Functional) -> Form:
    """The direct form of a problem, without regard to singular ends."""
    if isinstance(problem, Curve):
        return _curve_form(problem)
    if not isinstance(problem, Problem):
        raise TypeError(f"problem must be a Problem or a Curve, not {problem!r}")
    if isinstance(problem.start, OnCurve) or isinstance(problem.end, OnCurve):
        return _sliding_form(problem)
    return _graph_form(problem)


def side_conditions(problem: Functional, rewrite: Callable[[Expression, bool], Expression]) -> dict[str, Any]:
    """The isoperimetric and pathwise conditions of a problem, each expression passed through ``rewrite``.

    ``rewrite(expression, integrated)`` states it in the form's own coordinates.
    """
    integrals, pathwise = [], []
    numbers = {id(c): i for i, c in enumerate(problem.constraints)}
    for t in problem.traced:
        index = numbers[id(t.constraint)]
        if isinstance(t.constraint, Isoperimetric):
            lower, upper = t.constraint.interval
            integrals.append(SideCondition(rewrite(t.expression, True), lower, upper, index))
        elif isinstance(t.constraint, Bound):
            lower, upper = t.constraint.interval
            pathwise.append(SideCondition(rewrite(t.expression, False), lower, upper, index))
        elif isinstance(t.constraint, Holonomic):
            pathwise.append(SideCondition(rewrite(t.expression, False), 0.0, 0.0, index))
    return {"integrals": tuple(integrals), "pathwise": tuple(pathwise)}


def fixed_values(problem: Problem, end: Any) -> np.ndarray:
    """Values and slopes fixed at an end, NaN where free; shape (order, n)."""
    fixed = np.full((problem.order, problem.n), np.nan)
    if isinstance(end, Fixed):
        fixed[0] = [np.nan if v is None else v for v in components("y", end.y)]
        if end.dy is not None:
            fixed[1] = [np.nan if v is None else v for v in components("dy", end.dy)]
    return fixed


def straight(span: tuple[float, float], start: np.ndarray, end: np.ndarray) -> Sampled:
    """The straight line between two points, components that are NaN at one end kept constant (0 at both)."""
    first = np.where(np.isnan(start), end, start)
    last = np.where(np.isnan(end), start, end)
    first, last = np.nan_to_num(first), np.nan_to_num(last)

    def line(s: np.ndarray) -> np.ndarray:
        along = (s - span[0]) / (span[1] - span[0])
        return first[:, None] * (1 - along) + last[:, None] * along

    return line


def through(span: tuple[float, float], line: Sampled, waypoints: tuple[Any, ...]) -> Sampled:
    """The broken line from end to end through the waypoints."""
    if not waypoints:
        return line
    marks = np.array([span[0], *(w[0] for w in waypoints), span[1]])
    values = line(marks)
    for k, (_, demanded) in enumerate(waypoints, start=1):
        values[:, k] = [v if d is None else d for v, d in zip(values[:, k], demanded, strict=True)]
    return lambda s: np.array([np.interp(s, marks, row) for row in values])


def _end_conditions(
    problem: Functional, symbols: Symbols, y0: Expression, y1: Expression, x0: Any, x1: Any, equations: list[Expression]
) -> EndConditions | None:
    kind = symbols.kind
    cost = kind(0)
    if problem.end_cost_expression is not None:
        given, expression = problem.end_cost_expression
        ends = [x0, y0, x1, y1] if isinstance(problem, Problem) else [y0, y1]
        sign = -1.0 if problem.maximise else 1.0
        old = [*given, problem.symbols.unknowns, problem.symbols.parameters]
        count = len(problem.unknowns)
        new = [*(kind(e) for e in ends), symbols.unknowns[:count, :], symbols.parameters]
        cost = sign * ca.substitute([expression], old, new)[0]
    elif not equations:
        return None
    return EndConditions(y0, y1, ca.vertcat(*equations) if equations else kind(0, 1), cost)


def _waypoints(problem: Functional) -> tuple[tuple[float, tuple[float | None, ...]], ...]:
    return tuple(sorted(((float(c.x), components("y", c.y)) for c in problem.of_type(Through)), key=lambda w: w[0]))


def _graph_form(problem: Problem) -> Form:
    """Fixed abscissae: the person's own symbols serve as they are."""
    s = problem.symbols
    sign = -1.0 if problem.maximise else 1.0
    integrand = problem.integrand if sign > 0 else -problem.integrand
    start, end = fixed_values(problem, problem.start), fixed_values(problem, problem.end)
    ends = None
    if problem.end_cost is not None:
        y0, y1 = s.kind.sym("y0", problem.n), s.kind.sym("y1", problem.n)
        ends = _end_conditions(problem, s, y0, y1, *problem.span, [])
    waypoints = _waypoints(problem)
    return Form(
        problem=problem,
        symbols=s,
        integrand=integrand,
        functional=integrand,
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
    )


def extended(problem: Functional, n: int, extra: int) -> Symbols:
    """Fresh symbols for ``n`` functions, the problem's parameters, its unknowns and ``extra`` more numbers."""
    s = problem.symbols
    count = len(problem.unknowns) + extra
    fresh = Symbols.make(s.kind, n, problem.order, 0, count)
    return replace(fresh, parameters=s.parameters)


def rewriter(
    problem: Functional, symbols: Symbols, x: Expression, y: Expression, slopes: list[Expression], speed: Expression
) -> Callable[[Expression, bool], Expression]:
    """A function that states an expression of the problem in other coordinates.

    ``x, y, slopes`` are the problem's variables in terms of ``symbols``;
    integrated expressions are multiplied by ``speed`` = dx/ds.
    """
    old = problem.symbols
    count = len(problem.unknowns)
    before = [old.x, old.y, old.dy, old.ddy, old.unknowns]
    acceleration = slopes[1] if len(slopes) > 1 else old.kind(0, 1)
    after = [x, y, slopes[0], acceleration, symbols.unknowns[:count, :]]

    def rewrite(expression: Expression, integrated: bool) -> Expression:
        stated = ca.substitute([expression], before, after)[0]
        return stated * speed if integrated else stated

    return rewrite


def _sliding_form(problem: Problem) -> Form:
    """Ends that slide on curves: s in [0, 1], the sliding abscissae among the unknowns."""
    sliding = [isinstance(e, OnCurve) for e in (problem.start, problem.end)]
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
    start, end = fixed_values(problem, problem.start), fixed_values(problem, problem.end)
    guesses = [
        on_curve(e, problem) if isinstance(e, OnCurve) else f[0]
        for e, f in ((problem.start, start), (problem.end, end))
    ]
    guess = np.array([*problem.unknown_guesses, *(v for v, sl in zip(problem.span, sliding, strict=True) if sl)])
    lift = ca.Function(
        "lift",
        [symbols.x, symbols.y, symbols.dy, symbols.unknowns, symbols.parameters],
        [ca.densify(x), symbols.y, ca.densify(width), symbols.dy],
    )
    a, b = problem.span
    return Form(
        problem=problem,
        symbols=symbols,
        integrand=integrand,
        functional=integrand,
        sign=sign,
        span=(0.0, 1.0),
        **side_conditions(problem, rewrite),
        fixed_start=start,
        fixed_end=end,
        ends=_end_conditions(problem, symbols, y0, y1, x0, x1, equations),
        periodic=False,
        knots=(),
        waypoints=(),
        unknown_guess=guess,
        baseline=straight((0.0, 1.0), *guesses),
        bumps=np.eye(problem.n),
        pull=lambda curve: lambda s: curve(a + s * (b - a)),
        lift=lift,
        note="abscissa unknown",
    )


def on_curve(end: OnCurve, problem: Problem) -> np.ndarray:
    """A point of phi(x, y) = 0 at the guessed abscissa, by Newton's method in y from several starts."""
    y = ca.SX.sym("y", problem.n)
    phi = trace("phi", end.phi, [ca.SX(end.x), y[0] if problem.scalar else y], ca.SX)
    function = ca.Function("phi", [y], [phi, ca.gradient(phi, y)])
    for start in (0.0, 1.0, -1.0, 10.0, -10.0):
        point = np.full(problem.n, start)
        for _ in range(30):
            value, gradient = (np.asarray(v).ravel() for v in function(point))
            square = float(gradient @ gradient)
            if not (math.isfinite(square) and square > 0.0):
                break
            point = point - value[0] * gradient / square
            if abs(value[0]) <= 1e-10 * max(1.0, float(np.abs(point).max())):
                return point
    return np.full(problem.n, np.nan)


def _curve_form(problem: Curve) -> Form:
    """A curve in space: its energy when that does, the functional with a gauge otherwise."""
    sign = -1.0 if problem.maximise else 1.0
    closed = isinstance(problem.start, Periodic)
    energetic = not closed and problem.end_cost is None and _positive(problem, sign)
    energetic = energetic and not any(isinstance(c, Isoperimetric) for c in problem.constraints)
    symbols = problem.symbols if energetic else extended(problem, problem.n, 1)
    rewrite = rewriter(problem, symbols, symbols.x, symbols.y, symbols.slopes, symbols.kind(1))
    functional = sign * (problem.integrand if energetic else rewrite(problem.integrand, True))
    y0, y1 = symbols.kind.sym("q0", problem.n), symbols.kind.sym("q1", problem.n)
    equations = [
        trace(f"{label}.phi", e.phi, [q], symbols.kind)
        for label, e, q in (("start", problem.start, y0), ("end", problem.end, y1))
        if isinstance(e, OnSurface)
    ]
    points = [_curve_end(e, problem.n) for e in (problem.start, problem.end)]
    start, end = (_curve_fixed(e, problem.n) for e in (problem.start, problem.end))
    baseline = _ring(problem.n) if closed else straight((0.0, 1.0), *points)
    length = float(np.linalg.norm(np.nan_to_num(points[1] - points[0]))) or 1.0
    return Form(
        problem=problem,
        symbols=symbols,
        integrand=functional**2 if energetic else functional + _gauge(symbols),
        functional=functional,
        sign=sign,
        span=(0.0, 1.0),
        **side_conditions(problem, rewrite),
        fixed_start=start,
        fixed_end=end,
        ends=_end_conditions(problem, symbols, y0, y1, None, None, equations),
        periodic=closed,
        knots=(),
        waypoints=(),
        unknown_guess=np.array([*problem.unknown_guesses, *([] if energetic else [2 * math.pi if closed else length])]),
        baseline=baseline,
        bumps=np.eye(problem.n),
        pull=lambda curve: curve,
        note="energy" if energetic else "gauge of constant speed",
        energetic=energetic,
        gauged=not energetic,
    )


def _gauge(symbols: Symbols) -> Expression:
    """A term that vanishes for constant speed, the speed being the last unknown.

    F is homogeneous of degree one, so dq . (Euler-Lagrange expression of F) is
    identically zero and this term alone decides the parametrisation: its
    extremals have |dq|^2 = l^2, where it is zero, and F is left as it is.
    """
    square, speed = ca.sumsqr(symbols.dy), symbols.unknowns[-1]
    return (square / speed - speed) ** 2 / (4 * speed)


def _positive(problem: Curve, sign: float) -> bool:
    """True when sign * F > 0 in every direction tried along the line between the ends."""
    s = problem.symbols
    function = ca.Function("F", [s.y, s.dy, s.parameters, s.unknowns], [problem.integrand])
    ends = [_curve_end(e, problem.n) for e in (problem.start, problem.end)]
    line = straight((0.0, 1.0), *ends)(np.linspace(0.03, 0.97, 5))
    chord = np.nan_to_num(ends[1] - ends[0])
    directions = [*np.eye(problem.n), *-np.eye(problem.n), chord, -chord]
    values = [
        sign * float(function(q, d, problem.parameter_values, problem.unknown_guesses))
        for q in line.T
        for d in directions
        if np.any(d)
    ]
    numbers = [v for v in values if math.isfinite(v)]
    return bool(numbers) and min(numbers) > 0.0


def _curve_end(end: Any, n: int) -> np.ndarray:
    if isinstance(end, At):
        return np.array([np.nan if v is None else v for v in components("q", end.q)])
    return np.array(end.guess, dtype=float) if isinstance(end, OnSurface) else np.full(n, np.nan)


def _curve_fixed(end: Any, n: int) -> np.ndarray:
    return (_curve_end(end, n) if isinstance(end, At) else np.full(n, np.nan))[None, :]


def _ring(n: int) -> Sampled:
    """The unit circle in the first two coordinates, counter-clockwise."""

    def circle(s: np.ndarray) -> np.ndarray:
        out = np.zeros((n, len(s)))
        out[0], out[1 % n] = np.cos(2 * math.pi * s), np.sin(2 * math.pi * s)
        return out

    return circle
