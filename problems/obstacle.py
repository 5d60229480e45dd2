"""Obstacles: the shortest string over a hill and round a disc, a loaded string, and a bound on the slope.

Off the obstacle the string is an extremal, straight, and it leaves the
obstacle along a tangent.

* Over the hill y = 1 - x^2 from (-2, 0) to (2, 0) it touches for |x| <= s,
  s = 2 - sqrt(3). Its length is 2 (2 - s) sqrt(1 + 4 s^2) + s sqrt(1 + 4 s^2) + arsinh(2s)/2;
  half the integral of y'^2, whose least curve is the same, is 4 s^2 (2 - s) + 4 s^3/3.
* Round the unit disc from (-2, 0) to (2, 0), above or below: 2 sqrt(3) + pi/3.
* The integral of y'^2/2 - 4y with |y'| <= 1 and y(0) = y(2) = 0: the slope is
  4 (1 - x), cut at -1 and 1. The value is -37/12.

Source: Kinderlehrer and Stampacchia, "An Introduction to Variational
Inequalities and Their Applications", ch. I and II.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import asinh, numbers, pi, sqrt, where

SOURCE = 'Kinderlehrer and Stampacchia, "An Introduction to Variational Inequalities", ch. I'


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def energy(x, y, dy):
    return dy**2 / 2


def loaded(x, y, dy):
    return dy**2 / 2 - 4 * y


def above_hill(x, y, dy):
    return y - (1 - x**2)


def speed(q, dq):
    return ca.norm_2(dq)


def taut(touch: Any) -> Callable[[Any], Any]:
    """The string over the hill, which touches that up to ``touch`` either way."""

    def y(x: Any) -> Any:
        x = abs(numbers(x))
        return where(x < touch, 1 - x**2, 2 * touch * (2 - x))

    return y


def over_hill(number: Callable[[float], Any]) -> tuple[Any, Any]:
    touch = 2 - sqrt(number(3))
    tangent = sqrt(1 + 4 * touch**2)
    return 2 * (2 - touch) * tangent + touch * tangent + asinh(2 * touch) / 2, taut(touch)


def least_energy(number: Callable[[float], Any]) -> tuple[Any, Any]:
    touch = 2 - sqrt(number(3))
    return 4 * touch**2 * (2 - touch) + 4 * touch**3 / 3, taut(touch)


def cut_slope(x: Any) -> Any:
    near = 1 - abs(1 - numbers(x))
    return where(near < 0.75, near, 0.875 - 2 * (1 - near) ** 2)


references = (
    vc.Reference(
        name="obstacle",
        problem=vc.Problem(arc_length, vc.Fixed(-2, 0), vc.Fixed(2, 0), [vc.Bound(above_hill, lower=0)]),
        exact=vc.Exact.of(over_hill, "tangents and parabola"),
        source=SOURCE,
        statement="The shortest string over a parabolic hill.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/string",
        problem=vc.Problem(energy, vc.Fixed(-2, 0), vc.Fixed(2, 0), [vc.Bound(above_hill, lower=0)]),
        exact=vc.Exact.of(least_energy, "tangents and parabola"),
        source=SOURCE,
        statement="The string of least energy over a parabolic hill.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/disc",
        problem=vc.Curve(speed, vc.At((-2, 0)), vc.At((2, 0)), [vc.Bound(lambda q, dq: ca.sumsqr(q), lower=1)]),
        exact=vc.Exact.of(
            lambda number: (2 * sqrt(number(3)) + pi(number(1)) / 3, None), "tangents and arc, above or below"
        ),
        source=SOURCE,
        statement="The shortest string round a disc.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
    vc.Reference(
        name="obstacle/slope",
        problem=vc.Problem(loaded, vc.Fixed(0, 0), vc.Fixed(2, 0), [vc.Bound(lambda x, y, dy: dy, lower=-1, upper=1)]),
        exact=vc.Exact.of(lambda number: (-number(37) / 12, cut_slope), "straight lines and parabola"),
        source=SOURCE,
        statement="A loaded string whose slope is bounded.",
        inapplicable=_inapplicable.INEQUALITY,
    ),
)
