"""Integration of systems that switch: from one switch to the next, each time by what the system is there.

A kink or a jump of the rates is no place for a series: a step over it is wrong, and its error does not tell. Between
two of them the system is smooth, and has the switches' arguments as stopping functions. Where one is met, the side
that comes next is the one whose own rates lead into it. Where both lead back, the run goes along the switch, by the
mean of both rates that stays on it (A. F. Filippov, "Differential Equations with Discontinuous Righthand Sides",
1988, §4): that is how dry friction holds a body.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.integrators.crossings import Crossings
from varcalc.integrators.lowering import CannotLower, scalar_function
from varcalc.integrators.one_side import OneSided
from varcalc.integrators.protocol import OUTCOMES, Engine, Flow, Landing, Run, RunOutcome, begun
from varcalc.symbolic.instructions import program
from varcalc.symbolic.sides import Sides
from varcalc.symbolic.switches import SWITCHING
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class Continuous:
    """A ``function`` (s, Y, constants) that must not jump where a switch of the first ``count`` states turns over."""

    function: ca.Function
    count: int


@dataclass(frozen=True)
class Piecewise:
    """An ``engine`` whose runs stop at every switch of the system, and go on by what it is on the other side.

    A run ends there where ``continuous`` jumps, if that is given: the rates do not tell what such a jump does.
    """

    engine: Engine
    continuous: Continuous | None = None

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return self.engine.name

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,
        at_ends: tuple[int, ...] = (),
    ) -> Flow:  # fmt: skip
        """See :meth:`Engine.compile`; what does not switch along its runs goes by as it is."""
        try:
            formulas = [scalar_function(f) for f in (system, stops) if f is not None]
            held = [] if self.continuous is None else [scalar_function(self.continuous.function)]
        except CannotLower:
            return self.engine.compile(system, stops, watching=watching, at_ends=at_ends)
        if all(SWITCHING.isdisjoint(i.operation for i in program(f).steps) for f in [*formulas, *held]):
            return self.engine.compile(system, stops, watching=watching, at_ends=at_ends)
        symbols = [ca.SX.sym(name, system.numel_in(k)) for k, name in enumerate("sYc")]
        results = [ca.densify(f(*symbols)) for f in formulas]
        if stops is None:
            results.append(ca.SX(0, 1))
        results += [_first(f, symbols) for f in held] or [ca.SX(0, 1)]
        sides = Sides(ca.Function("switching", symbols, results), (0, 1))
        if not sides.places:
            return self.engine.compile(system, stops, watching=watching, at_ends=at_ends)
        return PiecewiseFlow(OneSided(self.engine, sides, 0 if self.continuous is None else self.continuous.count))


def _first(function: ca.Function, symbols: Sequence[Expression]) -> Expression:
    """A function of fewer states, which are the first ones."""
    s, state, constants = symbols
    return ca.densify(function(s, state[: function.numel_in(1)], constants))


@dataclass(frozen=True)
class PiecewiseFlow:
    """A ``system`` that switches; its verbs are the protocol's."""

    system: OneSided

    @property
    def compiled(self) -> bool:
        """See :attr:`Flow.compiled`: between pieces Python decides."""
        return False

    @cached_property
    def _crossings(self) -> Crossings:
        return Crossings(self.system)

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
        landing, ends = begun(states, start, until, stopping=self.system.stops > 0)
        begin = landing.reached.copy()
        walkers = self._crossings.begun(landing.states, constants, begin, ends, leaving)
        for one, bound in zip(walkers, np.full(len(walkers), np.inf) if longest is None else longest, strict=True):
            one.longest = float(bound)
        while going := [one for one in walkers if one.outcome is None]:
            self._crossings.step(going, level)
        for k, one in enumerate(walkers):
            landing.states[k], landing.reached[k] = one.state[:-1], one.state[-1]
            landing.outcomes[k] = OUTCOMES.index(one.outcome or RunOutcome.COMPLETED)
            landing.stopped_by[k], landing.steps[k] = one.stopped_by, one.steps
            if one.outcome is RunOutcome.COMPLETED:
                landing.reached[k] = ends[k]
        if dense:
            landing.dense = [
                self._between(state, row, begin[k], landing.reached[k])
                for k, (state, row) in enumerate(zip(states, constants, strict=True))
            ]
        return landing

    def _between(
        self, state: np.ndarray, constants: np.ndarray, start: float, end: float
    ) -> PiecewiseTrajectory | None:
        """The states between the start of a run and its end; stops do not count."""
        if start == end:
            return None
        run = self.trajectory(np.array([start, end]), state, constants, dense=True)
        return run.trajectory if isinstance(run.trajectory, PiecewiseTrajectory) else None

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """See :meth:`varcalc.integrators.protocol.Flow.trajectories`; one by one."""
        return [self.trajectory(abscissae, state, constants) for state in states]

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.trajectory`."""
        if self.system.stops:
            return self._without_stops.trajectory(
                abscissae, state, constants, level=level, longest=longest, dense=dense
            )
        begin, last = float(abscissae[0]), float(abscissae[-1])
        [walker] = self._crossings.begun(state[None, :], constants[None, :], abscissae[:1], abscissae[-1:], ())
        states, between, steps = np.full((len(abscissae), len(state)), np.nan), [], 0
        states[0] = state
        while walker.outcome is None:
            here, piece, numbers = walker.state.copy(), self.system.piece(walker.side), walker.numbers
            self._crossings.step([walker], level)
            end = last if walker.outcome is RunOutcome.COMPLETED else float(walker.state[-1])
            if end == here[-1]:
                continue
            inside = np.flatnonzero((walker.direction * (abscissae - here[-1]) > 0) & (abscissae != end)
                                    & (walker.direction * (end - abscissae) > 0))  # fmt: skip
            grid = np.concatenate([here[-1:], abscissae[inside], [end]])
            run = piece.free.trajectory(grid, here[:-1], numbers, level=level, longest=longest, dense=dense)
            states[inside], states[abscissae == end], steps = run.states[1:-1], run.states[-1], steps + run.steps
            if run.trajectory is not None:
                between.append((float(here[-1]), run.trajectory))
            if not run.completed:
                walker.state[-1] = run.reached
                walker.ended(run.outcome if run.outcome is not RunOutcome.NOT_FINITE else RunOutcome.BLOW_UP)
                break
            walker.state[:-1] = run.states[-1]
        outcome = walker.outcome or RunOutcome.COMPLETED
        reached = last if outcome is RunOutcome.COMPLETED else float(walker.state[-1])
        known = PiecewiseTrajectory(tuple(between), walker.direction) if between else None
        return Run(np.asarray(abscissae), states, outcome, reached if reached != begin else begin, steps, known)

    @cached_property
    def _without_stops(self) -> PiecewiseFlow:
        symbols = self.system.sides.symbols
        rates, _, kept = self.system.sides.function(*symbols)
        function = ca.Function("switching", symbols, [rates, ca.SX(0, 1), kept])
        sides = replace(self.system.sides, function=function)
        return PiecewiseFlow(replace(self.system, sides=sides))


@dataclass(frozen=True)
class PiecewiseTrajectory:
    """States between the abscissae of a run: of each piece, where it begins and its own trajectory."""

    between: tuple[tuple[float, Callable[[np.ndarray], np.ndarray]], ...]
    direction: float

    def __call__(self, abscissae: np.ndarray) -> np.ndarray:
        """States (m, N) at abscissae (m,) between the start of the run and what it reached."""
        at = np.asarray(abscissae, dtype=float)
        begin = self.direction * np.array([first for first, _ in self.between])
        number = np.clip(np.searchsorted(begin, self.direction * at, side="right") - 1, 0, len(begin) - 1)
        parts = {int(k): self.between[k][1](at[number == k]) for k in np.unique(number)}
        out = np.empty((len(at), next(iter(parts.values())).shape[1])) if parts else np.empty((0, 0))
        for k, values in parts.items():
            out[number == k] = values
        return out
