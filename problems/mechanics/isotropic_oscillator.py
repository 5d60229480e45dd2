"""The isotropic oscillator by quadrature: ellipses about the centre, in a time that depends on nothing.

The radius goes to and fro in π √(m/k), half a turn, whatever energy and angular momentum are. With l = 0 the radius
passes through the centre: the straight line of a whole period.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.4.
"""

from functools import cache

import numpy as np

from varcalc import mechanics

MASS, K = 1.3, 0.7
OMEGA = np.sqrt(K / MASS)
system = mechanics.System(
    lambda t, q, v: (MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) - K * q[0] ** 2) / 2, ("r", "phi"), name="oscillator"
)
CASES = [(1e-3, 0.6), (0.5, 0.6), (0.5, 7.0)]


@cache
def orbit(momentum, energy):
    """The motion."""
    (found,) = system.reduced({"phi": momentum}).orbits(energy)
    return found


def period(momentum, energy):
    """The error of the time and of the angle."""
    found = orbit(momentum, energy)
    return max(abs(found.period * OMEGA / np.pi - 1), abs(found.angles["phi"] / np.pi - 1))


def ellipse(momentum, energy):
    """1/r² = (1/a² + 1/b²)/2 + (1/b² - 1/a²)/2 cos 2φ from the smaller axis b."""
    found, angles = orbit(momentum, energy), np.linspace(0.1, 1.5, 8)
    far, near = found.high**-2, found.low**-2
    radii = ((near + far) / 2 + (near - far) / 2 * np.cos(2 * angles)) ** -0.5
    axes = abs(found.low * found.high / (momentum / np.sqrt(MASS * K)) - 1)
    return max(axes, np.abs(found.angle(radii)["phi"] - angles).max())


experiment = mechanics.Examination(
    "The isotropic oscillator",
    {
        "period and angle": lambda: max(period(*case) for case in CASES),
        "ellipse": lambda: max(ellipse(*case) for case in CASES if case[0] > 0.1),
        "through the centre": lambda: abs(orbit(0.0, 0.6).period * OMEGA / (2 * np.pi) - 1),
    },
)
