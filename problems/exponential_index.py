"""Light rays in a medium of exponential index n = n0 exp(-beta y).

    S[y] = integral of n0 exp(-beta y) sqrt(1 + y'^2) dx

With r = exp(-beta y) and the angle beta x it is n0/beta times the length of a
plane curve in polar coordinates. The ray is a straight line there:
y = ln(cos(beta x - phi0)/cos(phi0))/beta from the origin at the angle phi0, at
its top where x = phi0/beta. No ray spans beta x >= pi.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), ch. 1,
problem 4, eq. 1.56.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._arithmetic import exp, log, numbers
from varcalc.problems._curves import PolarLine


def optical_length(x, y, dy, p):
    return p.n0 * ca.exp(-p.beta * y) * ca.sqrt(1 + dy**2)


def ray(across: float, rise: float, beta: float, case: str, statement: str) -> vc.Reference:
    n0 = 1.5

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        scale = number(beta)
        line = PolarLine(number(1), exp(-scale * number(rise)), scale * number(across))
        return n0 / scale * line.length, lambda x: log(line.reciprocal(scale * numbers(x))) / scale

    return vc.Reference(
        name="exponential_index" + case,
        problem=vc.Problem(
            optical_length,
            vc.Fixed(0, 0),
            vc.Fixed(across, rise),
            parameters={"n0": n0, "beta": beta},
            name="exponential_index",
        ),
        exact=vc.Exact.of(form, "logarithm of a cosine"),
        source='Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.56',
        statement=statement,
    )


references = (
    ray(2, 0.5, 0.5, "", "A light ray that rises where the index falls exponentially."),
    ray(2.5, 0, 1, "/arch", "A light ray that climbs high between far points of equal height."),
)
