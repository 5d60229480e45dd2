"""Foucault's pendulum: small swings in a plane that turns with ω sin(latitude).

x'' - 2 n y' + w² x = 0 and y'' + 2 n x' + w² y = 0; with z = x + i y, z = exp(-i n t) times an ellipse of frequency
√(w² + n²).

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 39, problem 3.
"""

import numpy as np

from varcalc import mechanics

SWING, TURN = 1.9, 0.05
system = mechanics.System(
    lambda t, q, v: (
        (v[0] ** 2 + v[1] ** 2) / 2 + TURN * (q[0] * v[1] - q[1] * v[0]) - SWING**2 * (q[0] ** 2 + q[1] ** 2) / 2
    ),
    ("x", "y"),
    name="Foucault's pendulum",
)


def exact(t):
    """x and y of a bob that is let go at x = 1."""
    w = np.hypot(SWING, TURN)
    z = np.exp(-1j * TURN * t) * (np.cos(w * t) + 1j * TURN / w * np.sin(w * t))
    return np.stack([z.real, z.imag])


experiment = mechanics.Experiment(system, [1.0, 0.0], [0.0, 0.0], (0.0, 60.0), exact, title="Foucault's pendulum")
