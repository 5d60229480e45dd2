"""A state carried over a span of time: known everywhere, and held against the same carried more carefully."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from varcalc import integrators
from varcalc.integrators import Engine, Flow
from varcalc.integrators.protocol import Run, RunOutcome
from varcalc.mechanics.motion import CHECKED_TIMES, Checkpoints
from varcalc.progress import Progress, Telling, telling

PART = 16
"""Of the times at which a long motion is looked at: how many lie between two at which it may be stopped."""
FEW_STEPS, MOST_STEPS = 4000, 100_000_000
"""Of a motion that is over before code that runs fast is compiled, and of any."""
NO_FARTHER = 1e-9
"""Of how far a run has come: what another is ahead that comes no farther."""
STEP_ROUND_OFF = 4 * float(np.finfo(float).eps)
"""Of the coordinates: what a step adds at random."""
ERROR_MARGIN = 8.0
"""By how many times the difference of two integrations either may be off, where motions part."""


@dataclass(frozen=True)
class Course:
    """A ``run`` with the ``trajectory`` to ``reached``; its ``states`` (k, N) at the times ``looked`` (k,) at.

    ``careful`` (k, N) are those of a more careful run; ``stopped`` tells that Ctrl-C ended it at ``reached``.
    """

    run: Run
    trajectory: Callable[[np.ndarray], np.ndarray]
    reached: float
    looked: np.ndarray
    states: np.ndarray
    careful: np.ndarray
    stopped: bool = False

    def error(self, columns: slice, size: float) -> float:
        """How far off the ``columns`` of the states, which are of this ``size``, may be anywhere."""
        apart = float(np.nanmax(np.abs(self.careful[:, columns] - self.states[:, columns])))
        return ERROR_MARGIN * apart + STEP_ROUND_OFF * self.run.steps**0.5 * size


def course(
    flow: Callable[[Engine], Flow], state: np.ndarray, numbers: np.ndarray, span: tuple[float, float],
    progress: Progress = None,
) -> Course:  # fmt: skip
    """A ``state`` (N,) carried over the ``span`` by the ``flow`` of an engine; a long one tells how far it has come.

    Raises ValueError where it cannot begin.
    """
    first, end = span
    with telling(progress, "motion") as told:
        flying, looked = flow(integrators.for_one(FEW_STEPS, quick=True)), np.linspace(first, end, CHECKED_TIMES)
        run, careful, stopped = flying.trajectory(looked, state, numbers, dense=True), None, False
        if run.outcome is RunOutcome.TOO_MANY_STEPS:  # worth code that runs fast
            flying = flow(integrators.for_one(MOST_STEPS, quick=False))
            again, careful, stopped = _in_parts(flying, state, numbers, looked, told)
            # where pieces are too many, parts lead no farther than the whole, which is known between as well
            farther = abs(again.reached - run.reached) > NO_FARTHER * abs(run.reached - first)
            if again.outcome is not RunOutcome.TOO_MANY_STEPS or farther:
                looked = again.abscissae
                run = replace(again, trajectory=Checkpoints(flying, numbers, looked, again.states))
    if run.trajectory is None or run.outcome is RunOutcome.NOT_FINITE:
        raise ValueError(f"the motion cannot begin: {run.outcome.value}")
    states = run.states
    if not run.completed:
        looked, careful = np.linspace(first, run.reached, CHECKED_TIMES), None
        states = run.trajectory(looked)
    if careful is None:
        half = (run.reached - first) / (2 * run.steps + 1)
        careful = flying.trajectory(looked, state, numbers, level=1, longest=half).states
    known = np.all(np.isfinite(states), axis=1)  # what leaves every bound may do so at the last of these times
    return Course(run, run.trajectory, run.reached, looked[known], states[known], careful[known], stopped)


def _in_parts(
    flying: Flow, state: np.ndarray, numbers: np.ndarray, looked: np.ndarray, told: Telling
) -> tuple[Run, np.ndarray | None, bool]:
    """A run through the times ``looked`` (k,) at, the states (k, N) of a more careful one, and whether Ctrl-C ended it.

    Both are carried side by side, so that what is known when it is stopped has its claim. What ends before the last
    time has no more careful run yet.
    """
    states, careful = (np.full((len(looked), len(state)), np.nan) for _ in range(2))
    states[0] = careful[0] = state
    steps, done = 0, 0
    try:
        for low, high in told.over(list(pairwise(range(0, len(looked), PART)))):
            part = looked[low : high + 1]
            run = flying.trajectory(part, states[low], numbers)
            states[low : high + 1], steps = run.states, steps + run.steps
            if not run.completed:
                return Run(looked, states, run.outcome, run.reached, steps), None, False
            half = (part[-1] - part[0]) / (2 * run.steps + 1)
            careful[low : high + 1] = flying.trajectory(part, careful[low], numbers, level=1, longest=half).states
            done = high
    except KeyboardInterrupt:
        if done == 0:
            raise
        known = slice(done + 1)
        return Run(looked[known], states[known], RunOutcome.COMPLETED, float(looked[done]), steps), careful[known], True
    return Run(looked, states, RunOutcome.COMPLETED, float(looked[-1]), steps), careful, False
