"""A Penning trap: a charge that no field alone would hold, and Liouville's theorem.

L = v²/2 + c (x y' - y x')/2 - w² (2 z² - x² - y²)/4. z oscillates with w, x + i y is a sum of exp(-i f t) with the
frequencies f = (c ± √(c² - 2 w²))/2. The motion is a canonical map: its derivative M fulfils Mᵀ J M = J.

Source: L. S. Brown, G. Gabrielse, "Geonium theory", Reviews of Modern Physics 58 (1986), 233, sect. II; H. Goldstein,
C. Poole, J. Safko, "Classical Mechanics" (3rd ed., 2002), sect. 9.4, 9.9.
"""

import numpy as np

from varcalc import mechanics

TURN, AXIAL, PUSH = 3.0, 1.1, 0.8
system = mechanics.System(
    lambda t, q, v: (
        (v[0] ** 2 + v[1] ** 2 + v[2] ** 2 + TURN * (q[0] * v[1] - q[1] * v[0])) / 2
        - AXIAL**2 * (2 * q[2] ** 2 - q[0] ** 2 - q[1] ** 2) / 4
    ),
    ("x", "y", "z"),
    name="Penning trap",
)
ROOT = np.sqrt(TURN**2 - 2 * AXIAL**2)
FAST, SLOW = (TURN + ROOT) / 2, AXIAL**2 / (TURN + ROOT)


def exact(t):
    """x, y and z from (1, 0, 0.5) with the rate PUSH along y."""
    fast = -(PUSH + SLOW) / ROOT
    w = fast * np.exp(-1j * FAST * t) + (1 - fast) * np.exp(-1j * SLOW * t)
    return np.stack([w.real, w.imag, 0.5 * np.cos(AXIAL * t)])


def liouville(motion):
    """How far Mᵀ J M is from J after the whole time; M is linear here, and its columns are motions."""
    shift = np.zeros((6, 6))  # from rates to momenta: p = v + c (-y, x, 0)/2
    shift[3, 1], shift[4, 0] = -TURN / 2, TURN / 2
    start = (np.eye(6) - shift).T  # rows: states of unit coordinates and momenta
    end = system.ensemble(start[:, :3], start[:, 3:], motion.span)
    m = (np.eye(6) + shift) @ np.hstack([end.q[:, :, -1], end.v[:, :, -1]]).T
    j = np.kron([[0, 1], [-1, 0]], np.eye(3))
    return np.abs(m.T @ j @ m - j).max()


experiment = mechanics.Experiment(
    system, [1.0, 0.0, 0.5], [0.0, PUSH, 0.0], (0.0, 25.0), exact, {"Liouville": liouville}, title="A Penning trap"
)  # fmt: skip
