"""Runs that take their steps together, each with a step and an error of its own, by an embedded method.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sect. II.4: SciPy's own loop has one step for all
of them together, so that the worst of thousands sets it for all.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np

from varcalc.integrators.protocol import BLOW_UP, COMPLETED, NOT_FINITE, STOPPED, TOO_MANY_STEPS, Landing
from varcalc.integrators.stops import Interpolant, Stops

SHRINK, GROW = 0.2, 10.0
"""A new step is so many times the last at least and at most."""
SPARSE = 16
"""So many runs are left together until half of them have ended: less is not worth rearranging."""


class Stepper(Protocol):
    """Memory for a step of m runs of a system, and what makes it there; ``constants`` (m, c) are those of the runs."""

    constants: np.ndarray
    order: Literal["C", "F"]
    """How states (m, N) lie in memory."""

    def slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N)."""
        ...

    def step(
        self, time: np.ndarray, end: np.ndarray, state: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The states (m, N) at ``end`` (m,), and the slopes there."""
        ...

    def error(self, size: np.ndarray) -> np.ndarray:
        """The error (m,) of the step just made, each state's as a part of its ``size`` (m, N)."""
        ...

    def interpolant(
        self, at: np.ndarray, time: np.ndarray, length: np.ndarray, ends: tuple[np.ndarray, np.ndarray],
        slopes: tuple[np.ndarray, np.ndarray], *, dense: bool,
    ) -> Interpolant:  # fmt: skip
        """The solution within the step just made of the runs ``at``, by its states and slopes (m, N) at both ends.

        It is good enough to find a stop by, and where it is asked to be ``dense`` as good as the ends.
        """
        ...


class EmbeddedMethod(Protocol):
    """An embedded method for a system; it keeps memory, whose making costs as much as a step."""

    power: float
    """By which power of its length the error of a step goes."""
    safety: float
    """A new step is so much of the one that just meets the tolerance: less where the power is great."""
    least: float
    """The smallest tolerance that leaves its error a meaning."""

    @property
    def spare(self) -> dict[int, Any]:
        """Memory for so many runs at a time that is not in use."""
        ...

    def room(self, m: int) -> Stepper:
        """Memory for ``m`` runs."""
        ...


class Runs:
    """Runs that take their steps together; those that have ended go to ``landing``.

    ``longest`` (m,) bounds the steps of each, ``most_steps`` their number. ``kept`` takes the interpolants of each step
    with the runs they are of.
    """

    def __init__(
        self, method: EmbeddedMethod, stops: Stops | None, landing: Landing, constants: np.ndarray, until: np.ndarray,
        longest: np.ndarray, rows: np.ndarray, tolerance: float, most_steps: int, leaving: tuple[int, ...],
        kept: list[tuple[np.ndarray, Interpolant]] | None,
    ) -> None:  # fmt: skip
        self.method, self.stops, self.landing, self.kept = method, stops, landing, kept
        self.rows, self.tolerance, self.most_steps = rows, tolerance, most_steps
        self.time: np.ndarray = landing.reached[rows]
        self.bound: np.ndarray = until[rows]
        self.state = landing.states[rows]
        self.constants, self.longest = constants[rows], longest[rows]
        self.way = np.where(self.bound < self.time, -1.0, 1.0)
        self.live: np.ndarray = np.ones(len(rows), dtype=bool)
        self.refused = np.zeros(len(rows), dtype=bool)
        self.met: list[tuple[np.ndarray, ...]] = []
        self.floor = np.maximum(1.0, np.abs(self.state).max(axis=1, initial=0.0))[:, None]
        self.signs = np.zeros((len(rows), 0))
        if stops is not None:
            self.signs = stops.sides(self.state, self.constants, leaving)
        self._allocate()

    def _allocate(self) -> None:
        """Memory for as many runs as there are now."""
        self.work = self.method.room(len(self.rows))
        self.work.constants[:] = self.constants
        self.state = np.asarray(self.state, order=self.work.order)

    def _give_back(self) -> None:
        if len(self.rows) <= SPARSE:
            self.method.spare[len(self.rows)] = self.work

    def go(self) -> None:
        """Carry all runs to their ends."""
        with np.errstate(all="ignore"):
            self.slope = self.work.slope(self.time, self.state)
            self._end(np.asarray(~np.isfinite(self.slope).all(axis=1)), NOT_FINITE)
            self._end(self.live & (self.time == self.bound), COMPLETED)
            self.step = self._first_steps()
            while self.live.any():
                if len(self.rows) > SPARSE and 2 * np.count_nonzero(self.live) <= len(self.rows):
                    self._rearrange()
                self._advance()
                self.landing.rounds += 1
            self._give_back()
            self._land()

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
        self._give_back()
        for name in ("rows", "time", "state", "bound", "longest", "way", "refused", "floor", "signs", "slope", "step"):
            setattr(self, name, getattr(self, name)[kept])
        self.constants = self.constants[kept]
        self.live = np.ones(len(self.rows), dtype=bool)
        self._allocate()

    def _first_steps(self) -> np.ndarray:
        """The first steps (m,): Hairer, Norsett, Wanner, sect. II.4."""
        scale = self.tolerance * (self.floor + np.abs(self.state))
        d0, d1 = (np.sqrt(np.mean((v / scale) ** 2, axis=1)) for v in (self.state, self.slope))
        most = np.minimum(np.abs(self.bound - self.time), self.longest)
        trial = np.fmin(np.where((d0 < 1e-5) | (d1 < 1e-5), 1e-6, 0.01 * d0 / d1), most)
        trial = np.where(trial > 0, trial, 1e-6)
        move = (trial * self.way)[:, None]
        after = self.work.slope(self.time + move[:, 0], self.state + move * self.slope)
        d2 = np.sqrt(np.mean(((after - self.slope) / scale) ** 2, axis=1)) / trial
        steepest = np.fmax(d1, d2)
        power = 1 / self.method.power
        other = np.where(steepest <= 1e-15, np.maximum(1e-6, trial * 1e-3), (0.01 / steepest) ** power)
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
        new, following = self.work.step(self.time, end, self.state, self.slope)
        error = self.work.error(self.floor + np.maximum(np.abs(self.state), np.abs(new))) / self.tolerance
        factor = np.fmin(np.fmax(self.method.safety * error ** (-1 / self.method.power), SHRINK), GROW)
        taken = self.live & (error < 1)
        looked = self._looked_at(taken, h, new, following)
        step = None
        if len(looked):
            ends, slopes = (self.state, new), (self.slope, following)
            step = self.work.interpolant(looked, self.time, h, ends, slopes, dense=self.kept is not None)
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
        if self.landing.rounds + 1 >= self.most_steps:
            self._end(self.live & (self.landing.steps[self.rows] >= self.most_steps), TOO_MANY_STEPS)

    def _looked_at(self, taken: np.ndarray, h: np.ndarray, new: np.ndarray, following: np.ndarray) -> np.ndarray:
        """The runs whose step has to be known between its ends: it is kept, or may meet a stop."""
        if self.kept is not None:
            return np.flatnonzero(taken)
        if self.stops is None:
            return np.zeros(0, dtype=int)
        ends, rates = (self.state, new), (self.slope, following)
        return np.flatnonzero(taken & self.stops.may_stop(ends, rates, h, self.constants, self.signs))

    def _record(self, at: np.ndarray, step: Interpolant) -> None:
        """Keep the interpolants of the steps of some runs, and end those that have met a stop."""
        if self.kept is not None:
            self.kept.append((self.rows[at], step))
        if self.stops is None:
            return
        which, part, stop = self.stops.first(step, self.constants[at], self.signs[at])
        if len(which) == 0:
            return
        met = at[which]
        until = step.time[which] + part * step.length[which]
        self.met.append((self.rows[met], step.time[which], until, step.state[which], self.constants[met], stop))
        ended = np.zeros(len(self.rows), dtype=bool)
        ended[met] = True
        self._end(ended, STOPPED)

    def _land(self) -> None:
        """Carry the runs that met a stop onto it from where their last step began, all of them together.

        That takes one step, shorter than the one that was good enough.
        """
        if self.stops is None or not self.met:
            return
        rows, start, until, states, constants, stop = (np.concatenate(parts) for parts in zip(*self.met, strict=True))
        work = self.method.room(len(rows))
        work.constants[:] = constants
        states = np.asarray(states, order=work.order)
        there, _ = work.step(start, until, states, work.slope(start, states))
        there, shift = self.stops.polished(there, constants, stop)
        self.landing.states[rows], self.landing.reached[rows] = there, until + shift
        self.landing.stopped_by[rows] = stop


def combined(weights: np.ndarray, stages: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """The sum (m, N) of ``stages`` (k, m, N) by their ``weights`` (k,), on one core.

    BLAS would take all cores for what takes microseconds, and so would every other of the threads at work.
    """
    return np.einsum("k,kmn->mn", weights, stages, out=out)
