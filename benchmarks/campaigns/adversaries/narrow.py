"""Features far narrower than any first mesh: soft spots of a string, and loads on a few grains of it."""

from __future__ import annotations

import casadi as ca
import numpy as np
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
