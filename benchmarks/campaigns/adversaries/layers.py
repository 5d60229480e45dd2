"""Layers across y: of different index, written as conditions, and stiffnesses that are stairs or teeth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from campaigns.least import Least
from campaigns.statement import Integrand, Statement


def direct(heights: np.ndarray, indices: np.ndarray, across: float) -> float:
    """The optical path of the ray that crosses layers once each, so high and of such indices (Snell's law).

    With p = n sin(angle from the normal) it comes sum of h p/sqrt(n^2 - p^2) across and takes h n^2/sqrt(n^2 - p^2).
    p is found by t = p/sqrt(n_min^2 - p^2).
    """
    least = indices.min()

    def roots(t: float) -> tuple[float, np.ndarray]:
        p = least * t / np.hypot(1, t)
        # n^2 - p^2 = n^2 - n_min^2 + n_min^2/(1 + t^2)
        return p, np.sqrt(indices**2 - least**2 + (least / np.hypot(1, t)) ** 2)

    def arrival(t: float) -> float:
        p, root = roots(t)
        return float(np.sum(heights * p / root))

    far = 1.0
    while arrival(far) < across:
        far *= 2
    _, root = roots(brentq(lambda t: arrival(t) - across, 0.0, far, xtol=1e-15, rtol=1e-15))
    return float(np.sum(heights * indices**2 / root))


def headed(
    heights: np.ndarray, indices: np.ndarray, fast: float, across: float
) -> float | None:  # fmt: skip
    """The optical path by way of a boundary along which the index is ``fast``; None where it is not reached."""
    if fast >= indices.min():
        return None
    root = np.sqrt(indices**2 - fast**2)
    if across < np.sum(heights * fast / root):
        return None
    return float(fast * across + np.sum(heights * root))


def fermat(levels: Sequence[float], indices: Sequence[float], y0: float, y1: float, across: float) -> list[float]:
    """The optical paths that may be the least: straight through, and by way of each boundary beyond the ends."""
    edges = np.array([-np.inf, *levels, np.inf])
    n = np.array(indices)

    def crossed(low: float, high: float) -> np.ndarray:
        return np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0, None)

    low, high = min(y0, y1), max(y0, y1)
    through = crossed(low, high)
    paths = [direct(through[through > 0], n[through > 0], across)]
    for number, level in enumerate(levels):
        if low < level < high:
            continue
        # down (or up) to the level and back again: the layers between it and either end
        way = crossed(level, y0) + crossed(level, y1) if level <= low else crossed(y0, level) + crossed(y1, level)
        beyond = n[number] if level <= low else n[number + 1]
        path = headed(way[way > 0], n[way > 0], float(beyond), across)
        if path is not None:
            paths.append(path)
    return paths


def refraction(random: np.random.Generator) -> Statement:
    """if_else(y > c, n2, n1) sqrt(1 + v^2) with one to three levels."""
    count = int(random.integers(1, 4))
    levels = (np.cumsum(random.uniform(0.2, 0.8, count)) - 0.5).tolist()
    indices = random.uniform(1, 3, count + 1).tolist()
    y0, y1 = levels[0] - random.uniform(0.1, 1), levels[-1] + random.uniform(0.1, 1)
    if count > 1 and random.uniform() < 0.4:  # both ends on the same side of some level
        y1 = random.uniform(levels[0], levels[1])
    across = random.uniform(0.3, 5)
    paths = fermat(levels, indices, y0, y1, across)

    def index(y: Any) -> Any:
        n = indices[0]
        for level, above in zip(levels, indices[1:], strict=True):
            n = ca.if_else(y > level, above, n)
        return n

    L: Integrand = lambda x, y, v: index(y) * ca.sqrt(1 + v**2)  # noqa: E731
    return Statement(L, (0.0, y0), (across, y1), Least(min(paths), sole=len(paths) == 1))


def stairs(random: np.random.Generator) -> Statement:
    """p(y) v^2 with p = exp(c floor(n y)), the same with ceil, or 1 + m remainder(n y, 1).

    The value is (integral of sqrt p dy)^2 over the length, by Cauchy and Schwarz.
    """
    rate, slope = random.uniform(0.7, 8), float(random.choice([-1, 1]) * random.uniform(0.2, 0.8))
    y0 = random.uniform(-1, 1)
    y1, across = y0 + random.choice([-1, 1]) * random.uniform(0.4, 2), random.uniform(0.5, 4)
    operation = random.integers(3)
    # teeth jump half way between whole numbers
    edge = 0.5 if operation == 2 else 0.0
    low, high = sorted((rate * y0 + edge, rate * y1 + edge))
    cuts = np.unique(np.concatenate([[low], np.arange(np.ceil(low), np.ceil(high)), [high]]))
    below = np.floor((cuts[1:] + cuts[:-1]) / 2)
    if operation == 2:
        ends = [1 + slope * (cut - below - edge) for cut in (cuts[:-1], cuts[1:])]
        way = np.sum(2 / (3 * slope) * (ends[1] ** 1.5 - ends[0] ** 1.5))
        stiffness: Any = lambda y: 1 + slope * ca.remainder(rate * y, 1)  # noqa: E731
    else:
        way = np.sum(np.diff(cuts) * np.exp(slope * (below + operation) / 2))
        step = ca.ceil if operation else ca.floor
        stiffness = lambda y: ca.exp(slope * step(rate * y))  # noqa: E731
    L: Integrand = lambda x, y, v: stiffness(y) * v**2  # noqa: E731
    return Statement(L, (0.0, y0), (across, y1), Least(float((way / rate) ** 2 / across)))
