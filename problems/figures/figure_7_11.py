"""Orbits of a heavy top, case II: φ comes to rest where θ turns, as p_φ = p_ψ cos θ there: a cusp.

On the left θ over φ with the limits of nutation, on the right the axis, which begins at the dot.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 7.11.
"""

import numpy as np

from varcalc.problems.figures._tops import TILT, panels
from varcalc.study.drawing import Drawing

figure = Drawing("Orbits of a heavy top, case II", lambda: panels(np.cos(TILT)))
