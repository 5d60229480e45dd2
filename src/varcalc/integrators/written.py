"""Steps of few runs, each one call of one function of symbols.

Of one run, the calls of NumPy for each stage of an embedded method take ten times as long as its numbers do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from varcalc.integrators.stops import Interpolant
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

FEW_RUNS = 12
"""Runs that go by one function a step, at most: of more, stages of all of them at once take less."""
LONG_SYSTEM = 1000
"""Instructions of a system, of which each stage takes longer than the calls that a written step spares."""


def worth_writing(system: ca.Function) -> bool:
    """Whether a step of a system can be written as one function, and is not too long for it."""
    return bool(system.is_a("SXFunction")) and system.n_instructions() <= LONG_SYSTEM


def weighted(weights: np.ndarray, slopes: Mapping[int, Expression]) -> Expression:
    """The sum of the slopes that have a weight, as one product: summed one by one they take twice as long to write."""
    used = [int(j) for j in np.flatnonzero(weights) if j in slopes]
    return ca.horzcat(*(slopes[j] for j in used)) @ weights[used]


@dataclass(frozen=True)
class WrittenStep:
    """A step of a method for a system, as functions of columns.

    ``rates(s, Y, constants)`` are dY/ds, ``step(s, end, Y, dY/ds, constants)`` gives state and slope at the end, so
    many ``errors`` (N,), and what ``between`` needs besides: that takes the same and the result of the step, to the
    coefficients of the interpolant. ``measure`` makes one number (m,) of the errors (m, N) in units of the states.
    """

    rates: PointEvaluator
    step: PointEvaluator
    between: PointEvaluator
    errors: int
    measure: Callable[..., np.ndarray]


class WrittenStepper:
    """Memory for a step of ``m`` runs; see :class:`varcalc.integrators.side_by_side.Stepper`."""

    order: Literal["C", "F"] = "C"

    def __init__(self, written: WrittenStep, m: int) -> None:
        step, system = written.step, written.step.function
        self.written, self.size = written, system.numel_in(2)
        self.time, self.end, self.constants = np.zeros((m, 1)), np.zeros((m, 1)), np.zeros((m, system.numel_in(4)))
        self.state, self.slopes = np.zeros((m, self.size)), np.zeros((m, self.size))
        self.result, self.shape = np.zeros((m, step.width)), np.zeros((m, written.between.width))
        begun = [self.time, self.end, self.state, self.slopes, self.constants]
        self.call = step.bound(begun, self.result)
        self.between = written.between.bound([*begun, self.result], self.shape)

    def slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N)."""
        return self.written.rates(len(time), time[:, None], state, self.constants)

    def step(
        self, time: np.ndarray, end: np.ndarray, state: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`varcalc.integrators.side_by_side.Stepper.step`."""
        self.time[:, 0], self.end[:, 0], self.state[:], self.slopes[:] = time, end, state, slope
        self.call()
        return self.result[:, : self.size].copy(), self.result[:, self.size : 2 * self.size].copy()

    def error(self, size: np.ndarray) -> np.ndarray:
        """See :meth:`varcalc.integrators.side_by_side.Stepper.error`."""
        n = self.size
        return self.written.measure(
            *(self.result[:, k * n : (k + 1) * n] / size for k in range(2, 2 + self.written.errors))
        )

    def interpolant(
        self, at: np.ndarray, time: np.ndarray, length: np.ndarray, ends: tuple[np.ndarray, np.ndarray],
        slopes: tuple[np.ndarray, np.ndarray], *, dense: bool,  # noqa: ARG002  the step is known, and always as good
    ) -> Interpolant:  # fmt: skip
        """See :meth:`varcalc.integrators.side_by_side.Stepper.interpolant`."""
        self.between()
        shape = self.shape[at].reshape(len(at), -1, self.size).transpose(1, 0, 2)
        return Interpolant(time[at], length[at], ends[0][at], shape)
