"""A rod of graded glass: light swings about its axis, and what is off the axis comes to foci of its own.

Source: E. W. Marchand, "Gradient Index Optics" (1978), chapter 5.
"""

import casadi as ca
import numpy as np

from varcalc import optics

angles = np.radians(np.linspace(-18.0, 18.0, 25))
study = optics.Study(
    optics.Scene(optics.Stratified(lambda y: ca.sqrt(1.5**2 * (1 - y**2)))),
    optics.PointSource((0.0, 0.0)),
    np.column_stack([np.cos(angles), np.sin(angles)]),
    optical_path=30.0,
    wavefronts=0,
    title="A rod of graded index",
)
