"""Two bodies that attract each other: a period of Kepler's third law, and a centre of mass that goes straight on.

T = 2π √(a³/(m₁ + m₂)) with G = 1; after it the bodies are where they were, beside the way of their centre of mass.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 13, 15.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

FIRST, SECOND, AXIS, ECCENTRICITY, DRIFT = 1.2, 0.5, 1.3, 0.4, (0.1, -0.2)
TOTAL = FIRST + SECOND
PERIOD = 2 * np.pi * np.sqrt(AXIS**3 / TOTAL)
system = mechanics.System(
    lambda t, q, v: (
        FIRST * ca.sumsqr(v[:2]) / 2 + SECOND * ca.sumsqr(v[2:]) / 2 + FIRST * SECOND / ca.norm_2(q[:2] - q[2:])
    ),
    ("x1", "y1", "x2", "y2"),
    symmetries=[
        mechanics.Symmetry(lambda t, q: [1, 0, 1, 0], name="momentum x"),
        mechanics.Symmetry(lambda t, q: [0, 1, 0, 1], name="momentum y"),
        mechanics.Symmetry(lambda t, q: [-q[1], q[0], -q[3], q[2]], name="angular momentum"),
        mechanics.Symmetry(
            lambda t, q: [t, 0, t, 0], gauge=lambda t, q: FIRST * q[0] + SECOND * q[2], name="boost along x"
        ),
    ],
    name="two bodies",
)
NEAR = AXIS * (1 - ECCENTRICITY)
SPEED = np.sqrt(TOTAL / AXIS * (1 + ECCENTRICITY) / (1 - ECCENTRICITY))
START = [SECOND / TOTAL * NEAR, 0.0, -FIRST / TOTAL * NEAR, 0.0]
RATES = [DRIFT[0], DRIFT[1] + SECOND / TOTAL * SPEED, DRIFT[0], DRIFT[1] - FIRST / TOTAL * SPEED]


def closes(motion):
    """How far the bodies are from where they were a period ago, beside their drift."""
    return np.abs(motion.q(PERIOD) - START - PERIOD * np.tile(DRIFT, 2)).max()


experiment = mechanics.Experiment(
    system, START, RATES, (0.0, PERIOD), None,
    {"period": closes, "invariants": lambda motion: max(motion.drift.values())}, title="Two bodies",
)  # fmt: skip
