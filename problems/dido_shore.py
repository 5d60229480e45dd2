"""Dido's problem: the curve of given length that, with a straight shore, encloses most.

    A[q] = integral of y dx  greatest,  with  integral of |dq| = l,

the ends free on the shore y = 0. Transversality makes the curve meet the shore
at right angles: a semicircle of radius l/pi, A = l^2/(2 pi).

Source: Gelfand and Fomin, "Calculus of Variations", sect. 12 and 14.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

LENGTH = 3.0
SOURCE = 'Gelfand and Fomin, "Calculus of Variations", sect. 12 and 14'


def area_under(q, dq):
    return q[1] * dq[0]


def speed(q, dq):
    return ca.norm_2(dq)


def shore(q):
    return q[1]


def semicircle(t: Any) -> np.ndarray:
    t = np.asarray(t, dtype=float)
    return LENGTH / math.pi * np.array([2 * np.sin(math.pi * t / 2) ** 2, np.sin(math.pi * t)])


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
        exact=vc.Exact(LENGTH**2 / (2 * math.pi), semicircle, "semicircle"),
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
        exact=vc.Exact(LENGTH**2 / (2 * math.pi), description="semicircle, its place on the shore free"),
        source=SOURCE,
        statement="The greatest area between a shore and a curve of length 3 with both ends free on the shore.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
