"""A string sprung to a rail whose height is chosen with the curve: an unknown number beside the unknown function.

    J[y, k] = half the integral of (y'^2 + (y - k)^2 + k^2) dx,  y(0) = 0, y(T) = 1,

least in y and in the height k of the rail, which is sprung to the ground.
y'' = y - k, and dJ/dk = 0 says that the integral of y - k equals T k: with
tau = tanh(T/2), k = tau/(T + 2 tau), y = k + ((1 - k) sinh(x) - k sinh(T - x))/sinh(T),
and J = ((k^2 + (1 - k)^2) cosh(T) + 2 k (1 - k))/(2 sinh(T)) + T k^2/2.

Source: Gelfand and Fomin, "Calculus of Variations", sect. 4 for given k;
k by the ordinary derivative.
"""

from collections.abc import Callable
from typing import Any

import varcalc as vc
from varcalc.problems._arithmetic import cosh, numbers, sinh, tanh

LENGTH = 2.0


def energy(x, y, dy, p):
    return (dy**2 + (y - p.k) ** 2 + p.k**2) / 2


def string(number: Callable[[float], Any]) -> tuple[Any, Any]:
    T = number(LENGTH)
    k = tanh(T / 2) / (T + 2 * tanh(T / 2))

    def y(x: Any) -> Any:
        x = numbers(x)
        return k + ((1 - k) * sinh(x) - k * sinh(T - x)) / sinh(T)

    ends = (k**2 + (1 - k) ** 2) * cosh(T) + 2 * k * (1 - k)
    return ends / (2 * sinh(T)) + T * k**2 / 2, y


references = (
    vc.Reference(
        name="elastic_support",
        problem=vc.Problem(energy, vc.Fixed(0, 0), vc.Fixed(LENGTH, 1), unknowns={"k": 0.0}),
        exact=vc.Exact.of(string, "hyperbolic functions"),
        source='Gelfand and Fomin, "Calculus of Variations", sect. 4',
        statement="A string sprung to a rail that finds its own height.",
        inapplicable={vc.FirstIntegral: "the unknown height adds a condition that no first integral holds"},
    ),
)
