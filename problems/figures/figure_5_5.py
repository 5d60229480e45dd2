"""The cross-section of Rutherford scattering, over the angle of deflection.

σ = (k/(4 E))²/sin⁴(Θ/2), beside motions that come from far away: σ = b |db/dΘ|/sin Θ from neighbouring pairs.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 5.5.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

FAR, STEP = 3000.0, 1e-3
IMPACTS = np.geomspace(0.03, 3.0, 15)
system = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - 1 / ca.norm_2(q), ("x", "y"), name="repulsion")


def deflections(impacts):
    """Angles (m,) of motions with the energy 1/2, r0 = k/(2 E) = 1, from far away on the left to far on the right."""
    speed = np.sqrt(1 - 2 / np.hypot(FAR, impacts))
    q0 = np.column_stack([np.full(len(impacts), -FAR), impacts])
    v0 = np.column_stack([speed, np.zeros(len(impacts))])
    ends = system.ensemble(q0, v0, [0.0, 2 * FAR])
    return np.arctan2(ends.v[:, 1, -1], ends.v[:, 0, -1])


def panels():
    """In units of (k/(4 E))²."""
    angles = np.linspace(0.35, np.pi, 400)
    before, after = (deflections(IMPACTS * (1 + sign * STEP)) for sign in (-1, 1))
    middle = (before + after) / 2
    found = IMPACTS * np.abs(2 * STEP * IMPACTS / (after - before)) / np.sin(middle)
    shown = middle > angles[0]
    parts = [Line(angles, np.sin(angles / 2) ** -4.0), Points(middle[shown], 4 * found[shown], label="motions")]
    return [[Panel(parts, "Θ", "σ/(k/4E)²", logarithmic=True)]]


figure = Drawing("Rutherford scattering", panels)
