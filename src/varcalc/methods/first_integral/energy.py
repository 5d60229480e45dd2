"""Lagrangians without x: Euler's second equation L - y' L_y' = C reduced to quadrature.

On a monotone branch the slope follows from C at every y, and dx = dy / y'
(Gelfand and Fomin, "Calculus of Variations", sect. 4, case 2). With P(y, v) =
L - v L_v, which decreases with the slope's size where L_vv > 0, the slope
solves

    P(y, 0) - P(y, v) = P(y, 0) - C,

both sides carried as differences from where they vanish, so that a turning
point (v = 0) costs no digits; the distance from it is squared away by the
rule. The action is W + C x with W the integral of L_v dy, whose derivative
by C is -x: an error of C changes it in second order only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.carried import Carried, carry, displaced, fixed
from varcalc.methods.first_integral.integrands import Integrands
from varcalc.methods.first_integral.panels import Panels
from varcalc.symbolic.instructions import Vectorised

NEWTON_STEPS = 80
STEEPEST = 640.0
"""Largest logarithm of a slope: beyond it exp overflows in intermediate results."""
CONVEXITY_PROBES = (-6.0, -2.0, 0.0, 2.0)
"""Logarithms of slopes at which L_vv > 0 is checked; only the first must lie in the domain of L."""
NEARLY = 1e-5
"""A relative miss above this belies a small Newton step: the slope is infinite there."""
QUADRATIC = 1e-8
"""A Newton step below this is the last: convergence is quadratic."""


@dataclass(frozen=True)
class Leg:
    """Part of a monotone branch, measured from its ``anchor``: y = anchor + length * share(t).

    ``anchor`` and ``length`` have one entry for each curve of a batch.
    ``direction`` is the sign of the slope, ``away`` tells whether the curve
    leaves the anchor. C is known by P at ``reference``, from which all changes
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
class Batch:
    """Curves of the same shape: legs in travel order, and C = P(reference, 0) - excess for each curve."""

    legs: tuple[Leg, ...]
    constant: np.ndarray
    excess: np.ndarray
    multipliers: np.ndarray


@dataclass(frozen=True)
class Measured:
    """What a batch integrates to, one entry a curve (NaN where the slope has no solution).

    ``x`` and ``action`` (the integral of L_v dy), ``levels`` the isoperimetric
    integrals; per leg ``log_slope`` and the weighted integrands of x and of the
    Lagrangian function, each (curves, points).
    """

    x: np.ndarray
    action: np.ndarray
    levels: np.ndarray
    log_slope: list[np.ndarray]
    dx: list[np.ndarray]
    dl: list[np.ndarray]
    fields: list[np.ndarray] = field(default_factory=list)


@dataclass(frozen=True)
class AnchorFunctions:
    """The functions of (anchor, displacement, ...) at one kind of anchor."""

    rest: Vectorised
    """(anchor, delta, lambda) -> P(y, 0) and its change from the anchor."""
    slope: Vectorised
    """(anchor, delta, c, c - 1, s, lambda) -> P(y, 0) - P(y, v), P(y, v), and the derivative of the first by log v."""
    value: Vectorised
    """(anchor, delta, c, s, lambda) -> momentum, Lagrangian function, L, the g_j, the partials by parameters."""


