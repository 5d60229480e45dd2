"""Kepler's problem of two bodies: two ellipses about the centre of mass, of a shape, on either side of it.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 4.4.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

FIRST, SECOND, ECCENTRICITY, SHOWN = 1.0, 2.0, 0.5, 0.15
system = mechanics.System(
    lambda t, q, v: (
        FIRST * ca.sumsqr(v[:2]) / 2 + SECOND * ca.sumsqr(v[2:]) / 2 + FIRST * SECOND / ca.norm_2(q[:2] - q[2:])
    ),
    ("x1", "y1", "x2", "y2"), name="two bodies",
)  # fmt: skip


def panels():
    """Both orbits from the perihelion, at rest as a whole, with the bodies and the line between them."""
    total = FIRST + SECOND
    apart, rate = 1 - ECCENTRICITY, np.sqrt(total * (1 + ECCENTRICITY) / (1 - ECCENTRICITY))
    shares = np.array([SECOND, -FIRST]) / total
    q0, v0 = np.kron(shares, [apart, 0.0]).tolist(), np.kron(shares, [0.0, rate]).tolist()
    period = 2 * np.pi / np.sqrt(total)
    motion = system.motion(q0, v0, (0.0, period))
    x1, y1, x2, y2 = motion.q(np.linspace(0.0, period, 601))
    now = motion.q(SHOWN * period)
    parts = [
        Line(x1, y1, label=f"m = {FIRST:g}"), Line(x2, y2, label=f"m = {SECOND:g}"),
        Line(now[::2], now[1::2], dashed=True, colour=5), Points(now[::2], now[1::2], colour=5),
        Points([0.0], [0.0], colour=2, label="centre of mass"),
    ]  # fmt: skip
    return [[Panel(parts, "x", "y", equal=True)]]


figure = Drawing("Two bodies about their centre of mass", panels)
