"""Two pendula of one length and unlike masses with a spring between them.

w² = g/l, in which they swing together, and g/l + k/µ, with µ = m1 m2/(m1 + m2), in which their middle rests.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 8.3.2.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, LENGTH, FIRST, SECOND, SPRING = 9.81, 0.9, 1.2, 0.5, 3.0
system = mechanics.System(
    lambda t, q, v: (
        LENGTH**2 * (FIRST * v[0] ** 2 + SECOND * v[1] ** 2) / 2
        + G * LENGTH * (FIRST * ca.cos(q[0]) + SECOND * ca.cos(q[1]))
        - SPRING * LENGTH**2 * (ca.sin(q[0]) - ca.sin(q[1])) ** 2 / 2
    ),
    ("theta1", "theta2"), name="coupled pendula",
)  # fmt: skip
modes = system.normal_modes([0.0, 0.0])


def frequencies():
    """How far they are off."""
    reduced = FIRST * SECOND / (FIRST + SECOND)
    known = np.sqrt([G / LENGTH, G / LENGTH + SPRING / reduced])
    return np.abs(modes.frequencies / known - 1).max()


def shapes():
    """How far the pendula are from going together, and against each other as their masses do."""
    return np.abs(modes.shapes[1] / modes.shapes[0] - [1, -FIRST / SECOND]).max()


def upside_down():
    """Whether one pendulum standing and one hanging is told stable: then it is off by one."""
    return float(system.normal_modes([np.pi, 0.0]).stable or system.normal_modes([np.pi, np.pi]).stable)


experiment = mechanics.Examination(
    "Coupled pendula", {"frequencies": frequencies, "shapes": shapes, "upside down": upside_down}
)
