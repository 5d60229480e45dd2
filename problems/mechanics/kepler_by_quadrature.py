"""Kepler's problem by quadrature: ellipses, the parabola and hyperbolas, and a comet inside the Earth's orbit.

With r0 = l²/m k and e² = 1 + 2 E l²/m k², r = r0/(1 + e cos φ): an ellipse closes after 2π, in 2π √(m a³/k); of a
hyperbola the angle is 2 arccos(-1/e). A comet on a parabola with the perihelion β spends √(2 (1 - β)) (1 + 2 β)/3π
years inside the Earth's orbit.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.3, problem 1 of ch. 4.
"""

from functools import cache

import numpy as np

from varcalc import mechanics

MASS, K, MOMENTUM = 1.3, 0.7, 0.9
UNIT = MOMENTUM**2 / (MASS * K)
ECCENTRICITIES = (1e-3, 0.3, 0.9, 0.9999)
planet = mechanics.System(
    lambda t, q, v: MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + K / q[0], ("r", "phi")
).reduced({"phi": MOMENTUM})


@cache
def orbit(e):
    """The conic of an eccentricity."""
    (found,) = planet.orbits((e**2 - 1) * MASS * K**2 / (2 * MOMENTUM**2))
    return found


def ellipse(e):
    """Period, and angle, of what is known to round-off of the energy."""
    found = orbit(e)
    axis = K / (-2 * found.energy)
    return max(abs(found.period / (2 * np.pi * np.sqrt(MASS * axis**3 / K)) - 1), abs(found.precession["phi"]))


def conic(e):
    """The angle to some radii."""
    angles = np.linspace(0.3, 2.4, 8) if e < 1 else np.linspace(0.3, 0.9, 8) * np.arccos(-1 / e)
    return np.abs(orbit(e).angle(UNIT / (1 + e * np.cos(angles)))["phi"] - angles).max()


def comet(perihelion):
    """The time inside the Earth's orbit in years, of a parabola (GM = 4π² in astronomical units)."""
    sun = 4 * np.pi**2
    moved = mechanics.System(lambda t, q, v: (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + sun / q[0], ("r", "phi"))
    (parabola,) = moved.reduced({"phi": np.sqrt(2 * sun * perihelion)}).orbits(0.0)
    known = np.sqrt(2 * (1 - perihelion)) * (1 + 2 * perihelion) / (3 * np.pi)
    return abs(2 * float(parabola.time(1.0)) / known - 1)


experiment = mechanics.Examination(
    "Kepler by quadrature",
    {
        "ellipses": lambda: max(ellipse(e) for e in ECCENTRICITIES),
        "conics": lambda: max(conic(e) for e in (0.3, 0.9, 1.0, 1.7)),
        "hyperbolas": lambda: max(abs(orbit(e).angles["phi"] - 2 * np.arccos(-1 / e)) for e in (1.1, 3.0)),
        "comet": lambda: max(comet(beta) for beta in (0.1, 0.5, 0.9)),
    },
)
