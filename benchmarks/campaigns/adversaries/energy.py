"""Autonomous functionals v^2/2 + V(y) with monotone extremals: walls, wells and long kinks by the energy integral.

E = v^2/2 - V is constant along an extremal, so that the interval is the integral of dy/sqrt(2 (E + V)) and the value
that of sqrt(2 (E + V)) dy less E T (Landau and Lifshitz, "Mechanics", 11). The energy is drawn, and the interval
follows, or E is found from the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from campaigns.adversaries.momentum import about, pieces, rule
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

DEEPEST = 1e-140
"""The least energy over the height of a well that is looked for."""


def of_energy(V: np.ndarray, weights: np.ndarray, energy: float) -> tuple[float, float]:
    """The interval and the value of the extremal of such an energy, V being given where the rule asks for it."""
    speed = np.sqrt(2 * (energy + V))
    T = float(weights @ (1 / speed))
    return T, float(weights @ speed) - energy * T


def found(V: np.ndarray, weights: np.ndarray, T: float, offset: float = 0.0) -> float:
    """The value of the extremal over an interval T; its energy is above ``offset``, by any order of magnitude."""

    def late(logarithm: float) -> float:
        return math.log(of_energy(V, weights, offset + math.exp(logarithm))[0] / T)

    logarithm = brentq(late, math.log(DEEPEST), math.log(1e12), xtol=1e-13, rtol=1e-13)
    return of_energy(V, weights, offset + math.exp(logarithm))[1]


def walls(random: np.random.Generator) -> Statement:
    """v^2/2 + A exp(-((y - c)/w)^2)/w: over a high wall, or through a deep well, of any width.

    V vanishes at both ends to round-off, so that every extremal crosses in one sweep: the one is the least.
    """
    w, c = 10 ** random.uniform(-4, -1.2), random.uniform(-0.2, 0.2)
    A = random.choice([-1, 1, 1]) * 10 ** random.uniform(-2, 0.5) * (w if random.uniform() < 0.5 else 1)
    y, weights = pieces(-1.0, 1.0, about(c, w), 60)
    V = A / w * np.exp(-(((y - c) / w) ** 2))
    energy = (10 ** random.uniform(-1.5, 1)) + max(0.0, -A / w)
    T, value = of_energy(V, weights, energy)
    potential: Callable[[Any], Any] = lambda y: A / w * ca.exp(-(((y - c) / w) ** 2))  # noqa: E731
    L: Integrand = lambda x, y, v: v**2 / 2 + potential(y)  # noqa: E731
    return Statement(L, (0.0, -1.0), (T, 1.0), Least(value, sole=True, within=1e-11 * abs(value)))


def graded(length: float) -> tuple[np.ndarray, np.ndarray]:
    """The rule from 0 to a length, its panels as fine towards 0 as the deepest energies demand."""
    return rule([0.0, *(length * 10.0 ** np.arange(-75, 0.1, 0.25))], 2)


def double_wells(random: np.random.Generator) -> Statement:
    """v^2/2 + k (1 - y^2)^2/4 from one well to the other, over 6 to 100: a kink that would be anywhere.

    V is k (u (2 - u))^2/4 at a distance u from a well; both halves are alike.
    """
    T, k = 10 ** random.uniform(math.log10(6), 2), random.uniform(0.5, 3)
    u, weights = graded(1.0)
    value = found(k * (u * (2 - u)) ** 2 / 4, 2 * weights, T)
    L: Integrand = lambda x, y, v: v**2 / 2 + k * (1 - y**2) ** 2 / 4  # noqa: E731
    return Statement(L, (0.0, -1.0), (T, 1.0), Least(value, sole=True, within=1e-10))


def heteroclinic(random: np.random.Generator) -> Statement:
    """v^2/2 + (1 - y^2)^2/4 between heights of tanh((x - x0)/sqrt 2), which has no energy.

    As v^2/2 + V >= sqrt(2 V) v the value is the integral of (1 - y^2)/sqrt 2 dy.
    """
    T, share = 10 ** random.uniform(math.log10(6), 2), random.uniform(0.2, 0.8)
    x0 = share * T
    y0, y1 = math.tanh(-x0 / math.sqrt(2)), math.tanh((T - x0) / math.sqrt(2))
    # 1 - y keeps no digits where y rounds to 1: a value there is that of y = 1, to round-off
    value = ((y1 - y1**3 / 3) - (y0 - y0**3 / 3)) / math.sqrt(2)
    L: Integrand = lambda x, y, v: v**2 / 2 + (1 - y**2) ** 2 / 4  # noqa: E731
    return Statement(L, (0.0, y0), (T, y1), Least(value, within=1e-10))


def sine_gordon(random: np.random.Generator) -> Statement:
    """v^2/2 + k (1 - cos y) from 0 to 2 pi over 6 to 100: the pendulum, or a soliton."""
    T, k = 10 ** random.uniform(math.log10(6), 2), random.uniform(0.5, 2)
    u, weights = graded(math.pi)
    value = found(2 * k * np.sin(u / 2) ** 2, 2 * weights, T)
    L: Integrand = lambda x, y, v: v**2 / 2 + k * (1 - ca.cos(y))  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, 2 * math.pi), Least(value, sole=True, within=1e-10))
