"""Curves between two points that share a shape: monotone, or with one turning point.

A family turns one shape parameter for each curve into a batch of legs; the
first integral then gives the abscissa each curve covers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from varcalc.methods.first_integral.energy import EnergyLines
from varcalc.methods.first_integral.lines import Arc, CurveBatch
from varcalc.numerics.one_coordinate.panels import GRADED, TOWARD, WHOLE, Panels
from varcalc.numerics.roots import edges, least
from varcalc.numerics.runs import runs

DECADES = 7
"""Turning points are looked for from 1e-7 to 1e7 times the problem's size beyond the outer end."""
FIRST_BARRIER = 100.0
"""Beyond the first barrier turning points are looked for up to so many times the problem's size."""
ROUNDING = 1e-14
SLOPE_GRID = np.array(
    [-34, -25, -18, -13, -10, -8, -6, -5, -4, -3, -2, -1.5, -1, -0.5, 0, 0.5, 1, 2, 3, 4, 6, 9, 14, 20.0]
)
"""Logarithms of the least slope, in units of the mean one, at which monotone curves are tried."""
SLOWER = np.array([-600, -400, -270, -180, -120, -80, -50.0])
"""The same for curves that stay by an equilibrium: how long grows as the logarithm does."""


@dataclass(frozen=True)
class EndOrdinates:
    """The two ends: ordinates (None where free), the abscissa between them, and where L is infinite."""

    y0: float | None
    y1: float | None
    width: float
    singular: tuple[float, ...] = ()

    @property
    def known(self) -> tuple[float, ...]:
        """The ordinates that are given."""
        return tuple(y for y in (self.y0, self.y1) if y is not None)

    @property
    def size(self) -> float:
        """A length typical of the ordinates."""
        known = self.known
        return abs(known[-1] - known[0]) or max(abs(known[0]), self.width)


@dataclass(frozen=True)
class Orbits:
    """Curves of one shape: with a greatest (side 1) or least (-1) ordinate, or monotone (0).

    A curve with a free end stops at its turning point, where the natural
    condition L_y' = 0 holds. The parameter is the ordinate of the turning point, or the logarithm of the
    slope at ``reference``, where a monotone curve is least steep. ``panels``
    are the rules of the legs, the simplest ones when empty; ``coarse`` is for a first look.
    """

    lines: EnergyLines
    points: EndOrdinates
    side: int
    reference: float = 0.0
    panels: tuple[Panels, ...] = ()
    coarse: bool = False

    @property
    def unit(self) -> float:
        """The size of a change of the parameter that matters."""
        return self.points.size if self.side else 1.0

    def ruled(self, panels: tuple[Panels, ...]) -> Orbits:
        """The same family with the given rules."""
        return replace(self, panels=panels)

    def looked_at(self) -> Orbits:
        """The same family with coarse rules."""
        return replace(self, coarse=True)

    def batch(self, parameter: np.ndarray, multipliers: np.ndarray) -> CurveBatch:
        """The curves for parameters (curves,) and multipliers (constraints, curves)."""
        legs, constant, excess = (self._turning if self.side else self._monotone)(parameter, multipliers)
        return CurveBatch(tuple(legs), constant, excess, multipliers).by_rules(self.panels, coarse=self.coarse)

    def _monotone(self, parameter: np.ndarray, multipliers: np.ndarray) -> tuple[list[Arc], np.ndarray, np.ndarray]:
        first, last = self.points.known
        sign = 1.0 if last > first else -1.0
        at = np.full(parameter.shape, self.reference)
        excess, constant = self.lines.at_slope(at, parameter, sign, multipliers)
        # each stretch is halved, and each half measured from the end it touches
        stops = [first, last] if self.reference in (first, last) else [first, self.reference, last]
        legs: list[Arc] = []
        for a, b in pairwise(stops):
            for anchor, other, away in ((a, b, True), (b, a, False)):
                length = np.full(parameter.shape, 0.5 * (other - anchor))
                legs.append(self._leg(anchor, length, sign, away, at))
        return legs, constant, excess

    def _turning(self, parameter: np.ndarray, multipliers: np.ndarray) -> tuple[list[Arc], np.ndarray, np.ndarray]:
        legs: list[Arc] = []
        for anchor, away in ((self.points.y0, True), (self.points.y1, False)):
            if anchor is None:
                continue
            direction = float(self.side if away else -self.side)
            half = 0.5 * (parameter - anchor)
            outer = self._leg(anchor, half, direction, away, parameter)
            inner = Arc(parameter, -half, direction, not away, parameter, WHOLE)
            legs += [outer, inner] if away else [inner, outer]
        return legs, self.lines.rest(parameter, multipliers) * np.ones_like(parameter), np.zeros_like(parameter)

    def _leg(self, anchor: float, length: np.ndarray, direction: float, away: bool, reference: np.ndarray) -> Arc:
        full = np.full(length.shape, anchor)
        if anchor in self.points.singular:
            return Arc(full, length, direction, away, None, TOWARD, anchor)
        return Arc(full, length, direction, away, reference, WHOLE)


