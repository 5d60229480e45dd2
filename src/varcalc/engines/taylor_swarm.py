"""Many initial values at once by Taylor's method, each with steps and an end of its own.

All that are on their way take their next steps together, by one call of one
compiled function (:mod:`varcalc.engines.stride`); those that have come to
their ends make room for the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.engines.columnwise import Columnwise
from varcalc.engines.protocol import NONE, OUTCOMES, Landing, Outcome, check_system
from varcalc.engines.stride import LOST, MET, Stride

STOPPED, NOT_FINITE, BLOW_UP, TOO_MANY = (
    OUTCOMES.index(o) for o in (Outcome.STOPPED, Outcome.NOT_FINITE, Outcome.BLOW_UP, Outcome.TOO_MANY_STEPS)
)
TOGETHER = 1024
"""Runs that take their steps together: enough to make up for the call, and few enough to stay near the processor."""
PATIENCE = 16
"""A run that has ended is taken out when one in so many has: until then it ends again, the same way."""
USUAL = 20
"""Steps that a run is expected to take."""


@dataclass
class TaylorSwarm:
    """A system with its stops; :meth:`run` is that of the protocol, and may be called by several threads at once."""

    system: ca.Function
    stops: ca.Function
    tolerance: float
    most_steps: int
    stride: Stride = field(init=False, repr=False)
    _step: Columnwise = field(init=False, repr=False)
    _land: Columnwise = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_system(self.system)
        self.stride = Stride(self.system, self.stops, self.tolerance)
        self._step, self._land = Columnwise(self.stride.step), Columnwise(self.stride.land)

    def run(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...] = ()) -> Landing:
        """See :meth:`varcalc.engines.protocol.Swarm.run`."""
        m, size = states.shape
        landing = Landing(np.array(states), np.zeros(m), np.full(m, TOO_MANY, np.int8), np.full(m, NONE, np.int16))
        if m == 0:
            return landing
        self._step.expects(USUAL * m)
        self._land.expects(m)
        rows, columns, codes = self._ends(self.stride.travellers(states, constants, leaving))
        landing.states[rows], landing.reached[rows] = columns[:size].T, columns[size]
        landing.outcomes[rows[codes == LOST]] = BLOW_UP
        landing.outcomes[rows[(codes == LOST) & (columns[size] == 0)]] = NOT_FINITE
        met = np.flatnonzero(codes == MET)
        if len(met):
            landed, at = self._land(np.take(columns, met, axis=1)), rows[met]
            landing.states[at], landing.reached[at] = landed[:size].T, landed[size]
            landing.outcomes[at], landing.stopped_by[at] = STOPPED, landed[size + 1]
        return landing

    def _ends(self, waiting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Carry the columns ``waiting`` to their ends: their places there, themselves, and what the last steps came to.

        They are in the order in which they end.
        """
        ended: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        begun = min(TOGETHER, waiting.shape[1])
        rows, columns = np.arange(begun), np.ascontiguousarray(waiting[:, :begun])
        steps = np.zeros(begun, dtype=int)
        while len(rows):
            columns = self._step(columns)
            columns, codes = columns[:-1], columns[-1]
            steps += 1
            over = (codes == MET) | (codes == LOST) | (steps >= self.most_steps)
            count = np.count_nonzero(over)
            if count * PATIENCE < len(rows):
                continue
            out, on = np.flatnonzero(over), np.flatnonzero(~over)
            ended.append((rows[out], np.take(columns, out, axis=1), codes[out]))
            more = np.arange(begun, min(begun + count, waiting.shape[1]))
            begun += len(more)
            rows, steps = np.concatenate([rows[on], more]), np.concatenate([steps[on], np.zeros(len(more), int)])
            columns = np.concatenate([np.take(columns, on, axis=1), waiting[:, more]], axis=1)
        places, ends, last = (np.concatenate(parts, axis=-1) for parts in zip(*ended, strict=True))
        return places, ends, last
