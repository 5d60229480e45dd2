"""Bratu's problem: a reaction that heats itself, y'' + lambda e^y = 0 with cold ends.

    J[y] = integral of (y'^2/2 - lambda e^y) dx,  y(0) = y(1) = 0.

y = 2 ln(cosh(theta/4)/cosh(theta (2x - 1)/4)), theta = sqrt(2 lambda) cosh(theta/4), and
J = theta^2/2 - 4 theta tanh(theta/4). For lambda < 3.5138... there are two roots; the
smaller gives the stable state, a minimum (a local one: J is unbounded below).

Source: Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value
Problems"; Bratu, Bull. Soc. Math. France 42 (1914).
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._curves import FOLD
from varcalc.problems._roots import increasing_root


def functional(x, y, dy, p):
    return dy**2 / 2 - p.rate * ca.exp(y)


def reaction(rate: float, case: str, statement: str) -> vc.Reference:
    def root(h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return h / np.cosh(h), (1 - h * np.tanh(h)) / np.cosh(h)

    theta = 4 * float(increasing_root(root, 0.0, FOLD, math.sqrt(2 * rate) / 4))

    def y(x: Any) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        # cosh(theta/4) - cosh(theta (2x - 1)/4) as a product, to keep the digits at the ends
        rise = 2 * np.sinh(theta * x / 4) * np.sinh(theta * (1 - x) / 4) / np.cosh(theta * (2 * x - 1) / 4)
        return 2 * np.log1p(rise)

    return vc.Reference(
        name="bratu" + case,
        problem=vc.Problem(functional, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"rate": rate}, name="bratu"),
        exact=vc.Exact(theta**2 / 2 - 4 * theta * math.tanh(theta / 4), y, "logarithm of a hyperbolic cosine"),
        source='Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems"',
        statement=statement,
    )


references = (
    reaction(3.0, "", "The stable state of a self-heating reaction between cold walls."),
    reaction(1.0, "/mild", "The stable state of a mildly self-heating reaction between cold walls."),
)
