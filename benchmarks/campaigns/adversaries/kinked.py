"""Kinks in the slope and in y: friction, levels that are crossed, and levels that are followed (dead cores)."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from campaigns.adversaries.momentum import dual, pieces
from campaigns.least import Least
from campaigns.statement import Integrand, Statement


def friction(random: np.random.Generator) -> Statement:
    """v^2/2 + m1 (-v)+ + m2 v+ - c y, or v^2/2 + fmax(-m1 v, m2 v), which is the same: the curve is held, then lets go.

    phi*(s) is half the square of the distance of s from (-m1, m2).
    """
    T, c = random.uniform(1, 4), random.uniform(0.5, 3) * random.choice([-1, 1])
    low, high = -random.uniform(0.05, 1.2), random.uniform(0.05, 1.2)
    rise = 0.0 if random.uniform() < 0.6 else random.uniform(-1.5, 1.5)
    if random.uniform() < 0.6:
        low = -high
        phi: Any = lambda v: v**2 / 2 + high * ca.fabs(v)  # noqa: E731
    else:
        phi = lambda v: v**2 / 2 + ca.fmax(low * v, high * v)  # noqa: E731
    # with the impulse c x as the variable the rule is exact, its breaks being those of phi*: here a fine one is enough
    x, weights = pieces(0.0, T, [], 4000)
    distance: Any = lambda s: s - np.clip(s, low, high)  # noqa: E731
    reach = 10 * (abs(c) * T + high - low + abs(rise) / T)
    value = dual(lambda s: distance(s) ** 2 / 2, distance, rise, x, weights, c * x, reach) - c * T * rise
    L: Integrand = lambda x, y, v: phi(v) - c * y  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, rise), Least(value, sole=True, within=1e-10))


def _fall(height: float, energy: float, k: float) -> tuple[float, float]:
    """Time and action, the integrals of dy/sqrt(2 (E + k y)) and sqrt(2 (E + k y)) dy, from 0 to a height."""
    before, after = math.sqrt(2 * energy), math.sqrt(2 * (energy + k * height))
    return (after - before) / k, (after**3 - before**3) / (3 * k)


def crossed_levels(random: np.random.Generator) -> Statement:
    """v^2/2 + k1 (c - y)+ + k2 (y - c)+ from below c to above: crossed at an energy E = v^2/2 - k |y - c| > 0.

    Drawn is the energy; the interval follows from it.
    """
    k1, k2 = np.exp(random.uniform(-1.5, 1.5, 2)).tolist()
    if random.uniform() < 0.6:
        k2 = k1
    below, above, c = random.uniform(0.2, 2), random.uniform(0.2, 2), float(random.integers(-4, 5)) / 8
    energy = 10 ** random.uniform(-4, 1)
    times, actions = zip(_fall(below, energy, k1), _fall(above, energy, k2), strict=True)
    T = sum(times)
    if k1 == k2:
        potential: Any = lambda y: k1 * ca.fabs(y - c)  # noqa: E731
    else:
        potential = lambda y: ca.fmax(k2 * (y - c), k1 * (c - y))  # noqa: E731
    L: Integrand = lambda x, y, v: v**2 / 2 + potential(y)  # noqa: E731
    return Statement(L, (0.0, c - below), (T, c + above), Least(sum(actions) - energy * T, sole=True))


def dead_cores(random: np.random.Generator) -> Statement:
    """v^2/2 + k |y| between ends of one sign: a parabola where they are near, else to 0 and along it.

    A parabola reaches the axis with no slope from a height h after sqrt(2 h/k), at the price (2/3) sqrt(2 k) h^(3/2).
    """
    k, y0, y1 = np.exp(random.uniform(-1, 1.5)), random.uniform(0.2, 2), random.uniform(0.2, 2)
    if random.uniform() < 0.4:
        y1 = y0
    nearest = math.sqrt(2 * y0 / k) + math.sqrt(2 * y1 / k)
    T = nearest * 10 ** random.uniform(-0.5, 0.7)
    if nearest <= T:
        value = 2 / 3 * math.sqrt(2 * k) * (y0**1.5 + y1**1.5)
    else:
        s = (y1 - y0) / T - k * T / 2
        value = s**2 * T / 2 + s * k * T**2 / 2 + k**2 * T**3 / 6 + k * (y0 * T + s * T**2 / 2 + k * T**3 / 6)
    L: Integrand = lambda x, y, v: v**2 / 2 + k * ca.fabs(y)  # noqa: E731
    return Statement(L, (0.0, y0), (T, y1), Least(value, sole=True))
