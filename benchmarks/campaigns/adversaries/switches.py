"""Lagrangians that switch on x alone, at abscissae that nobody names: jumps and kinks of coefficients and loads."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from campaigns.adversaries.momentum import pieces, quadratic, weighted
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

LENGTH = 2.0


def heights(random: np.random.Generator) -> tuple[float, float | None]:
    """The heights of the ends, the second one free now and then."""
    y0, y1 = random.uniform(-1, 1, 2)
    return float(y0), None if random.uniform() < 0.2 else float(y1)


def risen(random: np.random.Generator) -> tuple[float, float]:
    """The heights of two ends that are held, some way apart."""
    y0 = random.uniform(-1, 1)
    return float(y0), float(y0 + random.choice([-1, 1]) * random.uniform(0.5, 2))


def driven(
    stiffness: Any, force: Any, impulse: Any, breaks: list[float], ends: tuple[float, float | None], panels: int = 8
) -> Statement:
    """p v^2/2 - f y with p and f functions of x for CasADi, ``impulse`` the integral of f from 0 for NumPy."""
    y0, y1 = ends
    x, weights = pieces(0.0, LENGTH, breaks, panels)
    p = np.array([float(stiffness(node)) for node in x])
    integrals = weighted(lambda x: p, impulse, x, weights)
    value = quadratic(integrals, float(impulse(np.array([LENGTH]))[0]), y0, y1)
    L: Integrand = lambda x, y, v: stiffness(x) * v**2 / 2 - force(x) * y  # noqa: E731
    return Statement(L, (0.0, y0), (LENGTH, y1), Least(value, sole=True), points=tuple(breaks))


def jumps(random: np.random.Generator) -> Statement:
    """A stiffness of up to four levels, with up to three jumps, written as nested conditions, steps or signs."""
    count = int(random.integers(1, 4))
    places = np.sort(random.uniform(0.05, LENGTH - 0.05, count)).tolist()
    levels = np.exp(random.uniform(-2.5, 2.5, count + 1)).tolist()
    written = int(random.integers(3))

    def stiffness(x: Any) -> Any:
        level = levels[0]
        for place, before, after in zip(places, levels[:-1], levels[1:], strict=True):
            if written == 0:
                level = ca.if_else(x > place, after, level)
            elif written == 1:
                level = level + (x >= place) * (after - before)
            else:
                level = level + (1 + ca.sign(x - place)) / 2 * (after - before)
        return level

    return driven(stiffness, lambda x: 0.0, np.zeros_like, places, risen(random))


def stairs(random: np.random.Generator) -> Statement:
    """A stiffness that rises with floor, or alternates with fmod."""
    width, rise = random.uniform(0.15, 0.9), np.exp(random.uniform(-2, 2))
    if random.uniform() < 0.5:
        breaks = (width * np.arange(1, LENGTH / width)).tolist()
        return driven(lambda x: 1 + rise * ca.floor(x / width), lambda x: 0.0, np.zeros_like, breaks, risen(random))
    share = random.uniform(0.2, 0.8) * width
    starts = width * np.arange(0, LENGTH / width)
    breaks = np.concatenate([starts, starts + share]).tolist()
    inside = [b for b in breaks if 0 < b < LENGTH]
    return driven(lambda x: 1 + rise * (ca.fmod(x, width) > share), lambda x: 0.0, np.zeros_like, inside, risen(random))


def kinks(random: np.random.Generator) -> Statement:
    """A stiffness with kinks: 1 + m |x - c|, or fmax(x, c)."""
    place, slope = random.uniform(0.05, LENGTH - 0.05), np.exp(random.uniform(-2, 3))
    if random.uniform() < 0.5:
        return driven(
            lambda x: 0.2 + slope * ca.fabs(x - place), lambda x: 0.0, np.zeros_like, [place], risen(random), 40
        )
    return driven(lambda x: ca.fmax(x, place) * slope, lambda x: 0.0, np.zeros_like, [place], risen(random), 40)


def loads(random: np.random.Generator) -> Statement:
    """A load with a kink, A |x - c| or A fmax(x, c), or one that sets in at c."""
    c, A = random.uniform(0.05, LENGTH - 0.05), random.uniform(-8, 8)
    kind = random.integers(3)
    if kind == 0:
        force: Any = lambda x: A * ca.fabs(x - c)  # noqa: E731
        impulse: Any = lambda x: A * ((x - c) * np.abs(x - c) + c**2) / 2  # noqa: E731
    elif kind == 1:
        force = lambda x: A * ca.fmax(x, c)  # noqa: E731
        impulse = lambda x: A * np.where(x < c, c * x, (x**2 + c**2) / 2)  # noqa: E731
    else:
        force = lambda x: ca.if_else(x > c, A, 0)  # noqa: E731
        impulse = lambda x: A * np.maximum(x - c, 0)  # noqa: E731
    return driven(lambda x: 1.0, force, impulse, [c], heights(random))
