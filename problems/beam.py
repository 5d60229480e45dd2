"""Elastic beams under load and tension: functionals of the second derivative.

    U[y] = integral of (E I y''^2/2 - w y) dx

for the deflection y of a beam of stiffness E I = B under a uniform load w. From
B y'''' = w: clamped at both ends y = w x^2 (1 - x)^2/(24 B), U = -w^2/(1440 B);
simply supported, where the slopes are free and the moment B y'' vanishes
naturally, y = w x (1 - 2x^2 + x^3)/(24 B), U = -w^2/(240 B); as a cantilever
y = w x^2 (6 - 4x + x^2)/(24 B), U = -w^2/(40 B). A beam under tension,
half the integral of y''^2 + k^2 y'^2, clamped horizontally at heights 0 and 1:
y' is 1 - cosh(k (x - 1/2))/cosh(k/2) up to a factor, U = k^2/(2 - 4 tanh(k/2)/k).

Source: Landau and Lifshitz, "Theory of Elasticity", sect. 20, problems 1-3;
Courant and Hilbert, "Methods of Mathematical Physics", vol. I, ch. IV.
"""

from collections.abc import Callable
from typing import Any

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cosh, numbers, sinh, tanh

SOURCE = 'Landau and Lifshitz, "Theory of Elasticity", sect. 20'
STIFFNESS, LOAD, TENSION = 2.0, 3.0, 5.0


def energy(x, y, dy, ddy, p):
    return p.B * ddy**2 / 2 - p.w * y


def energy_under_tension(x, y, dy, ddy, p):
    return (ddy**2 + (p.k * dy) ** 2) / 2


def beam(start: Any, end: Any, shape: Callable[[Any], Any], divisor: float, case: str, statement: str) -> vc.Reference:
    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        value = -(number(LOAD) ** 2) / (divisor * STIFFNESS)
        return value, lambda x: number(LOAD) / (24 * STIFFNESS) * shape(numbers(x))

    return vc.Reference(
        name="beam" + case,
        problem=vc.Problem(energy, start, end, order=2, parameters={"B": STIFFNESS, "w": LOAD}, name="beam"),
        exact=vc.Exact.of(form, "polynomial"),
        source=SOURCE,
        statement=statement,
        inapplicable=_inapplicable.SECOND_ORDER,
        downward=True,
    )


def under_tension(number: Callable[[float], Any]) -> tuple[Any, Any]:
    k = number(TENSION)
    shear = k**2 / (1 - 2 * tanh(k / 2) / k)

    def y(x: Any) -> Any:
        x = numbers(x)
        bend = 2 * sinh(k * x / 2) * cosh(k * (1 - x) / 2) / (k * cosh(k / 2))
        return shear / k**2 * (x - bend)

    return shear / 2, y


references = (
    beam(
        vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), lambda x: (x * (1 - x)) ** 2, 1440, "",
        "A beam clamped at both ends under a uniform load.",
    ),
    beam(
        vc.Fixed(0, 0), vc.Fixed(1, 0), lambda x: x * (1 - x) * (1 + x * (1 - x)), 240, "/supported",
        "A simply supported beam under a uniform load: both slopes free.",
    ),
    beam(
        vc.Fixed(0, 0, 0), vc.Free(1), lambda x: x**2 * (6 - 4 * x + x**2), 40, "/cantilever",
        "A cantilever under a uniform load: one end clamped, the other free.",
    ),
    vc.Reference(
        name="beam/tension",
        problem=vc.Problem(
            energy_under_tension, vc.Fixed(0, 0, 0), vc.Fixed(1, 1, 0), order=2, parameters={"k": TENSION}
        ),
        exact=vc.Exact.of(under_tension, "hyperbolic functions"),
        source=SOURCE,
        statement="A beam under tension between two horizontal clamps of different height.",
        inapplicable=_inapplicable.SECOND_ORDER,
    ),
)  # fmt: skip
