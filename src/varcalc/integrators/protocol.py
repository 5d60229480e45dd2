"""What an integrator of initial-value problems must offer.

An :class:`Engine` compiles an explicit first-order system, given as a CasADi
``Function(s, Y, constants) -> dY/ds``, into a :class:`Flow` of three verbs: one
trajectory, several through the same abscissae, and an ensemble of many states until their ends.
Sensitivities are states like any other:
:func:`varcalc.integrators.variational.variational` appends the variational
equations to a system.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import casadi as ca
import numpy as np


class RunOutcome(Enum):
    """How an integration ended; each member carries its meaning."""

    COMPLETED = "the last abscissa was reached"
    STOPPED = "a stopping function became zero"
    NOT_FINITE = "the right-hand side is not a number at the initial values"
    BLOW_UP = "the solution leaves every bound, or the domain of the system, before the last abscissa"
    UNRESOLVED = "no smooth solution was found between the singular end and a place near it"
    TOO_MANY_STEPS = "the limit on the number of steps was reached"
    UNDECIDED = "where a switch turns over, the equations go on in no way, or in several"
    IMPULSE = "what is integrated jumps where a switch turns over, which is an impulse that no rate gives"


@dataclass(frozen=True)
class Run:
    """One integration: ``states`` (k, N) at the k ``abscissae``, the first of which is the start.

    Where the outcome is not COMPLETED the rows beyond ``reached`` are NaN, and
    ``outcome`` says why. ``trajectory`` takes abscissae (m,) between the start
    and ``reached`` to states (m, N); it is there only when asked for.
    """

    abscissae: np.ndarray
    states: np.ndarray
    outcome: RunOutcome
    reached: float
    steps: int
    trajectory: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def completed(self) -> bool:
        """True when every abscissa was reached."""
        return self.outcome is RunOutcome.COMPLETED


OUTCOMES = tuple(RunOutcome)
"""What the small integers of :attr:`Landing.outcomes` stand for."""
COMPLETED, STOPPED, NOT_FINITE, BLOW_UP, TOO_MANY_STEPS = (
    OUTCOMES.index(o)
    for o in (
        RunOutcome.COMPLETED,
        RunOutcome.STOPPED,
        RunOutcome.NOT_FINITE,
        RunOutcome.BLOW_UP,
        RunOutcome.TOO_MANY_STEPS,
    )
)
NONE = -1
"""In place of the number of a stopping function: none of them."""


@dataclass
class Landing:
    """Where m integrations ended, each at an abscissa of its own.

    ``states`` (m, N) at the abscissae ``reached`` (m,); ``outcomes`` (m,) are indices into
    :data:`OUTCOMES`, ``stopped_by`` (m,) the numbers of the stopping functions that were met, or
    :data:`NONE`, ``steps`` (m,) what each took. A run that failed keeps the last state that is
    known, never NaN. ``dense``, there only when asked for, has for each run a function from abscissae
    (k,) between its start and its end to states (k, N). ``rounds`` counts the steps that runs took together, refused
    ones among them, where they go side by side.
    """

    states: np.ndarray
    reached: np.ndarray
    outcomes: np.ndarray
    stopped_by: np.ndarray
    steps: np.ndarray
    dense: Sequence[Any] | None = None
    rounds: int = 0

    @classmethod
    def at(cls, states: np.ndarray, start: np.ndarray | float = 0.0, outcome: int = COMPLETED) -> Landing:
        """Runs that are where they begin."""
        m = len(states)
        reached = np.array(np.broadcast_to(np.asarray(start, dtype=float), (m,)))
        return cls(
            np.array(states, dtype=float), reached, np.full(m, outcome, np.int8), np.full(m, NONE, np.int16),
            np.zeros(m, dtype=int),
        )  # fmt: skip

    def carry_on(self, rows: np.ndarray, part: Landing, last: np.ndarray | float = math.inf) -> None:
        """Take over where a ``part`` led the runs ``rows``, which went on in it from where they were.

        Its abscissae count from there; those of the ends asked for are ``last`` (m,).
        """
        self.states[rows], self.outcomes[rows], self.stopped_by[rows] = part.states, part.outcomes, part.stopped_by
        done = part.outcomes == COMPLETED  # the sum of the parts is not told so well
        ends = np.broadcast_to(last, len(self.reached))[rows]
        self.reached[rows] = np.where(done, ends, self.reached[rows] + part.reached)


class Flow(Protocol):
    """A compiled system with its stopping functions, ready to be integrated any number of times.

    An event on one trajectory is :meth:`ensemble` for its abscissa and then :meth:`trajectory` up to it.
    """

    @property
    def compiled(self) -> bool:
        """True where a step is machine code, not a series of calls from Python."""
        ...

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """Carry ``state`` (N,) from the first of the ``abscissae`` (k,), which are monotone, to the others.

        Each ``level`` integrates more carefully than the one before, so that
        the difference between two tells the error of the lower one; ``longest`` bounds
        the steps, where their number at level 0 need not be found out; ``dense``
        keeps the trajectory between the abscissae. Stopping functions do not count.
        """
        ...

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """What :meth:`trajectory` gives from each row of ``states`` (m, N), in less time than one by one."""
        ...

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
        """Carry each row of ``states`` (m, N), with its row of ``constants`` (m, c), to an end of its own.

        That is its abscissa ``until``, either way from its ``start``, or where one of the stopping
        functions crosses zero, located to round-off, whichever comes first; where there are such functions,
        runs go forwards. ``leaving`` are the numbers of those that are zero, to round-off, at the start of
        every run: those zeros do not count, later ones do. ``level`` and ``dense`` are those of :meth:`trajectory`,
        and level -1 is a look, as careless as the engine can be; ``longest`` is (m,).
        ValueError where a run has no end: neither stopping functions nor a finite ``until``.
        """
        ...


class Engine(Protocol):
    """An integrator with its options."""

    @property
    def name(self) -> str:
        """What to call it in a message."""
        ...

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,
        at_ends: tuple[int, ...] = (),
    ) -> Flow:  # fmt: skip
        """Prepare ``system``: ``(s, Y (N,), constants (c,)) -> dY/ds (N,)``, with ``stops``: the same to (k,).

        Where there are stops, neither may depend on s. The last ``watching`` states are there to bound the steps alone:
        nothing depends on them, and they need not be right. Stops with the numbers ``at_ends`` are floors that a run
        sinks to slowly: it ends at the latest after the first step that ends below one. Raises
        :class:`varcalc.integrators.lowering.CannotLower`
        when the system holds an operation the engine does not know.
        """
        ...


def begun(
    states: np.ndarray, start: np.ndarray | float, until: np.ndarray | float, stopping: bool
) -> tuple[Landing, np.ndarray]:
    """An ensemble at its start, and where each run is to end (m,); ValueError where one has no end."""
    landing = Landing.at(states, start)
    ends = np.array(np.broadcast_to(np.asarray(until, dtype=float), (len(states),)))
    if not (stopping or np.all(np.isfinite(ends))):
        raise ValueError("without stopping functions each run needs a finite abscissa to end at")
    return landing, ends


def check_system(system: ca.Function) -> int:
    """The dimension N of the state; ValueError when ``system`` is no right-hand side."""
    if system.n_in() != 3 or system.n_out() != 1:
        raise ValueError(f"a system takes (s, Y, constants) and returns dY/ds; {system} does not")
    if system.numel_in(0) != 1 or system.numel_in(1) != system.numel_out(0):
        raise ValueError(f"s must be a scalar and dY/ds must have as many entries as Y; {system} has other shapes")
    return int(system.numel_in(1))


def checked(abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, system: ca.Function) -> None:
    """Raise ValueError for arguments of :meth:`Flow.trajectory` that do not fit the system."""
    steps = np.diff(abscissae)
    if abscissae.ndim != 1 or len(abscissae) < 2 or not (np.all(steps > 0) or np.all(steps < 0)):
        raise ValueError(f"abscissae must be two or more, all ascending or all descending, not {abscissae}")
    if state.shape != (system.numel_in(1),) or constants.shape != (system.numel_in(2),):
        raise ValueError(
            f"the system has {system.numel_in(1)} states and {system.numel_in(2)} constants, "
            f"not {state.shape} and {constants.shape}"
        )
