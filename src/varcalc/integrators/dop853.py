"""Dormand and Prince's method of order 8 with SciPy's coefficients, for all runs together.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sect. II.4 to II.6: each run has a step and an
error of its own, and the stages of all are one call of the system. Nothing is compiled, so it is cheap to start and
takes any CasADi function, interpolated data included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import (
    BLOW_UP,
    COMPLETED,
    NOT_FINITE,
    OUTCOMES,
    STOPPED,
    TOO_MANY_STEPS,
    Landing,
    Run,
    begun,
    check_system,
    checked,
)
from varcalc.integrators.stops import Step, Stops
from varcalc.symbolic.evaluation import PointEvaluator

REFINEMENT = 100.0
"""By how much the tolerance of each level is the smaller one."""
SMALLEST = 100 * float(np.finfo(float).eps)
"""The smallest relative tolerance that rounding leaves a meaning."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
"""A new step is so much of the one that just meets the tolerance, and so many times the last at least and at most."""
TOGETHER = 1024
"""Runs that take their steps together."""
SPARSE = 16
"""So many runs are left together until half of them have ended: less is not worth rearranging."""


@dataclass(frozen=True)
class Dop853:
    """Dormand and Prince's method of order 8. ``tolerance`` is relative to each state, or to the largest initial value.

    Each level takes a hundredth of it, and as many steps more as level 0 takes. ``most_steps`` bounds those of one run.
    """

    tolerance: float = REFINEMENT * SMALLEST
    most_steps: int = 4000

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return "DOP853 (SciPy)"

    def compile(self, system: ca.Function, stops: ca.Function | None = None) -> Dop853Flow:
        """Wrap ``system`` and ``stops``; never raises CannotLower."""
        check_system(system)
        return Dop853Flow(self, system, None if stops is None else Stops(system, stops))


@dataclass(frozen=True)
class Dop853Flow:
    """A system with its stops, which nothing has to be compiled for; both verbs are those of the protocol."""

    engine: Dop853
    system: ca.Function
    stops: Stops | None

    compiled = False

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0, dense: bool = False
    ) -> Run:
        """:meth:`varcalc.integrators.protocol.Flow.trajectory`, as an ensemble of one without stops."""
        checked(abscissae, state, constants, self.system)
        inner = len(abscissae) > 2
        ends = Dop853Flow(self.engine, self.system, None).ensemble(
            state[None, :], constants[None, :], start=abscissae[0], until=abscissae[-1], level=level,
            dense=dense or inner,
        )  # fmt: skip
        outcome, reached = OUTCOMES[ends.outcomes[0]], float(ends.reached[0])
        between = None if ends.dense is None else ends.dense[0]
        states = np.full((len(abscissae), len(state)), math.nan)
        states[0] = state
        if inner and between is not None:
            there = np.abs(abscissae - abscissae[0]) <= abs(reached - abscissae[0])
            there[0] = False
            states[there] = between(abscissae[there])
        if ends.outcomes[0] == COMPLETED:
            states[-1] = ends.states[0]
        return Run(abscissae, states, outcome, reached, int(ends.steps[0]), between if dense else None)

    def ensemble(
        self,
        states: np.ndarray,
        constants: np.ndarray,
        *,
        start: np.ndarray | float = 0.0,
        until: np.ndarray | float = math.inf,
        level: int = 0,
        usual: np.ndarray | None = None,
        dense: bool = False,
        leaving: tuple[int, ...] = (),
    ) -> Landing:
        """:meth:`varcalc.integrators.protocol.Flow.ensemble`; each ``level`` halves the steps."""
        landing, until = begun(states, start, until, self.stops is not None)
        if dense:
            landing.dense = [Pieces(float(s)) for s in landing.reached]
        tolerance = max(self.engine.tolerance / REFINEMENT**level, SMALLEST)
        longest = np.full(len(states), math.inf)
        if level:  # smaller steps as well: few steps may be the same at any tolerance
            ends = until
            if usual is None or not np.all(np.isfinite(ends)):
                first = self.ensemble(states, constants, start=start, until=until, leaving=leaving)
                usual, ends = first.steps, first.reached
            longest = np.abs(ends - landing.reached) / (2**level * usual + 1)
        for first in range(0, len(states), TOGETHER):
            rows = np.arange(first, min(first + TOGETHER, len(states)))
            _Runs(self, landing, constants, until, longest, rows, tolerance, leaving).go()
        return landing


@lru_cache(maxsize=1)
def _tables() -> tuple[np.ndarray, ...]:
    """SciPy's coefficients: stages with the new state as the last, their places, errors, extra stages, dense output."""
    from scipy.integrate import DOP853

    stages = np.zeros((13, 12))
    stages[:12], stages[12] = DOP853.A, DOP853.B
    errors = np.stack([DOP853.E5, DOP853.E3])
    return stages, np.append(DOP853.C, 1.0), errors, DOP853.A_EXTRA, DOP853.C_EXTRA, DOP853.D


