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
    units=("rad", "rad"),
    time_unit="s",
    name="double pendulum",
)


def equations(motion):
    """How far both Euler-Lagrange equations are from being kept, in units of g."""
    t = 0.37 * motion.span[1]
    (a, b), (u, w) = motion.q(t), motion.v(t)
    first, second = system.accelerations(t, [a, b], [u, w])
    upper = 2 * first + second * np.cos(a - b) + w**2 * np.sin(a - b) + 2 * 9.81 * np.sin(a)
    lower = second + first * np.cos(a - b) - u**2 * np.sin(a - b) + 9.81 * np.sin(b)
    return max(abs(upper), abs(lower)) / 9.81


def hamilton(motion):
    """How far Hamilton's four equations are from those that H = T + U gives by hand, in units of g."""
    t = 0.37 * motion.span[1]
    (a, b), (u, w) = motion.q(t), motion.v(t)
    c, s = np.cos(a - b), np.sin(a - b)
    p, r = 2 * u + w * c, w + u * c
    whole = 2 - c**2
    energy = (p**2 + 2 * r**2 - 2 * p * r * c) / (2 * whole)
    turning = (p * r * s * whole - (p**2 + 2 * r**2 - 2 * p * r * c) * c * s) / whole**2  # ∂T/∂a = -∂T/∂b
    known = [
        (p - r * c) / whole, (2 * r - p * c) / whole, -turning - 2 * 9.81 * np.sin(a), turning - 9.81 * np.sin(b)
    ]  # fmt: skip
    found = system.hamiltonian()
    rates = np.concatenate([np.ravel(part) for part in found.equations(t, [a, b], [p, r])])
    total = energy - 9.81 * (2 * np.cos(a) + np.cos(b))
    return max(np.abs(rates - known).max(), abs(found(t, [a, b], [p, r]) - total)) / 9.81


over = mechanics.Event(lambda t, q, v, p: ca.cos(q[1] / 2), "the lower rod upright")
angles = np.linspace(-3.1, 3.1, 80)
experiment = mechanics.Experiment(
    system, [2.0, 2.5], [0.0, 0.0], (0.0, 10.0), None,
    {"energy": lambda motion: motion.drift["energy"] / (3 * 9.81), "equations": equations, "Hamilton": hamilton},
    title="Double pendulum",
    beside=mechanics.Flights(over, angles, angles, (0.0, 30.0)),
)  # fmt: skip
