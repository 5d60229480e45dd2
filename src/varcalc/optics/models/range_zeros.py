"""All zeros of families of smooth functions of one unknown, with their derivatives.

Intervals are halved until the cubic through values and rates at the ends
foretells the middle. What changes its sign is then bracketed, and where a
function comes close to zero and turns round, the turning point is located
first and says whether there are two zeros, one or none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

FIRST_PLACES = 33
"""Places looked at in each interval to begin with, closer together at its ends."""
INSET = 1e-13
"""Of an interval: how close to its ends, where a function may be infinite, it is looked at."""
WELL_FORETOLD = 0.02
"""Of the change over an interval: how well a cubic must foretell the middle."""
RATE_MARGIN = 4.0
"""How much faster than at the ends of an interval a function is taken to change inside it."""
HALVINGS = 44
"""Of an interval; zeros that lie closer together than that are not told from each other."""
JUMP = 1e3
"""Of what counts as touching: a change of sign that leaves more than that is a jump, as where a ray starts level."""
JUMP_BY_RATE = 1e-12
"""The same, in units of the function's change over a unit of the unknown."""
BRACKET_STEPS = 80
"""Steps of a bracketed search."""


@dataclass(frozen=True)
class RangeValues:
    """Values, rates and ``bound`` (F, m) of F functions at m places; the bound is positive where none is asked for."""

    value: np.ndarray
    rate: np.ndarray
    bound: np.ndarray


@dataclass(frozen=True)
class Zeros:
    """``at`` (k,) which places which function ``number`` (k,) vanishes; ``touching`` where it turns round there.

    ``looked_at`` counts places, ``unresolved`` intervals that were given up.
    """

    at: np.ndarray
    number: np.ndarray
    touching: np.ndarray
    looked_at: int
    unresolved: int


