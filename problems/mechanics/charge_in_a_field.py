"""A charge in crossed electric and magnetic fields: a circle that drifts.

L = m v²/2 + e (v·A - Φ) with A = B (-y, x)/2 and Φ = -E x. The circle goes round with ω = e B/m and drifts by E/B.

Source: L. D. Landau, E. M. Lifshitz, "The Classical Theory of Fields" (4th ed., 1975), sect. 21, 22.
"""

import numpy as np

from varcalc import mechanics

FIELD, PULL, MASS, CHARGE = 1.7, 0.4, 0.9, 1.1
system = mechanics.System(
    mechanics.charged(MASS, CHARGE, lambda t, q: [-FIELD * q[1] / 2, FIELD * q[0] / 2], lambda t, q: -PULL * q[0]),
    ("x", "y"),
    name="charge in crossed fields",
)
OMEGA, DRIFT = CHARGE * FIELD / MASS, PULL / FIELD


def exact(t):
    """The cycloid of a charge that starts with the velocity (1, 0) at the origin: m x'' = e E + e B y'."""
    u, w = 1.0, DRIFT  # in the frame that drifts with (0, -E/B)
    x = (u * np.sin(OMEGA * t) + w * (1 - np.cos(OMEGA * t))) / OMEGA
    y = (w * np.sin(OMEGA * t) - u * (1 - np.cos(OMEGA * t))) / OMEGA - DRIFT * t
    return np.stack([x, y])


experiment = mechanics.Experiment(
    system, [0.0, 0.0], [1.0, 0.0], (0.0, 20.0), exact, title="A charge in crossed fields"
)  # fmt: skip
