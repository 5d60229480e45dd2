"""Retrograde motion of the charged pendulum: α = -1 in the place of 1, and φ goes backwards on part of the way.

θ over φ, from above, and from the side; in the lower well, on the separatrix, in the upper well.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.11.
"""

from varcalc.problems.figures._charged import MOMENTUM, flat, orbits
from varcalc.study.drawing import Drawing, Line, Panel


def panels():
    """One column a case."""
    found = orbits(-MOMENTUM)
    angles = [Panel([Line(phi, theta)], "φ", "θ", title=name) for name, (theta, phi, _) in found.items()]
    return [angles, *([flat(places, 0, k) for _, _, places in found.values()] for k in (1, 2))]


figure = Drawing("Retrograde motion of a charged pendulum", panels)
