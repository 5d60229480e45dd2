"""Newton's iteration that makes the segments match: what it measures, and when it gives up.

A trial that cannot be integrated counts as one that made no progress.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from varcalc.methods.shooting.segments import Mismatch, Segments
from varcalc.methods.shooting.shots import Failure
from varcalc.numerics.damped_newton import CONVERGED, Ending, LinearisedEquations, damped_newton

LEFT_OPEN, LEFT_BY_LOOK = 1e-6, 1e-3
"""A residual, relative to its row of the Jacobian, that a convergent iteration leaves only in a singular system; that
of a look."""
SHOT_ITERATIONS = 40
RUN_AWAY = 1e10
"""Scaled states beyond which an iteration has run away."""
DIGITS_LOST = 1e6
"""Growth across a segment that leaves a residual for want of digits."""
LOOK = -1
"""The level of integrations that tell where an extremal is, and not yet what it is."""
LOOKED = 1e-4
"""The relative correction after which one more step leaves what a look does not see."""


class Termination(Enum):
    """How the iteration ended, in words."""

    CONVERGED = "converged"
    FAILED = "an integration failed at the start"
    DAMPED_OUT = "no step brings the segments nearer to each other"
    RUNAWAY = "the iteration runs away to infinity"
    SINGULAR = "the linear system is singular"
    TOO_MANY = "too many iterations"
    GROWTH = "errors grow too much across a segment"


@dataclass(frozen=True)
class Matched:
    """Where the iteration ended: the unknowns and their evaluation, the size of the last correction.

    ``failure`` is the last integration that failed, if any did.
    """

    x: np.ndarray
    at: Mismatch | None
    ending: Termination
    correction: float
    iterations: int
    failure: Failure | None = None


def size(correction: np.ndarray, weights: np.ndarray) -> float:
    """Root mean square of a correction relative to the sizes of the unknowns."""
    return float(np.sqrt(np.mean((correction / weights) ** 2))) if len(correction) else 0.0


class _Matching:
    """The mismatch of segments, as :func:`damped_newton` takes it; keeps the last failure and why it gave up."""

    def __init__(self, segments: Segments, floor: np.ndarray, most_growth: float, most_work: int, level: int) -> None:
        self.segments, self.floor, self.most_growth, self.most_work = segments, floor, most_growth, most_work
        self.level = level
        self.failure: Failure | None = None
        self.given_up: Termination | None = None

    def evaluate(self, z: np.ndarray) -> Mismatch | None:
        """The mismatch at unknowns ``z`` (N,); None where a segment fails or no work is left."""
        runs_back = self.segments.equations.form.runs_back(self.segments.parts(z)[1])
        if runs_back or self.segments.work.total >= self.most_work:
            return None
        at = self.segments.evaluate(z, level=self.level)
        if isinstance(at, Failure):
            self.failure = at
            return None
        return at

    def linearised(self, z: np.ndarray, at: Mismatch) -> LinearisedEquations[Mismatch] | None:
        """The linear equations of a step from ``z`` (N,); None where there is no point in one."""
        self.given_up = self._hopeless(z, at)
        if self.given_up:
            return None
        weights = np.maximum(np.abs(z), self.floor)
        return LinearisedEquations(
            lambda point: self.segments.solve(at, -point.residual, weights), lambda step: size(step, weights)
        )

    def _hopeless(self, z: np.ndarray, at: Mismatch) -> Termination | None:
        """Why there is no point in going on from z, if so."""
        if at.growth.max() > self.most_growth:
            return Termination.GROWTH
        if np.abs(self.segments.parts(z)[0]).max() > RUN_AWAY:
            return Termination.RUNAWAY
        return Termination.TOO_MANY if self.segments.work.total >= self.most_work else None


TERMINATIONS = {
    Ending.CONVERGED: Termination.CONVERGED,
    Ending.SINGULAR: Termination.SINGULAR,
    Ending.DAMPED_OUT: Termination.DAMPED_OUT,
    Ending.TOO_MANY: Termination.TOO_MANY,
}


def iterate(
    segments: Segments, x: np.ndarray, floor: np.ndarray, most_growth: float, budget: int, level: int = 0
) -> Matched:
    """Bring the mismatch of ``segments`` to zero from ``x`` (M,).

    ``floor`` (M,) are the smallest sizes the unknowns are measured by. The
    iteration stops with GROWTH when a segment magnifies errors by more than
    ``most_growth``, and with TOO_MANY after the work of ``budget`` runs, each of which is integrated at ``level``.
    """
    most_work = segments.work.total + budget
    at = segments.evaluate(x, level=level, every=True)
    if isinstance(at, Failure):
        return Matched(x, None, Termination.FAILED, np.inf, 0, at)
    matching = _Matching(segments, floor, most_growth, most_work, level)
    result = damped_newton(matching, x, at, SHOT_ITERATIONS, LOOKED if level == LOOK else CONVERGED)
    ending = matching.given_up or TERMINATIONS[result.ending]
    allowed = LEFT_BY_LOOK if level == LOOK else LEFT_OPEN
    lost = result.at.growth.max() > DIGITS_LOST
    if ending is Termination.CONVERGED and not (lost or segments.left_open(result.at, result.z) < allowed):
        ending = Termination.SINGULAR
    return Matched(result.z, result.at, ending, result.correction, result.iterations, matching.failure)
