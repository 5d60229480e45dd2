"""Roots and minima along one line, on whole arrays at a time: a call costs about as much for 300 places as for one.

All zeros of families of smooth functions are found by halving intervals until the cubic through values and rates at
the ends foretells the middle (:class:`ZeroSearch`). What changes its sign is then bracketed, and where a function comes
close to zero and turns round, the turning point is located first and says whether there are two zeros, one or none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

EPSILON = float(np.finfo(float).eps)
SCANS = 40
"""Scans of a bracket; each leaves at most half of it, an analytic function 1e-5 of it or less."""
SPREAD = np.array([1e-7, 1e-5, 1e-3, 3e-2, 0.2, 0.5])
"""Distances from the place foretold, in units of the bracket, at which a function is looked at."""
NEIGHBOURS = 3
"""Places on either side of a change of sign through which the inverse function is laid."""
NEWTON_STEPS = 100
SHARES = np.linspace(0.0, 1.0, 65)
DOUBLINGS = 80
NARROWING = 6
CUTS = 257
"""Places of a scan that looks for an extremum: 128^-6 = 2e-13 of the first bracket after all."""
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


def scanned_root(function: Callable[[np.ndarray], np.ndarray], low: float, high: float, close: float) -> float | None:
    """A root of a ``function`` (m,) -> (m,) between two places where its signs differ, by scans and interpolation.

    Taken as met where the function is not farther than ``close`` from zero. None when the ends do not bracket a root
    or no change of sign is left between places at which the function is a number.
    """
    at, spread = np.linspace(low, high, 2 * len(SPREAD) + 3), abs(high - low)
    for _ in range(SCANS):
        values = function(at)
        at, values = at[np.isfinite(values)], values[np.isfinite(values)]
        change = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) <= 0)
        if len(change) == 0:
            return None
        k = int(change[0])
        best = k + int(abs(values[k + 1]) < abs(values[k]))
        a, b = float(at[k]), float(at[k + 1])
        spread = abs(b - a)
        if abs(values[best]) <= close or spread <= 2 * EPSILON * abs(at[best]) + 1e-300:
            return float(at[best])
        near = slice(max(k + 1 - NEIGHBOURS, 0), k + 1 + NEIGHBOURS)
        guess = _inverse(at[near], values[near], a, b)
        inner = guess + (b - a) * np.concatenate([-SPREAD[::-1], [0.0], SPREAD])
        ends = min(a, b), max(a, b)
        inner = inner[(inner > ends[0]) & (inner < ends[1])]
        at = np.concatenate([[a], inner, [b]])
    return float(at[len(at) // 2])


def _inverse(at: np.ndarray, values: np.ndarray, a: float, b: float) -> float:
    """Where the inverse function is zero, by interpolation where that is safe, else halfway."""
    steps = np.diff(values)
    if np.all(steps > 0) or np.all(steps < 0):
        apart = values[:, None] - values
        np.fill_diagonal(apart, 1.0)
        shares = np.where(np.eye(len(values), dtype=bool), 1.0, -values / apart)
        guess = float(np.prod(shares, axis=1) @ at)
        if min(a, b) < guess < max(a, b):
            return guess
    return 0.5 * (a + b)


def least(function: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> float:
    """The place of a minimum inside a bracket, by repeated scans; where the function is no number it is not."""
    for _ in range(NARROWING):
        at = np.linspace(low, high, CUTS)
        k = int(np.argmin(np.nan_to_num(function(at), nan=np.inf)))
        low, high = float(at[max(k - 1, 0)]), float(at[min(k + 1, CUTS - 1)])
    return 0.5 * (low + high)


def edges(
    holds: Callable[[np.ndarray], np.ndarray], inside: np.ndarray, outside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where a condition (m, k) -> (m, k) ceases to hold, going from ``inside`` (m,), where it does, to ``outside``.

    Neighbouring numbers (m,) and (m,), the last at which it holds and the first at which it does not.
    """
    rows = np.arange(len(inside))
    for _ in range(SCANS):
        at = inside[:, None] + (outside - inside)[:, None] * SHARES
        at[:, -1] = outside
        good = holds(at)
        good[:, 0], good[:, -1] = True, False
        first = np.argmin(good, axis=1)
        before, after = at[rows, first - 1], at[rows, first]
        if np.all((before == inside) & (after == outside)):
            break
        inside, outside = before, after
    return inside, outside


