"""Orbits of a heavy top, case I: φ goes one way only, as p_φ > p_ψ cos θ all the way.

On the left θ over φ with the limits of nutation, on the right the axis, which begins at the dot.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 7.10.
"""

from varcalc.problems.figures._tops import panels
from varcalc.study.drawing import Drawing

figure = Drawing("Orbits of a heavy top, case I", lambda: panels(0.6))
