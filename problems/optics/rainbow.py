"""The first rainbow: light reflected once in a drop of water comes back brightest where it turns least.

n = 4/3: the least deviation, 137.97 degrees, belongs to rays that meet the drop at sin(i) = 0.8607 of its radius.

Source: R. Descartes, "Les Météores" (1637); M. Born, E. Wolf, "Principles of Optics", sect. 4.6.
"""

import numpy as np

from varcalc import optics

drop, back = optics.Sphere((0.0, 0.0), 1.0), optics.Sphere((0.0, 0.0), 1.0, mirror=True)
study = optics.Study(
    optics.Scene([optics.Uniform(1.0), optics.Uniform(4 / 3), optics.Uniform(1.0)], [drop, back, drop]),
    optics.PlaneWave((-2.0, 0.0), (1.0, 0.0)),
    np.linspace(0.04, 0.99, 32),
    optical_path=9.0,
    title="A drop of water, n = 4/3",
)
