"""Many initial values by SciPy's DOP853, one after the other.

A stop is found as a change of sign along the interpolant of a step; the state
there comes from an integration to that place, since the interpolant has one
order less than the method.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.integrators.protocol import NONE, OUTCOMES, Landing, Outcome
from varcalc.integrators.stops import Stops

if TYPE_CHECKING:
    from collections.abc import Callable

SAMPLES = 12
"""Places along a step where the stopping functions are looked at."""

_ONE_AT_A_TIME = Lock()


@dataclass(frozen=True)
class Dop853Swarm:
    """A system with its stopping functions; :meth:`run` is that of the protocol."""

    rate: Callable[[float, np.ndarray], np.ndarray]
    set_constants: Callable[[np.ndarray], None]
    stops: Stops
    tolerance: float
    most_steps: int = field(default=4000)

    def run(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...] = ()) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Swarm.run`."""
        m = len(states)
        landing = Landing(np.array(states), np.zeros(m), np.zeros(m, np.int8), np.full(m, NONE, np.int16))
        with _ONE_AT_A_TIME, np.errstate(all="ignore"):  # the constants are the system's own while it is integrated
            for row in range(m):
                self.set_constants(constants[row])
                end, reached, outcome, stop = self._one(states[row], constants[row], leaving)
                landing.states[row], landing.reached[row] = end, reached
                landing.outcomes[row], landing.stopped_by[row] = OUTCOMES.index(outcome), stop
        return landing

    def _solver(self, time: float, state: np.ndarray, end: float) -> Any:
        from scipy.integrate import DOP853

        scale = self.tolerance * max(1.0, float(np.abs(state).max()))
        return DOP853(self.rate, time, state, end, rtol=self.tolerance, atol=scale)

    def _one(
        self, start: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...]
    ) -> tuple[np.ndarray, float, Outcome, int]:
        if not np.all(np.isfinite(self.rate(0.0, start))):
            return start, 0.0, Outcome.NOT_FINITE, NONE
        signs, slopes, _ = (a[0] for a in self.stops(start[None, :], constants[None, :]))
        signs = np.sign(signs)
        for stop in leaving:
            signs[stop] = np.sign(slopes[stop])
        solver = self._solver(0.0, start, np.inf)
        for _ in range(self.most_steps):
            before, time = solver.y, solver.t
            solver.step()
            if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
                return before, time, Outcome.BLOW_UP, NONE
            met = self._first(solver, time, constants, signs)
            if met is not None:
                at, stop = met
                return *self._landed(before, time, at, constants, stop), Outcome.STOPPED, stop
        return solver.y, solver.t, Outcome.TOO_MANY_STEPS, NONE

    def _first(self, solver: Any, time: float, constants: np.ndarray, signs: np.ndarray) -> tuple[float, int] | None:
        """The first stop along the last step, as (s, number); ``signs`` are those before it."""
        from scipy.optimize import brentq

        interpolant = solver.dense_output()
        times = np.linspace(time, solver.t, SAMPLES + 1)[1:]
        levels = self.stops(interpolant(times).T, np.tile(constants, (SAMPLES, 1)))[0]
        crossed = levels * signs < 0
        if not np.any(crossed):
            return None
        place = int(np.argmax(np.any(crossed, axis=1)))
        low = time if place == 0 else times[place - 1]

        def level(s: float, stop: int) -> float:
            return float(self.stops(interpolant(s)[None, :], constants[None, :])[0][0, stop])

        found = []
        for stop in map(int, np.flatnonzero(crossed[place])):
            ends = level(low, stop), level(times[place], stop)
            found.append((low if ends[0] * ends[1] >= 0 else brentq(level, low, times[place], args=(stop,)), stop))
        return min(found)

    def _landed(
        self, before: np.ndarray, time: float, at: float, constants: np.ndarray, stop: int
    ) -> tuple[np.ndarray, float]:
        """The state at the stop near ``at``, integrated to it from the step's beginning."""
        state = before
        if at > time:
            solver = self._solver(time, before, at)
            while solver.status == "running":
                solver.step()
            state = solver.y
        shift = 0.0
        for _ in range(2):  # the interpolant is some digits off, and Newton's steps are short
            rows, more = self.stops.polished(state[None, :], constants[None, :], np.array([stop]))
            state, shift = rows[0], shift + float(more[0])
        return state, at + shift
