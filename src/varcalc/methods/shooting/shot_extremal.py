"""From converged segments to an extremal: its trajectories, its value, and how far both can be trusted.

The unknowns are corrected once more on a finer integration, and what a still
finer one would change, with the mismatch left and round-off, is the error claimed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from varcalc.methods.answer import Extremal, cost_between
from varcalc.methods.shooting.newton import size
from varcalc.methods.shooting.segments import Mismatch, Segments
from varcalc.methods.shooting.shots import Failure, Shots, Trajectories
from varcalc.solution import ErrorEstimate
from varcalc.symbolic.evaluation import in_columns

SHRINKING = 0.5
"""Newton's steps shrink by less than this next to a zero (Kantorovich), and never next to a fold without one."""
MISMATCH_ROUND_OFF = 256 * float(np.finfo(float).eps)
"""Relative size of a mismatch in the next evaluation that rounding alone explains."""
LEFT_OPEN = 1e-13
"""A mismatch, relative to its row of the Jacobian, that rounding does not explain where errors do not grow."""
CORRECTIONS = 30
"""Newton's steps on the fine integration, at most: next to a fold each does no more than halve the distance."""
LAST_STEP = 1e-8
"""A relative step whose square is round-off: no other is needed."""
INTEGRAL_ROUND_OFF = 4 * float(np.finfo(float).eps)
"""Relative error of a sum of running integrals, and of a state, that rounding alone explains."""


@dataclass(frozen=True)
class ShotCurve:
    """The curve of all segments together."""

    segments: Segments
    x: np.ndarray
    states: Trajectories
    _latest: list[tuple[np.ndarray, list[np.ndarray]]] = field(default_factory=list, repr=False, compare=False)

    def _tower(self, s: np.ndarray) -> list[np.ndarray]:
        """y, y', ... at s, which are asked for one after the other."""
        if not (self._latest and np.array_equal(self._latest[0][0], s)):
            equations, (a, b) = self.segments.equations, self.segments.equations.form.span
            states, units = self.states((s - a) / (b - a)), self.segments.scales.ordinates[:, None]
            self._latest[:] = [(s.copy(), equations.derivatives(states, units))]
        return self._latest[0][1]

    def evaluate(self, s: np.ndarray, derivative: int) -> np.ndarray:
        """The derivative of the unknown functions at s (m,), shape (n, m); up to the order of the equation."""
        equations = self.segments.equations
        form, n = equations.form, equations.form.n
        order = 2 * form.order
        if derivative > order:
            raise ValueError(f"derivatives up to order {order} are at hand, not {derivative}")
        tower = self._tower(s)
        if derivative < order:
            return tower[derivative]
        _, unknowns, lambdas, _ = self.segments.parts(self.x)
        numbers = in_columns(len(s), form.problem.parameter_values, unknowns, lambdas)
        return np.asarray(equations.highest(s[None, :], *tower, *numbers)).reshape(n, -1)


@dataclass(frozen=True)
class Finished:
    """An extremal with its value (of ``form.functional``, with the cost of the ends) and the errors claimed.

    ``growth`` is the largest magnification of an error across one segment,
    ``condition`` the condition number of the segments' linear system.
    """

    extremal: Extremal
    value: float
    error: ErrorEstimate
    growth: float
    condition: float


def finish(segments: Segments, x: np.ndarray, floor: np.ndarray) -> Finished | Failure:
    """Correct x on a finer integration; what a still finer one would change tells what that is worth.

    ``floor`` (M,) are the sizes of the unknowns.
    """
    kept = corrected(segments, x, floor)
    if isinstance(kept, Failure):
        return kept
    x, at = kept.x, kept.at
    check = segments.evaluate(x, level=2, taken=at.steps)
    if isinstance(check, Failure):
        return check
    _, unknowns, lambdas, _ = segments.parts(x)
    form = segments.equations.form
    a, b = form.span
    vertices = a + (b - a) * segments.vertices
    states = segments.paths(x, 1, 0).trajectories()
    if isinstance(states, Failure):
        return states
    curve = ShotCurve(segments, x, states)
    extremal = Extremal(form, curve.evaluate, unknowns, vertices, lambdas, {})
    value, error = value_of(segments, x, at.shots), ErrorEstimate(math.inf, math.inf)
    step = segments.solve(check, -check.residual, np.maximum(np.abs(x), floor))
    if step is not None and _matches(segments, kept, floor):
        states, unknown, lambda_, _ = segments.parts(step)
        better = check.shots.moved(states, np.concatenate([unknown, lambda_]))
        change = abs(value - value_of(segments, x + step, better))
        left_over = change + _mismatch(segments, x, at) + _rounding(segments, x, at, value)
        error = ErrorEstimate(left_over, _curve_error(segments, at, better))
    return Finished(extremal, value, error, float(at.growth.max()), at.jacobian.condition)


@dataclass(frozen=True)
class Corrected:
    """The unknowns after Newton's steps, what the segments give there, and the size of the last step."""

    x: np.ndarray
    at: Mismatch
    step: float


def corrected(segments: Segments, x: np.ndarray, floor: np.ndarray) -> Corrected | Failure:
    """x after Newton's steps on the fine integration; the x at which no step leads anywhere."""
    at = segments.evaluate(x, level=1, taken=0)
    last = math.inf
    for _ in range(CORRECTIONS):
        if isinstance(at, Failure):
            return at
        step = segments.solve(at, -at.residual, np.maximum(np.abs(x), floor))
        if step is None or size(step, floor) > 1.0:
            return Corrected(x, at, math.inf)
        x, last = x + step, size(step, np.maximum(np.abs(x), floor))
        at = segments.evaluate(x, level=1, taken=0)
        if isinstance(at, Mismatch) and last <= LAST_STEP and segments.left_open(at, x) <= _explained(at):
            break
    return at if isinstance(at, Failure) else Corrected(x, at, last)


