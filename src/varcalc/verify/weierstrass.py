"""Weierstrass's condition: no other slope at a point of the curve may come lower.

The excess E(w) = L(w) - L(v) - (w - v) L_v(v) must not be negative, else curves
close by but with other slopes are lower (Gelfand and Fomin, "Calculus of
Variations", sect. 34).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Bound, Holonomic
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Finding, Solution, Verdict
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.verify.along_curve import AlongCurve, complement
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.slopes import ROUND_OFF_EXCESS, SlopeFan, places
from varcalc.verify.verification import Excess, excesses, slope_turns

VERIFIED_PLACES = 33
"""Points of a curve at which slopes are tried for a verification."""
PLANE_DIRECTIONS = 72
SPACE_DIRECTIONS = 256
PRIMES = np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0])
"""Their square roots spread directions evenly (Weyl)."""


@dataclass(frozen=True)
class WeierstrassCondition(Check[Excess]):
    """Whether the excess is negative nowhere, for no slope tried."""

    name = "Weierstrass"

    def measure(self, candidate: Candidate) -> Excess:
        """The least excess along the solution's curve."""
        return least_excess(candidate.along, candidate.solution)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """Whether the condition holds for every slope tried."""
        measured = candidate.measured(self)
        if math.isnan(measured):
            sentence = "Weierstrass's condition was not tested: pathwise conditions and bounds restrict the slope"
            yield Finding(None, sentence)
            return
        numbers = {"excess": float(measured), "at": measured.at}
        if measured < -ROUND_OFF_EXCESS:
            slope, own = (np.array2string(v, precision=5) for v in (measured.slope, measured.own))
            sentence = (
                f"Weierstrass's condition fails: at {measured.at:.6g} the excess is {float(measured):.3g} of its terms "
                f"for the slope {slope} instead of {own}, so curves with corners do better"
            )
            yield Finding(Verdict.WEAK_MINIMUM, sentence, numbers)
        else:
            yield Finding(None, "Weierstrass's condition holds for every slope tried", numbers)


def least_excess(along: AlongCurve, solution: Solution) -> Excess:
    """The least excess along a solution's curve, relative to its terms; ``along`` is in the user's coordinates.

    Slopes are tried one component at a time and, for several functions, in
    directions between them; for a Curve all directions are; at second order
    second derivatives are tried in place of slopes. Slopes that a bound
    forbids, or that pathwise conditions do, are left out.
    """
    problem = solution.problem
    if isinstance(problem, Problem) and problem.order == 1 and any(problem.of_type(Bound)):
        if any(problem.of_type(Holonomic)):
            return Excess(float("nan"), float("nan"), np.zeros(0), np.zeros(0))
        fan = SlopeFan(solution, places(solution))
        relative, worst = fan.least()
        own = fan.v[:, worst.place]
        slope = own.copy()
        slope[worst.component] = worst.slope
        return Excess(relative, float(fan.x[worst.place]), slope, own)
    return _excess(along, _directed if isinstance(problem, Curve) else _turned)


def _excess(along: AlongCurve, tries: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Excess:
    """The least relative excess over the slopes that ``tries(own (m, n), allowed (m, n, k))`` gives, (m, T, n)."""
    s = along.span[0] + along.length * (np.arange(VERIFIED_PLACES) + 0.5) / VERIFIED_PLACES
    top, order, n = along.symbols.slopes[-1], along.order, along.n
    H = along.whole.expression
    arguments = along.arguments(s)
    own = arguments[1 + order].T
    tried = tries(own, complement(along.forbidden_slopes(s)))
    count = tried.shape[1]
    inputs = [*along.symbols.all, *along.multiplier_symbols]
    value = PointEvaluator(ca.Function("H", inputs, [H]))
    gradient = ca.Function("slope", inputs, [ca.densify(ca.gradient(H, top))])
    with np.errstate(all="ignore"):
        slope = np.asarray(gradient.call(arguments)[0])
        repeated = [np.repeat(v.T, count, axis=0) for v in arguments]
        repeated[1 + order] = tried.reshape(-1, n)
        other = value(len(s) * count, *repeated).reshape(len(s), count)
        here = value(len(s), *(v.T for v in arguments))
        relative = excesses(here, np.einsum("ka,kta->kt", slope.T, tried - own[:, None]), other)[1]
    k, j = (int(i) for i in np.unravel_index(np.argmin(relative), relative.shape))
    return Excess(float(relative[k, j]), float(s[k]), tried[k, j], own[k])


def _directions(k: int) -> np.ndarray:
    """Unit vectors (T, k) in every direction of k dimensions: the axes, and a low-discrepancy spread between them."""
    if k == 0:
        return np.zeros((0, 0))
    if k == 1:
        return np.array([[1.0], [-1.0]])
    if k == 2:
        angles = 2 * np.pi * np.arange(PLANE_DIRECTIONS) / PLANE_DIRECTIONS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    from scipy.special import ndtri

    steps = np.modf(np.outer(np.arange(1, SPACE_DIRECTIONS + 1), np.sqrt(PRIMES[:k])))[0]
    spread = ndtri(steps)
    return np.concatenate([np.eye(k), -np.eye(k), spread / np.linalg.norm(spread, axis=1, keepdims=True)])


def _turned(own: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """The curve's own slope changed in every direction by steps of many sizes."""
    turns = slope_turns(own)
    steps = turns[turns > 0][:, None, None] * _directions(allowed.shape[2])
    unit = np.maximum(1.0, np.abs(own).max(1))[:, None, None]
    return own[:, None] + unit * np.einsum("mak,tk->mta", allowed, steps.reshape(-1, steps.shape[2]))


def _directed(own: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Every direction at the curve's own speed: F is homogeneous, so lengths do not matter."""
    speed = np.linalg.norm(own, axis=1)[:, None, None]
    return speed * np.einsum("mak,tk->mta", allowed, _directions(allowed.shape[2]))
