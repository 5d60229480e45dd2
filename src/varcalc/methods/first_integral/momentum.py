"""Lagrangians without y: the momentum L_y' = c is constant, and y is the integral of the slope.

At every x the slope solves L_y'(x, v) = c, monotone in v where L_vv > 0
(Gelfand and Fomin, "Calculus of Variations", sect. 4, case 1). The value is
the integral of L - c v, plus c times the rise, so that an error of c changes
it in second order only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.lines import Arc, CurveBatch, CurveIntegrals, Lines
from varcalc.numerics.one_coordinate.panels import (
    QUADRATIC,
    TOWARD,
    WHOLE,
    Cumulative,
    Panels,
    inverse_distance,
)
from varcalc.numerics.resampled import SentResampled
from varcalc.numerics.roots import bracketed_newton, least
from varcalc.symbolic.differences import carry, displaced, fixed
from varcalc.symbolic.evaluation import Columns, PointEvaluator

LARGEST_ASINH_SLOPE = 36.0
"""Largest asinh of a slope in units of the mean one: there L_y' has reached its limit to round-off, if it has one."""
SLOPE_GRID = LARGEST_ASINH_SLOPE * np.linspace(-1, 1, 25) ** 3
"""asinh of slopes at which curves are tried."""
PROBE = 0.37


