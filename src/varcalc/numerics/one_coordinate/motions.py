"""Motions along one coordinate, in parameters in which they are smooth, and how far they can go.

(du/dτ)² = Q(u) = g(u) - C. Where Q vanishes the ray turns back and dτ =
du/√Q is singular; with u = u_t ± q² it is not, and q goes on through the
turning point. Between two turning points u = m - a cos q does the same for
both. Every way answers with u and w = du/dτ and the rate dτ/dq, and with the
derivatives of these by C at fixed q, in which nothing is singular either.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from varcalc.numerics.one_coordinate.potential import Potential, PotentialNodes, PotentialValues

DOUBTFUL = 1e-10
"""Of g: what is left of it at a node, where that is less, is told from its change."""
HEIGHT_ROUND_OFF = 64 * float(np.finfo(float).eps)
"""Of a height: by how much more a turning point is not off."""
KNOWN = 1e-2
"""Of the change of g over a height: what is left of it has so many digits more than the height."""
OTHER_SIDE = 1e-9
"""Of g: values that differ by more are told on the two sides of a jump."""
AT_JUMP = 8 * float(np.finfo(float).eps)
"""Of a place, and of the start: what is so close to a jump of g is at it."""
LEVEL = 1e-3
"""Of what g would have come to by its slope: where g and C are both less, g - C is told from themselves."""
MOTIONS_TOGETHER = 2048
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

    @property
    def stops(self) -> np.ndarray:
        """See :attr:`Potential.stops`."""
        return self.potential.stops

    @property
    def gentle(self) -> np.ndarray:
        """See :attr:`Potential.gentle`."""
        return self.potential.gentle

    def integrands(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places u (m, k) at ``q`` (m, k), and dτ/dq, times what the potential weights it with, and by C."""
        at = self.at(q)
        weighted = (at.rate * weight for weight in self.potential.weighted(at))
        return at.u, np.stack([at.rate, *weighted, at.rate_by_c])

    def take(self, rows: np.ndarray) -> Self:
        """The motions of ``rows``."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "potential"}
        return type(self)(potential=self.potential, **arrays)

    @abstractmethod
    def at(self, q: np.ndarray) -> MotionPoint:
        """Places (m, k) at the parameters ``q`` (m, k), a row for each motion."""

    @property
    @abstractmethod
    def anchor(self) -> np.ndarray:
        """The place (m,), or the larger of two, from which places on the ways are told: to its round-off."""

    @abstractmethod
    def apart(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """How much higher (m,) the places at the parameters ``last`` (m,) are than those at ``first`` (m,)."""

    @abstractmethod
    def reaching(self, x: np.ndarray) -> np.ndarray:
        """The parameter (m,) at which the motions have come to u₀ + ``x`` for the last time."""

    @abstractmethod
    def height(self, u: np.ndarray) -> np.ndarray:
        """The least parameter (m, k), not negative, at ``u`` (k,); not a number where a motion does not come there."""


@dataclass(frozen=True)
class NoTurn(CoordinateMotion):
    """Q has no zero on the way: q = |u - u₀|, from ``u0`` with the speed squared ``squared``, upwards or downwards."""

    u0: np.ndarray
    squared: np.ndarray
    sign: np.ndarray
    C: np.ndarray

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        sign = self.sign[:, None]
        values = self.potential(self.u0[:, None], sign * q)
        squared, C = self.squared[:, None], self.C[:, None]
        level = np.abs(values.g) + np.abs(C) < LEVEL * squared
        speed = np.sqrt(np.where(level, values.g - C, squared + values.gain))
        nothing = np.zeros_like(q)
        return MotionPoint(
            self.u0[:, None] + sign * q, sign * speed, 1 / speed, values.g, values.slope,
            nothing, -sign / (2 * speed), 1 / (2 * speed * speed * speed),
        )  # fmt: skip

    @property
    def anchor(self) -> np.ndarray:
        """See :attr:`CoordinateMotion.anchor`."""
        return self.u0

    def apart(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.apart`."""
        return self.sign * (last - first)

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.reaching`."""
        return self.sign * x

    def height(self, u: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.height`."""
        return self.sign[:, None] * (u - self.u0[:, None])


@dataclass(frozen=True)
class OneTurn(CoordinateMotion):
    """u = ``turn`` + ``sign`` q²: Q = q² D with D the mean slope between the turning point and u.

    ``offset`` is u₀ - turn, and ``rest`` what ``turn`` is short of the turning point for being rounded.
    """

    turn: np.ndarray
    rest: np.ndarray
    offset: np.ndarray
    sign: np.ndarray
    C: np.ndarray

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        sign, turn = self.sign[:, None], self.turn[:, None]
        squared = q**2
        start, rest = self.potential.at(turn), self.rest[:, None]
        values, steep = self.potential.moved(turn, sign * squared, start), start[1]
        C = self.C[:, None]
        level = np.abs(values.g) + np.abs(C) < LEVEL * squared * np.abs(steep)
        gain = np.where(level, values.g - C, values.gain + rest * values.bend)
        mean = np.where(squared > 0, gain / np.where(squared > 0, squared, 1.0), sign * steep)
        bend = np.where(squared > 0, values.bend / np.where(squared > 0, squared, 1.0), 0.0)
        by_c = bend / steep
        root = np.sqrt(mean)
        return MotionPoint(
            turn + sign * squared, sign * q * root, 2 / root, values.g, values.slope,
            np.broadcast_to(1 / steep, q.shape), sign * q * by_c / (2 * root), -by_c / (mean * root),
        )  # fmt: skip

    @property
    def anchor(self) -> np.ndarray:
        """See :attr:`CoordinateMotion.anchor`."""
        return self.turn

    def apart(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.apart`."""
        return self.sign * (last - first) * (last + first)

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.reaching`."""
        return np.sqrt(np.maximum(self.sign * (self.offset + x), 0.0))

    def height(self, u: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.height`."""
        return np.sqrt(self.sign[:, None] * (u - self.turn[:, None]))


@dataclass(frozen=True)
class TwoTurns(CoordinateMotion):
    """u goes to and fro between ``low`` and ``high``, ``span`` apart: u = low + span sin²(q/2).

    Q = (u - low)(high - u) E. Changes are taken from the nearer of the two, which are ``rests`` (m, 2) short of the
    turning points for being rounded.
    """

    low: np.ndarray
    high: np.ndarray
    rests: np.ndarray
    span: np.ndarray

    @property
    def period(self) -> float:
        """2π."""
        return 2 * np.pi

    def at(self, q: np.ndarray) -> MotionPoint:
        """See :meth:`CoordinateMotion.at`."""
        low, high, span = self.low[:, None], self.high[:, None], self.span[:, None]
        at_low, at_high = self.potential.at(low), self.potential.at(high)
        s, c = np.sin(q / 2), np.cos(q / 2)
        above, below = span * s**2, span * c**2
        upper = below < above
        x = np.where(upper, -below, above)
        rest, over = self.rests[:, :1], self.rests[:, 1:]
        ends = (high, low), (over, rest), *zip(at_high, at_low, strict=True)
        base, short, squared, steep = (np.where(upper, *pair) for pair in ends)
        values = self.potential.moved(base, x, (squared, steep))
        safe = np.where(x == 0, 1.0, x)
        mean = np.where(x == 0, steep, (values.gain + short * values.bend) / safe)
        bend = np.where(x == 0, 0.0, values.bend / safe)
        other = np.where(upper, -above, below)  # the product of the distances is x * other
        ease = mean / other
        root = np.sqrt(ease)
        widening = (1 / at_high[1] - 1 / at_low[1]) / span  # of the span
        u_by_c = 1 / steep + widening * x
        ease_by_c = (bend * u_by_c + steep * widening) / other - 2 * widening * ease
        sine = s * c * span
        return MotionPoint(
            base + x, sine * root, 1 / root, values.g, values.slope,
            u_by_c, sine * (widening * root + ease_by_c / (2 * root)), -ease_by_c / (2 * ease * root),
        )  # fmt: skip

    @property
    def anchor(self) -> np.ndarray:
        """See :attr:`CoordinateMotion.anchor`."""
        return np.where(np.abs(self.low) > np.abs(self.high), self.low, self.high)

    def apart(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.apart`."""
        return self.span * np.sin((last - first) / 2) * np.sin((last + first) / 2)

    def reaching(self, x: np.ndarray) -> np.ndarray:
        """Never: there is nothing between the turning points."""
        return np.full(len(x), np.inf)

    def height(self, u: np.ndarray) -> np.ndarray:
        """See :meth:`CoordinateMotion.height`."""
        return 2 * np.arctan2(np.sqrt(u - self.low[:, None]), np.sqrt(self.high[:, None] - u))


