"""The cubic potential x - x³/3 at the height of its hill: x = 1 - 3/cosh²(t/√2) goes to the top and stays.

L = v²/2 - x + x³/3 at the energy 2/3. What it is off grows as exp(√2 t).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5.
"""

import numpy as np

from varcalc import mechanics

system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] + q[0] ** 3 / 3, ("x",), name="cubic separatrix")


def exact(t):
    """x."""
    return (1 - 3 / np.cosh(t / np.sqrt(2)) ** 2)[None]


experiment = mechanics.Experiment(
    system, [-2.0], [0.0], (0.0, 4.0), exact, title="The separatrix of the cubic potential"
)  # fmt: skip
