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

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.18'
NORTH, SOUTH, APART = 0.6, 1.3, 0.8
RADIUS = 3
A, B = np.array([2.0, 2.0, 1.0]), np.array([-1.0, 2.0, 2.0])
ANGLE = math.atan2(float(np.linalg.norm(np.cross(A, B))), float(A @ B))


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


def angle_between(theta: float, other: float, azimuth: float) -> float:
    """The angle between two directions, by haversines."""
    haversine = math.sin((other - theta) / 2) ** 2 + math.sin(theta) * math.sin(other) * math.sin(azimuth / 2) ** 2
    return 2 * math.asin(math.sqrt(haversine))


def azimuth(theta: Any) -> np.ndarray:
    """The azimuth at a polar angle, on the way from (NORTH, 0) to (SOUTH, APART), where both grow."""
    north, south = 1 / math.tan(NORTH), 1 / math.tan(SOUTH)
    first = math.atan2(north * math.sin(APART), north * math.cos(APART) - south)
    return first - np.arcsin(math.sin(first) / north / np.tan(theta))


def polar_angle(phi: Any) -> np.ndarray:
    """The polar angle at an azimuth, on the way from (SOUTH, 0) to (NORTH, 2)."""
    first, last = 1 / math.tan(SOUTH), 1 / math.tan(NORTH)
    cotangent = (first * np.sin(2 - np.asarray(phi, dtype=float)) + last * np.sin(phi)) / math.sin(2)
    return math.pi / 2 - np.arctan(cotangent)


def embedded(t: Any) -> np.ndarray:
    t = np.asarray(t, dtype=float)
    return (np.multiply.outer(A, np.sin((1 - t) * ANGLE)) + np.multiply.outer(B, np.sin(t * ANGLE))) / math.sin(ANGLE)


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
        exact=vc.Exact(angle_between(NORTH, SOUTH, APART), azimuth, "great circle"),
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
        exact=vc.Exact(angle_between(SOUTH, NORTH, 2), polar_angle, "great circle"),
        source=SOURCE,
        statement="The shortest path on the unit sphere, polar angle as a function of the azimuth.",
        downward=True,
    ),
    vc.Reference(
        name="great_circle/embedded",
        problem=vc.Curve(speed, vc.At(A.tolist()), vc.At(B.tolist()), [vc.Holonomic(on_sphere)]),
        exact=vc.Exact(RADIUS * ANGLE, embedded, "great circle"),
        source=SOURCE,
        statement="The shortest curve in space that lies on a sphere of radius 3.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
    vc.Reference(
        name="great_circle/energy",
        problem=vc.Problem(
            energy, vc.Fixed(0, A.tolist()), vc.Fixed(1, B.tolist()), [vc.Holonomic(lambda x, y: on_sphere(y))]
        ),
        exact=vc.Exact((RADIUS * ANGLE) ** 2 / 2, embedded, "uniform motion on a great circle"),
        source='Milnor, "Morse Theory", sect. 12',
        statement="The motion of least energy between two points of a sphere in unit time.",
        inapplicable=_inapplicable.HOLONOMIC,
    ),
)
