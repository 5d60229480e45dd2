"""The cubic potential x - x³/3 for ten periods, by Weierstrass's function.

With x = 6 ℘ the energy's x'² = 2E - 2x + 2x³/3 becomes ℘'² = 4℘³ - g₂ ℘ - g₃, g₂ = 1/3 and g₃ = -E/18. The bound
motion is ℘ on the line half an imaginary period off the real one, where theta functions give
℘ = e₁ - (π θ₃ θ₄/2ω)² (θ₃(v)/θ₄(v))², v = π t/2ω, 2ω the real period.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 3.5, app. A.2.2; National
Institute of Standards and Technology, "Digital Library of Mathematical Functions", 20.2, 23.6.5, 22.2.
"""

import numpy as np
from scipy.special import ellipk

from varcalc import mechanics

ENERGY = 0.3
LOW, MIDDLE, HIGH = np.sort(np.roots([4.0, 0.0, -1 / 3, ENERGY / 18]).real)  # e₃, e₂, e₁
M = (MIDDLE - LOW) / (HIGH - LOW)
HALF = ellipk(M) / np.sqrt(HIGH - LOW)
NOME = np.exp(-np.pi * ellipk(1 - M) / ellipk(M))
TERMS = np.arange(1, 8)[:, None]

system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] + q[0] ** 3 / 3, ("x",), name="cubic potential")


def theta(v, sign):
    """θ₃ (``sign`` 1) and θ₄ (-1), whose series end soon: the nome is small."""
    return 1 + 2 * np.sum(sign**TERMS * NOME ** (TERMS**2) * np.cos(2 * TERMS * v), axis=0)


def exact(t):
    """x from the lower turning point."""
    v, factor = np.pi * t / (2 * HALF), np.pi * theta(0.0, 1) * theta(0.0, -1) / (2 * HALF)
    return 6 * (HIGH - (factor * theta(v, 1) / theta(v, -1)) ** 2)[None]


experiment = mechanics.Experiment(
    system, [6 * LOW], [0.0], (0.0, 20 * HALF), exact, title="The cubic potential by Weierstrass's function"
)
