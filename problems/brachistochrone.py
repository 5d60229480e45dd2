"""The brachistochrone: the path of quickest descent.

A bead slides without friction from rest at the origin to a given point. With
x across and y downward its speed is sqrt(2 g y), and its time

    T[y] = integral of sqrt((1 + y'^2) / (2 g y)) dx

is least on the cycloid x = r (a - sin a), y = r (1 - cos a), on which
T = a sqrt(r/g). L does not contain x, so L - y' L_y' = 1/sqrt(4 g r). The
Lagrangian is infinite at the start, where the cycloid is vertical; an end as
high as the start is reached at the next cusp, where both happen again.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.2
and problem 2, with the axes swapped: its x points down. (Its eq. 1.26 needs
x/(2a) for x/a to agree with eq. 1.27.) Abanov, "Analytical Mechanics",
lecture 8.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._curves import Cycloid

GRAVITY = 9.81
SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.2'


def travel_time(x, y, dy, p):
    return ca.sqrt((1 + dy**2) / (2 * p.g * y))


def travel_time_by_height(x, y, dy, p):
    return ca.sqrt((1 + dy**2) / (-2 * p.g * y))


def travel_time_by_depth(x, y, dy, p):
    return ca.sqrt((1 + dy**2) / (2 * p.g * x))


def descent(across: float, depth: float, case: str, statement: str) -> vc.Reference:

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        cycloid = Cycloid.through(number(across), number(depth))
        return cycloid.descent_time(number(GRAVITY)), cycloid.depth

    return vc.Reference(
        name="brachistochrone" + case,
        problem=vc.Problem(
            travel_time, vc.Fixed(0, 0), vc.Fixed(across, depth), parameters={"g": GRAVITY}, name="brachistochrone"
        ),
        exact=vc.Exact.of(form, "cycloid"),
        source=SOURCE,
        statement=statement,
        downward=True,
    )


def upward(number: Callable[[float], Any]) -> tuple[Any, Any]:
    cycloid = Cycloid.through(number(1), number(1))
    return cycloid.descent_time(number(GRAVITY)), lambda x: -cycloid.depth(x)


def swapped(number: Callable[[float], Any]) -> tuple[Any, Any]:
    cycloid = Cycloid.through(number(1), number(1))
    return cycloid.descent_time(number(GRAVITY)), cycloid.across


references = (
    descent(1, 1, "", "Quickest descent from rest to a point as deep as it is far."),
    descent(math.pi / 2, 1, "/bottom", "Quickest descent to the bottom of the cycloid."),
    descent(5, 1, "/beyond", "Quickest descent to a point that is passed below and met from underneath."),
    descent(1, 0, "/level", "Quickest passage to a point as high as the start; singular at both ends."),
    vc.Reference(
        name="brachistochrone/upward",
        problem=vc.Problem(travel_time_by_height, vc.Fixed(0, 0), vc.Fixed(1, -1), parameters={"g": GRAVITY}),
        exact=vc.Exact.of(upward, "cycloid"),
        source=SOURCE,
        statement="Quickest descent, height counted upward.",
    ),
    vc.Reference(
        name="brachistochrone/swapped",
        problem=vc.Problem(travel_time_by_depth, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": GRAVITY}),
        exact=vc.Exact.of(swapped, "cycloid"),
        source='Abanov, "Analytical Mechanics", lecture 8',
        statement="Quickest descent, the depth taken as independent variable.",
    ),
)
