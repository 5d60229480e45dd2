"""Atwood's compound machine: a pulley in the place of one of the weights.

The acceleration of the first weight is g (4 m₂ m₃ - m₁ (m₂ + m₃)) / (4 m₂ m₃ + m₁ (m₂ + m₃)), upwards.

Source: H. Goldstein, C. Poole, J. Safko, "Classical Mechanics" (3rd ed., 2002), ch. 1; A. J. Brizard, "An
Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.4.
"""

import numpy as np

from varcalc import mechanics

G, FIRST, SECOND, THIRD = 9.81, 3.0, 1.2, 0.7
# x: how far the first weight is below its pulley, y: the second below the pulley that moves
system = mechanics.System(
    lambda t, q, v: (
        (FIRST * v[0] ** 2 + SECOND * (v[1] - v[0]) ** 2 + THIRD * (v[0] + v[1]) ** 2) / 2
        + G * (FIRST * q[0] + SECOND * (q[1] - q[0]) - THIRD * (q[0] + q[1]))
    ),
    ("x", "y"),
    units=("m", "m"),
    time_unit="s",
    name="compound Atwood machine",
)
COUPLED = FIRST * (SECOND + THIRD)
DOWN = G * (COUPLED - 4 * SECOND * THIRD) / (COUPLED + 4 * SECOND * THIRD)


def exact(t):
    """Both fall uniformly; the lower pulley falls with -DOWN, in which its two weights feel g + DOWN."""
    return np.stack([DOWN * t**2 / 2, (SECOND - THIRD) / (SECOND + THIRD) * (G + DOWN) * t**2 / 2])


experiment = mechanics.Experiment(
    system, [0.0, 0.0], [0.0, 0.0], (0.0, 3.0), exact, title="Atwood's compound machine"
)  # fmt: skip
