"""Scattering by inverse powers: k/r² in closed form, and what falls into the centre.

Repelled by k/r², χ = π (1 - b/√(b² + k/E)). Attracted by -k/rⁿ, n > 2, orbits with an impact parameter below
b₀ = √(n/(n - 2)) (k (n - 2)/2E)^(1/n) fall into the centre; with n = 2 below √(k/E). The angle diverges next to b₀ as
a logarithm: for n = 4 with the factor 1/√2.

Source: L. D. Landau and E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 18, problems 3, 4 and 5.
"""

import numpy as np

from varcalc import mechanics

K, ENERGY = 0.9, 1.6
IMPACT = np.geomspace(1e-4, 1e4, 33)
square = mechanics.Scattering(lambda r: K / r**2, ENERGY)


def deflected():
    """The largest relative error of the angles."""
    root = np.sqrt(IMPACT**2 + K / ENERGY)
    return np.abs(square.deflection(IMPACT).angle / (np.pi * K / ENERGY / (root * (root + IMPACT))) - 1).max()


def captured(power):
    """The relative error of the area from which orbits are captured."""
    found = mechanics.Scattering(lambda r: -K * r**-power, ENERGY).capture_cross_section
    excess = power - 2
    known = K / ENERGY if excess == 0 else power / excess * (K * excess / (2 * ENERGY)) ** (2 / power)
    return abs(found / (np.pi * known) - 1)


def logarithm():
    """Of -k/r⁴."""
    (orbiting,) = mechanics.Scattering(lambda r: -K * r**-4, ENERGY).orbiting
    return abs(orbiting.logarithm * np.sqrt(2) - 1)


experiment = mechanics.Examination(
    "Inverse powers",
    {
        "repelled by the inverse square": deflected,
        "captured by the third power": lambda: captured(3),
        "captured by the fourth power": lambda: captured(4),
        "captured by the sixth power": lambda: captured(6),
        "logarithm of the fourth power": logarithm,
    },
)
