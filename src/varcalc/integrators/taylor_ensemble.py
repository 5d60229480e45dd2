"""Many initial values at once by Taylor's method, each with steps and an end of its own.

All that are on their way take their next steps together, by one call of one function
(:mod:`varcalc.integrators.taylor_step`), interpreted by CasADi while it has little to do and then compiled by heyoka;
those that have come to their ends make room for the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import lower
from varcalc.integrators.protocol import BLOW_UP, COMPLETED, NONE, NOT_FINITE, STOPPED, TOO_MANY_STEPS, Landing, begun
from varcalc.integrators.taylor_step import ARRIVED, LOST, MET, TaylorStep

RUNS_BUFFERED = 4096
"""Runs that take their steps together: enough to make up for the call, and few enough to stay near the processor."""
ENDED_SHARE = 16
"""A run that has ended is taken out when one in so many has: until then it ends again, the same way."""
USUAL = 20
"""Steps that a run is expected to take."""
WORTH = ((20_000, 0), (1_000_000, 3))
"""Columns from which on compiling is worth it, and the level to which LLVM then optimises.

An operation of a column takes CasADi's interpreter 2.7 nanoseconds, machine code that is not optimised 0.09 and the
optimised one 0.03, and compiling an operation some 60 microseconds and 150.
"""

_ONE_AT_A_TIME = Lock()
"""Threads that need the same function wait for the one that compiles it."""


@dataclass
class VectorisedStep:
    """A function of columns of numbers: interpreted by CasADi while it has little to do, then compiled by heyoka.

    The number of columns decides, not the clock, so results are reproducible.
    """

    function: ca.Function
    _seen: int = field(default=0, init=False)
    _compilations: int = field(default=0, init=False)
    _compiled: Any = field(default=None, init=False, repr=False)

    def expects(self, columns: int) -> None:
        """Compile the function, or do it better, if so many columns more than those before are worth it."""
        if self._compilations == len(WORTH) or self._seen + columns <= WORTH[self._compilations][0]:
            return
        worth = [level for least, level in WORTH if self._seen + columns > least]
        with _ONE_AT_A_TIME:
            if len(worth) > self._compilations:
                self._compiled = _compiled(self.function, worth[-1])
                self._compilations = len(worth)

    def __call__(self, columns: np.ndarray, results: np.ndarray) -> None:
        """The function of each of the ``columns`` (n, m), written into ``results`` (k, m); both contiguous."""
        self.expects(columns.shape[1])
        self._seen += columns.shape[1]
        if self._compiled is not None:
            self._compiled(columns, outputs=results)
        else:
            results[:] = np.array(self.function(columns))


def _compiled(function: ca.Function, level: int) -> Any:
    """``function`` of one argument as a heyoka function of arrays, optimised to a ``level``."""
    import heyoka as hy

    column, nothing = ca.SX.sym("Y", function.numel_in(0)), ca.SX.sym("c", 0)
    system = ca.Function(function.name(), [ca.SX.sym("s"), column, nothing], [function(column)])
    names = [hy.expression(f"Y{i}") for i in range(function.numel_in(0))]
    return hy.cfunc(lower(system, [[hy.time], names, []]), names, opt_level=level)


@dataclass
class TaylorEnsemble:
    """A system with its stops; :meth:`run` may be called by several threads at once."""

    system: ca.Function
    stops: ca.Function
    tolerance: float
    most_steps: int
    at_ends: tuple[int, ...] = ()
    step: TaylorStep = field(init=False, repr=False)
    _call: VectorisedStep = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.step = TaylorStep(self.system, self.stops, self.tolerance, self.at_ends)
        self._call = VectorisedStep(self.step.function)

    def run(
        self,
        states: np.ndarray,
        constants: np.ndarray,
        *,
        start: np.ndarray | float = 0.0,
        until: np.ndarray | float = np.inf,
        leaving: tuple[int, ...] = (),
    ) -> Landing:
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`; ValueError where a run is to go back."""
        landing, ends = begun(states, start, until, stopping=True)
        ahead, size = ends - landing.reached, states.shape[1]
        if np.any(ahead < 0):
            raise ValueError("stops are looked for forwards only: turn the system round to go back")
        going = np.flatnonzero(ahead > 0)
        if len(going) == 0:
            return landing
        self._call.expects(USUAL * len(going))
        places, columns, codes, steps = self._ends(
            self.step.travellers(states[going], constants[going], ahead[going], leaving)
        )
        rows, outcomes = going[places], np.full(len(going), TOO_MANY_STEPS, np.int8)
        outcomes[codes == LOST] = BLOW_UP
        outcomes[(codes == LOST) & (columns[size] == 0)] = NOT_FINITE
        outcomes[codes == ARRIVED], outcomes[codes >= MET] = COMPLETED, STOPPED
        landing.states[rows], landing.outcomes[rows], landing.steps[rows] = columns[:size].T, outcomes, steps
        landing.reached[rows] = np.where(codes == ARRIVED, ends[rows], landing.reached[rows] + columns[size])
        landing.stopped_by[rows] = np.where(codes >= MET, codes - MET, NONE)
        return landing

    def _ends(self, waiting: np.ndarray) -> tuple[np.ndarray, ...]:
        """Carry the columns ``waiting`` to their ends.

        Their places there, themselves, what the last steps came to and the number of steps, in the order of the ends.
        """
        ended: list[tuple[np.ndarray, ...]] = []
        pool = _Pool(self.step.rows, waiting)
        taken = 0
        while pool.count:
            self._call(*pool.before_and_after())
            taken += 1
            over = pool.codes >= LOST
            if taken >= self.most_steps:
                over |= taken - pool.since >= self.most_steps
            if np.count_nonzero(over) * ENDED_SHARE >= pool.count:
                ended.append(pool.exchanged(over, taken))
        return tuple(np.concatenate(parts, axis=-1) for parts in zip(*ended, strict=True))


class _Pool:
    """The columns that take their steps together, taken from those ``waiting`` and going from one buffer to the other.

    New arrays of this size would be fetched from the system, and cleared, at every step.
    """

    def __init__(self, rows: int, waiting: np.ndarray) -> None:
        self.rows, self.waiting = rows, waiting
        self._buffers = [np.empty((rows + 1) * min(RUNS_BUFFERED, waiting.shape[1])) for _ in range(2)]
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

    def exchanged(self, over: np.ndarray, now: int) -> tuple[np.ndarray, ...]:
        """Places, columns, codes, steps of those that are ``over``, and others in their stead, which begin ``now``."""
        out, on = np.flatnonzero(over), np.flatnonzero(~over)
        ended = self.places[out], np.take(self.columns, out, axis=1), self.codes[out], now - self.since[out]
        going = np.take(self.columns, on, axis=1)
        self.places, self.since = self.places[on], self.since[on]
        self._fill(going, now)
        return ended

    def _fill(self, going: np.ndarray, now: int) -> None:
        more = np.arange(self.begun, min(self.begun + RUNS_BUFFERED - len(self.places), self.waiting.shape[1]))
        self.begun += len(more)
        old = len(self.places)
        self.places = np.concatenate([self.places, more])
        self.since = np.concatenate([self.since, np.full(len(more), now)])
        columns = self.columns
        columns[:, :old] = going
        columns[:, old:] = self.waiting[:, more]
