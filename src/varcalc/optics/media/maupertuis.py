"""A particle as a ray: the principle of Maupertuis in Jacobi's form.

A particle of energy E in a potential U goes along the rays of the index
sqrt(E - U) (Brizard, "An Introduction to Lagrangian Mechanics", eq. 2.8;
Landau and Lifshitz, "Mechanics", sect. 44): its abbreviated action is
sqrt(2 m) times the optical path.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from varcalc.optics.media.medium import Graded, Uniform
from varcalc.problem.conditions import finite, named
from varcalc.spelling import spelled

ENERGY = "energy"
"""The parameter's name."""


@spelled
def maupertuis(
    potential: float | Callable[..., Any], energy: float, parameters: Mapping[str, float] | None = None
) -> Uniform | Graded:
    """The medium n = sqrt(E - U) whose rays are the orbits of a particle of energy E in the potential U.

    Raises ValueError for a constant potential that the energy does not exceed.

    Parameters
    ----------
    potential : float or callable
        ``U(x, y)`` in the plane, ``U(x, y, z)`` in space, with ``p`` last where there are parameters; or a constant.
    energy : float
        E. It is a parameter of the medium, so that the time of flight of a particle of mass m from A to B is
        ``sqrt(2 * m) * ray.derivatives["energy"]`` (Jacobi: t = ∂W/∂E, W = sqrt(2 m) S).
    parameters : Mapping[str, float], optional
        Those of the potential, names with values.

    Returns
    -------
    Graded, or Uniform where the potential is a constant

    Notes
    -----
    A surface between two such media is one where the potential jumps: a well of depth U0 with soft walls refracts
    particles of energy E as a sphere of the relative index sqrt(1 + U0/E) does light (Abanov, lecture 6).

    Examples
    --------
    A stone of mass 1 is thrown with speed 2, where g = 1, to a place 2 away: at 15 or at 75 degrees.

    >>> import numpy as np
    >>> from varcalc import optics
    >>> low, high = optics.Scene(optics.maupertuis(lambda x, y: y, 2.0)).rays((0, 0), (2.0, 0.0))
    >>> [round(float(np.sqrt(2) * ray.derivatives["energy"]), 10) for ray in (low, high)]
    [1.0352761804, 3.8637033052]
    """
    own = named("parameters", parameters)
    given = {**own, ENERGY: finite("energy", energy)}
    if not callable(potential):
        height = finite("potential", potential)
        if not given[ENERGY] > height:
            raise ValueError(f"the energy {energy} must exceed the potential {potential}, or nothing moves there")
        return Uniform(lambda p: ca.sqrt(p.energy - height), given)

    def index(*arguments: Any) -> Any:
        *position, p = arguments
        return ca.sqrt(p.energy - potential(*position, *((p,) if own else ())))

    return Graded(index, given)
