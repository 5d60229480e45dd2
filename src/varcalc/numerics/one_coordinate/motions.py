"""Motions along one coordinate, in parameters in which they are smooth, and how far they can go.

(du/dτ)² = Q(u) = g(u) - C. Where Q vanishes the ray turns back and dτ =
du/√Q is singular; with u = u_t ± q² it is not, and q goes on through the
turning point. Between two turning points u = m - a cos q does the same for
both. Every way answers with u and w = du/dτ and the rate dτ/dq, and with the
derivatives of these by C at fixed q, in which nothing is singular either.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from varcalc.numerics.one_coordinate.potential import Potential, PotentialNodes, PotentialValues

DOUBTFUL = 1e-10
"""Of g: what is left of it at a node, where that is less, is told from its change."""
TOGETHER = 2048
"""Motions looked at together; bounds the memory."""


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


@dataclass(frozen=True)
class MotionBounds:
    """What bounds m motions on one side: ``x`` (m,) from their starts, and whether that is a turning point."""

    x: np.ndarray
    turning: np.ndarray


def bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: int,
) -> MotionBounds:
    """The bounds above (``sign`` 1) or below (-1) of motions from ``u0`` (m,) with w² = ``squared`` = g - C (m,).

    ``wall`` (m,) is the distance of the nearest surface there, infinite where there is none.
    """
    slices = [slice(k, k + TOGETHER) for k in range(0, len(u0), TOGETHER)]
    parts = [_bounds(potential, nodes, u0[part], squared[part], C[part], wall[part], sign) for part in slices]
    return MotionBounds(np.concatenate([p.x for p in parts]), np.concatenate([p.turning for p in parts]))


def _bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: int,
) -> MotionBounds:
    u, g = nodes.u[::sign], nodes.g[::sign]
    rows = np.arange(len(u0))
    start, slope = potential.at(u0)
    away = sign * (u - u0[:, None])
    left = PotentialValues(g, g, g - start[:, None], g).above(C[:, None], squared[:, None])
    # where a motion all but comes to rest, a difference of values is round-off
    row, node = np.nonzero(np.abs(left) <= DOUBTFUL * np.maximum(C[:, None], np.abs(start[:, None])))
    left[row, node] = potential(u0[row], u[node] - u0[row]).above(C[row], squared[row])
    stopped = (away > 0) & (left <= 0)
    found = np.any(stopped, axis=1)
    first = np.argmax(stopped, axis=1)
    before = np.maximum(away[rows, np.maximum(first - 1, 0)], 0.0)
    before = np.where(first > 0, before, 0.0)
    at_once = (squared == 0) & (sign * slope < 0)
    looked_for = np.flatnonzero(found & ~at_once & (before < wall))
    x = np.maximum(away[:, -1], 0.0)
    low, high = sign * before[looked_for], sign * away[looked_for, first[looked_for]]
    x[looked_for] = sign * potential.zero(u0[looked_for], squared[looked_for], C[looked_for], low, high)
    x[at_once] = 0.0
    turning = (found | at_once) & (x < wall)
    return MotionBounds(sign * np.where(turning, x, np.minimum(x, wall)), turning)


def ways(
    potential: Potential, u0: np.ndarray, w0: np.ndarray, below: MotionBounds, above: MotionBounds
) -> list[tuple[np.ndarray, CoordinateMotion, np.ndarray]]:
    """The motions by kind: rows, way, and the last parameter (of the rows) on it; those that stay at rest are none."""
    out = []
    rests = (w0 == 0) & (potential.at(u0)[1] == 0)
    both = below.turning & above.turning & ~rests
    rows = np.flatnonzero(both & (above.x > below.x))
    if len(rows):
        down, up = -below.x[rows], above.x[rows]
        start = 2 * np.arctan2(np.sqrt(down), np.sqrt(up))
        start = np.where(w0[rows] < 0, -start, start)
        way = TwoTurns(potential, start, u0[rows] - down, u0[rows] + up, down + up)
        out.append((rows, way, np.full(len(rows), np.inf)))
    for sign, here, other in ((1, below, above), (-1, above, below)):
        rows = np.flatnonzero(here.turning & ~other.turning & ~rests)
        if len(rows):
            offset = -here.x[rows]
            start = sign * np.where(w0[rows] < 0, -1.0, 1.0) * np.sqrt(np.abs(offset))
            way = OneTurn(potential, start, u0[rows] - offset, offset, np.full(len(rows), float(sign)))
            out.append((rows, way, way.reaching(other.x[rows])))
    rows = np.flatnonzero(~below.turning & ~above.turning & (w0 != 0))
    if len(rows):
        sign = np.where(w0[rows] < 0, -1.0, 1.0)
        way = NoTurn(potential, np.zeros(len(rows)), u0[rows], w0[rows] ** 2, sign)
        out.append((rows, way, way.reaching(np.where(sign > 0, above.x[rows], below.x[rows]))))
    return out
