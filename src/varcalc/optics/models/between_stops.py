"""How far rays come, and on which optical paths, where g is a formula of its own between stops: tables, kinks.

On a stretch from one place to another with speeds w₀ and w₁ the substitution v = w₀ + (w₁ - w₀)t, with v² linear in
the height, takes ∫ du/w to

    2 L/(w₀ + w₁) ∫ v/w dt,

which is 2 L/(w₀ + w₁) where g is linear, for then v = w, and in which nothing is singular at a turning point. What is
not resolved so is halved, each half with speeds of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.numerics.mesh import gauss
from varcalc.numerics.one_coordinate.motions import AT_JUMP, CoordinateMotion, OneTurn, TwoTurns, seen
from varcalc.numerics.one_coordinate.panels import transform
from varcalc.numerics.one_coordinate.quadrature import MOST_INTEGRAL_PANELS, PANEL_HALVINGS, cut
from varcalc.optics.models.reduction import RayPotential
from varcalc.optics.rays.beam import Rows

RULE_POINTS = 16
_NODES, _WEIGHTS = gauss(RULE_POINTS)
_SHARES, _HALF_WEIGHTS = (1 + _NODES) / 2, _WEIGHTS / 2
_LAST, _AT_SLOWER = transform(RULE_POINTS)[-4:], (-1.0) ** np.arange(RULE_POINTS) @ transform(RULE_POINTS)
"""The last coefficients of an integrand: those that the rule leaves out are about their squares, as these fall off.
And what the points say of it at the slower end, beside which it may change more quickly than anywhere.
"""
BESIDE_TURN = 1e-6
"""Of a stretch: so close to a turning point the integrand is looked at; at other slower ends it is known."""
TAILS_MARGIN = 1e-3
"""Of what an integral may be off: those squares."""
STRETCHES_TOGETHER = 8192
"""Stretches that are integrated over together; bounds the memory."""


def passages_between_stops(
    potential: RayPotential, way: CoordinateMotion, C: np.ndarray, low: np.ndarray, high: np.ndarray, agreed: np.ndarray
) -> np.ndarray:
    """τ and the optical paths (m, 2) from ``low`` to ``high`` (m,) on m ways; not numbers where they are not resolved.

    They are to be known to ``agreed`` (m,), relatively.
    """
    with np.errstate(all="ignore"):
        parts = [(low, high)]
        if isinstance(way, OneTurn | TwoTurns):  # monotone on either side of
            middle = 0.0 if isinstance(way, OneTurn) else np.pi / 2
            parts = [(np.minimum(low, middle), np.minimum(high, middle))]
            parts += [(np.maximum(low, middle), np.maximum(high, middle))]
        left = Stretches.joined([Stretches.of(potential, way, *part) for part in parts])
        total, size = np.zeros((2, len(low), 2))
        for _ in range(PANEL_HALVINGS):
            sums, tails, told = _integrated(potential, left, C)
            size = np.maximum(size, total + _by_row(left.row, np.abs(sums), total))
            known = np.isfinite(sums).all(axis=1)
            small = tails**2 <= TAILS_MARGIN * agreed[left.row, None] * size[left.row] ** 2
            fine = known & told & np.all(small, axis=1)
            total += _by_row(left.row[fine], sums[fine], total)
            total[left.row[~known]] = np.nan
            lost = ~np.all(np.isfinite(total), axis=1)
            left = left.take(np.flatnonzero(~fine & ~np.take(lost, left.row)))
            if len(left) == 0:
                return total
            if len(left) > MOST_INTEGRAL_PANELS * (len(low) + len(way.stops)):
                break
            left = left.halved(potential)
        total[left.row] = np.nan
    return total


@dataclass(frozen=True)
class Stretches(Rows):
    """n stretches of the motions ``row`` (n,), from the slower end ``base``, with the speed ``first``, to the ``last``.

    ``along`` (n,) is the way to the other end with its sign. ``sense`` is -1.0 where they are gone through backwards,
    and ``middle`` (n,) a place inside, which tells the formula of g there.
    """

    row: np.ndarray
    base: np.ndarray
    along: np.ndarray
    first: np.ndarray
    last: np.ndarray
    sense: np.ndarray
    middle: np.ndarray

    @classmethod
    def of(cls, potential: RayPotential, way: CoordinateMotion, low: np.ndarray, high: np.ndarray) -> Stretches:
        """Those between the stops."""
        row, left, right = cut(way, low, high)
        some = np.flatnonzero(left != right)
        row, left, right = row[some], left[some], right[some]
        part = way.take(row)
        ends = part.at(np.stack([left, right], axis=1))
        u, speed = ends.u, np.abs(ends.w)
        if len(potential.jumps):
            speed = _inside(potential, part, left, right, u, speed)
        if isinstance(way, TwoTurns):
            speed[:, 1] = np.where(right >= np.pi, 0.0, speed[:, 1])  # of which the sine is round-off
        apart = part.apart(left, right)
        slower = np.where(speed[:, 0] <= speed[:, 1], 0, 1)
        every = np.arange(len(row))
        along = np.where(slower == 0, apart, -apart)
        return cls(
            row, u[every, slower], along, speed[every, slower], speed[every, 1 - slower],
            np.sign(right - left), u.mean(axis=1),
        )  # fmt: skip

    def squared(self, potential: RayPotential, share: np.ndarray) -> np.ndarray:
        """The squares of the speeds at shares (n, k) of the way from the slower end, from where they lose nothing."""
        far = share * self.along[:, None]
        gain = potential.within(self.middle[:, None], self.base[:, None], far)
        return self.first[:, None] ** 2 + np.where(far == 0, 0.0, gain)  # of a kink no formula tells that

    def halved(self, potential: RayPotential) -> Stretches:
        """Both halves of each."""
        both = self.first + self.last
        share = (0.75 * self.first + 0.25 * self.last) / both
        middle = np.sqrt(self.squared(potential, share[:, None])[:, 0])
        inner, outer = self.along * share, self.along * (0.25 * self.first + 0.75 * self.last) / both
        place, end = self.base + inner, self.base + self.along
        below = replace(self, along=inner, last=middle)
        above = replace(self, base=place, along=outer, first=middle)
        return Stretches.joined([below.ordered(place), above.ordered(end)])

    def ordered(self, end: np.ndarray) -> Stretches:
        """The same from their slower ends; they end at the places ``end`` (n,)."""
        swapped = self.first > self.last
        return replace(
            self,
            base=np.where(swapped, end, self.base),
            along=np.where(swapped, -self.along, self.along),
            first=np.where(swapped, self.last, self.first),
            last=np.where(swapped, self.first, self.last),
        )


def _inside(
    potential: RayPotential,
    way: CoordinateMotion,
    left: np.ndarray,
    right: np.ndarray,
    u: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """The speeds (n, 2) at the ends ``u`` (n, 2) of stretches, at jumps of g those on the inner side."""
    middle = (left + right) / 2
    at = way.at(middle[:, None])
    far = np.stack([way.apart(middle, end) for end in (left, right)], axis=1)
    told = at.w**2 + potential.within(at.u, at.u, far)
    room = AT_JUMP * np.maximum(np.abs(u), np.abs(way.anchor)[:, None])
    jump = np.abs(u[..., None] - potential.jumps[:, 0]) <= room[..., None]
    return np.where(jump.any(axis=-1), np.sqrt(told), speed)


def _integrated(
    potential: RayPotential, stretches: Stretches, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The integrals (n, 2), and the last coefficients (n, 2) of what is integrated, times as much.

    Last comes whether no two neighbours of the places have several between them at which g varies fast (n,).
    """
    (sums, tails), told = np.empty((2, len(stretches), 2)), np.ones(len(stretches), dtype=bool)
    for begin in range(0, len(stretches), STRETCHES_TOGETHER):
        some = slice(begin, begin + STRETCHES_TOGETHER)
        part = stretches.take(some)
        first, last, both = part.first[:, None], part.last[:, None], (part.first + part.last)[:, None]
        slower = np.where(first > 0, 0.0, BESIDE_TURN)
        at = np.concatenate([np.broadcast_to(_SHARES, (len(part), RULE_POINTS)), slower], axis=1)
        v = first + (last - first) * at
        share = at * (first + v) / both
        squared = part.squared(potential, share)
        told[some] = seen(potential.gentle, part.base[:, None] + share[:, :RULE_POINTS] * part.along[:, None])
        rate = 2 * np.abs(part.along)[:, None] / both * v / np.sqrt(squared)
        rates = np.stack([rate, rate * (C[part.row, None] + squared)], axis=1)
        inside, beside = rates[..., :RULE_POINTS], rates[..., RULE_POINTS]
        sums[some] = part.sense[:, None] * (inside @ _HALF_WEIGHTS)
        unseen = np.abs(inside @ _AT_SLOWER - beside)
        tails[some] = np.maximum(np.abs(inside @ _LAST.T).max(axis=2), unseen)
    return sums, tails, told


def _by_row(rows: np.ndarray, parts: np.ndarray, total: np.ndarray) -> np.ndarray:
    """The ``parts`` (n, 2) of the ``rows`` (n,) summed in the shape of ``total`` (m, 2)."""
    return np.stack([np.bincount(rows, column, minlength=len(total)) for column in parts.T], axis=1)
