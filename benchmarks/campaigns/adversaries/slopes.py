"""Lagrangians that are not convex in the slope: the least curve has corners, or there is none."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from campaigns.adversaries.momentum import dual, pieces
from campaigns.least import Least
from campaigns.statement import Integrand, Statement
from varcalc.solution import Verdict

OF_SMOOTH_CURVES = frozenset({Verdict.SADDLE, Verdict.WEAK_MINIMUM})
"""What may be said, truthfully, of an extremal without corners; the least curve has them."""


def _steeper(s: np.ndarray) -> np.ndarray:
    """The v >= 1 with 4 v (v^2 - 1) = s >= 0, by Newton's iteration from above."""
    v = 1 + np.cbrt(s / 4) + s / 8
    for _ in range(60):
        v = v - (4 * v * (v**2 - 1) - s) / (12 * v**2 - 4)
    return v


def _quartic(s: np.ndarray) -> np.ndarray:
    v = _steeper(np.abs(s))
    return np.abs(s) * v - (v**2 - 1) ** 2


def _quartic_slope(s: np.ndarray) -> np.ndarray:
    return np.sign(s) * _steeper(np.abs(s))


def loaded_corners(random: np.random.Generator) -> Statement:
    """(v^2 - 1)^2 - c y, or (|v| - 1)^2 - c y: one corner, where the momentum c (x - x*) changes its sign.

    The least value is that of the convex hull, which has the same conjugate: s v - (v^2 - 1)^2 at the steeper slope, or
    s^2/4 + |s|; the hull's curve takes no slope between -1 and 1 but at one point.
    """
    T, c = random.uniform(0.5, 3), random.uniform(0.3, 3) * random.choice([-1, 1])
    rise = random.uniform(-1.5, 1.5) * T
    phi: Any = lambda v: (v**2 - 1) ** 2  # noqa: E731
    conjugate, slope = _quartic, _quartic_slope
    if random.uniform() < 0.4:
        phi = lambda v: (ca.fabs(v) - 1) ** 2  # noqa: E731
        conjugate = lambda s: s**2 / 4 + np.abs(s)  # noqa: E731
        slope = lambda s: s / 2 + np.sign(s)  # noqa: E731
    steepest = 4 * (abs(rise / T) + 2) ** 3 + abs(c) * T
    # a few panels of the rule leave the jump of (phi*)' unresolved: the constant is off by a panel, its square counts
    x, weights = pieces(0.0, T, [], 2000)
    value = dual(conjugate, slope, rise, x, weights, c * x, steepest) - c * T * rise
    L: Integrand = lambda x, y, v: phi(v) - c * y  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, rise), Least(value, within=1e-8, verdicts=OF_SMOOTH_CURVES))


class _Parabola(NamedTuple):
    """a (v - m)^2 / 2 + k on a sector of the slope."""

    low: float
    high: float
    a: float
    m: float
    k: float

    def __call__(self, v: Any) -> Any:
        return self.a * (v - self.m) ** 2 / 2 + self.k

    def best(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The slope of the sector at which s v less this is greatest, and that; (m,) each."""
        v = np.clip(self.m + s / self.a, self.low, self.high)
        return v, s * v - self(v)


def _sectors(random: np.random.Generator, count: int) -> list[_Parabola]:
    """Parabolas on sectors whose edges are a fifth apart or more; half of them are the first one, higher or lower."""
    edges = [-math.inf, *np.cumsum(random.uniform(0.2, 1.2, count - 1)) - random.uniform(0, 2), math.inf]
    a, m = random.uniform(0.5, 2), random.uniform(-0.5, 0.5)
    found = []
    for low, high in pairwise(edges):
        other = random.uniform() < 0.5
        own = (random.uniform(0.5, 3), random.uniform(-1, 1)) if other else (a, m)
        found.append(_Parabola(low, high, *own, random.uniform(-0.5, 1)))
    return found


def sectors(random: np.random.Generator) -> Statement:
    """Parabolas in the slope that jump between sectors, less c y: curves keep slopes of jumps, with corners between.

    At a jump L has the lower of its values, which the least curve may need. The conjugate is the greatest of those of
    the sectors; at a jump of its slope the least curve has a corner.
    """
    T, c = random.uniform(0.5, 2), random.uniform(0.3, 3) * random.choice([-1, 1])
    rise = random.uniform(-1.5, 1.5) * T
    sectors = _sectors(random, int(random.integers(2, 5)))

    def best(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        slopes, values = np.array([sector.best(s) for sector in sectors]).transpose(1, 0, 2)
        first = np.argmax(values, axis=0)[None]
        return np.take_along_axis(slopes, first, 0)[0], np.take_along_axis(values, first, 0)[0]

    def L(x: Any, y: Any, v: Any) -> Any:
        branch = sectors[0](v)
        for before, after in pairwise(sectors):
            at_edge = before(after.low) <= after(after.low)
            branch = ca.if_else(v <= after.low if at_edge else v < after.low, branch, after(v))
        return branch - c * y

    x, weights = pieces(0.0, T, [], 2000)
    reach = 40.0 + abs(c) * T
    value = dual(lambda s: best(s)[1], lambda s: best(s)[0], rise, x, weights, c * x, reach) - c * T * rise
    return Statement(L, (0.0, 0.0), (T, rise), Least(value, within=1e-8, verdicts=OF_SMOOTH_CURVES))


def zigzags(random: np.random.Generator) -> Statement:
    """(v^2 - 1)^2 alone: 0 by slopes of 1 and -1 where the chord is less steep, else by the chord."""
    T = random.uniform(0.5, 3)
    steep = random.uniform(-1.6, 1.6)
    value = max(0.0, steep**2 - 1) ** 2 * T
    L: Integrand = lambda x, y, v: (v**2 - 1) ** 2  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, steep * T), Least(value, verdicts=OF_SMOOTH_CURVES))


def bolza(random: np.random.Generator) -> Statement:
    """(v^2 - 1)^2 + k y^2 with both ends at 0: ever finer zigzags come down to 0, no curve does (Bolza's example).

    A tent on whose sides v^2 > 1/3 is a weak minimum: L is convex there, and to move its corner is no
    weak variation.
    """
    T, k = random.uniform(0.5, 3), math.exp(random.uniform(-2, 2))
    truths = frozenset({Verdict.NOT_ATTAINED, Verdict.SADDLE, Verdict.WEAK_MINIMUM})
    least = Least(0.0, attained=False, verdicts=truths)
    L: Integrand = lambda x, y, v: (v**2 - 1) ** 2 + k * y**2  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, 0.0), least)
