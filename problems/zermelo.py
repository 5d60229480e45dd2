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

import varcalc as vc
from varcalc.problems._arithmetic import numbers, scalar, sqrt
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


def inclination(x: Any, c: Any) -> tuple[Any, Any]:
    """1 - w^2, and k."""
    w = current(x, CURRENT)
    return 1 - w**2, w + c * (1 - w**2)


def slope(x: Any, c: Any) -> Any:
    free, k = inclination(x, c)
    return k * sqrt(free / (1 - k**2))


def slope_by_constant(x: Any, c: Any) -> Any:
    """The derivative of the slope by c."""
    free, k = inclination(x, c)
    return (free / (1 - k**2)) ** 1.5


def duration_rate(x: Any, c: Any) -> Any:
    free, k = inclination(x, c)
    return (1 - k * current(x, CURRENT)) / sqrt(free * (1 - k**2))


def drift(x: Any) -> Any:
    """The integral of the current."""
    x = numbers(x)
    return 2 * CURRENT * x**2 * (1 - 2 * x / 3)


def first_integral(number: Callable[[float], Any], cost: float, weight: float) -> Any:
    """The constant c for which weight y(1) + c cost vanishes; |k| < 1 bounds it."""
    bank = number(1)

    def balance(c: Any) -> tuple[Any, Any]:
        at = scalar(c)
        across = integral(lambda s: slope(s, at), 0, bank), integral(lambda s: slope_by_constant(s, at), 0, bank)
        return weight * across[0] + cost * at, weight * across[1] + cost

    return scalar(increasing_root(balance, number(-1), 1 / (1 + number(CURRENT))))


def crossing(cost: float, weight: float, walked: float = 0.0) -> vc.Exact:
    """The crossing whose constant balances, the landing at y costing ``walked`` y^2 more."""

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        c, bank = first_integral(number, cost, weight), number(1)

        def track(x: Any) -> Any:
            return integral(lambda s: slope(s, c), 0, x)

        return scalar(integral(lambda s: duration_rate(s, c), 0, bank) + walked * track(bank) ** 2), track

    return vc.Exact.of(form, "quadrature of the first integral")


references = (
    vc.Reference(
        name="zermelo",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"W": CURRENT}),
        exact=crossing(cost=0, weight=1),
        source=SOURCE,
        statement="The quickest crossing of a river to the point opposite.",
    ),
    vc.Reference(
        name="zermelo/drift",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Free(1), parameters={"W": CURRENT}),
        exact=vc.Exact.of(lambda number: (number(1), drift), "cubic"),
        source=SOURCE,
        statement="The quickest crossing of a river, the landing left to the current.",
    ),
    vc.Reference(
        name="zermelo/walk",
        problem=vc.Problem(crossing_time, vc.Fixed(0, 0), vc.Free(1), parameters={"W": CURRENT}, end_cost=walk),
        exact=crossing(cost=1, weight=2 * COST, walked=COST),
        source=SOURCE,
        statement="The quickest crossing of a river when the way back along the shore is paid for.",
    ),
)
