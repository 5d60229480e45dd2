"""Whether a curve is stationary, and of which index: told without any of the library's own checks.

For one unknown function and fixed ends. Derivatives of L are CasADi's, all else is here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import varcalc as vc
from campaigns.routes import functional, rule
from campaigns.truth import FLOOR, MARGIN, Answer, Outcome, Truth, refused

STATIONARY = 1e-3
"""Relative residual of du Bois-Reymond's equation, in the mean square, that a curve may leave."""
ENDS = 1e-6
"""Relative distance by which a curve may miss its ends."""
END = 1e-4
"""Part of the interval before its end in which a conjugate point is not held against a minimum."""
PANELS, POINTS = 200, 6


def derivatives(problem: vc.Problem) -> ca.Function:
    """(x, y, v) to (L_v, L_y, L_vv, L_yv, L_yy)."""
    s = problem.symbols
    L, y, v = problem.integrand, s.y, s.dy
    first, second = [ca.gradient(L, v), ca.gradient(L, y)], ca.hessian(L, ca.vertcat(y, v))[0]
    return ca.Function("d", [s.x, y, v], [*map(ca.densify, first), second[1, 1], second[0, 1], second[0, 0]])


def residual(problem: vc.Problem, y: Callable[..., Any], dy: Callable[..., Any]) -> float:
    """How far L_v - integral of L_y is from a constant, relative to its terms, in the mean square."""
    x, weights = rule(problem.span, PANELS, POINTS)
    out: Any = derivatives(problem)(x[None], np.asarray(y(x))[None], np.asarray(dy(x))[None])
    momentum, force = (np.asarray(v)[0] for v in out[:2])
    # the integral up to the middle of each panel, where momentum and force are taken at their means
    w = weights.reshape(PANELS, POINTS)
    share = w.sum(1)
    means = [(w * v.reshape(PANELS, POINTS)).sum(1) for v in (momentum, force)]
    impulse = np.cumsum(means[1]) - means[1] / 2
    rest = means[0] / share - impulse
    mean = share @ rest / share.sum()
    size = np.sqrt(share @ (np.square(means[0] / share) + np.square(impulse)) / share.sum())
    return float(np.sqrt(share @ np.square(rest - mean) / share.sum()) / max(size, 1e-300))


def index(problem: vc.Problem, y: Callable[..., Any], dy: Callable[..., Any]) -> int:
    """Conjugate points strictly inside: zeros of the Jacobi field that leaves the start."""
    d = derivatives(problem)
    x0, x1 = problem.span

    def field(x: float, state: np.ndarray) -> list[float]:
        _, _, P, R, Q = (float(v) for v in d(x, float(y(x)), float(dy(x))))
        h, p = state  # p = P h' + R h
        slope = (p - R * h) / P
        return [slope, R * slope + Q * h]

    crossing: Any = lambda x, state: state[0]  # noqa: E731
    found = solve_ivp(field, (x0, x1), [0.0, 1.0], method="DOP853", rtol=1e-8, atol=1e-12, events=crossing)
    width = x1 - x0
    return sum(x0 + END * width < x < x1 - END * width for x in found.t_events[0])


def witnessed(
    answer: Answer, solution: vc.Solution, truth: Truth, minimises: bool, coercive: bool
) -> tuple[Outcome, float]:
    """The outcome where not every extremal is known beforehand, and the residual of the curve."""
    if not answer.ok:
        return refused(answer, truth.has_minimum or (coercive or not minimises), truth.verdicts), float("nan")
    problem = solution.problem
    assert isinstance(problem, vc.Problem)
    left = residual(problem, solution.y, solution.dy)
    known: Any = (problem.start.y, problem.end.y)
    size = float(np.abs(solution.y(np.linspace(*problem.span, 101))).max())
    missed = max(abs(solution.y(x) - v) for x, v in zip(problem.span, known, strict=True)) / max(size, 1e-300)
    value = functional(problem, solution.y, solution.dy)
    off = abs(value - answer.value) > max(MARGIN * answer.claim, FLOOR * max(1.0, abs(value)))
    if off or not left <= STATIONARY or not missed <= ENDS:
        return Outcome.FALSE, left
    minimum = index(problem, solution.y, solution.dy) == 0
    if minimises and not minimum:
        return Outcome.FALSE, left
    return Outcome.RIGHT if minimum or not coercive else Outcome.OTHER, left
