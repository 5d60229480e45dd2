"""Kepler's ellipses of one period have one action: no closed curve about the centre has less, and all of them tie.

L = v²/2 + 1/r. The action over a period T is 3 π (T/(2π))^(1/3), whatever the eccentricity: the second variation
vanishes in three directions, along the orbit, round the centre and from one ellipse to the next.

Source: W. B. Gordon, "A minimizing property of Keplerian orbits", Am. J. Math. 99 (1977), 961.
"""

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc import mechanics

PERIOD, ECCENTRICITIES = 2 * np.pi, (0.0, 0.3, 0.6)
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 + 1 / ca.norm_2(q), ("x", "y"), name="Kepler's problem of one period"
)


def orbit(eccentricity):
    """The ellipse from its perihelion, as the closed orbit next to a motion."""
    perihelion = 1 - eccentricity
    return system.orbit([perihelion, 0.0], [0.0, np.sqrt((1 + eccentricity) / perihelion)], PERIOD)


def told(_):
    """One off for every ellipse of which it is not told that others tie with it."""
    wrong = 0.0
    for known in map(orbit, ECCENTRICITIES):
        found = vc.solve(system.periodic(PERIOD), guess=known.q, throw=False)
        wrong += vc.verify(found).verdict is not vc.Verdict.DEGENERATE
        wrong += (known.index, known.nullity) != (0, 3)
    return wrong


experiment = mechanics.Experiment(
    system, [0.4, 0.0], [0.0, 2.0], (0.0, PERIOD), None,
    {"action": lambda _: max(abs(orbit(e).action - 3 * np.pi) for e in ECCENTRICITIES),
     "closing": lambda _: max(orbit(e).closure for e in ECCENTRICITIES), "told": told},
    title="Kepler's ellipses of one period",
)  # fmt: skip
