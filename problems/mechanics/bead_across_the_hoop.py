"""A bead on a hoop that turns faster than √(g/R), which swings across the bottom from one side to the other.

θ'² = C + 2 w² cos θ + W² sin²θ with w² = g/R. With u = tan(θ/2) this is biquadratic: u = u0 cn(κt), κ² = D (u0² + b)/4,
m = u0²/(u0² + b), where D = 2 w² - C and b = (C + 2 w²)/(D u0²) > 0. Below W = w the bottom is the only place of rest
near it, with the frequency √(w² - W²); beyond it there are three.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.2, 8.1.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj

from varcalc import mechanics

PULL, TURN, START = 9.81 / 0.8, 5.0, 1.8


def hoop(turn):
    return mechanics.System(
        lambda t, q, v: (v[0] ** 2 + (turn * ca.sin(q[0])) ** 2) / 2 + PULL * ca.cos(q[0]), ("theta",),
        units=("rad",), time_unit="s", name="bead across the hoop",
    )  # fmt: skip


system, SLOW = hoop(TURN), 3.0
OUTER = np.tan(START / 2)
C = -2 * PULL * np.cos(START) - (TURN * np.sin(START)) ** 2
D = 2 * PULL - C
B = (C + 2 * PULL) / (D * OUTER**2)


def exact(t):
    """θ from rest."""
    return 2 * np.arctan(OUTER * ellipj(np.sqrt(D * (OUTER**2 + B)) / 2 * t, OUTER**2 / (OUTER**2 + B))[1])[None]


def rests(_):
    """How far the places of rest are from those that are known, on either side of the critical turning."""
    side = np.arccos(PULL / TURN**2)
    slow, fast = (one.equilibria([-3.0], [3.1]).places[:, 0] for one in (hoop(SLOW), system))
    return max(np.abs(slow - [0]).max(), np.abs(np.sort(fast) - [-side, 0, side]).max())


def frequency(_):
    """How far the frequency of a slow hoop is off."""
    return abs(hoop(SLOW).normal_modes([0.0]).frequencies[0] / np.sqrt(PULL - SLOW**2) - 1)


experiment = mechanics.Experiment(
    system, [START], [0.0], (0.0, 8.0), exact, {"rests": rests, "frequency below": frequency},
    title="A bead across the bottom of its hoop",
)  # fmt: skip
