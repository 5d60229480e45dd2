"""Refraction at plane interfaces: an index that jumps in x.

    S[y] = integral of n(x) sqrt(1 + y'^2) dx,  n constant in each layer,

is least on a broken line with n sin(theta) = n y'/sqrt(1 + y'^2) the same in all
layers: Snell's law, which the corner condition of Weierstrass and Erdmann
yields. With u = tan(theta) in the layer of least index n', tan(theta) is
n' u/sqrt(n^2 + (n^2 - n'^2) u^2) in the others, and u follows from the ends.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.28;
Gelfand and Fomin, "Calculus of Variations", sect. 15.
"""

from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._roots import increasing_root

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.28'


def glass(x, y, dy):
    return ca.if_else(x < 0, 1, 1.5) * ca.sqrt(1 + dy**2)


def plate(x, y, dy):
    return ca.if_else(x < 0, 1, ca.if_else(x < 0.5, 1.75, 1.25)) * ca.sqrt(1 + dy**2)


def snell(edges: tuple[float, ...], indices: tuple[float, ...], rise: float) -> vc.Exact:
    """The ray from (edges[0], 0) to (edges[-1], rise) through layers of the given indices."""
    widths, n = np.diff(edges), np.array(indices)
    least = n.min()

    def tangents(u: Any) -> np.ndarray:
        return least * u / np.sqrt(n**2 + (n**2 - least**2) * u**2)

    def height(u: np.ndarray) -> tuple[Any, Any]:
        slopes = least * n**2 / (n**2 + (n**2 - least**2) * u**2) ** 1.5
        return widths @ tangents(u), widths @ slopes

    steepest = rise / widths[n == least].sum()
    tangent = tangents(increasing_root(height, 0.0, steepest, rise))
    corners = np.concatenate([[0.0], np.cumsum(widths * tangent)])
    return vc.Exact(
        float(np.sum(n * widths * np.sqrt(1 + tangent**2))), lambda x: np.interp(x, edges, corners), "broken line"
    )


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
