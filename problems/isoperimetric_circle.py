"""The isoperimetric problem: the closed curve of given length that encloses most.

    A[q] = half the integral of (x dy - y dx)  greatest,  with  integral of |dq| = l,

is solved by every circle of length l, wherever it lies: A = l^2/(4 pi).

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.1;
Gelfand and Fomin, "Calculus of Variations", sect. 12.
"""

import casadi as ca

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import pi

LENGTH = 3.0


def enclosed_area(q, dq):
    return (q[0] * dq[1] - q[1] * dq[0]) / 2


def speed(q, dq):
    return ca.norm_2(dq)


references = (
    vc.Reference(
        name="isoperimetric_circle",
        problem=vc.Curve(enclosed_area, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(speed, LENGTH)], maximise=True),
        exact=vc.Exact.of(lambda number: (number(LENGTH) ** 2 / (4 * pi(number(1))), None), "circle, its place free"),
        source='Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.1',
        statement="The greatest area enclosed by a closed curve of length 3.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
