"""Many initial values carried to abscissae of their own: nothing has to be looked for on the way."""

from __future__ import annotations

import copy
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from varcalc.integrators.protocol import NONE, OUTCOMES, Flow, Landing, Outcome
from varcalc.integrators.threads import threads_for

COMPLETED = OUTCOMES.index(Outcome.COMPLETED)


@dataclass(frozen=True)
class OneByOne:
    """Any engine's flow, run by run."""

    flow: Flow

    def run(self, states: np.ndarray, constants: np.ndarray, until: np.ndarray) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Fleet.run`."""
        m = len(states)
        landing = Landing(np.array(states), np.zeros(m), np.zeros(m, np.int8), np.full(m, NONE, np.int16))
        for row in np.flatnonzero(until > 0):
            run = self.flow.run(np.array([0.0, until[row]]), states[row], constants[row])
            landing.outcomes[row] = OUTCOMES.index(run.outcome)
            if run.completed:
                landing.states[row], landing.reached[row] = run.states[-1], until[row]
        return landing


@dataclass(frozen=True)
class TaylorFleet:
    """heyoka's batch integrator; a batch in which one run fails is run again one by one.

    ``alone`` compiles the flow for those.
    """

    integrator: Any
    alone: Callable[[], Flow]
    most_steps: int

    def run(self, states: np.ndarray, constants: np.ndarray, until: np.ndarray) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Fleet.run`; the batches are spread over the cores."""
        m, size = len(states), self.integrator.batch_size
        landing = Landing(np.array(states), np.zeros(m), np.zeros(m, np.int8), np.full(m, NONE, np.int16))
        batches = [np.minimum(np.arange(k, k + size), m - 1) for k in range(0, m, size)]
        threads = threads_for(m)

        def share(number: int) -> None:
            integrator = copy.deepcopy(self.integrator) if number else self.integrator
            for lanes in batches[number::threads]:
                self._batch(integrator, lanes, states, constants, until, landing)

        if threads == 1:
            share(0)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(share, range(threads)))
        short = np.flatnonzero((landing.reached != until) | ~np.all(np.isfinite(landing.states), axis=1))
        if len(short):
            again = self._one_by_one.run(states[short], constants[short], until[short])
            landing.states[short], landing.reached[short] = again.states, again.reached
            landing.outcomes[short] = again.outcomes
        return landing

    def _batch(
        self, integrator: Any, lanes: np.ndarray, states: np.ndarray, constants: np.ndarray, until: np.ndarray,
        landing: Landing,
    ) -> None:  # fmt: skip
        integrator.set_time(0.0)
        integrator.state[:] = states[lanes].T
        if constants.shape[1]:
            integrator.pars[: constants.shape[1]] = constants[lanes].T
        integrator.propagate_until(until[lanes], max_steps=self.most_steps)
        landing.states[lanes] = integrator.state.T
        landing.reached[lanes] = integrator.time

    @cached_property
    def _one_by_one(self) -> OneByOne:
        return OneByOne(self.alone())
