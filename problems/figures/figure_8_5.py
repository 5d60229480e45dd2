"""Two blocks, weakly coupled: K/k = 5/8, whose frequencies are as 3 to 2, and 0.1, which beats.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 8.5.
"""

from varcalc.problems.figures._coupled import row
from varcalc.study.drawing import Drawing

figure = Drawing("Two blocks, weakly coupled", lambda: [row(5 / 8), row(0.1)])
