"""Lagrangians without x: Euler's second equation L - y' L_y' = C reduced to quadrature.

On a monotone branch the slope follows from C at every y, and dx = dy / y'
(Gelfand and Fomin, "Calculus of Variations", sect. 4, case 2). With P(y, v) =
L - v L_v, which decreases with the slope's size where L_vv > 0, the slope
solves

    P(y, 0) - P(y, v) = P(y, 0) - C,

both sides carried as differences from where they vanish, so that a turning
point (v = 0) costs no digits; the distance from it is squared away by the
rule.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.lines import Arc, CurveBatch, Lines
from varcalc.numerics.one_coordinate.panels import QUADRATIC
from varcalc.numerics.roots import bracketed_newton
from varcalc.symbolic.differences import carry, displaced, fixed
from varcalc.symbolic.evaluation import Columns, PointEvaluator

LARGEST_LOG_SLOPE = 640.0
"""Largest logarithm of a slope: beyond it exp overflows in intermediate results."""
CONVEXITY_PROBES = np.array([-6.0, -2.0, 0.0, 2.0])
"""Logarithms of slopes at which L_vv > 0 is checked; only the first must lie in the domain of L."""
NEARLY = 1e-5
"""A relative miss up to which a small Newton step counts."""


@dataclass(frozen=True)
class AnchorFunctions:
    """The functions of (anchor, displacement, ...) at one kind of anchor."""

    rest: Columns
    """(anchor, delta, lambda) -> P(y, 0) and its change from the anchor."""
    slope: Columns
    """(anchor, delta, c, c - 1, s, lambda) -> P(y, 0) - P(y, v), P(y, v), and the derivative of the first by log v."""
    value: Columns
    """(anchor, delta, c, s, lambda) -> Lagrangian function, L, the g_j, the partials by parameters."""


class EnergyLines(Lines[AnchorFunctions]):
    """Slopes and integrals of the extremals of a Lagrangian without x: y runs; slopes are given by their logarithms."""

    running, most_panels = 1, 1_600

    def _build(self, end: float | None) -> AnchorFunctions:
        y = self.integrands.problem.symbols.y
        c, s, multipliers = self.integrands.symbols
        form = self.orientation * self.integrands.lagrangian
        first = ca.gradient(form, c)
        lam = ca.vertsplit(multipliers) if multipliers.numel() else []
        drop = ca.SX.sym("drop")
        unchanged = [fixed(m, 0.3) for m in lam]
        at_slope = ca.Function("P", [y, c, s, *lam], [first])
        carried = carry(
            at_slope,
            [fixed(y, self.inside), displaced(ca.SX(1), drop, 1.0), displaced(ca.SX(0), s, 0.0), *unchanged],
        )[0]
        rest = ca.substitute(first, ca.vertcat(c, s), ca.DM([1, 0]))
        mixed = -s * ca.jacobian(ca.gradient(form, s), c)
        results = [rest, -carried.change, first, mixed, form]
        results += [*self.integrands.forms, *self.integrands.partials]
        inputs = [y, c, drop, s, *lam]
        anchor, delta = (ca.SX.sym("anchor") if end is None else ca.SX(end)), ca.SX.sym("delta")
        start = displaced(anchor, delta, self.inside if end is None else self._probe(end))
        others = [fixed(v, probe) for v, probe in zip(inputs[1:], [0.8, -0.2, 0.6, *[0.3] * len(lam)], strict=True)]
        function = ca.Function("all", inputs, ca.cse([ca.densify(r) for r in results]))
        rest, excess, first, mixed, *values = carry(function, [start, *others])
        name = anchor if end is None else ca.SX.sym("anchor")
        at = [name, delta]
        return AnchorFunctions(
            *(
                PointEvaluator(ca.Function("at_anchor", names, ca.cse(parts))).columns
                for names, parts in (
                    ([*at, multipliers], [rest.value, rest.change]),
                    ([*at, c, drop, s, multipliers], [excess.value, first.value, mixed.value]),
                    ([*at, c, s, multipliers], [v.value for v in values]),
                )
            )
        )

    def _probe(self, end: float) -> float:
        """The ordinate of a singular end, or no number where L is still finite at it.

        There P is so large that nothing is left of a small one when it is summed from P at the end and the change.
        """
        value = self.integrands.at(np.zeros(1), np.array([end]), np.zeros(1))[0, 0, 0]
        return math.nan if np.isfinite(value) else end

    def rest(self, y: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """P(y, 0) at points y of shape (m,)."""
        return np.broadcast_to(self.functions(None).rest(y, 0.0, list(multipliers))[0], np.shape(y))

    def rest_where_convex(self, y: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """P(y, 0), NaN where L_vv is not positive at some slope tried."""
        values = self.rest(y, multipliers)
        c, drop, s = _direction(CONVEXITY_PROBES[:, None], 1.0)
        mixed = self.functions(None).slope(y, 0.0, c, drop, s, list(multipliers))[2]
        mixed = np.broadcast_to(mixed, (len(CONVEXITY_PROBES), len(y)))
        return np.where((mixed[0] > 0) & ~np.any(mixed[1:] <= 0, axis=0), values, np.nan)

    def at_slope(
        self, y: np.ndarray, log_slope: np.ndarray, direction: float, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """P(y, 0) - P(y, v) and P(y, v) at the slope scale * exp(log_slope), each to full relative accuracy."""
        c, drop, s = _direction(log_slope, direction)
        excess, value, _ = self.functions(None).slope(y, 0.0, c, drop, s, list(multipliers))
        return excess * np.ones_like(y), value * np.ones_like(y)

    def steps(self, slopes: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Lines.steps`: dx = c dt where dy = scale s dt."""
        c, _, s = _direction(slopes, 1.0)
        step = width / (self.integrands.scale * s)
        return step, step * c

    def slope(self, leg: Arc, delta: np.ndarray, batch: CurveBatch) -> np.ndarray:
        """See :meth:`Lines.slope`."""
        theta, _ = self.along([leg], [delta[None, :]], batch)
        with np.errstate(over="ignore"):
            slope = leg.direction * self.integrands.scale * np.exp(theta[0])
        # at an anchor without a slope it is that of the limit: infinite with L, zero at a turning point
        limit = leg.direction * np.inf if leg.end is not None else 0.0
        return np.where(np.isnan(slope) & (np.abs(delta) <= np.abs(leg.length[0]) * 1e-200), limit, slope)

    def along(
        self, legs: Sequence[Arc], deltas: Sequence[np.ndarray], batch: CurveBatch
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """See :meth:`Lines.along`."""
        functions = self.functions(legs[0].end)
        lam = [m[:, None] for m in batch.multipliers]
        bases, offsets, directions = [], [], []
        for leg, delta in zip(legs, deltas, strict=True):
            base = leg.anchor if leg.reference is None else leg.reference
            bases.append(np.broadcast_to(base[:, None], delta.shape))
            offsets.append(delta if leg.reference is None else (leg.anchor - leg.reference)[:, None] + delta)
            directions.append(np.full(delta.shape[1], leg.direction))
        base, offset, direction = (np.concatenate(parts, axis=-1) for parts in (bases, offsets, directions))
        at_rest, change = (np.broadcast_to(v, offset.shape) for v in functions.rest(base, offset, lam))
        constant = batch.constant[:, None]
        wanted = at_rest - constant if legs[0].reference is None else change + batch.excess[:, None]
        with np.errstate(all="ignore"):
            theta = self._slopes(functions, (base, offset), direction, lam, constant, at_rest, wanted)
        c, _, s = _direction(theta, direction)
        return theta, functions.value(base, offset, c, s, lam)

    @staticmethod
    def _slopes(
        functions: AnchorFunctions, place: tuple[np.ndarray, np.ndarray], direction: np.ndarray, lam: list[np.ndarray],
        constant: np.ndarray, at_rest: np.ndarray, wanted: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """log v by Newton's method on the logarithm of whichever side is small, kept in a bracket.

        Near a turning point the excess P(y, 0) - P(y, v) is small and its logarithm almost linear in log v; where
        L is large (a singular end) P itself is small against P(y, 0) and its logarithm is. Where P falls through zero
        (a mechanical energy does) that has a pole, before which every step is too long.
        """
        steep = (constant > 0) & (at_rest > 2 * constant)
        goals = np.log(wanted), -np.log(constant)

        def short(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """What is left at log v = ``theta`` (m,), falling, and its derivative, NaN where it leads nowhere."""
            excess, value, slope = functions.slope(*place, *_direction(theta, direction), lam)
            steep[value < -NEARLY * at_rest] = False
            size = np.where(steep, value, excess)
            miss, rate = np.where(steep, -np.log(size) - goals[1], np.log(size) - goals[0]), slope / size
            beyond = np.isnan(miss) | (steep & ~(value > 0))
            # a large miss belies a small Newton step: the slope is infinite there
            known = np.isfinite(slope) & ((np.abs(miss) <= NEARLY) | (np.abs(miss / rate) > QUADRATIC))
            return np.where(beyond, -np.inf, -miss), np.where(known, -rate, np.nan)

        start = np.where(np.isfinite(np.where(steep, goals[1], goals[0])) & (wanted > 0), 0.0, np.nan)
        ends = np.full(start.shape, -LARGEST_LOG_SLOPE), np.full(start.shape, LARGEST_LOG_SLOPE)
        theta, moved = bracketed_newton(short, *ends, start, absolute=QUADRATIC)
        return np.where((moved <= QUADRATIC) & (np.abs(theta) <= 0.99 * LARGEST_LOG_SLOPE), theta, np.nan)


def _direction(log_slope: np.ndarray, sign: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """c, c - 1 and s of the direction whose slope has the given logarithm and sign, each to full relative accuracy."""
    slope = np.exp(log_slope)
    radius = np.hypot(1.0, slope)
    c, s = 1 / radius, slope / radius
    return c, -s * s / (1 + c), sign * s
