"""Many initial values at once by heyoka's batch integrators, one batch in the lanes of one vector register.

A stop that one lane meets halts the whole batch, while the others are in the
middle of their way; so does a lane whose state is no longer a number. The batch is therefore
started again until every lane has come to its own end, and the lanes that
have are held at their own time.
"""

from __future__ import annotations

import copy
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from varcalc.engines.protocol import NONE, OUTCOMES, Landing, Outcome
from varcalc.engines.stops import Stops
from varcalc.engines.threads import threads_for

FAR = 1e300
"""An abscissa that no run reaches: stops end them."""
COMPLETED, STOPPED, NOT_FINITE, BLOW_UP, TOO_MANY = (
    OUTCOMES.index(o)
    for o in (Outcome.COMPLETED, Outcome.STOPPED, Outcome.NOT_FINITE, Outcome.BLOW_UP, Outcome.TOO_MANY_STEPS)
)
PATIENCE = 16
"""Steps after which the bound on their length is raised."""
GROWTH = 16.0
"""By how much it is raised."""
STRIDE = 0.83
"""Of the distance at which a stop seems to lie: steps that end on the stop itself are to be avoided."""
ATTEMPTS = 3
"""How often a run that missed a stop is tried again with other steps."""


@dataclass(frozen=True)
class TaylorSwarm:
    """A compiled batch integrator with terminal events; :meth:`run` is that of the protocol."""

    integrator: Any
    stops: Stops
    most_steps: int
    codes: Any = field(repr=False)  # heyoka's taylor_outcome

    def run(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...] = ()) -> Landing:
        """See :meth:`varcalc.engines.protocol.Swarm.run`; the batches are spread over the cores."""
        m = len(states)
        landing = Landing(np.array(states), np.zeros(m), np.full(m, COMPLETED, np.int8), np.full(m, NONE, np.int16))
        signs = self._signs(states, constants, leaving)
        reach = STRIDE * self.stops.reach(states, constants, leaving)
        self._spread(np.arange(m), landing, constants, leaving, signs, reach)
        self._settle(landing, constants)
        for _ in range(ATTEMPTS):
            missed = np.flatnonzero(self._missed(landing, constants, signs))
            if len(missed) == 0:
                break
            landing.states[missed] = states[missed]
            reach *= STRIDE
            self._spread(missed, landing, constants, leaving, signs, reach)
            self._settle(landing, constants)
        return landing

    def _spread(
        self, rows: np.ndarray, landing: Landing, constants: np.ndarray, leaving: tuple[int, ...], signs: np.ndarray,
        reach: np.ndarray,
    ) -> None:  # fmt: skip
        """Run ``rows``, batch by batch, over the cores."""
        size = self.integrator.batch_size
        threads = threads_for(len(rows))
        batches = [rows[np.minimum(np.arange(k, k + size), len(rows) - 1)] for k in range(0, len(rows), size)]

        def share(number: int) -> None:
            # a copy shares the compiled code
            integrator = copy.deepcopy(self.integrator) if number else self.integrator
            for lanes in batches[number::threads]:
                _Batch(self, integrator, lanes, leaving, signs, reach[lanes]).run(landing, constants)

        if threads == 1:
            share(0)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(share, range(threads)))

    def _signs(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...]) -> np.ndarray:
        """The signs (m, k) of the stopping functions just after the start."""
        level, slope, _ = self.stops(states, constants)
        signs = np.sign(level)
        for stop in leaving:
            signs[:, stop] = np.sign(slope[:, stop])
        return signs

    def _missed(self, landing: Landing, constants: np.ndarray, signs: np.ndarray) -> np.ndarray:
        """True (m,) where a stop has changed its sign without being met: its zero fell on the end of a step."""
        level = self.stops(landing.states, constants)[0]
        changed = np.sign(level) * signs < 0
        stopped = np.flatnonzero(landing.stopped_by != NONE)
        changed[stopped, landing.stopped_by[stopped]] = False
        return np.any(changed, axis=1)

    def _settle(self, landing: Landing, constants: np.ndarray) -> None:
        """Locate the stops once more, on the stopping functions themselves."""
        at = np.flatnonzero(landing.outcomes == STOPPED)
        if len(at):
            states, shift = self.stops.polished(landing.states[at], constants[at], landing.stopped_by[at])
            landing.states[at] = states
            landing.reached[at] += shift


