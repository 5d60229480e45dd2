"""How far from a curve hills and wells are worth crossing, where the way there alone costs too much beyond.

Where L is nowhere negative no part of a curve pays for another: what comes too dear by a node of a lattice is so all
along.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.existence.landscape import LandscapeWithUnit
from varcalc.existence.polygons import WORTH_MOVING, Lattice
from varcalc.problem.breaks import whole
from varcalc.symbolic.intervals import EVERYTHING, constant, enclosures


def worth_crossing(about: Lattice) -> tuple[float, float]:
    """Ordinates beyond which no polygon is worth moving, by the lattice ``about`` a curve; infinite ones for none.

    They lie a node beyond those by which it finds a polygon that costs less. Told alone where L is a number, nowhere
    negative and convex in the slope on all of the lattice.
    """
    everywhere = not about.landscape.closed and np.isfinite(about.costs).all() and not about.walls.any()
    if not everywhere or not nowhere_negative(about.landscape):
        return -math.inf, math.inf
    # the ceiling of what adds as much with its signs as without
    worth = np.flatnonzero((about.least.values < about.own_value / (1 - WORTH_MOVING)).any(0))
    if len(worth) == 0:  # the curve sums nothing, and no share of that is worth more
        return -math.inf, math.inf
    first, last = max(worth.min() - 1, 0), min(worth.max() + 1, about.nodes.shape[1] - 1)
    return float(about.nodes[:, first].min()), float(about.nodes[:, last].max())


def nowhere_negative(landscape: LandscapeWithUnit) -> bool:
    """Whether what curves sum is enclosed by numbers that are not negative, and ends cost nothing."""
    problem = landscape.problem
    if landscape.approximate or problem.end_cost_expression is not None or problem.symbols.kind is not ca.SX:
        return False
    low, high = (np.array(end) for end in landscape.span)
    curve = [[EVERYTHING] * symbol.numel() for symbol in (problem.symbols.y, problem.symbols.dy, problem.symbols.ddy)]
    numbers = [[*map(constant, problem.parameter_values.tolist())], [EVERYTHING] * problem.symbols.unknowns.numel()]
    least, most = enclosures(whole(problem), [[(low, high)], *curve, *numbers])[0][0]
    return bool(least >= 0.0 if landscape.sign > 0 else most <= 0.0)
