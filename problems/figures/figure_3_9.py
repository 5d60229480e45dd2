"""Orbits of the charged pendulum in a magnetic field: in the lower well, on the separatrix, in the upper well.

On the sphere in the first row, from above in the second; α = 1 and Ω = 2.5, beyond the threshold. The motion
on the separatrix begins 1e-4 from the crest.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.9.
"""

from varcalc.problems.figures._charged import MOMENTUM, flat, orbits
from varcalc.study.drawing import Drawing, Line, Panel


def panels():
    """One column a case."""
    found = orbits(MOMENTUM)
    space = [
        Panel([Line(*places, colour=0)], "x", "y", "z", title=name, sphere=True)
        for name, (_, _, places) in found.items()
    ]
    return [space, [flat(places, 0, 1) for _, _, places in found.values()]]


figure = Drawing("A charged pendulum in a magnetic field", panels)
