"""A knife edge on an inclined plane: a constraint of rates that no function of the coordinates replaces.

The edge may slide along its heading (cos φ, sin φ) only. On a plane with the pull a it goes, from rest and turning
with ω, as x = a sin²(ωt)/(2 ω²), y = a (ωt - sin ωt cos ωt)/(2 ω²): it does not run down.

Source: Ju. I. Neimark, N. A. Fufaev, "Dynamics of Nonholonomic Systems" (1972), ch. III.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

PULL, TURN = 2.3, 1.4
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 + v[1] ** 2 + 0.2 * v[2] ** 2) / 2 + PULL * q[0], ("x", "y", "phi"),
    constraints=[mechanics.Pfaffian(lambda t, q: [ca.sin(q[2]), -ca.cos(q[2]), 0])], name="knife edge",
)  # fmt: skip


def exact(t):
    """x, y and φ."""
    angle = TURN * t
    x = PULL * np.sin(angle) ** 2 / (2 * TURN**2)
    y = PULL * (angle - np.sin(angle) * np.cos(angle)) / (2 * TURN**2)
    return np.stack([x, y, angle])


experiment = mechanics.Experiment(
    system, [0.0, 0.0, 0.0], [0.0, 0.0, TURN], (0.0, 20.0), exact, title="A knife edge on a slope"
)  # fmt: skip
