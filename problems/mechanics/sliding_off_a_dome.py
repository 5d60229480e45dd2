"""A particle slides off a round dome, and leaves it where the dome no longer pushes: at 2/3 of its first height.

L = v²/2 - g y with x² + y² = 1. As on a pendulum let go at π - a: x = 2 k sn dn and y = 2 k² sn² - 1 of √g t + K, with
k = cos(a/2).

Source: L. N. Hand, J. D. Finch, "Analytical Mechanics" (1998), ch. 2; L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd
ed., 1976), sect. 11.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

G, START = 9.81, 0.3
M = np.cos(START / 2) ** 2
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 - G * q[1], ("x", "y"),
    constraints=[mechanics.Holonomic(lambda t, q: ca.sumsqr(q) / 2 - 0.5)],
    units=("m", "m"), time_unit="s", name="particle on a dome",
)  # fmt: skip


def exact(t):
    """x and y."""
    sn, _, dn, _ = ellipj(np.sqrt(G) * t + ellipk(M), M)
    return np.stack([2 * np.sqrt(M) * sn * dn, 2 * M * sn**2 - 1])


leaves = mechanics.Event(lambda t, q, v: G * q[1] - ca.sumsqr(v), "leaves the dome", terminal=True)
experiment = mechanics.Experiment(
    system, [np.sin(START), np.cos(START)], [0.0, 0.0], (0.0, 3.0), exact,
    {
        "height": lambda motion: abs(motion.events[0].q[1] - 2 / 3 * np.cos(START)),
        "push": lambda motion: np.abs(motion.reactions(motion.span[1])).max() / G,
    },
    (leaves,), title="Sliding off a dome",
)  # fmt: skip
