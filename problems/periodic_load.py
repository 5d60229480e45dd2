"""A periodic curve: an endless string on springs under a periodic load.

    U[y] = half the integral of (y'^2 + k y^2 - 2 f y) dx over a period,
    f = cos(x) + sin(2x).

y'' = k y - f is solved term by term: y = cos(x)/(k + 1) + sin(2x)/(k + 4), and
U = -(1/(k + 1) + 1/(k + 4)) pi/2.

Source: Courant and Hilbert, "Methods of Mathematical Physics", vol. I, ch. IV.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cos, numbers, pi, sin

STIFFNESS = 2.0
PERIOD = vc.Periodic(0, 2 * math.pi)


def energy(x, y, dy, p):
    return (dy**2 + p.k * y**2) / 2 - (ca.cos(x) + ca.sin(2 * x)) * y


def string(number: Callable[[float], Any]) -> tuple[Any, Any]:
    k = number(STIFFNESS)
    return -(1 / (k + 1) + 1 / (k + 4)) * pi(k) / 2, lambda x: cos(x) / (k + 1) + sin(2 * numbers(x)) / (k + 4)


references = (
    vc.Reference(
        name="periodic_load",
        problem=vc.Problem(energy, PERIOD, PERIOD, parameters={"k": STIFFNESS}),
        exact=vc.Exact.of(string, "Fourier series of two terms"),
        source='Courant and Hilbert, "Methods of Mathematical Physics", vol. I, ch. IV',
        statement="The periodic shape of an endless string on springs under a periodic load.",
        inapplicable=_inapplicable.NOT_IGNORABLE,
    ),
)
