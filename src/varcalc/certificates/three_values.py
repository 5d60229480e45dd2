"""How little a convex function less a line may be, by three of its values, which need no derivative.

Where phi(a) and phi(b) are no less than phi(c), a < c < b, it is least between a and b, and there nowhere below the
lines through c and a, and through c and b.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from varcalc.certificates.balls import Around, Ball, Box, flint
from varcalc.certificates.jets import Switch
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.statement import Statement
from varcalc.certificates.taylor import Values

POWERS_OF_4 = range(-46, 12)
"""Those, of the size of the slope, that distances of the outer places are tried from."""
FAR_ENOUGH = 2.0**-50
"""Distance, relative to that size, from which on three values tell a slope."""
INWARD, UNEVEN = (-1, -4, -7, -10, -13, -16), 4.0
"""Powers of 4, of how far the farther outer place is, that the inner one is moved by; how far it is, relative to the
size of the slope, where that is tried."""


@dataclass(frozen=True)
class Term:
    """A convex function of x and of the state or control of the number ``place``, between ``low`` and ``high``."""

    place: int
    stated: Statement
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class Part:
    """A box of the piece ``k``, with the curve on it.

    ``rows`` are its states and controls, ``value`` that of R, ``slopes`` R's derivatives by these, ``rates`` those of
    the terms of functions, by their places.
    """

    k: int
    box: Box
    views: list[Around]
    rows: list[Values]
    value: Values
    slopes: list[Values]
    rates: dict[int, Values]


class ThreeValues:
    """A ``term`` less the line of some ``slope`` on a part, c near the curve; distances are counted in ``size``."""

    def __init__(self, part: Part, term: Term, slope: Values, size: float, switches: Sequence[Switch]) -> None:
        self.part, self.term, self.slope, self.size, self.switches = part, term, slope, size, switches
        self._kept: dict[tuple[float, float], Values | None] = {}

    def at(self, shift: float, more: float = 0.0) -> Values | None:
        """The function at the distance ``shift + more`` from the curve; None where it is not smooth there."""
        key = shift, more
        if key not in self._kept:
            # the sum of two doubles may be one of them
            self._kept[key] = self._evaluated(flint().arb(shift) + more)
        return self._kept[key]

    def _evaluated(self, shift: Ball) -> Values | None:
        stated, n = self.term.stated, self.term.stated.n
        found = []
        for view, values in zip(
            self.part.views, zip(*(r.by_views() for r in self.part.rows), strict=True), strict=True
        ):
            row = list(values)
            row[self.term.place] = row[self.term.place] + shift
            try:
                found.append(stated.jet(view.abscissa(), row[:n], row[n:], 0, self.switches).value)
            except Undecided:
                return None
        return Values.on(self.part.views, found)

    def least(self) -> tuple[Ball, Ball] | None:
        """The integral over t in [-1, 1] of the function on the curve, or more, and how much less it may be at any x.

        None where that is not found.
        """
        on, shift = self.at(0.0), 0.0
        if on is None:
            # on a kink: no more than the mean of what it is on either side
            shift = next((d for d in self._distances if self.at(d) and self.at(-d)), 0.0)
            right, left = self.at(shift), self.at(-shift)
            if right is None or left is None:
                return None
            on = (right + left) * 0.5
        best, far = self._less(on, shift)
        # beside a kink it may be least on the other side, and a line leads far below: the inner place is moved there
        for k in INWARD if abs(far) > UNEVEN * self.size else ():
            other = self._less(on, far * 4.0**k)[0]
            best = other if best is None or (other is not None and other < best) else best
        return None if best is None else (on.integral(), best)

    def _less(self, on: Values, shift: float) -> tuple[Ball | None, float]:
        """How much less than ``on`` the function may be, with the inner place at ``shift``; None where that fails.

        Then how far the farther outer place is.
        """
        inner = self.at(shift)
        above_it, below_it = (self._side(sign, shift) for sign in (1, -1))
        if inner is None or above_it is None or below_it is None:
            return None, 0.0
        (right, up), (left, down) = above_it, below_it
        zero = flint().arb(0)
        less = [
            a.upper() * b.upper() if a.upper() > 0 and b.upper() > 0 else zero for a, b in ((up, left), (down, right))
        ]
        gap = zero if inner is on else (on - inner + self.slope * shift).ball
        return (gap + less[0].max(less[1])).upper(), float(right) if right > left else -float(left)

    @cached_property
    def _distances(self) -> list[float]:
        return [self.size * 4.0**k for k in POWERS_OF_4]

    def _side(self, sign: int, shift: float) -> tuple[Ball, Ball] | None:
        """How far on one side the function may be least, and from above the slope of a line that leads on to there.

        None where no place is found at which the function is proved to be no less than near the curve.
        """
        first = bisect.bisect_left(self._distances, True, key=lambda d: self._serves(sign, shift, d))
        if first == len(self._distances):
            return None
        d, room = self._distances[first], self._room(sign, shift)
        if not room <= d:
            return flint().arb(d), self._slope_to(sign, shift, d)
        # it is least at the bound, or on this side of it: where the line leads is seen from a little farther on
        return room.max(0), self._slope_to(sign, shift, max(d, self.size * FAR_ENOUGH))

    def _slope_to(self, sign: int, shift: float, d: float) -> Ball:
        """The slope of the line through an outer place and the inner one, upwards; all numbers if that is not known."""
        rise = self._rise(sign, shift, d)
        return rise.ball / d if rise is not None and rise.ball.is_finite() else flint().arb(0, math.inf)

    def _serves(self, sign: int, shift: float, d: float) -> bool:
        if self._room(sign, shift) <= d:
            return True
        rise = self._rise(sign, shift, d)
        return rise is not None and rise.positive

    def _room(self, sign: int, shift: float) -> Ball:
        """How far the bound on one side is from the inner place."""
        limit = self.term.high if sign > 0 else self.term.low
        if math.isinf(limit):
            return flint().arb(math.inf)
        return (self.part.rows[self.term.place].ball + shift - limit) * -sign

    def _rise(self, sign: int, shift: float, d: float) -> Values | None:
        """What the function less the line is more at an outer place than at the inner one."""
        outer, inner = self.at(shift, sign * d), self.at(shift)
        return None if outer is None or inner is None else outer - inner - self.slope * (sign * d)
