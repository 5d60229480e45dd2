"""Turning points of a particle inside a cone, roots of a cubic, as its energy grows.

3 ε/2 = 1/(2 σ²) + σ with σ = s/s0 and ε = E/V0: one root is negative, the other two part at the least energy ε = 1.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.6.
"""

import numpy as np

from varcalc.problems.mechanics.cone import MOMENTUM, system
from varcalc.study.drawing import Drawing, Line, Panel, Points

MOST = 2.5


def panels():
    """σ over ε: the effective potential of the Routhian, on its side."""
    reduced = system.routhian({"phi": MOMENTUM})
    (rest,) = reduced.equilibria([0.05], [5.0]).places[:, 0]
    least = reduced.energies(np.full((1, 1), rest), np.zeros((1, 1)))[0]
    parts = []
    for number, (low, high) in enumerate(((-1.5, -0.2), (0.3, 1.0), (1.0, 4.0))):
        sigma = np.linspace(low, high, 400)
        energy = reduced.energies(rest * sigma[None], np.zeros((1, 400))) / least
        shown = (energy >= 0) & (energy <= MOST)
        parts.append(Line(energy[shown], sigma[shown], label=f"σ{number}"))
    return [[Panel([*parts, Points([1.0], [1.0])], "ε = E/V0", "σ", within=(0, MOST, -1.5, 4.0))]]


figure = Drawing("Turning points on the cone", panels)