class _Batch:
    """One batch on its way; ``rows`` are its lanes' places in the swarm, the last repeated to fill it."""

    def __init__(
        self,
        swarm: TaylorSwarm,
        integrator: Any,
        rows: np.ndarray,
        leaving: tuple[int, ...],
        signs: np.ndarray,
        reach: np.ndarray,
    ) -> None:
        self.swarm, self.integrator, self.rows = swarm, integrator, rows
        self.leaving, self.signs = leaving, signs
        self.longest = reach
        self.until = np.full(len(rows), FAR)
        self.ended = np.zeros(len(rows), dtype=bool)
        self.steps = np.zeros(len(rows), dtype=int)
        self.raised = np.zeros(len(rows), dtype=int)  # steps taken when the bound on their length was last raised

    def run(self, landing: Landing, constants: np.ndarray) -> None:
        """Start again until every lane has ended; write the ends into ``landing``."""
        integrator = self.integrator
        integrator.set_time(0.0)
        integrator.reset_cooldowns()
        integrator.state[:] = landing.states[self.rows].T
        if constants.shape[1]:
            integrator.pars[: constants.shape[1]] = constants[self.rows].T
        while True:
            before = np.array(integrator.state)
            left = self.swarm.most_steps - int(self.steps[~self.ended].max())
            integrator.propagate_until(self.until, max_steps=max(1, min(left, PATIENCE)), max_delta_t=self.longest)
            results = integrator.propagate_res
            self.steps += np.array([result[3] for result in results])
            codes = np.array([int(result[0]) for result in results])
            self._judge(codes, before, np.array(integrator.state), landing, constants)
            if np.all(self.ended):
                return
            tired = self.steps >= self.raised + PATIENCE
            self.longest = np.where(tired, GROWTH * self.longest, self.longest)
            self.raised = np.where(tired, self.steps, self.raised)
            self._hold()

    def _judge(
        self, codes: np.ndarray, before: np.ndarray, after: np.ndarray, landing: Landing, constants: np.ndarray
    ) -> None:
        """Note the lanes that have come to their ends; ``codes`` are heyoka's, ``before`` and ``after`` (N, lanes)."""
        known, rows = self.swarm.codes, self.rows
        failed = ~np.all(np.isfinite(after), axis=0) | (codes == int(known.err_nf_state))
        stopped = ~failed & (codes > int(known.success)) & (codes < 0)
        for lane in np.flatnonzero(stopped & ~self.ended & np.isin(-codes - 1, self.leaving)):
            stopped[lane] = not self._is_the_start(-codes[lane] - 1, after[:, lane], rows[lane], constants)
        tired = ~failed & ~stopped & (self.steps >= self.swarm.most_steps)
        at_once = np.all(before == landing.states[rows].T, axis=0)
        outcomes = np.select([failed & at_once, failed, stopped], [NOT_FINITE, BLOW_UP, STOPPED], TOO_MANY)
        new = ~self.ended & (failed | stopped | tired)
        if not np.any(new):
            return
        times = np.array(self.integrator.time)
        landing.reached[rows[new]] = np.where(np.isfinite(times), times, 0.0)[new]
        landing.states[rows[new]] = np.where(failed, before, after)[:, new].T
        landing.outcomes[rows[new]] = outcomes[new]
        landing.stopped_by[rows[new]] = np.where(stopped, -codes - 1, NONE)[new]
        self.ended |= new

    def _is_the_start(self, stop: int, state: np.ndarray, row: int, constants: np.ndarray) -> bool:
        """Whether a stop being left is crossed the way it was left: between two such crossings lies another."""
        slope = self.swarm.stops(state[None, :], constants[row][None, :])[1][0, stop]
        return bool(np.sign(slope) == self.signs[row, stop])

    def _hold(self) -> None:
        """Keep the lanes that have ended where they are; those that failed stand in another's place.

        A lane whose Taylor series is not a number would halt the batch at every step.
        """
        integrator = self.integrator
        running = int(np.argmin(self.ended))
        times = np.array(integrator.time)
        ended = self.ended
        integrator.state[:, ended] = integrator.state[:, [running]]
        integrator.pars[:, ended] = integrator.pars[:, [running]]
        times[ended] = times[running]
        integrator.set_time(times)
        self.until = np.where(self.ended, times, FAR)
