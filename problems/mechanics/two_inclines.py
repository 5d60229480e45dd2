"""Two blocks on two slopes, tied to each other over the ridge, with the tension in the rope.

With s1 and s2 the ways down the slopes and s1 + s2 the rope: s1'' = g (m1 sin a1 - m2 sin a2)/(m1 + m2), and the
tension is m1 m2 g (sin a1 + sin a2)/(m1 + m2). At m1 sin a1 = m2 sin a2 the blocks rest.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 2, problem 1.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, FIRST, SECOND, ROPE, START = 9.81, 2.0, 1.1, 5.0, 0.5
STEEP, FLAT = np.sin(0.7), np.sin(0.4)


def blocks(second):
    return mechanics.System(
        lambda t, q, v: FIRST * (v[0] ** 2 / 2 + G * STEEP * q[0]) + second * (v[1] ** 2 / 2 + G * FLAT * q[1]),
        ("s1", "s2"), constraints=[mechanics.Holonomic(lambda t, q: ca.sum1(q) - ROPE)],
    units=("m", "m"), time_unit="s", name="blocks on two slopes",
    )  # fmt: skip


system = blocks(SECOND)
PULL = G * (FIRST * STEEP - SECOND * FLAT) / (FIRST + SECOND)
TENSION = FIRST * SECOND * G * (STEEP + FLAT) / (FIRST + SECOND)


def exact(t):
    """s1 and s2 from rest."""
    return np.stack([START + PULL * t**2 / 2, ROPE - START - PULL * t**2 / 2])


def tension(motion):
    """How far the reactions are from the tension."""
    return np.abs(motion.reactions(np.linspace(motion.span[0], motion.span[1], 50)) / TENSION + 1).max()


def balance(_):
    """The accelerations of blocks that balance."""
    return np.abs(blocks(FIRST * STEEP / FLAT).accelerations(0.0, [START, ROPE - START], [0.0, 0.0])).max()


experiment = mechanics.Experiment(
    system, [START, ROPE - START], [0.0, 0.0], (0.0, 2.0), exact, {"tension": tension, "balance": balance},
    title="Two blocks on two slopes",
)  # fmt: skip