def bracketed_newton(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], low: np.ndarray, high: np.ndarray, at: np.ndarray,
    *, relative: float = 0.0, absolute: float = 0.0, flat: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Roots between ``low``, where the function is positive, and ``high``, by Newton's steps kept inside the brackets.

    ``function`` takes places, in the shape of ``at``, where it begins, to values and derivatives. A step is the last
    where it is within ``relative`` of the place and ``absolute``, or starts from a value within ``flat``. Returns the
    places, and the last step of each; NaN stays what it is.
    """
    moved = np.full(np.shape(at), np.inf)
    for _ in range(NEWTON_STEPS):
        value, rate = function(at)
        low, high = np.where(value > 0, at, low), np.where(value > 0, high, at)
        with np.errstate(all="ignore"):
            newton = np.where(value == 0, at, at - value / rate)
        # at round-off the sign of the value, and so the bracket, means nothing
        last = (np.abs(newton - at) <= relative * np.abs(at) + absolute) | (np.abs(value) <= flat)
        following = np.where(((newton - low) * (newton - high) < 0) | last, newton, (low + high) / 2)
        moved, at = np.abs(following - at), following
        if not np.any((moved > relative * np.abs(at) + absolute) & ~last):
            break
    return at, moved


def growing(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], guess: np.ndarray, relative: float
) -> np.ndarray:
    """Where functions that never fall, and are negative at 0, vanish: places in the shape of ``guess``, not negative.

    ``function`` takes places to values and derivatives. The guess is doubled until it is beyond; Newton's steps,
    kept inside the bracket, end where they are within ``relative`` of the place.
    """
    low, high = np.zeros(np.shape(guess)), np.maximum(guess, 0.0)
    with np.errstate(all="ignore"):
        for _ in range(DOUBLINGS):
            short = function(high)[0] < 0
            if not np.any(short):
                break
            low, high = np.where(short, high, low), np.where(short, 2 * high, high)

        def falling(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, rate = function(at)
            return -value, -rate

        return bracketed_newton(falling, low, high, np.clip(guess, low, high), relative=relative)[0]


def quadratic(constant: np.ndarray, slope: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Both zeros (2, ...) of constant + slope x + bend x², without cancellation; not numbers where there are none."""
    with np.errstate(all="ignore"):
        q = -(slope + np.copysign(np.sqrt(slope**2 - 4 * constant * bend), slope)) / 2
        return np.stack([q / bend, constant / q])


def quadratic_ahead(
    level: np.ndarray, slope: np.ndarray, bend: np.ndarray, leaving: np.ndarray | bool = False
) -> np.ndarray:
    """The zeros (2, ...) of level + slope x + bend x²/2; of those ``leaving`` one at x = 0 only the other."""
    if not np.any(leaving):
        return quadratic(level, slope, bend / 2)
    with np.errstate(all="ignore"):
        other = np.stack([-2 * slope / bend, np.full_like(slope, np.nan)])
    return other if np.all(leaving) else np.where(leaving, other, quadratic(level, slope, bend / 2))


def first_ahead(places: np.ndarray) -> np.ndarray:
    """The least positive number of the first axis; infinite where there is none."""
    return np.where(np.isfinite(places) & (places > 0), places, np.inf).min(axis=0)


@dataclass(frozen=True)
class FamilyValues:
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

    def __init__(self, functions: Callable[[np.ndarray], FamilyValues], breaks: np.ndarray, touch: float) -> None:
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

    def _look(self, places: np.ndarray) -> FamilyValues:
        self.looked_at += len(places)
        return self.functions(places)

    def _at_places(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The zeros at the breaks themselves, beyond which there may be nothing."""
        ends = np.array([places[0], places[-1]])
        number, k = np.nonzero(np.abs(self._look(ends).value) <= self.touch)
        return ends[k], number, np.zeros(len(k))

    def _settled(self, left: FamilyValues, there: FamilyValues, right: FamilyValues, width: np.ndarray) -> np.ndarray:
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
        self, low: np.ndarray, left: FamilyValues, high: np.ndarray, right: FamilyValues
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
        self, low: np.ndarray, high: np.ndarray, number: np.ndarray, left: FamilyValues, k: np.ndarray
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


def _taken(family: FamilyValues, columns: np.ndarray) -> FamilyValues:
    return FamilyValues(family.value[:, columns], family.rate[:, columns], family.bound[:, columns])


def _joined(first: FamilyValues, second: FamilyValues, columns: np.ndarray) -> FamilyValues:
    pairs = zip((first.value, first.rate, first.bound), (second.value, second.rate, second.bound), strict=True)
    return FamilyValues(*(np.concatenate([a[:, columns], b[:, columns]], axis=1) for a, b in pairs))
