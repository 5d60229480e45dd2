"""Geodesics of the cylinder: helices.

With the angle phi and the height z, l[z] = integral of sqrt(R^2 + z'^2) dphi;
unrolled, the cylinder is a plane, and the shortest path a straight line. Going
round the other way gives another local minimum, and so does every winding.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.17
for this metric; Gelfand and Fomin, "Calculus of Variations", sect. 9.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import atan2, cos, hypot, numbers, sin, sqrt

SOURCE = 'Gelfand and Fomin, "Calculus of Variations", sect. 9'
FAR_SIDE = 2 - 2 * math.pi
RADIUS, RISE = 5, 2


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def speed(q, dq):
    return ca.norm_2(dq)


def rolled(phi, z):
    """The point of the unit cylinder at an angle and a height."""
    return ca.cos(phi), ca.sin(phi), z


def on_cylinder(q):
    return q[0] ** 2 + q[1] ** 2 - RADIUS**2


def helix(number: Callable[[float], Any]) -> tuple[Any, Any]:
    turn = atan2(number(4), number(3))

    def q(t: Any) -> np.ndarray:
        t = numbers(t)
        return np.array([RADIUS * cos(turn * t), RADIUS * sin(turn * t), RISE * t])

    return hypot(RADIUS * turn, RISE), q


references = (
    vc.Reference(
        name="cylinder",
        problem=vc.Problem(arc_length, vc.Fixed(0, 0), vc.Fixed(2, 1), names=("phi", "z"), surface=rolled),
        exact=vc.Exact.of(lambda number: (sqrt(number(5)), lambda x: numbers(x) / 2), "helix"),
        source=SOURCE,
        statement="The geodesic of the unit cylinder that rises by 1 over an angle of 2.",
    ),
    vc.Reference(
        name="cylinder/other_way",
        problem=vc.Problem(arc_length, vc.Fixed(FAR_SIDE, 1), vc.Fixed(0, 0), names=("phi", "z"), surface=rolled),
        exact=vc.Exact.of(
            lambda number: (hypot(number(FAR_SIDE), 1), lambda x: numbers(x) / number(FAR_SIDE)), "helix"
        ),
        source=SOURCE,
        statement="The geodesic between the same points of the unit cylinder, the other way round.",
    ),
    vc.Reference(
        name="cylinder/embedded",
        problem=vc.Curve(speed, vc.At((5, 0, 0)), vc.At((3, 4, 2)), [vc.Holonomic(on_cylinder)]),
        exact=vc.Exact.of(helix, "helix"),
        source=SOURCE,
        statement="The shortest curve in space that lies on a cylinder of radius 5.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
)
