"""Scattering by a hard sphere, about the centre of mass and in the laboratory.

b = R cos(Θ/2): the cross-section is R²/4 in every direction, π R² in all. In the laboratory, for a mass ratio α < 1,
it is R²/4 (2 α cos θ + (1 + α² cos 2θ)/√(1 - α² sin² θ)), whose integral is π R² again.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 5.6.1; A. G. Abanov,
"Mechanics" (lecture notes, 2012), lect. 6.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

R, ENERGY = 1.7, 0.4
sphere = mechanics.Scattering(lambda r: ca.if_else(r < R, ca.inf, 0), ENERGY)
collision = mechanics.Collision(1.0, 2.5)
IMPACT, ANGLES = np.linspace(0, 2, 41), np.linspace(0.2, 3.0, 8)


def angles():
    """Within the sphere, and beside it."""
    return np.abs(sphere.deflection(IMPACT).angle - 2 * np.arccos(np.minimum(IMPACT / R, 1))).max()


def in_the_laboratory():
    """The relative error at some angles."""
    alpha, cosine = collision.mass_ratio, np.cos(ANGLES)
    known = 2 * alpha * cosine + (1 + alpha**2 * np.cos(2 * ANGLES)) / np.sqrt(1 - alpha**2 * np.sin(ANGLES) ** 2)
    found = collision.laboratory_cross_section(sphere.cross_section, ANGLES)
    return np.abs(found / (R**2 / 4 * known) - 1).max()


def area_in_the_laboratory():
    """The integral over all directions, by Gauss's rule in cos θ."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    found = collision.laboratory_cross_section(sphere.cross_section, np.arccos(nodes))
    return abs(2 * np.pi * float(weights @ found) / sphere.total_cross_section - 1)


experiment = mechanics.Examination(
    "A hard sphere",
    {
        "angles": angles,
        "cross-section": lambda: np.abs(sphere.cross_section(ANGLES) / (R**2 / 4) - 1).max(),
        "whole cross-section": lambda: abs(sphere.total_cross_section / (np.pi * R**2) - 1),
        "in the laboratory": in_the_laboratory,
        "area in the laboratory": area_in_the_laboratory,
    },
)
