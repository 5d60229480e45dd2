"""Strings over narrow obstacles, v^2 and y >= psi(x): straight to the obstacle, along it, straight on.

With both ends above the obstacle the least curve is the lowest concave one over it (Kinderlehrer and Stampacchia, "An
Introduction to Variational Inequalities and Their Applications" (1980), chap. II).
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

import varcalc as vc
from campaigns.adversaries.momentum import about, pieces
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

SLOPES: Integrand = lambda x, y, v: v**2  # noqa: E731


def _over(
    obstacle: Any, value: float, y0: float, y1: float, points: tuple[float, ...]
) -> Statement:  # fmt: skip
    bound = vc.Bound(lambda x, y, v: y - obstacle(x), lower=0)
    return Statement(SLOPES, (0.0, y0), (1.0, y1), Least(value, sole=True), (bound,), points)


def bumps(random: np.random.Generator) -> Statement:
    """Over h exp(-((x - c)/w)^2) - 1, w from 1e-3 to 0.1: tangents from both ends to its cap, where it is concave."""
    w, c = 10 ** random.uniform(-3, -1), random.uniform(0.25, 0.75)
    y0, y1 = random.uniform(0, 0.4, 2)
    h = 1.5 + random.uniform(0, 1)

    def psi(x: Any) -> Any:
        return h * np.exp(-(((x - c) / w) ** 2)) - 1

    def slope(x: Any) -> Any:
        return -2 * (x - c) / w**2 * (psi(x) + 1)

    cap = w / math.sqrt(2)
    left = brentq(lambda t: psi(t) - slope(t) * t - y0, c - cap, c, xtol=1e-16)
    right = brentq(lambda t: psi(t) + slope(t) * (1 - t) - y1, c, c + cap, xtol=1e-16)
    x, weights = pieces(left, right, [], 8)
    value = (psi(left) - y0) ** 2 / left + (psi(right) - y1) ** 2 / (1 - right) + float(weights @ slope(x) ** 2)
    return _over(lambda x: h * ca.exp(-(((x - c) / w) ** 2)) - 1, value, y0, y1, about(c, w))


def tents(random: np.random.Generator) -> Statement:
    """Over h - s |x - c|, steeper than the string: only its peak is touched."""
    c, y0, y1 = random.uniform(0.1, 0.9), *random.uniform(0, 0.4, 2)
    h = random.uniform(0.6, 1.2)
    steep = (1 + 10 ** random.uniform(-1, 3)) * max((h - y0) / c, (h - y1) / (1 - c))
    value = (h - y0) ** 2 / c + (h - y1) ** 2 / (1 - c)
    return _over(lambda x: h - steep * ca.fabs(x - c), value, y0, y1, (c,))


def posts(random: np.random.Generator) -> Statement:
    """Over a post of height h and width 2 w on a floor at -1, w from 1e-4 to 0.1: both its corners are touched."""
    w, c = 10 ** random.uniform(-4, -1), random.uniform(0.25, 0.75)
    y0, y1 = random.uniform(0, 0.4, 2)
    h = random.uniform(0.6, 1.2)
    value = (h - y0) ** 2 / (c - w) + (h - y1) ** 2 / (1 - c - w)
    return _over(lambda x: ca.if_else(ca.fabs(x - c) <= w, h, -1.0), value, y0, y1, (c - w, c + w))
