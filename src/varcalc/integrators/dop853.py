"""Dormand and Prince's method of order 8 by SciPy, with its dense output of order 7.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sect. II.5
and II.6. Nothing is compiled, so it is cheap to start and takes any CasADi
function, interpolated data included.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.dop853_swarm import Dop853Swarm
from varcalc.integrators.fleet import OneByOne
from varcalc.integrators.protocol import Outcome, Run, check_system, checked
from varcalc.integrators.stops import Stops

REFINEMENT = 100.0
"""By how much the tolerance of each level is the smaller one."""
SMALLEST = 100 * float(np.finfo(float).eps)
"""The smallest relative tolerance SciPy accepts."""


@dataclass(frozen=True)
class Dop853:
    """SciPy's DOP853. ``tolerance`` is relative to each state, or to the largest initial value where that is more.

    Each level takes a hundredth of it and steps of half the length. ``most_steps`` bounds the steps of one run.
    """

    tolerance: float = REFINEMENT * SMALLEST
    most_steps: int = 4000

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return "DOP853 (SciPy)"

    def compile(self, system: ca.Function) -> Dop853Flow:
        """Wrap ``system`` for calls without copies; never raises CannotLower."""
        check_system(system)
        return Dop853Flow(self, system)

    def compile_fleet(self, system: ca.Function) -> OneByOne:
        """Wrap ``system``; never raises CannotLower."""
        return OneByOne(self.compile(system))

    def compile_swarm(self, system: ca.Function, stops: ca.Function) -> Dop853Swarm:
        """Wrap ``system`` and ``stops``; never raises CannotLower."""
        check_system(system)
        flow = Dop853Flow(self, system)
        return Dop853Swarm(
            flow.right_hand_side, flow.set_constants, Stops(system, stops), self.tolerance, self.most_steps
        )


class Dop853Flow:
    """A system ready for SciPy; :meth:`run` is that of the protocol."""

    def __init__(self, engine: Dop853, system: ca.Function) -> None:
        self.engine, self.system = engine, system
        self._time = np.zeros(1)
        self._state = np.zeros(system.numel_in(1))
        self._constants = np.zeros(system.numel_in(2))
        self._rate = np.zeros(system.numel_out(0))
        self._buffer, self._call = _bound(system, [self._time, self._state, self._constants], self._rate)

    def set_constants(self, constants: np.ndarray) -> None:
        """Use these constants (c,) from here on."""
        self._constants[:] = constants

    def right_hand_side(self, time: float, state: np.ndarray) -> np.ndarray:
        """dY/ds at one state, with the constants set last."""
        self._time[0] = time
        self._state[:] = state
        self._call()
        return self._rate.copy()

    def run(
        self,
        abscissae: np.ndarray,
        state: np.ndarray,
        constants: np.ndarray,
        *,
        level: int = 0,
        dense: bool = False,
    ) -> Run:
        """:meth:`varcalc.integrators.protocol.Flow.run`; each ``level`` lowers the tolerance and halves the steps."""
        from scipy.integrate import DOP853

        checked(abscissae, state, constants, self.system)
        self.set_constants(constants)
        tolerance = max(self.engine.tolerance / REFINEMENT**level, SMALLEST)
        longest = math.inf
        if level:  # smaller steps as well: few steps may be the same at any tolerance
            usual = self.run(abscissae[[0, -1]], state, constants)
            longest = abs(abscissae[-1] - abscissae[0]) / (2**level * usual.steps + 1)
        states = np.full((len(abscissae), len(state)), math.nan)
        states[0] = state
        with np.errstate(all="ignore"):
            if not np.all(np.isfinite(self.right_hand_side(float(abscissae[0]), state))):
                return Run(abscissae, states, Outcome.NOT_FINITE, float(abscissae[0]), 0)
            solver = DOP853(
                self.right_hand_side, abscissae[0], state, abscissae[-1], rtol=tolerance,
                atol=tolerance * max(1.0, float(np.abs(state).max())),
                max_step=longest,
            )  # fmt: skip
            pieces, outcome = self._march(solver, abscissae, states, keep=dense or len(abscissae) > 2)
        trajectory = _Pieces(pieces, float(abscissae[0])) if dense and pieces else None
        return Run(abscissae, states, outcome, float(solver.t), len(pieces), trajectory)

    def _march(
        self, solver: Any, abscissae: np.ndarray, states: np.ndarray, keep: bool
    ) -> tuple[list[tuple[float, Any]], Outcome]:
        """Step to the end, filling ``states``; the interpolants of the steps with their right ends, and the outcome."""
        pieces: list[tuple[float, Any]] = []
        waiting = 1
        direction = 1.0 if abscissae[-1] > abscissae[0] else -1.0
        for _ in range(self.engine.most_steps):
            solver.step()
            if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
                return pieces, Outcome.BLOW_UP
            interpolant: Any = solver.dense_output() if keep else None
            pieces.append((float(solver.t), interpolant))
            while waiting < len(abscissae) and direction * (abscissae[waiting] - solver.t) <= 0:
                if interpolant is None or abscissae[waiting] == solver.t:
                    states[waiting] = solver.y
                else:
                    states[waiting] = interpolant(abscissae[waiting])
                waiting += 1
            if solver.status == "finished":
                return pieces, Outcome.COMPLETED
        return pieces, Outcome.TOO_MANY_STEPS


class _Pieces:
    """The dense output of a run: one polynomial for each step."""

    def __init__(self, pieces: list[tuple[float, Any]], start: float) -> None:
        self._ends = np.array([end for end, _ in pieces])
        self._pieces = [piece for _, piece in pieces]
        self._direction = 1.0 if self._ends[-1] > start else -1.0

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States (m, N) at ``times`` (m,)."""
        at = np.searchsorted(self._direction * self._ends, self._direction * times)
        at = np.minimum(at, len(self._pieces) - 1)
        out = np.empty((len(times), len(self._pieces[0].y_old)))
        for k in np.unique(at):
            out[at == k] = self._pieces[k](times[at == k]).T
        return out


def _bound(function: ca.Function, arguments: list[np.ndarray], result: np.ndarray) -> tuple[Any, Callable[[], None]]:
    """A call of ``function`` that reads and writes the given arrays in place, and the buffer that keeps it alive."""
    bound: Any = function.buffer()  # CasADi's own annotations are wrong here
    buffer, trigger = bound
    for i, argument in enumerate(arguments):
        if len(argument):
            buffer.set_arg(i, memoryview(argument))
    buffer.set_res(0, memoryview(result))
    return buffer, trigger
