"""The orbits of the charged pendulum seen from the side: the separatrix parts the lower well from the upper one.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 3.10.
"""

from varcalc.problems.figures._charged import MOMENTUM, orbits
from varcalc.study.drawing import Drawing, Line, Panel


def panels():
    """x and z of all three."""
    lines = [Line(places[0], places[2], label=name) for name, (_, _, places) in orbits(MOMENTUM).items()]
    return [[Panel(lines, "x", "z", equal=True)]]


figure = Drawing("A charged pendulum from the side", panels)
