"""Scattering by an oscillator's potential that ends at a radius: k (r² - R²)/2 inside, nothing outside.

Inside, orbits are arcs of ellipses about the centre, or of hyperbolas where k < 0. With A = 1 + κ R², κ = k/2E, the
angle from the closest approach to the edge is (arcsin((A R² - 2 b²)/(R² √(A² - 4 κ b²))) + π/2)/2. The edge is a kink.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.4, 5.4.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

R, ENERGY = 1.7, 1.3
IMPACT = R * np.linspace(0.05, 0.99, 20)


def scattering(stiffness):
    """What scatters."""
    return mechanics.Scattering(lambda r: ca.fmin(r**2 - R**2, 0) * stiffness / 2, ENERGY)


def exact(stiffness, b):
    """The deflection."""
    kappa = stiffness / (2 * ENERGY)
    whole = 1 + kappa * R**2
    root = np.sqrt(whole**2 - 4 * kappa * b**2)
    inside = (np.arcsin((whole * R**2 - 2 * b**2) / (R**2 * root)) + np.pi / 2) / 2
    return np.pi - 2 * (inside + np.arcsin(b / R))


def off(stiffness):
    """The largest error of the angles."""
    return np.abs(scattering(stiffness).deflection(IMPACT).angle - exact(stiffness, IMPACT)).max()


experiment = mechanics.Examination(
    "A truncated oscillator",
    {
        "attracted": lambda: off(2.0),
        "repelled": lambda: off(-0.5),
        "whole cross-section": lambda: abs(scattering(2.0).total_cross_section / (np.pi * R**2) - 1),
    },
)
