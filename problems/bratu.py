"""Bratu's problem: a reaction that heats itself, y'' + lambda e^y = 0 with cold ends.

    J[y] = integral of (y'^2/2 - lambda e^y) dx,  y(0) = y(1) = 0.

y = 2 ln(cosh(theta/4)/cosh(theta (2x - 1)/4)), theta = sqrt(2 lambda) cosh(theta/4), and
J = theta^2/2 - 4 theta tanh(theta/4). For lambda < 3.5138... there are two roots; the
smaller gives the stable state, a minimum (a local one: J is unbounded below).

Source: Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value
Problems"; Bratu, Bull. Soc. Math. France 42 (1914).
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._arithmetic import cosh, log1p, numbers, scalar, sinh, sqrt, tanh
from varcalc.problems._curves import FOLD
from varcalc.problems._roots import increasing_root


def functional(x, y, dy, p):
    return dy**2 / 2 - p.rate * ca.exp(y)


def reaction(rate: float, case: str, statement: str) -> vc.Reference:
    def root(h: Any) -> tuple[Any, Any]:
        return h / cosh(h), (1 - h * tanh(h)) / cosh(h)

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        theta = 4 * scalar(increasing_root(root, 0.0, FOLD, sqrt(2 * number(rate)) / 4))

        def y(x: Any) -> Any:
            x = numbers(x)
            # cosh(theta/4) - cosh(theta (2x - 1)/4) as a product, to keep the digits at the ends
            rise = 2 * sinh(theta * x / 4) * sinh(theta * (1 - x) / 4) / cosh(theta * (2 * x - 1) / 4)
            return 2 * log1p(rise)

        return theta**2 / 2 - 4 * theta * tanh(theta / 4), y

    return vc.Reference(
        name="bratu" + case,
        problem=vc.Problem(functional, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"rate": rate}, name="bratu"),
        exact=vc.Exact.of(form, "logarithm of a hyperbolic cosine"),
        source='Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems"',
        statement=statement,
    )


references = (
    reaction(3.0, "", "The stable state of a self-heating reaction between cold walls."),
    reaction(1.0, "/mild", "The stable state of a mildly self-heating reaction between cold walls."),
)
