"""Luneburg's lens: a plane wave comes to a point of the rim.

n² = 2 - r² within the unit circle, and air outside; after the focus the light goes on and spreads.

Source: R. K. Luneburg, "Mathematical Theory of Optics" (1944), sect. 29.
"""

import numpy as np

from varcalc import optics

rim = optics.Sphere((0.0, 0.0), 1.0)
study = optics.Study(
    optics.Scene([optics.Uniform(1.0), optics.luneburg(), optics.Uniform(1.0)], [rim, rim]),
    optics.PlaneWave((-1.6, 0.0), (1.0, 0.0)),
    np.linspace(-0.95, 0.95, 21),
    optical_path=4.2,
    wavefronts=14,
    title="Luneburg's lens",
)
