"""Dido's problem: the curve of given length that, with a straight shore, encloses most.

    A[q] = integral of y dx  greatest,  with  integral of |dq| = l,

the ends free on the shore y = 0. Transversality makes the curve meet the shore
at right angles: a semicircle of radius l/pi, A = l^2/(2 pi).

Source: Gelfand and Fomin, "Calculus of Variations", sect. 12 and 14.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import numbers, pi, sin

LENGTH = 3.0
SOURCE = 'Gelfand and Fomin, "Calculus of Variations", sect. 12 and 14'


def area_under(q, dq):
    return q[1] * dq[0]


def speed(q, dq):
    return ca.norm_2(dq)


def shore(q):
    return q[1]


def area(number: Callable[[float], Any]) -> Any:
    return number(LENGTH) ** 2 / (2 * pi(number(1)))


def semicircle(number: Callable[[float], Any]) -> tuple[Any, Any]:
    half_turn = pi(number(1))

    def q(t: Any) -> np.ndarray:
        t = numbers(t)
        return LENGTH / half_turn * np.array([2 * sin(half_turn * t / 2) ** 2, sin(half_turn * t)])

    return area(number), q


references = (
    vc.Reference(
        name="dido_shore",
        problem=vc.Curve(
            area_under,
            vc.At((0, 0)),
            vc.OnSurface(shore, guess=(1, 0)),
            [vc.Isoperimetric(speed, LENGTH)],
            maximise=True,
        ),
        exact=vc.Exact.of(semicircle, "semicircle"),
        source=SOURCE,
        statement="The greatest area between a shore and a curve of length 3, one end given and one free on the shore.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="dido_shore/free",
        problem=vc.Curve(
            area_under,
            vc.OnSurface(shore, guess=(-1, 0)),
            vc.OnSurface(shore, guess=(1, 0)),
            [vc.Isoperimetric(speed, LENGTH)],
            maximise=True,
        ),
        exact=vc.Exact.of(lambda number: (area(number), None), "semicircle, its place on the shore free"),
        source=SOURCE,
        statement="The greatest area between a shore and a curve of length 3 with both ends free on the shore.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
