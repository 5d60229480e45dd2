"""Kepler's ellipse in polar coordinates, eccentricity 0.7.

L = (r'² + r² φ'²)/2 + 1/r. The time follows Kepler's equation t = E - e sin E, r = 1 - e cos E.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 15.
"""

import numpy as np

from varcalc import mechanics

ECCENTRICITY = 0.7
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + 1 / q[0], ("r", "phi"), name="Kepler's problem"
)


def exact(t):
    """r and φ from the perihelion, by Newton's iteration for the eccentric anomaly."""
    turns, rest = np.divmod(t, 2 * np.pi)
    anomaly = rest + ECCENTRICITY * np.sin(rest)
    for _ in range(30):
        short = anomaly - ECCENTRICITY * np.sin(anomaly) - rest
        anomaly -= short / (1 - ECCENTRICITY * np.cos(anomaly))
    x, y = np.cos(anomaly) - ECCENTRICITY, np.sqrt(1 - ECCENTRICITY**2) * np.sin(anomaly)
    return np.stack([1 - ECCENTRICITY * np.cos(anomaly), np.arctan2(y, x) % (2 * np.pi) + 2 * np.pi * turns])


PERIHELION = 1 - ECCENTRICITY
experiment = mechanics.Experiment(
    system, [PERIHELION, 0.0], [0.0, np.sqrt(1 - ECCENTRICITY**2) / PERIHELION**2], (0.0, 18.0), exact,
    title="Kepler's ellipse, e = 0.7",
)  # fmt: skip
