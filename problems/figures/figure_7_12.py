"""Orbits of a heavy top, case III: φ goes backwards on part of the way, as p_φ < p_ψ cos θ at the start.

On the left θ over φ with the limits of nutation, on the right the axis, which begins at the dot.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 7.12.
"""

from varcalc.problems.figures._tops import panels
from varcalc.study.drawing import Drawing

figure = Drawing("Orbits of a heavy top, case III", lambda: panels(0.5))
