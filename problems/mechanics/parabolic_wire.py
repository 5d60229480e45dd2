"""A bead on a parabolic wire z = k r² that turns about its axis.

L = ((1 + 4 k² r²) r'² + W² r²)/2 - g k r². With w² = 2 g k - W² and r = r0 sin x the time is the second elliptic
integral: w t = E(x | -4 k² r0²). The bottom is stable while W² < 2 g k, with the frequency w.

Source: L. N. Hand, J. D. Finch, "Analytical Mechanics" (1998), ch. 1; A. J. Brizard, "An Introduction to Lagrangian
Mechanics" (2nd ed., 2015), ch. 2, problem 2.
"""

import numpy as np
from scipy.special import ellipeinc

from varcalc import mechanics
from varcalc.problems._roots import increasing_root

G, CURVE, TURN, WIDTH = 9.81, 0.8, 2.5, 1.5


def wire(turn):
    return mechanics.System(
        lambda t, q, v: ((1 + (2 * CURVE * q[0]) ** 2) * v[0] ** 2 + (turn * q[0]) ** 2) / 2 - G * CURVE * q[0] ** 2,
        ("r",), units=("m",), time_unit="s", name="parabolic wire",
    )  # fmt: skip


system = wire(TURN)
W, M = np.sqrt(2 * G * CURVE - TURN**2), -((2 * CURVE * WIDTH) ** 2)


def exact(t):
    """r from the bottom."""
    angle = increasing_root(lambda x: (ellipeinc(x, M), np.sqrt(1 - M * np.sin(x) ** 2)), 0.0, W * t, W * t)
    return (WIDTH * np.sin(angle))[None]


def frequency(_):
    """How far the frequency at the bottom is off; a wire that turns too fast must be told unstable."""
    unstable = wire(1.01 * np.sqrt(2 * G * CURVE)).normal_modes([0.0])
    return abs(system.normal_modes([0.0]).frequencies[0] / W - 1) + float(unstable.stable)


experiment = mechanics.Experiment(
    system, [0.0], [W * WIDTH], (0.0, 12.0), exact, {"frequency": frequency}, title="A bead on a turning parabola"
)  # fmt: skip
