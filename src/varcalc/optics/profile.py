"""An index of one coordinate, as the motion along that coordinate sees it.

In layers the momentum p_h along them is constant (Snell's law; Brizard, "An
Introduction to Lagrangian Mechanics", eq. 1.33), and the height u obeys
(du/dτ)² = g(u) - C with g = n², C = p_h² and τ = σ. About a centre Bouguer's
c = |r × p| is constant (eq. 1.45). With u = ln(r/r₀), the logarithm being
conformal, the equation is the same with g = n² r², C = c² and dτ = dσ/r². In
both the optical path is ∫ g dτ, and √C τ is the distance along the layers or
the angle about the centre.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.carried import carry, displaced
from varcalc.optics.media import Expression, Medium, Radial
from varcalc.symbolic.instructions import Vectorised

FAR = 1e6
"""Rays that have come so many times farther than the scene is large meet nothing any more."""
PLACES = 240
"""Places on either side at which the index is looked at to begin with, in geometric progression."""
BENT = 1e-2
"""Of its change over an interval: how well a cubic must foretell g in the middle."""
ROUNDS = 14
"""Times an interval is halved to meet BENT."""
EPS = float(np.finfo(float).eps)
DIFFERENT = 0.1
"""Of the larger of two values: their difference is then exact to round-off."""
DEEPEST = 330.0
"""Of |ln(r/r₀)|: beyond it r² is no number."""
ZERO_STEPS = 100
"""Steps of a bracketed search."""


@dataclass(frozen=True)
class Values:
    """At places base + x: ``g`` and ``slope`` = dg/du there, their changes ``gain`` and ``bend`` since the base.

    The changes are exact to round-off, however small x is.
    """

    g: np.ndarray
    slope: np.ndarray
    gain: np.ndarray
    bend: np.ndarray

    def above(self, C: np.ndarray, squared: np.ndarray | float = 0.0) -> np.ndarray:
        """g - C, where ``squared`` is g - C at the bases: of the two ways to find it the one that loses less."""
        apart = self.g - C
        return np.where(np.abs(apart) > DIFFERENT * np.maximum(np.abs(self.g), C), apart, squared + self.gain)


@dataclass(frozen=True)
class Nodes:
    """Places ``u`` (k,) in ascending order between which ``g`` (k,) is monotone.

    The edges say whether there is no index beyond the ends.
    """

    u: np.ndarray
    g: np.ndarray
    low_edge: bool
    high_edge: bool


@dataclass(frozen=True)
class Profile:
    """g of one medium, about ``unit``: the radius u is measured from, or any height in layers.

    Parameters
    ----------
    medium : Stratified or Radial
    unit : float
        A radius, for a centre; a length of the scene, for layers.
    probe : float
        A u at which there is an index.
    """

    medium: Medium
    unit: float
    probe: float
    _changes: Callable[..., list[Any]] = field(init=False, repr=False, compare=False)
    _index: Callable[..., list[Any]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        u, base, x = ca.SX.sym("u"), ca.SX.sym("base"), ca.SX.sym("x")
        g = self._squared(u)
        slope = ca.gradient(g, u)
        values = ca.Function("g", [u], [g, ca.densify(slope)])
        carried = carry(values, [displaced(base, x, self.probe)])
        results = [carried[0].change, carried[1].change]
        object.__setattr__(self, "_changes", Vectorised(ca.Function("changes", [base, x], results)))
        index = self._plain.index(self._position(u))
        object.__setattr__(self, "_index", Vectorised(ca.Function("index", [u], [g, ca.densify(slope), ca.SX(index)])))

    @property
    def about_centre(self) -> bool:
        """True for a centre, False for layers."""
        return isinstance(self.medium, Radial)

    def _position(self, u: Expression) -> Expression:
        return ca.vertcat(self.unit * ca.exp(u), 0) if self.about_centre else ca.vertcat(0, u)

    @property
    def _plain(self) -> Medium:
        """The medium, its centre at the origin."""
        return replace(self.medium, center=None) if isinstance(self.medium, Radial) else self.medium

    def _squared(self, u: Expression) -> Expression:
        squared = self._plain.squared_index(self._position(u))
        return squared * (self.unit * ca.exp(u)) ** 2 if self.about_centre else squared

    def __call__(self, base: np.ndarray, x: np.ndarray) -> Values:
        """The values at base + x, arrays of one shape."""
        shape = np.shape(x)
        g, slope, _ = self._table(base + x)
        old, steep, _ = self._table(base)
        gain, bend = (_shaped(c, shape) for c in self._changes(base, x))
        return Values(g, slope, _better(g, old, gain), _better(slope, steep, bend))

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """g and its slope at u."""
        g, slope, _ = self._table(u)
        return g, slope

    def _table(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, its slope and n at u; g is not a number where there is no index."""
        g, slope, n = (_shaped(c, np.shape(u)) for c in self._index(u))
        return g, slope, n

    def squared_radius(self, u: np.ndarray) -> np.ndarray:
        """dσ/dτ: r² about a centre, 1 in layers."""
        return (self.unit * np.exp(u)) ** 2 if self.about_centre else np.ones_like(u)

    def zero(
        self, base: np.ndarray, squared: np.ndarray, C: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> np.ndarray:
        """x (m,) between ``low`` and ``high`` with g(base + x) = C, which holds once there.

        ``squared`` is g(base) - C. g - C is positive at ``low``, and it is no matter which of the two is the larger.
        """
        x = (low + high) / 2
        with np.errstate(all="ignore"):
            for _ in range(ZERO_STEPS):
                at = self(base, x)
                value = at.above(C, squared)
                low, high = np.where(value > 0, x, low), np.where(value > 0, high, x)
                newton = x - value / at.slope
                inside = (newton - low) * (newton - high) < 0
                new = np.where(inside, newton, (low + high) / 2)
                done = np.abs(new - x) <= EPS * (4 * np.abs(x) + 2 * np.abs(np.minimum(squared, C) / at.slope))
                x = new
                if np.all(done):
                    break
        return x

    def nodes(self, first: float, last: float, low: float, high: float) -> Nodes:
        """The nodes of g about the places from ``first`` to ``last``, no farther than ``low`` and ``high``."""
        with np.errstate(all="ignore"):
            return self._nodes(first, last, low, high)

    def _nodes(self, first: float, last: float, low: float, high: float) -> Nodes:
        size = max(abs(first), abs(last), last - first) or 1.0
        reach = np.geomspace(1e-8, FAR, PLACES) * (1.0 if self.about_centre else size)
        if self.about_centre:
            reach = reach[reach < DEEPEST]
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
        return Nodes(u, self._table(u)[0], low_edge, high_edge)

    def _inside(self, u: np.ndarray, first: float, last: float) -> tuple[np.ndarray, bool, bool]:
        """The places among ``u`` with an index all the way to them, and whether it ends below and above."""
        sound = self._sound(u)
        below, above = np.flatnonzero(~sound & (u < first)), np.flatnonzero(~sound & (u > last))
        start, stop = (below[-1] + 1 if len(below) else 0), (above[0] if len(above) else len(u))
        ends = []
        if len(below):
            ends.append(self._edge(u[start], u[start - 1]))
        if len(above):
            ends.append(self._edge(u[stop - 1], u[stop]))
        return np.unique(np.concatenate([u[start:stop], ends])), len(below) > 0, len(above) > 0

    def _sound(self, u: np.ndarray) -> np.ndarray:
        """True where g is a number and n not negative; where n² is negative rays turn before."""
        g, slope, n = self._table(u)
        return np.isfinite(g) & np.isfinite(slope) & ~(n < 0)

    def _edge(self, good: float, bad: float) -> float:
        """The last place from ``good`` towards ``bad`` where there is an index."""
        for _ in range(ZERO_STEPS):
            middle = (good + bad) / 2
            if middle in (good, bad):
                break
            good, bad = (middle, bad) if self._sound(np.array([middle]))[0] else (good, middle)
        return good

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
        low, high, sign = u[turn], u[turn + 1], slope[turn]
        for _ in range(ZERO_STEPS if len(turn) else 0):
            middle = (low + high) / 2
            same = self.at(middle)[1] * sign > 0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.concatenate([low, high])


def _shaped(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """``values`` in ``shape``: what does not depend on the place comes as one number."""
    values = np.asarray(values, dtype=float)
    return values if values.shape == shape else np.broadcast_to(values, shape)


def _better(new: np.ndarray, old: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The difference where the values differ much, which loses nothing; elsewhere the ``change`` as it was carried."""
    return np.where(np.abs(new - old) > DIFFERENT * np.maximum(np.abs(new), np.abs(old)), new - old, change)
