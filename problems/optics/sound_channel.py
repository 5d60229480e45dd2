"""Sound in the deep ocean: Munk's profile holds it about the depth where it is slowest.

Every ray from a source on the axis of the channel comes back to it again and again; the receiver, 60 km away, hears
each of them.

Source: W. H. Munk, J. Acoust. Soc. Am. 55 (1974) 220.
"""

import numpy as np

from varcalc import optics

angles = np.radians(np.linspace(-12.0, 12.0, 25))
study = optics.Study(
    optics.Scene(optics.munk_profile(), names=("range", "height"), units=("m", "m")),
    optics.PointSource((0.0, -1300.0)),
    np.column_stack([np.cos(angles), np.sin(angles)]),
    optical_path=6.2e4,
    receiver=(6.0e4, -1000.0),
    within=6.4e4,
    title="Munk's profile",
)
