"""Damped Newton's method that does not depend on how the equations are scaled.

The natural monotonicity test and the damping strategy of P. Deuflhard,
"Newton Methods for Nonlinear Problems", sect. 3.3.3 (algorithm NLEQ-ERR):
progress is measured by simplified Newton corrections, never by residuals. A
trial that cannot be integrated counts as one that made no progress.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from varcalc.methods.initial_value.segments import Evaluation, Failure, Segments

CONVERGED = 1e-15
"""Relative correction below which nothing is left to correct."""
NOISE = 1e-6
"""A correction below this that no longer shrinks is the integrator's noise, not the iteration's."""
CONTRACTION = 0.3
"""A small correction that shrank by less than this factor is noise."""
SMALLEST = 1e-5
"""Smallest damping factor."""
SHRINK = 0.5
"""Damping falls at least by this factor after a rejected trial."""
ITERATIONS = 40
FAR = 1e10
"""Scaled states beyond which an iteration has run away."""
LOST = 1e6
"""Growth across a segment that leaves a residual for want of digits."""


class Ending(Enum):
    """How the iteration ended."""

    CONVERGED = "converged"
    FAILED = "an integration failed at the start"
    DAMPED_OUT = "no step brings the segments nearer to each other"
    RUNAWAY = "the iteration runs away to infinity"
    SINGULAR = "the linear system is singular"
    TOO_MANY = "too many iterations"
    GROWTH = "errors grow too much across a segment"


@dataclass(frozen=True)
class Result:
    """Where the iteration ended: the unknowns and their evaluation, the size of the last correction.

    ``failure`` is the last integration that failed, if any did;
    ``evaluations`` counts how often all segments were integrated.
    """

    x: np.ndarray
    at: Evaluation | None
    ending: Ending
    correction: float
    iterations: int
    evaluations: int
    failure: Failure | None = None


def size(correction: np.ndarray, weights: np.ndarray) -> float:
    """Root mean square of a correction relative to the sizes of the unknowns."""
    return float(np.sqrt(np.mean((correction / weights) ** 2))) if len(correction) else 0.0


def iterate(segments: Segments, x: np.ndarray, floor: np.ndarray, most_growth: float, budget: int) -> Result:
    """Bring the mismatch of ``segments`` to zero from ``x`` (M,).

    ``floor`` (M,) are the smallest sizes the unknowns are measured by. The
    iteration stops with GROWTH when a segment magnifies errors by more than
    ``most_growth``, and with TOO_MANY after ``budget`` evaluations.
    """
    at = segments.evaluate(x, every=True)
    if isinstance(at, Failure):
        return Result(x, None, Ending.FAILED, np.inf, 0, 1, at)
    damping, correction, failure, spent = 1.0, np.inf, None, 1
    for iteration in range(1, ITERATIONS + 1):
        ending = _hopeless(segments, x, at, most_growth, spent >= budget)
        weights = np.maximum(np.abs(x), floor)
        step = None if ending else segments.solve(at, -at.residual, weights)
        if step is None:
            return Result(x, at, ending or Ending.SINGULAR, correction, iteration, spent, failure)
        before, correction = correction, size(step, weights)
        noise = correction < NOISE and correction > CONTRACTION * before
        if correction < CONVERGED or noise:
            met = segments.left_open(at, x) < NOISE or at.growth.max() > LOST
            ending = Ending.CONVERGED if met else Ending.SINGULAR
            return Result(x, at, ending, correction, iteration, spent, failure)
        found = _search(segments, x, at, step, weights, damping)
        failure, spent = found.failure or failure, spent + found.trials
        if found.at is None:
            return Result(x, at, Ending.DAMPED_OUT, correction, iteration, spent, failure)
        x, at, damping = found.x, found.at, found.damping
    return Result(x, at, Ending.TOO_MANY, correction, ITERATIONS, spent, failure)


def _hopeless(segments: Segments, x: np.ndarray, at: Evaluation, most_growth: float, spent: bool) -> Ending | None:
    """Why there is no point in going on from x, if so."""
    if at.growth.max() > most_growth:
        return Ending.GROWTH
    if np.abs(segments.parts(x)[0]).max() > FAR:
        return Ending.RUNAWAY
    return Ending.TOO_MANY if spent else None


@dataclass(frozen=True)
class _Step:
    """A damped step: where it led (``at`` is None when nowhere), and the damping to begin with next."""

    x: np.ndarray
    at: Evaluation | None
    damping: float
    trials: int
    failure: Failure | None


def _search(
    segments: Segments, x: np.ndarray, at: Evaluation, step: np.ndarray, weights: np.ndarray, damping: float
) -> _Step:
    """A damped step whose simplified correction is the smaller one."""
    length = size(step, weights)
    failure, settled, trials = None, False, 0
    while damping >= SMALLEST:
        following = x + damping * step
        trial = segments.evaluate(following)
        trials += 1
        if isinstance(trial, Failure):
            failure, settled = trial, True
            damping *= SHRINK * SHRINK
            continue
        simplified = segments.solve(at, -trial.residual, weights)
        if simplified is None:
            break
        curvature = size(simplified - (1 - damping) * step, weights)
        ideal = np.inf if curvature == 0.0 else 0.5 * length * damping**2 / curvature
        if size(simplified, weights) > (1 - damping / 4) * length and length > NOISE:
            damping, settled = min(float(ideal), SHRINK * damping), True
            continue
        better = min(1.0, float(ideal))
        if not settled and better >= 4 * damping:  # the curvature just measured allows a longer step
            damping, settled = better, True
            continue
        return _Step(following, trial, max(better, SMALLEST), trials, failure)
    return _Step(x, None, damping, trials, failure)
