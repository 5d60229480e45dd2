"""The effective potential of the charged pendulum in a magnetic field, below, at and above the threshold Ω = 1.94204.

V = 1 - cos θ + (α/sin θ + Ω sin θ)²/2 with α = 1: one well, an inflection, two wells with a crest between.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.8.
"""

import numpy as np

from varcalc.problems.figures._charged import MOMENTUM, potential
from varcalc.study.drawing import Drawing, Line, Panel

W = (np.sqrt(4 ** (2 / 3) + 4) - 4 ** (1 / 3)) / 2
THRESHOLD = np.sqrt(1 / (4 ** (1 / 3) * W) ** 2 + 1 / W)
"""Of Ω, for α = 1 (see the problem charged_spherical_pendulum)."""
THETA = np.linspace(0.25, 2.95, 501)


def panels():
    """V over θ."""
    fields = {"Ω = 1.5": 1.5, f"Ω = {THRESHOLD:.5f}": THRESHOLD, "Ω = 2.5": 2.5}
    lines = [Line(THETA, potential(field, MOMENTUM, THETA), label=name) for name, field in fields.items()]
    return [[Panel(lines, "θ", "V/(m g l)", within=(0.2, 3.0, 3.0, 10.0))]]


figure = Drawing("A charged pendulum in a magnetic field, α = 1", panels)
