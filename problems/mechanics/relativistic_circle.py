"""A fast charge in a magnetic field: it goes round slower the more energy it has.

L = -√(1 - v²) + v·A in units of the mass, the charge and of c, with A = B (-y, x)/2: a circle with w = B/γ and the
radius γ v/B, γ = 1/√(1 - v²).

Source: L. D. Landau, E. M. Lifshitz, "The Classical Theory of Fields" (4th ed., 1975), sect. 21.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

FIELD, GAMMA = 1.4, 5.0
SPEED, OMEGA = np.sqrt(1 - GAMMA**-2), FIELD / GAMMA
system = mechanics.System(
    lambda t, q, v: -ca.sqrt(1 - ca.sumsqr(v)) + FIELD * (q[0] * v[1] - q[1] * v[0]) / 2, ("x", "y"),
    name="relativistic circle",
)  # fmt: skip


def exact(t):
    """x and y."""
    return SPEED / OMEGA * np.stack([np.sin(OMEGA * t), np.cos(OMEGA * t) - 1])


experiment = mechanics.Experiment(
    system, [0.0, 0.0], [SPEED, 0.0], (0.0, 60.0), exact,
    {"energy": lambda motion: abs(float(motion.energy(0.0)) / GAMMA - 1)}, title="A fast charge in a magnetic field",
)  # fmt: skip
