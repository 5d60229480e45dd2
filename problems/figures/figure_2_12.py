"""A particle inside a cone, seen from the side and from above.

The distance from the vertex goes to and fro between two values while the orbit turns about the axis.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 2.12.
"""

import numpy as np

from varcalc.problems.mechanics.cone import HIGH, MOMENTUM, OPENING, PERIOD, SINE, system
from varcalc.study.drawing import Drawing, Line, Panel, Points


def panels():
    """x and z, x and y, over ten periods of the distance."""
    rate = MOMENTUM / (HIGH * SINE) ** 2
    motion = system.motion([HIGH, 0.0], [0.0, rate], (0.0, 10 * PERIOD))
    s, phi = motion.q(np.linspace(0.0, 10 * PERIOD, 3001))
    x, y, z = s * np.sin(OPENING) * np.cos(phi), s * np.sin(OPENING) * np.sin(phi), s * np.cos(OPENING)
    reach = HIGH * np.sin(OPENING)
    wall = Line([-reach, 0.0, reach], [HIGH * np.cos(OPENING), 0.0, HIGH * np.cos(OPENING)], dashed=True)
    return [[
        Panel([Line(x, z), wall, Points(x[:1], z[:1])], "x", "z", title="from the side", equal=True),
        Panel([Line(x, y), Points(x[:1], y[:1])], "x", "y", title="from above", equal=True),
    ]]  # fmt: skip


figure = Drawing("A particle inside a cone", panels)
