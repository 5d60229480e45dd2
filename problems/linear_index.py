"""Light rays in a medium of linear index n = n0 (1 - beta y).

    S[y] = integral of n0 (1 - beta y) sqrt(1 + y'^2) dx

In X = beta x and u = 1 - beta y it is (n0/beta) times the integral of
u sqrt(1 + u'^2) dX, so that the ray is a catenary hanging upside down from
n = 0: y = 1/beta - (cos(phi0)/beta) cosh(beta x/cos(phi0) - ln(sec(phi0) +
tan(phi0))) from the origin at the angle phi0. Of the two between given points
the lower is the shorter.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005),
sect. 1.3.3, eq. 1.36-1.38.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._arithmetic import numbers
from varcalc.problems._curves import Catenary


def optical_length(x, y, dy, p):
    return p.n0 * (1 - p.beta * y) * ca.sqrt(1 + dy**2)


def ray(across: float, rise: float, beta: float, case: str, statement: str) -> vc.Reference:
    n0 = 1.5

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        scale = number(beta)
        catenary = Catenary.over_axis((number(0), number(1)), (scale * across, 1 - scale * number(rise)))
        path = n0 / scale * catenary.moment_about_axis
        return path, lambda x: -catenary.above_start(scale * numbers(x)) / scale

    return vc.Reference(
        name="linear_index" + case,
        problem=vc.Problem(
            optical_length,
            vc.Fixed(0, 0),
            vc.Fixed(across, rise),
            parameters={"n0": n0, "beta": beta},
            name="linear_index",
        ),
        exact=vc.Exact.of(form, "catenary"),
        source='Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.36-1.38',
        statement=statement,
    )


references = (
    ray(1, 0, 1, "", "A light ray between points of equal height, under an index that falls linearly."),
    ray(1, 0.4, 0.5, "/rising", "A light ray that rises where the index falls linearly."),
)