def _explained(at: Mismatch) -> float:
    """The mismatch, relative to its row of the Jacobian, that rounding explains."""
    return LEFT_OPEN * max(1.0, float(at.growth.max()))


def _matches(segments: Segments, found: Corrected, floor: np.ndarray) -> bool:
    """Whether the segments match near ``found``, and do not merely come nearest to it next to a fold.

    The next step is measured against the last one, so far as rounding does not explain both.
    """
    if segments.left_open(found.at, found.x) > _explained(found.at):
        return False
    weights = np.maximum(np.abs(found.x), floor)
    step = segments.solve(found.at, -found.at.residual, weights)
    noise = segments.shaken(found.at, found.x, weights, MISMATCH_ROUND_OFF)
    if step is None or noise is None:
        return False
    return size(step, weights) <= max(SHRINKING * found.step, min(size(noise, weights), SHRINKING))


def value_of(segments: Segments, x: np.ndarray, shots: Shots) -> float:
    """The functional with the cost of the ends at x."""
    form, n, units = segments.equations.form, segments.equations.form.n, segments.scales
    total = float(shots.totals(segments.dimension)[0] * units.integrals[0])
    start, end = (z[:n] * units.ordinates for z in (shots.left[0], shots.right[-1]))
    return total + cost_between(form, start, end, segments.parts(x)[1])


def _jumps(segments: Segments, at: Mismatch) -> np.ndarray:
    """The mismatch left of the ordinates (and slopes, at second order) at inner vertices, (N - 1, order n)."""
    D, kept = segments.dimension, segments.dimension // 2
    rows = at.residual[: (segments.count - 1) * D].reshape(-1, D)
    return np.abs(rows[:, :kept])


def _end_misses(segments: Segments, at: Mismatch) -> np.ndarray:
    """By how much the fixed values at the ends are missed, scaled; (order, n), the larger of both ends."""
    form, n = segments.equations.form, segments.equations.form.n
    width = form.span[1] - form.span[0]
    out = np.zeros((form.order, n))
    for fixed, state in ((form.ends.start, at.shots.left[0]), (form.ends.end, at.shots.right[-1])):
        for k in range(form.order):
            demanded = fixed[k] * width**k / segments.scales.ordinates
            miss = np.abs(state[k * n : (k + 1) * n] - demanded)
            out[k] = np.maximum(out[k], np.where(np.isnan(demanded), 0.0, miss))
    return out


def _mismatch(segments: Segments, x: np.ndarray, at: Mismatch) -> float:
    """The first-order effect on the value of the jumps that are left: momentum times jump, summed."""
    equations = segments.equations
    form = equations.form
    a, width = form.span[0], form.span[1] - form.span[0]
    _, unknowns, lambdas, _ = segments.parts(x)
    states = np.concatenate([at.shots.left, at.shots.right[-1:]])[:, : segments.dimension].T
    s = a + width * segments.vertices
    s = np.clip(s, a + equations.inset, a + width - equations.inset)
    tower = equations.derivatives(states, segments.scales.ordinates[:, None])
    numbers = in_columns(len(s), form.problem.parameter_values, unknowns, lambdas)
    with np.errstate(all="ignore"):
        momenta = np.abs(np.asarray(equations.momenta(s[None, :], *tower, *numbers)))
    momenta = np.where(np.isfinite(momenta), momenta, 0.0)
    units = np.concatenate([segments.scales.ordinates / width**k for k in range(form.order)])[:, None]
    weighed = momenta * units
    jumps = np.zeros_like(weighed)
    jumps[:, 1:-1] = _jumps(segments, at).T
    jumps[:, 0] = jumps[:, -1] = 0.5 * _end_misses(segments, at).ravel()
    levels = [
        abs(lam * (at.totals[1 + j] * segments.scales.integrals[1 + j] - c.lower))
        for j, (lam, c) in enumerate(zip(lambdas, form.conditions.integrals, strict=True))
    ]
    return float(sum(levels)) + (float(np.sum(weighed * jumps)) if form.same_functional else 0.0)


def _rounding(segments: Segments, x: np.ndarray, at: Mismatch, value: float) -> float:
    """Round-off of the running integrals, those that are prescribed included: a miss of one costs its multiplier."""
    units, D = segments.scales.integrals, segments.dimension
    parts = float(np.abs(at.shots.right[:, D] - at.shots.left[:, D]).sum())
    lambdas = segments.parts(x)[2]
    levels = np.abs(at.totals * units)[1 : 1 + len(lambdas)]
    return INTEGRAL_ROUND_OFF * (max(abs(value), parts * float(units[0])) + float(np.abs(lambdas) @ levels))


def _curve_error(segments: Segments, at: Mismatch, reference: Shots) -> float:
    """The largest change of the ordinates between two integrations, with the jumps left and round-off."""
    n, units = segments.equations.form.n, segments.scales.ordinates
    own, better = (np.concatenate([s.left[:, :n], s.right[:, :n]]) * units for s in (at.shots, reference))
    jumps = _jumps(segments, at)[:, :n]
    left = float(np.max(jumps * units)) if jumps.size else 0.0
    left = max(left, float(np.max(_end_misses(segments, at)[0] * units)))
    return float(np.abs(better - own).max()) + left + INTEGRAL_ROUND_OFF * float(np.abs(better).max())
