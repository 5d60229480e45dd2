"""Begin with the engine that costs nothing to start, and compile when that has paid for itself.

Compiling a system for heyoka takes 60 to 600 ms (measured for systems of 3 to
25 states), as much as DOP853 takes for some thousands of steps. Going over
after that many costs at most twice what the better of both would have.
The number of steps decides, not the clock, so results are reproducible.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.integrators.dop853 import Dop853
from varcalc.integrators.lowering import CannotLower
from varcalc.integrators.protocol import Fleet, Flow, Run, Swarm
from varcalc.integrators.taylor import Taylor

STEPS = 2500
"""Steps of DOP853, at 0.1 ms each, that take as long as compiling for heyoka."""


@dataclass(frozen=True)
class Thrifty:
    """DOP853 for the first ``steps`` steps of a system, then Taylor, if that can take the system."""

    first: Dop853 = field(default_factory=Dop853)
    then: Taylor = field(default_factory=Taylor)
    steps: int = STEPS

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return f"{self.first.name}, then {self.then.name}"

    def compile(self, system: ca.Function) -> ThriftyFlow:
        """Wrap ``system`` for DOP853; never raises CannotLower."""
        return ThriftyFlow(self, system, self.first.compile(system))

    def compile_fleet(self, system: ca.Function) -> Fleet:
        """As :meth:`compile_swarm`, without stops."""
        try:
            return self.then.compile_fleet(system)
        except CannotLower:
            return self.first.compile_fleet(system)

    def compile_swarm(self, system: ca.Function, stops: ca.Function) -> Swarm:
        """Compile for Taylor at once, since many runs pay for it; for DOP853 what Taylor cannot take."""
        try:
            return self.then.compile_swarm(system, stops)
        except CannotLower:
            return self.first.compile_swarm(system, stops)


@dataclass
class ThriftyFlow:
    """A system with the engine that it has earned; :meth:`run` is that of the protocol."""

    engine: Thrifty
    system: ca.Function
    flow: Flow
    taken: int = 0
    settled: bool = False

    def run(
        self,
        abscissae: np.ndarray,
        state: np.ndarray,
        constants: np.ndarray,
        *,
        level: int = 0,
        dense: bool = False,
    ) -> Run:
        """See :meth:`varcalc.integrators.protocol.Flow.run`."""
        if not self.settled and self.taken >= self.engine.steps:
            self.settled = True
            with suppress(CannotLower):  # DOP853 goes on: it takes any system
                self.flow = self.engine.then.compile(self.system)
        run = self.flow.run(abscissae, state, constants, level=level, dense=dense)
        self.taken += run.steps
        return run
