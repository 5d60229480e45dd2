"""Light rays in n^2 = 1 - 2y: the parabolas of thrown stones.

    S[y] = integral of sqrt(1 - 2y) sqrt(1 + y'^2) dx

With dsigma = ds/n the ray equation is r'' = grad(n^2)/2 = (0, -1): free fall,
as Maupertuis's principle says for a stone. To a point (X, Y), d from the
origin, two rays arrive at sigma^2 = 2 (b -+ sqrt(b^2 - d^2)), b = 1 - Y, one
at the fold b = d and none beyond; the low one is a minimum, and S, the
integral of n^2 dsigma, is exact by Simpson's rule.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 2.1.2
(Jacobi's principle); Born and Wolf, "Principles of Optics", sect. 3.2.1.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._arithmetic import numbers, sqrt


def optical_length(x, y, dy):
    return ca.sqrt(1 - 2 * y) * ca.sqrt(1 + dy**2)


def ray(X: float, Y: float, case: str, statement: str) -> vc.Reference:
    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        across, up = number(X), number(Y)
        square, b = across**2 + up**2, 1 - up
        sigma = sqrt(2 * square / (b + sqrt(b**2 - square)))
        middle = up / 2 + sigma**2 / 8

        def y(x: Any) -> Any:
            x = numbers(x)
            return up * x / across + (sigma / across) ** 2 * x * (across - x) / 2

        return sigma * (1 + 4 * (1 - 2 * middle) + (1 - 2 * up)) / 6, y

    return vc.Reference(
        name="parabolic_ray" + case,
        problem=vc.Problem(optical_length, vc.Fixed(0, 0), vc.Fixed(X, Y), name="parabolic_ray"),
        exact=vc.Exact.of(form, "parabola"),
        source='Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 2.1.2',
        statement=statement,
    )


references = (
    ray(0.5, 0, "", "The low ray between points of equal height in n^2 = 1 - 2y; it leaves at 15 degrees."),
    ray(0.5, 0.2, "/rising", "The low ray to a higher point in n^2 = 1 - 2y."),
)
