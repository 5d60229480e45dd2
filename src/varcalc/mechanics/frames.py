"""Lagrangians seen from a rotating frame, and of charges in electromagnetic potentials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from varcalc.mechanics.arguments import triple
from varcalc.problem.conditions import finite, function
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression


@spelled
def rotating(lagrangian: Callable[..., Any], angular_velocity: Sequence[float]) -> Callable[..., Any]:
    """The Lagrangian of one particle in a frame that turns: L(t, q, v + Ω × q).

    ``lagrangian`` is that in a frame at rest, as a function of position (3,) and velocity that no turning changes but
    by the velocity; ``angular_velocity`` (3,) is Ω in radians for each unit of time. The Coriolis and centrifugal
    forces follow (Landau and Lifshitz, "Mechanics", sect. 39). Raises TypeError or ValueError for what is no function,
    and for what are not three numbers.
    """
    function("lagrangian", lagrangian)
    omega = ca.SX(triple("angular_velocity", angular_velocity))

    def turning(t: Expression, q: Expression, v: Expression, *p: Any) -> Expression:
        return lagrangian(t, q, v + ca.cross(omega, q), *p)

    return turning


@spelled
def charged(
    mass: float,
    charge: float,
    vector_potential: Callable[[Expression, Expression], Any],
    potential: Callable[[Expression, Expression], Any] = lambda t, q: 0,
) -> Callable[..., Any]:
    """The Lagrangian m v²/2 + e v·A(t, q) - e Φ(t, q) of a charge, in SI units or any others without factors of c.

    ``vector_potential(t, q)`` gives as many numbers as there are coordinates, Cartesian ones. With Gaussian units
    divide the charge in front of A by c. Source: Landau and Lifshitz, "The Classical Theory of Fields", sect. 16.

    Raises TypeError where one of the potentials is no function of (t, q).
    """
    for name, given, shown in (("vector_potential", vector_potential, "(0, 0, 0)"), ("potential", potential, "0")):
        if not callable(given):
            raise TypeError(f"{name} must be a function of (t, q), not {given!r}; write lambda t, q: {shown}")

    m, e = finite("mass", mass), finite("charge", charge)

    def lagrangian(t: Expression, q: Expression, v: Expression, *_: Any) -> Expression:
        """The value at a time, coordinates and velocities."""
        a = vector_potential(t, q)
        a = ca.vertcat(*a) if isinstance(a, list | tuple) else a
        return m * ca.sumsqr(v) / 2 + e * (ca.dot(v, a) - potential(t, q))

    return lagrangian
