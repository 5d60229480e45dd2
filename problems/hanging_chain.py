"""The hanging chain of given length.

A chain of length l hangs between two points; its potential energy

    U[y] = integral of y sqrt(1 + y'^2) dx,  with  integral of sqrt(1 + y'^2) dx = l,

is least on a catenary y = c cosh((x - b)/c) + k. With h = D/(2c) for ends D
apart and H different in height: sinh(h)/h = sqrt(l^2 - H^2)/D, and the middle
lies where tanh((x - b)/c) = H/l. The energy about the height of the start is
H l/2 - c^2 (sinh 2h - 2h)/2. An end that is free on a vertical pole is
horizontal there: half of the symmetric chain.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), problem 3
of ch. 1 (which fixes the poles so that k = 0); Gelfand and Fomin, "Calculus of
Variations", sect. 12.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._curves import Catenary

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), ch. 1, problem 3'


def energy(x, y, dy):
    return y * ca.sqrt(1 + dy**2)


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def chain(span: float, rise: float, length: float, case: str, statement: str) -> vc.Reference:

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        catenary = Catenary.of_length(number(0), number(span), number(rise), number(length))
        return catenary.moment_about_start, catenary.above_start

    return vc.Reference(
        name="hanging_chain" + case,
        problem=vc.Problem(
            energy,
            vc.Fixed(0, 0),
            vc.Fixed(span, rise),
            [vc.Isoperimetric(arc_length, length)],
            name="hanging_chain",
        ),
        exact=vc.Exact.of(form, "catenary"),
        source=SOURCE,
        statement=statement,
    )


def half(number: Callable[[float], Any]) -> tuple[Any, Any]:
    whole = Catenary.of_length(number(0), number(2), number(0), number(3))
    return whole.moment_about_start / 2, whole.above_start


references = (
    chain(1, 0, 1.5, "", "A chain half as long again as its span."),
    chain(2, 1, 3, "/unequal", "A chain between points of different height."),
    chain(1, 0, 1.01, "/shallow", "A chain one hundredth longer than its span."),
    chain(1, 0, 1.0001, "/taut", "A chain one ten-thousandth longer than its span."),
    vc.Reference(
        name="hanging_chain/sliding",
        problem=vc.Problem(
            energy, vc.Fixed(0, 0), vc.Free(1), [vc.Isoperimetric(arc_length, 1.5)], name="hanging_chain"
        ),
        exact=vc.Exact.of(half, "half a catenary"),
        source=SOURCE,
        statement="A chain whose right end slides on a vertical pole.",
    ),
)
