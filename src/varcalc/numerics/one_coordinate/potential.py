"""What a motion in one coordinate needs to know of g, where (du/dτ)² = g(u) - C."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from varcalc.numerics.roots import EPSILON, bracketed_newton, edges

if TYPE_CHECKING:
    from varcalc.numerics.one_coordinate.motions import MotionPoint

NOT_FOLLOWED = 1e6
"""Motions that have come so many times farther than the problem is large are not followed."""
BEYOND_SIZE = 1e4
"""The same of where a motion may come to."""
PLACES = 240
"""Places on either side at which g is looked at to begin with, in geometric progression."""
BENT = 1e-2
"""Of its change over an interval: how well a cubic must foretell g in the middle."""
BENT_HALVINGS = 14
"""Times an interval is halved to meet BENT."""
SPARSE = 4
"""Of the places beyond an interval that are closer to it than those in it are to each other, one in so many will do."""
MANY = 2000
"""Nodes; with more it is asked whether motions come so far."""
_NONE = np.zeros(0)
DIFFERENT = 0.1
"""Of the larger of two values: their difference is then exact to round-off."""


@dataclass(frozen=True)
class PotentialValues:
    """At places base + x: ``g`` and ``slope`` = dg/du there, their changes ``gain`` and ``bend`` since the base.

    The changes are exact to round-off, however small x is.
    """

    g: np.ndarray
    slope: np.ndarray
    gain: np.ndarray
    bend: np.ndarray

    def above(self, C: np.ndarray, squared: np.ndarray) -> np.ndarray:
        """g - C, where ``squared`` is g - C at the bases: of the two ways to find it the one that loses less."""
        return np.where(squared < np.maximum(self.g, C), squared + self.gain, self.g - C)


@dataclass(frozen=True)
class PotentialNodes:
    """Places ``u`` (k,) in ascending order between which ``g`` (k,) is monotone.

    The edges say whether there is no g beyond the ends.
    """

    u: np.ndarray
    g: np.ndarray
    low_edge: bool
    high_edge: bool

    @cached_property
    def upwards(self) -> NodesOutwards:
        """The nodes in ascending order."""
        return NodesOutwards(self.u, self.g)

    @cached_property
    def downwards(self) -> NodesOutwards:
        """The nodes of -u, in ascending order."""
        return NodesOutwards(-self.u[::-1], self.g[::-1])

    @property
    def separatrices(self) -> np.ndarray:
        """The values of g at its minima between the ends: with such a C motions take for ever to come to rest."""
        g = self.g
        return g[1:-1][(g[1:-1] <= g[:-2]) & (g[1:-1] <= g[2:])]


@dataclass(frozen=True)
class NodesOutwards:
    """The nodes ``u`` (k,) as a motion comes to them, and ``g`` (k,) there."""

    u: np.ndarray
    g: np.ndarray

    @cached_property
    def turns(self) -> np.ndarray:
        """The numbers, ascending, of the nodes at which g turns from falling to rising or back; and of the last."""
        way = np.sign(np.diff(self.g))
        steep = np.flatnonzero(way)
        turn = steep[1:][way[steep[1:]] != way[steep[:-1]]]
        return np.unique(np.append(turn, len(self.u) - 1))

    @cached_property
    def _least(self) -> list[np.ndarray]:
        """The least g of 1, 2, 4, ... nodes from each on, infinite beyond the last."""
        levels = [self.g]
        while 2 ** len(levels) <= len(self.g):
            half, last = 2 ** (len(levels) - 1), levels[-1]
            levels.append(np.minimum(last, np.append(last[half:], np.full(half, np.inf))))
        return levels

    def first_below(self, number: np.ndarray, bar: np.ndarray) -> np.ndarray:
        """The first node (m,) from ``number`` (m,) on with a g of no more than ``bar`` (m,); k where there is none."""
        at = number.copy()
        for level in reversed(range(len(self._least))):
            inside = np.minimum(at, len(self.g) - 1)
            skips = (at + 2**level <= len(self.g)) & (self._least[level][inside] > bar)
            at[skips] += 2**level
        return at


class Potential(ABC):
    """A function g of one coordinate u, with its differences to round-off.

    A new one says what g is and how it changes; where a coordinate has a scale of its own it says that too.
    """

    @abstractmethod
    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The values of g and dg/du at ``u``, in the shape of ``u``; not numbers where there is no g."""

    @abstractmethod
    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changes of g and dg/du from ``base`` to base + x, exact to round-off however small ``x`` is.

        They are in the shape of ``x``, to which ``base`` broadcasts.
        """

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:  # noqa: ARG002  time alone, to begin with
        """What is integrated over τ beside 1, at points of a motion: the action's integrand, other times, angles."""
        return ()

    def sound(self, u: np.ndarray) -> np.ndarray:
        """True where motions may come: g and its slope are numbers."""
        g, slope = self.at(u)
        return np.isfinite(g) & np.isfinite(slope)

    @property
    def stops(self) -> np.ndarray:
        """Places (k,), ascending, at which g is less smooth than elsewhere: no panel of an integral goes over one."""
        return _NONE

    @property
    def jumps(self) -> np.ndarray:
        """Where g jumps: the last place before each and the first beyond (k, 2), ascending; the former are stops."""
        return _NONE.reshape(0, 2)

    @property
    def gentle(self) -> np.ndarray:
        """Places (k,), ascending, between which g varies gently.

        Two samples of g with several of them in between may miss what is narrower.
        """
        return _NONE

    @property
    def reach(self) -> np.ndarray | None:
        """Distances, ascending, at which g is looked at beyond the places asked for; None for multiples of a size."""
        return None

    def __call__(self, base: np.ndarray, x: np.ndarray) -> PotentialValues:
        """The values at base + x, arrays that broadcast to the shape of ``x``."""
        return self.moved(base, x, self.at(base))

    def moved(self, base: np.ndarray, x: np.ndarray, start: tuple[np.ndarray, np.ndarray]) -> PotentialValues:
        """The same where g and its slope at the base, ``start``, are known."""
        g, slope = self.at(base + x)
        gain, bend = self.changes(base, x)
        return PotentialValues(g, slope, _better(g, start[0], gain), _better(slope, start[1], bend))

    def zero(
        self, base: np.ndarray, squared: np.ndarray, C: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> np.ndarray:
        """x (m,) between ``low`` and ``high`` with g(base + x) = C, which holds once there, or from there on.

        ``squared`` is g(base) - C. g - C is positive at ``low``, and it is no matter which of the two is the larger.
        """

        def above(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """g - C at x (m,), and its slope; negative where g stays at C."""
            at = self(base, x)
            left = at.above(C, squared)
            return np.where((left == 0) & (at.slope == 0), -squared, left), at.slope  # g may stay there from the first

        with np.errstate(all="ignore"):
            start, flat = (low + high) / 2, 2 * EPSILON * np.minimum(squared, C)
            return bracketed_newton(above, low, high, start, relative=4 * EPSILON, flat=flat)[0]

    def distances(self, first: np.ndarray, last: np.ndarray, size: np.ndarray | float = 0.0) -> np.ndarray:
        """How far beyond places from ``first`` to ``last`` (p,) g is looked at: ascending, (p, k).

        A motion that may come as far as ``size`` (p,) does so wherever its coordinate is called nothing.
        """
        if self.reach is not None:
            return np.tile(self.reach, (len(first), 1))
        own, size = np.max([np.abs(first), np.abs(last), last - first], axis=0), np.where(np.isfinite(size), size, 0.0)
        own = np.where(own > 0, own, np.where(size > 0, size, 1.0))
        return np.geomspace(1e-8 * own, np.fmax(NOT_FOLLOWED * own, BEYOND_SIZE * size), PLACES, axis=1)

    def nodes(
        self, first: np.ndarray | float, last: np.ndarray | float, low: np.ndarray | float, high: np.ndarray | float,
        size: np.ndarray | float = 0.0,
    ) -> PotentialNodes:  # fmt: skip
        """The nodes of g about places from ``first`` to ``last``, no farther than ``low`` and ``high``.

        Of p intervals each brings its own nodes; for ``size`` see :meth:`distances`.
        """
        with np.errstate(all="ignore"):
            return self._nodes(*(np.atleast_1d(np.asarray(end, dtype=float)) for end in (first, last, low, high, size)))

    def _nodes(
        self, first: np.ndarray, last: np.ndarray, low: np.ndarray, high: np.ndarray, size: np.ndarray
    ) -> PotentialNodes:
        u = self._places(first, last, low, high, size)
        stops = np.append(self.stops, self.jumps)
        u = np.union1d(u, stops[(stops >= low.min()) & (stops <= high.max())])
        u, low_edge, high_edge = self._inside(u, first.min(), last.max())
        u = np.union1d(u, self.gentle[(self.gentle > u[0]) & (self.gentle < u[-1])])
        for _ in range(BENT_HALVINGS):
            middle = self._coarse(u)
            if len(middle) == 0:
                break
            u = np.unique(np.concatenate([u, middle]))
            if len(u) > MANY:
                u = self.enclosed(u, first.min(), last.max())
        u = np.unique(np.concatenate([u, self._flattest(u)]))
        u = np.unique(np.concatenate([u, self._turns(u)]))
        return PotentialNodes(u, self.at(u)[0], low_edge, high_edge)

    def _places(
        self, first: np.ndarray, last: np.ndarray, low: np.ndarray, high: np.ndarray, size: np.ndarray
    ) -> np.ndarray:
        """Places, ascending, at which g is looked at to begin with: those of intervals alike are the same.

        They lie on lattices whose steps are powers of two, no wider than a share of an interval or of how far beyond it
        they are.
        """
        step = _power_of_two((last - first) / (PLACES - 1))
        inner = _lattices(first, last, step)
        reach = self.distances(first, last, size)
        wide = _power_of_two(np.diff(reach, axis=1, append=2 * reach[:, -1:]))
        beyond = (reach >= step[:, None]) | (np.arange(reach.shape[1]) % SPARSE == 0)
        sides = np.concatenate(
            [np.round((first - reach.T) / wide.T) * wide.T, np.round((last + reach.T) / wide.T) * wide.T]
        )
        kept = np.concatenate([beyond.T, beyond.T]) & (sides >= low) & (sides <= high) & np.isfinite(sides)
        ends = np.concatenate([first, last, low, high])
        return np.unique(np.concatenate([ends[np.isfinite(ends)], inner, sides[kept]]))

    def enclosed(self, u: np.ndarray, first: float, last: float) -> np.ndarray:  # noqa: ARG002  all, to begin with
        """Those of the places ``u`` (k,), ascending, to which motions between ``first`` and ``last`` may come."""
        return u

    def _inside(self, u: np.ndarray, first: float, last: float) -> tuple[np.ndarray, bool, bool]:
        """The places among ``u`` with a g all the way to them, and whether it ends below and above."""
        sound = self.sound(u)
        below, above = np.flatnonzero(~sound & (u < first)), np.flatnonzero(~sound & (u > last))
        start, stop = (below[-1] + 1 if len(below) else 0), (above[0] if len(above) else len(u))
        ends = []
        if len(below):
            ends.append(self._edge(u[start], u[start - 1]))
        if len(above):
            ends.append(self._edge(u[stop - 1], u[stop]))
        return np.unique(np.concatenate([u[start:stop], ends])), len(below) > 0, len(above) > 0

    def _edge(self, good: float, bad: float) -> float:
        """The last place from ``good`` towards ``bad`` where there is a g."""
        return float(edges(self.sound, np.array([good]), np.array([bad]))[0][0])

    def _coarse(self, u: np.ndarray) -> np.ndarray:
        """The middles of the intervals over which the cubic through g and its slope at the ends is no good."""
        g, slope = self.at(u)
        width = np.diff(u)
        middle = (u[1:] + u[:-1]) / 2
        there, rate = self.at(middle)
        foretold = (g[1:] + g[:-1]) / 2 - width * np.diff(slope) / 8
        usual = np.abs(np.diff(g)) + width * (np.abs(slope[1:]) + np.abs(slope[:-1]) + np.abs(rate))
        bad = np.abs(there - foretold) > BENT * usual + 1e-15 * np.abs(there)
        return middle[bad & (middle > u[:-1]) & (middle < u[1:])]

    def _flattest(self, u: np.ndarray) -> np.ndarray:
        """Where between places the slope of g may come to zero and back: it has one sign at both, and turns twice.

        The cubic through g and its slope tells, which is good by then.
        """
        g, slope = self.at(u)
        width, first, last = np.diff(u), slope[:-1], slope[1:]
        mean = np.diff(g) / width
        bend, curve = 6 * mean - 4 * first - 2 * last, 3 * (first + last - 2 * mean)
        share = -bend / (2 * curve)
        least = (first + share * bend / 2) * np.sign(first)
        size = np.max(np.abs([first, last, mean]), axis=0)
        inside = (share > 0) & (share < 1) & (first * last > 0) & (least < BENT * size)
        return (u[:-1] + share * width)[inside]

    def _turns(self, u: np.ndarray) -> np.ndarray:
        """Where the slope of g changes its sign, bisected."""
        _, slope = self.at(u)
        return self.turning(slope, u, np.flatnonzero(np.sign(slope[1:]) * np.sign(slope[:-1]) < 0))

    def turning(self, slope: np.ndarray, u: np.ndarray, number: np.ndarray) -> np.ndarray:
        """The places on both sides of where the ``slope`` at ``u`` (k,) changes its sign after some ``number`` (t,)."""
        if len(number) == 0:
            return np.zeros(0)
        sign = np.sign(slope[number])[:, None]
        return np.concatenate(edges(lambda at: self.at(at)[1] * sign > 0, u[number], u[number + 1]))


def _lattices(first: np.ndarray, last: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The multiples of each ``step`` (p,) between ``first`` and ``last`` (p,), once where intervals overlap."""
    parts = []
    for own in np.unique(step[step > 0]):
        rows = np.flatnonzero(step == own)
        rows = rows[np.argsort(first[rows])]
        low, high = np.floor(first[rows] / own) + 1, np.ceil(last[rows] / own)
        begun = np.flatnonzero(np.append(True, low[1:] > np.maximum.accumulate(high)[:-1]))
        ends = zip(low[begun], np.maximum.reduceat(high, begun), strict=True)
        parts.append(own * np.concatenate([np.arange(*pair) for pair in ends]))
    return np.concatenate(parts) if parts else np.zeros(0)


def _power_of_two(values: np.ndarray) -> np.ndarray:
    """The next lower powers of two."""
    return np.exp2(np.floor(np.log2(values)))


def _better(new: np.ndarray, old: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The difference where the values differ much, which loses nothing; elsewhere the ``change`` as it was carried.

    The change may be no number where the difference is one: what it is made of overflows farther away.
    """
    much = np.abs(new - old) > DIFFERENT * np.maximum(np.abs(new), np.abs(old))
    return np.where(much | ~np.isfinite(change), new - old, change)
