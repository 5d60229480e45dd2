"""Damped Newton's method that does not depend on how the equations are scaled.

The natural monotonicity test and the damping strategy of P. Deuflhard,
"Newton Methods for Nonlinear Problems" (2004), sect. 3.3 (algorithm NLEQ-ERR):
progress is measured by Newton corrections, never by residuals, as SciPy's `root` does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Generic, Protocol, TypeVar

import numpy as np

P = TypeVar("P")

CONVERGED = 1e-9
"""Relative correction after which one more step leaves only round-off."""
NOISY_CORRECTION = 1e-6
"""A correction below this that no longer shrinks is round-off, or an integrator's noise, not the iteration's."""
CONTRACTION = 0.3
"""A small correction that shrank by less than this factor is noise."""
SMALLEST_DAMPING = 1e-6
LONGER = 4.0
"""A step is tried again longer when the curvature just measured allows so many times its length."""


@dataclass(frozen=True)
class LinearisedEquations(Generic[P]):
    """The equations linearised at a point.

    ``correction(point)`` is -J^-1 F(point), J being kept; None, or not a
    number, where J is singular. ``measure`` gives the size of a correction
    relative to that of the unknowns.
    """

    correction: Callable[[P], np.ndarray | None]
    measure: Callable[[np.ndarray], float]


class Equations(Protocol[P]):
    """Equations F(z) = 0, known by what they give at points P."""

    def evaluate(self, z: np.ndarray) -> P | None:
        """The equations at z (M,); None where z is out of the question."""
        ...

    def linearised(self, z: np.ndarray, at: P) -> LinearisedEquations[P] | None:
        """The equations linearised at a point already evaluated; None to give up there."""
        ...


class Ending(Enum):
    """How an iteration ended."""

    CONVERGED = auto()
    GIVEN_UP = auto()
    """The equations gave up at a point."""
    SINGULAR = auto()
    DAMPED_OUT = auto()
    """No step along the Newton direction brings the equations nearer to being met."""
    TOO_MANY = auto()


@dataclass(frozen=True)
class Result(Generic[P]):
    """Where an iteration ended: the unknowns, what the equations give there, the size of the last correction."""

    z: np.ndarray
    at: P
    ending: Ending
    correction: float
    iterations: int


@dataclass(frozen=True)
class _Accepted(Generic[P]):
    """A damped step: where it led, and the simplified correction there."""

    damping: float
    z: np.ndarray
    at: P
    following: np.ndarray


def damped_newton(
    equations: Equations[P], z: np.ndarray, at: P, iterations: int, converged: float = CONVERGED
) -> Result[P]:
    """Iterate from ``z`` (M,), where the equations give ``at``, at most so many times.

    A relative correction within ``converged`` is the last one.
    """
    damping, length, last = 1.0, math.inf, None
    for iteration in range(1, iterations + 1):
        linearised = equations.linearised(z, at)
        if linearised is None:
            return Result(z, at, Ending.GIVEN_UP, length, iteration)
        step, measure = linearised.correction(at), linearised.measure
        before, length = length, math.inf if step is None else measure(step)
        if step is None or not math.isfinite(length):
            return Result(z, at, Ending.SINGULAR, before, iteration)
        if length <= converged or (length <= NOISY_CORRECTION and length > CONTRACTION * before):
            return _finished(equations, z + step, Result(z, at, Ending.CONVERGED, length, iteration))
        if last is not None:
            change = measure(last - step)
            damping = min(1.0, damping * before * measure(last) / max(change * length, 1e-300))
        accepted = _search(equations, linearised, z, step, length, damping)
        if accepted is None:
            ending = Ending.CONVERGED if length <= NOISY_CORRECTION else Ending.DAMPED_OUT
            return Result(z, at, ending, length, iteration)
        damping, z, at, last = accepted.damping, accepted.z, accepted.at, accepted.following
        if damping == 1.0 and measure(last) <= converged:
            return _finished(equations, z + last, Result(z, at, Ending.CONVERGED, measure(last), iteration))
    return Result(z, at, Ending.TOO_MANY, length, iterations)


def _finished(equations: Equations[P], z: np.ndarray, otherwise: Result[P]) -> Result[P]:
    """The end of a convergent iteration after its last step, if that can be evaluated."""
    at = equations.evaluate(z)
    return otherwise if at is None else Result(z, at, Ending.CONVERGED, otherwise.correction, otherwise.iterations)


def _search(
    equations: Equations[P],
    linearised: LinearisedEquations[P],
    z: np.ndarray,
    step: np.ndarray,
    length: float,
    damping: float,
) -> _Accepted[P] | None:
    """The damped step that passes the natural monotonicity test: the simplified correction is the smaller one."""
    damping, settled = max(damping, SMALLEST_DAMPING), False
    while damping >= SMALLEST_DAMPING:
        trial = z + damping * step
        at = equations.evaluate(trial)
        if at is None:
            damping, settled = 0.5 * damping, True
            continue
        following = linearised.correction(at)
        if following is None:
            return None
        curvature = linearised.measure(following - (1.0 - damping) * step)
        ideal = 0.5 * length * damping**2 / max(curvature, 1e-300)
        after = linearised.measure(following)
        if not after < (1.0 - 0.25 * damping) * length and not after <= NOISY_CORRECTION:
            damping, settled = min(ideal, 0.5 * damping) if math.isfinite(ideal) else 0.5 * damping, True
            continue
        if not settled and min(1.0, ideal) >= LONGER * damping:
            damping, settled = min(1.0, ideal), True
            continue
        return _Accepted(damping, trial, at, following)
    return None
