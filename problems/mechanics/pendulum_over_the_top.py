"""The plane pendulum, pushed hard enough to go round.

L = v²/2 + cos θ. From the bottom with the rate c > 2: θ = 2 am(c t/2 | 4/c²), once round in 4 K/c.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5.2.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

RATE = 2.05
M = 4 / RATE**2
system = mechanics.System(
    lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",), units=("rad",), name="pendulum that goes round"
)


def exact(t):
    """θ by Jacobi's amplitude."""
    return 2 * ellipj(RATE * t / 2, M)[3][None]


experiment = mechanics.Experiment(
    system, [0.0], [RATE], (0.0, 20.0), exact,
    {"period": lambda motion: abs(motion.events[0].t - 4 * ellipk(M) / RATE)},
    (mechanics.Event(lambda t, q, v: q[0] - 2 * np.pi, "once round"),), title="A pendulum that goes round",
)  # fmt: skip
