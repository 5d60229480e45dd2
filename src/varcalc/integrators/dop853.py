"""Dormand and Prince's method of order 8 with SciPy's coefficients, for all runs together.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sect. II.5 and II.6: the stages of all runs are
one call of the system. Nothing is compiled, so it is cheap to start and takes any CasADi function, interpolated data
included. Systems of second order that are free of velocities go by Nyström's method of order 12 instead.
"""

from __future__ import annotations

import importlib.util
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from varcalc.integrators.nystrom import Nystrom, second_order
from varcalc.integrators.protocol import COMPLETED, OUTCOMES, Landing, Run, begun, check_system, checked
from varcalc.integrators.side_by_side import Runs, combined
from varcalc.integrators.stops import Interpolant, Stops
from varcalc.integrators.written import FEW_RUNS, WrittenStep, WrittenStepper, weighted, worth_writing
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

REFINEMENT = 100.0
"""By how much the tolerance of each level is the smaller one."""
SMALLEST = 100 * float(np.finfo(float).eps)
"""The smallest relative tolerance that rounding leaves a meaning."""
LOOK = 1e-6
"""The tolerance of a look, where that of the engine is smaller."""
RUNS_TOGETHER = 8192
"""Runs that take their steps together."""
NOTED = 2000
"""So many runs at a time would be worth the compilation by heyoka: its absence is told."""
KEPT_AT = (2, 1, 0)
"""Which of the first three slopes is kept first, second and third: those that few stages need come before others."""


@spelled
@dataclass(frozen=True)
class Dop853:
    """Dormand and Prince's methods: of order 8, or Nyström's of order 12 where rates are free of velocities.

    ``tolerance`` is relative to each state, or to the largest initial value.

    Each level takes a hundredth of it, and as many steps more as level 0 takes; level -1 is a look, to six digits.
    ``most_steps`` bounds those of one run.
    """

    tolerance: float = REFINEMENT * SMALLEST
    most_steps: int = 4000

    def tolerance_at(self, level: int) -> float:
        """The tolerance of a level."""
        return max(self.tolerance / REFINEMENT ** max(level, 0), LOOK if level < 0 else SMALLEST)

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return "DOP853 (SciPy)"

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,
        at_ends: tuple[int, ...] = (),  # noqa: ARG002  every stop is looked for on the way
    ) -> Dop853Flow:  # fmt: skip
        """Wrap ``system`` and ``stops``; never raises CannotLower."""
        check_system(system)
        pairs = second_order(system, watching)
        method = DormandPrince(PointEvaluator(system)) if pairs is None else Nystrom(pairs)
        return Dop853Flow(self, system, method, None if stops is None else Stops(system, stops))


