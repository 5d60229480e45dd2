"""With which powers of a parameter an extremal leaves an end where L is infinite."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from varcalc.formulation.singular.detection import (
    LARGEST_DENOMINATOR,
    Blowup,
    end_points,
    extent,
    finite_cost,
    line_through,
)
from varcalc.formulation.singular.indicial import Growth, powers_at_ends
from varcalc.formulation.singular.powers import exponent
from varcalc.problem.problem import Problem

ALONG_AXIS = 1e-6
"""Departure of a normal from an axis that is none."""
INSIDE = 1e-3
"""Distance from the end, in units of the problem's size, at which large slopes are tried."""
LARGE = (1e5, 1e9)
"""Slopes between which L is seen to grow in proportion, as a length does."""
PROPORTION = 1e-3


@dataclass(frozen=True)
class Departure:
    """Along the extremal x - x0 grows like t^``abscissa`` and y_i - y0_i like t^``ordinates[i]``.

    ``side`` (n,) is the direction from the end into the domain, 0 for components along the singular line. ``power`` is
    that of the unknown function in y: where it is not 1, its base cannot change the side. Meshes are graded toward the
    end by so many ``layers``.
    """

    abscissa: int
    ordinates: tuple[int, ...]
    side: np.ndarray
    power: int = 1
    layers: int = 0

    @classmethod
    def like(cls, found: Growth) -> Departure:
        """That of one function at an end where L is singular in x."""
        return cls(found.abscissa, (found.ordinate,), np.zeros(1), layers=found.layers)


def departure(problem: Problem, at_start: bool) -> Departure | None:
    """The powers at an end where L is infinite; None when neither a length nor a first integral tells them.

    Raises Infinite when no curve that ends there has a finite value.
    """
    line = line_through(problem, at_start)
    if line is not None and _like_a_length(problem, line):
        finite_cost(line, at_start)
        return _of_length(line)
    if problem.n > 1:
        return None
    if line is not None and _across_x(line):
        found = powers_at_ends(problem)[0 if at_start else 1]
        return None if found.plain else Departure.like(found)
    points = end_points(problem)
    here, other = points if at_start else points[::-1]
    leaves = exponent(problem, here, np.where(np.isnan(other), here + extent(problem), other))
    if leaves is None:
        return None
    power, side = leaves
    fraction = Fraction(power).limit_denominator(2 * LARGEST_DENOMINATOR)
    if fraction <= 0:
        return None
    return Departure(fraction.denominator, (fraction.numerator,), np.array([side]), fraction.numerator)


def _like_a_length(problem: Problem, line: Blowup) -> bool:
    """Whether L is proportional to large slopes; of several functions it is taken to be so at a vertical line."""
    inside = line.origin + INSIDE * extent(problem) * line.normal
    if _across_x(line) and problem.n > 1:
        return True
    slopes = np.outer(np.ones(problem.n), LARGE)
    low, high = problem.integrand_values(np.full(2, inside[0]), np.outer(inside[1:], np.ones(2)), slopes)
    return bool(abs(high / low / (LARGE[1] / LARGE[0]) - 1) < PROPORTION)


def _across_x(line: Blowup) -> bool:
    """Whether L is infinite at an abscissa, whatever the ordinates."""
    return bool(abs(line.normal[0]) > 1 - ALONG_AXIS)


def _of_length(line: Blowup) -> Departure:
    """Along the line an extremal covers the distance from it to the power 1 + s: its momentum there is constant."""
    axis = int(np.argmax(np.abs(line.normal)))
    power = Fraction(line.power).limit_denominator(2 * LARGEST_DENOMINATOR)
    n = len(line.normal) - 1
    side = np.where(np.abs(line.normal[1:]) > ALONG_AXIS, np.sign(line.normal[1:]), 0.0)
    b, q = power.denominator, (1 + power).numerator
    if abs(line.normal[axis]) <= 1 - ALONG_AXIS:
        return Departure(b, (b,) * n, side)
    if axis == 0:
        return Departure(b, (q,) * n, side)
    return Departure(q, tuple(b if i == axis - 1 else q for i in range(n)), side)
