"""Dormand and Prince's method of order 8 with SciPy's coefficients, for all runs together.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sect. II.4 to II.6: each run has a step and an
error of its own, and the stages of all are one call of the system. SciPy's own loop has one step for all of them
together, so that the worst of thousands sets it for all; only its coefficients are taken. Nothing is compiled, so it is
cheap to start and takes any CasADi function, interpolated data included.
"""

from __future__ import annotations

import importlib.util
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Literal

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
from varcalc.integrators.stops import Interpolant, Stops
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator

REFINEMENT = 100.0
"""By how much the tolerance of each level is the smaller one."""
SMALLEST = 100 * float(np.finfo(float).eps)
"""The smallest relative tolerance that rounding leaves a meaning."""
LOOK = 1e-6
"""The tolerance of a look, where that of the engine is smaller."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
"""A new step is so much of the one that just meets the tolerance, and so many times the last at least and at most."""
TOGETHER = 8192
"""Runs that take their steps together."""
NOTED = 2000
"""So many runs at a time would be worth the compilation by heyoka: its absence is told."""
KEPT_AT = (2, 1, 0)
"""Which of the first three slopes is kept first, second and third: those that few stages need come before others."""
SPARSE = 16
"""So many runs are left together until half of them have ended: less is not worth rearranging."""


@spelled
@dataclass(frozen=True)
class Dop853:
    """Dormand and Prince's method of order 8. ``tolerance`` is relative to each state, or to the largest initial value.

    Each level takes a hundredth of it, and as many steps more as level 0 takes; level -1 is a look, to six digits.
    ``most_steps`` bounds those of one run.
    """

    tolerance: float = REFINEMENT * SMALLEST
    most_steps: int = 4000

    def tolerance_at(self, level: int) -> float:
        """The tolerance of a level."""
        return max(self.tolerance / REFINEMENT ** max(level, 0), LOOK if level < 0 else SMALLEST)

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
    """A system with its stops, which nothing has to be compiled for; its verbs are those of the protocol."""

    engine: Dop853
    system: ca.Function
    stops: Stops | None
    spare: dict[int, _Workspace] = field(default_factory=dict, repr=False, compare=False)
    """Memory for so many runs at a time, whose making costs as much as a step."""

    compiled = False

    @cached_property
    def rates(self) -> PointEvaluator:
        """dY/ds at many points."""
        return PointEvaluator(self.system)

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """:meth:`varcalc.integrators.protocol.Flow.trajectory`, as an ensemble of one without stops."""
        checked(abscissae, state, constants, self.system)
        bounds = None if longest is None else np.array([longest])
        return self._runs(abscissae, state[None, :], constants, level, bounds, dense=dense)[0]

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """:meth:`varcalc.integrators.protocol.Flow.trajectories`, as an ensemble without stops."""
        return self._runs(abscissae, states, constants, 0, None, dense=False)

    def _runs(
        self, abscissae: np.ndarray, starts: np.ndarray, constants: np.ndarray, level: int, longest: np.ndarray | None,
        *, dense: bool,
    ) -> list[Run]:  # fmt: skip
        inner, each = len(abscissae) > 2, np.broadcast_to(constants, (len(starts), len(constants)))
        ends = Dop853Flow(self.engine, self.system, None).ensemble(
            starts, each, start=abscissae[0], until=abscissae[-1], level=level, longest=longest, dense=dense or inner
        )
        states = np.full((len(starts), len(abscissae), starts.shape[1]), math.nan)
        states[:, 0] = starts
        runs: list[Run] = []
        for k, own in enumerate(states):
            reached = float(ends.reached[k])
            between = None if ends.dense is None else ends.dense[k]
            if inner and between is not None:
                there = np.abs(abscissae - abscissae[0]) <= abs(reached - abscissae[0])
                there[0] = False
                own[there] = between(abscissae[there])
            if ends.outcomes[k] == COMPLETED:
                own[-1] = ends.states[k]
            outcome = OUTCOMES[ends.outcomes[k]]
            runs.append(Run(abscissae, own, outcome, reached, int(ends.steps[k]), between if dense else None))
        return runs

    def ensemble(
        self,
        states: np.ndarray,
        constants: np.ndarray,
        *,
        start: np.ndarray | float = 0.0,
        until: np.ndarray | float = math.inf,
        level: int = 0,
        longest: np.ndarray | None = None,
        dense: bool = False,
        leaving: tuple[int, ...] = (),
    ) -> Landing:
        """:meth:`varcalc.integrators.protocol.Flow.ensemble`; each ``level`` halves the steps."""
        landing, until = begun(states, start, until, self.stops is not None)
        if len(states) >= NOTED:
            _note()
        bounds = np.full(len(states), math.inf) if longest is None else longest
        if longest is None and level > 0:  # smaller steps as well: few steps may be the same at any tolerance
            usual = self.ensemble(states, constants, start=start, until=until, leaving=leaving)
            bounds = np.abs(usual.reached - landing.reached) / (2**level * usual.steps + 1)
        kept: list[tuple[np.ndarray, Interpolant]] | None = [] if dense else None
        tolerance = self.engine.tolerance_at(level)
        for rows in np.array_split(np.arange(len(states)), max(1, -(-len(states) // TOGETHER))):
            _Runs(self, landing, constants, until, bounds, rows, tolerance, leaving, kept).go()
        if kept is not None:
            landing.dense = [DenseOutput.of(kept, row) for row in range(len(states))]
        return landing


def installed(package: str) -> bool:
    """Whether a package can be imported, without importing it; an import hook may say no by ImportError."""
    try:
        return importlib.util.find_spec(package) is not None
    except ImportError:
        return False


@lru_cache(maxsize=1)
def _note() -> None:
    """Tell, once, that large ensembles would be quicker with heyoka, unless it is there and this method was chosen."""
    if not installed("heyoka"):
        logging.getLogger("varcalc").warning(
            "heyoka is not installed: large bundles of rays and motions go by DOP853 on arrays, to the same digits, "
            "and up to eight times slower than by heyoka once it has compiled them. Where there is a wheel for it: "
            "python -m pip install heyoka"
        )


@lru_cache(maxsize=1)
def _tables() -> tuple[np.ndarray, ...]:
    """SciPy's coefficients: stages with the new state as the last, their places, errors, extra stages, dense output.

    They are of the slopes in the order of :data:`KEPT_AT`.
    """
    from scipy.integrate import DOP853

    stages = np.zeros((13, 13))
    stages[:12, :12], stages[12, :12] = DOP853.A, DOP853.B
    errors = np.stack([DOP853.E5, DOP853.E3])
    reordered = [table[..., [*KEPT_AT, *range(3, table.shape[-1])]] for table in (stages, errors, DOP853.A_EXTRA)]
    dense = DOP853.D[:, [*KEPT_AT, *range(3, DOP853.D.shape[1])]]
    return reordered[0], np.append(DOP853.C, 1.0), reordered[1], reordered[2], DOP853.C_EXTRA, dense


@lru_cache(maxsize=1)
def _used() -> list[slice]:
    """Where in memory the slopes are that each stage is made of: after the fourth neither the second nor the third."""
    nonzero = [np.flatnonzero(row) for row in _tables()[0]]
    return [slice(int(places[0]), int(places[-1]) + 1) if len(places) else slice(0) for places in nonzero]


class _Workspace:
    """Memory for a step of ``m`` runs of a system."""

    def __init__(self, rates: PointEvaluator, m: int) -> None:
        system = rates.function
        size = system.numel_in(1)
        self.order: Literal["C", "F"] = rates.order(m)
        self.time, self.constants = np.zeros(m), np.zeros((m, system.numel_in(2)), order=self.order)
        self.state, self.rates, self.sum = (np.zeros((m, size), order=self.order) for _ in range(3))
        self.call = rates.bound([self.time[:, None], self.state, self.constants], self.rates)
        # times the step
        stages = np.zeros((13, m, size)) if self.order == "C" else np.zeros((13, size, m)).transpose(0, 2, 1)
        self.stages: np.ndarray = stages

    def slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N), in memory that the next call overwrites."""
        self.time[:], self.state[:] = time, state
        self.call()
        return self.rates


