"""The least integral of v^2/2 + V(x, y) by a dynamic programme, and a polish of what it finds.

Bellman's recursion on a lattice gives for every lattice point the least value of the curves through it. Where that is
least among its neighbours along a line of constant x a valley of the functional runs; from each such curve a polygon is
brought to rest by Newton's iteration, on three meshes, whose values are extrapolated (Richardson). The least is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import solveh_banded

ACROSS, HEIGHTS = 48, 241
LOOKS = 5
"""Abscissae at which valleys are looked for."""
ITERATIONS = 200


@dataclass(frozen=True)
class Landscape:
    """V and its first two derivatives by y, as functions of arrays."""

    V: Callable[[Any, Any], Any]
    slope: Callable[[Any, Any], Any]
    curvature: Callable[[Any, Any], Any]


def valleys(landscape: Landscape, x: np.ndarray, heights: np.ndarray, y0: float, y1: float) -> list[np.ndarray]:
    """The best lattice curves through each valley between (x[0], y0) and (x[-1], y1)."""
    h = x[1] - x[0]
    levels = [np.array([y0]), *[heights] * (len(x) - 2), np.array([y1])]
    price = [landscape.V(at, y) for at, y in zip(x, levels, strict=True)]

    def leg(i: int) -> np.ndarray:
        rise = levels[i + 1][None, :] - levels[i][:, None]
        return rise**2 / (2 * h) + h * (price[i][:, None] + price[i + 1][None, :]) / 2

    ahead, came = [np.zeros(1)], []
    for i in range(len(x) - 1):
        total = ahead[-1][:, None] + leg(i)
        came.append(total.argmin(0))
        ahead.append(total.min(0))
    behind, goes = [np.zeros(1)], []
    for i in reversed(range(len(x) - 1)):
        total = leg(i) + behind[-1][None, :]
        goes.append(total.argmin(1))
        behind.append(total.min(1))
    behind.reverse()
    goes.reverse()
    found = []
    for i in np.linspace(1, len(x) - 2, LOOKS).round().astype(int):
        through = ahead[i] + behind[i]
        inner = through[1:-1]
        for j in 1 + np.flatnonzero((inner <= through[:-2]) & (inner < through[2:])):
            way = {int(i): int(j)}
            for k in range(i, 0, -1):
                way[k - 1] = int(came[k - 1][way[k]])
            for k in range(i, len(x) - 1):
                way[k + 1] = int(goes[k][way[k]])
            found.append((through[j], np.array([levels[k][way[k]] for k in range(len(x))])))
    found.sort(key=lambda pair: pair[0])
    return [curve for _, curve in found[:12]]


def polygon_value(landscape: Landscape, x: np.ndarray, y: np.ndarray) -> float:
    """The trapezoidal value of a polygon."""
    h, V = x[1] - x[0], landscape.V(x, y)
    return float(np.sum(np.diff(y) ** 2) / (2 * h) + h * (V.sum() - (V[0] + V[-1]) / 2))


def rested(landscape: Landscape, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A polygon brought to rest by Newton's iteration, damped by a diagonal where it does not descend."""
    h, damping = x[1] - x[0], 0.0
    value = polygon_value(landscape, x, y)
    for _ in range(ITERATIONS):
        inside = x[1:-1], y[1:-1]
        gradient = -(y[2:] - 2 * y[1:-1] + y[:-2]) / h + h * landscape.slope(*inside)
        bands = np.zeros((2, len(x) - 2))
        bands[0, 1:] = -1 / h
        bands[1] = 2 / h + h * (landscape.curvature(*inside) + damping)
        try:
            step = solveh_banded(bands, -gradient)
        except np.linalg.LinAlgError:
            damping = max(1.0, 4 * damping)
            continue
        tried = y.copy()
        tried[1:-1] += step
        new = polygon_value(landscape, x, tried)
        if new <= value + 1e-13 * max(1.0, abs(value)):
            y, value = tried, new
            damping = damping / 4 if damping > 1e-6 else 0.0
            if damping == 0 and np.abs(step).max() < 1e-11 * (1 + np.abs(y).max()):
                break
        else:
            damping = max(1.0, 4 * damping)
    return y


def least_value(
    landscape: Landscape, ends: tuple[float, float, float, float], band: tuple[float, float], nodes: int = 1000
) -> tuple[float, float]:
    """The least value from (x0, y0) to (x1, y1), and its error, with lattice heights in a band."""
    x0, y0, x1, y1 = ends
    coarse = np.linspace(x0, x1, ACROSS + 1)
    meshes = [np.linspace(x0, x1, count + 1) for count in (nodes, 2 * nodes, 4 * nodes)]
    best, error = np.inf, 0.0
    for curve in valleys(landscape, coarse, np.linspace(*band, HEIGHTS), y0, y1):
        first = rested(landscape, meshes[0], np.interp(meshes[0], coarse, curve))
        value = polygon_value(landscape, meshes[0], first)
        if value > best + max(1e-3, abs(best)) * 1e-2:
            continue
        values = [value]
        for before, mesh in pairwise(meshes):
            first = rested(landscape, mesh, np.interp(mesh, before, first))
            values.append(polygon_value(landscape, mesh, first))
        once = [(4 * fine - rough) / 3 for rough, fine in pairwise(values)]
        twice = (16 * once[1] - once[0]) / 15
        if twice < best:
            best, error = twice, abs(twice - once[1])
    return best, error
