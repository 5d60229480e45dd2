"""The plane pendulum, swung out to one radian.

L = v²/2 + (g/l) cos θ. θ = 2 arcsin(k sn(ωt + K, k)) with k = sin(θ₀/2), ω² = g/l, and the period 4 K/ω.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 11; A. J. Brizard, "An Introduction to
Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

AMPLITUDE = 1.0
system = mechanics.System(
    lambda t, q, v, p: v[0] ** 2 / 2 + p.g / p.l * ca.cos(q[0]), ("theta",), parameters={"g": 9.81, "l": 1.0},
    units=("rad",), time_unit="s", name="plane pendulum",
)  # fmt: skip
K, OMEGA = np.sin(AMPLITUDE / 2), np.sqrt(9.81)
PERIOD = 4 * ellipk(K**2) / OMEGA


def exact(t):
    """θ by Jacobi's functions."""
    return 2 * np.arcsin(K * ellipj(OMEGA * t + ellipk(K**2), K**2)[0])[None]


experiment = mechanics.Experiment(
    system, [AMPLITUDE], [0.0], (0.0, 10 * PERIOD), exact,
    {"period": lambda motion: abs(motion.events[1].t - PERIOD)},
    (mechanics.Event(lambda t, q, v, p: v[0], "turning point"),),
    title="Plane pendulum",
)  # fmt: skip
