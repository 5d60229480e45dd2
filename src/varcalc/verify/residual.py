"""How far a curve is from satisfying the Euler-Lagrange equation.

In du Bois-Reymond's integrated form no more derivatives are asked of the curve
than the functional has: L_y' - integral of L_y is constant along an extremal,
at second order L_y'' - integral of (L_y' - integral of L_y) is a linear function
(Gelfand and Fomin, "Calculus of Variations", sect. 3 and 11).
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import antiderivative, gauss
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve

POINTS = 24
"""Gauss points an element."""
FAINT = 1e-8
"""Momentum in units of H / slope, the slope that of the curve's chords, below which it is as good as zero."""
EDGE = 0.1
"""Part of the interval beside each singular end that is left out in coordinates that are singular there."""


def residual(along: AlongCurve, singular: bool = False) -> float:
    """The largest departure of the integrated equation from a constant (a linear function), relative to its terms.

    ``singular`` tells that the coordinates may be so at the ends, which are then left out.
    """
    s = along.symbols
    H = along.whole.expression
    if singular:
        along = _inside(along)
    gradients = [ca.gradient(H, v) for v in (s.y, *s.slopes)]
    nodes, weights = along.rule(POINTS)
    whole, *values = (v[:, :, 0] for v in along.function(H, *gradients)(nodes))
    total, size = values[0], np.zeros(1)
    for term in values[1:]:
        integral = _running(total, along.vertices)
        size = size + np.abs(integral).max(0) + np.abs(term).max(0)
        total = term - integral
    marks = [along.span[0], *(at for at, _ in along.form.conditions.waypoints), along.span[1]]
    worst = 0.0
    for left, right in itertools.pairwise(marks):
        inside = (nodes > left) & (nodes < right)
        powers = (nodes[inside, None] - left) ** np.arange(along.order) / along.length ** np.arange(along.order)
        root = np.sqrt(weights[inside, None])
        fitted = powers @ np.linalg.lstsq(powers * root, total[inside] * root, rcond=None)[0]
        worst = max(worst, float(np.abs(total[inside] - fitted).max()))
    # terms that are what is left when larger ones cancel say nothing, however they compare with one another
    cancelled = FAINT * float(along.function(felt(along))(nodes)[0].max())
    # a function the Lagrangian hardly feels is measured by those it does feel
    extent = float(np.abs(along.evaluate(nodes, 0)).max()) or along.length
    faint = FAINT * float(np.abs(whole).max()) * along.length**along.order / extent
    return worst / max(float(size.max()), faint, cancelled, 1e-300)


def felt(along: AlongCurve) -> Expression:
    """What the momentum would be made of if nothing cancelled: the sum of abs(H_y'y y) and abs(H_y'y' y'), (n,)."""
    s = along.symbols
    variables = ca.vertcat(s.y, *s.slopes)
    momentum = ca.gradient(along.whole.expression, s.slopes[-1])
    return ca.mtimes(ca.fabs(ca.jacobian(momentum, variables)), ca.fabs(variables))


def _inside(along: AlongCurve) -> AlongCurve:
    """The same functional away from the ends of its interval."""
    a, b = along.span
    low, high = a + EDGE * (b - a), b - EDGE * (b - a)
    inner = along.vertices[(along.vertices > low) & (along.vertices < high)]
    return replace(along, span=(low, high), vertices=np.concatenate([[low], inner, [high]]))


def _running(values: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Integrals from the first vertex to the Gauss points of values there, both (points, n)."""
    nodes, weights = gauss(POINTS)
    inner = np.polynomial.legendre.legvander(nodes, POINTS) @ antiderivative(POINTS)
    half = 0.5 * np.diff(vertices)[:, None, None]
    shaped = values.reshape(len(vertices) - 1, POINTS, -1)
    whole = half[:, 0] * np.einsum("q,eqa->ea", weights, shaped)
    before = np.concatenate([np.zeros((1, whole.shape[1])), np.cumsum(whole, axis=0)[:-1]])
    return (before[:, None] + half * (inner @ shaped)).reshape(values.shape)
