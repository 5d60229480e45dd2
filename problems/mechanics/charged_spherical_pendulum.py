"""A charged spherical pendulum in a magnetic field, which turns forwards and backwards.

L = θ'²/2 + sin²θ (φ'²/2 - W φ') - 1 + cos θ, with Larmor's frequency W and the momentum a = sin²θ (φ' - W). With
u = cos θ, u'² = 2 (1 - u²)(E - 1 + u) - (a + W (1 - u²))² has four roots here: u by Jacobi's functions, φ by integrals
of the third kind. Beyond the threshold W² = a²/(c w)² + 1/w, w = (√(c² + 4) - c)/2, c³ = 4 a², the effective potential
has a second well.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.6; P. F. Byrd, M. D. Friedman,
"Handbook of Elliptic Integrals" (2nd ed., 1971), no. 257.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj

from varcalc import mechanics
from varcalc.problems.mechanics._elliptic import third_kind

LARMOR, MOMENTUM, START = 3.0, -1.0, 0.312


def pendulum(larmor):
    return mechanics.System(
        lambda t, q, v: v[0] ** 2 / 2 + ca.sin(q[0]) ** 2 * (v[1] ** 2 / 2 - larmor * v[1]) + ca.cos(q[0]),
        ("theta", "phi"), name="charged spherical pendulum",
    )  # fmt: skip


system = pendulum(LARMOR)
OUT = np.polynomial.Polynomial([1, 0, -1])  # 1 - u²
ENERGY = 1 - np.cos(START) + (MOMENTUM / np.sin(START) + LARMOR * np.sin(START)) ** 2 / 2
SQUARE = 2 * OUT * np.polynomial.Polynomial([ENERGY - 1, 1]) - (MOMENTUM + LARMOR * OUT) ** 2  # u'²
R4, R3, R2, R1 = np.sort(SQUARE.roots().real)
KAPPA = LARMOR * np.sqrt((R1 - R3) * (R2 - R4)) / 2
M, N = (R1 - R2) * (R3 - R4) / ((R1 - R3) * (R2 - R4)), (R1 - R2) / (R2 - R4)


def exact(t):
    """θ and φ from the lowest point: u = (r1 + r4 N sn²)/(1 + N sn²)."""
    sn, _, _, angle = ellipj(KAPPA * t, M)
    phi = LARMOR * t
    for pole in (-1, 1):  # 1/(1 - u²) is half of 1/(1 - u) + 1/(1 + u)
        near, ratio = 1 - pole * R1, (1 - pole * R1) / (1 - pole * R4)
        phi += MOMENTUM / (2 * near) * (ratio * t + (1 - ratio) / KAPPA * third_kind(-N / ratio, angle, M))
    return np.stack([np.arccos((R1 + R4 * N * sn**2) / (1 + N * sn**2)), phi])


def threshold(_):
    """Zero if the second well opens between a little below the threshold and a little above."""
    c = (4 * MOMENTUM**2) ** (1 / 3)
    w = (np.sqrt(c**2 + 4) - c) / 2
    at = np.sqrt((MOMENTUM / (c * w)) ** 2 + 1 / w)
    rests = [pendulum(f * at).routhian({"phi": MOMENTUM}).equilibria([0.1], [3.0]).places for f in (0.999, 1.001)]
    return float([len(places) for places in rests] != [1, 3])


experiment = mechanics.Experiment(
    system, [START, 0.0], [0.0, MOMENTUM / np.sin(START) ** 2 + LARMOR], (0.0, 12.0), exact, {"threshold": threshold},
    title="A charged spherical pendulum",
)  # fmt: skip
