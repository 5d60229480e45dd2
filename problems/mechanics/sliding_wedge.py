"""A block that slides down a wedge, which slides away under it.

With s the way down the wedge and X the wedge's place: s'' = g sin a (M + m)/(M + m sin²a) and
X'' = -m g sin a cos a/(M + m sin²a); the momentum along the floor is kept.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 5; A. J. Brizard, "An Introduction to
Lagrangian Mechanics" (2nd ed., 2015), ch. 2, problem 5.
"""

import numpy as np

from varcalc import mechanics

G, BLOCK, WEDGE, SLOPE = 9.81, 0.7, 2.0, 0.5
SINE, COSINE = np.sin(SLOPE), np.cos(SLOPE)
system = mechanics.System(
    lambda t, q, v: (
        (WEDGE + BLOCK) * v[0] ** 2 / 2 + BLOCK * (v[1] ** 2 / 2 + v[0] * v[1] * COSINE) + BLOCK * G * SINE * q[1]
    ),
    ("X", "s"),
    units=("m", "m"),
    time_unit="s",
    name="block on a wedge",
)


def exact(t):
    """X and s from rest."""
    rate = G * SINE / (WEDGE + BLOCK * SINE**2)
    return np.stack([-BLOCK * COSINE * rate * t**2 / 2, (WEDGE + BLOCK) * rate * t**2 / 2])


experiment = mechanics.Experiment(system, [0.0, 0.0], [0.0, 0.0], (0.0, 2.0), exact, title="A block on a wedge")