def families(energy: EnergyLines, points: EndOrdinates, multipliers: np.ndarray) -> list[tuple[Orbits, np.ndarray]]:
    """The families that may join two points, each with a sample of its parameter, once for each interval of it."""
    found: list[tuple[Orbits, np.ndarray]] = []
    if points.y0 is not None and points.y1 is not None and points.y0 != points.y1:
        reference = _least_between(energy, points, multipliers)
        if reference is not None:
            found.append((Orbits(energy, points, 0, reference), SLOPE_GRID))
    for side in (1, -1):
        samples = turning_ordinates(energy, points, side, multipliers)
        found += [(Orbits(energy, points, side), sample) for sample in samples]
    return found


def lingering(family: Orbits, sample: np.ndarray) -> tuple[Orbits, np.ndarray]:
    """The same family with rules that hold curves which stay by an equilibrium at or beside an end of a leg."""
    sample = sample if family.side else np.concatenate([SLOWER, sample])
    legs = family.batch(sample[:1], np.zeros((0, 1))).legs
    return family.ruled((GRADED,) * len(legs)), sample


def _least_between(energy: EnergyLines, points: EndOrdinates, multipliers: np.ndarray) -> float | None:
    """Where between the ends P(y, 0) is least: there the slope is least on every monotone curve."""
    low, high = sorted(points.known)
    at = low + (high - low) * (0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 65)))
    at[-1] = high
    values = energy.rest_where_convex(at, multipliers)
    if np.isnan(values[1:-1]).any():
        return None
    values = np.where(np.isin(at, points.singular), np.inf, np.nan_to_num(values, nan=np.inf))
    k = int(np.argmin(values))
    for end in (0, 64):
        if values[end] <= values[k]:
            return float(at[end])
    return least(lambda y: energy.rest(y, multipliers), float(at[k - 1]), float(at[k + 1]))


def turning_ordinates(
    energy: EnergyLines, points: EndOrdinates, side: int, multipliers: np.ndarray
) -> list[np.ndarray]:
    """Where a curve can turn: for each interval of such ordinates, a sample clustered at its edges.

    P(y_t, 0) must lie below P(y, 0) everywhere on the curve.
    """
    outer = max(side * y for y in points.known) * side
    inner = min(side * y for y in points.known) * side

    def rest(away: np.ndarray) -> np.ndarray:
        return energy.rest_where_convex(outer + side * away, multipliers)

    between = energy.rest_where_convex(inner + (outer - inner) * np.linspace(0, 1, 65), multipliers)
    if outer != inner and np.isnan(between[1:-1]).any():
        return []
    floor = float(np.fmin.reduce(np.append(between, np.inf)))
    grid = points.size * np.logspace(-DECADES, DECADES, 36 * DECADES)
    values = rest(grid)
    ended = np.flatnonzero(np.isnan(values))
    grid, values = (grid, values) if len(ended) == 0 else (grid[: ended[0] + 1], values[: ended[0] + 1])
    lowest = np.fmin.accumulate(np.concatenate([[floor], values]))[:-1]
    # a later well counts only where it is deeper by more than rounding
    possible = values < lowest - ROUNDING * np.where(np.isfinite(lowest), np.abs(lowest), 0.0)
    barriers = np.flatnonzero(~possible[1:] & possible[:-1])
    if len(barriers):
        possible &= (np.arange(len(grid)) <= barriers[0]) | (grid < FIRST_BARRIER * points.size)
    samples = []
    for a, b in runs(possible):
        lowest_before = float(lowest[a])
        low = 0.0 if a == 0 else _edge(lambda d, m=lowest_before: rest(d) < m, grid[a], grid[a - 1])
        high = float(grid[b])
        if b + 1 < len(grid):
            end = _edge(lambda d: np.isfinite(rest(d)), high, grid[b + 1])
            high = least(rest, float(grid[max(b - 1, 0)]), end)
        samples.append(outer + side * _clustered(low, high, open_end=b + 1 == len(grid)))
    return samples


def _edge(holds: Callable[[np.ndarray], np.ndarray], inside: float, outside: float) -> float:
    """The last place, going outside from where a condition holds, at which it still does."""
    return float(edges(lambda at: holds(at.ravel()).reshape(at.shape), np.array([inside]), np.array([outside]))[0][0])


def _clustered(low: float, high: float, *, open_end: bool) -> np.ndarray:
    """Distances from low to high, geometric from either edge."""
    width = high - low
    if open_end:
        return low + np.concatenate([[0.0], np.logspace(np.log10(width) - 2 * DECADES, np.log10(width), 6 * DECADES)])
    near = np.logspace(-DECADES - 4, np.log10(0.5), 24)
    return np.concatenate([[low], low + width * near, high - width * near[-2::-1]])
