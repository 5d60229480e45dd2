"""The pendulum in the plane, its rod a constraint, and the tension in it.

L = m (v_x² + v_y²)/2 - m g y with x² + y² = l². The reaction is along the rod: T = m (v²/l + g cos θ).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.3.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

MASS, GRAVITY, START = 1.3, 9.81, 2.0
system = mechanics.System(
    lambda t, q, v: MASS * ca.sumsqr(v) / 2 - MASS * GRAVITY * q[1], ("x", "y"),
    constraints=[mechanics.Holonomic(lambda t, q: ca.sumsqr(q) / 2 - 0.5)],
    units=("m", "m"), time_unit="s", name="pendulum on a rod",
)  # fmt: skip


def tension(motion):
    """How far the reactions are from the tension along the rod."""
    t = np.linspace(motion.span[0], motion.span[1], 400)
    q, v = motion.q(t), motion.v(t)
    pull = MASS * ((v**2).sum(axis=0) - GRAVITY * q[1])
    return np.abs(motion.reactions(t) + pull * q).max() / np.abs(pull).max()


def length(motion):
    """How far the bob leaves its circle."""
    return np.abs(np.hypot(*motion.q(np.linspace(motion.span[0], motion.span[1], 2000))) - 1).max()


experiment = mechanics.Experiment(
    system, [np.sin(START), -np.cos(START)], [0.0, 0.0], (0.0, 50.0), None, {"tension": tension, "length": length},
    title="Pendulum on a rod",
)  # fmt: skip
