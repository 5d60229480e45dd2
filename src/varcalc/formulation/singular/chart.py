"""Coordinates in which the line is straight along which a metric is infinite, and the extremal smooth.

The powers of s that an extremal is known to start with at a singular end are taken out of them, and put back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Sampled, straight
from varcalc.formulation.singular.detection import LARGEST_DENOMINATOR, Blowup
from varcalc.problem.functional import Symbols
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


def factors_at(ends: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> tuple[np.ndarray, np.ndarray]:
    """What is fixed of the factors at the ends, each (K, 2), for one singular end: its own values are free."""
    known = np.array([ends[1][:, 0] - ends[0][:, 0], ends[1 if singular[0] else 0][:, 1]]).T
    blank = np.full(known.shape, np.nan)
    return (blank, known) if singular[0] else (known, blank)


def with_factors(symbols: Symbols, line: tuple[float, float], growth: float, singular: tuple[bool, bool]) -> Expression:
    """(xi, w) as known powers of s times unknown functions, free at the singular ends; ``line``: xi at both ends.

    One singular end: xi = xi_end + r^growth z, w = r omega with r the
    distance in s from it; z and omega keep the values of the other end. Two:
    xi = the graded line + (s (1 - s))^growth z, w = s (1 - s) omega.
    """
    s, z, omega = symbols.x, symbols.y[0], symbols.y[1]
    if all(singular):
        edge = s * (1 - s)
        graded = line[0] + (line[1] - line[0]) * _incomplete_beta(s, growth)
        return ca.vertcat(graded + edge**growth * z, edge * omega)
    at_start = singular[0]
    near, origin, sign = (s, line[0], 1.0) if at_start else (1 - s, line[1], -1.0)
    step = near**growth * z if sign > 0 else -(near**growth) * z
    xi = step if origin == 0.0 else origin + step
    return ca.vertcat(xi, near * omega)


def factored_ends(
    fixed: tuple[np.ndarray, ...], guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]
) -> tuple[np.ndarray, np.ndarray]:
    """Fixed values of the factors at the ends."""
    blank = np.full(2, np.nan)
    if all(singular):
        return blank, blank
    ends = np.where(np.isnan(fixed[1 if singular[0] else 0]), np.nan, _known_factors(guess, singular))
    return (blank, ends) if singular[0] else (ends, blank)


def factored_line(guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> Sampled:
    """The factors of the graded straight line."""
    if all(singular):
        return lambda s: np.zeros((2, len(s)))
    return lambda s: np.repeat(_known_factors(guess, singular)[:, None], len(s), axis=1)


def _known_factors(guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> np.ndarray:
    """The factors at the regular end: z is the step along the line there, and omega the distance itself."""
    return np.array([guess[1][0] - guess[0][0], guess[1 if singular[0] else 0][1]])


def _incomplete_beta(s: Expression, growth: float) -> Expression:
    """A smooth step that behaves as s^growth at 0 and 1 - (1 - s)^growth at 1."""
    head, tail = s**growth, (1 - s) ** growth
    return head / (head + tail)


def divided(
    plain: np.ndarray, s: np.ndarray, growth: float, fixed: tuple[np.ndarray, np.ndarray], factored: tuple[bool, bool]
) -> np.ndarray:
    """Take the known powers out of sampled coordinates (2, m); see :func:`with_factors`."""
    if not any(factored):
        return plain
    if all(factored):
        edge = np.maximum(s * (1 - s), 1e-3)
        head, tail = s**growth, (1 - s) ** growth
        line = fixed[0][0] + (fixed[1][0] - fixed[0][0]) * head / (head + tail)
        return np.vstack([(plain[0] - line) / edge**growth, plain[1] / edge])
    near = np.maximum(s if factored[0] else 1 - s, 1e-3)
    step = plain[0] - fixed[0][0] if factored[0] else fixed[1][0] - plain[0]
    return np.vstack([step / near**growth, plain[1] / near])


def graded_line(start: np.ndarray, end: np.ndarray, growth: float, singular: tuple[bool, bool]) -> Sampled:
    """From start to end with the tangential coordinate growing like s^growth at singular ends."""
    line = straight((0.0, 1.0), start, end)
    if growth == 1.0:
        return line

    def graded(s: np.ndarray) -> np.ndarray:
        """The points at s (m,), the tangential coordinate first."""
        head = s**growth if singular[0] else s
        tail = (1 - s) ** growth if singular[1] else 1 - s
        points = line(s)
        points[0] = start[0] + (end[0] - start[0]) * head / (head + tail)
        return points

    return graded


def grading(s: Expression, grade: int, singular: tuple[bool, bool]) -> Expression:
    """dtau/ds for a parameter tau ~ s^grade at singular ends, scaled to run over [0, 1]."""
    if grade == 1:
        return type(s)(1)
    rate = type(s)(1)
    if singular[0]:
        rate = rate * s ** (grade - 1)
    if singular[1]:
        rate = rate * (1 - s) ** (grade - 1)
    a, b = (grade if bad else 1 for bad in singular)
    total = math.gamma(a) * math.gamma(b) / math.gamma(a + b)
    return rate / total
