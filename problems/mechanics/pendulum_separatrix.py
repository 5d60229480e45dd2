"""The plane pendulum on its separatrix: it comes to the top, and never arrives.

L = v²/2 + cos θ. From the bottom with the rate 2: θ = 2 arctan(sinh t). What it is off grows as exp(t).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5.2.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

system = mechanics.System(
    lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",), units=("rad",), name="pendulum on its separatrix"
)


def exact(t):
    """θ."""
    return 2 * np.arctan(np.sinh(t))[None]


experiment = mechanics.Experiment(system, [0.0], [2.0], (0.0, 6.0), exact, title="A pendulum on its separatrix")
