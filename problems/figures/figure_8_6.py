"""Two blocks, strongly coupled: K/k = 3/2, whose frequencies are as 2 to 1, and 2.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 8.6.
"""

from varcalc.problems.figures._coupled import row
from varcalc.study.drawing import Drawing

figure = Drawing("Two blocks, strongly coupled", lambda: [row(3 / 2), row(2.0)])
