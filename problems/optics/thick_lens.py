"""A thick lens of crown glass: its spherical aberration is a caustic.

A biconvex lens of N-BK7 in yellow light. Rays far from the axis cross it before the paraxial focus, and their
neighbours cross on the caustic whose cusp that focus is.

Source: M. Born, E. Wolf, "Principles of Optics", sect. 5.5; the index by the maker's Sellmeier formula.
"""

import numpy as np

from varcalc import optics

glass = optics.Uniform(optics.GLASSES["N-BK7"].index(0.5875618))
air = optics.Uniform(1.0)
study = optics.Study(
    optics.Scene(
        [air, glass, air],
        [optics.Conic((0.0, 0.0), (1.0, 0.0), radius=3.0), optics.Conic((1.0, 0.0), (1.0, 0.0), radius=-3.0)],
    ),
    optics.PlaneWave((-0.8, 0.0), (1.0, 0.0)),
    np.linspace(-1.4, 1.4, 29),
    optical_path=6.0,
    title="A thick lens of N-BK7",
)
