"""The great circle: the shortest path on a sphere, in angles and embedded in space.

In the polar angle theta and the azimuth phi of the unit sphere

    l[phi] = integral of sqrt(1 + sin(theta)^2 phi'^2) dtheta;

phi is ignorable, and the first integral sin(theta)^2 phi'/L = sin(alpha)
leads to cos(phi - beta) = tan(alpha) cot(theta). Along a great circle cot(theta)
is a linear combination of cos(phi) and sin(phi): given at two azimuths, it is
given between them. The length is the angle between the ends.

Embedded, with |q| = R as a holonomic constraint, the shortest curve moves
uniformly from a to b in their plane; the same motion makes the energy
integral of |q'|^2/2 least.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.18.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import asin, atan, atan2, cos, numbers, pi, sin, sqrt, tan

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.18'
NORTH, SOUTH, APART = 0.6, 1.3, 0.8
RADIUS = 3
A, B = np.array([2.0, 2.0, 1.0]), np.array([-1.0, 2.0, 2.0])


def length_by_polar_angle(x, y, dy):
    return ca.sqrt(1 + (ca.sin(x) * dy) ** 2)


def length_by_azimuth(x, y, dy):
    return ca.sqrt(dy**2 + ca.sin(y) ** 2)


def speed(q, dq):
    return ca.norm_2(dq)


def energy(x, y, dy):
    return ca.sumsqr(dy) / 2


def on_sphere(q):
    return ca.sumsqr(q) - RADIUS**2


def on_unit_sphere(theta, phi):
    """The point at a polar angle and an azimuth."""
    return ca.sin(theta) * ca.cos(phi), ca.sin(theta) * ca.sin(phi), ca.cos(theta)


def angle_between(theta: Any, other: Any, azimuth: Any) -> Any:
    """The angle between two directions, by haversines."""
    haversine = sin((other - theta) / 2) ** 2 + sin(theta) * sin(other) * sin(azimuth / 2) ** 2
    return 2 * asin(sqrt(haversine))


def by_polar_angle(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The azimuth at a polar angle, on the way from (NORTH, 0) to (SOUTH, APART), where both grow."""
    theta, other, apart = number(NORTH), number(SOUTH), number(APART)
    north, south = 1 / tan(theta), 1 / tan(other)
    first = atan2(north * sin(apart), north * cos(apart) - south)
    return angle_between(theta, other, apart), lambda x: first - asin(sin(first) / north / tan(x))


def by_azimuth(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The polar angle at an azimuth, on the way from (SOUTH, 0) to (NORTH, 2)."""
    theta, other, apart = number(SOUTH), number(NORTH), number(2)
    first, last = 1 / tan(theta), 1 / tan(other)

    def polar_angle(phi: Any) -> Any:
        phi = numbers(phi)
        return pi(first) / 2 - atan((first * sin(apart - phi) + last * sin(phi)) / sin(apart))

    return angle_between(theta, other, apart), polar_angle


def embedded(number: Callable[[float], Any]) -> tuple[Any, Any]:
    """The angle between the ends, and the uniform motion in their plane."""
    across = np.cross(A, B).tolist()
    angle = atan2(sqrt(number(sum(c**2 for c in across))), number(float(A @ B)))

    def q(t: Any) -> np.ndarray:
        t = numbers(t)
        return np.array([a * sin((1 - t) * angle) + b * sin(t * angle) for a, b in zip(A, B, strict=True)]) / sin(angle)

    return angle, q


def length(number: Callable[[float], Any]) -> tuple[Any, Any]:
    angle, q = embedded(number)
    return RADIUS * angle, q


def least_energy(number: Callable[[float], Any]) -> tuple[Any, Any]:
    angle, q = embedded(number)
    return (RADIUS * angle) ** 2 / 2, q


references = (
    vc.Reference(
        name="great_circle",
        problem=vc.Problem(
            length_by_polar_angle,
            vc.Fixed(NORTH, 0),
            vc.Fixed(SOUTH, APART),
            names=("theta", "phi"),
            surface=on_unit_sphere,
        ),
        exact=vc.Exact.of(by_polar_angle, "great circle"),
        source=SOURCE,
        statement="The shortest path on the unit sphere, azimuth as a function of the polar angle.",
    ),
    vc.Reference(
        name="great_circle/longitude",
        problem=vc.Problem(
            length_by_azimuth,
            vc.Fixed(0, SOUTH),
            vc.Fixed(2, NORTH),
            names=("phi", "theta"),
            surface=lambda phi, theta: on_unit_sphere(theta, phi),
        ),
        exact=vc.Exact.of(by_azimuth, "great circle"),
        source=SOURCE,
        statement="The shortest path on the unit sphere, polar angle as a function of the azimuth.",
        downward=True,
    ),
    vc.Reference(
        name="great_circle/embedded",
        problem=vc.Curve(speed, vc.At(A.tolist()), vc.At(B.tolist()), [vc.Holonomic(on_sphere)]),
        exact=vc.Exact.of(length, "great circle"),
        source=SOURCE,
        statement="The shortest curve in space that lies on a sphere of radius 3.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
    vc.Reference(
        name="great_circle/energy",
        problem=vc.Problem(
            energy, vc.Fixed(0, A.tolist()), vc.Fixed(1, B.tolist()), [vc.Holonomic(lambda x, y: on_sphere(y))]
        ),
        exact=vc.Exact.of(least_energy, "uniform motion on a great circle"),
        source='Milnor, "Morse Theory", sect. 12',
        statement="The motion of least energy between two points of a sphere in unit time.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
)
