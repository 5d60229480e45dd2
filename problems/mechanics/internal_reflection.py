"""Internal reflection inside a well of constant depth: chords, and the angle between one and the next.

Inside, r = r_t sec φ with r_t = l/√(2 m (E + U0)); the wall at R is met at Θ = arccos(r_t/R) from the closest
approach, after m √(R² - r_t²)/p, and what is thrown back goes round by 2Θ from one chord to the next.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.5.
"""

import numpy as np

from varcalc import mechanics

MASS, DEPTH, R, MOMENTUM, ENERGY = 1.3, 2.0, 1.7, 0.9, -0.4
inside = mechanics.System(
    lambda t, q, v: MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + DEPTH, ("r", "phi"), name="inside a well"
)
(chord,) = inside.reduced({"phi": MOMENTUM}).orbits(ENERGY)
SPEED = np.sqrt(2 * (ENERGY + DEPTH) / MASS)
NEAREST = MOMENTUM / (MASS * SPEED)


def straight():
    """The angles to some radii."""
    angles = np.linspace(0.1, 1.4, 9)
    return np.abs(chord.angle(NEAREST / np.cos(angles))["phi"] - angles).max()


experiment = mechanics.Examination(
    "Internal reflection",
    {
        "closest approach": lambda: abs(chord.low / NEAREST - 1),
        "chord": straight,
        "angle at the wall": lambda: abs(float(chord.angle(R)["phi"]) - np.arccos(NEAREST / R)),
        "time to the wall": lambda: abs(float(chord.time(R)) * SPEED / np.sqrt(R**2 - NEAREST**2) - 1),
    },
)
