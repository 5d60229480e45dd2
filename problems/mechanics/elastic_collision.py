"""An elastic collision of two bodies, about the centre of mass and in the laboratory.

With a target at rest and α = m1/m2, tan θ = sin Θ/(α + cos Θ), the target recoils under (π - Θ)/2, and speeds are
v1 = u √(1 + 2 α cos Θ + α²)/(1 + α), v2 = 2 α u sin(Θ/2)/(1 + α), u being that of the projectile.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 5.2, 5.3, eq. 5.7 to 5.10.
"""

import numpy as np

from varcalc import mechanics

FIRST, SECOND, SPEED, DEFLECTION = 1.3, 2.1, 0.7, 1.9
light, heavy = mechanics.Collision(FIRST, SECOND), mechanics.Collision(SECOND, FIRST)
ALPHA = FIRST / SECOND
direction = np.array([np.cos(DEFLECTION), np.sin(DEFLECTION)])
after, recoil = light.after([SPEED, 0.0], [0.0, 0.0], direction)


def kept():
    """Momentum and energy, in units of themselves."""
    momentum = np.abs(FIRST * after + SECOND * recoil - [FIRST * SPEED, 0]).max() / (FIRST * SPEED)
    energy = (FIRST * after @ after + SECOND * recoil @ recoil) / (FIRST * SPEED**2) - 1
    return momentum + abs(energy)


def speeds():
    """The closed forms."""
    first = SPEED * np.sqrt(1 + 2 * ALPHA * np.cos(DEFLECTION) + ALPHA**2) / (1 + ALPHA)
    second = 2 * ALPHA * SPEED * np.sin(DEFLECTION / 2) / (1 + ALPHA)
    return abs(np.hypot(*after) / first - 1) + abs(np.hypot(*recoil) / second - 1)


def angles():
    """In the laboratory, from the velocities and by the formulas."""
    first = np.arctan2(after[1], after[0]) - light.laboratory_angle(DEFLECTION)
    return abs(first) + abs(np.arctan2(-recoil[1], recoil[0]) - light.recoil_angle(DEFLECTION))


def back():
    """Both deflections of a heavy projectile that come out under one angle, and its largest angle."""
    inside = 0.6 * heavy.largest_laboratory_angle
    both = heavy.centre_of_mass_angles(inside)
    largest = np.arctan2(np.sqrt(1 - ALPHA**2), 1 / ALPHA - ALPHA)
    return np.abs(heavy.laboratory_angle(both) - inside).max() + abs(heavy.largest_laboratory_angle - largest)


experiment = mechanics.Examination(
    "An elastic collision", {"kept": kept, "speeds": speeds, "angles": angles, "back": back}
)
