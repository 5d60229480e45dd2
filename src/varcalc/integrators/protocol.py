"""What an integrator of initial-value problems must offer.

An :class:`Engine` compiles an explicit first-order system, given as a CasADi
``Function(s, Y, constants) -> dY/ds``, into a :class:`Flow`, which carries
initial values to given abscissae. Sensitivities are states like any other:
:func:`varcalc.engines.variational.variational` appends the variational
equations to a system.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import casadi as ca
import numpy as np


class Outcome(Enum):
    """How an integration ended; each member carries its meaning."""

    COMPLETED = "the last abscissa was reached"
    STOPPED = "a stopping function became zero"
    NOT_FINITE = "the right-hand side is not a number at the initial values"
    BLOW_UP = "the solution leaves every bound, or the domain of the system, before the last abscissa"
    UNRESOLVED = "no smooth solution was found between the singular end and a place near it"
    TOO_MANY_STEPS = "the limit on the number of steps was reached"


@dataclass(frozen=True)
class Run:
    """One integration: ``states`` (k, N) at the k ``abscissae``, the first of which is the start.

    Where the outcome is not COMPLETED the rows beyond ``reached`` are NaN, and
    ``outcome`` says why. ``trajectory`` takes abscissae (m,) between the start
    and ``reached`` to states (m, N); it is there only when asked for.
    """

    abscissae: np.ndarray
    states: np.ndarray
    outcome: Outcome
    reached: float
    steps: int
    trajectory: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def completed(self) -> bool:
        """True when every abscissa was reached."""
        return self.outcome is Outcome.COMPLETED


class Flow(Protocol):
    """A compiled system, ready to be integrated any number of times."""

    def run(
        self,
        abscissae: np.ndarray,
        state: np.ndarray,
        constants: np.ndarray,
        *,
        level: int = 0,
        dense: bool = False,
    ) -> Run:
        """Carry ``state`` (N,) from the first of the ``abscissae`` (k,), which are monotone, to the others.

        Each ``level`` integrates more carefully than the one before, so that
        the difference between two tells the error of the lower one; ``dense``
        keeps the trajectory between the abscissae.
        """
        ...


OUTCOMES = tuple(Outcome)
"""What the small integers of :attr:`Landing.outcomes` stand for."""
NONE = -1
"""In place of the number of a stopping function: none of them."""


@dataclass(frozen=True)
class Landing:
    """Where m integrations ended, each at an abscissa of its own.

    ``states`` (m, N) at the abscissae ``reached`` (m,); ``outcomes`` (m,) are indices into
    :data:`OUTCOMES`, ``stopped_by`` (m,) the numbers of the stopping functions that were met, or
    :data:`NONE`. A run that failed keeps the last state that is known, never NaN.
    """

    states: np.ndarray
    reached: np.ndarray
    outcomes: np.ndarray
    stopped_by: np.ndarray


class Swarm(Protocol):
    """A compiled autonomous system with stopping functions, for many initial values at once."""

    def run(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...] = ()) -> Landing:
        """Carry each row of ``states`` (m, N) from s = 0 until one of the stopping functions crosses zero.

        ``constants`` has shape (m, c). ``leaving`` are the numbers of stopping
        functions that are zero, to round-off, at the start of every run:
        those zeros do not count, later ones do. A stop is located to round-off.
        """
        ...


class Fleet(Protocol):
    """A compiled autonomous system for many initial values, each carried to an abscissa of its own."""

    def run(self, states: np.ndarray, constants: np.ndarray, until: np.ndarray) -> Landing:
        """Carry each row of ``states`` (m, N) from s = 0 to ``until`` (m,), not negative; ``constants`` (m, c)."""
        ...


class Engine(Protocol):
    """An integrator with its options."""

    @property
    def name(self) -> str:
        """What to call it in a message."""
        ...

    def compile(self, system: ca.Function) -> Flow:
        """Prepare ``system``: ``(s, Y (N,), constants (c,)) -> dY/ds (N,)``.

        Raises :class:`varcalc.integrators.lowering.CannotLower` when the system
        holds an operation the engine does not know.
        """
        ...

    def compile_swarm(self, system: ca.Function, stops: ca.Function) -> Swarm:
        """Prepare ``system`` for many runs at once, with ``stops``: ``(s, Y (N,), constants (c,)) -> (k,)``.

        Neither may depend on s. Raises as :meth:`compile` does.
        """
        ...

    def compile_fleet(self, system: ca.Function) -> Fleet:
        """Prepare ``system``, which must not depend on s, for many runs to given abscissae. Raises as above."""
        ...


def check_system(system: ca.Function) -> int:
    """The dimension N of the state; ValueError when ``system`` is no right-hand side."""
    if system.n_in() != 3 or system.n_out() != 1:
        raise ValueError(f"a system takes (s, Y, constants) and returns dY/ds; {system} does not")
    if system.numel_in(0) != 1 or system.numel_in(1) != system.numel_out(0):
        raise ValueError(f"s must be a scalar and dY/ds must have as many entries as Y; {system} has other shapes")
    return int(system.numel_in(1))


def checked(abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, system: ca.Function) -> None:
    """Raise ValueError for arguments of :meth:`Flow.run` that do not fit the system."""
    steps = np.diff(abscissae)
    if abscissae.ndim != 1 or len(abscissae) < 2 or not (np.all(steps > 0) or np.all(steps < 0)):
        raise ValueError(f"abscissae must be two or more, all ascending or all descending, not {abscissae}")
    if state.shape != (system.numel_in(1),) or constants.shape != (system.numel_in(2),):
        raise ValueError(
            f"the system has {system.numel_in(1)} states and {system.numel_in(2)} constants, "
            f"not {state.shape} and {constants.shape}"
        )
