"""Derivatives of the optical path between two points in the parameters of the media and surfaces.

By Fermat's principle the ray itself need not be varied: what is left of the
change of S = ∫ n ds is ∫ ∂n/∂p ds along the ray, in the ray's own parameter
half the integral of ∂(n²)/∂p (Born and Wolf, "Principles of Optics",
sect. 3.3.2; the "Fréchet kernel" of travel-time tomography, Aki and Richards,
"Quantitative Seismology", sect. 13.3.2). A surface that moves adds the jump of
the momentum, which stands at right angles to it, times its displacement.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import gauss
from varcalc.optics.media.medium import Medium
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Surface
from varcalc.symbolic.evaluation import PointEvaluator

NODE_COUNTS = tuple(2**k for k in range(5, 12))
"""Numbers of Gauss-Legendre nodes on a leg, one tried after the other until two agree."""
AGREED_WITHIN = 1e-14
"""How well, relative to the integral of the absolute value."""
SMOOTH_WITHIN = 1e-8
"""Two that never agree so well belong to an index with kinks on the ray."""


def path_derivatives(legs: Sequence[Leg], media: Sequence[Medium], surfaces: Sequence[Surface]) -> dict[str, float]:
    """DS/dp by name for the ray of ``legs``, one in each medium.

    A name that stands in several media or surfaces is one parameter, which changes in all of them by the same amount.
    Raises ArithmeticError where an integral does not converge.
    """
    totals: defaultdict[str, float] = defaultdict(float)
    for leg, medium in zip(legs, media, strict=True):
        if medium.parameters:
            rates = _index_rates(medium, leg.at(np.zeros(1)).dimension)
            for name, value in zip(medium.parameters, _integral(leg, rates), strict=True):
                totals[name] += float(value)
    for before, after, surface in zip(legs[:-1], legs[1:], surfaces, strict=True):
        for name, value in _displaced(before, after, surface).items():
            totals[name] += value
    return dict(totals)


def _index_rates(medium: Medium, dimension: int) -> Callable[[np.ndarray], np.ndarray]:
    """Takes positions (k, d) to ∂(n²)/∂p / 2 (k, number of parameters)."""
    if isinstance(medium, Tabulated):
        return medium.parameter_rates
    position = ca.SX.sym("r", dimension)
    symbols = ca.SX.sym("p", len(medium.parameters))
    named = {name: symbols[i] for i, name in enumerate(medium.parameters)}
    rates = ca.gradient(medium.parametric_index(position, named) ** 2, symbols) / 2
    rates = ca.substitute(ca.densify(rates), symbols, ca.DM(list(medium.parameters.values())))
    function = PointEvaluator(ca.Function("rates", [position], [rates]))
    return lambda points: function(len(points), points)


def _integral(leg: Leg, rates: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The integral of ``rates`` over σ along a leg, from break to break."""
    ends = [0.0, *leg.breaks, leg.length]
    parts = [_smooth_part(leg, rates, low, high) for low, high in pairwise(ends) if high > low]
    return np.sum(parts, axis=0)


def _smooth_part(leg: Leg, rates: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> np.ndarray:
    known, gap = np.full(1, np.nan), np.inf
    for count in NODE_COUNTS:
        nodes, weights = gauss(count)
        values = rates(leg.at(low + (high - low) * (nodes + 1) / 2).position)
        integral, size = ((high - low) / 2 * (weights @ v) for v in (values, np.abs(values)))
        gap = float(np.max(np.abs(integral - known)) / (np.max(size) or 1.0))
        known = integral
        if gap <= AGREED_WITHIN:
            return integral
    if gap <= SMOOTH_WITHIN:
        return known
    raise ArithmeticError(
        f"the derivative of the optical path has settled to {gap:.1g} only: the index is not smooth along the ray"
    )


def _displaced(before: Leg, after: Leg, surface: Surface) -> dict[str, float]:
    """The part of a surface, between the two legs, that moves with its parameters."""
    if not surface.parameters:
        return {}
    end, start = before.at(np.array([before.length])), after.at(np.zeros(1))
    position = ca.SX.sym("r", end.dimension)
    symbols = ca.SX.sym("p", len(surface.parameters))
    named = {name: symbols[i] for i, name in enumerate(surface.parameters)}
    level = surface.parametric_level(position, named)
    gradients = [ca.gradient(level, position), ca.gradient(level, symbols)]
    function = ca.Function("level", [position, symbols], [ca.densify(g) for g in gradients])
    across, by_parameter = (np.array(g).ravel() for g in function(end.position[0], list(surface.parameters.values())))
    jump = float((start.momentum[0] - end.momentum[0]) @ across / (across @ across))
    return dict(zip(surface.parameters, (jump * by_parameter).tolist(), strict=True))
