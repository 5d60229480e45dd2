"""Reflections inside a hard sphere: chords that all come as near to the centre.

A free particle goes straight on to the wall, an event, and is thrown back there: twice Θ = arccos(r_t/R) is the angle
of a chord.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 4.8.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

NEAREST, CHORDS = 0.6, 24
system = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"), name="inside a sphere")
wall = mechanics.Event(lambda t, q, v: ca.sumsqr(q) - 1, "wall", direction=1, terminal=True)


def reflections():
    """The places (2, m) at which it meets the wall, from where it is nearest to the centre."""
    q, v = np.array([NEAREST, 0.0]), np.array([0.0, 1.0])
    places = [q]
    for _ in range(CHORDS):
        motion = system.motion(q.tolist(), v.tolist(), (0.0, 3.0), events=[wall])
        q = motion.q(motion.span[1])
        v = v - 2 * (v @ q) / (q @ q) * q
        q = q / np.linalg.norm(q) * (1 - 1e-15)
        places.append(q)
    return np.array(places).T


def panels():
    """The way, the wall, and the circle that all chords touch."""
    around, places = np.linspace(0, 2 * np.pi, 401), reflections()
    parts = [
        Line(*places), Line(np.cos(around), np.sin(around), label="wall"),
        Line(NEAREST * np.cos(around), NEAREST * np.sin(around), dashed=True, label="nearest to the centre"),
        Points([0.0], [0.0]),
    ]  # fmt: skip
    return [[Panel(parts, "x/R", "y/R", equal=True)]]


figure = Drawing("Internal reflections", panels)
