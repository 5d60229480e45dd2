"""A charge that an electric field pulls to the speed of light.

L = -√(1 - v²) + E x in units of the mass and of c: x = (√(1 + (E t)²) - 1)/E.

Source: L. D. Landau, E. M. Lifshitz, "The Classical Theory of Fields" (4th ed., 1975), sect. 20.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

PULL = 0.8
system = mechanics.System(lambda t, q, v: -ca.sqrt(1 - v[0] ** 2) + PULL * q[0], ("x",), name="relativistic charge")


def exact(t):
    """x."""
    return ((PULL * t) ** 2 / (np.sqrt(1 + (PULL * t) ** 2) + 1) / PULL)[None]


experiment = mechanics.Experiment(system, [0.0], [0.0], (0.0, 10.0), exact, title="A relativistic charge")
