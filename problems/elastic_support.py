"""A string sprung to a rail whose height is chosen with the curve: an unknown number beside the unknown function.

    J[y, k] = half the integral of (y'^2 + (y - k)^2 + k^2) dx,  y(0) = 0, y(T) = 1,

least in y and in the height k of the rail, which is sprung to the ground.
y'' = y - k, and dJ/dk = 0 says that the integral of y - k equals T k: with
tau = tanh(T/2), k = tau/(T + 2 tau), y = k + ((1 - k) sinh(x) - k sinh(T - x))/sinh(T),
and J = ((k^2 + (1 - k)^2) cosh(T) + 2 k (1 - k))/(2 sinh(T)) + T k^2/2.

Source: Gelfand and Fomin, "Calculus of Variations", sect. 4 for given k;
k by the ordinary derivative.
"""

import math
from typing import Any

import numpy as np

import varcalc as vc

LENGTH = 2.0
HEIGHT = math.tanh(LENGTH / 2) / (LENGTH + 2 * math.tanh(LENGTH / 2))


def energy(x, y, dy, p):
    return (dy**2 + (y - p.k) ** 2 + p.k**2) / 2


def string(x: Any) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    return HEIGHT + ((1 - HEIGHT) * np.sinh(x) - HEIGHT * np.sinh(LENGTH - x)) / math.sinh(LENGTH)


def least_energy() -> float:
    ends = (HEIGHT**2 + (1 - HEIGHT) ** 2) * math.cosh(LENGTH) + 2 * HEIGHT * (1 - HEIGHT)
    return ends / (2 * math.sinh(LENGTH)) + LENGTH * HEIGHT**2 / 2


references = (
    vc.Reference(
        name="elastic_support",
        problem=vc.Problem(energy, vc.Fixed(0, 0), vc.Fixed(LENGTH, 1), unknowns={"k": 0.0}),
        exact=vc.Exact(least_energy(), string, "hyperbolic functions"),
        source='Gelfand and Fomin, "Calculus of Variations", sect. 4',
        statement="A string sprung to a rail that finds its own height.",
        inapplicable={vc.FirstIntegral: "the unknown height adds a condition that no first integral holds"},
    ),
)
