"""The isoperimetric problem between two points: the arc of given length that encloses most with its chord.

    A[y] = integral of y dx  greatest,  with  integral of sqrt(1 + y'^2) dx = l,

is solved by the arc of a circle. For a chord c its half angle obeys
sin(a)/a = c/l; radius r = c/(2 sin a), area r^2 (2a - sin 2a)/2. For
l > pi c/2 the arc is no graph, and the problem is one of a curve. That the
length be at most l, rather than l, changes nothing.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.1;
Gelfand and Fomin, "Calculus of Variations", sect. 12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cos, numbers, pi, scalar, sin, sqrt
from varcalc.problems._functions import sine_deficit
from varcalc.problems._roots import increasing_root

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.1'


def height(x, y, dy):
    return y


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def area_under(q, dq):
    return q[1] * dq[0]


def speed(q, dq):
    return ca.norm_2(dq)


@dataclass(frozen=True)
class Arc:
    """The arc over the chord from (-half_chord, 0) to (half_chord, 0), of half angle ``angle``."""

    half_chord: float
    angle: float

    @classmethod
    def of_length(cls, half_chord: float, length: float) -> Arc:
        """The arc of given length."""

        def shortening(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            part = sine_deficit(a) / a
            return part, 2 * sin(a / 2) ** 2 / a - part / a

        missing = (length - 2 * half_chord) / length
        return cls(half_chord, scalar(increasing_root(shortening, 0.0, pi(length), missing)))

    @property
    def radius(self) -> float:
        """Radius of the circle."""
        return self.half_chord / sin(self.angle)

    @property
    def area(self) -> float:
        """Area between chord and arc."""
        return self.radius**2 * scalar(sine_deficit(2 * self.angle)) / 2

    def y(self, x: Any) -> np.ndarray:
        """Height over the chord, for an arc that is a graph."""
        x = numbers(x)
        below = self.radius * cos(self.angle)
        return (self.half_chord - x) * (self.half_chord + x) / (sqrt(self.radius**2 - x**2) + below)

    def q(self, t: Any) -> np.ndarray:
        """The point a fraction t along the arc."""
        t = numbers(t)
        height_over_chord = 2 * self.radius * sin(self.angle * t) * sin(self.angle * (1 - t))
        return np.array([self.radius * sin(self.angle * (2 * t - 1)), height_over_chord])


def low(number: Callable[[float], Any]) -> tuple[Any, Any]:
    arc = Arc.of_length(number(1), number(3))
    return arc.area, arc.y


def high(number: Callable[[float], Any]) -> tuple[Any, Any]:
    arc = Arc.of_length(number(1), number(4))
    return arc.area, arc.q


references = (
    vc.Reference(
        name="chord_and_arc",
        problem=vc.Problem(height, vc.Fixed(-1, 0), vc.Fixed(1, 0), [vc.Isoperimetric(arc_length, 3)], maximise=True),
        exact=vc.Exact.of(low, "circular arc"),
        source=SOURCE,
        statement="The greatest area under an arc of length 3 over a chord of length 2.",
    ),
    vc.Reference(
        name="chord_and_arc/between",
        problem=vc.Problem(
            height, vc.Fixed(-1, 0), vc.Fixed(1, 0), [vc.Isoperimetric(arc_length, lower=2.5, upper=3)], maximise=True
        ),
        exact=vc.Exact.of(low, "circular arc"),
        source=SOURCE,
        statement="The greatest area under an arc of length between 2.5 and 3 over a chord of length 2.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="chord_and_arc/curve",
        problem=vc.Curve(area_under, vc.At((-1, 0)), vc.At((1, 0)), [vc.Isoperimetric(speed, 4)], maximise=True),
        exact=vc.Exact.of(high, "circular arc"),
        source=SOURCE,
        statement="The greatest area between a chord of length 2 and a curve of length 4, which overhangs it.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
