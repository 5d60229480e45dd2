"""A bead on a hoop that turns about its vertical diameter faster than √(g/R).

L = R² (θ'² + Ω² sin²θ)/2 + g R cos θ. The bead rests at cos θ = g/(R Ω²), and swings about it with
ω = Ω √(1 - (g/(R Ω²))²).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.1.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, RADIUS, TURN = 9.81, 0.8, 5.0
system = mechanics.System(
    lambda t, q, v: RADIUS**2 * (v[0] ** 2 + (TURN * ca.sin(q[0])) ** 2) / 2 + G * RADIUS * ca.cos(q[0]), ("theta",),
    name="bead on a turning hoop",
)  # fmt: skip
RATIO = G / (RADIUS * TURN**2)
REST, SWING = np.arccos(RATIO), TURN * np.sqrt(1 - RATIO**2)

experiment = mechanics.Experiment(
    system, [REST + 0.4], [0.0], (0.0, 6.0), None,
    {
        "frequency": lambda motion: abs(system.normal_modes([REST]).frequencies[0] / SWING - 1),
        "rest": lambda motion: abs(float(system.accelerations(0.0, [REST], [0.0])[0])),
    },
    title="A bead on a turning hoop",
)  # fmt: skip
