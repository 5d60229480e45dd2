"""Curves that are the closed form of more than one problem: cycloid, catenary, a straight line in polar coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.problems._arithmetic import (
    asin,
    asinh,
    atanh,
    cbrt,
    cosh,
    greatest,
    hypot,
    least,
    numbers,
    pi,
    scalar,
    sin,
    sinh,
    sqrt,
    tanh,
)
from varcalc.problems._functions import sine_deficit, sinh_excess
from varcalc.problems._roots import increasing_root

FOLD = 1.1996786402577338
"""The root of h tanh(h) = 1, where the two catenaries between equal rings merge."""


@dataclass(frozen=True)
class Cycloid:
    """x = r (a - sin a), y = r (1 - cos a) from its cusp at the origin, y counted downward.

    ``period`` is 2 pi r, the distance to the next cusp; ``turn`` the angle a at
    the end of the arc that is used.
    """

    period: float
    turn: float

    @classmethod
    def through(cls, across: float, depth: float) -> Cycloid:
        """The cycloid whose first arch meets a point."""
        if depth == 0:
            return cls(across, 2 * pi(across))

        def ratio(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            versine = 2 * sin(a / 2) ** 2
            return sine_deficit(a) / versine, 1 - sine_deficit(a) * sin(a) / versine**2

        turn = scalar(increasing_root(ratio, 0.0, 2 * pi(depth), across / depth))
        # the better conditioned of the two coordinates gives the radius
        radius = across / sine_deficit(turn) if across > depth else depth / (2 * sin(turn / 2) ** 2)
        return cls(2 * pi(depth) * scalar(radius), turn)

    @property
    def radius(self) -> float:
        """Radius of the rolling circle."""
        return self.period / (2 * pi(self.period))

    def descent_time(self, g: float) -> float:
        """Time of the fall from rest at the cusp: the angle grows at the constant rate sqrt(g/r)."""
        return self.turn * sqrt(self.radius / g)

    def depth(self, across: Any) -> np.ndarray:
        """y for given x on the first arch, counted from the nearer cusp to keep all digits there."""
        across = numbers(across)
        target = greatest(least(across, self.period - across), 0.0) / self.radius

        def rolled(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return sine_deficit(a), 2 * sin(a / 2) ** 2

        # (a - sin a)/a^3 falls from 1/6 at 0 to 1/pi^2 at pi
        angle = increasing_root(rolled, cbrt(6 * target), cbrt(pi(across) ** 2 * target), target)
        return 2 * self.radius * sin(angle / 2) ** 2

    def across(self, depth: Any) -> np.ndarray:
        """x for given y, on the way down."""
        angle = 2 * asin(sqrt(numbers(depth) / (2 * self.radius)))
        return self.radius * sine_deficit(angle)


@dataclass(frozen=True)
class Catenary:
    """c cosh(u), u = mean + (x - middle)/c, over an interval of the given ``span`` from x = ``start``.

    ``half`` is half the growth of u over the interval, so that c = span/(2 half).
    """

    start: float
    span: float
    half: float
    mean: float

    @classmethod
    def over_axis(cls, start: tuple[float, float], end: tuple[float, float]) -> Catenary:
        """The shallow one of the two catenaries c cosh(u) between points above the axis.

        With h = ``half``: c cosh(mean) cosh(h) and c sinh(mean) sinh(h) are half
        the sum and half the difference of the ordinates; cosh^2 - sinh^2 = 1
        leaves one equation for h.
        """
        (x0, y0), (x1, y1) = start, end
        total, rise = (y1 + y0) / (x1 - x0), (y1 - y0) / (x1 - x0)

        def squares(h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            a, b = total * h / cosh(h), rise * h / sinh(h)
            return a**2 - b**2, 2 * (a**2 * (1 - h * tanh(h)) - b**2 * (1 - h / tanh(h))) / h

        half = scalar(increasing_root(squares, 0 * total, FOLD, 1.0))
        return cls(x0, x1 - x0, half, asinh(rise * half / sinh(half)))

    @classmethod
    def of_length(cls, start: float, span: float, rise: float, length: float) -> Catenary:
        """The catenary of given length between ends ``span`` apart and ``rise`` different in height.

        sinh(h)/h = sqrt(length^2 - rise^2)/span, solved for its excess over 1,
        which keeps the digits of a chain that is nearly taut.
        """
        taut = hypot(span, rise)
        across = sqrt((length - rise) * (length + rise))
        excess = (length - taut) * (length + taut) / (span * (across + span))

        def stretch(h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            over = sinh_excess(h) / h
            return over, 2 * sinh(h / 2) ** 2 / h - over / h

        # sinh(h)/h - 1 exceeds h^2/6
        half = scalar(increasing_root(stretch, 0.0, sqrt(6 * excess), excess))
        return cls(start, span, half, atanh(rise / length))

    @property
    def scale(self) -> float:
        """The length c."""
        return self.span / (2 * self.half)

    def above_axis(self, x: Any) -> np.ndarray:
        """c cosh(u)."""
        return self.scale * cosh(self.mean - self.half + (numbers(x) - self.start) / self.scale)

    def above_start(self, x: Any) -> np.ndarray:
        """c cosh(u) less its value at the start, as a product."""
        step = (numbers(x) - self.start) / (2 * self.scale)
        return 2 * self.scale * sinh(step) * sinh(self.mean - self.half + step)

    @property
    def moment_about_axis(self) -> float:
        """The integral of c cosh(u) over the arc length."""
        return self.scale**2 * (self.half + cosh(2 * self.mean) * sinh(2 * self.half) / 2)

    @property
    def moment_about_start(self) -> float:
        """The integral over the arc length of the height above the start."""
        length = 2 * self.scale * cosh(self.mean) * sinh(self.half)
        return length**2 * tanh(self.mean) / 2 - self.scale**2 * scalar(sinh_excess(2 * self.half)) / 2


@dataclass(frozen=True)
class PolarLine:
    """The straight line between the points (r0, 0) and (r1, angle) in polar coordinates, angle < pi."""

    r0: float
    r1: float
    angle: float

    @property
    def length(self) -> float:
        """By the law of cosines, without its cancellation."""
        return hypot(self.r1 - self.r0, 2 * sqrt(self.r0 * self.r1) * sin(self.angle / 2))

    def reciprocal(self, angle: Any) -> np.ndarray:
        """1/r at a polar angle."""
        angle = numbers(angle)
        return (sin(angle) / self.r1 + sin(self.angle - angle) / self.r0) / sin(self.angle)

    def radius(self, angle: Any) -> np.ndarray:
        """R at a polar angle."""
        return 1 / self.reciprocal(angle)
