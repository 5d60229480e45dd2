"""Motions of a system: one with its events and what it keeps, and many at once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from varcalc.axes import Axis, measured
from varcalc.integrators.protocol import OUTCOMES, Flow, RunOutcome
from varcalc.mechanics.arguments import times_within
from varcalc.problem.conditions import function as check_function
from varcalc.problem.conditions import reals, text, truth
from varcalc.showing import Brief, Fact, Plotted, counted, line
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator

MOST_NAMES = 4
"""Coordinates and events that a print names."""
CHECKED_TIMES = 257
"""Times of a motion at which invariants, and the error, are looked at."""


@spelled
@dataclass(frozen=True, repr=False)
class Event(Brief):
    """Where ``function(t, q, v[, p])`` comes through zero; the motion ends there if it is ``terminal``.

    ``direction`` 1 asks for rising zeros only, -1 for falling ones, 0 for both. Raises TypeError or ValueError for
    arguments of another kind.
    """

    function: Callable[..., Any]
    name: str = "event"
    direction: int = 0
    terminal: bool = False

    def __post_init__(self) -> None:
        check_function("Event.function", self.function)
        text("Event.name", self.name)
        whole_number = isinstance(self.direction, int | np.integer) and not isinstance(self.direction, bool)
        if not whole_number or self.direction not in (-1, 0, 1):
            raise ValueError(f"Event.direction must be 1 (rising), -1 (falling) or 0 (both), not {self.direction!r}")
        truth("Event.terminal", self.terminal)


@dataclass(frozen=True, repr=False, eq=False)
class Happening(Brief):
    """An event that took place at the time ``t``, in the state ``q``, ``v`` (n,)."""

    name: str
    t: float
    q: np.ndarray
    v: np.ndarray


@dataclass(frozen=True, repr=False, eq=False)
class Motion(Plotted):
    """A motion from ``span[0]`` to ``span[1]``: coordinates and rates as functions of time, and what it keeps.

    ``error`` bounds how far the coordinates are off anywhere, as the difference from a motion that is integrated more
    carefully tells; ``drift`` how far each invariant of L goes from where it was, in its own units, by name.
    ``outcome`` says why it ended, ``events`` what happened on the way, ``steps`` what it took.
    """

    span: tuple[float, float]
    outcome: RunOutcome
    error: float
    drift: Mapping[str, float]
    events: tuple[Happening, ...]
    steps: int
    numbers: np.ndarray = field(repr=False)
    states: Callable[[np.ndarray], np.ndarray] = field(repr=False)
    """From times (m,) to states (m, 2n)."""
    measured: PointEvaluator = field(repr=False)
    """Of the state: the energy and the reactions (n,)."""
    axes: tuple[Axis, ...] = field(repr=False, default=())
    """Names and units of the time and the coordinates."""

    def __repr__(self) -> str:
        first, last = self.span
        return line(
            "Motion", [*(axis.name for axis in self.axes[1:]), f"from {first:g} to {last:g}", self.outcome.name]
        )

    def _headline(self) -> str:
        first, last = self.span
        coordinates = self.axes[1:]
        names = ", ".join(axis.name for axis in coordinates[:MOST_NAMES])
        if len(coordinates) > MOST_NAMES:
            names += f" and {len(coordinates) - MOST_NAMES} more"
        ends = measured(f"{self._time.name} = {first:g} to {last:g}", self._time.unit)
        return f"A motion{' of ' + names if names else ''} from {ends}"

    @property
    def _time(self) -> Axis:
        return self.axes[0] if self.axes else Axis("t")

    def _facts(self) -> Iterator[Fact]:
        yield Fact("ended", f"{self.outcome.value}, after {counted(self.steps, 'step')}")
        yield Fact("coordinates", f"known to {self.error:.1g}")
        yield from (Fact(name, f"kept to {drift:.1g}") for name, drift in self.drift.items())
        for event in self.events[:MOST_NAMES]:
            yield Fact(event.name, f"at {self._time.at([event.t], 12)}, q = {np.array2string(event.q, precision=6)}")
        if len(self.events) > MOST_NAMES:
            yield Fact("", f"and {counted(len(self.events) - MOST_NAMES, 'more event')}")

    @property
    def completed(self) -> bool:
        """True when it came to its last time, or to an event that ends it."""
        return self.outcome is RunOutcome.COMPLETED

    def _at(self, t: Any) -> tuple[np.ndarray, tuple[int, ...]]:
        times = times_within(t, self.span)
        return self.states(times.ravel()), times.shape

    def q(self, t: Any) -> np.ndarray:
        """The coordinates, shape (n,) + t.shape, at times of any shape."""
        states, shape = self._at(t)
        n = states.shape[1] // 2
        return states[:, :n].T.reshape(n, *shape)

    def v(self, t: Any) -> np.ndarray:
        """The rates of the coordinates, shape (n,) + t.shape."""
        states, shape = self._at(t)
        n = states.shape[1] // 2
        return states[:, n:].T.reshape(n, *shape)

    def _measured(self, t: Any) -> tuple[np.ndarray, tuple[int, ...]]:
        states, shape = self._at(t)
        n, times = states.shape[1] // 2, reals("t", t).reshape(-1, 1)
        columns = times, states[:, :n], states[:, n:], self.numbers[None, :]
        return self.measured(len(states), *columns), shape

    def energy(self, t: Any) -> np.ndarray:
        """Jacobi's integral v·L_v - L, in the shape of ``t``."""
        values, shape = self._measured(t)
        return values[:, 0].reshape(shape)

    def reactions(self, t: Any) -> np.ndarray:
        """The generalised forces by which constraints hold the motion, shape (n,) + t.shape; zero without any."""
        values, shape = self._measured(t)
        return values[:, 1:].T.reshape(values.shape[1] - 1, *shape)


