"""Newton's iteration that makes the segments match: what it measures, and when it gives up.

A trial that cannot be integrated counts as one that made no progress.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from varcalc.methods.shooting.segments import Evaluation, Segments
from varcalc.methods.shooting.shots import Failure
from varcalc.numerics import damped_newton
from varcalc.numerics.damped_newton import Linearised

LEFT_OPEN = 1e-6
"""A residual, relative to its row of the Jacobian, that a convergent iteration leaves only in a singular system."""
ITERATIONS = 40
FAR = 1e10
"""Scaled states beyond which an iteration has run away."""
LOST = 1e6
"""Growth across a segment that leaves a residual for want of digits."""


class Ending(Enum):
    """How the iteration ended, in words."""

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

    ``failure`` is the last integration that failed, if any did.
    """

    x: np.ndarray
    at: Evaluation | None
    ending: Ending
    correction: float
    iterations: int
    failure: Failure | None = None


def size(correction: np.ndarray, weights: np.ndarray) -> float:
    """Root mean square of a correction relative to the sizes of the unknowns."""
    return float(np.sqrt(np.mean((correction / weights) ** 2))) if len(correction) else 0.0


class _Matching:
    """The mismatch of segments, as :func:`damped_newton` takes it; keeps the last failure and why it gave up."""

    def __init__(self, segments: Segments, floor: np.ndarray, most_growth: float, most_work: int) -> None:
        self.segments, self.floor, self.most_growth, self.most_work = segments, floor, most_growth, most_work
        self.failure: Failure | None = None
        self.given_up: Ending | None = None

    def evaluate(self, z: np.ndarray) -> Evaluation | None:
        runs_back = self.segments.equations.form.runs_back(self.segments.parts(z)[1])
        if runs_back or self.segments.work.total >= self.most_work:
            return None
        at = self.segments.evaluate(z)
        if isinstance(at, Failure):
            self.failure = at
            return None
        return at

    def linearised(self, z: np.ndarray, at: Evaluation) -> Linearised[Evaluation] | None:
        self.given_up = self._hopeless(z, at)
        if self.given_up:
            return None
        weights = np.maximum(np.abs(z), self.floor)
        return Linearised(
            lambda point: self.segments.solve(at, -point.residual, weights), lambda step: size(step, weights)
        )

    def _hopeless(self, z: np.ndarray, at: Evaluation) -> Ending | None:
        """Why there is no point in going on from z, if so."""
        if at.growth.max() > self.most_growth:
            return Ending.GROWTH
        if np.abs(self.segments.parts(z)[0]).max() > FAR:
            return Ending.RUNAWAY
        return Ending.TOO_MANY if self.segments.work.total >= self.most_work else None


ENDINGS = {
    damped_newton.Ending.CONVERGED: Ending.CONVERGED,
    damped_newton.Ending.SINGULAR: Ending.SINGULAR,
    damped_newton.Ending.DAMPED_OUT: Ending.DAMPED_OUT,
    damped_newton.Ending.TOO_MANY: Ending.TOO_MANY,
}


def iterate(segments: Segments, x: np.ndarray, floor: np.ndarray, most_growth: float, budget: int) -> Result:
    """Bring the mismatch of ``segments`` to zero from ``x`` (M,).

    ``floor`` (M,) are the smallest sizes the unknowns are measured by. The
    iteration stops with GROWTH when a segment magnifies errors by more than
    ``most_growth``, and with TOO_MANY after the work of ``budget`` runs.
    """
    most_work = segments.work.total + budget
    at = segments.evaluate(x, every=True)
    if isinstance(at, Failure):
        return Result(x, None, Ending.FAILED, np.inf, 0, at)
    matching = _Matching(segments, floor, most_growth, most_work)
    result = damped_newton.damped_newton(matching, x, at, ITERATIONS)
    ending = matching.given_up or ENDINGS[result.ending]
    lost = result.at.growth.max() > LOST
    if ending is Ending.CONVERGED and not (lost or segments.left_open(result.at, result.z) < LEFT_OPEN):
        ending = Ending.SINGULAR
    return Result(result.z, result.at, ending, result.correction, result.iterations, matching.failure)
