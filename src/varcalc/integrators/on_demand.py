"""Begin with the engine that costs nothing to start, and compile when that has paid for itself.

Compiling a system for heyoka takes 60 to 600 ms (measured for systems of 3 to
25 states), as much as DOP853 takes for some hundreds of steps. Going over
after that many costs at most twice what the better of both would have.
The number of steps decides, not the clock, so results are reproducible.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.integrators.dop853 import Dop853
from varcalc.integrators.lowering import CannotLower
from varcalc.integrators.protocol import COMPLETED, Flow, Landing, Run
from varcalc.integrators.taylor import Taylor
from varcalc.spelling import spelled

STEPS = 800
"""Steps of DOP853, refused ones among them, that take as long as compiling for heyoka."""
SIDE_BY_SIDE = 16
"""Runs that take their steps together with another, and with it as long as two that take them one after the other."""


@spelled
@dataclass(frozen=True)
class OnDemand:
    """DOP853 for the first ``steps`` steps of a system, then Taylor, if that can take the system.

    A system with stopping functions goes to Taylor at once, since many runs pay for it.
    """

    first: Dop853 = field(default_factory=Dop853)
    then: Taylor = field(default_factory=Taylor)
    steps: int = STEPS

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return f"{self.first.name}, then {self.then.name}"

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,
        at_ends: tuple[int, ...] = (),
    ) -> Flow:  # fmt: skip
        """Wrap ``system`` and ``stops``; never raises CannotLower."""
        if stops is None and self.steps:
            return FlowOnDemand(self, system, self.first.compile(system, watching=watching))
        try:
            return self.then.compile(system, stops, watching=watching, at_ends=at_ends)
        except CannotLower:
            return self.first.compile(system, stops, watching=watching, at_ends=at_ends)


@dataclass
class FlowOnDemand:
    """A system with the engine that it has earned; its verbs are those of the protocol."""

    engine: OnDemand
    system: ca.Function
    flow: Flow
    taken: int = 0
    settled: bool = False
    first: Flow = field(init=False)
    """DOP853, whose trajectories between the abscissae are at hand, while Taylor integrates them anew."""

    def __post_init__(self) -> None:
        self.first = self.flow

    @property
    def compiled(self) -> bool:
        """Whether Taylor has taken over."""
        return self.flow.compiled

    def _chosen(self) -> Flow:
        if not self.settled and self.taken >= self.engine.steps:
            self.settled = True
            with suppress(CannotLower):  # DOP853 goes on: it takes any system
                self.flow = self.engine.then.compile(self.system)
        return self.flow

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.trajectory`."""
        run = self._chosen().trajectory(abscissae, state, constants, level=level, longest=longest, dense=dense)
        self.taken += run.steps
        return run

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """See :meth:`varcalc.integrators.protocol.Flow.trajectories`."""
        runs = self._chosen().trajectories(abscissae, states, constants)
        self.taken += sum(run.steps for run in runs) // SIDE_BY_SIDE
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
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""

        def carried(flow: Flow) -> Landing:
            """The ensemble as the flow of one of the two engines carries it."""
            return flow.ensemble(
                states, constants, start=start, until=until, level=level, longest=longest, dense=dense, leaving=leaving
            )

        chosen = self._chosen()
        landing = carried(self.first if dense else chosen)
        if dense and chosen is not self.first and not (landing.outcomes == COMPLETED).all():
            landing = carried(chosen)  # what Taylor carried may be too much for DOP853
        self.taken += landing.rounds + int(landing.steps.sum()) // SIDE_BY_SIDE
        return landing
