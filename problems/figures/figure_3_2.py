"""Bounded and unbounded orbits in the cubic potential x - x³/3.

I: E above the crest, unbounded; II and III: at the crest E = 2/3, bounded and unbounded; IV and V: below, on either
side.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.2.
"""

import numpy as np

from varcalc.problems.mechanics.cubic_potential import system
from varcalc.study.drawing import Drawing, Levels, Panel, Text

CREST, ABOVE, BELOW = 2 / 3, 1.5, 0.0
NAMES = {"I": (-2.4, 1.2), "II": (-1.1, 1.72), "III": (1.6, 1.05), "IV": (-1.1, 0.3), "V": (2.5, 0.3)}


def panels():
    """Level curves of the energy over x and its rate."""
    x, v = np.linspace(-3.0, 3.5, 401), np.linspace(-3.5, 3.5, 401)
    grid = np.meshgrid(x, v)
    energy = system.energies(grid[0].ravel()[None], grid[1].ravel()[None]).reshape(grid[0].shape)
    levels = [Levels(x, v, energy, [ABOVE]), Levels(x, v, energy, [CREST], dashed=True), Levels(x, v, energy, [BELOW])]
    return [[Panel([*levels, *(Text(*place, name) for name, place in NAMES.items())], "x", "dx/dt")]]


figure = Drawing("Orbits in the potential x - x³/3", panels)
