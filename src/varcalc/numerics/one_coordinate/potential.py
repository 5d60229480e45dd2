"""What a motion in one coordinate needs to know of g, where (du/dτ)² = g(u) - C."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from varcalc.numerics.roots import EPSILON, bracketed_newton, edges

if TYPE_CHECKING:
    from varcalc.numerics.one_coordinate.motions import MotionPoint

FAR = 1e6
"""Motions that have come so many times farther than the problem is large are not followed."""
PLACES = 240
"""Places on either side at which g is looked at to begin with, in geometric progression."""
BENT = 1e-2
"""Of its change over an interval: how well a cubic must foretell g in the middle."""
ROUNDS = 14
"""Times an interval is halved to meet BENT."""
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

    @property
    def separatrices(self) -> np.ndarray:
        """The values of g at its minima between the ends: with such a C motions take for ever to come to rest."""
        g = self.g
        return g[1:-1][(g[1:-1] <= g[:-2]) & (g[1:-1] <= g[2:])]


class Potential(ABC):
    """A function g of one coordinate u, with its differences to round-off.

    A new one says what g is and how it changes; where a coordinate has a scale of its own it says that too.
    """

    @abstractmethod
    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The values of g and dg/du at ``u``, in the shape of ``u``; not numbers where there is no g."""

    @abstractmethod
    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changes of g and dg/du from ``base`` to base + x, exact to round-off however small ``x`` is."""

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:  # noqa: ARG002  time alone, to begin with
        """What is integrated over τ beside 1, at points of a motion: the action's integrand, other times, angles."""
        return ()

    def sound(self, u: np.ndarray) -> np.ndarray:
        """True where motions may come: g and its slope are numbers."""
        g, slope = self.at(u)
        return np.isfinite(g) & np.isfinite(slope)

    @property
    def reach(self) -> np.ndarray | None:
        """Distances, ascending, at which g is looked at beyond the places asked for; None for multiples of a size."""
        return None

    def __call__(self, base: np.ndarray, x: np.ndarray) -> PotentialValues:
        """The values at base + x, arrays of one shape."""
        (g, slope), (old, steep) = self.at(base + x), self.at(base)
        gain, bend = self.changes(base, x)
        return PotentialValues(g, slope, _better(g, old, gain), _better(slope, steep, bend))

    def zero(
        self, base: np.ndarray, squared: np.ndarray, C: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> np.ndarray:
        """x (m,) between ``low`` and ``high`` with g(base + x) = C, which holds once there.

        ``squared`` is g(base) - C. g - C is positive at ``low``, and it is no matter which of the two is the larger.
        """

        def above(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            at = self(base, x)
            return at.above(C, squared), at.slope

        with np.errstate(all="ignore"):
            start, flat = (low + high) / 2, 2 * EPSILON * np.minimum(squared, C)
            return bracketed_newton(above, low, high, start, relative=4 * EPSILON, flat=flat)[0]

    def nodes(self, first: float, last: float, low: float, high: float) -> PotentialNodes:
        """The nodes of g about the places from ``first`` to ``last``, no farther than ``low`` and ``high``."""
        with np.errstate(all="ignore"):
            return self._nodes(first, last, low, high)

    def _nodes(self, first: float, last: float, low: float, high: float) -> PotentialNodes:
        size = max(abs(first), abs(last), last - first) or 1.0
        reach = self.reach if self.reach is not None else size * np.geomspace(1e-8, FAR, PLACES)
        inner = np.linspace(first, last, PLACES) if last > first else np.array([first])
        u = np.concatenate([[low], first - reach[::-1], inner, last + reach, [high]])
        u = np.unique(u[(u >= low) & (u <= high) & np.isfinite(u)])
        u, low_edge, high_edge = self._inside(u, first, last)
        for _ in range(ROUNDS):
            middle = self._coarse(u)
            if len(middle) == 0:
                break
            u = np.unique(np.concatenate([u, middle]))
        u = np.unique(np.concatenate([u, self._turns(u)]))
        return PotentialNodes(u, self.at(u)[0], low_edge, high_edge)

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

    def _turns(self, u: np.ndarray) -> np.ndarray:
        """Where the slope of g changes its sign, bisected."""
        _, slope = self.at(u)
        turn = np.flatnonzero(np.sign(slope[1:]) * np.sign(slope[:-1]) < 0)
        if len(turn) == 0:
            return turn
        sign = np.sign(slope[turn])[:, None]
        return np.concatenate(edges(lambda at: self.at(at)[1] * sign > 0, u[turn], u[turn + 1]))


def _better(new: np.ndarray, old: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The difference where the values differ much, which loses nothing; elsewhere the ``change`` as it was carried."""
    return np.where(np.abs(new - old) > DIFFERENT * np.maximum(np.abs(new), np.abs(old)), new - old, change)
