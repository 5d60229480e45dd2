"""A well with a way out: the cubic potential x - x³/3.

Between the roots a < b < c of E - x + x³/3 the motion is x = a + (b - a) sn²(κ t), κ² = (c - a)/6,
k² = (b - a)/(c - a).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5.
"""

import numpy as np
from scipy.special import ellipj

from varcalc import mechanics

ENERGY = 0.3
A, B, C = np.sort(np.roots([1 / 3, 0, -1, ENERGY]).real)
system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] + q[0] ** 3 / 3, ("x",), name="cubic potential")


def exact(t):
    """x by Jacobi's function."""
    return (A + (B - A) * ellipj(np.sqrt((C - A) / 6) * t, (B - A) / (C - A))[0] ** 2)[None]


experiment = mechanics.Experiment(system, [A], [0.0], (0.0, 15.0), exact, title="The cubic potential")
