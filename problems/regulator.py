"""The linear regulator: bringing a quantity down at the least cost of its size and its rate.

    J[y] = half the integral of (y^2 + v^2) dx,  v = y',  y(0) = 1.

The Euler-Lagrange equation is y'' = y. With the end free the slope vanishes
there: y = cosh(T - x)/cosh(T), J = tanh(T)/2. With the end cost s y(T)^2/2 it is
-s y: y = (cosh(T - x) + s sinh(T - x))/(cosh(T) + s sinh(T)). With eps v^2 for
v^2, brought to zero, y = sinh(k (1 - x))/sinh(k), k = eps^(-1/2): a boundary layer,
through which an initial-value problem would lose log10(sinh k) digits. Held to a
signal, (y - sin(w x))^2 for y^2, with w a multiple of 2 pi and y = 0 at both ends:
y = a sin(w x), a = 1/(1 + eps w^2), J = (1 - a)/4.

Source: Bryson and Ho, "Applied Optimal Control", sect. 5.2; Ascher, Mattheij
and Russell, "Numerical Solution of Boundary Value Problems", on singular perturbations.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Bryson and Ho, "Applied Optimal Control", sect. 5.2'
DURATION, PENALTY, THICKNESS = 1.0, 2.0, 1e-2
PERIODS = 10
SHARE = 1 / (1 + (2 * math.pi * PERIODS * THICKNESS) ** 2)
"""Of the signal's amplitude, what is followed."""


def cost(x, y, dy):
    return (y**2 + dy**2) / 2


def stiff_cost(x, y, dy, p):
    return (y**2 + p.eps * dy**2) / 2


def tracking_cost(x, y, dy, p):
    return ((y - ca.sin(2 * ca.pi * PERIODS * x)) ** 2 + p.eps * dy**2) / 2


def penalty(x0, y0, x1, y1):
    return PENALTY * y1**2 / 2


def regulated(x: Any, s: float) -> np.ndarray:
    left = DURATION - np.asarray(x, dtype=float)
    return (np.cosh(left) + s * np.sinh(left)) / (math.cosh(DURATION) + s * math.sinh(DURATION))


def least_cost(s: float) -> float:
    c, h = math.cosh(DURATION), math.sinh(DURATION)
    return (h + s * c) / (c + s * h) / 2


def layer(x: Any) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    return np.exp(-x / THICKNESS) * np.expm1(-2 * (1 - x) / THICKNESS) / math.expm1(-2 / THICKNESS)


def followed(x: Any) -> np.ndarray:
    # sin(w x) by the distance from the nearest half period, which keeps all digits
    halves = 2 * PERIODS * np.asarray(x, dtype=float)
    nearest = np.round(halves)
    return SHARE * np.where(nearest % 2, -1.0, 1.0) * np.sin(math.pi * (halves - nearest))


references = (
    vc.Reference(
        name="regulator",
        problem=vc.Problem(cost, vc.Fixed(0, 1), vc.Free(DURATION)),
        exact=vc.Exact(least_cost(0), lambda x: regulated(x, 0), "hyperbolic cosine"),
        source=SOURCE,
        statement="The cheapest way to bring a quantity down in a given time.",
    ),
    vc.Reference(
        name="regulator/end_cost",
        problem=vc.Problem(cost, vc.Fixed(0, 1), vc.Free(DURATION), end_cost=penalty),
        exact=vc.Exact(least_cost(PENALTY), lambda x: regulated(x, PENALTY), "hyperbolic functions"),
        source=SOURCE,
        statement="The cheapest way to bring a quantity down, what is left being paid for at the end.",
    ),
    vc.Reference(
        name="regulator/layer",
        problem=vc.Problem(stiff_cost, vc.Fixed(0, 1), vc.Fixed(1, 0), parameters={"eps": THICKNESS**2}),
        exact=vc.Exact(THICKNESS / math.tanh(1 / THICKNESS) / 2, layer, "hyperbolic sine"),
        source='Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems"',
        statement="A rate so cheap that the quantity drops to zero in a boundary layer.",
    ),
    vc.Reference(
        name="regulator/signal",
        problem=vc.Problem(tracking_cost, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"eps": THICKNESS**2}),
        exact=vc.Exact((1 - SHARE) / 4, followed, "sine"),
        source=SOURCE,
        statement="Following a signal of ten periods, the rate being paid for.",
        inapplicable=_inapplicable.NOT_IGNORABLE,
    ),
)
