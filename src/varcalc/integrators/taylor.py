"""Taylor's method by heyoka: full double precision at a small price once compiled.

F. Biscani, D. Izzo, "Revisiting high-order Taylor methods for astrodynamics
and celestial mechanics", MNRAS 504 (2021) 2614. Just-in-time compilation costs
some 10 to 400 milliseconds a system, according to its size.
"""

from __future__ import annotations

import copy
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import lower
from varcalc.integrators.protocol import (
    OUTCOMES,
    Landing,
    Run,
    RunOutcome,
    begun,
    check_system,
    checked,
)
from varcalc.integrators.taylor_ensemble import TaylorEnsemble
from varcalc.integrators.threads import threads_for
from varcalc.spelling import spelled

BLIND = 2.0
"""By how many times more than all the terms of its series allow a first step may be."""
SAME_RUN = 1e-12
"""Relative difference of two runs that come to the same."""
SMALL = 1e-6
"""The same of two runs that differ by what round-off has grown to."""
SHORT = 0.1
"""Of the mean of steps: a bound below that is none on a step made blindly."""
RUNS_FOR_BATCHES, RUNS_FOR_GRIDS = 64, 8
"""Runs without stops from which on heyoka's batches are worth compiling, and those that are asked for many states."""


@spelled
@dataclass(frozen=True)
class Taylor:
    """heyoka's adaptive Taylor integrator of local ``tolerance`` (relative; round-off by default).

    ``most_steps`` bounds the steps of one run, ``ensemble_steps`` those of each of many that go to their stops.
    ``compact`` compiles loops rather than straight code: five to ten times quicker to compile, about
    two times slower to run, so it is worth leaving only for long integrations. ``quick`` leaves out what the compiler
    does to make code fast: ten times quicker to compile, three times slower to run.
    """

    tolerance: float = float(np.finfo(float).eps)
    most_steps: int = 4000
    ensemble_steps: int = 20_000
    compact: bool = True
    quick: bool = False

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return "Taylor (heyoka)"

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,  # noqa: ARG002  of a series all states tell
        at_ends: tuple[int, ...] = (),
    ) -> TaylorFlow:  # fmt: skip
        """Lower ``system`` and ``stops``; CannotLower when they hold an operation that has no Taylor series.

        heyoka compiles what is called when it is first called. States that are ``watching`` are series like any other.
        """
        import heyoka as hy

        check_system(system)
        if stops is not None:
            return TaylorFlow(
                self, system, TaylorEnsemble(system, stops, self.tolerance, self.ensemble_steps, at_ends), hy
            )
        flow = TaylorFlow(self, system, None, hy)
        _ = flow.equations  # raises CannotLower
        return flow


