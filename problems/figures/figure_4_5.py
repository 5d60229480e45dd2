"""Kepler's problem with a small further attraction ε/r²: an ellipse that turns, for ε = k r0/16.

r = γ² r0/(1 + e cos γθ) with γ² = 1 - 2 μ ε/l².

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 4.5.
"""

import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

STRENGTH, ECCENTRICITY, TURNS = 1 / 16, 0.5, 8
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0] + STRENGTH / q[0] ** 2, ("r", "theta"),
    name="Kepler's problem, perturbed",
)  # fmt: skip


def panels():
    """The orbit with the angular momentum 1 from its perihelion, beside the ellipse without that."""
    gamma = np.sqrt(1 - 2 * STRENGTH)
    start = gamma**2 / (1 + ECCENTRICITY)
    period = 2 * np.pi * gamma**3 / (1 - ECCENTRICITY**2) ** 1.5
    motion = system.motion([start, 0.0], [0.0, 1 / start**2], (0.0, TURNS * period))
    r, theta = motion.q(np.linspace(*motion.span, 3001))
    around = np.linspace(0, 2 * np.pi, 401)
    ellipse = 1 / (1 + ECCENTRICITY * np.cos(around))
    parts = [
        Line(r * np.cos(theta), r * np.sin(theta), label="ε = k r0/16"),
        Line(ellipse * np.cos(around), ellipse * np.sin(around), dashed=True, label="ε = 0"), Points([0.0], [0.0]),
    ]  # fmt: skip
    return [[Panel(parts, "x/r0", "y/r0", equal=True)]]


figure = Drawing("Perturbed Kepler problem", panels)
