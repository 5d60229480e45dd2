"""A lever that is out of balance, let go with its heavier side up.

θ'' = g cos θ (m2 R2 - m1 R1)/(m1 R1² + m2 R2²): θ - π/2 swings as a pendulum that is let go at θ0 - π/2,
by Jacobi's sn. At m1 R1 = m2 R2 the lever rests at every tilt.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.2.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

G, FIRST, SECOND, ARM, OTHER, START = 9.81, 1.5, 0.9, 0.6, 1.4, -0.5


def lever(second):
    """The lever of two weights at its arms, tilted by θ towards the second."""
    return mechanics.System(
        lambda t, q, v: (
            (FIRST * ARM**2 + second * OTHER**2) * v[0] ** 2 / 2 + G * (second * OTHER - FIRST * ARM) * ca.sin(q[0])
        ),
        ("theta",),
        units=("rad",),
        time_unit="s",
        name="lever",
    )


system = lever(SECOND)
OMEGA = np.sqrt(G * (SECOND * OTHER - FIRST * ARM) / (FIRST * ARM**2 + SECOND * OTHER**2))
K = np.sin((np.pi / 2 - START) / 2)


def exact(t):
    """θ."""
    return np.pi / 2 - 2 * np.arcsin(K * ellipj(OMEGA * t + ellipk(K**2), K**2)[0])[None]


def balance(_):
    """The acceleration of a lever whose weights go as its arms do the other way round."""
    return abs(float(lever(FIRST * ARM / OTHER).accelerations(0.0, [0.4], [0.0])[0]))


experiment = mechanics.Experiment(
    system, [START], [0.0], (0.0, 10.0), exact, {"balance": balance}, title="A lever out of balance"
)  # fmt: skip
