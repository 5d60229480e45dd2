"""The normal coordinates of two coupled blocks, K/k = 2: each has one frequency, 1 and √5.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 8.7.
"""

import numpy as np

from varcalc.problems.figures._coupled import blocks, moved
from varcalc.study.drawing import Drawing, Line, Panel

RATIO, SHOWN = 2.0, 800


def panels():
    """x + y and x - y over time, by the rows of the modes' shapes."""
    modes = blocks(RATIO).normal_modes([0.0, 0.0])
    times, places = moved(RATIO)
    shapes = modes.shapes / np.abs(modes.shapes).max(axis=0)
    row = []
    for frequency, shape in zip(modes.frequencies, shapes.T, strict=True):
        name = "η = x + y" if shape[0] * shape[1] > 0 else "η = x - y"
        line = Line(times[:SHOWN], (np.sign(shape[0]) * shape @ places)[:SHOWN])
        row.append(Panel([line], "t √(k/m)", name, title=f"frequency {frequency:.6g}"))
    return [row]


figure = Drawing("Normal coordinates of two coupled blocks, K/k = 2", panels)
