"""A problem as its least value is known, and the same problem in other coordinates.

A person may mirror, shift and stretch what they measure x and y in, multiply the functional, or ask for the greatest
value of the opposite one. None of this may change an answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import varcalc as vc
from campaigns.least import Least

Integrand = Callable[..., Any]
"""Of x, y and y', and of y'' for a functional of second order."""
End = tuple[float, float | None] | tuple[float, float | None, float]
"""Abscissa, ordinate (None where it is free) and, at second order, slope."""
Constraint = vc.Bound | vc.Isoperimetric


@dataclass(frozen=True)
class Statement:
    """To make the integral of ``L(x, y, v)`` least between two ends.

    ``points`` are the abscissae about which something happens, for whoever lays a mesh by hand.
    """

    L: Integrand
    start: End
    end: End
    least: Least
    constraints: tuple[Constraint, ...] = ()
    points: tuple[float, ...] = ()
    order: int = 1


@dataclass(frozen=True)
class Disguise:
    """Coordinates X, Y with x = x0 + stretch X and y = y0 + height Y, and what the functional is multiplied by.

    A negative ``factor`` asks for the greatest value. Stretches are powers of two and shifts have few digits, so
    that abscissae with few digits stay what they are in floating-point numbers.
    """

    x0: float = 0.0
    stretch: float = 1.0
    y0: float = 0.0
    height: float = 1.0
    factor: float = 1.0

    @classmethod
    def drawn(cls, random: np.random.Generator, shifted: bool) -> Disguise:
        """None for a quarter of all; shifted only where the Lagrangian has no singularity that a shift would blur."""
        if random.uniform() < 0.25:
            return cls()
        x0, y0 = random.integers(-8, 9, 2) / 4.0 * shifted
        stretch, height = random.choice([-1, 1], 2) * 2.0 ** random.integers(-3, 4, 2)
        factor = float(random.choice([-1, 1, 1]) * 10 ** random.uniform(-1.5, 1.5))
        return cls(float(x0), float(stretch), float(y0), float(height), factor)

    def abscissa(self, x: float) -> float:
        """X of x."""
        return (x - self.x0) / self.stretch

    def of(self, function: Integrand) -> Integrand:
        """A function of (x, y, v) as one of (X, Y, V); at second order with a second derivative after these."""
        if self == Disguise():
            return function
        # a person writes no shift by zero and no multiplication by one
        return lambda x, y, *slopes: function(
            self.x0 + self.stretch * x if self.x0 else self.stretch * x,
            self.y0 + self.height * y if self.y0 else self.height * y,
            *(self.height / self.stretch**k * slope for k, slope in enumerate(slopes, 1)),
        )

    def end(self, end: End) -> vc.Fixed | vc.Free:
        """An end in the new coordinates."""
        x, y, *slope = end
        if y is None:
            return vc.Free(self.abscissa(x))
        slopes = [float(v) * self.stretch / self.height for v in slope]
        return vc.Fixed(self.abscissa(x), float(y - self.y0) / self.height, *slopes)

    def constraint(self, constraint: Constraint) -> Constraint:
        """A constraint in the new coordinates."""
        if isinstance(constraint, vc.Bound):
            return replace(constraint, h=self.of(constraint.h))
        assert constraint.value is not None
        return replace(constraint, g=self.of(constraint.g), value=constraint.value / abs(self.stretch))


@dataclass(frozen=True)
class Adversary:
    """A problem and its least value, which is that of ``sign`` times the functional."""

    problem: vc.Problem
    least: Least
    sign: int


def disguised(statement: Statement, disguise: Disguise) -> Adversary:
    """A problem in other coordinates."""
    integrand = disguise.of(statement.L)
    L: Integrand = integrand if disguise.factor == 1 else lambda *point: disguise.factor * integrand(*point)
    first, last = sorted((disguise.end(statement.start), disguise.end(statement.end)), key=lambda end: end.x)
    constraints = [disguise.constraint(constraint) for constraint in statement.constraints]
    problem = vc.Problem(L, first, last, constraints, order=statement.order, maximise=disguise.factor < 0)
    least = statement.least.times(abs(disguise.factor) / abs(disguise.stretch))
    return Adversary(problem, least, -1 if disguise.factor < 0 else 1)
