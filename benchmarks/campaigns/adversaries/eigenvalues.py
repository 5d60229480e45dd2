"""Rayleigh quotients: v^2 + V(x) y^2 with the integral of y^2 given, of which the least value is an eigenvalue.

-y'' + V y = e y with y = 0 at both ends is solved by Galerkin's method with integrated Legendre polynomials (Shen,
"Efficient spectral-Galerkin method I", SIAM J. Sci. Comput. 15 (1994)), whose eigenvalues lie above the true ones and
fall to them geometrically; with two thirds of the polynomials they have to be the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import eigh

import varcalc as vc
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

DEGREE, POINTS = 180, 400
KNOWN = 1e-10
"""Relative change of an eigenvalue, with half again the polynomials, that is its error."""


def least_eigenvalue(V: Callable[[np.ndarray], np.ndarray], a: float, b: float, degree: int = DEGREE) -> float:
    """The least eigenvalue e on (a, b), as the greatest 1/(e + s): that of a matrix near the unit one, to round-off."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    P = np.polynomial.legendre.legvander(nodes, degree)
    k = np.arange(degree - 1)
    scale = np.sqrt(4 * k + 6)
    basis, slope = (P[:, :-2] - P[:, 2:]) / scale, -(2 * k + 3) * P[:, 1:-1] / scale
    half = (b - a) / 2
    at = V((a + b) / 2 + half * nodes)
    shift = 1 - at.min()
    stiffness = (slope.T * weights) @ slope / half + half * (basis.T * (weights * (at + shift))) @ basis
    mass = half * (basis.T * weights) @ basis
    last = degree - 2
    return float(1 / eigh(mass, stiffness, subset_by_index=[last, last], eigvals_only=True)[0] - shift)


def _quotient(
    V: Callable[[Any], Any], sampled: Callable[[np.ndarray], np.ndarray], a: float, b: float, norm: float
) -> Statement:  # fmt: skip
    value, before = least_eigenvalue(sampled, a, b), least_eigenvalue(sampled, a, b, 2 * DEGREE // 3)
    if abs(before - value) > KNOWN * max(1.0, abs(value)):
        raise ArithmeticError(f"the least eigenvalue is not resolved: {before} and {value}")
    L: Integrand = lambda x, y, v: v**2 + V(x) * y**2  # noqa: E731
    of = vc.Isoperimetric(lambda x, y, v: y**2, norm)
    return Statement(L, (a, 0.0), (b, 0.0), Least(norm * value, within=2 * KNOWN * norm * max(1.0, abs(value))), (of,))


def oscillating(random: np.random.Generator) -> Statement:
    """A harmonic oscillator on (-8, 8), and Mathieu's equation, V = q cos(m x + phi)."""
    norm = random.uniform(0.5, 2)
    if random.uniform() < 0.5:
        w, x0 = random.uniform(0.5, 2), random.uniform(-2, 2)
        return _quotient(lambda x: (w * (x - x0)) ** 2, lambda x: (w * (x - x0)) ** 2, -8.0, 8.0, norm)
    q, m, phi = random.uniform(-20, 20), int(random.integers(1, 5)), random.uniform(0, math.pi)
    return _quotient(lambda x: q * ca.cos(m * x + phi), lambda x: q * np.cos(m * x + phi), 0.0, 2 * math.pi, norm)


def wells(random: np.random.Generator) -> Statement:
    """One or two Gaussian wells in a box, the two alike or nearly: the lowest two eigenvalues lie close together."""
    norm, w = random.uniform(0.5, 2), random.uniform(0.5, 1.2)
    depth = np.array([1.0, 1.0 - 10 ** random.uniform(-4, 0)]) * -random.uniform(2, 20)
    places = np.array([-1.0, 1.0]) * random.uniform(1, 3)

    def V(x: Any, exp: Callable[[Any], Any]) -> Any:
        return sum(float(d) * exp(-(((x - float(c)) / w) ** 2)) for d, c in zip(depth, places, strict=True))

    return _quotient(lambda x: V(x, ca.exp), lambda x: V(x, np.exp), -6.0, 6.0, norm)
