"""Orbits of a bead on a turning parabolic wire, seen from above: stable, marginal and unstable.

(1 + 4 k² r²) r'' + 4 k² r r'² = (ω² - 2 g k) r from rest at r0: to and fro through the axis for ω² < 2 g k, a circle at
ω² = 2 g k, a spiral outwards beyond.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 8.3.
"""

import numpy as np

from varcalc.problems.mechanics.parabolic_wire import CURVE, G, wire
from varcalc.study.drawing import Drawing, Line, Panel, Points

START, TURNS = 1.0, 4.0
CASES = {"ω² = 0.6 · 2 g k": 0.6, "ω² = 2 g k": 1.0, "ω² = 1.05 · 2 g k": 1.05}


def panels():
    """The bead in the frame at rest, in units of r0."""
    row = []
    for title, share in CASES.items():
        turn = np.sqrt(share * 2 * G * CURVE)
        end = 2 * np.pi * TURNS / turn
        times = np.linspace(0.0, end, 1501)
        r = wire(turn).motion([START], [0.0], (0.0, end)).q(times)[0]
        x, y = r * np.cos(turn * times), r * np.sin(turn * times)
        row.append(Panel([Line(x, y), Points(x[:1], y[:1])], "x/r0", "y/r0", title=title, equal=True))
    return [row]


figure = Drawing("A bead on a turning parabolic wire", panels)
