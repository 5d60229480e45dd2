"""Rutherford scattering: like and unlike charges, from impact parameters of 1e-6 to 1e6.

tan(χ/2) = k/(2 E b) and dσ/dΩ = (k/4E)²/sin⁴(Θ/2), the same for attraction and repulsion. Angles are held against it
in units of themselves, small as they are.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 5.5; L. D. Landau and
E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 19.
"""

import numpy as np

from varcalc import mechanics

K, ENERGY = 1.3, 0.7
IMPACT, ANGLES = np.geomspace(1e-6, 1e6, 49), np.array([1e-3, 0.1, 1.0, 2.0, 3.0])


def angles(sign):
    """The largest relative error of deflections."""
    found = mechanics.Scattering(lambda r: sign * K / r, ENERGY).deflection(IMPACT).angle
    return np.abs(found / (2 * np.arctan(sign * K / (2 * ENERGY * IMPACT))) - 1).max()


def cross_section(sign):
    """The largest relative error of Rutherford's formula."""
    found = mechanics.Scattering(lambda r: sign * K / r, ENERGY).cross_section(ANGLES)
    return np.abs(found / ((K / (4 * ENERGY)) ** 2 / np.sin(ANGLES / 2) ** 4) - 1).max()


experiment = mechanics.Examination(
    "Rutherford scattering",
    {
        "repelled": lambda: angles(1),
        "attracted": lambda: angles(-1),
        "cross-section, repelled": lambda: cross_section(1),
        "cross-section, attracted": lambda: cross_section(-1),
    },
)
