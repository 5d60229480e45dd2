"""A cart with a rod that turns about it, without weight: the cart shakes as the rod goes round.

L = (M + m) x'²/2 + m l x' θ' cos θ + m l² θ'²/2. With u = m/(M + m) and no momentum along the rails,
θ'² (1 - u cos²θ) is kept: the time is the second elliptic integral, c t = E(θ - π/2 | u), and x + u l sin θ stays.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 2, problem 3, with k = g = 0;
P. F. Byrd, M. D. Friedman, "Handbook of Elliptic Integrals" (2nd ed., 1971), no. 110.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipeinc

from varcalc import mechanics
from varcalc.problems._roots import increasing_root

CART, BOB, LENGTH, RATE = 0.3, 1.2, 0.9, 2.0
SHARE = BOB / (CART + BOB)
system = mechanics.System(
    lambda t, q, v: (
        (CART + BOB) * v[0] ** 2 / 2 + BOB * LENGTH * v[0] * v[1] * ca.cos(q[1]) + BOB * (LENGTH * v[1]) ** 2 / 2
    ),
    ("x", "theta"),
    name="weightless cart",
)


def exact(t):
    """x and θ from θ = π/2, where the cart rests."""
    slope = 1 / np.sqrt(1 - SHARE)
    angle = increasing_root(
        lambda a: (ellipeinc(a, SHARE), np.sqrt(1 - SHARE * np.sin(a) ** 2)), 0.0, slope * RATE * t, RATE * t
    )
    return np.stack([SHARE * LENGTH * (1 - np.cos(angle)), np.pi / 2 + angle])


experiment = mechanics.Experiment(
    system, [0.0, np.pi / 2], [0.0, RATE], (0.0, 12.0), exact, title="A rod that shakes its cart"
)  # fmt: skip
