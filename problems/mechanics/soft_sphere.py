"""Scattering by a soft sphere, a well of constant depth: refraction by n = √(1 + U0/E).

χ = -2 (β - α) with sin β = b/R = n sin α, up to 2 arccos(1/n); the cross-section is
n² R² |(n cos(Θ/2) - 1) (n - cos(Θ/2))|/(4 cos(Θ/2) (1 + n² - 2 n cos(Θ/2))²). The same height as a wall reflects
whole what comes beyond b = R √(1 - U0/E).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 5.6.2; A. G. Abanov,
"Mechanics" (lecture notes, 2012), lect. 6.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

R, ENERGY, DEPTH = 1.3, 0.8, 0.6
N, WALL = np.sqrt(1 + DEPTH / ENERGY), np.sqrt(1 - DEPTH / ENERGY)
well = mechanics.Scattering(lambda r: ca.if_else(r < R, -DEPTH, 0), ENERGY)
wall = mechanics.Scattering(lambda r: ca.if_else(r < R, DEPTH, 0), ENERGY)
IMPACT = R * np.linspace(0, 0.999, 30)
ANGLES = np.linspace(0.05, 0.95, 9) * 2 * np.arccos(1 / N)


def refracted():
    """Angles of the well."""
    known = -2 * (np.arcsin(IMPACT / R) - np.arcsin(IMPACT / (N * R)))
    return np.abs(well.deflection(IMPACT).angle - known).max()


def cross_section():
    """Of the well, and none beyond its largest angle."""
    c = np.cos(ANGLES / 2)
    known = N**2 * R**2 * np.abs((N * c - 1) * (N - c)) / (4 * c * (1 + N**2 - 2 * N * c) ** 2)
    beyond = float(well.cross_section(2.001 * np.arccos(1 / N)))
    return np.abs(well.cross_section(ANGLES) / known - 1).max() + beyond


def reflected():
    """Angles of the wall: refracted away from the centre, or whole reflection."""
    inside = IMPACT < WALL * R
    known = 2 * (np.arcsin(np.where(inside, IMPACT / (WALL * R), 1)) - np.arcsin(IMPACT / R))
    return np.abs(wall.deflection(IMPACT).angle - known).max()


experiment = mechanics.Examination(
    "A soft sphere", {"refracted": refracted, "cross-section": cross_section, "reflected": reflected}
)
