"""Curves known by the constant of their first integral: legs, and what is integrated along them.

One variable of the two runs along a leg and the slope follows from the
constant at every point (:class:`~varcalc.methods.first_integral.energy.EnergyLines`
where y runs, :class:`~varcalc.methods.first_integral.momentum.Momentum` where
x does). The functional is W + constant * covered with W, the action, the
integral of the Lagrangian function less constant times what is covered; its
derivative by the constant is minus that, so that an error of the constant
changes the functional in second order only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Generic, TypeVar

import numpy as np

from varcalc.methods.first_integral.integrands import ReducedIntegrands
from varcalc.numerics.one_coordinate.panels import COARSE, Cumulative, Panels

F = TypeVar("F")


@dataclass(frozen=True)
class Arc:
    """Part of a monotone branch, measured from its ``anchor``: the running variable is anchor + length * share(t).

    ``anchor`` and ``length`` have one entry for each curve of a batch.
    ``direction`` is the sign of the slope, ``away`` tells whether the curve
    leaves the anchor. The constant is known by its value at rest at ``reference``, from which all changes
    are measured; None at an ``end`` of the problem where L is infinite.
    """

    anchor: np.ndarray
    length: np.ndarray
    direction: float
    away: bool
    reference: np.ndarray | None
    panels: Panels
    end: float | None = None


@dataclass(frozen=True)
class CurveBatch:
    """Curves of the same shape: legs in travel order, and the constant, at rest at the reference less ``excess``."""

    legs: tuple[Arc, ...]
    constant: np.ndarray
    excess: np.ndarray
    multipliers: np.ndarray

    def by_rules(self, panels: tuple[Panels, ...], *, coarse: bool) -> CurveBatch:
        """The same with the rules of the legs where there are any, or ``coarse`` ones."""
        rules = panels or ((COARSE,) * len(self.legs) if coarse else ())
        if not rules:
            return self
        return replace(self, legs=tuple(replace(leg, panels=p) for leg, p in zip(self.legs, rules, strict=True)))

    def cumulative(self, measured: CurveIntegrals) -> Cumulative:
        """What the first of the curves covers along each leg from its anchor."""
        return Cumulative([leg.panels for leg in self.legs], [d[0] for d in measured.dx])

    def anchors(self, covered: Cumulative, first: float, last: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where legs have their anchors, the signs of the ways from these, and where legs meet, ends included."""
        between = first + np.concatenate([[0.0], np.cumsum(covered.totals())])
        between[-1] = last
        away = np.array([leg.away for leg in self.legs])
        return np.where(away, between[:-1], between[1:]), np.where(away, 1.0, -1.0), between


@dataclass(frozen=True)
class CurveIntegrals:
    """What a batch integrates to, one entry a curve (NaN where the slope has no solution).

    ``x`` is what is covered of the other variable, ``action`` the functional less constant * x, ``levels`` the
    isoperimetric integrals; per leg the weighted integrands of
    x, of the Lagrangian function, and of its parts, each (curves, points).
    """

    x: np.ndarray
    action: np.ndarray
    levels: np.ndarray
    dx: list[np.ndarray]
    dl: list[np.ndarray]
    fields: list[np.ndarray]

    def take(self, k: int) -> CurveIntegrals:
        """What curve ``k`` integrates to."""
        one = slice(k, k + 1)
        dx, dl = ([d[one] for d in part] for part in (self.dx, self.dl))
        return CurveIntegrals(
            self.x[one], self.action[one], self.levels[:, one], dx, dl, [f[:, one] for f in self.fields]
        )


class Lines(ABC, Generic[F]):
    """Slopes and integrals of extremals known by a constant; L is negated throughout where ``orientation`` is -1.

    ``inside`` is a place of the running variable inside the domain of L.
    """

    running: ClassVar[int]
    """The variable that runs along a leg: 0 for x, 1 for y."""
    most_panels: ClassVar[int]
    """Panels of all legs of a curve, after which no more are made: some nine hold a turn of what oscillates."""

    def __init__(self, integrands: ReducedIntegrands, orientation: float, inside: float) -> None:
        self.integrands = integrands
        self.orientation = orientation
        self.inside = inside
        self._anchors: dict[float | None, F] = {}

    def functions(self, end: float | None) -> F:
        """The functions anchored at a singular ``end``, or at any regular point for None."""
        if end not in self._anchors:
            with self.integrands.building:
                self._anchors[end] = self._build(end)
        return self._anchors[end]

    @abstractmethod
    def _build(self, end: float | None) -> F: ...

    @abstractmethod
    def along(
        self, legs: Sequence[Arc], deltas: Sequence[np.ndarray], batch: CurveBatch
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """The slopes at distances from the anchors of legs with one ``end``, and the integrands there.

        All of them side by side: (curves, points of the first leg, points of the second, ...).
        """

    @abstractmethod
    def steps(self, slopes: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of steps ``width`` of the running variable: those of the homogeneous parameter, and of the other variable."""

    @abstractmethod
    def slope(self, leg: Arc, delta: np.ndarray, batch: CurveBatch) -> np.ndarray:
        """y' (m,) of a batch of one at distances ``delta`` (m,) from a leg's anchor."""

    def measure(self, batch: CurveBatch) -> CurveIntegrals:
        """Slopes and integrals along every curve of a batch."""
        count = len(batch.legs)
        dx, dl, fields = ([np.zeros(0)] * count for _ in range(3))
        for end in dict.fromkeys(leg.end for leg in batch.legs):
            numbers = [k for k, leg in enumerate(batch.legs) if leg.end == end]
            legs = [batch.legs[k] for k in numbers]
            rules = [leg.panels.distances for leg in legs]
            deltas = [leg.length[:, None] * share for leg, (share, _) in zip(legs, rules, strict=True)]
            widths = [np.abs(leg.length)[:, None] * weights for leg, (_, weights) in zip(legs, rules, strict=True)]
            width = np.concatenate(widths, axis=1)
            found, values = self.along(legs, deltas, batch)
            # a leg of no length holds nothing, even where the slope is not defined
            step, covered = (np.where(width == 0, 0.0, part) for part in self.steps(found, width))
            parts = np.stack([np.where(width == 0, 0.0, step * v) for v in values])
            cuts = np.cumsum([d.shape[1] for d in deltas])[:-1]
            split = (np.split(a, cuts, axis=-1) for a in (covered, parts[0], parts[1:]))
            for k, *of_leg in zip(numbers, *split, strict=True):
                dx[k], dl[k], fields[k] = of_leg
        x = np.sum([d.sum(axis=1) for d in dx], axis=0)
        total = np.sum([d.sum(axis=1) for d in dl], axis=0)
        n = len(self.integrands.levels)
        levels = np.sum([f[1 : 1 + n].sum(axis=2) for f in fields], axis=0)
        return CurveIntegrals(x, total - batch.constant * x, levels, dx, dl, fields)
