"""ReducedRays along one coordinate, in parameters in which they are smooth.

(du/dτ)² = Q(u) = g(u) - C. Where Q vanishes the ray turns back and dτ =
du/√Q is singular; with u = u_t ± q² it is not, and q goes on through the
turning point. Between two turning points u = m - a cos q does the same for
both. Every way answers with u and w = du/dτ and the rate dτ/dq, and with the
derivatives of these by C at fixed q, in which nothing is singular either.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

import numpy as np

if TYPE_CHECKING:
    from varcalc.numerics.one_coordinate.potential import Potential


@dataclass(frozen=True)
class MotionPoint:
    """Places on ways, all arrays of one shape: the derivatives by C are those at fixed q."""

    u: np.ndarray
    w: np.ndarray
    rate: np.ndarray
    g: np.ndarray
    slope: np.ndarray
    u_by_c: np.ndarray
    w_by_c: np.ndarray
    rate_by_c: np.ndarray


@dataclass(frozen=True)
class CoordinateMotion(ABC):
    """m motions of one kind in one potential; ``start`` (m,) is where each begins, in q."""

    potential: Potential
    start: np.ndarray

    @property
    def period(self) -> float:
        """In q; infinite where the motion is not periodic."""
        return np.inf

    def take(self, rows: np.ndarray) -> Self:
        """The motions of ``rows``."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "potential"}
        return type(self)(potential=self.potential, **arrays)

    @abstractmethod
    def at(self, q: np.ndarray) -> MotionPoint:
        """Places (m, k) at the parameters ``q`` (m, k), a row for each motion."""

    @abstractmethod
    def reaching(self, x: np.ndarray) -> np.ndarray:
        """The parameter (m,) at which the motions have come to u₀ + ``x`` for the last time."""


@dataclass(frozen=True)
class NoTurn(CoordinateMotion):
    """Q has no zero on the way: q = |u - u₀|, from ``u0`` with the speed squared ``squared``, upwards or downwards."""

    u0: np.ndarray
    squared: np.ndarray
    sign: np.ndarray

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        sign = self.sign[:, None]
        values = self.potential(np.broadcast_to(self.u0[:, None], q.shape), sign * q)
        speed = np.sqrt(self.squared[:, None] + values.gain)
        nothing = np.zeros_like(q)
        return MotionPoint(
            self.u0[:, None] + sign * q, sign * speed, 1 / speed, values.g, values.slope,
            nothing, -sign / (2 * speed), 1 / (2 * speed**3),
        )  # fmt: skip

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.reaching`."""
        return self.sign * x


@dataclass(frozen=True)
class OneTurn(CoordinateMotion):
    """u = ``turn`` + ``sign`` q²: Q = q² D with D the mean slope between the turning point and u.

    ``offset`` is u₀ - turn.
    """

    turn: np.ndarray
    offset: np.ndarray
    sign: np.ndarray

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        sign, turn = self.sign[:, None], np.broadcast_to(self.turn[:, None], q.shape)
        squared = q**2
        values = self.potential(turn, sign * squared)
        _, steep = self.potential.at(turn)
        mean = np.where(squared > 0, values.gain / np.where(squared > 0, squared, 1.0), sign * steep)
        bend = np.where(squared > 0, values.bend / np.where(squared > 0, squared, 1.0), 0.0)
        by_c = bend / steep
        root = np.sqrt(mean)
        return MotionPoint(
            turn + sign * squared, sign * q * root, 2 / root, values.g, values.slope,
            1 / steep, sign * q * by_c / (2 * root), -by_c / root**3,
        )  # fmt: skip

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.reaching`."""
        return np.sqrt(np.maximum(self.sign * (self.offset + x), 0.0))


@dataclass(frozen=True)
class TwoTurns(CoordinateMotion):
    """u goes to and fro between ``low`` and ``high``, ``span`` apart: u = low + span sin²(q/2).

    Q = (u - low)(high - u) E. Changes are taken from the nearer of the two.
    """

    low: np.ndarray
    high: np.ndarray
    span: np.ndarray

    @property
    def period(self) -> float:
        """2π."""
        return 2 * np.pi

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        shape = q.shape
        low, high, span = (np.broadcast_to(a[:, None], shape) for a in (self.low, self.high, self.span))
        _, low_slope = self.potential.at(self.low)
        _, high_slope = self.potential.at(self.high)
        above, below = span * np.sin(q / 2) ** 2, span * np.cos(q / 2) ** 2
        upper = below < above
        x = np.where(upper, -below, above)
        values = self.potential(np.where(upper, high, low), x)
        safe = np.where(x == 0, 1.0, x)
        steep = np.broadcast_to(np.where(upper, high_slope[:, None], low_slope[:, None]), shape)
        mean = np.where(x == 0, steep, values.gain / safe)
        bend = np.where(x == 0, 0.0, values.bend / safe)
        other = np.where(upper, -above, below)  # the product of the distances is x * other
        ease = mean / other
        root = np.sqrt(ease)
        widening = np.broadcast_to((1 / high_slope - 1 / low_slope)[:, None] / span[:, :1], shape)  # of the span
        u_by_c = 1 / steep + widening * x
        ease_by_c = (bend * u_by_c + steep * widening) / other - 2 * widening * ease
        sine = np.sin(q) * span / 2
        return MotionPoint(
            np.where(upper, high, low) + x, sine * root, 1 / root, values.g, values.slope,
            u_by_c, sine * (widening * root + ease_by_c / (2 * root)), -ease_by_c / (2 * root**3),
        )  # fmt: skip

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """Never: there is nothing between the turning points."""
        return np.full(len(x), np.inf)