class Energy:
    """Slopes and integrals of the extremals of a Lagrangian without x.

    ``orientation`` is -1 where L_vv < 0, and then L is negated throughout.
    ``inside`` is an ordinate inside the domain of L.
    """

    def __init__(self, integrands: Integrands, orientation: float, inside: float) -> None:
        self.integrands = integrands
        self.orientation = orientation
        self.inside = inside
        self._anchors: dict[float | None, AnchorFunctions] = {}

    def functions(self, end: float | None) -> AnchorFunctions:
        """The functions anchored at a singular ``end``, or at any regular point for None."""
        if end not in self._anchors:
            with self.integrands.building:
                self._anchors[end] = self._build(end)
        return self._anchors[end]

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
        results = [rest, -carried.change, first, mixed, ca.gradient(form, s)]
        results += [form, *self.integrands.forms, *self.integrands.partials]
        inputs = [y, c, drop, s, *lam]
        anchor, delta = (ca.SX.sym("anchor") if end is None else ca.SX(end)), ca.SX.sym("delta")
        start = displaced(anchor, delta, self.inside if end is None else self._probe(end))
        others = [fixed(v, probe) for v, probe in zip(inputs[1:], [0.8, -0.2, 0.6, *[0.3] * len(lam)], strict=True)]
        function = ca.Function("all", inputs, [ca.densify(r) for r in results])
        moved = carry(function, [start, *others])
        name = anchor if end is None else ca.SX.sym("anchor")
        return _vectorised(moved, name, delta, [c, drop, s], multipliers)

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
        lam = list(multipliers)
        values = self.rest(y, multipliers)
        for k, log_slope in enumerate(CONVEXITY_PROBES):
            c, drop, s = _direction(np.array(log_slope), 1.0)
            _, _, mixed = self.functions(None).slope(y, 0.0, c, drop, s, lam)
            convex = mixed > 0 if k == 0 else ~(mixed <= 0)
            values = np.where(convex, values, np.nan)
        return values

    def at_slope(
        self, y: np.ndarray, log_slope: np.ndarray, direction: float, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """P(y, 0) - P(y, v) and P(y, v) at the slope scale * exp(log_slope), each to full relative accuracy."""
        c, drop, s = _direction(log_slope, direction)
        excess, value, _ = self.functions(None).slope(y, 0.0, c, drop, s, list(multipliers))
        return excess * np.ones_like(y), value * np.ones_like(y)

    def measure(self, batch: Batch, warm: Sequence[np.ndarray] | None = None) -> Measured:
        """Slopes and integrals along every curve of a batch, from the slopes of a similar batch if given."""
        dx, dl, log_slopes, fields = [], [], [], []
        total_x, action = 0.0, 0.0
        levels = np.zeros((len(self.integrands.levels), len(batch.constant)))
        for k, leg in enumerate(batch.legs):
            share, weights = leg.panels.distances
            delta = leg.length[:, None] * share
            theta, values = self.along(leg, delta, batch, None if warm is None else warm[k])
            c, _, s = _direction(theta, 1.0)
            step = np.abs(leg.length)[:, None] * weights / (self.integrands.scale * s)
            # a leg of no length holds nothing, even where the slope is not defined
            empty = leg.length[:, None] == 0
            values = [np.where(empty, 0.0, v) for v in values]
            step = np.where(empty, 0.0, step)
            momentum, form, *rest = (np.broadcast_to(v, delta.shape) for v in values)
            dx.append(np.where(empty, 0.0, step * c))
            dl.append(step * form)
            fields.append(np.array([step * f for f in rest]))
            log_slopes.append(theta)
            total_x = total_x + dx[-1].sum(axis=1)
            action = action + (np.abs(leg.length)[:, None] * weights * momentum * leg.direction).sum(axis=1)
            levels += fields[-1][1 : 1 + len(levels)].sum(axis=2)
        action = np.asarray(action) / self.integrands.scale
        return Measured(np.asarray(total_x), action, levels, log_slopes, dx, dl, fields)

    def along(
        self, leg: Leg, delta: np.ndarray, batch: Batch, warm: np.ndarray | None
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """The logarithms of the slopes at distances ``delta`` (curves, m) from the anchor, and what holds there."""
        functions = self.functions(leg.end)
        lam = [m[:, None] for m in batch.multipliers]
        if leg.reference is None:
            base = leg.anchor[:, None]
        else:
            base = leg.reference[:, None]
            delta = (leg.anchor - leg.reference)[:, None] + delta
        at_rest, change = (np.broadcast_to(v, delta.shape) for v in functions.rest(base, delta, lam))
        wanted = at_rest - batch.constant[:, None] if leg.reference is None else change + batch.excess[:, None]
        theta = self._slopes(functions, base, delta, leg.direction, lam, batch.constant[:, None], at_rest, wanted, warm)
        c, _, s = _direction(theta, leg.direction)
        return theta, functions.value(base, delta, c, s, lam)

    @staticmethod
    def _slopes(
        functions: AnchorFunctions, anchor: np.ndarray, delta: np.ndarray, direction: float, lam: list[np.ndarray],
        constant: np.ndarray, at_rest: np.ndarray, wanted: np.ndarray, warm: np.ndarray | None,
    ) -> np.ndarray:  # fmt: skip
        """log v by Newton's method on the logarithm of whichever side is small, kept in a bracket.

        Near a turning point the excess P(y, 0) - P(y, v) is small and its logarithm almost linear in log v; where
        L is large (a singular end) P itself is small against P(y, 0) and its logarithm is.
        """
        with np.errstate(all="ignore"):
            steep = (constant > 0) & (at_rest > 2 * constant)
            goal = np.where(steep, -np.log(constant), np.log(wanted))
            theta = np.zeros(delta.shape) if warm is None else np.nan_to_num(warm)
            possible = np.isfinite(goal) & (wanted > 0)
            theta[~possible] = np.nan
            low, high = np.full(delta.shape, -STEEPEST), np.full(delta.shape, STEEPEST)
            moved = np.full(delta.shape, np.inf)
            for _ in range(NEWTON_STEPS):
                c, drop, s = _direction(theta, direction)
                excess, value, slope = functions.slope(anchor, delta, c, drop, s, lam)
                size = np.where(steep, value, excess)
                miss = np.where(steep, -np.log(size), np.log(size)) - goal
                beyond = (miss > 0) | (steep & ~(value > 0)) | np.isnan(miss)
                low, high = np.where(beyond, low, theta), np.where(beyond, theta, high)
                newton = theta - miss * size / slope
                # at round-off the sign of the miss, and so the bracket, means nothing
                settled = (np.abs(newton - theta) <= QUADRATIC) & (np.abs(miss) <= NEARLY)
                inside = ((newton > low) & (newton < high) & np.isfinite(slope)) | settled
                following = np.where(inside, newton, 0.5 * (low + high))
                moved = np.abs(following - theta)
                theta = np.where(possible, following, np.nan)
                if not np.any(moved[possible] > QUADRATIC):
                    break
            else:
                theta[moved > QUADRATIC] = np.nan
            theta[np.abs(theta) > 0.99 * STEEPEST] = np.nan
        return theta


def _vectorised(
    moved: list[Carried], anchor: ca.SX, delta: ca.SX, inputs: list[ca.SX], multipliers: ca.SX
) -> AnchorFunctions:
    c, drop, s = inputs
    rest, excess, first, mixed, momentum, *values = moved
    return AnchorFunctions(
        Vectorised(ca.Function("rest", [anchor, delta, multipliers], [rest.value, rest.change])),
        Vectorised(
            ca.Function("slope", [anchor, delta, c, drop, s, multipliers], [excess.value, first.value, mixed.value])
        ),
        Vectorised(
            ca.Function("value", [anchor, delta, c, s, multipliers], [momentum.value, *(v.value for v in values)])
        ),
    )


def _direction(log_slope: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """c, c - 1 and s of the direction whose slope has the given logarithm and sign, each to full relative accuracy."""
    slope = np.exp(log_slope)
    radius = np.hypot(1.0, slope)
    c, s = 1 / radius, slope / radius
    return c, -s * s / (1 + c), sign * s
