"""Coordinates in which the line is straight along which a metric is infinite, and the extremal smooth."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.singular.detection import LARGEST_DENOMINATOR, Blowup
from varcalc.symbolic.tracing import Expression

SAME_LINE = 1e-6
"""Relative distance within which two singular ends lie on one line."""


@dataclass(frozen=True)
class Chart:
    """Coordinates (xi, w): xi along the singular line, w^power the distance from it.

    Between two parallel singular lines ``height`` apart, with the metric
    blowing up as distance^-1/2 at each, the distance from the first is height
    sin(w)^2 instead.
    """

    origin: np.ndarray
    normal: np.ndarray
    power: float
    grade: int
    growth: float
    """Power of s with which the tangential coordinate grows along an extremal."""
    height: float | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells one chart from another."""
        return self.origin.tobytes(), self.normal.tobytes(), self.power, self.grade, self.growth, self.height

    @property
    def tangent(self) -> np.ndarray:
        """Unit vector along the line."""
        return np.array([self.normal[1], -self.normal[0]])

    def point(self, coordinates: Expression) -> Expression:
        """The point of the plane with symbolic coordinates (xi, w)."""
        w = coordinates[1]
        if self.height is not None:
            distance = self.height * ca.sin(w) ** 2
        else:
            distance = w if self.power == 1.0 else w**self.power
        return ca.vertcat(
            *(
                combination(o, (t, n), (coordinates[0], distance))
                for o, t, n in zip(self.origin, self.tangent, self.normal, strict=True)
            )
        )

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """(xi, w) of points (2, m)."""
        offset = points - self.origin[:, None]
        distance = _projected(self.normal, offset)
        if self.height is not None:
            w = np.arcsin(np.sqrt(np.clip(distance / self.height, 0.0, 1.0)))
        else:
            w = distance if self.power == 1.0 else np.maximum(distance, 0.0) ** (1.0 / self.power)
        return np.array([_projected(self.tangent, offset), w])


def _projected(direction: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """direction . offsets (2, m), where an unknown coordinate that does not enter does no harm."""
    parts = [row if d == 1.0 else d * row for d, row in zip(direction, offsets, strict=True) if d != 0.0]
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def combination(origin: float, factors: tuple[float, float], symbols: tuple[Expression, Expression]) -> Expression:
    """origin + sum of factor * symbol without the terms that vanish, so that no digits are lost to them."""
    terms = [v if f == 1.0 else f * v for f, v in zip(factors, symbols, strict=True) if f != 0.0]
    total = terms[0] if len(terms) == 1 else terms[0] + terms[1]
    return total if origin == 0.0 else origin + total


def chart_of(blowups: list[Blowup | None], beyond: bool) -> Chart | None:
    """The coordinates in which every singular end is regular; None when no one chart serves."""
    if not blowups:
        return Chart(np.zeros(2), np.array([0.0, 1.0]), 1.0, 1, 1.0)
    first, last = blowups[0], blowups[-1]
    if first is None or last is None:
        return None
    power = 1.0 / (1.0 - first.power)
    # along the line x' ~ w^(2 s m): a power of tau that may be fractional; grade s so that it is a whole one, where
    # tau is measured from the line
    ratio = (1 + first.power) / (1 - first.power)
    grade = 1 if beyond else Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR).denominator
    height = float(first.normal @ (last.origin - first.origin))
    if abs(height) <= SAME_LINE * max(1.0, float(np.abs(last.origin - first.origin).max())):
        if first.power != last.power or float(first.normal @ last.normal) < 1 - SAME_LINE:
            return None
        return Chart(first.origin, first.normal, power * grade, grade, grade * ratio)
    facing = float(first.normal @ last.normal) < -1 + SAME_LINE
    if not (facing and first.power == last.power == 0.5):
        return None
    return Chart(first.origin, first.normal, power, 1, ratio, height)
