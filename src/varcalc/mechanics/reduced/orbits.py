"""The motions of one energy in one coordinate, by quadrature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from varcalc.mechanics.arguments import sampled
from varcalc.mechanics.reduced.effective import ANGLES, TIME, EffectivePotential
from varcalc.mechanics.reduced.rests import Rest
from varcalc.numerics.one_coordinate.motions import (
    CoordinateMotion,
    MotionBounds,
    NoTurn,
    OneTurn,
    TwoTurns,
    both_bounds,
    ways,
)
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import AGREED, integrals, reached
from varcalc.numerics.runs import runs
from varcalc.problem.conditions import reals, told
from varcalc.showing import Shown

CONVERGED = 1e-9
"""Of an integral towards an end: what the last part of the way there may add."""
PARTS = ((0.0, 0.5), (0.5, 0.75), (0.75, 1.0))
"""Of the way to an end."""
SHRINKING = 0.5
"""Of the part before: what the last part at least adds to an integral that diverges."""


class End(Enum):
    """How a motion ends on one side; the value says it in words."""

    TURNING = "turns back"
    FAR = "goes on without end"
    BEYOND = "goes on beyond what was looked at"
    SINGULAR = "comes to where L is singular"
    RESTING = "comes to rest, after infinite time"
    ROUND = "goes round"


FEWER = 0.05
"""Of what round-off makes of the rate of a motion that all but rests: what panels of many points must agree to."""
LEVEL = 1e-13
"""Of the energy: what is round-off of it next to a separatrix."""
OPEN = {End.FAR, End.BEYOND, End.SINGULAR, End.ROUND}
"""Ends at the limits of where the coordinate is defined, or of a turn."""


@dataclass(frozen=True, repr=False)
class ReducedOrbit(Shown):
    """A motion of the ``energy`` between ``low`` and ``high``, with what becomes of it at its ``ends``.

    ``rest`` is the place at which it comes to rest, where it does: a separatrix.
    """

    energy: float
    low: float
    high: float
    ends: tuple[End, End]
    rest: Rest | None
    _names: tuple[str, ...]
    _potential: EffectivePotential
    _way: CoordinateMotion
    _range: tuple[float, float]
    _agreed: float
    """To what share integrals are told: fewer digits next to the energy of a separatrix."""

    @property
    def bounded(self) -> bool:
        """Whether the motion is repeated for ever: between turning points, or round and round."""
        return self.ends in ((End.TURNING, End.TURNING), (End.ROUND, End.ROUND))

    @cached_property
    def _whole(self) -> np.ndarray:
        """All integrals over a period, or over the whole motion, with infinities where they diverge."""
        return self._over(self._way)

    def _over(self, way: CoordinateMotion) -> np.ndarray:
        first, last = self._range
        twice = 2.0 if isinstance(way, OneTurn | TwoTurns) else 1.0
        if self.bounded:
            return twice * self._between(way, first, last)
        middle = max(first, 0.0) if isinstance(way, OneTurn) else 0.0
        total = np.zeros(way.integrands(np.array([[middle]]))[1].shape[0])
        for end in (first, last):
            if end == middle:
                continue
            with np.errstate(invalid="ignore"):  # of what diverges both ways
                total += (1.0 if end > middle else -1.0) * self._towards(way, middle, end)
        return twice * total

    def _towards(self, way: CoordinateMotion, first: float, last: float) -> np.ndarray:
        """The integrals towards an end: infinite where they diverge, not numbers where that is not told."""
        stretch = last - first
        half, third, fourth = (self._between(way, first + a * stretch, first + b * stretch) for a, b in PARTS)
        whole = half + third + fourth
        # to a place of rest the last part is no number
        diverges = ~(np.abs(fourth) < SHRINKING * np.abs(third)) & ~(np.abs(fourth) <= CONVERGED * np.abs(whole))
        known = np.abs(fourth) <= CONVERGED * np.abs(whole)
        return np.where(diverges, np.copysign(np.inf, half), np.where(known, whole, np.nan))

    def _between(self, way: CoordinateMotion, first: float, last: float) -> np.ndarray:
        return integrals(way, np.array([first]), np.array([last]), agreed=self._agreed)[0]

    @property
    def period(self) -> float:
        """The time after which the coordinate is the same again; infinite where the motion is not repeated."""
        return float(self._whole[TIME]) if self.bounded else np.inf

    @property
    def duration(self) -> float:
        """The time of the whole motion: finite where it falls into a centre, or runs to infinity ever faster.

        Not a number where the motion goes on beyond what was looked at.
        """
        if End.BEYOND in self.ends:
            return np.nan
        return np.inf if self.bounded else float(self._whole[TIME])

    @property
    def angles(self) -> Mapping[str, float]:
        """By how much each ignorable coordinate advances in a period, or in the whole motion."""
        return dict(zip(self._names, self._whole[ANGLES : ANGLES + len(self._names)].tolist(), strict=True))

    @property
    def precession(self) -> Mapping[str, float]:
        """By how much the advance in a period differs from the next whole number of turns."""
        if not self.bounded:
            raise ValueError("an orbit that is not repeated does not precess")
        return {name: angle - 2 * np.pi * round(angle / (2 * np.pi)) for name, angle in self.angles.items()}

    def average(self, function: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> float:
        """The average over the time of ``function(q, q')``, which takes and gives arrays of one shape.

        Raises ValueError for a motion that is not repeated.
        """
        if not self.bounded:
            raise ValueError("a motion that is not repeated has no average: give one between two turning points")

        def both(q: np.ndarray, v: np.ndarray) -> np.ndarray:
            # of the way there and of the way back, which a quadrature of half a period does not see
            return (once(q, v) + once(q, -v)) / 2

        def once(q: np.ndarray, v: np.ndarray) -> np.ndarray:
            return sampled("function", function, q, v)

        round_ = self.ends[0] is End.ROUND
        way = replace(self._way, potential=self._potential.averaging(once if round_ else both))
        whole = self._over(way)
        return float(whole[ANGLES + len(self._names)] / whole[TIME])

    def time(self, q: Any) -> np.ndarray:
        """The time from the lower turning point, the only one or the middle of the motion to places ``q``.

        On the way upwards, of a motion that has an upper turning point only downwards; negative on the way before.
        Not a number where the motion does not come.
        """
        return self._at(q)[..., TIME]

    def angle(self, q: Any) -> Mapping[str, np.ndarray]:
        """The angles that each ignorable coordinate goes through meanwhile."""
        found = self._at(q)
        return {name: found[..., ANGLES + k] for k, name in enumerate(self._names)}

    def _at(self, q: Any) -> np.ndarray:
        places = reals("q", q)
        u = np.atleast_1d(self._potential.chart.coordinate(places.ravel()))
        with np.errstate(all="ignore"):
            last = self._way.height(u)[0]
            out = np.full((len(u), self._whole.size), np.nan)
            inside = np.isfinite(last) & (last >= self._range[0]) & (last <= self._range[1])
            if np.any(inside):
                way = self._way.take(np.zeros(np.count_nonzero(inside), dtype=int))
                out[inside] = integrals(way, np.zeros(len(last[inside])), last[inside], agreed=self._agreed)
        return out.reshape(*places.shape, self._whole.size)

    def place(self, t: Any) -> tuple[np.ndarray, Mapping[str, np.ndarray]]:
        """The coordinate, and the angles gone through, at times ``t`` after the start that :meth:`time` tells of.

        Not numbers where the motion has ended by then. Raises ValueError for times that are negative.
        """
        times = reals("t", t)
        if not np.all(times >= 0):
            raise ValueError(f"t must not be negative: it is counted from where the motion begins anew, not {told(t)}")
        flat = times.ravel()
        way = replace(self._way, start=np.zeros(1)).take(np.zeros(len(flat), dtype=int))
        columns = self._whole.size - 1
        targets = np.full((len(flat), columns), np.inf)
        targets[:, TIME] = flat
        last = np.inf if self.bounded else self._range[1]
        found = reached(way, np.full(len(flat), last), targets)
        u = way.at(found.q[:, None]).u[:, 0]
        good = found.resolved & ~found.ended
        q = np.where(good, self._potential.place(u), np.nan).reshape(times.shape)[()]
        angles = [np.where(good, found.integrals[:, ANGLES + k], np.nan) for k in range(len(self._names))]
        return q, {name: a.reshape(times.shape)[()] for name, a in zip(self._names, angles, strict=True)}


@dataclass(frozen=True)
class Regions:
    """The motions of an energy in one chart."""

    potential: EffectivePotential
    nodes: PotentialNodes
    rests: tuple[Rest, ...]
    names: tuple[str, ...]

    def orbits(self, energy: float) -> list[ReducedOrbit]:
        """The motions, in ascending order."""
        g, C = self.nodes.g, -2 * energy
        saddles = [rest for rest in self.rests if not rest.stable and _same(rest.energy, energy)]
        allowed = g > C
        at = {k: rest for rest in saddles for k in self._numbers(rest)}
        at_rest = [k for rest in self.rests if rest.stable and _same(rest.energy, energy) for k in self._numbers(rest)]
        allowed[[*at, *at_rest]] = False
        out = []
        for first, last in runs(allowed):
            resting = at.get(first - 1), at.get(last + 1)
            inside = first + int(np.argmax(g[first : last + 1]))
            if (first == 0) != (last + 1 == len(g)):  # next to where it turns, which is then known best
                inside = first if first > 0 else last
            orbit = self._orbit(energy, inside, resting)
            if orbit is not None:
                out.append(orbit)
        return out

    def _numbers(self, rest: Rest) -> list[int]:
        """The nodes at a rest, with those that are as high for all that is told: at both ends of a turn, too."""
        chart, g = self.potential.chart, self.nodes.g
        first = int(np.argmin(np.abs(self.potential.place(self.nodes.u) - rest.place)))
        last = [len(g) - 1] if chart.turning and rest.place == chart.low else []
        higher = np.flatnonzero(np.abs(g - g[first]) > LEVEL * np.abs(g[first]))
        found: list[int] = []
        for k in (first, *last):
            stop = int(np.searchsorted(higher, k))
            begin, end = (higher[stop - 1] + 1 if stop else 0), (higher[stop] if stop < len(higher) else len(g))
            found += range(int(begin), int(end))
        return found

    def _orbit(self, energy: float, inside: int, resting: tuple[Rest | None, Rest | None]) -> ReducedOrbit | None:
        u0, C = self.nodes.u[inside : inside + 1], np.array([-2 * energy])
        squared = self.nodes.g[inside : inside + 1] - C
        free = np.full(1, np.inf)
        below, above = both_bounds(self.potential, self.nodes, u0, squared, C, (free, free))
        below, above = (
            _open(b, r, self._room(u0, s, r)) for b, r, s in zip((below, above), resting, (-1, 1), strict=True)
        )
        found = ways(self.potential, u0, np.sqrt(squared), below, above)
        if not found:
            return None
        _, way, _ = found[0]
        ends = self._end(below, resting[0], -1), self._end(above, resting[1], 1)
        lower, upper = (float(self.potential.place(u0 + b.x)[0]) for b in (below, above))
        chart = self.potential.chart
        lower = chart.low if ends[0] in OPEN else lower
        upper = chart.high if ends[1] in OPEN else upper
        rest = next((one for one in resting if one is not None), None)
        way = replace(way, C=C) if isinstance(way, OneTurn | NoTurn) else way
        span, agreed = _span(way, below, above), self._agreed(energy)
        return ReducedOrbit(energy, lower, upper, ends, rest, self.names, self.potential, way, span, agreed)

    def _agreed(self, energy: float) -> float:
        """To what share integrals are told: the rate of a motion that all but rests is little but round-off."""
        saddles = [one.energy for one in self.rests if not one.stable and one.energy != energy]
        room = [FEWER * float(np.finfo(float).eps) * max(abs(energy), abs(e)) / abs(energy - e) for e in saddles]
        return max([AGREED, *room])

    def _room(self, u0: np.ndarray, sign: int, rest: Rest | None) -> float:
        """How far it is in u to a ``rest``; the one at which a turn begins is also where it ends."""
        if rest is None:
            return 0.0
        chart = self.potential.chart
        place = chart.high if chart.turning and sign > 0 and rest.place == chart.low else rest.place
        return float(place - u0[0]) if chart.turning else float(chart.coordinate(np.array(place)) - u0[0])

    def _end(self, bound: MotionBounds, rest: Rest | None, sign: int) -> End:
        if rest is not None:
            return End.RESTING
        if bound.turning[0]:
            return End.TURNING
        chart = self.potential.chart
        if chart.turning:
            return End.ROUND
        if chart.oscillating:
            return End.BEYOND
        return End.FAR if np.isinf(chart.low if sign < 0 else chart.high) else End.SINGULAR


def _open(bound: MotionBounds, rest: Rest | None, room: float) -> MotionBounds:
    return bound if rest is None else MotionBounds(np.array([room]), np.array([False]))


def _span(way: CoordinateMotion, below: MotionBounds, above: MotionBounds) -> tuple[float, float]:
    """The parameters between which a motion goes."""
    if isinstance(way, TwoTurns):
        return 0.0, float(way.period / 2)
    if isinstance(way, OneTurn):
        other = above if below.turning[0] else below
        return 0.0, float(way.reaching(other.x)[0])
    return float(below.x[0]), float(above.x[0])


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= 64 * float(np.finfo(float).eps) * max(abs(a), abs(b))
