"""Hamilton's ray equations as the engines take a system, and rays as its states.

dr/dσ = p, dp/dσ = ∇n²/2, dS/dσ = n², of the Hamiltonian (|p|² - n²)/2 = 0
(Born and Wolf, sect. 3.2; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 3.3): for many media polynomials. The deviations of neighbours obey
δr' = δp, δp' = H δr/2 with H the Hessian matrix of n² (the ray deviation
equation, Brizard sect. 1.4.3).
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.optics.beam import Beam
from varcalc.optics.media import Expression, Medium
from varcalc.optics.tabulated import Tabulated, cubic


def ray_rates(squared: Expression, state: Expression, dimension: int) -> Expression:
    """Hamilton's ray equations for ``squared``, n² at the position: of r, p, S, then δr and δp of each neighbour."""
    d = dimension
    pull = ca.gradient(squared, state[:d]) / 2
    rates = [state[d : 2 * d], pull, squared]
    bend = ca.jacobian(pull, state[:d])
    for first in range(2 * d + 1, state.numel(), 2 * d):
        rates += [state[first + d : first + 2 * d], bend @ state[first : first + d]]
    return ca.densify(ca.vertcat(*rates))


def ray_system(medium: Medium, dimension: int, neighbours: int) -> ca.Function:
    """Hamilton's ray equations with ``neighbours`` deviations, as the engines take a system.

    The state is r, p, S, then δr and δp of each neighbour. There are no
    constants, but for those of one layer where the medium is a table.
    """
    s, state = ca.SX.sym("s"), ca.SX.sym("Y", 2 * dimension + 1 + 2 * dimension * neighbours)
    constants = ca.SX.sym("c", 6 if isinstance(medium, Tabulated) else 0)
    if isinstance(medium, Tabulated):
        squared = cubic(state[dimension - 1], constants)
    else:
        squared = medium.squared_index(state[:dimension])
    return ca.Function("rays", [s, state, constants], [ray_rates(squared, state, dimension)])


def packed(beam: Beam) -> np.ndarray:
    """The states (m, N) of :func:`ray_system` for the rays of ``beam``."""
    pairs = np.concatenate([beam.moved, beam.turned], axis=2).reshape(len(beam), -1)
    return np.column_stack([beam.position, beam.momentum, beam.optical_path, pairs])


def unpacked(states: np.ndarray, dimension: int) -> Beam:
    """The rays of the states (m, N)."""
    d = dimension
    pairs = states[:, 2 * d + 1 :].reshape(len(states), states.shape[1] // (2 * d) - 1, 2 * d)
    return Beam(states[:, :d], states[:, d : 2 * d], states[:, 2 * d], pairs[:, :, :d], pairs[:, :, d:])
