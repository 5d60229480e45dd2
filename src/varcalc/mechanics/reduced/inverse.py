"""Inverse problems of motion in one coordinate: the force of an orbit, and the width of a well from its periods."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from varcalc.mechanics.arguments import sampled
from varcalc.problem.conditions import finite, positive, reals
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import trace

COARSEST, REACH = 0.5, 4.5
"""Step of t to begin with, and its reach: what is left out beyond is e^-70 of the whole."""
STEP_HALVINGS = 6
"""Times the step is halved."""
AGREED = 1e-12
"""Of the width: how well two rules must agree, of which the finer is better still."""


@spelled
def force_of_orbit(
    orbit: Callable[..., Any], angle: Any, *, momentum: float = 1.0, mass: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """The radius of an orbit r(θ) at an ``angle`` of any shape, and the central force that makes a body follow it.

    By Binet's equation, F = -(l²/m) s² (s'' + s) with s = 1/r and the angular ``momentum`` l (Brizard, "An
    Introduction to Lagrangian Mechanics", eq. 4.3; Goldstein, Poole and Safko, "Classical Mechanics", sect. 3.5):
    positive where it repels.

    Raises TypeError or ValueError where the orbit is no function of an angle, and where its radius is not positive.

    Parameters
    ----------
    orbit : callable
        ``r(theta)``, written with CasADi or NumPy functions.
    angle : array
        In radians.
    momentum, mass : float

    Returns
    -------
    r, force : arrays of the shape of ``angle``

    Examples
    --------
    >>> r, force = force_of_orbit(lambda theta: theta**2, [1.0, 2.0])  # -(l²/m) (1 + 6/r)/r³
    >>> bool(np.all(abs(force * r**4 / (r + 6) + 1) < 1e-14))
    True
    """
    factor = finite("momentum", momentum) ** 2 / positive("mass", mass)
    theta = ca.SX.sym("theta")
    s = 1 / trace("orbit", orbit, [theta], ca.SX, "it takes the angle")
    bent = ca.gradient(ca.gradient(s, theta), theta)
    function = PointEvaluator(ca.Function("force", [theta], [1 / s, ca.densify(-(s**2) * (bent + s))]))
    at = reals("angle", angle)
    found = function(at.size, at.reshape(-1, 1))
    if not np.all(found[:, 0] > 0):
        raise ValueError("orbit must give a positive radius at every angle")
    force = factor * found[:, 1]
    return found[:, 0].reshape(at.shape)[()], force.reshape(at.shape)[()]


@spelled
def well_width(period: Callable[[np.ndarray], np.ndarray], depth: Any, *, mass: float = 1.0) -> np.ndarray:
    """How wide a well is at heights ``depth`` above its bottom, from the periods of motions in it.

    x₂(U) - x₁(U) = ∫ T(E) dE/√(U - E) from 0 to U, over π √(2 m): Abel's inversion (Landau and Lifshitz, "Mechanics",
    sect. 12). Of a symmetric well that is the potential; of others any shear of it has the same periods.

    Raises ValueError for heights that are not positive, and for periods that are not smooth, as where one is infinite
    on the way.

    Parameters
    ----------
    period : callable
        The periods of energies (k,) above the bottom, smooth but for a power at the bottom.
    depth : array
        Positive heights, of any shape.
    mass : float

    Returns
    -------
    array of the shape of ``depth``

    Examples
    --------
    >>> width = well_width(lambda energy: 0 * energy + 2 * np.pi, [0.5, 2.0])  # of x²/2
    >>> bool(np.all(abs(width - [2, 4]) < 1e-14))
    True
    """
    heights, scale = reals("depth", depth), np.pi * np.sqrt(2 * positive("mass", mass))
    if not np.all((heights > 0) & np.isfinite(heights)):
        raise ValueError(f"depth must be positive numbers, not {depth!r}")
    flat, step = heights.ravel(), COARSEST
    last = _width(period, flat, step)
    for _ in range(STEP_HALVINGS):
        step /= 2
        before, last = last, _width(period, flat, step)
        if np.all(np.abs(last - before) <= AGREED * np.abs(last)):
            return (last / scale).reshape(heights.shape)[()]
    raise ValueError("period is not smooth, or not finite, below depth: its integral is not resolved")


def _width(period: Callable[[np.ndarray], np.ndarray], heights: np.ndarray, step: float) -> np.ndarray:
    """∫ T/√(U - E) dE (m,) by the double exponential rule, E = U/(1 + exp(-π sinh t)): both ends may be singular."""
    t = np.arange(-REACH, REACH + step / 2, step)
    grown = np.exp(np.pi * np.sinh(t))
    share = grown / (1 + grown)
    # dE/√(U - E) = √U share √(1 - share) π cosh t dt
    weights = step * np.pi * np.cosh(t) * share / np.sqrt(1 + grown)
    periods = sampled("period", period, (heights[:, None] * share).ravel()).reshape(len(heights), len(t))
    return np.sqrt(heights) * (periods @ weights)
