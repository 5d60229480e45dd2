"""Maxwell's fish-eye: every ray of a point is a circle through the point opposite.

n = 2/(1 + r²). The wavefronts of a point close on its image after an optical path of π; a receiver anywhere else is
reached by the two arcs of one circle.

Source: J. C. Maxwell, Cambridge and Dublin Math. J. 8 (1854) 188; M. Born, E. Wolf, "Principles of Optics",
sect. 4.2.2.
"""

import numpy as np

from varcalc import optics

study = optics.Study(
    optics.Scene(optics.fish_eye()),
    optics.PointSource((1.0, 0.0)),
    [(np.cos(a), np.sin(a)) for a in np.linspace(np.pi / 2 + 0.15, 3 * np.pi / 2 - 0.15, 24)],
    optical_path=3.6,
    receiver=(-0.3, 0.8),
    within=6.0,
    wavefronts=9,
    title="Maxwell's fish-eye",
)
