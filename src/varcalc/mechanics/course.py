"""A state carried over a span of time: known everywhere, and held against the same carried more carefully."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from varcalc import integrators
from varcalc.integrators import Engine, Flow
from varcalc.integrators.protocol import Run, RunOutcome
from varcalc.mechanics.motion import CHECKED_TIMES, Checkpoints

FEW_STEPS, MOST_STEPS = 4000, 100_000_000
"""Of a motion that is over before code that runs fast is compiled, and of any."""
STEP_ROUND_OFF = 4 * float(np.finfo(float).eps)
"""Of the coordinates: what a step adds at random."""
ERROR_MARGIN = 8.0
"""By how many times the difference of two integrations either may be off, where motions part."""


@dataclass(frozen=True)
class Course:
    """A ``run`` with the ``trajectory`` to ``reached``; its ``states`` (k, N) at the times ``looked`` (k,) at.

    ``careful`` (k, N) are those of a more careful run.
    """

    run: Run
    trajectory: Callable[[np.ndarray], np.ndarray]
    reached: float
    looked: np.ndarray
    states: np.ndarray
    careful: np.ndarray

    def error(self, columns: slice, size: float) -> float:
        """How far off the ``columns`` of the states, which are of this ``size``, may be anywhere."""
        apart = float(np.nanmax(np.abs(self.careful[:, columns] - self.states[:, columns])))
        return ERROR_MARGIN * apart + STEP_ROUND_OFF * self.run.steps**0.5 * size


def course(flow: Callable[[Engine], Flow], state: np.ndarray, numbers: np.ndarray, span: tuple[float, float]) -> Course:
    """A ``state`` (N,) carried over the ``span`` by the ``flow`` of an engine.

    Raises ValueError where it cannot begin.
    """
    first, end = span
    flying, looked = flow(integrators.for_one(FEW_STEPS, quick=True)), np.linspace(first, end, CHECKED_TIMES)
    run = flying.trajectory(looked, state, numbers, dense=True)
    if run.outcome is RunOutcome.TOO_MANY_STEPS:  # worth code that runs fast
        flying = flow(integrators.for_one(MOST_STEPS, quick=False))
        run = flying.trajectory(looked, state, numbers)
        run = replace(run, trajectory=Checkpoints(flying, numbers, looked, run.states))
    if run.trajectory is None or run.outcome is RunOutcome.NOT_FINITE:
        raise ValueError(f"the motion cannot begin: {run.outcome.value}")
    reached, states = end if run.completed else run.reached, run.states
    if reached != end:
        looked = np.linspace(first, reached, CHECKED_TIMES)
        states = run.trajectory(looked)
    half = (reached - first) / (2 * run.steps + 1)
    careful = flying.trajectory(looked, state, numbers, level=1, longest=half).states
    known = np.all(np.isfinite(states), axis=1)  # what leaves every bound may do so at the last of these times
    return Course(run, run.trajectory, reached, looked[known], states[known], careful[known])