@dataclass(frozen=True)
class MotionBounds:
    """What bounds m motions on one side: ``x`` (m,) from their starts, and whether that is a turning point.

    At a ``jump`` (m,) of g, not a number for none, they are thrown back, though they come there with a speed.
    """

    x: np.ndarray
    turning: np.ndarray
    jump: np.ndarray | float = np.nan

    def take(self, rows: slice) -> MotionBounds:
        """Those of some ``rows``."""
        jump = np.broadcast_to(self.jump, self.x.shape)
        return MotionBounds(self.x[rows], self.turning[rows], jump[rows])


def bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: np.ndarray | int,
) -> MotionBounds:
    """The bounds above (``sign`` 1) or below (-1) of motions from ``u0`` (m,) with w² = ``squared`` = g - C (m,).

    ``wall`` (m,) is the distance of the nearest surface there, infinite where there is none.
    """
    sign = np.broadcast_to(sign, np.shape(u0))
    slices = [slice(k, k + MOTIONS_TOGETHER) for k in range(0, max(len(u0), 1), MOTIONS_TOGETHER)]
    parts = [_bounds(potential, nodes, u0[part], squared[part], C[part], wall[part], sign[part]) for part in slices]
    return MotionBounds(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(MotionBounds)))


def both_bounds(
    potential: Potential, nodes: PotentialNodes, u0: np.ndarray, squared: np.ndarray, C: np.ndarray,
    walls: Sequence[np.ndarray],
) -> tuple[MotionBounds, MotionBounds]:  # fmt: skip
    """The :func:`bounds` of motions below and above, where the nearest surfaces are ``walls`` (each (m,)) off."""
    m = len(u0)
    u0, squared, C = (np.tile(values, 2) for values in (u0, squared, C))
    found = bounds(potential, nodes, u0, squared, C, np.concatenate(walls), np.repeat([-1, 1], m))
    return found.take(slice(m)), found.take(slice(m, None))