@dataclass(frozen=True)
class Dop853Flow:
    """A system with its stops, which nothing has to be compiled for; its verbs are those of the protocol."""

    engine: Dop853
    system: ca.Function
    method: DormandPrince | Nystrom
    stops: Stops | None

    compiled = False

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """:meth:`varcalc.integrators.protocol.Flow.trajectory`, as an ensemble of one without stops."""
        checked(abscissae, state, constants, self.system)
        bounds = None if longest is None else np.array([longest])
        return self._runs(abscissae, state[None, :], constants, level, bounds, dense=dense)[0]

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """:meth:`varcalc.integrators.protocol.Flow.trajectories`, as an ensemble without stops."""
        return self._runs(abscissae, states, constants, 0, None, dense=False)

    def _runs(
        self, abscissae: np.ndarray, starts: np.ndarray, constants: np.ndarray, level: int, longest: np.ndarray | None,
        *, dense: bool,
    ) -> list[Run]:  # fmt: skip
        inner, each = len(abscissae) > 2, np.broadcast_to(constants, (len(starts), len(constants)))
        ends = replace(self, stops=None).ensemble(
            starts, each, start=abscissae[0], until=abscissae[-1], level=level, longest=longest, dense=dense or inner
        )
        states = np.full((len(starts), len(abscissae), starts.shape[1]), math.nan)
        states[:, 0] = starts
        runs: list[Run] = []
        for k, own in enumerate(states):
            reached = float(ends.reached[k])
            between = None if ends.dense is None else ends.dense[k]
            if inner and between is not None:
                there = np.abs(abscissae - abscissae[0]) <= abs(reached - abscissae[0])
                there[0] = False
                own[there] = between(abscissae[there])
            if ends.outcomes[k] == COMPLETED:
                own[-1] = ends.states[k]
            outcome = OUTCOMES[ends.outcomes[k]]
            runs.append(Run(abscissae, own, outcome, reached, int(ends.steps[k]), between if dense else None))
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
        """:meth:`varcalc.integrators.protocol.Flow.ensemble`; each ``level`` halves the steps."""
        landing, until = begun(states, start, until, self.stops is not None)
        if len(states) >= NOTED:
            _note()
        bounds = np.full(len(states), math.inf) if longest is None else longest
        if longest is None and level > 0:  # smaller steps as well: few steps may be the same at any tolerance
            usual = self.ensemble(states, constants, start=start, until=until, leaving=leaving)
            bounds = np.abs(usual.reached - landing.reached) / (2**level * usual.steps + 1)
        kept: list[tuple[np.ndarray, Interpolant]] | None = [] if dense else None
        tolerance = max(self.engine.tolerance_at(level), self.method.least)
        for rows in np.array_split(np.arange(len(states)), max(1, -(-len(states) // RUNS_TOGETHER))):
            Runs(
                self.method, self.stops, landing, constants, until, bounds, rows, tolerance, self.engine.most_steps,
                leaving, kept,
            ).go()  # fmt: skip
        if kept is not None:
            landing.dense = [DenseOutput.of(kept, row) for row in range(len(states))]
        return landing


def installed(package: str) -> bool:
    """Whether a package can be imported, without importing it; an import hook may say no by ImportError."""
    try:
        return importlib.util.find_spec(package) is not None
    except ImportError:
        return False


@lru_cache(maxsize=1)
def _note() -> None:
    """Tell, once, that large ensembles would be quicker with heyoka, unless it is there and this method was chosen."""
    if not installed("heyoka"):
        logging.getLogger("varcalc").warning(
            "heyoka is not installed: large bundles of rays and motions go by NumPy's arrays, to the same digits, "
            "and up to five times slower than by heyoka once it has compiled them. Where there is a wheel for it: "
            "python -m pip install heyoka"
        )


@lru_cache(maxsize=1)
def _tables() -> tuple[np.ndarray, ...]:
    """SciPy's coefficients: stages with the new state as the last, their places, errors, extra stages, dense output.

    They are of the slopes in the order of :data:`KEPT_AT`.
    """
    from scipy.integrate import DOP853

    stages = np.zeros((13, 13))
    stages[:12, :12], stages[12, :12] = DOP853.A, DOP853.B
    errors = np.stack([DOP853.E5, DOP853.E3])
    reordered = [table[..., [*KEPT_AT, *range(3, table.shape[-1])]] for table in (stages, errors, DOP853.A_EXTRA)]
    dense = DOP853.D[:, [*KEPT_AT, *range(3, DOP853.D.shape[1])]]
    return reordered[0], np.append(DOP853.C, 1.0), reordered[1], reordered[2], DOP853.C_EXTRA, dense


@lru_cache(maxsize=1)
def _used() -> list[slice]:
    """Where in memory the slopes are that each stage is made of: after the fourth neither the second nor the third."""
    nonzero = [np.flatnonzero(row) for row in _tables()[0]]
    return [slice(int(places[0]), int(places[-1]) + 1) if len(places) else slice(0) for places in nonzero]


@dataclass(frozen=True)
class DormandPrince:
    """The method of order 8 for one system; see :class:`varcalc.integrators.side_by_side.EmbeddedMethod`."""

    rates: PointEvaluator
    spare: dict[int, DormandPrinceStepper | WrittenStepper] = field(default_factory=dict, repr=False, compare=False)
    power, safety, least = 8.0, 0.9, SMALLEST

    def __reduce__(self) -> tuple[Any, ...]:
        return DormandPrince, (self.rates,)

    def room(self, m: int) -> DormandPrinceStepper | WrittenStepper:
        """See :meth:`varcalc.integrators.side_by_side.EmbeddedMethod.room`."""
        kept = self.spare.pop(m, None)
        if kept is not None:
            return kept
        if m <= FEW_RUNS and (written := self._written) is not None:
            return WrittenStepper(written, m)
        return DormandPrinceStepper(self.rates, m)

    @cached_property
    def _written(self) -> WrittenStep | None:
        system = self.rates.function
        return _written_step(self.rates) if worth_writing(system) else None


def _written_step(rates: PointEvaluator) -> WrittenStep:
    """A step as one function; what it leaves to its interpolant are the stages."""
    stages, places, errors, extra, extra_places, within = _tables()
    system = rates.function
    size = system.numel_in(1)
    time, end = ca.SX.sym("t"), ca.SX.sym("e")
    state, slope, constants = (ca.SX.sym(name, system.numel_in(k)) for name, k in (("Y", 1), ("f", 1), ("c", 2)))
    h = end - time

    k: dict[int, Expression] = {KEPT_AT[0]: h * slope}
    there, rate = state, slope
    for s in range(1, len(stages)):
        there = state + weighted(stages[s], k)
        rate = ca.densify(system(end if s == len(stages) - 1 else time + places[s] * h, there, constants))
        k[KEPT_AT[s] if s < len(KEPT_AT) else s] = h * rate
    result = ca.vertcat(there, rate, *(weighted(row, k) for row in errors), *(k[j] for j in sorted(k)))
    begun = [time, end, state, slope, constants]
    step = ca.Function("step", begun, [ca.densify(result)])

    known = ca.SX.sym("known", result.numel())
    new, following, _, _, *given = ca.vertsplit(known, size)
    k = dict(enumerate(given))
    for row, place in zip(extra, extra_places, strict=True):
        k[len(k)] = h * ca.densify(system(time + place * h, state + weighted(row, k), constants))
    rise, first = new - state, k[KEPT_AT[0]]
    shape = ca.vertcat(
        rise, first - rise, 2 * rise - (h * following + first), *(weighted(row, k) for row in within)
    )  # fmt: skip
    between = ca.Function("between", [*begun, known], [ca.densify(shape)])
    return WrittenStep(rates, PointEvaluator(step), PointEvaluator(between), 2, _combined_error)


def _combined_error(fifth: np.ndarray, third: np.ndarray) -> np.ndarray:
    """The error (m,) of order 5, corrected by that of order 3, of both (m, N) in units of the states."""
    of_fifth, of_third = (np.einsum("mn,mn->m", part, part) for part in (fifth, third))
    denominator = of_fifth + 0.01 * of_third
    return np.where(denominator == 0, 0.0, of_fifth / np.sqrt(denominator * fifth.shape[1]))


class DormandPrinceStepper:
    """Memory for a step of ``m`` runs; see :class:`varcalc.integrators.side_by_side.Stepper`."""

    def __init__(self, rates: PointEvaluator, m: int) -> None:
        system = rates.function
        size = system.numel_in(1)
        self.evaluator = rates
        self.order: Literal["C", "F"] = rates.order(m)
        self.time, self.constants = np.zeros(m), np.zeros((m, system.numel_in(2)), order=self.order)
        self.state, self.rates, self.sum = (np.zeros((m, size), order=self.order) for _ in range(3))
        self.call = rates.bound([self.time[:, None], self.state, self.constants], self.rates)
        # times the step
        stages = np.zeros((13, m, size)) if self.order == "C" else np.zeros((13, size, m)).transpose(0, 2, 1)
        self.stages: np.ndarray = stages

    def slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N)."""
        self.time[:], self.state[:] = time, state
        self.call()
        return self.rates.copy("K")

    def step(
        self, time: np.ndarray, end: np.ndarray, state: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`varcalc.integrators.side_by_side.Stepper.step`."""
        stages, places, *_ = _tables()
        k, h = self.stages, end - time
        column = h[:, None]
        times = time + places[:, None] * h
        times[12] = end
        np.multiply(slope, column, out=k[KEPT_AT[0]])
        for s, used in enumerate(_used()[1:], start=1):
            combined(stages[s, used], k[used], self.sum)
            np.add(state, self.sum, out=self.state)
            self.time[:] = times[s]
            self.call()
            np.multiply(self.rates, column, out=k[KEPT_AT[s] if s < len(KEPT_AT) else s])
        return self.state.copy("K"), self.rates.copy("K")

    def error(self, size: np.ndarray) -> np.ndarray:
        """That of order 5, corrected by that of order 3; see :meth:`varcalc.integrators.side_by_side.Stepper.error`."""
        return _combined_error(*(combined(weights, self.stages[:13]) / size for weights in _tables()[2]))

    def interpolant(
        self, at: np.ndarray, time: np.ndarray, length: np.ndarray, ends: tuple[np.ndarray, np.ndarray],
        slopes: tuple[np.ndarray, np.ndarray], *, dense: bool,  # noqa: ARG002  it is one and the same
    ) -> Interpolant:  # fmt: skip
        """See :meth:`varcalc.integrators.side_by_side.Stepper.interpolant`; of order 7, ibid. sect. II.6."""
        _, _, _, extra, places, within = _tables()
        time, length, constants = time[at], length[at], self.constants[at]
        state, new, following = ends[0][at], ends[1][at], slopes[1][at]
        m, column = len(at), length[:, None]
        k = np.empty((16, m, state.shape[1]))
        k[:13] = self.stages[:13, at]
        for s, (row, place) in enumerate(zip(extra, places, strict=True), start=13):
            there = state + combined(row[:s], k[:s])
            np.multiply(self.evaluator(m, (time + place * length)[:, None], there, constants), column, out=k[s])
        rise = new - state
        shape = np.empty((7, *rise.shape))
        first = k[KEPT_AT[0]]
        shape[0], shape[1] = rise, first - rise
        shape[2] = 2 * rise - (column * following + first)
        for row, out in zip(within, shape[3:], strict=True):
            out[:] = combined(row, k)
        return Interpolant(time, length, state, shape)


@dataclass(frozen=True)
class DenseOutput:
    """The dense output of one run: its ``steps`` (K,), one after the other."""

    steps: Interpolant

    @classmethod
    def of(cls, kept: Sequence[tuple[np.ndarray, Interpolant]], row: int) -> DenseOutput | None:
        """The steps of one run among all that were ``kept`` with their rows; None where there was none."""
        own = [step[np.flatnonzero(rows == row)] for rows, step in kept if row in rows]
        return cls(Interpolant.joined(own)) if own else None

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States (m, N) at ``times`` (m,)."""
        steps = self.steps
        way = math.copysign(1.0, steps.length[0])
        at = np.searchsorted(way * (steps.time + steps.length), way * times)
        at = np.minimum(at, len(steps.time) - 1)
        return steps[at]((times - steps.time[at]) / steps.length[at])
