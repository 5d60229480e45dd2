"""A stone thrown in a frame that turns: the straight line seen from a carousel.

L = |v + Ω × q|²/2, free of forces: in the frame at rest the stone goes straight on.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 39.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

TURN = 0.9
system = mechanics.System(
    mechanics.rotating(lambda t, q, v: ca.sumsqr(v) / 2, (0.0, 0.0, TURN)), ("x", "y", "z"), name="stone on a carousel"
)


def exact(t):
    """The line (1 + a t, b t, c t) seen from the carousel."""
    x, y, z = 1 + 0.3 * t, (0.5 + TURN) * t, 0.2 * t
    c, s = np.cos(TURN * t), np.sin(TURN * t)
    return np.stack([c * x + s * y, -s * x + c * y, z])


experiment = mechanics.Experiment(
    system, [1.0, 0.0, 0.0], [0.3, 0.5, 0.2], (0.0, 10.0), exact, title="A stone seen from a carousel"
)  # fmt: skip
