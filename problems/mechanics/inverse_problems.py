"""Inverse problems: the force of an orbit, and a well from its periods.

r = r0 sec(αφ) is that of an inverse cube, l² (α² - 1)/m r³; the spiral r = k φ² wants -l² (1 + 6 k/r)/m r³;
a conic about its focus the inverse square. Periods 2π √(m/k) make the well of k x²/2, and those of x⁴ one of x⁴.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.1.2, problem 2 of ch. 4;
L. D. Landau and E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 12.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

MOMENTUM, MASS = 1.7, 1.3
UNIT, ALPHA, E = 0.8, 0.6, 0.45
ANGLES, HEIGHTS = np.linspace(0.2, 1.2, 9), np.array([0.3, 1.0, 4.0])


def force(orbit, known):
    """The largest relative error of the force."""
    r, found = mechanics.force_of_orbit(orbit, ANGLES, momentum=MOMENTUM, mass=MASS)
    return np.abs(found / (MOMENTUM**2 / MASS * known(r)) - 1).max()


def quartic():
    """Half the width of a well of x⁴ from its periods, which are found by quadrature."""
    motion = mechanics.System(lambda t, q, v: MASS * v[0] ** 2 / 2 - q[0] ** 4, ("x",)).reduced()
    (one,) = motion.orbits(1.0)
    # homogeneous of the fourth degree: T goes as E^(-1/4)
    width = mechanics.well_width(lambda energy: one.period * energy**-0.25, HEIGHTS, mass=MASS)
    return np.abs(width / (2 * HEIGHTS**0.25) - 1).max()


def harmonic():
    """The same of x²/2."""
    width = mechanics.well_width(lambda energy: 2 * np.pi * np.sqrt(MASS) + 0 * energy, HEIGHTS, mass=MASS)
    return np.abs(width / (2 * np.sqrt(2 * HEIGHTS)) - 1).max()


experiment = mechanics.Examination(
    "Inverse problems",
    {
        "secant": lambda: force(lambda x: UNIT / ca.cos(ALPHA * x), lambda r: (ALPHA**2 - 1) / r**3),
        "spiral": lambda: force(lambda x: UNIT * x**2, lambda r: -(1 + 6 * UNIT / r) / r**3),
        "conic": lambda: force(lambda x: UNIT / (1 + E * ca.cos(x)), lambda r: -1 / (UNIT * r**2)),
        "harmonic well": harmonic,
        "quartic well": quartic,
    },
)
