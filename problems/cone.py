"""Geodesics of the cone: straight lines once it is unrolled.

With the angle phi, the distance r from the apex and the half angle alpha,

    l[r] = integral of sqrt(r'^2 + (r sin(alpha))^2) dphi

is the length of a plane curve in polar coordinates r and phi sin(alpha).

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.17
for this metric; do Carmo, "Differential Geometry of Curves and Surfaces",
sect. 4-4.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import atan2, cos, hypot, numbers, pi, sin
from varcalc.problems._curves import PolarLine

SOURCE = 'do Carmo, "Differential Geometry of Curves and Surfaces", sect. 4-4'
SINE = 0.6


def arc_length(x, y, dy, p):
    return ca.sqrt(dy**2 + (p.sine * y) ** 2)


def speed(q, dq):
    return ca.norm_2(dq)


def rolled(phi, r, p):
    """The point at an angle and a distance from the apex."""
    return r * p.sine * ca.cos(phi), r * p.sine * ca.sin(phi), r * ca.sqrt(1 - p.sine**2)


def on_cone(q):
    return 16 * (q[0] ** 2 + q[1] ** 2) - 9 * q[2] ** 2


def graph(number: Callable[[float], Any]) -> tuple[Any, Any]:
    line = PolarLine(number(1), number(1.5), number(2) * number(SINE))
    return line.length, lambda x: line.radius(number(SINE) * numbers(x))


def embedded(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The straight line from (5, 0) over a quarter of a turn to the distance 10, rolled up again."""
    sine, cosine = number(3) / 5, number(4) / 5
    quarter = PolarLine(number(5), number(10), sine * pi(number(1)) / 2)

    def rolled_up(t: Any) -> np.ndarray:
        t = numbers(t)
        x, y = 5 * (1 - t) + 10 * t * cos(quarter.angle), 10 * t * sin(quarter.angle)
        r, phi = hypot(x, y), atan2(y, x) / sine
        return np.array([sine * r * cos(phi), sine * r * sin(phi), cosine * r])

    return quarter.length, rolled_up


references = (
    vc.Reference(
        name="cone",
        problem=vc.Problem(
            arc_length, vc.Fixed(0, 1), vc.Fixed(2, 1.5), parameters={"sine": SINE}, names=("phi", "r"), surface=rolled
        ),
        exact=vc.Exact.of(graph, "straight line, rolled up"),
        source=SOURCE,
        statement="The geodesic of a cone, distance from the apex as a function of the angle.",
    ),
    vc.Reference(
        name="cone/embedded",
        problem=vc.Curve(speed, vc.At((3, 0, 4)), vc.At((0, 6, 8)), [vc.Holonomic(on_cone)]),
        exact=vc.Exact.of(embedded, "straight line, rolled up"),
        source=SOURCE,
        statement="The shortest curve in space that lies on the cone 16 (x^2 + y^2) = 9 z^2.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
)
