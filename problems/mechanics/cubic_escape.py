"""The cubic potential x - x³/3 above its hill: a motion that comes back from its turning point and runs away for good.

With the one real root a of E - x + x³/3, the others b ± i c, and H = √((b - a)² + c²): x = a + H (1 - cn)/(1 + cn) of
√(2 H/3) t, with m = (1 + (b - a)/H)/2. It is at infinity after 2 K/√(2 H/3).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5; P. F. Byrd, M. D. Friedman,
"Handbook of Elliptic Integrals" (2nd ed., 1971), no. 239.
"""

import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

ENERGY = 0.75
ROOTS = np.roots([1 / 3, 0, -1, ENERGY])
A, PAIR = ROOTS[np.argmin(ROOTS.real)].real, ROOTS[np.argmax(ROOTS.imag)]
H = abs(PAIR - A)
RATE, M = np.sqrt(2 * H / 3), (1 + (PAIR.real - A) / H) / 2
system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] + q[0] ** 3 / 3, ("x",), name="escape over a hill")


def exact(t):
    """x from rest."""
    cn = ellipj(RATE * t, M)[1]
    return (A + H * (1 - cn) / (1 + cn))[None]


experiment = mechanics.Experiment(
    system, [A], [0.0], (0.0, 0.8 * 2 * ellipk(M) / RATE), exact, title="Escape over the hill of a cubic potential"
)  # fmt: skip
