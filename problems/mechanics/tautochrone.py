"""The tautochrone: a bead on a cycloid, which comes to the bottom in π √(a/g) from every height.

x = a (φ + sin φ), z = a (1 - cos φ): L = a² φ'² (1 + cos φ) - g a (1 - cos φ). The arc 4 a sin(φ/2) oscillates with
the frequency √(g/a)/2, however far.

Source: C. Huygens, "Horologium Oscillatorium" (1673), part II; L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed.,
1976), sect. 11, 12.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, SIZE, HEIGHTS = 9.81, 0.7, (2.6, 0.4)
system = mechanics.System(
    lambda t, q, v: (SIZE * v[0]) ** 2 * (1 + ca.cos(q[0])) - G * SIZE * (1 - ca.cos(q[0])), ("phi",),
    units=("rad",), time_unit="s", name="bead on a cycloid",
)  # fmt: skip
bottom = mechanics.Event(lambda t, q, v: q[0], "bottom")


def exact(t):
    """φ from rest."""
    return 2 * np.arcsin(np.sin(HEIGHTS[0] / 2) * np.cos(np.sqrt(G / SIZE) / 2 * t))[None]


def time(motion):
    """How far the times to the bottom from both heights are off."""
    low = system.motion([HEIGHTS[1]], [0.0], motion.span, events=[bottom])
    return max(abs(one.events[0].t - np.pi * np.sqrt(SIZE / G)) for one in (motion, low))


experiment = mechanics.Experiment(
    system, [HEIGHTS[0]], [0.0], (0.0, 6.0), exact, {"time to the bottom": time}, (bottom,), title="The tautochrone"
)  # fmt: skip