class _Runs:
    """Runs that take their steps together; those that have ended go to ``landing``.

    ``longest`` (m,) bounds the steps of each.
    """

    def __init__(
        self, flow: Dop853Flow, landing: Landing, constants: np.ndarray, until: np.ndarray, longest: np.ndarray,
        rows: np.ndarray, tolerance: float, leaving: tuple[int, ...],
    ) -> None:  # fmt: skip
        self.flow, self.landing, self.tolerance, self.rows = flow, landing, tolerance, rows
        self.time: np.ndarray = landing.reached[rows]
        self.bound: np.ndarray = until[rows]
        self.state = landing.states[rows]
        self.constants, self.longest = np.ascontiguousarray(constants[rows]), longest[rows]
        self.way = np.where(self.bound < self.time, -1.0, 1.0)
        self.live: np.ndarray = np.ones(len(rows), dtype=bool)
        self.refused = np.zeros(len(rows), dtype=bool)
        self.floor = tolerance * np.maximum(1.0, np.abs(self.state).max(axis=1, initial=0.0))[:, None]
        self.keeps = landing.dense is not None or flow.stops is not None
        self.signs = np.zeros((len(rows), 0))
        if flow.stops is not None:
            self.signs = flow.stops.sides(self.state, self.constants, leaving)
        self._allocate()

    def _allocate(self) -> None:
        """Buffers for as many runs as there are now."""
        m, size = self.state.shape
        self._at = [np.zeros(m), np.zeros((m, size)), self.constants]
        self._rates = np.zeros((m, size))
        self._call = PointEvaluator(self.flow.system).bound(self._at, self._rates)
        self._stages = np.zeros((16 if self.keeps else 13, m, size))  # times the step
        self._sum = np.zeros(m * size)

    def _slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N), in a buffer that the next call overwrites."""
        self._at[0][:], self._at[1][:] = time, state
        self._call()
        return self._rates

    def go(self) -> None:
        """Carry all runs to their ends."""
        with np.errstate(all="ignore"):
            self.slope = self._slope(self.time, self.state).copy()
            self._end(np.asarray(~np.isfinite(self.slope).all(axis=1)), NOT_FINITE)
            self._end(self.live & (self.time == self.bound), COMPLETED)
            self.step = self._first_steps()
            while self.live.any():
                if len(self.rows) > SPARSE and 2 * np.count_nonzero(self.live) <= len(self.rows):
                    self._rearrange()
                self._advance()
                self.landing.rounds += 1

    def _end(self, which: np.ndarray, code: int) -> None:
        if which.any():
            rows = self.rows[which]
            self.landing.states[rows], self.landing.reached[rows] = self.state[which], self.time[which]
            self.landing.outcomes[rows] = code
            self.live &= ~which
            self.bound[which] = self.time[which]  # so that it stays where it is, if it is carried on with the others

    def _rearrange(self) -> None:
        """Leave out the runs that have ended."""
        kept = self.live
        for name in ("rows", "time", "state", "bound", "longest", "way", "refused", "floor", "signs", "slope", "step"):
            setattr(self, name, getattr(self, name)[kept])
        self.constants = np.ascontiguousarray(self.constants[kept])
        self.live = np.ones(len(self.rows), dtype=bool)
        self._allocate()

    def _first_steps(self) -> np.ndarray:
        """The first steps (m,): Hairer, Norsett, Wanner, sect. II.4."""
        scale = self.floor + self.tolerance * np.abs(self.state)
        root = math.sqrt(self.state.shape[1])
        d0, d1 = (np.linalg.norm(v / scale, axis=1) / root for v in (self.state, self.slope))
        most = np.minimum(np.abs(self.bound - self.time), self.longest)
        trial = np.fmin(np.where((d0 < 1e-5) | (d1 < 1e-5), 1e-6, 0.01 * d0 / d1), most)
        trial = np.where(trial > 0, trial, 1e-6)
        move = (trial * self.way)[:, None]
        after = self._slope(self.time + move[:, 0], self.state + move * self.slope)
        d2 = np.linalg.norm((after - self.slope) / scale, axis=1) / root / trial
        steepest = np.fmax(d1, d2)
        other = np.where(steepest <= 1e-15, np.maximum(1e-6, trial * 1e-3), (0.01 / steepest) ** (1 / 8))
        return np.fmin(np.fmin(100 * trial, other), most)

    def _advance(self) -> None:
        """One step of every run, or another try, shorter."""
        least = 10 * np.abs(np.nextafter(self.time, self.way * np.inf) - self.time)
        self._end(self.live & self.refused & (self.step < least), BLOW_UP)
        size = np.where(self.refused, self.step, np.fmin(np.fmax(self.step, least), self.longest))
        end = self.time + size * self.way
        end = np.where(self.way * (end - self.bound) > 0, self.bound, end)
        h = (end - self.time)[:, None]
        new = self._stages_of(h, end)
        error = self._error(new)
        factor = np.fmin(np.fmax(SAFETY * error ** (-1 / 8), SHRINK), GROW)
        taken = self.live & (error < 1)
        self.step = np.abs(h[:, 0]) * np.where(taken & self.refused, np.minimum(1.0, factor), factor)
        self.refused = self.live & ~taken
        before = self.time, self.state
        following = self._rates.copy()
        shape = self._shape(h, new, following) if self.keeps else None
        column = taken[:, None]
        self.time, self.state = np.where(taken, end, self.time), np.where(column, new, self.state)
        self.slope = np.where(column, following, self.slope)
        self.landing.steps[self.rows[taken]] += 1
        if shape is not None:
            self._record(*before, h[:, 0], shape, taken)
        self._end(self.live & (self.time == self.bound), COMPLETED)
        self._end(self.live & (self.landing.steps[self.rows] >= self.flow.engine.most_steps), TOO_MANY_STEPS)

    def _stages_of(self, h: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The state after the step; the rate there is left in the buffer."""
        stages, places, *_ = _tables()
        k, m = self._stages, len(self.time)
        flat = k.reshape(len(k), -1)
        time, state = self._at[0], self._at[1]
        np.multiply(self.slope, h, out=k[0])
        for s in range(1, 13):
            np.dot(stages[s, :s], flat[:s], out=self._sum)
            np.add(self.state, self._sum.reshape(m, -1), out=state)
            time[:] = end if s == 12 else self.time + places[s] * h[:, 0]
            self._call()
            np.multiply(self._rates, h, out=k[s])
        return state.copy()

    def _error(self, new: np.ndarray) -> np.ndarray:
        """The error (m,) of the step relative to the tolerance: that of order 5, corrected by that of order 3."""
        errors, m = _tables()[2], len(new)
        scale = self.floor + np.maximum(np.abs(self.state), np.abs(new)) * self.tolerance
        off = (errors @ self._stages[:13].reshape(13, -1)).reshape(2, m, -1) / scale
        fifth, third = np.einsum("kmn,kmn->km", off, off)
        denominator = fifth + 0.01 * third
        return np.where(denominator == 0, 0.0, fifth / np.sqrt(denominator * new.shape[1]))

    def _shape(self, h: np.ndarray, new: np.ndarray, following: np.ndarray) -> np.ndarray:
        """The coefficients (7, m, N) of the interpolant of order 7: Hairer, Norsett, Wanner, sect. II.6."""
        _, _, _, extra, places, dense = _tables()
        k, m = self._stages, len(self.time)
        flat = k.reshape(len(k), -1)
        for s, (row, place) in enumerate(zip(extra, places, strict=True), start=13):
            within = self.state + (row[:s] @ flat[:s]).reshape(m, -1)
            np.multiply(self._slope(self.time + place * h[:, 0], within), h, out=k[s])
        rise = new - self.state
        out = np.empty((7, *rise.shape))
        out[0], out[1], out[2] = rise, k[0] - rise, 2 * rise - (h * following + k[0])
        out[3:] = (dense @ flat).reshape(4, m, -1)
        return out

    def _record(self, time: np.ndarray, state: np.ndarray, h: np.ndarray, shape: np.ndarray, taken: np.ndarray) -> None:
        """Keep the interpolants of the steps that were taken, and end the runs that have met a stop."""
        if self.landing.dense is not None:
            for j in np.flatnonzero(taken):
                self.landing.dense[self.rows[j]].append(time[j], h[j], state[j].copy(), shape[:, j].copy())
        at = np.flatnonzero(taken)
        if self.flow.stops is None or len(at) == 0:
            return
        step = Step(time[at], h[at], state[at], shape[:, at])
        which, part, stop = self.flow.stops.first(step, self.constants[at], self.signs[at])
        if len(which) == 0:
            return
        met = at[which]
        short = Dop853Flow(self.flow.engine, self.flow.system, None).ensemble(
            state[met], self.constants[met], start=time[met], until=time[met] + part * h[met]
        )
        there, shift = self.flow.stops.polished(short.states, self.constants[met], stop)
        self.state[met], self.time[met] = there, short.reached + shift
        self.landing.stopped_by[self.rows[met]] = stop
        ended = np.zeros(len(self.rows), dtype=bool)
        ended[met] = True
        self._end(ended, STOPPED)


@dataclass
class Pieces:
    """The dense output of one run: one polynomial for each step."""

    start: float
    _steps: list[tuple[float, float, np.ndarray, np.ndarray]] = field(default_factory=list, repr=False)

    def append(self, *step: Any) -> None:
        """Add the next step: its start, its length, the state there, its coefficients (7, N)."""
        self._steps.append(step)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States (m, N) at ``times`` (m,)."""
        begin, length = np.array([s[0] for s in self._steps]), np.array([s[1] for s in self._steps])
        way = math.copysign(1.0, length[0])
        at = np.searchsorted(way * (begin + length), way * times)
        at = np.minimum(at, len(begin) - 1)
        state = np.array([s[2] for s in self._steps])
        shape = np.stack([s[3] for s in self._steps], axis=1)
        return Step(begin, length, state, shape)[at]((times - begin[at]) / length[at])
