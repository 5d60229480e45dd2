"""Kinks in the slope and in y: friction, levels that are crossed, and levels that are followed (dead cores)."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

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


def total_variation(random: np.random.Generator) -> Statement:
    """w |v| + k (y - a sin(2 pi m x / T + phase))^2, or with m1 v or -m2 v for w |v|, between free ends.

    Every crest and trough is cut by a rest along which the momentum 2 k (y - data) takes it from one side of the kink
    to the other, from 0 at the ends; drawn so that no rest comes to the next one.
    """
    T, waves, a = random.uniform(0.5, 4), int(random.integers(1, 4)), math.exp(random.uniform(-2, 2))
    low, high = np.exp(random.uniform(-1, 1, 2)).tolist()
    if random.uniform() < 0.6:
        low = high
    rate, phase = 2 * math.pi * waves / T, random.uniform(-0.3, 0.3)
    k = random.uniform(8, 80) * (low + high) * rate / (4 * a)
    sign = float(random.choice([-1, 1]))

    def area(x: float, c: float, end: float) -> float:  # of the data beyond a level c between abscissae
        return a * (math.cos(rate * x + phase) - math.cos(rate * end + phase)) / rate - c * (end - x)

    def off(x: float, c: float, end: float) -> float:  # the integral of (data - c)^2
        squares = (end - x) / 2 - (math.sin(2 * (rate * end + phase)) - math.sin(2 * (rate * x + phase))) / (4 * rate)
        return a**2 * squares - 2 * c * area(x, 0.0, end) + c**2 * (end - x)

    # between crests: a rest about one from u before it to u after it, of level a cos(rate u)
    crests = [(math.pi * (n + 0.5) - phase) / rate for n in range(2 * waves)]
    turned = (low + high) / (2 * k)
    half = brentq(
        lambda u: 2 * (a * math.sin(rate * u) / rate - u * a * math.cos(rate * u)) - turned, 0, math.pi / (2 * rate)
    )
    levels, lost = [(-1) ** n * a * math.cos(rate * half) for n in range(2 * waves)], 0.0
    lost = sum(off(x - half, c, x + half) for x, c in zip(crests, levels, strict=True))
    # sign * y rises from the start to the first crest, and from the last trough to the end
    rises = high if sign > 0 else low
    first = brentq(lambda x: a * x * math.sin(rate * x + phase) - area(0.0, 0.0, x) - rises / (2 * k), 0, crests[0])
    last = brentq(
        lambda x: area(T - x, 0.0, T) - a * x * math.sin(rate * (T - x) + phase) - rises / (2 * k), 0, T - crests[-1]
    )
    ends = a * math.sin(rate * first + phase), a * math.sin(rate * (T - last) + phase)
    lost += off(0.0, ends[0], first) + off(T - last, ends[1], T)
    steps = sign * np.diff([ends[0], *levels, ends[1]])
    value = float(np.where(steps > 0, high * steps, -low * steps).sum()) + k * lost
    slope: Any = lambda v: high * ca.fabs(v) if low == high else ca.fmax(high * v, -low * v)  # noqa: E731
    L: Integrand = lambda x, y, v: slope(v) + k * (y - sign * a * ca.sin(rate * x + phase)) ** 2  # noqa: E731
    return Statement(L, (0.0, None), (T, None), Least(value, sole=True))


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
