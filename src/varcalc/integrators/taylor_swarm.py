"""Many initial values at once by Taylor's method, each with steps and an end of its own.

All that are on their way take their next steps together, by one call of one
compiled function (:mod:`varcalc.integrators.stride`); those that have come to
their ends make room for the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.integrators.columnwise import Columnwise
from varcalc.integrators.protocol import NONE, OUTCOMES, Landing, Outcome, check_system
from varcalc.integrators.stride import LOST, MET, Stride

STOPPED, NOT_FINITE, BLOW_UP, TOO_MANY = (
    OUTCOMES.index(o) for o in (Outcome.STOPPED, Outcome.NOT_FINITE, Outcome.BLOW_UP, Outcome.TOO_MANY_STEPS)
)
TOGETHER = 4096
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

    def __post_init__(self) -> None:
        check_system(self.system)
        self.stride = Stride(self.system, self.stops, self.tolerance)
        self._step = Columnwise(self.stride.step)

    def run(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...] = ()) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Swarm.run`."""
        m, size = states.shape
        landing = Landing(np.array(states), np.zeros(m), np.full(m, TOO_MANY, np.int8), np.full(m, NONE, np.int16))
        if m == 0:
            return landing
        self._step.expects(USUAL * m)
        rows, columns, codes = self._ends(self.stride.travellers(states, constants, leaving))
        landing.states[rows], landing.reached[rows] = columns[:size].T, columns[size]
        landing.outcomes[rows[codes == LOST]] = BLOW_UP
        landing.outcomes[rows[(codes == LOST) & (columns[size] == 0)]] = NOT_FINITE
        met = codes >= MET
        landing.outcomes[rows[met]], landing.stopped_by[rows[met]] = STOPPED, codes[met] - MET
        return landing

    def _ends(self, waiting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Carry the columns ``waiting`` to their ends: their places there, themselves, and what the last steps came to.

        They are in the order in which they end.
        """
        ended: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        pool = _Pool(self.stride.rows, waiting)
        taken = 0
        while pool.count:
            self._step(*pool.before_and_after())
            taken += 1
            over = pool.codes >= LOST
            if taken >= self.most_steps:
                over |= taken - pool.since >= self.most_steps
            if np.count_nonzero(over) * PATIENCE >= pool.count:
                ended.append(pool.exchanged(over, taken))
        places, ends, last = (np.concatenate(parts, axis=-1) for parts in zip(*ended, strict=True))
        return places, ends, last


class _Pool:
    """The columns that take their steps together, taken from those ``waiting`` and going from one buffer to the other.

    New arrays of this size would be fetched from the system, and cleared, at every step.
    """

    def __init__(self, rows: int, waiting: np.ndarray) -> None:
        self.rows, self.waiting = rows, waiting
        self._buffers = [np.empty((rows + 1) * min(TOGETHER, waiting.shape[1])) for _ in range(2)]
        self.places, self.since = np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        self.begun = 0
        self._fill(np.empty((rows, 0)), 0)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.places)

    @property
    def columns(self) -> np.ndarray:
        """They themselves (rows, count)."""
        return self._buffers[0][: self.rows * self.count].reshape(self.rows, self.count)

    @property
    def codes(self) -> np.ndarray:
        """What their last steps came to (count,)."""
        return self._buffers[0][self.rows * self.count : (self.rows + 1) * self.count]

    def before_and_after(self) -> tuple[np.ndarray, np.ndarray]:
        """The columns, and the room for what the next step makes of them, which becomes the columns."""
        before = self.columns
        self._buffers.reverse()
        return before, self._buffers[0][: (self.rows + 1) * self.count].reshape(self.rows + 1, self.count)

    def exchanged(self, over: np.ndarray, now: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places, columns and codes of those that are ``over``, and others in their stead, which begin ``now``."""
        out, on = np.flatnonzero(over), np.flatnonzero(~over)
        ended = self.places[out], np.take(self.columns, out, axis=1), self.codes[out]
        going = np.take(self.columns, on, axis=1)
        self.places, self.since = self.places[on], self.since[on]
        self._fill(going, now)
        return ended

    def _fill(self, going: np.ndarray, now: int) -> None:
        more = np.arange(self.begun, min(self.begun + TOGETHER - len(self.places), self.waiting.shape[1]))
        self.begun += len(more)
        old = len(self.places)
        self.places = np.concatenate([self.places, more])
        self.since = np.concatenate([self.since, np.full(len(more), now)])
        columns = self.columns
        columns[:, :old] = going
        columns[:, old:] = self.waiting[:, more]
