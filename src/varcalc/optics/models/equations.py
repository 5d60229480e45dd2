"""Hamilton's ray equations as expressions, for any medium and with neighbours.

dr/dσ = p, dp/dσ = ∇n²/2, dS/dσ = n² (Born and Wolf, sect. 3.2; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 3.3), and for the deviations of neighbours δr' = δp, δp' = H δr/2 with H the Hessian matrix of n² (sect. 1.4.3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from varcalc.optics.media.medium import Expression, Medium
from varcalc.optics.media.tabulated import Layers


@dataclass(frozen=True)
class RayStops:
    """Where rays stop: ``count`` functions ``levels`` of a state, ``constants`` in number and n² vanish there.

    Those numbered ``at_ends`` are asked at the ends of steps alone, see
    :meth:`varcalc.integrators.protocol.Engine.compile`, where the medium is in one piece: at the end of a piece a ray
    that comes to rest only touches it, which a stop before it tells from crossing.
    """

    levels: Callable[[Expression, Expression, Expression], Expression]
    count: int
    constants: int
    at_ends: tuple[int, ...] = ()


NO_RAY_STOPS = RayStops(lambda _, __, ___: ca.SX(0, 1), 0, 0)


@dataclass(frozen=True)
class Force:
    """n² (a scalar), ∇n²/2 (d,) and the latter's derivative along a deviation, as expressions of a position."""

    squared: Expression
    pull: Expression
    along: Callable[[Expression], Expression]


def force(squared: Expression, position: Expression) -> Force:
    """The force of any n², an expression of the symbols ``position``."""
    pull = ca.gradient(squared, position) / 2
    return Force(squared, pull, lambda moved: ca.jtimes(pull, position, moved))


def force_through(function: ca.Function, u: Expression, position: Expression) -> Force:
    """The force of n² = F(u), by the chain rule; ∇u and u's second derivatives are simple."""
    symbol = ca.SX.sym("u")
    squared = function(symbol)
    half = ca.gradient(squared, symbol) / 2
    orders = ca.Function("orders", [symbol], [squared, half, ca.gradient(half, symbol)])
    squared, half, bend = orders(u)
    slope = ca.gradient(u, position)
    hessian = ca.jacobian(slope, position)

    def along(moved: Expression) -> Expression:
        return half * (hessian @ moved) + (bend * ca.dot(slope, moved)) * slope

    return Force(squared, half * slope, along)


def ray_rates(force: Force, state: Expression, dimension: int) -> Expression:
    """Hamilton's ray equations: of r, p, S, then δr and δp of each neighbour."""
    d = dimension
    rates = [state[d : 2 * d], force.pull, force.squared]
    for first in range(2 * d + 1, state.numel(), 2 * d):
        rates += [state[first + d : first + 2 * d], force.along(state[first : first + d])]
    return ca.cse(ca.densify(ca.vertcat(*rates)))


def force_of(medium: Medium, layers: Layers | None, position: Expression, constants: Expression) -> Force:
    """The force of ``medium``; where it has ``layers``, that of one of them, whose ``constants`` are given."""
    if layers is not None:
        return force(layers.written(position[position.numel() - 1], constants), position)
    known = medium.through(position)
    return force(medium.squared_index(position), position) if known is None else force_through(*known, position)


def ray_system(medium: Medium, dimension: int, neighbours: int, *, by_path: bool = False) -> ca.Function:
    """Hamilton's ray equations with ``neighbours`` deviations, as the engines take a system, of a medium in one piece.

    The state is r, p, S, then δr and δp of each neighbour, and there are no constants. The abscissa is σ, or the
    optical path, whose rate by σ is n²; deviations are those at the same σ.
    """
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * dimension + 1 + 2 * dimension * neighbours)
    none = ca.SX.sym("c", 0)
    here = force_of(medium, None, state[:dimension], none)
    rates = ray_rates(here, state, dimension)
    return ca.Function("rays", [s, state, none], [ca.cse(rates * (1 / here.squared)) if by_path else rates])