@dataclass(frozen=True)
class Checkpoints:
    """A long motion, known at ``times`` (k,) by its ``states`` (k, 2n), and carried on from there when asked for."""

    flow: Flow
    numbers: np.ndarray
    times: np.ndarray
    states: np.ndarray

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """States (m, 2n) at times (m,)."""
        known = np.flatnonzero(np.isfinite(self.states[:, 0]))
        piece = np.clip(np.searchsorted(self.times[known], t, side="right") - 1, 0, len(known) - 1)
        out = self.states[known[piece]]
        for number in np.unique(piece[t > self.times[known[piece]]]):
            rows = np.flatnonzero((piece == number) & (t > self.times[known[number]]))
            ahead, back = np.unique(t[rows], return_inverse=True)
            begin = known[number]
            run = self.flow.trajectory(np.append(self.times[begin], ahead), self.states[begin], self.numbers)
            out[rows] = run.states[1:][back]
        return out


@dataclass(frozen=True, repr=False, eq=False)
class Ensemble(Plotted):
    """m motions at k ``times``: coordinates ``q`` and rates ``v`` (m, n, k), not numbers beyond where one ended.

    ``outcomes`` (m,) say how each ended.
    """

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    outcomes: tuple[RunOutcome, ...]
    axes: tuple[Axis, ...] = field(repr=False, default=())
    """Names and units of the time and the coordinates."""

    def __repr__(self) -> str:
        return line("Ensemble", [counted(len(self.q), "motion"), counted(len(self.times), "time")])

    def _headline(self) -> str:
        return f"{counted(len(self.q), 'motion')} at {counted(len(self.times), 'time')}"

    def _facts(self) -> Iterator[Fact]:
        unit = self.axes[0].unit if self.axes else ""
        yield Fact("times", measured(f"from {self.times[0]:g} to {self.times[-1]:g}", unit))
        for outcome, number in Counter(self.outcomes).items():
            yield Fact(counted(number, "motion"), outcome.value)

    @property
    def completed(self) -> np.ndarray:
        """True (m,) for motions that came to the last time."""
        return np.array([outcome is RunOutcome.COMPLETED for outcome in self.outcomes])


def carried(
    flow: Flow, states: np.ndarray, numbers: np.ndarray, times: np.ndarray, axes: tuple[Axis, ...] = ()
) -> Ensemble:
    """Many initial states (m, 2n) at the first of the ``times`` (k,), to the others."""
    m, n = len(states), states.shape[1] // 2
    out = np.full((m, len(times), 2 * n), np.nan)
    out[:, 0], codes, going = states, np.zeros(m, dtype=int), np.arange(m)
    constants = np.broadcast_to(numbers, (m, len(numbers)))
    for k in range(1, len(times)):
        if len(going) == 0:
            break
        landing = flow.ensemble(out[going, k - 1], constants[going], start=times[k - 1], until=times[k])
        done = landing.outcomes == OUTCOMES.index(RunOutcome.COMPLETED)
        out[going[done], k] = landing.states[done]
        codes[going] = landing.outcomes
        going = going[done]
    every = np.swapaxes(out, 1, 2)
    return Ensemble(times, every[:, :n], every[:, n:], tuple(OUTCOMES[c] for c in codes), axes)


def happenings(
    flow: Flow, state: np.ndarray, numbers: np.ndarray, span: tuple[float, float], events: tuple[Event, ...],
    rates: PointEvaluator,
) -> tuple[tuple[Happening, ...], float]:  # fmt: skip
    """What happens on a motion, and the time at which it ends: one event after the other, located to round-off.

    The states of ``flow`` end with the time; ``rates`` gives how fast the functions of the events change.
    """
    found: list[Happening] = []
    n, t, here, leaving = len(state) // 2, span[0], np.append(state, span[0]), ()
    level = rates(1, here[None, :], numbers[None, :])[0, : len(events)]
    leaving = tuple(np.flatnonzero(level == 0).tolist())
    while t < span[1]:
        landing = flow.ensemble(
            here[None, :], numbers[None, :], start=np.array([t]), until=np.array([span[1]]), leaving=leaving
        )
        here, t = landing.states[0], float(landing.states[0, -1])
        if OUTCOMES[int(landing.outcomes[0])] is not RunOutcome.STOPPED:
            return tuple(found), span[1] if math.isclose(t, span[1]) else t
        number = int(landing.stopped_by[0])
        event, leaving = events[number], (number,)
        slope = rates(1, here[None, :], numbers[None, :])[0, len(events) + number]
        if event.direction * slope >= 0:
            found.append(Happening(event.name, t, here[:n].copy(), here[n : 2 * n].copy()))
            if event.terminal:
                return tuple(found), t
    return tuple(found), span[1]
