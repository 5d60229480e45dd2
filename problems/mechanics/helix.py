"""A charge in fields along one axis: a helix whose pitch grows, in any gauge.

L = m v²/2 + e (v·A - Φ) with A = (0, B x, 0) and Φ = -E z. With w = e B/m: x = (u/w) sin wt, y = (u/w)(cos wt - 1),
z = e E t²/(2 m). The potentials A + grad f and Φ - df/dt give the same motion.

Source: L. D. Landau, E. M. Lifshitz, "The Classical Theory of Fields" (4th ed., 1975), sect. 18, 20 - 22.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

FIELD, PULL, MASS, CHARGE, SPEED = 1.7, 0.4, 0.9, 1.1, 1.3
system = mechanics.System(
    mechanics.charged(MASS, CHARGE, lambda t, q: [0, FIELD * q[0], 0], lambda t, q: -PULL * q[2]), ("x", "y", "z"),
    name="charge on a helix",
)  # fmt: skip
OMEGA = CHARGE * FIELD / MASS


def exact(t):
    """x, y and z."""
    around = SPEED / OMEGA
    return np.stack([around * np.sin(OMEGA * t), around * (np.cos(OMEGA * t) - 1), CHARGE * PULL * t**2 / (2 * MASS)])


def gauge(_):
    """How far the accelerations in another gauge are off, one that knows the time."""
    other = system.gauged(lambda t, q: CHARGE * (ca.sin(q[1] * q[2]) * t - FIELD * q[0] * q[1] / 2))
    state = 0.6, [0.3, -0.8, 0.5], [1.1, 0.2, -0.7]
    return np.abs(other.accelerations(*state) - system.accelerations(*state)).max()


experiment = mechanics.Experiment(
    system, [0.0, 0.0, 0.0], [SPEED, 0.0, 0.0], (0.0, 15.0), exact,
    {"gauge": gauge, "momentum along y": lambda motion: motion.drift["p_y"]}, title="A charge on a helix",
)  # fmt: skip
