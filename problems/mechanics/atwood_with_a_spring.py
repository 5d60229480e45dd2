"""Atwood's machine with a spring in its rope.

L = (m x'² + M y'²)/2 + g (m x + M y) - k s²/2 with the stretch s = x + y - l. m x - M y falls uniformly, and s
oscillates about 2 g u/k with the frequency √(k/u), u = m M/(m + M).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 2, problem 4.
"""

import numpy as np

from varcalc import mechanics

G, FIRST, SECOND, STIFF, LENGTH = 9.81, 1.4, 0.6, 25.0, 3.0
system = mechanics.System(
    lambda t, q, v: (
        (FIRST * v[0] ** 2 + SECOND * v[1] ** 2) / 2 + G * (FIRST * q[0] + SECOND * q[1])
        - STIFF * (q[0] + q[1] - LENGTH) ** 2 / 2
    ),
    ("x", "y"),
    units=("m", "m"), time_unit="s", name="Atwood machine with a spring",
)  # fmt: skip
TOTAL, REDUCED, START = FIRST + SECOND, FIRST * SECOND / (FIRST + SECOND), 1.0


def exact(t):
    """x and y from rest, with the spring relaxed."""
    stretch = 2 * G * REDUCED / STIFF * (1 - np.cos(np.sqrt(STIFF / REDUCED) * t))
    apart = FIRST * START - SECOND * (LENGTH - START) + (FIRST - SECOND) * G * t**2 / 2
    return np.stack([SECOND * (LENGTH + stretch) + apart, FIRST * (LENGTH + stretch) - apart]) / TOTAL


experiment = mechanics.Experiment(
    system, [START, LENGTH - START], [0.0, 0.0], (0.0, 2.0), exact, title="Atwood's machine with a spring"
)  # fmt: skip
