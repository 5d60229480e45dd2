"""Meshes for boundary layers, laid before anything is solved.

Where the linearised Euler-Lagrange equation P h'' = Q h + ... has a large Q / P, its solutions grow and die like
exp(+- r x), r = sqrt(Q / P), and away from the ends only what varies slowly is left. So r at the ends, read off the
starting curve, tells how wide the layers are (Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value
Problems for ODEs", sect. 10.1). Elements that grow away from either end resolve them at one degree at once, which
bisection would take a dozen refinements for.
"""

from __future__ import annotations

import math

import numpy as np

from varcalc.methods.collocation.system import CollocationSystem, Residual

STIFF = 24.0
"""Widths of a layer in the interval from which one polynomial is not enough."""
LAYERED_DEGREE = 18
LAYER_WIDTHS = np.array([8.0, 20.0, 42.0])
"""Widths of a layer at which elements end: polynomials of that degree leave less than round-off of it."""
FURTHEST = 0.4
"""Part of the interval that is given to the layer at one end."""


def layered_vertices(system: CollocationSystem, residual: Residual) -> np.ndarray | None:
    """Vertices for the layers at the ends of a curve known on one element; None where there are none to be seen."""
    form = system.form
    cut = form.conditions.knots or system.space.elements != 1
    if form.order != 1 or form.ends.periodic or cut or any(form.coordinates.singular):
        return None
    a, b = form.span
    rates = growth_rates(system, residual) * (b - a)
    if not math.isfinite(float(rates.sum())):
        return None
    depths = [
        LAYER_WIDTHS[FURTHEST * rate >= LAYER_WIDTHS] / rate if rate >= STIFF else LAYER_WIDTHS[:0]
        for rate in rates[[0, -1]]
    ]
    inner = np.concatenate([depths[0], 1.0 - depths[1][::-1]])
    return np.concatenate([[a], a + (b - a) * inner, [b]]) if len(inner) else None


def growth_rates(system: CollocationSystem, residual: Residual) -> np.ndarray:
    """The fastest growth rate (points,) of solutions of the linearised equation at the collocation points.

    What does not grow but oscillates has the rate zero.
    """
    n = system.counts.functions
    jacobian = system.pointwise_jacobian(residual)[0, :, :n]
    stiffness, inertia = jacobian[:, :, :n], -jacobian[:, :, 2 * n : 3 * n]
    if n == 1:
        with np.errstate(all="ignore"):
            squares = (stiffness / inertia)[:, 0, 0]
    else:
        try:
            squares = np.linalg.eigvals(np.linalg.solve(inertia, stiffness)).real.max(1)
        except np.linalg.LinAlgError:
            return np.zeros(len(jacobian))
    return np.sqrt(np.maximum(squares, 0.0))