@dataclass(frozen=True)
class TaylorFlow:
    """A system for heyoka, with a Taylor step of its own where runs go to ``stops``; its verbs are the protocol's."""

    engine: Taylor
    system: ca.Function
    stops: TaylorEnsemble | None
    heyoka: Any

    compiled = True

    def __reduce__(self) -> tuple[Any, ...]:
        """Compiled code stays in its process: what is sent is compiled anew, to the same numbers, when it is called."""
        stops = self.stops
        if stops is None:
            return self.engine.compile, (self.system,)
        return partial(self.engine.compile, at_ends=stops.at_ends), (self.system, stops.stops)

    @cached_property
    def equations(self) -> list[tuple[Any, Any]]:
        """dY/ds = f as heyoka takes it."""
        hy, system = self.heyoka, self.system
        state = [hy.expression(f"Y{i}") for i in range(system.numel_in(1))]
        rates = lower(system, [[hy.time], state, [hy.par[i] for i in range(system.numel_in(2))]])
        return list(zip(state, rates, strict=True))

    @cached_property
    def integrator(self) -> Any:
        """heyoka's integrator of one trajectory."""
        start, engine = np.zeros(len(self.equations)), self.engine
        return self.heyoka.taylor_adaptive(
            self.equations, start, tol=engine.tolerance, compact_mode=engine.compact,
            opt_level=0 if engine.quick else 3,
        )  # fmt: skip

    @cached_property
    def _side_by_side(self) -> Any:
        """heyoka's integrator of as many trajectories as the processor takes side by side."""
        start, engine = np.zeros((len(self.equations), self.heyoka.recommended_simd_size())), self.engine
        return self.heyoka.taylor_adaptive_batch(
            self.equations, start, tol=engine.tolerance, compact_mode=engine.compact,
            opt_level=0 if engine.quick else 3,
        )  # fmt: skip

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.trajectory`."""
        checked(abscissae, state, constants, self.system)
        return self._carried(abscissae, state, constants, level, longest, dense=dense)

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """See :meth:`varcalc.integrators.protocol.Flow.trajectories`."""
        along = np.full((len(abscissae), *states.T.shape), math.nan)
        again = np.ones(len(states), dtype=bool)
        landing, ends = begun(states, float(abscissae[0]), float(abscissae[-1]), stopping=False)
        if len(states) >= RUNS_FOR_GRIDS:
            each = np.broadcast_to(constants, (len(states), len(constants)))
            again = self._in_batches(landing, each, ends, (abscissae, along))
            along[0] = states.T  # not told of a run whose first step failed
        told = zip(landing.outcomes, landing.reached, landing.steps, strict=True)
        return [
            self.trajectory(abscissae, states[k], constants) if again[k] else
            Run(abscissae, along[..., k], OUTCOMES[outcome], float(reached), int(steps))
            for k, (outcome, reached, steps) in enumerate(told)
        ]  # fmt: skip

    def _carried(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, level: int, longest: float | None, *,
        dense: bool,
    ) -> Run:  # fmt: skip
        """One run with steps of at most ``longest``, if that is given; else each ``level`` halves them."""
        bound = math.inf if longest is None else longest
        run, bound = self._seeing(abscissae, state, constants, bound)
        if longest is None and level > 0 and run.completed:
            bound = abs(abscissae[-1] - abscissae[0]) / (2**level * run.steps + 1)
            run = self._propagate(abscissae, state, constants, bound)
        if not dense or run.steps == 0:
            return run
        return replace(run, trajectory=Trajectory(self, abscissae[0], run.reached, state, constants.copy(), bound))

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
        if self.stops is not None:
            return self.stops.run(states, constants, start=start, until=until, leaving=leaving)
        landing, ends = begun(states, start, until, stopping=False)
        begin, rows = landing.reached.copy(), np.flatnonzero(landing.reached != ends)
        if len(states) >= RUNS_FOR_BATCHES and level <= 0 and longest is None and not dense:
            rows = np.flatnonzero(self._in_batches(landing, constants, ends))
        between: list[Any] = [None] * len(states)
        for row in rows:
            span = np.array([begin[row], ends[row]])
            bound = None if longest is None else float(longest[row])
            run = self._carried(span, states[row], constants[row], level, bound, dense=dense)
            landing.states[row], landing.reached[row] = states[row], run.reached
            landing.outcomes[row], landing.steps[row] = OUTCOMES.index(run.outcome), run.steps
            between[row] = run.trajectory
            if run.completed:
                landing.states[row], landing.reached[row] = run.states[-1], ends[row]
        if dense:
            landing.dense = between
        return landing

    def _in_batches(
        self, landing: Landing, constants: np.ndarray, until: np.ndarray,
        places: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Carry all runs from where they are, as many as the processor takes side by side, on all cores.

        ``places`` are the abscissae (k,) that all go through, and where their states (k, N, m) are written.

        True (m,) for those to be made again alone: their first step may have been blind, or they were on their way
        when another of their batch failed, which stops them all.
        """
        known = self.heyoka.taylor_outcome
        m, size, begin = len(until), self._side_by_side.batch_size, landing.reached.copy()
        first = landing.states.copy()
        again = np.zeros(m, dtype=bool)
        lanes = [np.minimum(np.arange(k, k + size), m - 1) for k in range(0, m, size)]
        threads = threads_for(m)

        def share(number: int) -> None:
            """Carries every so many of the batches, the first of them ``number``, on an integrator of its own."""
            integrator = copy.deepcopy(self._side_by_side) if number else self._side_by_side
            used = len(integrator.pars)
            for rows in lanes[number::threads]:
                integrator.set_time(begin[rows])
                integrator.state[:] = landing.states[rows].T
                integrator.pars[:] = constants[rows, :used].T
                integrator.step(write_tc=True)
                steps = np.abs([step for _, step in integrator.step_res])
                again[rows] = steps > BLIND * self._allowed(integrator.tc)
                integrator.set_time(begin[rows])
                integrator.state[:] = first[rows].T
                if places is None:
                    integrator.propagate_until(until[rows], max_steps=self.engine.most_steps)
                else:
                    grid = np.repeat(places[0][:, None], size, axis=1)
                    _, places[1][..., rows] = integrator.propagate_grid(grid, max_steps=self.engine.most_steps)
                landing.states[rows], landing.reached[rows] = integrator.state.T, integrator.time
                for row, (code, _, _, steps) in zip(rows, integrator.propagate_res, strict=True):
                    landing.steps[row] = steps
                    if code == known.success:
                        again[row] = True
                    elif code != known.time_limit:
                        landing.outcomes[row] = OUTCOMES.index(self._outcome(code, landing.states[row], steps))

        if threads == 1:
            share(0)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(share, range(threads)))
        lost = ~np.isfinite(landing.states).all(axis=1)
        landing.states[lost] = first[lost]
        landing.reached = np.where(np.isfinite(landing.reached), landing.reached, begin)
        return again

    def _set(self, time: float, state: np.ndarray, constants: np.ndarray) -> None:
        self.integrator.time = float(time)
        self.integrator.state[:] = state
        used = len(self.integrator.pars)  # heyoka counts up to the last constant that occurs in the system
        self.integrator.pars[:] = constants[:used]

    def _seeing(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, bound: float
    ) -> tuple[Run, float]:
        """A run, and the bound on its steps under which the first was not made blindly.

        heyoka goes by the last two terms of the series, and both may be nothing where a motion begins: of what is
        even in time, every other one. A bound counts where a run with half of it comes to the same.
        """
        first, reach = self._begun(state, constants, abscissae[0])
        run = self._propagate(abscissae, state, constants, bound)
        if not min(first, bound) > BLIND * reach or run.steps == 0:
            return run, bound
        least = SHORT * abs(run.reached - abscissae[0]) / run.steps
        bound = min(bound, reach)
        run, last = self._propagate(abscissae, state, constants, bound), math.inf
        while bound > least:
            bound /= 2
            before, run = run, self._propagate(abscissae, state, constants, bound)
            with np.errstate(invalid="ignore"):
                apart = np.nanmax(np.abs(run.states - before.states), initial=0.0)
                size = np.nanmax(np.abs(run.states))
            # what halving does not make less is round-off
            if before.outcome is run.outcome and (apart <= SAME_RUN * size or last / 2 < apart <= SMALL * size):
                break
            last = apart
        return run, bound

    def _begun(self, state: np.ndarray, constants: np.ndarray, time: float) -> tuple[float, float]:
        """The step that heyoka makes from a state, and the one that all the later terms of its series allow."""
        self._set(time, state, constants)
        _, step = self.integrator.step(write_tc=True)
        return abs(step), float(self._allowed(self.integrator.tc[:, :, None])[0])

    def _allowed(self, terms: np.ndarray) -> np.ndarray:
        """The steps (m,) that the later of the ``terms`` (N, order + 1, m) of series allow."""
        sizes = np.abs(terms).max(axis=0)
        order = np.arange(len(sizes))[:, None]
        with np.errstate(all="ignore"):
            radii = (sizes[1] / sizes) ** (1 / np.maximum(order - 1, 1))
        radii[(order <= len(sizes) // 2) | ~(sizes > 0) | ~(radii > 0)] = np.inf
        return self.engine.tolerance ** (1 / (len(sizes) - 1)) * radii.min(axis=0)

    def _propagate(self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, longest: float) -> Run:
        """A run with steps of at most ``longest``."""
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
        if outcome is RunOutcome.COMPLETED and len(abscissae) == 2:
            states[-1] = end
        time = float(integrator.time)  # not a number after a step that failed
        reached = time if math.isfinite(time) else float(abscissae[0])
        return Run(abscissae, states, outcome, reached, steps)

    def states(self, abscissae: np.ndarray, of: Trajectory) -> np.ndarray:
        """States of a trajectory at ascending or descending abscissae, the first of which is its start."""
        return self._propagate(abscissae, of.state, of.constants, of.longest).states

    def _outcome(self, code: Any, end: np.ndarray, steps: int) -> RunOutcome:
        known = self.heyoka.taylor_outcome
        if code == known.time_limit and np.all(np.isfinite(end)):
            return RunOutcome.COMPLETED
        if code == known.step_limit:
            return RunOutcome.TOO_MANY_STEPS
        return RunOutcome.NOT_FINITE if steps == 0 else RunOutcome.BLOW_UP


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
