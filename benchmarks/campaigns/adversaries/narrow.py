"""Features far narrower than any first mesh: soft spots of a string, loads on a few grains of it, slots beside it."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.integrate import quad
from scipy.special import erf

from campaigns.adversaries.momentum import about, pieces, quadratic, weighted
from campaigns.adversaries.switches import heights
from campaigns.least import Least
from campaigns.statement import Statement


def width_of(random: np.random.Generator, least: float = -6, most: float = -1) -> float:
    """A width of any order of magnitude."""
    return float(10 ** random.uniform(least, most))


def spots(random: np.random.Generator) -> Statement:
    """(1 - s exp(-((x - c)/w)^2)) v^2: the string is softer, or much stiffer, over a width w about c.

    The least value is the square of the rise over the integral of the compliance.
    """
    w, c = width_of(random), random.uniform(0.05, 0.95)
    s = 1 - 10 ** random.uniform(-4, -0.3) if random.uniform() < 0.7 else -(10 ** random.uniform(0, 3))
    # a compliance near its pole in the complex plane needs many panels
    x, weights = pieces(0.0, 1.0, about(c, w), 60)
    compliance = float(weights @ (1 / (1 - s * np.exp(-(((x - c) / w) ** 2)))))
    rise = random.uniform(0.5, 2)
    least = Least(rise**2 / compliance, sole=True)
    return Statement(
        lambda x, y, v: (1 - s * ca.exp(-(((x - c) / w) ** 2))) * v**2, (0.0, 0.0), (1.0, rise), least,
        points=about(c, w),
    )  # fmt: skip


def grains(random: np.random.Generator) -> Statement:
    """v^2/2 - A exp(-((x - c)/w)^2)/(w sqrt(pi)) y: a load A on a width w about c; its impulse is an error function."""
    w, c, A = width_of(random), random.uniform(0.05, 0.95), random.uniform(0.5, 4) * random.choice([-1, 1])
    y0, y1 = heights(random) if random.uniform() < 0.5 else (0.0, 0.0)
    x, weights = pieces(0.0, 1.0, about(c, w), 4)

    def impulse(x: np.ndarray) -> np.ndarray:
        return A / 2 * (erf((x - c) / w) + erf(c / w))

    value = quadratic(weighted(np.ones_like, impulse, x, weights), float(impulse(np.array([1.0]))[0]), y0, y1)
    return Statement(
        lambda x, y, v: v**2 / 2 - A * ca.exp(-(((x - c) / w) ** 2)) / (w * np.sqrt(np.pi)) * y, (0.0, y0), (1.0, y1),
        Least(value, sole=True), points=about(c, w),
    )  # fmt: skip


def slots(random: np.random.Generator) -> Statement:
    """v^2/2 - D f((y - c)/w), f one of exp(-u^2) and 1/(1 + u^2): a motion that stays in a slot far from both ends.

    Without energy beyond that at the bottom v^2/2 = D (1 - f), up to what is exp(-length/w).
    """
    w, c = width_of(random), random.choice([-1, 1]) * random.uniform(0.4, 1.5)
    length, rise = random.uniform(2, 12), random.uniform(-0.3, 0.3)
    far = abs(c), abs(c - rise)
    D = max(3.0, 32 * (sum(far) / length) ** 2) * 10 ** random.uniform(0, 1.5)
    tailed = random.uniform() < 0.5

    def way(distance: float) -> float:
        def speed(u: float) -> float:
            return float(np.sqrt(u**2 / (1 + u**2) if tailed else -np.expm1(-(u**2))))

        edges = [0.0, *(e for e in (3.0, 30.0, 3e3, 3e5) if e < distance / w), distance / w]
        return w * sum(quad(speed, a, b, limit=200, epsrel=1e-13)[0] for a, b in pairwise(edges))

    least = Least(-D * length + np.sqrt(2 * D) * (way(far[0]) + way(far[1])))

    def L(x: ca.SX, y: ca.SX, v: ca.SX) -> ca.SX:
        u2 = ((y - c) / w) ** 2
        return v**2 / 2 - D * (1 / (1 + u2) if tailed else ca.exp(-u2))

    turns = far[0] / np.sqrt(2 * D), length - far[1] / np.sqrt(2 * D)
    return Statement(L, (0.0, 0.0), (length, rise), least, points=turns)
