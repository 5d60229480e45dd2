"""The potential of a motion in one coordinate, as one_coordinate takes it.

With a(q) q'²/2 + W(q) = E and dt = √a (dq/du) dτ the motion is (du/dτ)² = g - C with g = -2 W and C = -2 E, whatever
the coordinate u; the time and the angles are integrals over τ.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.mechanics.reduced.charts import LOG_LIMIT, OpenChart
from varcalc.mechanics.reduced.routh import OneCoordinate
from varcalc.numerics.one_coordinate.motions import MotionPoint
from varcalc.numerics.one_coordinate.potential import Potential
from varcalc.symbolic.differences import carry, displaced
from varcalc.symbolic.evaluation import Columns, PointEvaluator, in_shape
from varcalc.symbolic.places import places
from varcalc.symbolic.switches import switches
from varcalc.symbolic.variation import gentle_boxes

TIME, ANGLES = 1, 2
"""The columns of the integrals, after τ, that hold the time and the first of the angles."""
MOST_PLACES_OF_POTENTIAL = 4000
"""Places at which a potential that varies fast is looked at."""
DISTANCES = np.geomspace(1e-12, 1e12, 600)
"""Distances along a line at which a potential is looked at to begin with."""
FARTHEST_PLACE = 1e12
PROBES = np.array([0.0, 0.37, -0.41, 1.1, -1.3, 2.9, -3.1, 20.0, -20.0])
"""Places in u at one of which a potential is a number."""

Averaged = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A function of the coordinate and its rate, arrays of one shape."""


@dataclass(frozen=True)
class EffectivePotential(Potential):
    """g = -2 W of u in one ``chart``; ``averaged`` are integrated over the time beside the angles."""

    one: OneCoordinate
    chart: OpenChart
    averaged: tuple[Averaged, ...] = ()
    _parts: _TracedPotential = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_parts", _TracedPotential.of(self.one, self.chart))

    def averaging(self, function: Averaged) -> EffectivePotential:
        """The same with a ``function`` that is integrated over the time."""
        other = copy(self)
        object.__setattr__(other, "averaged", (function,))
        return other

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        g, slope = in_shape(self._parts.values(u), np.shape(u))
        return g, slope

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`."""
        gain, bend = in_shape(self._parts.changes(base, x), np.shape(x))
        return gain, bend

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        """The time, the angles, and what is averaged over the time, by τ."""
        time, stretch, place, *rates = in_shape(self._parts.weights(point.u), np.shape(point.u))
        k = len(rates) // 2
        angles = [
            time * steady + stretch * point.w * carried for steady, carried in zip(rates[:k], rates[k:], strict=True)
        ]
        velocity = stretch * point.w / time
        return time, *angles, *(time * function(place, velocity) for function in self.averaged)

    @property
    def stops(self) -> np.ndarray:
        """See :meth:`Potential.stops`."""
        return self._parts.stops

    @property
    def gentle(self) -> np.ndarray:
        """See :meth:`Potential.gentle`."""
        return self._parts.gentle

    @property
    def reach(self) -> np.ndarray:
        """See :meth:`Potential.reach`."""
        return DISTANCES[DISTANCES < 2 * LOG_LIMIT]

    def place(self, u: np.ndarray) -> np.ndarray:
        """q at u."""
        return in_shape(self._parts.weights(u), np.shape(u))[2]


@dataclass(frozen=True)
class _TracedPotential:
    """Functions of u: g and its slope, their changes, and dt/dτ, dq/du, q and the rates of the angles."""

    function: ca.Function
    values: Columns
    weights: Columns
    probe: float
    limits: tuple[float, float]

    @classmethod
    def of(cls, one: OneCoordinate, chart: OpenChart) -> _TracedPotential:
        """Those of a coordinate in the chart of u."""
        u = ca.SX.sym("u")
        place = ca.SX(chart.place(u))
        potential, inertia, steady, carried = (
            ca.substitute(part, one.q, place) for part in (one.potential, one.inertia, one.steady, one.carried)
        )
        g, stretch = -2 * potential, ca.densify(ca.gradient(place, u))
        function = ca.Function("g", [u], [g, ca.densify(ca.gradient(g, u))])
        rates = [*ca.vertsplit(ca.densify(steady)), *ca.vertsplit(ca.densify(carried))] if steady.numel() else []
        weights = ca.Function("weights", [u], [ca.sqrt(inertia) * stretch, stretch, place, *rates])
        probes = [p for p in PROBES if np.all(np.isfinite([float(v) for v in function(p)]))]
        return cls(
            function,
            PointEvaluator(function).columns,
            PointEvaluator(weights).columns,
            float((probes or [0.0])[0]),
            chart.limits,
        )

    @cached_property
    def changes(self) -> Columns:
        """The changes of g and of its slope from ``base`` to ``base + x``, without cancellation."""
        base, x = ca.SX.sym("base"), ca.SX.sym("x")
        results = [one.change for one in carry(self.function, [displaced(base, x, self.probe)])]
        return PointEvaluator(ca.Function("changes", [base, x], results, {"cse": True})).columns

    @property
    def _span(self) -> tuple[float, float]:
        return tuple(np.clip(self.limits, -FARTHEST_PLACE, FARTHEST_PLACE).tolist())

    @cached_property
    def stops(self) -> np.ndarray:
        """Places u (k,) at which g switches from one formula to another, ascending."""
        u, found = ca.SX.sym("u"), []
        for switch in switches([self.function(u)[0]], [u]):
            found += places(switch, u, self._span, found) or []
        return np.unique(found)

    @cached_property
    def gentle(self) -> np.ndarray:
        """Edges u (k,) between which g is gentle, without the outermost."""
        u, (low, high) = ca.SX.sym("u"), self._span
        edges = np.array([low, (low + high) / 2, high])
        return gentle_boxes(ca.Function("g", [u], [self.function(u)[0]]), edges, MOST_PLACES_OF_POTENTIAL)[1:-1]
