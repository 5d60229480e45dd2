"""A disc that rolls upright on a slope and turns as it does: as the knife edge, it does not run down.

x' = r ψ' cos φ and y' = r ψ' sin φ with φ = wt. With the pull a along x and b = a/(1 + I/(m r²)), from rest:
x = b sin²(wt)/(2 w²), y = b (wt - sin wt cos wt)/(2 w²), r ψ = b (1 - cos wt)/w². Friction holds it on its way.

Source: Ju. I. Neimark, N. A. Fufaev, "Dynamics of Nonholonomic Systems" (1972), ch. III.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

PULL, TURN, RADIUS = 2.3, 1.4, 0.5
system = mechanics.System(
    lambda t, q, v: (
        (v[0] ** 2 + v[1] ** 2 + RADIUS**2 * (v[2] ** 2 / 4 + v[3] ** 2 / 2)) / 2 + PULL * q[0]
    ),
    ("x", "y", "phi", "psi"),
    constraints=[
        mechanics.Pfaffian(lambda t, q: [1, 0, 0, -RADIUS * ca.cos(q[2])]),
        mechanics.Pfaffian(lambda t, q: [0, 1, 0, -RADIUS * ca.sin(q[2])]),
    ],
    name="rolling disc",
)  # fmt: skip
SLOWED = PULL / 1.5


def exact(t):
    """x, y, φ and ψ."""
    sine, cosine, size = np.sin(TURN * t), np.cos(TURN * t), SLOWED / TURN**2
    return np.stack([
        size * sine**2 / 2, size * (TURN * t - sine * cosine) / 2, TURN * t, size * (1 - cosine) / RADIUS
    ])  # fmt: skip


def friction(motion):
    """How far the reactions at the point of contact are from what keeps the centre on its way."""
    t = np.linspace(motion.span[0], motion.span[1], 200)
    known = SLOWED * np.stack([np.cos(2 * TURN * t), np.sin(2 * TURN * t)]) - [[PULL], [0.0]]
    return np.abs(motion.reactions(t)[:2] - known).max() / PULL


experiment = mechanics.Experiment(
    system, [0.0] * 4, [0.0, 0.0, TURN, 0.0], (0.0, 20.0), exact, {"friction": friction}, title="A disc on a slope"
)  # fmt: skip
