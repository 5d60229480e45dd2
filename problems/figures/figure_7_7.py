"""Orbits of a free asymmetric top from (ω1, ω2, ω3) = (2, 0, 1), for ratios I1/I3 at one I2/I3.

From a circle about e3, where I1 = I2, through the separatrix at I1 (I1 - I2) ω1² = I3 (I2 - I3) ω3² to ways about e1.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 7.7.
"""

import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

START, MIDDLE = np.array([2.0, 0.0, 1.0]), 1.3
CRITICAL = MIDDLE / 2 + np.sqrt(MIDDLE**2 / 4 + (MIDDLE - 1) * (START[2] / START[0]) ** 2)
RATIOS = (MIDDLE, 1.33, CRITICAL, 1.45, 2.2)


def orbit(ratio):
    """ω (3, m) over one period, and there and back on the separatrix."""
    body = mechanics.RigidBody([ratio, MIDDLE, 1.0])
    period = body.polhode(START).period
    end = period if np.isfinite(period) else 30.0  # near the middle axis by then
    return body.motion((1, 0, 0, 0), START, (0.0, end)).angular_velocity(np.linspace(0.0, end, 801))


def panels():
    """In space, and as seen along the middle axis."""
    orbits = {f"I1/I3 = {ratio:.4g}": orbit(ratio) for ratio in RATIOS}
    start = Points(*START[:, None], colour=5)
    space = [Line(*omega, label=name) for name, omega in orbits.items()]
    along = [Line(omega[0], omega[2]) for omega in orbits.values()]
    level = [Line(omega[0], omega[1]) for omega in orbits.values()]
    flat = [Points(START[:1], START[k : k + 1], colour=5) for k in (1, 2)]
    return [
        [Panel([*space, start], "ω1", "ω2", "ω3")],
        [Panel([*level, flat[0]], "ω1", "ω2", equal=True), Panel([*along, flat[1]], "ω1", "ω3", equal=True)],
    ]


figure = Drawing(f"A free asymmetric top, I2/I3 = {MIDDLE}", panels)
