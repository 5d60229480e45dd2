"""A damped oscillator: a force that no Lagrangian of the coordinate alone gives.

x'' + 2 d x' + x = 0 from x = 1 at rest: x = exp(-d t) (cos wt + (d/w) sin wt), w² = 1 - d².

Source: H. Goldstein, C. Poole, J. Safko, "Classical Mechanics" (3rd ed., 2002), sect. 1.5, 6.5.
"""

import numpy as np

from varcalc import mechanics

DAMPING = 0.15
W = np.sqrt(1 - DAMPING**2)
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",), forces=lambda t, q, v: [-2 * DAMPING * v[0]],
    name="damped oscillator",
)  # fmt: skip


def exact(t):
    """x."""
    return (np.exp(-DAMPING * t) * (np.cos(W * t) + DAMPING / W * np.sin(W * t)))[None]


experiment = mechanics.Experiment(system, [1.0], [0.0], (0.0, 30.0), exact, title="A damped oscillator")
