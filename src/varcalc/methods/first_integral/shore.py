"""An end that slides on a curve phi(x, y) = 0: the point of it where the extremal lands transversally."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.answers import Reduced, Unsuitable
from varcalc.numerics.roots import EPSILON
from varcalc.problem.conditions import OnCurve
from varcalc.problem.problem import Problem
from varcalc.symbolic.evaluation import Columns, PointEvaluator
from varcalc.symbolic.tracing import trace

HEIGHTS = np.array([0.5, -0.5, 1.0, -1.0, 0.1, -0.1, 0.0, 4.0, -4.0])
"""Ordinates from which the curve is looked for, relative to the fixed end's, in units of the width."""
PROJECTIONS = 40
FIRST_STEP = 0.05
"""First step along the curve, relative to the width of the problem."""
STEPS_ALONG_SHORE = 30
GROWTH = 1.6


@dataclass(frozen=True)
class Shore:
    """The curve phi = 0 and ``points`` of it to start from."""

    phi: Columns
    points: tuple[np.ndarray, ...]

    @staticmethod
    def abscissa(problem: Problem, end: OnCurve) -> float | None:
        """Where the curve is when it is a vertical line, phi not depending on y: there the end is simply free."""
        x, y = ca.SX.sym("x"), ca.SX.sym("y")
        expression = trace("phi", end.phi, [x, y if problem.scalar else ca.vertcat(y)], ca.SX)
        if ca.depends_on(expression, y):
            return None
        phi = PointEvaluator(ca.Function("phi", [x, y], [expression, ca.gradient(expression, x), ca.SX(0)])).columns
        found = _projected(phi, np.array([end.x, 0.0]), keep_abscissa=False)
        return None if found is None else float(found[0])

    @classmethod
    def of(cls, problem: Problem, end: OnCurve, fixed: np.ndarray) -> Shore:
        """The curve of a sliding end, and points near its guess; Unsuitable when none is found."""
        x, y = ca.SX.sym("x"), ca.SX.sym("y")
        expression = trace("phi", end.phi, [x, y if problem.scalar else ca.vertcat(y)], ca.SX)
        results = [expression, ca.gradient(expression, x), ca.gradient(expression, y)]
        phi = PointEvaluator(ca.Function("phi", [x, y], [ca.densify(r) for r in results])).columns
        width = abs(end.x - fixed[0]) or 1.0
        points: list[np.ndarray] = []
        # the guessed abscissa is kept if the curve passes there, as it does unless it is vertical
        for keep in (True, False):
            for height in fixed[1] + width * HEIGHTS:
                found = _projected(phi, np.array([end.x, height]), keep_abscissa=keep)
                if found is not None and not any(np.allclose(found, p) for p in points):
                    points.append(found)
        if not points:
            raise Unsuitable(f"no point of the curve an end slides on was found near x = {end.x}; check OnCurve")
        return cls(phi, tuple(points))

    def projected(self, point: np.ndarray) -> np.ndarray | None:
        """The point of the curve nearest to a point beside it, to first order."""
        return _projected(self.phi, point, keep_abscissa=False)

    def tangent(self, point: np.ndarray) -> np.ndarray:
        """The unit tangent of the curve at one of its points."""
        _, by_x, by_y = map(float, self.phi(*point))
        return np.array([-by_y, by_x]) / np.hypot(by_x, by_y)


def _projected(phi: Columns, point: np.ndarray, *, keep_abscissa: bool) -> np.ndarray | None:
    """Newton's method on phi along its gradient, or along y alone."""
    at = point.astype(float)
    for _ in range(PROJECTIONS):
        value, by_x, by_y = map(float, phi(*at))
        gradient = np.array([0.0 if keep_abscissa else by_x, by_y])
        square = float(gradient @ gradient)
        if not (np.isfinite(value) and np.isfinite(square) and square > 0):
            return None
        step = value * gradient / square
        at = at - step
        if np.abs(step).max() <= 4 * EPSILON * max(1e-300, np.abs(at).max()):
            return at
    return None


def landed(
    shore: Shore,
    best: Callable[[np.ndarray], Reduced | None],
    gradient: Callable[[Reduced, np.ndarray], np.ndarray],
    size: float,
    sense: float,
) -> Reduced | None:
    """The extremal to the point of the curve where the value is stationary: downhill from the first point, then a root.

    ``sense`` is -1 where the value is to be greatest. None when there is no extremal on the way or no such point.
    """

    def slope(point: np.ndarray, along: np.ndarray) -> float:
        """The derivative of the value along the curve, in the sense of ``along``; NaN where no extremal goes there."""
        found = best(point)
        if found is None:
            return float("nan")
        tangent = shore.tangent(point)
        return float(gradient(found, point) @ tangent) * (1.0 if tangent @ along >= 0 else -1.0)

    for here in shore.points:
        way = shore.tangent(here)
        value = slope(here, way)
        if np.isfinite(value):
            break
    else:
        return None
    if sense * value > 0:
        way, value = -way, -value
    step = FIRST_STEP * size
    for _ in range(STEPS_ALONG_SHORE):
        there = shore.projected(here + step * way)
        if there is None:
            return None
        following = slope(there, there - here)
        if np.isfinite(following) and following * value <= 0:
            return _between(shore, best, slope, here, there)
        if np.isfinite(following):
            way = (there - here) / np.linalg.norm(there - here)
            here, value, step = there, following, GROWTH * step
        else:
            step /= 4
    return None


def _between(
    shore: Shore,
    best: Callable[[np.ndarray], Reduced | None],
    slope: Callable[[np.ndarray, np.ndarray], float],
    low: np.ndarray,
    high: np.ndarray,
) -> Reduced | None:
    from scipy.optimize import brentq

    chord = high - low

    def at(share: float) -> np.ndarray:
        point = shore.projected(low + share * chord)
        return point if point is not None else np.full(2, np.nan)

    try:
        share = brentq(lambda u: slope(at(u), chord), 0.0, 1.0, xtol=2 * EPSILON, rtol=4 * EPSILON)
    except ValueError:  # between the two there are points without an extremal
        return None
    return best(at(share))
