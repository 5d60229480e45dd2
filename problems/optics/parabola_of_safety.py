"""Rays where the squared index falls linearly, and the parabola they all touch.

n² = 1 - 2y: rays are the paths of stones thrown with unit speed, and their envelope is Torricelli's parabola
y = 1/2 - x²/2. Every point beneath it is reached by two rays, every point above by none.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.4; the envelope is
E. Torricelli's, "De motu gravium" (1644).
"""

import casadi as ca
import numpy as np

from varcalc import optics

angles = np.radians(np.arange(5.0, 176.0, 5.0))
study = optics.Study(
    optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))),
    optics.PointSource((0.0, 0.0)),
    np.column_stack([np.cos(angles), np.sin(angles)]),
    optical_path=0.9,
    receiver=(0.5, 0.0),
    wavefronts=6,
    title="n² = 1 - 2y",
)
