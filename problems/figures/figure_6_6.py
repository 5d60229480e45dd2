"""Foucault's pendulum from rest at (0, 1), with 2 (ω/ω0) sin λ = 0.05: some swings, and all directions.

x'' + x = 0.05 y', y'' + y = -0.05 x' in units of ω0. On the left the scales of x and y differ.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 6.6.
"""

import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

TURN = 0.025
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 + v[1] ** 2 - q[0] ** 2 - q[1] ** 2) / 2 + TURN * (q[0] * v[1] - q[1] * v[0]),
    ("x", "y"), name="Foucault's pendulum",
)  # fmt: skip


def panels():
    """Three swings, and the half turn after which the directions repeat."""
    motion = system.motion([0.0, 1.0], [0.0, 0.0], (0.0, np.pi / TURN))
    short, whole = motion.q(np.linspace(0.0, 6 * np.pi, 601)), motion.q(np.linspace(*motion.span, 4001))
    start = Points([0.0], [1.0])
    return [[
        Panel([Line(*short), start], "x", "y", title="three swings"),
        Panel([Line(*whole), start], "x", "y", title="half a turn", equal=True),
    ]]  # fmt: skip


figure = Drawing("Foucault's pendulum", panels)