class Momentum(Lines[tuple[Columns, Columns]]):
    """Slopes and integrals of the extremals of a Lagrangian without y: x runs; slopes are given by their asinh.

    The functions are of (anchor, delta, c, s, lambda): the momentum and its derivative by asinh v; the integrands.
    """

    running, most_panels = 0, 16_000

    def _build(self, end: float | None) -> tuple[Columns, Columns]:
        x = self.integrands.problem.symbols.x
        c, s, multipliers = self.integrands.symbols
        lam = ca.vertsplit(multipliers) if multipliers.numel() else []
        form = self.orientation * self.integrands.lagrangian
        momentum = ca.gradient(form, s) / self.integrands.scale
        rate = c * (c * ca.jacobian(momentum, s) - s * ca.jacobian(momentum, c))
        results = [momentum, rate, form, *self.integrands.forms, *self.integrands.partials]
        function = ca.Function("all", [x, c, s, *lam], ca.cse([ca.densify(r) for r in results]))
        anchor, delta = (ca.SX.sym("anchor") if end is None else ca.SX(end)), ca.SX.sym("delta")
        others = [fixed(c, 0.8), fixed(s, 0.6), *(fixed(m, 0.3) for m in lam)]
        start = displaced(anchor, delta, self.inside if end is None else end)
        moved = [m.value for m in carry(function, [start, *others])]
        inputs = [anchor if end is None else ca.SX.sym("anchor"), delta, c, s, multipliers]
        slope, value = (ca.Function("at_anchor", inputs, ca.cse(parts)) for parts in (moved[:2], moved[2:]))
        return PointEvaluator(slope).columns, PointEvaluator(value).columns

    def momentum(self, x: np.ndarray, asinh_slope: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """L_y' at abscissae x for slopes scale * sinh(asinh_slope)."""
        c, s = _direction(asinh_slope)
        return self.functions(None)[0](x, 0.0, c, s, list(multipliers))[0]

    def steps(self, slopes: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Lines.steps`: dy = scale s dt where dx = c dt."""
        c, s = _direction(slopes)
        step = width / c
        return step, step * self.integrands.scale * s

    def slope(self, leg: Arc, delta: np.ndarray, batch: CurveBatch) -> np.ndarray:
        """See :meth:`Lines.slope`."""
        return self.integrands.scale * np.sinh(self.along([leg], [delta[None, :]], batch)[0][0])

    def along(
        self, legs: Sequence[Arc], deltas: Sequence[np.ndarray], batch: CurveBatch
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """See :meth:`Lines.along`."""
        solve, value = self.functions(legs[0].end)
        lam, delta = [m[:, None] for m in batch.multipliers], np.concatenate(deltas, axis=1)
        sizes = [d.shape for d in deltas]
        bases = [np.broadcast_to(leg.anchor[:, None], size) for leg, size in zip(legs, sizes, strict=True)]
        anchor = np.concatenate(bases, axis=1)
        wanted = batch.constant[:, None]

        def short(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            momentum, rate = solve(anchor, delta, *_direction(z), lam)
            return wanted - momentum, np.where(np.isfinite(rate), -rate, np.nan)

        ends = np.full(delta.shape, -1.1 * LARGEST_ASINH_SLOPE), np.full(delta.shape, 1.1 * LARGEST_ASINH_SLOPE)
        with np.errstate(all="ignore"):
            begun = short(np.zeros(delta.shape))
            # the slope itself, by a step that is exact where L is of second degree in it
            start = np.clip(np.nan_to_num(np.arcsinh(-begun[0] / begun[1])), *ends)
            z, moved = bracketed_newton(short, *ends, start, absolute=QUADRATIC)
            z[(np.abs(z) > LARGEST_ASINH_SLOPE) | ~(moved <= QUADRATIC)] = np.nan
        return z, value(anchor, delta, *_direction(z), lam)


def _direction(asinh_slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 1 / np.cosh(asinh_slope), np.tanh(asinh_slope)


@dataclass(frozen=True)
class Abscissae:
    """The stretch of x, cut where L may jump, and whether L is no number at its ends."""

    stops: tuple[float, ...]
    size: float
    singular: tuple[bool, bool]


@dataclass(frozen=True)
class Rising:
    """Curves with L_y' = c, by the asinh of the slope at ``reference``, where the momentum is most limited."""

    lines: Momentum
    points: Abscissae
    reference: float
    panels: tuple[Panels, ...] = ()
    coarse: bool = False

    @property
    def unit(self) -> float:
        """The size of a change of the parameter that matters."""
        return 1.0

    def ruled(self, panels: tuple[Panels, ...]) -> Rising:
        """The same family with the given rules."""
        return replace(self, panels=panels)

    def looked_at(self) -> Rising:
        """The same family with coarse rules."""
        return replace(self, coarse=True)

    def batch(self, parameter: np.ndarray, multipliers: np.ndarray) -> CurveBatch:
        """The curves for parameters (curves,) and multipliers (constraints, curves)."""
        legs: list[Arc] = []
        stops = self.points.stops
        for a, b in pairwise(stops):
            for anchor, other, away in ((a, b, True), (b, a, False)):
                ends = zip(self.points.singular, (stops[0], stops[-1]), strict=True)
                singular = any(flag and anchor == x for flag, x in ends)
                full, length = np.full(parameter.shape, anchor), np.full(parameter.shape, 0.5 * (other - anchor))
                panels, end = (TOWARD, anchor) if singular else (WHOLE, None)
                legs.append(Arc(full, length, 1.0, away, None, panels, end))
        at = np.full(parameter.shape, self.reference)
        constant = self.lines.momentum(at, parameter, multipliers) * np.ones_like(at)
        batch = CurveBatch(tuple(legs), constant, np.zeros_like(at), multipliers)
        return batch.by_rules(self.panels, coarse=self.coarse)


def rising(momentum: Momentum, points: Abscissae, upward: bool, multipliers: np.ndarray) -> Rising:
    """The family of curves; the reference is where the limit of L_y' for steep slopes is nearest to zero."""
    a, b = points.stops[0], points.stops[-1]
    at = a + (b - a) * (0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 65)))
    at[-1] = b
    sign = 1.0 if upward else -1.0

    def limit(x: np.ndarray) -> np.ndarray:
        values = sign * momentum.momentum(x, np.full(x.shape, sign * LARGEST_ASINH_SLOPE), multipliers)
        return np.nan_to_num(np.broadcast_to(values, x.shape), nan=np.inf)

    values = limit(at)
    k = int(np.argmin(values))
    if k in (0, 64) or not np.isfinite(values[k]):
        return Rising(momentum, points, float(at[k]) if np.isfinite(values[k]) else 0.5 * (a + b))
    return Rising(momentum, points, least(limit, float(at[k - 1]), float(at[k + 1])))


@dataclass(frozen=True)
class RisingCurve(SentResampled):
    """y(x) as the integral of the slope from either end of each stretch."""

    family: Rising
    batch: CurveBatch
    measured: CurveIntegrals
    ordinates: tuple[float, float]

    @cached_property
    def _cumulative(self) -> Cumulative:
        return self.batch.cumulative(self.measured)

    @cached_property
    def _heights(self) -> tuple[np.ndarray, np.ndarray]:
        """Ordinate of each leg's anchor, and the sign of the way from it."""
        return self.batch.anchors(self._cumulative, *self.ordinates)[:2]

    @property
    def nodes(self) -> np.ndarray:
        """Abscissae of the panels' edges."""
        stops = [leg.anchor[0] + leg.length[0] * np.array(leg.panels.edges) ** 2 for leg in self.batch.legs]
        return np.unique(np.concatenate(stops))

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """y (derivative 0) or y' (1) at abscissae x (m,); shape (1, m)."""
        heights, sign = self._heights
        marks = np.array([leg.anchor[0] + (leg.length[0] if leg.away else 0.0) for leg in self.batch.legs])
        which = np.clip(np.searchsorted(marks, x, side="left"), 0, len(marks) - 1)
        out = np.empty(len(x))
        for k in np.unique(which):
            mask, leg = which == k, self.batch.legs[k]
            delta = x[mask] - leg.anchor[0]
            if derivative:
                out[mask] = self.family.lines.slope(leg, delta, self.batch)
            else:
                t = inverse_distance(leg.panels.kind, np.clip(delta / leg.length[0], 0.0, 1.0))
                out[mask] = heights[k] + sign[k] * self._cumulative.at(np.full(len(t), k), t)
        return out[None, :]
