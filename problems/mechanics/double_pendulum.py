"""The double pendulum, far out: chaotic, with its energy kept; and how long it takes the lower rod to go over the top.

L = v₁² + v₂²/2 + v₁ v₂ cos(θ₁ - θ₂) + 2 g cos θ₁ + g cos θ₂, both rods and bobs alike.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.2.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

system = mechanics.System(
    lambda t, q, v, p: (
        v[0] ** 2 + v[1] ** 2 / 2 + v[0] * v[1] * ca.cos(q[0] - q[1]) + p.g * (2 * ca.cos(q[0]) + ca.cos(q[1]))
    ),
    ("theta1", "theta2"),
    parameters={"g": 9.81},
    name="double pendulum",
)

over = mechanics.Event(lambda t, q, v, p: ca.cos(q[1] / 2), "the lower rod upright")
angles = np.linspace(-3.1, 3.1, 80)
experiment = mechanics.Experiment(
    system, [2.0, 2.5], [0.0, 0.0], (0.0, 10.0), None,
    {"energy": lambda motion: motion.drift["energy"] / (3 * 9.81)}, title="Double pendulum",
    beside=mechanics.Flights(over, angles, angles, (0.0, 30.0)),
)  # fmt: skip
