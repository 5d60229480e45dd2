"""A bead on a turning hoop from θ = π/3 at rest, where Ω² is less than g/R, equal to it, and more.

It swings about the bottom, or about arccos(g/(Ω² R)); at Ω² = g/R the bottom is only just stable.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 2.7.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

CASES = {"(a) Ω² = 0.5 g/R": 0.5, "(b) Ω² = g/R": 1.0, "(c) Ω² = 3 g/R": 3.0}


def hoop(square):
    """With this Ω², in units of g/R."""
    return mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 + p.square * ca.sin(q[0]) ** 2) / 2 + ca.cos(q[0]), ("theta",),
        parameters={"square": square}, name="bead on a turning hoop",
    )  # fmt: skip


def swing(square):
    """θ over time, and the bead in space."""
    times = np.linspace(0.0, 25.0, 1001)
    theta, phi = hoop(square).motion([np.pi / 3], [0.0], (0.0, 25.0)).q(times)[0], np.sqrt(square) * times
    return times, theta, (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta))


def panels():
    """θ above, the way of the bead below."""
    above, below = [], []
    for title, square in CASES.items():
        times, theta, place = swing(square)
        above.append(Panel([Line(times, theta)], "t √(g/R)", "θ", title=title, within=(0, 25, -1.2, 1.8)))
        start = Points(*(part[:1] for part in place))
        below.append(Panel([Line(*place), start], "x", "y", "z", sphere=True))
    return [above, below]


figure = Drawing("A bead on a turning hoop", panels)
