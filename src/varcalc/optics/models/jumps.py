"""Whether the index of a medium jumps inside it, and where an index of one coordinate is less than smooth."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.optics.media.medium import Expression, Medium, Radial, Stratified, switching
from varcalc.optics.media.tabulated import Tabulated
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.places import places
from varcalc.symbolic.sides import Sides
from varcalc.symbolic.switches import switches

LOG_RADIUS_LIMIT = 330.0
"""Of |ln(r/r₀)|: beyond it r² is no number."""
FARTHEST = 1e8
"""Heights at which an index is asked for."""
SIDE_OFFSET, INDEX_ROUND_OFF = 1e-9, 1e-11
"""Of a place: how far beside it its sides are told; and of n², what is round-off."""


def switched(g: Expression, u: Expression, far: float) -> np.ndarray | None:
    """Where ``g`` of one coordinate ``u`` has kinks or jumps, up to ``far``; None where they are too many."""
    found: list[float] = []
    for switch in switches([g], [u]):
        here = places(switch, u, (-far, far), found) if switch.depends_on(u) else []
        if here is None:
            return None
        found += here
    return np.unique(found)


def jumping(medium: Medium, dimension: int) -> bool:
    """Whether n² jumps: in layers and about a centre it is asked on both sides; elsewhere, whether it may is read."""
    if isinstance(medium, Stratified | Radial):
        return _jumps(medium)
    if isinstance(medium, Tabulated) or not switching(medium, dimension):
        return False
    position = ca.SX.sym("r", dimension)
    return any(
        one.jumps and one.depends_on(position) for one in switches([ca.SX(medium.squared_index(position))], [position])
    )


def _jumps(medium: Stratified | Radial) -> bool:
    u = ca.SX.sym("u")
    if isinstance(medium, Radial):
        g, far = replace(medium, center=None).squared_index(ca.vertcat(ca.exp(u), 0)), LOG_RADIUS_LIMIT
    else:
        g, far = medium.squared_index(ca.vertcat(0, u)), FARTHEST
    found = switched(ca.SX(g), u, far)
    if found is None:
        return True
    pieces = Sides.of(ca.SX(g), u)
    for place in found:
        sides = pieces.at(place + SIDE_OFFSET * max(1.0, abs(place)) * np.array([[-1.0], [1.0]]))
        both = [PointEvaluator(ca.Function("g", [u], [pieces.piece(side).expression])) for side in sides]
        below, above = (float(one(1, np.array([[place]]))[0, 0]) for one in both)
        if not abs(above - below) <= INDEX_ROUND_OFF * abs(below):
            return True
    return False
