"""Rules for the legs of a curve: distance from an anchor as a function of t in [0, 1], and panels in t.

Near an end of a monotone branch the integrand behaves like a power of the
distance from it. SQUARE, distance = length * t^2, makes half-integer powers
analytic (turning points, the brachistochrone's start); EXPONENTIAL,
distance = length * exp(1 - exp(T (1 - t))), the double exponential map of
Takahasi and Mori (1974) for one end, does so for any power that leaves the
integral finite. Panels carry Gauss points; their Legendre coefficients tell
whether they resolve the integrand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

from varcalc.numerics.mesh import composite_gauss, gauss
from varcalc.numerics.roots import bracketed_newton

POINTS = 16
"""Gauss points a panel; with bisection the cheapest order for full double precision, within a factor of 1.3."""
EXPONENTIAL_REACH = 6.45
"""T of the exponential map: the distance falls to exp(1 - exp(T)) = 1e-274 of the length."""
QUADRATIC = 1e-8
"""A Newton step below this is the last: convergence is quadratic."""


class DistanceMap(Enum):
    """How the distance from the anchor depends on t."""

    SQUARE = "square"
    EXPONENTIAL = "exponential"


def distance(kind: DistanceMap, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distance from the anchor in units of the leg's length, and its derivative by t."""
    if kind is DistanceMap.SQUARE:
        return t * t, 2 * t
    grown = np.exp(EXPONENTIAL_REACH * (1 - t))
    share = np.exp(1 - grown)
    return share, share * grown * EXPONENTIAL_REACH


def inverse_distance(kind: DistanceMap, share: np.ndarray) -> np.ndarray:
    """The t at which the distance is ``share`` of the leg's length."""
    if kind is DistanceMap.SQUARE:
        return np.sqrt(share)
    with np.errstate(divide="ignore"):
        return np.clip(1 - np.log(1 - np.log(share)) / EXPONENTIAL_REACH, 0.0, 1.0)


@lru_cache(maxsize=8)
def transform(count: int) -> np.ndarray:
    """The matrix from values at ``count`` Gauss points to Legendre coefficients."""
    nodes, weights = gauss(count)
    degrees = np.arange(count)
    return (degrees[:, None] + 0.5) * (legendre.legvander(nodes, count - 1).T * weights)


@lru_cache(maxsize=8)
def _integrator(count: int) -> np.ndarray:
    """From values at Gauss points to Legendre coefficients of the integral from -1; shape (count + 1, count)."""
    return np.array([legendre.legint(column, lbnd=-1.0) for column in transform(count).T]).T