def _bounds(
    potential: Potential,
    nodes: PotentialNodes,
    u0: np.ndarray,
    squared: np.ndarray,
    C: np.ndarray,
    wall: np.ndarray,
    sign: np.ndarray,
) -> MotionBounds:
    start, slope = potential.at(u0)
    away, before, beyond = np.empty((3, len(u0)))
    found, jump = np.empty(len(u0), dtype=bool), np.full(len(u0), np.nan)
    sides = [(side, rows) for side in (-1, 1) if len(rows := np.flatnonzero(sign == side))]
    for side, rows in sides:
        own = u0[rows], squared[rows], C[rows], start[rows]
        away[rows], found[rows], before[rows], beyond[rows] = _brackets(potential, nodes, *own, side)
    at_once = (squared == 0) & (sign * slope < 0)
    some = np.flatnonzero(found & ~at_once & (before < wall))
    x, way = np.maximum(away, 0.0), sign[some]
    x[some] = way * potential.zero(u0[some], squared[some], C[some], way * before[some], way * beyond[some])
    x[at_once] = 0.0
    for side, rows in sides:
        stopped = rows[found[rows] & ~at_once[rows]]
        jump[stopped] = _at_jumps(potential, u0[stopped], x[stopped], side)
    x = np.where(np.isnan(jump), x, sign * (jump - u0))
    turning = (found | at_once) & np.isnan(jump) & (x < wall)
    return MotionBounds(sign * np.where(turning, x, np.minimum(x, wall)), turning, np.where(x < wall, jump, np.nan))


def _at_jumps(potential: Potential, u0: np.ndarray, x: np.ndarray, sign: int) -> np.ndarray:
    """The jumps of g (m,) at which motions from ``u0`` (m,) turn back ``x`` (m,) away; not numbers for other places."""
    sides = sign * potential.jumps[::sign, ::sign]
    if len(sides) == 0:
        return np.full(len(u0), np.nan)
    place = sign * u0 + x
    room = AT_JUMP * np.maximum(np.abs(place), np.abs(u0))
    number = np.minimum(np.searchsorted(sides[:, 1], place - room), len(sides) - 1)
    near, far = sides[number].T
    return np.where((near - room <= place) & (place <= far + room), sign * near, np.nan)


