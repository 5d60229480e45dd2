"""v^2/2 + V(x, y) with many valleys, against a search that looks at all of them."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from campaigns.adversaries.search import Landscape, least_value
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

NEAR = 1e-8
"""What is added to the error that the search tells of itself, relative to the value."""


def hills(random: np.random.Generator) -> Statement:
    """Three to nine Gaussian hills and hollows over a strip: each is passed on one of its sides."""
    count = int(random.integers(3, 10))
    centres = np.column_stack([random.uniform(0.1, 0.9, count), random.uniform(-0.7, 0.7, count)])
    widths, heights = random.uniform(0.08, 0.3, count), random.uniform(-2, 12, count)
    y0, y1 = random.uniform(-0.4, 0.4, 2)
    terms = list(zip(heights.tolist(), centres[:, 0].tolist(), centres[:, 1].tolist(), widths.tolist(), strict=True))

    def V(x: Any, y: Any, exp: Any = np.exp) -> Any:
        return sum(h * exp(-((x - cx) ** 2 + (y - cy) ** 2) / w**2) for h, cx, cy, w in terms)

    def slope(x: Any, y: Any) -> Any:
        return sum(-2 * (y - cy) / w**2 * h * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / w**2) for h, cx, cy, w in terms)

    def curvature(x: Any, y: Any) -> Any:
        return sum(
            (4 * (y - cy) ** 2 / w**4 - 2 / w**2) * h * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / w**2)
            for h, cx, cy, w in terms
        )

    value, error = least_value(Landscape(V, slope, curvature), (0.0, y0, 1.0, y1), (-2.5, 2.5))
    L: Integrand = lambda x, y, v: v**2 / 2 + V(x, y, ca.exp)  # noqa: E731
    return Statement(L, (0.0, y0), (1.0, y1), Least(value, within=error + NEAR * max(1.0, abs(value))))


def tilted_wells(random: np.random.Generator) -> Statement:
    """v^2/2 + k (y^2 - 1)^2 + t y over 6 to 40: both ends may lie in the well that is not the deeper one."""
    T, k = 10 ** random.uniform(math.log10(6), math.log10(40)), 10 ** random.uniform(-0.5, 0.7)
    t = random.choice([-1, 1]) * k * 10 ** random.uniform(-2.5, 0)
    y0, y1 = random.choice([-1.0, 1.0], 2) + random.uniform(-0.3, 0.3, 2)
    landscape = Landscape(
        lambda x, y: k * (y**2 - 1) ** 2 + t * y + 0 * x,
        lambda x, y: 4 * k * y * (y**2 - 1) + t,
        lambda x, y: 4 * k * (3 * y**2 - 1),
    )
    value, error = least_value(landscape, (0.0, float(y0), T, float(y1)), (-1.8, 1.8), 2000)
    L: Integrand = lambda x, y, v: v**2 / 2 + k * (y**2 - 1) ** 2 + t * y  # noqa: E731
    return Statement(L, (0.0, y0), (T, y1), Least(value, within=error + NEAR * max(1.0, abs(value))))


def distant_wells(random: np.random.Generator) -> Statement:
    """A well beside a curve at rest, so deep that the way there and back is barely paid for, or barely not.

    It is as deep as where the best of straight ways, with a rest in the well between them, costs nothing, but for a
    tenth.
    """
    T, c, w = random.uniform(1, 5), random.choice([-1, 1]) * random.uniform(0.7, 2.5), 10 ** random.uniform(-1, -0.2)
    swing, rate = random.uniform(0, 0.2), random.uniform(1, 3)
    share = np.linspace(0.02, 0.48, 400)
    on_way = float(np.mean(np.exp(-(((np.linspace(0, c, 4001) - c) / w) ** 2))))
    deep = np.min(c**2 / (share * T**2 * (1 - 2 * share * (1 - on_way)))) * random.uniform(0.9, 1.1)

    def depth(x: Any, sin: Any) -> Any:
        return deep * (1 + swing * sin(rate * x))

    def well(y: Any) -> Any:
        return np.exp(-(((y - c) / w) ** 2))

    landscape = Landscape(
        lambda x, y: -depth(x, np.sin) * well(y),
        lambda x, y: 2 * (y - c) / w**2 * depth(x, np.sin) * well(y),
        lambda x, y: (2 / w**2 - 4 * (y - c) ** 2 / w**4) * depth(x, np.sin) * well(y),
    )
    value, error = least_value(landscape, (0.0, 0.0, T, 0.0), tuple(sorted((-0.3 * c, 1.3 * c))), 2000)
    L: Integrand = lambda x, y, v: v**2 / 2 - depth(x, ca.sin) * ca.exp(-(((y - c) / w) ** 2))  # noqa: E731
    return Statement(L, (0.0, 0.0), (T, 0.0), Least(value, within=error + NEAR * max(1.0, abs(value))))