@dataclass(frozen=True)
class Panels:
    """The rule of one leg: its map, the edges of its panels, 0 = edges[0] < ... < edges[-1] = 1, and their points."""

    kind: DistanceMap
    edges: tuple[float, ...]
    points: int = POINTS

    @property
    def count(self) -> int:
        """Number of panels."""
        return len(self.edges) - 1

    @cached_property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Gauss points t and weights, each of shape (panels * points,)."""
        return composite_gauss(np.array(self.edges), self.points)

    @cached_property
    def distances(self) -> tuple[np.ndarray, np.ndarray]:
        """Distances of the nodes in units of the length, and quadrature weights for them."""
        t, weights = self.nodes
        share, speed = distance(self.kind, t)
        return share, speed * weights

    def split(self, marked: np.ndarray) -> Panels:
        """The rule with the panels ``marked`` (panels,) bisected."""
        edges = np.array(self.edges)
        middles = 0.5 * (edges[1:] + edges[:-1])
        return Panels(self.kind, tuple(np.sort(np.concatenate([edges, middles[marked]]))))


WHOLE = Panels(DistanceMap.SQUARE, (0.0, 1.0))
"""The simplest rule: one panel."""
TOWARD = Panels(DistanceMap.SQUARE, (0.0, 0.0625, 0.25, 1.0))
"""For an end where L is infinite: graded, so that the curve keeps its relative accuracy there."""
COARSE = Panels(DistanceMap.SQUARE, (0.0, 1.0), 7)
"""For a first look at many curves."""
GRADED = Panels(DistanceMap.EXPONENTIAL, tuple(np.linspace(0.0, 1.0, 9)))
"""For an end with a power that is no half-integer."""


def tails(weighted: np.ndarray) -> np.ndarray:
    """An estimate of each panel's quadrature error; ``weighted`` are values times weights, (panels * POINTS,).

    The last two Legendre coefficients of the integrand, times the panel's width.
    """
    values = weighted.reshape(-1, POINTS) / gauss(POINTS)[1]
    return 2 * np.abs(values @ transform(POINTS)[-2:].T).max(axis=1)


@dataclass(frozen=True)
class Cumulative:
    """The integral along each leg from its anchor; ``weighted`` by leg as in :func:`tails`."""

    panels: Sequence[Panels]
    weighted: Sequence[np.ndarray]

    @cached_property
    def _table(self) -> tuple[np.ndarray, ...]:
        """Per panel of all legs: coefficients, integral at its left edge, its edges; then each leg's first panel."""
        values = np.concatenate(self.weighted).reshape(-1, POINTS) / gauss(POINTS)[1]
        coefficients = values @ _integrator(POINTS).T
        first = np.concatenate([[0], np.cumsum([p.count for p in self.panels])])
        amounts = values @ gauss(POINTS)[1]
        left = np.concatenate([np.concatenate([[0.0], np.cumsum(amounts[a:b])[:-1]]) for a, b in pairwise(first)])
        low = np.concatenate([p.edges[:-1] for p in self.panels])
        high = np.concatenate([p.edges[1:] for p in self.panels])
        return coefficients, left, low, high, first

    def totals(self) -> np.ndarray:
        """The integral over each leg."""
        return np.array([w.sum() for w in self.weighted])

    def at(self, leg: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The integral from the anchor of ``leg`` (m,) to ``t`` (m,)."""
        coefficients, left, low, high, first = self._table
        panel = np.empty(len(t), dtype=int)
        for k in np.unique(leg):
            mask = leg == k
            panel[mask] = first[k] + np.clip(
                np.searchsorted(self.panels[k].edges, t[mask], side="right") - 1, 0, self.panels[k].count - 1
            )
        local = 2 * (t - low[panel]) / (high[panel] - low[panel]) - 1
        return left[panel] + legendre.legval(local, coefficients[panel].T, tensor=False)

    def inverse(self, leg: np.ndarray, amount: np.ndarray) -> np.ndarray:
        """The t of ``leg`` (m,) at which the integral of a positive integrand reaches ``amount`` (m,)."""
        coefficients, left, low, high, first = self._table
        panel = np.empty(len(amount), dtype=int)
        for k in np.unique(leg):
            mask = leg == k
            edges = left[first[k] : first[k + 1]]
            panel[mask] = first[k] + np.clip(np.searchsorted(edges, amount[mask], side="right") - 1, 0, None)
        rows = coefficients[panel].T
        local = _monotone_root(rows, amount - left[panel])
        return low[panel] + 0.5 * (1 + local) * (high[panel] - low[panel])


def _monotone_root(rows: np.ndarray, amount: np.ndarray) -> np.ndarray:
    """Where in [-1, 1] increasing Legendre series, one a column of ``rows``, reach ``amount``."""
    slopes, total = legendre.legder(rows), rows.sum(axis=0)

    def left(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return amount - legendre.legval(at, rows, tensor=False), -legendre.legval(at, slopes, tensor=False)

    with np.errstate(divide="ignore", invalid="ignore"):
        start = np.clip(2 * np.nan_to_num(amount / total) - 1, -1.0, 1.0)
        ends = -np.ones_like(amount), np.ones_like(amount)
        return np.clip(bracketed_newton(left, *ends, start, absolute=QUADRATIC)[0], -1.0, 1.0)
