"""Cubic splines: the least bent curves through given points and states.

    U[y] = half the integral of |y''|^2 dx

is least on cubics. Through a waypoint, with free slopes at the ends, it is the
natural spline, whose second derivative vanishes at the ends and is continuous;
between states of given position and velocity, Hermite's cubic.

Source: Holladay, "A smoothest curve approximation", Math. Tables Aids Comput.
11 (1957); de Boor, "A Practical Guide to Splines", ch. V.
"""

from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import numbers

SOURCE = 'Holladay, "A smoothest curve approximation", Math. Tables Aids Comput. 11 (1957)'


def bending(x, y, dy, ddy):
    return ca.sumsqr(ddy) / 2


def natural(x: Any) -> np.ndarray:
    near = 1 - abs(1 - numbers(x))
    return near * (3 - near**2) / 2


def hermite(x: Any) -> np.ndarray:
    x = numbers(x)
    return np.array([x * (1 + x * (1 - x)), x**2 * (2 - x)])


references = (
    vc.Reference(
        name="spline",
        problem=vc.Problem(bending, vc.Fixed(0, 0), vc.Fixed(2, 0), [vc.Through(1, 1)], order=2),
        exact=vc.Exact.of(lambda number: (number(3), natural), "natural cubic spline"),
        source=SOURCE,
        statement="The least bent curve through three points.",
        inapplicable=_inapplicable.SECOND_ORDER,
    ),
    vc.Reference(
        name="spline/plane",
        problem=vc.Problem(bending, vc.Fixed(0, (0, 0), (1, 0)), vc.Fixed(1, (1, 1), (0, 1)), order=2),
        exact=vc.Exact.of(lambda number: (number(4), hermite), "Hermite's cubic"),
        source='de Boor, "A Practical Guide to Splines", ch. IV',
        statement="The motion of least acceleration between two states in the plane: a quarter turn.",
        inapplicable=_inapplicable.SECOND_ORDER,
    ),
)
