"""Lagrangians that are not convex in the slope: the least curve has corners, or there is none."""

from __future__ import annotations

import math
from typing import Any

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
