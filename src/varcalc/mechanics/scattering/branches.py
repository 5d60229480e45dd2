"""The deflection as a function of the impact parameter: where it is smooth, its extrema, and where it has a value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from varcalc.mechanics.scattering.deflection import Deflections
from varcalc.numerics.roots import bracketed_newton, scanned_root
from varcalc.showing import Shown

DEEPEST = 34.0
"""Of |ln|: e^-34 is the round-off of what is next to an end."""
UNDECIDED_IMPACT = 64 * float(np.finfo(float).eps)
"""Of an impact parameter: nearer to one at which the angle diverges or jumps round-off decides on which side it is."""
LEAST_DEFLECTION = 1e-12
"""Radians: impact parameters at which an orbit is deflected by less are not looked at."""
FIRST, PLACE_HALVINGS = 64, 10
"""Places that are looked at in each interval to begin with, and times they are halved."""
ANGLE_FORETOLD = 3e-3
"""Of its change, or of a radian: how well a cubic must foretell the angle in the middle of two places."""
SAME_ANGLE = 1e-13
"""Radians: angles that differ by no more are the same."""
QUADRATIC = 1e-9
"""A Newton step below this is the last: convergence is quadratic."""

Deflecting = Callable[[np.ndarray], Deflections]


@dataclass(frozen=True)
class Interval:
    """Impact parameters between ``low`` and ``high``, which may be infinite, between which the angle is smooth.

    A parameter z goes from -∞ at the one to ∞ at the other and tells them apart to round-off.
    """

    low: float
    high: float

    @property
    def _unit(self) -> float:
        return self.low if self.low > 0 else 1.0

    def impact(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """b and db/dz."""
        if np.isinf(self.high):
            grown = self._unit * np.exp(z)
            return self.low + grown, grown
        width, share, rest = self.high - self.low, 1 / (1 + np.exp(-z)), 1 / (1 + np.exp(z))
        return np.where(z < 0, self.low + width * share, self.high - width * rest), width * share * rest

    def parameter(self, impact: float) -> float:
        """The z of an impact parameter."""
        above = impact - self.low
        return float(np.log(above / (self._unit if np.isinf(self.high) else self.high - impact)))


@dataclass(frozen=True, repr=False)
class Rainbow(Shown):
    """Where the angle is stationary: the ``impact`` parameter and the ``angle``."""

    impact: float
    angle: float


@dataclass(frozen=True)
class Branches:
    """Cells of m intervals of impact parameters in which the angle is monotone, and the extrema between them.

    ``interval`` (m,) tells of which interval a cell is, ``z`` (m, 2) its ends, ``angle`` (m, 2) the angles there.
    """

    deflecting: Deflecting
    intervals: tuple[Interval, ...]
    interval: np.ndarray
    z: np.ndarray
    angle: np.ndarray
    extrema: tuple[Rainbow, ...]

    @property
    def least(self) -> float:
        """The least angle, either way, at the largest impact parameter that was looked at; 0 where there are none."""
        open_ended = [k for k, one in enumerate(self.intervals) if np.isinf(one.high)]
        if not open_ended:
            return 0.0
        return float(np.abs(self.angle[self.interval == open_ended[0], 1][-1]))

    def meeting(self, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the angle has one of the ``targets`` (k,): number of the target, b and dχ/db, all (n,)."""
        low, high = np.sort(self.angle, axis=1).T
        first, last = np.searchsorted(targets, low), np.searchsorted(targets, high)
        count = np.where(high - low > SAME_ANGLE, last - first, 0)
        cell = np.repeat(np.arange(len(count)), count)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
        wanted, rising = targets[number], self.angle[cell, 1] > self.angle[cell, 0]
        way, interval = np.where(rising, -1.0, 1.0), self.interval[cell]
        share = (wanted - self.angle[cell, 0]) / (self.angle[cell, 1] - self.angle[cell, 0])
        start = self.z[cell, 0] + share * (self.z[cell, 1] - self.z[cell, 0])

        def left(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """How far the angle is from the wanted one, falling with z (n,), and its derivative."""
            impact, rate = self._impacts(interval, z)
            found = self.deflecting(impact)
            off = found.angle - wanted
            # next to what orbits, neighbouring impact parameters are far apart in z, and in angle
            met = np.abs(off) <= np.spacing(impact) * np.abs(found.slope)
            return np.where(met, 0.0, way * off), way * found.slope * rate

        if len(cell) == 0:
            return number, start, start
        z, _ = bracketed_newton(left, self.z[cell, 0], self.z[cell, 1], start, absolute=QUADRATIC)
        impact = self._impacts(interval, z)[0]
        return number, impact, self.deflecting(impact).slope

    def _impacts(self, interval: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """b and db/dz at ``z`` of the intervals of these numbers."""
        impact, rate = np.empty_like(z), np.empty_like(z)
        for k in np.unique(interval):
            mine = interval == k
            impact[mine], rate[mine] = self.intervals[k].impact(z[mine])
        return impact, rate

    def angles(self, interval: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The angle and its derivative by z."""
        impact, rate = self._impacts(interval, z)
        found = self.deflecting(impact)
        return found.angle, found.slope * rate


def branches(deflecting: Deflecting, intervals: tuple[Interval, ...]) -> Branches:
    """The cells of all intervals."""
    kept: list[Interval] = []
    cells: list[tuple[np.ndarray, np.ndarray]] = []
    extrema: list[Rainbow] = []
    for interval in intervals:
        found = _Sampled.of(deflecting, interval)
        if found is None:
            continue
        kept.append(interval)
        z, angle, turned = found.cut()
        cells.append((z, angle))
        extrema += turned
    number = np.concatenate([np.full(len(z) - 1, k) for k, (z, _) in enumerate(cells)] or [np.zeros(0, dtype=int)])
    pairs = [[np.column_stack([c[:-1], c[1:]]) for c in cell] for cell in cells] or [[np.zeros((0, 2))] * 2]
    z, angle = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return Branches(deflecting, tuple(kept), number, z, angle, tuple(sorted(extrema, key=lambda one: one.impact)))


@dataclass(frozen=True)
class _Sampled:
    """Angles and their derivatives by z at places ``z`` (k,) of one interval."""

    deflecting: Deflecting
    interval: Interval
    z: np.ndarray
    angle: np.ndarray
    slope: np.ndarray

    @classmethod
    def of(cls, deflecting: Deflecting, interval: Interval) -> _Sampled | None:
        """Places close enough for a cubic to foretell what lies between; None where there is no deflection."""
        ends = (-DEEPEST, DEEPEST)
        if np.isinf(interval.high):
            ends = (
                (-DEEPEST - 2 * np.log(10) * 7, DEEPEST + 2 * np.log(10) * 7)
                if interval.low == 0
                else (-DEEPEST, 2 * DEEPEST)
            )
        one = cls._at(deflecting, interval, np.linspace(*ends, FIRST + 1))
        if len(one.z) < 2 or np.abs(one.angle).max() <= SAME_ANGLE:
            return None
        one = one.within()
        for _ in range(PLACE_HALVINGS):
            middles = one.coarse()
            if len(middles) == 0:
                break
            more = cls._at(deflecting, interval, middles)
            order = np.argsort(z := np.append(one.z, more.z))
            angle, slope = np.append(one.angle, more.angle)[order], np.append(one.slope, more.slope)[order]
            one = cls(deflecting, interval, z[order], angle, slope)
        return one

    @classmethod
    def _at(cls, deflecting: Deflecting, interval: Interval, z: np.ndarray) -> _Sampled:
        impact, rate = interval.impact(z)
        room = UNDECIDED_IMPACT * impact
        inside = (impact - interval.low > (room if interval.low > 0 else 0.0)) & (interval.high - impact > room)
        found = deflecting(impact[inside])
        good = np.isfinite(found.angle) & np.isfinite(found.slope)
        return cls(deflecting, interval, z[inside][good], found.angle[good], (found.slope * rate[inside])[good])

    def within(self) -> _Sampled:
        """Without the far end, where next to nothing is deflected."""
        felt = np.flatnonzero(np.abs(self.angle) > LEAST_DEFLECTION)
        stop = felt[-1] + 2 if np.isinf(self.interval.high) else len(self.z)
        return _Sampled(self.deflecting, self.interval, self.z[:stop], self.angle[:stop], self.slope[:stop])

    def coarse(self) -> np.ndarray:
        """The middles of the cells that a cubic does not foretell, told by the places to their left and right."""
        width, change = np.diff(self.z), np.diff(self.angle)
        bend = np.abs(np.diff(self.slope)) * width / 8
        off = np.abs(change - width * (self.slope[1:] + self.slope[:-1]) / 2)
        bad = (np.maximum(bend, off) > ANGLE_FORETOLD * (1 + np.abs(change))) & (width > 1e-9)
        return (self.z[1:] + self.z[:-1])[bad] / 2

    def cut(self) -> tuple[np.ndarray, np.ndarray, list[Rainbow]]:
        """Places and angles with the extrema among them."""
        turn = np.flatnonzero(np.sign(self.slope[1:]) * np.sign(self.slope[:-1]) < 0)
        places, extrema = [], []
        for k in turn.tolist():
            z = scanned_root(self._slope, float(self.z[k]), float(self.z[k + 1]), 0.0)
            if z is None:
                continue
            impact = self.interval.impact(np.array([z]))[0]
            angle = float(self.deflecting(impact).angle[0])
            if not self._stands_out(k, angle):
                continue
            places.append((z, angle))
            extrema.append(Rainbow(float(impact[0]), angle))
        z, angle = np.append(self.z, [p[0] for p in places]), np.append(self.angle, [p[1] for p in places])
        order = np.argsort(z)
        return z[order], angle[order], extrema

    def _stands_out(self, k: int, angle: float) -> bool:
        """Whether an extremum in cell ``k`` is more than the round-off of the angles beside it."""
        beside = self.angle[[k, k + 1]]
        return bool(np.max(np.abs(beside - angle)) > SAME_ANGLE * np.max(np.abs(beside)))

    def _slope(self, z: np.ndarray) -> np.ndarray:
        impact, rate = self.interval.impact(z)
        return self.deflecting(impact).slope * rate