def _brackets(
    potential: Potential, nodes: PotentialNodes, u0: np.ndarray, squared: np.ndarray, C: np.ndarray, start: np.ndarray,
    sign: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """How far off the last node is, whether motions turn back before it, and how far off two places between which.

    The first of these is the start where motions turn back before the first node. g is monotone from one of its turns
    to the next, so that it is enough to ask there; where a motion all but comes to rest, a difference of values is
    round-off, and what is left is told from its change.
    """
    outwards = nodes.upwards if sign > 0 else nodes.downwards
    turns, row = outwards.turns, np.arange(len(u0))
    away = outwards.u[turns] - sign * u0[:, None]
    g = np.broadcast_to(outwards.g[turns], away.shape)
    left = PotentialValues(g, g, g - start[:, None], g).above(C[:, None], squared[:, None])
    slack = DOUBTFUL * np.maximum(C, np.abs(start))
    doubtful, turn = np.nonzero(np.abs(left) <= slack[:, None])
    left[doubtful, turn] = _left_at(
        potential(u0[doubtful], sign * away[doubtful, turn]), g[doubtful, turn], C[doubtful], squared[doubtful]
    )
    stopped = (away > 0) & (left <= 0)
    first = np.argmax(stopped, axis=1)
    previous = np.where((first > 0) & (away[row, np.maximum(first - 1, 0)] > 0), turns[np.maximum(first - 1, 0)], -1)
    begin = np.maximum(np.searchsorted(outwards.u, sign * u0, side="right"), previous + 1)
    upper = np.minimum(outwards.first_below(begin, C - slack), turns[first])
    lower = np.minimum(outwards.first_below(begin, C + slack), upper) - 1
    lower = np.where(lower >= begin, lower, previous)
    before = np.where(lower >= 0, np.maximum(outwards.u[np.maximum(lower, 0)] - sign * u0, 0.0), 0.0)
    return away[:, -1], np.any(stopped, axis=1), before, outwards.u[upper] - sign * u0


def _left_at(values: PotentialValues, g: np.ndarray, C: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """g - C (m,) at nodes where there is ``g`` (m,), from the change up to there but beside a jump.

    There the place may come out on its other side for round-off.
    """
    return np.where(np.abs(values.g - g) > OTHER_SIDE * np.abs(g), g - C, values.above(C, squared))


def _turn(potential: Potential, u0: np.ndarray, w0: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The turning points ``x`` from ``u0`` (m,), and how much they are short of being ones for round-off.

    Next to a kink or in a slight slope that matters: g - C at ``u0`` is known better than the place, and must come out
    of changes from there, whose round-off is then that of all of them.
    """
    turn = u0 + x
    size, slope = np.maximum(np.abs(x), np.abs(turn)), potential.at(turn)[1]
    with np.errstate(all="ignore"):
        short = (potential(turn, u0 - turn).gain - w0**2) / slope
    known = (np.abs(short) <= HEIGHT_ROUND_OFF * size) & (w0**2 <= KNOWN * np.abs(slope) * size)
    return turn, np.where(known, short, (u0 - turn) + x)


def ways(
    potential: Potential, u0: np.ndarray, w0: np.ndarray, below: MotionBounds, above: MotionBounds
) -> list[tuple[np.ndarray, CoordinateMotion, np.ndarray]]:
    """The motions by kind: rows, way, and the last parameter (of the rows) on it; those that stay at rest are none."""
    out, C = [], potential.at(u0)[0] - w0**2
    rests = (w0 == 0) & (potential.at(u0)[1] == 0)
    both = below.turning & above.turning & ~rests
    rows = np.flatnonzero(both & (above.x > below.x))
    if len(rows):
        down, up = -below.x[rows], above.x[rows]
        start = 2 * np.arctan2(np.sqrt(down), np.sqrt(up))
        start = np.where(w0[rows] < 0, -start, start)
        (low, low_rest), (high, high_rest) = (_turn(potential, u0[rows], w0[rows], x) for x in (-down, up))
        way = TwoTurns(potential, start, low, high, np.column_stack([low_rest, high_rest]), down + up)
        out.append((rows, way, np.full(len(rows), np.inf)))
    for sign, here, other in ((1, below, above), (-1, above, below)):
        rows = np.flatnonzero(here.turning & ~other.turning & ~rests)
        if len(rows):
            offset = -here.x[rows]
            start = sign * np.where(w0[rows] < 0, -1.0, 1.0) * np.sqrt(np.abs(offset))
            turn, rest = _turn(potential, u0[rows], w0[rows], -offset)
            way = OneTurn(potential, start, turn, rest, offset, np.full(len(rows), float(sign)), C[rows])
            out.append((rows, way, way.reaching(other.x[rows])))
    rows = np.flatnonzero(~below.turning & ~above.turning & (w0 != 0))
    if len(rows):
        sign = np.where(w0[rows] < 0, -1.0, 1.0)
        way = NoTurn(potential, np.zeros(len(rows)), u0[rows], w0[rows] ** 2, sign, C[rows])
        out.append((rows, way, way.reaching(np.where(sign > 0, above.x[rows], below.x[rows]))))
    return out


def seen(gentle: np.ndarray, places: np.ndarray) -> np.ndarray:
    """True (m,) where no two neighbours of ``places`` (m, k) have several of the ``gentle`` ones between them."""
    if len(gentle) == 0:
        return np.ones(len(places), dtype=bool)
    return np.all(np.abs(np.diff(np.searchsorted(gentle, places), axis=1)) <= 1, axis=1)