class ZeroSearch:
    """The zeros of ``functions`` between the ``breaks``, to within ``touch`` of their values."""

    def __init__(self, functions: Callable[[np.ndarray], RangeValues], breaks: np.ndarray, touch: float) -> None:
        self.functions, self.breaks, self.touch = functions, breaks, touch
        self.looked_at = self.unresolved = 0

    def run(self) -> Zeros:
        """All of them."""
        with np.errstate(all="ignore"):  # functions may be infinite, or no numbers, at places
            return self._run()

    def _run(self) -> Zeros:
        share = (1 - np.cos(np.linspace(0, np.pi, FIRST_PLACES))) / 2
        share = np.concatenate([[0.0, INSET], share[1:-1], [1 - INSET, 1.0]])
        places = self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * share
        low, high = places[:, :-1].ravel(), places[:, 1:].ravel()
        left, right = self._look(low), self._look(high)
        found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = [self._at_places(places.ravel())]
        for halving in range(HALVINGS):
            middle = (low + high) / 2
            there = self._look(middle)
            fine = self._settled(left, there, right, high - low) | self._inset(low, high)
            if halving == HALVINGS - 1:
                self.unresolved += int(np.count_nonzero(~fine))
                fine[:] = True
            found += self._between(low[fine], _taken(left, fine), middle[fine], _taken(there, fine))
            found += self._between(middle[fine], _taken(there, fine), high[fine], _taken(right, fine))
            rest = ~fine
            if not np.any(rest):
                break
            low, high = np.append(low[rest], middle[rest]), np.append(middle[rest], high[rest])
            left, right = _joined(left, there, rest), _joined(there, right, rest)
        at, number, touching = (np.concatenate(column) for column in zip(*found, strict=True))
        return Zeros(at, number.astype(int), touching.astype(bool), self.looked_at, self.unresolved)

    def _inset(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """True (m,) for intervals next to a break, where nothing is looked for however a function behaves."""
        room = 2 * INSET * np.ptp(self.breaks)
        return (np.abs(np.stack([low, high])[..., None] - self.breaks).max(axis=0) <= room).any(axis=1)

    def _look(self, places: np.ndarray) -> RangeValues:
        self.looked_at += len(places)
        return self.functions(places)

    def _at_places(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The zeros at the breaks themselves, beyond which there may be nothing."""
        ends = np.array([places[0], places[-1]])
        number, k = np.nonzero(np.abs(self._look(ends).value) <= self.touch)
        return ends[k], number, np.zeros(len(k))

    def _settled(self, left: RangeValues, there: RangeValues, right: RangeValues, width: np.ndarray) -> np.ndarray:
        """True (m,) for intervals in which every function is foretold, or has no zero, or is not asked for."""
        value = np.stack([left.value, there.value, right.value])
        rate = np.stack([left.rate, there.rate, right.rate])
        nothing = np.all(np.isnan(value), axis=0)
        beyond = np.all(np.stack([left.bound, there.bound, right.bound]) > 0, axis=0)
        steepest = np.max(np.abs(rate), axis=0)
        far = np.all(np.abs(value) > RATE_MARGIN * width * steepest, axis=0)
        foretold = (left.value + right.value) / 2 + width * (left.rate - right.rate) / 8
        slope = 1.5 * (right.value - left.value) / width - (left.rate + right.rate) / 4
        smooth = np.abs(foretold - there.value) <= WELL_FORETOLD * width * steepest
        smooth &= np.abs(slope - there.rate) <= 4 * WELL_FORETOLD * steepest
        return np.all(nothing | beyond | far | smooth, axis=0)

    def _between(
        self, low: np.ndarray, left: RangeValues, high: np.ndarray, right: RangeValues
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """The zeros between neighbouring places."""
        number, k = np.nonzero(left.value * right.value <= 0)
        crossing = self._crossings(low[k], high[k], number, left.value[number, k])
        toward = (left.rate * right.rate < 0) & (left.value * left.rate < 0) & (left.value * right.value > 0)
        near = np.minimum(np.abs(left.value), np.abs(right.value)) <= RATE_MARGIN * (high - low) * np.maximum(
            np.abs(left.rate), np.abs(right.rate)
        )
        number, k = np.nonzero(toward & near)
        return [crossing, *self._folds(low[k], high[k], number, left, k)]

    def _crossings(
        self, low: np.ndarray, high: np.ndarray, number: np.ndarray, first: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Newton's steps kept inside brackets; ``first`` is the value at ``low``."""
        at, sign = (low + high) / 2, np.where(first != 0, np.sign(first), 1.0)
        at = np.where(first == 0, low, at)
        going, jump = np.flatnonzero(first != 0), np.zeros(len(at), dtype=bool)
        for _ in range(BRACKET_STEPS):
            if len(going) == 0:
                break
            value, rate = self._of(at[going], number[going])
            jump[going] = np.abs(value) > JUMP * self.touch + JUMP_BY_RATE * np.abs(rate)
            same = value * sign[going] > 0
            low[going[same]], high[going[~same]] = at[going[same]], at[going[~same]]
            step = at[going] - value / rate
            inside = (step >= low[going]) & (step <= high[going])
            step = np.where(inside, step, (low[going] + high[going]) / 2)
            moved = np.abs(step - at[going])
            at[going] = step
            met = np.abs(value) <= self.touch / 128
            going = going[~met & (moved > 4e-16 * np.maximum(np.abs(step), 1e-3))]
        return at[~jump], number[~jump], np.zeros(np.count_nonzero(~jump))

    def _folds(
        self, low: np.ndarray, high: np.ndarray, number: np.ndarray, left: RangeValues, k: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """The zeros on both sides of the places at which functions turn round."""
        if len(low) == 0:
            return []
        first, slope = left.value[number, k], left.rate[number, k]
        begin, end = low.copy(), high.copy()
        middle, value = low, first
        for _ in range(BRACKET_STEPS):
            middle = (begin + end) / 2
            value, rate = self._of(middle, number)
            same = rate * slope > 0
            begin, end = np.where(same, middle, begin), np.where(same, end, middle)
            if np.all((value * first < 0) | (end - begin <= 4e-16 * np.maximum(np.abs(end), 1e-3))):
                break
        over = (value * first < 0) & (np.abs(value) > self.touch)
        touching = (np.abs(value) <= self.touch) & ~over
        parts = [(middle[touching], number[touching], np.ones(int(np.sum(touching))))]
        parts.append(self._crossings(low[over], middle[over], number[over], first[over]))
        parts.append(self._crossings(middle[over], high[over], number[over], value[over]))
        return parts

    def _of(self, places: np.ndarray, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and rates (k,) of function ``number`` (k,) at ``places`` (k,)."""
        found = self._look(places)
        rows = np.arange(len(places))
        return found.value[number, rows], found.rate[number, rows]


def _taken(family: RangeValues, columns: np.ndarray) -> RangeValues:
    return RangeValues(family.value[:, columns], family.rate[:, columns], family.bound[:, columns])


def _joined(first: RangeValues, second: RangeValues, columns: np.ndarray) -> RangeValues:
    pairs = zip((first.value, first.rate, first.bound), (second.value, second.rate, second.bound), strict=True)
    return RangeValues(*(np.concatenate([a[:, columns], b[:, columns]], axis=1) for a, b in pairs))
