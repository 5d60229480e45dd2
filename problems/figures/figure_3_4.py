"""The phase space of the pendulum: libration, rotation, and the separatrix between them.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.4.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Levels, Panel, Text

system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - 1 + ca.cos(q[0]), ("theta",), name="pendulum")


def panels():
    """Level curves of the energy, in units of m g l: librations below 2, rotations above."""
    theta, rate = np.linspace(-np.pi, np.pi, 401), np.linspace(-3.2, 3.2, 401)
    grid = np.meshgrid(theta, rate)
    energy = system.energies(grid[0].ravel()[None], grid[1].ravel()[None]).reshape(grid[0].shape)
    parts = [
        Levels(theta, rate, energy, [0.2, 0.6, 1.2], colour=0), Levels(theta, rate, energy, [2.0], colour=1),
        Levels(theta, rate, energy, [2.6, 3.5], colour=2),
    ]  # fmt: skip
    names = [Text(-0.15, 0.1, "I"), Text(-0.15, 2.05, "II"), Text(-0.15, 2.75, "III")]
    return [[Panel([*parts, *names], "θ", "dθ/dt / ω0")]]


figure = Drawing("Phase space of the pendulum", panels)
