"""Circular orbits in the force -k r^(n-1): places of rest of the radius, stable where n > -2.

With the angular momentum l the radius rests at r^(n+2) = l²/(m k), where V'' = (n + 2) l²/(m r⁴).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 8.1.2; H. Goldstein, C. Poole,
J. Safko, "Classical Mechanics" (3rd ed., 2002), sect. 3.6.
"""

import numpy as np

from varcalc import mechanics

MASS, PULL, MOMENTUM = 1.4, 2.3, 1.7
POWERS = -2.5, -1.0, 0.5, 2.0


def orbit(n):
    """The system of the radius alone."""
    plane = mechanics.System(
        lambda t, q, v: MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 - PULL * q[0] ** n / n, ("r", "phi")
    )
    return plane.routhian({"phi": MOMENTUM})


def radius(n):
    return (MOMENTUM**2 / (MASS * PULL)) ** (1 / (n + 2))


def places():
    """How far the places of rest are off: of each force there is one."""
    misses = []
    for n in POWERS:
        found = orbit(n).equilibria([radius(n) / 3], [3 * radius(n)])
        misses.append(abs(found.places[0, 0] / radius(n) - 1) + len(found.places) - 1 + found.unresolved)
    return max(misses)


def frequencies():
    """How far frequencies, or rates of growth, are off; an orbit that is told wrongly stable counts as 1."""
    misses = []
    for n in POWERS:
        modes = orbit(n).normal_modes([radius(n)])
        known = np.sqrt(abs(n + 2)) * MOMENTUM / (MASS * radius(n) ** 2)
        found = modes.frequencies[0] if n > -2 else modes.rates[0]
        misses.append(abs(found / known - 1) + float(modes.stable != (n > -2)))
    return max(misses)


experiment = mechanics.Examination("Circular orbits and their stability", {"radii": places, "frequencies": frequencies})
