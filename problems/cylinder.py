"""Geodesics of the cylinder: helices.

With the angle phi and the height z, l[z] = integral of sqrt(R^2 + z'^2) dphi;
unrolled, the cylinder is a plane, and the shortest path a straight line. Going
round the other way gives another local minimum, and so does every winding.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.17
for this metric; Gelfand and Fomin, "Calculus of Variations", sect. 9.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Gelfand and Fomin, "Calculus of Variations", sect. 9'
FAR_SIDE = 2 - 2 * math.pi
RADIUS, RISE, TURN = 5, 2, math.atan2(4, 3)


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def speed(q, dq):
    return ca.norm_2(dq)


def rolled(phi, z):
    """The point of the unit cylinder at an angle and a height."""
    return ca.cos(phi), ca.sin(phi), z


def on_cylinder(q):
    return q[0] ** 2 + q[1] ** 2 - RADIUS**2


def helix(t: Any) -> np.ndarray:
    t = np.asarray(t, dtype=float)
    return np.array([RADIUS * np.cos(TURN * t), RADIUS * np.sin(TURN * t), RISE * t])


references = (
    vc.Reference(
        name="cylinder",
        problem=vc.Problem(arc_length, vc.Fixed(0, 0), vc.Fixed(2, 1), names=("phi", "z"), surface=rolled),
        exact=vc.Exact(math.sqrt(5), lambda x: np.asarray(x, dtype=float) / 2, "helix"),
        source=SOURCE,
        statement="The geodesic of the unit cylinder that rises by 1 over an angle of 2.",
    ),
    vc.Reference(
        name="cylinder/other_way",
        problem=vc.Problem(arc_length, vc.Fixed(FAR_SIDE, 1), vc.Fixed(0, 0), names=("phi", "z"), surface=rolled),
        exact=vc.Exact(math.hypot(FAR_SIDE, 1), lambda x: np.asarray(x, dtype=float) / FAR_SIDE, "helix"),
        source=SOURCE,
        statement="The geodesic between the same points of the unit cylinder, the other way round.",
    ),
    vc.Reference(
        name="cylinder/embedded",
        problem=vc.Curve(speed, vc.At((5, 0, 0)), vc.At((3, 4, 2)), [vc.Holonomic(on_cylinder)]),
        exact=vc.Exact(math.hypot(RADIUS * TURN, RISE), helix, "helix"),
        source=SOURCE,
        statement="The shortest curve in space that lies on a cylinder of radius 5.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
)
