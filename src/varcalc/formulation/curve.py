"""Forms of curves in space: the energy of a length, or a gauge that keeps the speed constant."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from varcalc.conditions import At, Isoperimetric, OnSurface, Periodic, components
from varcalc.formulation.form import (
    Form,
    Sampled,
    end_conditions,
    extended,
    rewriter,
    side_conditions,
    straight,
)
from varcalc.functional import Symbols
from varcalc.problem import Curve
from varcalc.tracing import Expression, trace


def curve_form(problem: Curve) -> Form:
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
        ends=end_conditions(problem, symbols, y0, y1, None, None, equations),
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