class _Runs:
    """Runs that take their steps together; those that have ended go to ``landing``.

    ``longest`` (m,) bounds the steps of each. ``kept`` takes the interpolants of each step with the runs they are of.
    """

    def __init__(
        self, flow: Dop853Flow, landing: Landing, constants: np.ndarray, until: np.ndarray, longest: np.ndarray,
        rows: np.ndarray, tolerance: float, leaving: tuple[int, ...], kept: list[tuple[np.ndarray, Interpolant]] | None,
    ) -> None:  # fmt: skip
        self.flow, self.landing, self.tolerance, self.rows, self.kept = flow, landing, tolerance, rows, kept
        self.time: np.ndarray = landing.reached[rows]
        self.bound: np.ndarray = until[rows]
        self.state = landing.states[rows]
        self.constants, self.longest = constants[rows], longest[rows]
        self.way = np.where(self.bound < self.time, -1.0, 1.0)
        self.live: np.ndarray = np.ones(len(rows), dtype=bool)
        self.refused = np.zeros(len(rows), dtype=bool)
        self.met: list[tuple[np.ndarray, ...]] = []
        self.floor = tolerance * np.maximum(1.0, np.abs(self.state).max(axis=1, initial=0.0))[:, None]
        self.signs = np.zeros((len(rows), 0))
        if flow.stops is not None:
            self.signs = flow.stops.sides(self.state, self.constants, leaving)
        self._allocate()

    def _allocate(self) -> None:
        """Memory for as many runs as there are now."""
        self.work = self.flow.spare.pop(len(self.rows), None) or _Workspace(self.flow.rates, len(self.rows))
        self.work.constants[:] = self.constants
        self.state = np.asarray(self.state, order=self.work.order)

    def _give_back(self) -> None:
        if len(self.work.time) <= SPARSE:
            self.flow.spare[len(self.work.time)] = self.work

    def go(self) -> None:
        """Carry all runs to their ends."""
        with np.errstate(all="ignore"):
            self.slope = self.work.slope(self.time, self.state).copy("K")
            self._end(np.asarray(~np.isfinite(self.slope).all(axis=1)), NOT_FINITE)
            self._end(self.live & (self.time == self.bound), COMPLETED)
            self.step = self._first_steps()
            while self.live.any():
                if len(self.rows) > SPARSE and 2 * np.count_nonzero(self.live) <= len(self.rows):
                    self._rearrange()
                self._advance()
                self.landing.rounds += 1
            self._land()
        self._give_back()

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
        self.constants = self.constants[kept]
        self._give_back()
        self.live = np.ones(len(self.rows), dtype=bool)
        self._allocate()

    def _first_steps(self) -> np.ndarray:
        """The first steps (m,): Hairer, Norsett, Wanner, sect. II.4."""
        scale = self.floor + self.tolerance * np.abs(self.state)
        d0, d1 = (np.sqrt(np.mean((v / scale) ** 2, axis=1)) for v in (self.state, self.slope))
        most = np.minimum(np.abs(self.bound - self.time), self.longest)
        trial = np.fmin(np.where((d0 < 1e-5) | (d1 < 1e-5), 1e-6, 0.01 * d0 / d1), most)
        trial = np.where(trial > 0, trial, 1e-6)
        move = (trial * self.way)[:, None]
        after = self.work.slope(self.time + move[:, 0], self.state + move * self.slope)
        d2 = np.sqrt(np.mean(((after - self.slope) / scale) ** 2, axis=1)) / trial
        steepest = np.fmax(d1, d2)
        other = np.where(steepest <= 1e-15, np.maximum(1e-6, trial * 1e-3), (0.01 / steepest) ** (1 / 8))
        return np.fmin(np.fmin(100 * trial, other), most)

    def _advance(self) -> None:
        """One step of every run, or another try, shorter."""
        least = 10 * np.spacing(np.abs(self.time))
        size = np.fmin(np.fmax(self.step, least), self.longest)
        if self.refused.any():
            self._end(self.live & self.refused & (self.step < least), BLOW_UP)
            size = np.where(self.refused, self.step, size)
        end = self.time + size * self.way
        end = np.where(self.way * (end - self.bound) > 0, self.bound, end)
        h = end - self.time
        new, following = self._stages_of(h, end)
        error = self._error(new)
        factor = np.fmin(np.fmax(SAFETY * error ** (-1 / 8), SHRINK), GROW)
        taken = self.live & (error < 1)
        looked = self._looked_at(taken, h, new, following)
        step = self._interpolant(looked, h, new, following) if len(looked) else None
        if self.refused.any():
            factor = np.where(taken & self.refused, np.minimum(1.0, factor), factor)
        self.step, self.refused = np.abs(h) * factor, self.live & ~taken
        if taken.all():
            self.time, self.state, self.slope = end, new, following
        else:
            column = taken[:, None]
            self.time, self.state = np.where(taken, end, self.time), np.where(column, new, self.state)
            self.slope = np.where(column, following, self.slope)
        self.landing.steps[self.rows[taken]] += 1
        if step is not None:
            self._record(looked, step)
        self._end(self.live & (self.time == self.bound), COMPLETED)
        if self.landing.rounds + 1 >= self.flow.engine.most_steps:
            self._end(self.live & (self.landing.steps[self.rows] >= self.flow.engine.most_steps), TOO_MANY_STEPS)

    def _stages_of(self, h: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state after the step, and the rate there."""
        stages, places, *_ = _tables()
        work, column = self.work, h[:, None]
        k, total, state, rates = work.stages, work.sum, work.state, work.rates
        times = self.time + places[:, None] * h
        times[12] = end
        np.multiply(self.slope, column, out=k[KEPT_AT[0]])
        for s, used in enumerate(_used()[1:], start=1):
            _combined(stages[s, used], k[used], total)
            np.add(self.state, total, out=state)
            work.time[:] = times[s]
            work.call()
            np.multiply(rates, column, out=k[KEPT_AT[s] if s < len(KEPT_AT) else s])
        return state.copy("K"), rates.copy("K")

    def _error(self, new: np.ndarray) -> np.ndarray:
        """The error (m,) of the step relative to the tolerance: that of order 5, corrected by that of order 3."""
        errors = _tables()[2]
        scale = self.floor + np.maximum(np.abs(self.state), np.abs(new)) * self.tolerance
        off = [_combined(weights, self.work.stages[:13]) / scale for weights in errors]
        fifth, third = (np.einsum("mn,mn->m", part, part) for part in off)
        denominator = fifth + 0.01 * third
        return np.where(denominator == 0, 0.0, fifth / np.sqrt(denominator * new.shape[1]))

    def _looked_at(self, taken: np.ndarray, h: np.ndarray, new: np.ndarray, following: np.ndarray) -> np.ndarray:
        """The runs whose step has to be known between its ends: it is kept, or may meet a stop."""
        if self.kept is not None:
            return np.flatnonzero(taken)
        if self.flow.stops is None:
            return np.zeros(0, dtype=int)
        ends, rates = (self.state, new), (self.slope, following)
        return np.flatnonzero(taken & self.flow.stops.may_stop(ends, rates, h, self.constants, self.signs))

    def _interpolant(self, at: np.ndarray, h: np.ndarray, new: np.ndarray, following: np.ndarray) -> Interpolant:
        """The interpolant of order 7 of the steps of some runs: Hairer, Norsett, Wanner, sect. II.6."""
        _, _, _, extra, places, dense = _tables()
        time, state, length, constants = self.time[at], self.state[at], h[at], self.constants[at]
        m, column = len(at), length[:, None]
        k = np.empty((16, m, state.shape[1]))
        k[:13] = self.work.stages[:13, at]
        for s, (row, place) in enumerate(zip(extra, places, strict=True), start=13):
            within = state + _combined(row[:s], k[:s])
            np.multiply(self.flow.rates(m, (time + place * length)[:, None], within, constants), column, out=k[s])
        rise = new[at] - state
        shape = np.empty((7, *rise.shape))
        first = k[KEPT_AT[0]]
        shape[0], shape[1] = rise, first - rise
        shape[2] = 2 * rise - (column * following[at] + first)
        for row, out in zip(dense, shape[3:], strict=True):
            out[:] = _combined(row, k)
        return Interpolant(time, length, state, shape)

    def _record(self, at: np.ndarray, step: Interpolant) -> None:
        """Keep the interpolants of the steps of some runs, and end those that have met a stop."""
        if self.kept is not None:
            self.kept.append((self.rows[at], step))
        if self.flow.stops is None:
            return
        which, part, stop = self.flow.stops.first(step, self.constants[at], self.signs[at])
        if len(which) == 0:
            return
        met = at[which]
        until = step.time[which] + part * step.length[which]
        self.met.append((self.rows[met], step.time[which], until, step.state[which], self.constants[met], stop))
        ended = np.zeros(len(self.rows), dtype=bool)
        ended[met] = True
        self._end(ended, STOPPED)

    def _land(self) -> None:
        """Carry the runs that met a stop onto it from where their last step began, all of them together."""
        if self.flow.stops is None or not self.met:
            return
        rows, start, until, states, constants, stop = (np.concatenate(parts) for parts in zip(*self.met, strict=True))
        free = Dop853Flow(self.flow.engine, self.flow.system, None)
        short = free.ensemble(states, constants, start=start, until=until)
        there, shift = self.flow.stops.polished(short.states, constants, stop)
        self.landing.states[rows], self.landing.reached[rows] = there, short.reached + shift
        self.landing.stopped_by[rows] = stop


def _combined(weights: np.ndarray, stages: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """The sum (m, N) of ``stages`` (k, m, N) by their ``weights`` (k,), on one core.

    BLAS would take all cores for what takes microseconds, and so would every other of the threads at work.
    """
    return np.einsum("k,kmn->mn", weights, stages, out=out)


@dataclass(frozen=True)
class DenseOutput:
    """The dense output of one run: its ``steps`` (K,), one after the other."""

    steps: Interpolant

    @classmethod
    def of(cls, kept: Sequence[tuple[np.ndarray, Interpolant]], row: int) -> DenseOutput | None:
        """The steps of one run among all that were ``kept`` with their rows; None where there was none."""
        own = [step[np.flatnonzero(rows == row)] for rows, step in kept if row in rows]
        return cls(Interpolant.joined(own)) if own else None

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States (m, N) at ``times`` (m,)."""
        steps = self.steps
        way = math.copysign(1.0, steps.length[0])
        at = np.searchsorted(way * (steps.time + steps.length), way * times)
        at = np.minimum(at, len(steps.time) - 1)
        return steps[at]((times - steps.time[at]) / steps.length[at])
