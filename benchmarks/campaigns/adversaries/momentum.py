"""Least values of convex functionals whose force does not depend on y: the momentum is known but for a constant.

For L = phi(x, v) - f(x) y the equation of Euler and Lagrange says that the momentum is C - F with F' = f, and

    min J = max over C of  C (y1 - y0) - integral of phi*(x, C - F) - F(x1) y1,   F(x0) = 0,

phi* being the convex conjugate in v (Ekeland and Temam, "Convex Analysis and Variational Problems" (1976), chap. III).
With a phi that is not convex the same is the infimum, phi and its convex hull having the same conjugate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

Function = Callable[[Any], Any]
ORDER = 24
NODES, WEIGHTS = np.polynomial.legendre.leggauss(ORDER)
REACHES = np.array([-9, -6.5, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6.5, 9])
"""Where a Gaussian is cut into pieces that Gauss's rule resolves, in its widths."""


def rule(points: Sequence[float], panels: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Abscissae and weights of Gauss's rule on each of so many panels of every piece between sorted points."""
    ends = np.unique(np.asarray(points, dtype=float))
    edges = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(panels) / panels).ravel(), ends[-1])
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + NODES)).ravel(), (half * WEIGHTS).ravel()


def pieces(a: float, b: float, inside: Sequence[float], panels: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """The rule from a to b with breaks at the points that lie inside."""
    return rule([a, b, *(x for x in inside if a < x < b)], panels)


def about(centre: float, width: float) -> tuple[float, ...]:
    """The points that cut a Gaussian of so great a width into pieces."""
    return tuple(centre + width * REACHES)


def quadratic(
    integrals: tuple[float, float, float], impulse: float, y0: float | None, y1: float | None
) -> float:  # fmt: skip
    """The least integral of p v^2/2 - f y, from the integrals of 1/p, F/p and F^2/p and from F(x1).

    An end where y is None is free: the momentum vanishes there, so that C is known. If both were, y would be too little
    held for a minimum.
    """
    one, first, second = integrals
    if y1 is None:
        assert y0 is not None
        C = impulse
        y1 = y0 + C * one - first
    elif y0 is None:
        C = 0.0
    else:
        C = (y1 - y0 + first) / one
    return C**2 * one / 2 - second / 2 - impulse * y1


def weighted(stiffness: Function, impulse: Function, x: np.ndarray, weights: np.ndarray) -> tuple[float, float, float]:
    """The integrals of 1/p, F/p and F^2/p."""
    p, F = stiffness(x), impulse(x)
    return float(weights @ (1 / p)), float(weights @ (F / p)), float(weights @ (F**2 / p))


def dual(
    conjugate: Function, slope: Function, rise: float, x: np.ndarray, weights: np.ndarray, impulse: np.ndarray,
    reach: float,
) -> float:  # fmt: skip
    """The maximum over C of C rise - integral of phi*(C - F); ``slope`` is (phi*)', ``reach`` bounds |C|."""
    C = brentq(lambda C: rise - float(weights @ slope(C - impulse)), -reach, reach, xtol=1e-14, rtol=1e-14)
    return C * rise - float(weights @ conjugate(C - impulse))
