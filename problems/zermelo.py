"""Zermelo's navigation problem: crossing a river in the least time.

A boat of speed 1 crosses from x = 0 to x = 1 in a current w(x) along y, here
w = 4 W x (1 - x). Heading so that its track is y(x) it takes the time

    T[y] = integral of (sqrt(1 + y'^2 - w^2) - w y')/(1 - w^2) dx.

y is ignorable; L_y' = c gives y' = k sqrt((1 - w^2)/(1 - k^2)), k = w + c (1 - w^2),
and T is the integral of (1 - k w) sqrt((1 - w^2)/(1 - k^2))/(1 - w^2). Where the
landing is free, c = 0: the boat heads straight across, drifts by the integral
of w, and T = 1. If every landing at y costs K y^2 more, c = -2 K y(1).

Source: Zermelo, "Ueber das Navigationsproblem", ZAMM 11 (1931),
for a current along y that depends on x alone.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._quadrature import integral
from varcalc.problems._roots import increasing_root

SOURCE = 'Zermelo, "Ueber das Navigationsproblem", ZAMM 11 (1931)'
CURRENT, COST = 0.6, 0.5


def current(x, W):
    return 4 * W * x * (1 - x)


def crossing_time(x, y, dy, p):
    w = current(x, p.W)
    return (ca.sqrt(1 + dy**2 - w**2) - w * dy) / (1 - w**2)


def walk(x0, y0, x1, y1, p):
    return COST * y1**2


def slope(x: np.ndarray, c: float) -> np.ndarray:
    w = current(x, CURRENT)
    k = w + c * (1 - w**2)
    return k * np.sqrt((1 - w**2) / (1 - k**2))


def slope_by_constant(x: np.ndarray, c: float) -> np.ndarray:
    """The derivative of the slope by c."""
    w = current(x, CURRENT)
    k = w + c * (1 - w**2)
    return ((1 - w**2) / (1 - k**2)) ** 1.5


def duration_rate(x: np.ndarray, c: float) -> np.ndarray:
    w = current(x, CURRENT)
    k = w + c * (1 - w**2)
    return (1 - k * w) / np.sqrt((1 - w**2) * (1 - k**2))


def track(c: float) -> Callable[[Any], np.ndarray]:
    return lambda x: integral(lambda s: slope(s, c), 0, x)


def drift(x: Any) -> np.ndarray:
    """The integral of the current."""
    x = np.asarray(x, dtype=float)
    return 2 * CURRENT * x**2 * (1 - 2 * x / 3)


def first_integral(cost: float, weight: float) -> float:
    """The constant c for which weight y(1) + c cost vanishes; |k| < 1 bounds it."""

    def balance(c: np.ndarray) -> tuple[Any, Any]:
        at = float(c)
        across = integral(lambda s: slope(s, at), 0, 1), integral(lambda s: slope_by_constant(s, at), 0, 1)
        return weight * across[0] + cost * at, weight * across[1] + cost

    return float(increasing_root(balance, -1.0, 1 / (1 + CURRENT)))


def crossing(c: float, cost: float = 0.0) -> vc.Exact:
    duration = integral(lambda s: duration_rate(s, c), 0, 1)
    return vc.Exact(float(duration + cost * track(c)(1) ** 2), track(c), "quadrature of the first integral")


references = (
    vc.Reference(
        name="zermelo",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"W": CURRENT}),
        exact=crossing(first_integral(cost=0, weight=1)),
        source=SOURCE,
        statement="The quickest crossing of a river to the point opposite.",
    ),
    vc.Reference(
        name="zermelo/drift",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Free(1), parameters={"W": CURRENT}),
        exact=vc.Exact(1, drift, "cubic"),
        source=SOURCE,
        statement="The quickest crossing of a river, the landing left to the current.",
    ),
    vc.Reference(
        name="zermelo/walk",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Free(1), parameters={"W": CURRENT}, end_cost=walk),
        exact=crossing(first_integral(cost=1, weight=2 * COST), COST),
        source=SOURCE,
        statement="The quickest crossing of a river when the way back along the shore is paid for.",
    ),
)
