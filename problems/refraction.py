"""Refraction at plane interfaces: an index that jumps in x.

    S[y] = integral of n(x) sqrt(1 + y'^2) dx,  n constant in each layer,

is least on a broken line with n sin(theta) = n y'/sqrt(1 + y'^2) the same in all
layers: Snell's law, which the corner condition of Weierstrass and Erdmann
yields. With u = tan(theta) in the layer of least index n', tan(theta) is
n' u/sqrt(n^2 + (n^2 - n'^2) u^2) in the others, and u follows from the ends.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.28;
Gelfand and Fomin, "Calculus of Variations", sect. 15.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._arithmetic import greatest, numbers, scalar, sqrt
from varcalc.problems._arithmetic import least as least_of
from varcalc.problems._roots import increasing_root

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.28'


def glass(x, y, dy):
    return ca.if_else(x < 0, 1, 1.5) * ca.sqrt(1 + dy**2)


def plate(x, y, dy):
    return ca.if_else(x < 0, 1, ca.if_else(x < 0.5, 1.75, 1.25)) * ca.sqrt(1 + dy**2)


def snell(edges: tuple[float, ...], indices: tuple[float, ...], rise: float) -> vc.Exact:
    """The ray from (edges[0], 0) to (edges[-1], rise) through layers of the given indices."""
    least = min(indices)

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        widths = [number(b) - number(a) for a, b in pairwise(edges)]
        layers = list(zip(widths, map(number, indices), strict=True))

        def tangent(n: Any, u: Any) -> Any:
            return least * u / sqrt(n**2 + (n**2 - least**2) * u**2)

        def height(u: Any) -> tuple[Any, Any]:
            slopes = [w * least * n**2 / (n**2 + (n**2 - least**2) * u**2) ** 1.5 for w, n in layers]
            return sum(w * tangent(n, u) for w, n in layers), sum(slopes)

        steepest = rise / sum(w for w, n in layers if n == least)
        u = scalar(increasing_root(height, 0 * steepest, steepest, rise))

        def y(x: Any) -> Any:
            x = numbers(x)
            # what is passed of each layer
            passed = [greatest(0 * x, least_of(x, b + 0 * x) - a) for a, b in pairwise(edges)]
            return sum(part * tangent(n, u) for part, (_, n) in zip(passed, layers, strict=True))

        return scalar(sum(n * w * sqrt(1 + tangent(n, u) ** 2) for w, n in layers)), y

    return vc.Exact.of(form, "broken line")


references = (
    vc.Reference(
        name="refraction",
        problem=vc.Problem(glass, vc.Fixed(-1, 0), vc.Fixed(1, 2), breakpoints=(0,)),
        exact=snell((-1, 0, 1), (1, 1.5), 2),
        source=SOURCE,
        statement="The light ray from air into glass.",
    ),
    vc.Reference(
        name="refraction/plate",
        problem=vc.Problem(plate, vc.Fixed(-1, 0), vc.Fixed(2, 3), breakpoints=(0, 0.5)),
        exact=snell((-1, 0, 0.5, 2), (1, 1.75, 1.25), 3),
        source=SOURCE,
        statement="The light ray through a plate of glass into a liquid.",
    ),
)
