"""Kepler's ellipses perturbed: by α/r² exactly, and by -α/r³, whose angle is an elliptic integral.

With α/r² the orbit is r = γ² r0/(1 + e cos γφ), γ² = 1 + 2 m α/l²: its angular period is 2π/γ. With -α/r³,
(ds/dφ)² = β (s - s1) (s2 - s) (s3 - s), s = 1/r and β = 2 m α/l²: it is 4 K(k)/√(β (s3 - s1)) with
k² = (s2 - s1)/(s3 - s1), 6π α/k r0² more than 2π to first order.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), problems 3 and 4 of ch. 4;
L. D. Landau and E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 15, problem 3.
"""

import numpy as np
from scipy.special import ellipk

from varcalc import mechanics

MASS, K, MOMENTUM = 1.3, 0.7, 0.9
ENERGY = -0.3 * MASS * K**2 / MOMENTUM**2


def orbit(alpha, power):
    """The inner motion in the potential -k/r + α/r^power."""
    system = mechanics.System(
        lambda t, q, v: MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + K / q[0] - alpha / q[0] ** power, ("r", "phi")
    )
    return next(one for one in system.reduced({"phi": MOMENTUM}).orbits(ENERGY) if one.bounded)


def inverse_square(alpha):
    """The error of the angular period, and of the angle from the pericentre to some radii."""
    gamma = np.sqrt(1 + 2 * MASS * alpha / MOMENTUM**2)
    unit = MOMENTUM**2 / (MASS * K)
    e = np.sqrt(1 + 2 * gamma**2 * ENERGY * MOMENTUM**2 / (MASS * K**2))
    found, angles = orbit(alpha, 2), np.linspace(0.2, 2.6, 7)
    radii = gamma**2 * unit / (1 + e * np.cos(angles))
    off = np.abs(found.angle(radii)["phi"] - angles / gamma).max()
    return max(off, abs(found.angles["phi"] - 2 * np.pi / gamma))


def inverse_cube(alpha):
    """The error of the angular period."""
    beta = 2 * MASS * alpha / MOMENTUM**2
    cubic = [beta, -1.0, 2 * MASS * K / MOMENTUM**2, 2 * MASS * ENERGY / MOMENTUM**2]
    s1, s2, s3 = np.sort(np.roots(cubic).real)
    exact = 4 / np.sqrt(beta * (s3 - s1)) * ellipk((s2 - s1) / (s3 - s1))
    return abs(orbit(-alpha, 3).angles["phi"] - exact)


experiment = mechanics.Examination(
    "Precession",
    {
        "inverse square": lambda: max(inverse_square(alpha) for alpha in (-0.1, 1e-4, 0.1)),
        "inverse cube": lambda: max(inverse_cube(alpha) for alpha in (1e-3, 0.02)),
    },
)
