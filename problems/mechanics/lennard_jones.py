"""Scattering by a Lennard-Jones potential: orbits that go round, and the way back to the potential.

At E below 0.8 some orbit goes round for ever: r² (1 - U/E) is least where x = r⁶ obeys 2 x² - 16 x/E + 40/E = 0, and
next to it angles grow by √(2 b²/g'') ln for each factor of the distance, g'' being that of r² (1 - U/E) by ln r. From
the angles at a higher energy Firsov's inversion gives the potential back.

Source: M. S. Child, "Molecular Collision Theory" (1974), ch. 2; L. D. Landau and E. M. Lifshitz, "Mechanics"
(3rd ed., 1976), sect. 18.
"""

import numpy as np

from varcalc import mechanics

SLOW, FAST = 0.5, 5.0


def potential(r):
    """Of depth 1."""
    return 4 * (r**-12 - r**-6)


slow, fast = mechanics.Scattering(potential, SLOW), mechanics.Scattering(potential, FAST)
RADIUS = ((16 / SLOW + np.sqrt(256 / SLOW**2 - 320 / SLOW)) / 4) ** (1 / 6)
SQUARED = RADIUS**2 * (1 - potential(RADIUS) / SLOW)
LOGARITHM = np.sqrt(2 * SQUARED / (4 * RADIUS**2 - 4 / SLOW * (100 * RADIUS**-10 - 16 * RADIUS**-4)))
(orbiting,) = slow.orbiting


def inverted():
    """The potential from angles, at radii on either side of its minimum."""
    r, found = mechanics.firsov(lambda b: fast.deflection(b).angle, FAST, np.array([0.7, 1.0, 1.3, 2.0]))
    return np.abs(found - potential(r)).max() / FAST


experiment = mechanics.Examination(
    "Lennard-Jones",
    {
        "orbiting radius": lambda: abs(orbiting.radius / RADIUS - 1),
        "orbiting impact parameter": lambda: abs(orbiting.impact / np.sqrt(SQUARED) - 1),
        "logarithm": lambda: abs(orbiting.logarithm / LOGARITHM - 1),
        "inverted": inverted,
    },
)
