"""The linear regulator: bringing a quantity down at the least cost of its size and its rate.

    J[y] = half the integral of (y^2 + v^2) dx,  v = y',  y(0) = 1.

The Euler-Lagrange equation is y'' = y. With the end free the slope vanishes
there: y = cosh(T - x)/cosh(T), J = tanh(T)/2. With the end cost s y(T)^2/2 it is
-s y: y = (cosh(T - x) + s sinh(T - x))/(cosh(T) + s sinh(T)). With eps v^2 for
v^2, brought to zero, y = sinh(k (1 - x))/sinh(k), k = eps^(-1/2): a boundary layer,
through which an initial-value problem would lose log10(sinh k) digits. Held to a
signal, (y - sin x)^2 for y^2, over N of its periods and with y = 0 at both ends:
y = a sin x, a = 1/(1 + eps), J = (pi/2) N (1 - a).

Source: Bryson and Ho, "Applied Optimal Control", sect. 5.2; Ascher, Mattheij
and Russell, "Numerical Solution of Boundary Value Problems", on singular perturbations.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cos, cosh, exp, expm1, numbers, sin, sinh, sqrt, tanh

SOURCE = 'Bryson and Ho, "Applied Optimal Control", sect. 5.2'
DURATION, PENALTY, THICKNESS = 1.0, 2.0, 1e-2
PERIODS, RATE_COST = 10, 0.4


def cost(x, y, dy):
    return (y**2 + dy**2) / 2


def stiff_cost(x, y, dy, p):
    return (y**2 + p.eps * dy**2) / 2


def tracking_cost(x, y, dy, p):
    return ((y - ca.sin(x)) ** 2 + p.eps * dy**2) / 2


def penalty(x0, y0, x1, y1):
    return PENALTY * y1**2 / 2


def regulated(penalty: float) -> Callable[[Callable[[float], Any]], tuple[Any, Any]]:
    """The cheapest way, of what is left at the end ``penalty`` being paid for."""

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        s, T = number(penalty), number(DURATION)
        c, h = cosh(T), sinh(T)

        def y(x: Any) -> Any:
            left = T - numbers(x)
            return (cosh(left) + s * sinh(left)) / (c + s * h)

        return (h + s * c) / (c + s * h) / 2, y

    return form


def layer(number: Callable[[float], Any]) -> tuple[Any, Any]:
    thickness = sqrt(number(THICKNESS**2))

    def y(x: Any) -> Any:
        x = numbers(x)
        return exp(-x / thickness) * expm1(-2 * (1 - x) / thickness) / expm1(-2 / thickness)

    return thickness / tanh(1 / thickness) / 2, y


def followed(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The share of the signal that is followed, but for what brings the curve to zero at the last double."""
    T, share, rate = number(2 * math.pi * PERIODS), 1 / (1 + number(RATE_COST)), sqrt(number(RATE_COST))
    rest = share * sin(T)
    missed = (1 - share) ** 2 * (T / 2 - sin(2 * T) / 4) / 2
    paid = rate**2 * share**2 * (T / 2 + sin(2 * T) / 4) / 2
    at_end = -(rate**2) * share * cos(T) * rest + rate * rest**2 / tanh(T / rate) / 2

    def y(x: Any) -> Any:
        x = numbers(x)
        return share * sin(x) - rest * sinh(x / rate) / sinh(T / rate)

    return missed + paid + at_end, y


references = (
    vc.Reference(
        name="regulator",
        problem=vc.Problem(cost, vc.Fixed(0, 1), vc.Free(DURATION)),
        exact=vc.Exact.of(regulated(0), "hyperbolic cosine"),
        source=SOURCE,
        statement="The cheapest way to bring a quantity down in a given time.",
    ),
    vc.Reference(
        name="regulator/end_cost",
        problem=vc.Problem(cost, vc.Fixed(0, 1), vc.Free(DURATION), end_cost=penalty),
        exact=vc.Exact.of(regulated(PENALTY), "hyperbolic functions"),
        source=SOURCE,
        statement="The cheapest way to bring a quantity down, what is left being paid for at the end.",
    ),
    vc.Reference(
        name="regulator/layer",
        problem=vc.Problem(stiff_cost, vc.Fixed(0, 1), vc.Fixed(1, 0), parameters={"eps": THICKNESS**2}),
        exact=vc.Exact.of(layer, "hyperbolic sine"),
        source='Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems"',
        statement="A rate so cheap that the quantity drops to zero in a boundary layer.",
    ),
    vc.Reference(
        name="regulator/signal",
        problem=vc.Problem(
            tracking_cost, vc.Fixed(0, 0), vc.Fixed(2 * math.pi * PERIODS, 0), parameters={"eps": RATE_COST}
        ),
        exact=vc.Exact.of(followed, "sine"),
        source=SOURCE,
        statement="Following a signal of ten periods, the rate being paid for.",
        inapplicable=_inapplicable.NOT_IGNORABLE,
    ),
)
