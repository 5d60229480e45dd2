"""A bead on a hoop that turns about its vertical diameter faster than √(g/R).

L = R² (θ'² + Ω² sin²θ)/2 + g R cos θ. The bead rests at cos θ = g/(R Ω²), and swings about it with
ω = Ω √(1 - (g/(R Ω²))²) where it goes little. However far it goes on its side, tan(θ/2) = u dn(κt) with 4 κ² = D u² and
m = 1 - b²/u², where u and b are the ends and D = 2 g/R - C, with C = θ'² - 2 (g/R) cos θ - Ω² sin²θ.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.2.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj

from varcalc import mechanics

G, RADIUS, TURN = 9.81, 0.8, 5.0
system = mechanics.System(
    lambda t, q, v: RADIUS**2 * (v[0] ** 2 + (TURN * ca.sin(q[0])) ** 2) / 2 + G * RADIUS * ca.cos(q[0]), ("theta",),
    units=("rad",), time_unit="s", name="bead on a turning hoop",
)  # fmt: skip
RATIO = G / (RADIUS * TURN**2)
REST, SWING = np.arccos(RATIO), TURN * np.sqrt(1 - RATIO**2)
START = REST + 0.4
C = -2 * G / RADIUS * np.cos(START) - (TURN * np.sin(START)) ** 2
D, OUTER = 2 * G / RADIUS - C, np.tan(START / 2)
INNER = -(C + 2 * G / RADIUS) / (D * OUTER**2)  # its square


def exact(t):
    """θ from its outer end, at rest."""
    return 2 * np.arctan(OUTER * ellipj(np.sqrt(D) / 2 * OUTER * t, 1 - INNER / OUTER**2)[2])[None]


experiment = mechanics.Experiment(
    system, [START], [0.0], (0.0, 6.0), exact,
    {
        "frequency": lambda motion: abs(system.normal_modes([REST]).frequencies[0] / SWING - 1),
        "rest": lambda motion: abs(float(system.accelerations(0.0, [REST], [0.0])[0])),
    },
    title="A bead on a turning hoop",
)  # fmt: skip
