"""The shortest path: between points, and to lines, curves and surfaces.

    l[y] = integral of sqrt(1 + y'^2) dx

is least on a straight line. Where an end slides on a curve, transversality
makes the line normal to it; where it is free on a line x = const, the natural
condition makes it horizontal.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.1;
Gelfand and Fomin, "Calculus of Variations", sect. 4, 6 and 14.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import numbers, sqrt

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.1'
SLIDING = 'Gelfand and Fomin, "Calculus of Variations", sect. 14'


def arc_length(x, y, dy):
    return ca.sqrt(1 + ca.sumsqr(dy))


def speed(q, dq):
    return ca.norm_2(dq)


def parabola(x, y):
    return y - (x - 3) ** 2


def sphere(x, y):
    return (x - 2) ** 2 + (y[0] - 3) ** 2 + (y[1] - 6) ** 2 - 4


def unit_circle(q):
    return ca.sumsqr(q) - 1


def slanting_line(q):
    return 3 * q[0] + 4 * q[1] - 10


def segment(a: Sequence[Any], b: Sequence[Any]) -> Callable[[Any], np.ndarray]:
    """The straight line from a to b at constant speed."""
    return lambda t: np.array([start * (1 - numbers(t)) + end * numbers(t) for start, end in zip(a, b, strict=True)])


references = (
    vc.Reference(
        name="shortest_path",
        problem=vc.Problem(arc_length, vc.Fixed(0, 0), vc.Fixed(3, 4)),
        exact=vc.Exact.of(lambda number: (number(5), lambda x: 4 * numbers(x) / 3), "straight line"),
        source=SOURCE,
        statement="The shortest path between two points of the plane.",
    ),
    vc.Reference(
        name="shortest_path/curve",
        problem=vc.Curve(speed, vc.At((0, 0)), vc.At((-3, 4))),
        exact=vc.Exact.of(lambda number: (number(5), segment((0, 0), (-3, 4))), "straight line"),
        source=SOURCE,
        statement="The shortest curve between two points of the plane.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="shortest_path/free",
        problem=vc.Problem(arc_length, vc.Fixed(0, 1), vc.Free(3)),
        exact=vc.Exact.of(lambda number: (number(3), lambda x: 0 * numbers(x) + 1), "horizontal line"),
        source='Gelfand and Fomin, "Calculus of Variations", sect. 6',
        statement="The shortest path from a point to a vertical line.",
    ),
    vc.Reference(
        name="shortest_path/to_parabola",
        problem=vc.Problem(arc_length, vc.Fixed(0, 0), vc.OnCurve(parabola, x=1.5)),
        exact=vc.Exact.of(
            lambda number: (sqrt(number(5)), lambda x: numbers(x) / 2), "normal of the parabola at (2, 1)"
        ),
        source=SLIDING,
        statement="The shortest path from the origin to the parabola y = (x - 3)^2.",
    ),
    vc.Reference(
        name="shortest_path/to_sphere",
        problem=vc.Problem(arc_length, vc.Fixed(0, (0, 0)), vc.OnCurve(sphere, x=1.5, n=2)),
        exact=vc.Exact.of(
            lambda number: (number(5), lambda x: np.array([1.5 * numbers(x), 3 * numbers(x)])), "line to the centre"
        ),
        source=SLIDING,
        statement="The shortest path in space from the origin to the sphere of radius 2 about (2, 3, 6).",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="shortest_path/circle_to_line",
        problem=vc.Curve(speed, vc.OnSurface(unit_circle, guess=(1, 0.5)), vc.OnSurface(slanting_line, guess=(2, 1))),
        exact=vc.Exact.of(
            lambda number: (number(1), segment([number(v) / 5 for v in (3, 4)], [number(v) / 5 for v in (6, 8)])),
            "common normal",
        ),
        source=SLIDING,
        statement="The shortest path from the unit circle to the line 3x + 4y = 10.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
