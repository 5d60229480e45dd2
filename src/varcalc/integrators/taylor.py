"""Taylor's method by heyoka: full double precision at a small price once compiled.

F. Biscani, D. Izzo, "Revisiting high-order Taylor methods for astrodynamics
and celestial mechanics", MNRAS 504 (2021) 2614. Just-in-time compilation costs
some 10 to 400 milliseconds a system, according to its size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.fleet import TaylorFleet
from varcalc.integrators.lowering import lower
from varcalc.integrators.protocol import Outcome, Run, check_system, checked
from varcalc.integrators.taylor_swarm import TaylorSwarm


@dataclass(frozen=True)
class Taylor:
    """heyoka's adaptive Taylor integrator of local ``tolerance`` (relative; round-off by default).

    ``most_steps`` bounds the steps of one run, ``swarm_steps`` those of each of many at once. ``compact`` compiles
    loops rather than straight code: five to ten times quicker to compile, about
    two times slower to run, so it is worth leaving only for long integrations.
    """

    tolerance: float = float(np.finfo(float).eps)
    most_steps: int = 4000
    swarm_steps: int = 20_000
    compact: bool = True

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return "Taylor (heyoka)"

    def compile(self, system: ca.Function) -> TaylorFlow:
        """Lower ``system`` to heyoka and compile it; CannotLower when it holds what heyoka lacks."""
        import heyoka as hy

        size = check_system(system)
        state = [hy.expression(f"Y{i}") for i in range(size)]
        constants = [hy.par[i] for i in range(system.numel_in(2))]
        rates = lower(system, [[hy.time], state, constants])
        integrator = hy.taylor_adaptive(
            list(zip(state, rates, strict=True)), np.zeros(size), tol=self.tolerance, compact_mode=self.compact
        )
        return TaylorFlow(self, system, integrator, hy)

    def compile_fleet(self, system: ca.Function) -> TaylorFleet:
        """As :meth:`compile_swarm`, without stops."""
        import heyoka as hy

        size, width = check_system(system), hy.recommended_simd_size()
        state = [hy.expression(f"Y{i}") for i in range(size)]
        rates = lower(system, [[hy.time], state, [hy.par[i] for i in range(system.numel_in(2))]])
        integrator = hy.taylor_adaptive_batch(
            list(zip(state, rates, strict=True)), np.zeros((size, width)), tol=self.tolerance, compact_mode=self.compact
        )
        return TaylorFleet(integrator, lambda: self.compile(system), self.most_steps)

    def compile_swarm(self, system: ca.Function, stops: ca.Function) -> TaylorSwarm:
        """Write one step of many runs as a function; heyoka compiles it where there are many of them."""
        return TaylorSwarm(system, stops, self.tolerance, self.swarm_steps)


@dataclass(frozen=True)
class TaylorFlow:
    """A compiled heyoka integrator; :meth:`run` is that of the protocol."""

    engine: Taylor
    system: ca.Function
    integrator: Any
    heyoka: Any

    def run(
        self,
        abscissae: np.ndarray,
        state: np.ndarray,
        constants: np.ndarray,
        *,
        level: int = 0,
        dense: bool = False,
    ) -> Run:
        """See :meth:`varcalc.integrators.protocol.Flow.run`; each ``level`` halves the steps."""
        checked(abscissae, state, constants, self.system)
        run = self._propagate(abscissae, state, constants, math.inf)
        longest = math.inf
        if level and run.completed:
            longest = abs(abscissae[-1] - abscissae[0]) / (2**level * run.steps + 1)
            run = self._propagate(abscissae, state, constants, longest)
        if not dense or run.steps == 0:
            return run
        return replace(run, trajectory=Trajectory(self, abscissae[0], run.reached, state, constants.copy(), longest))

    def _set(self, time: float, state: np.ndarray, constants: np.ndarray) -> None:
        self.integrator.time = float(time)
        self.integrator.state[:] = state
        used = len(self.integrator.pars)  # heyoka counts up to the last constant that occurs in the system
        self.integrator.pars[:] = constants[:used]

    def _propagate(self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, longest: float) -> Run:
        integrator, most = self.integrator, self.engine.most_steps
        self._set(abscissae[0], state, constants)
        states = np.full((len(abscissae), len(state)), math.nan)
        states[0] = state
        if len(abscissae) == 2:
            result = integrator.propagate_until(float(abscissae[-1]), max_steps=most, max_delta_t=longest)
        else:
            result = integrator.propagate_grid(abscissae, max_steps=most, max_delta_t=longest)
            states[: len(result[5])] = result[5]
        end, steps = np.array(integrator.state), int(result[3])
        outcome = self._outcome(result[0], end, steps)
        if outcome is Outcome.COMPLETED and len(abscissae) == 2:
            states[-1] = end
        time = float(integrator.time)  # not a number after a step that failed
        reached = time if math.isfinite(time) else float(abscissae[0])
        return Run(abscissae, states, outcome, reached, steps)

    def states(self, abscissae: np.ndarray, of: Trajectory) -> np.ndarray:
        """States of a trajectory at ascending or descending abscissae, the first of which is its start."""
        return self._propagate(abscissae, of.state, of.constants, of.longest).states

    def _outcome(self, code: Any, end: np.ndarray, steps: int) -> Outcome:
        known = self.heyoka.taylor_outcome
        if code == known.time_limit and np.all(np.isfinite(end)):
            return Outcome.COMPLETED
        if code == known.step_limit:
            return Outcome.TOO_MANY_STEPS
        return Outcome.NOT_FINITE if steps == 0 else Outcome.BLOW_UP


@dataclass(frozen=True)
class Trajectory:
    """States between the abscissae of a run, integrated anew where they are asked for.

    heyoka's own continuous output compiles code for each run, at milliseconds a time.
    """

    flow: TaylorFlow
    start: float
    reached: float
    state: np.ndarray
    constants: np.ndarray
    longest: float

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States (m, N) at ``times`` (m,), which lie between the start and what was reached."""
        direction = 1.0 if self.reached > self.start else -1.0
        ahead = np.maximum(direction * (times - self.start), 0.0)
        grid, place = np.unique(np.concatenate([[0.0], ahead]), return_inverse=True)
        if len(grid) == 1:
            return np.repeat(self.state[None, :], len(times), axis=0)
        abscissae = self.start + direction * grid
        abscissae = np.where(grid == 0.0, self.start, abscissae)
        keep = np.concatenate([[True], np.diff(direction * abscissae) > 0])  # neighbours that rounding made equal
        states = self.flow.states(abscissae[keep], self)
        return states[np.cumsum(keep) - 1][place.ravel()[1:]]
