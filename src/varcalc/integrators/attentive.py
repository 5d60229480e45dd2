"""Integration that does not step over what is narrow.

An integrator knows a system from where it has been. What is nothing there and something farther on, such as a load
exp(-u²) with u far from zero, its step goes over, and no tolerance tells. The arguments u of such operations are
therefore enclosed in the box in which a run has been; where one has gone through more there than its operation lets
through unseen, the run is made anew with one state more for each operation, arsinh u or ln |u|. Its series ends where
the operation begins to matter, however far off that is, so that steps become short on the way there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import CannotLower, scalar_function
from varcalc.integrators.protocol import Engine, Flow, Landing, Run, RunOutcome
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.instructions import POWERS, interpret, operate
from varcalc.symbolic.tracing import Expression
from varcalc.symbolic.variation import (
    CHANGE,
    FACTOR,
    LEAST_POWER,
    LOCAL,
    SEEN_FROM_AFAR,
    VARYING,
    Between,
    Rules,
    excess,
    gentle,
    varied_by,
)

WIDE = 12.0
"""By how many times more than is gentle an argument may go from the middle of where a run has been."""
MOST_AT_ONCE = 16
"""Runs of which that is asked together."""
RUN_PLACES = 1025
"""Places of a run at which it is asked where it has been."""
MISSED = 1e-6
"""Of the largest rate: by how much the rates of a run may miss the system's."""
RANGE_MARGIN = 0.1
"""By what share of their difference a run may leave the range of two neighbouring places."""
OFF_CENTRE = 0.5
"""Added to u in arsinh u: what is odd or even in time has a series with gaps, and what looks ahead must have none."""
SOFT = 1e-9
"""Below that ln |u| is smooth: a run may go through u = 0 where nothing comes of it."""
LENGTHS = {ca.OP_HYPOT, ca.OP_ATAN2}
FROM_EDGES: dict[int, tuple[float, ...]] = {
    ca.OP_LOG1P: (-1.0,), ca.OP_ACOSH: (1.0,), ca.OP_ASIN: (-1.0, 1.0), ca.OP_ACOS: (-1.0, 1.0),
              ca.OP_ATANH: (-1.0, 1.0)}  # fmt: skip
"""Where the domain of an operation ends."""
RULES = {operation: rule for operation, rule in VARYING.items() if operation not in SEEN_FROM_AFAR}
"""How far arguments may go unseen, by operation; sines are seen from everywhere."""


POWER = 3.0
"""Power of what is divided by that a series has to see from afar."""


def _by_logarithm(rule: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """Of what matters by a factor: a power of it is an exponential of its logarithm, seen from as far off."""
    return lambda *operands: POWER * np.log(np.fmax(FACTOR * rule(*operands), 1.0)) / CHANGE


def _power(base: Between, exponent: Between) -> np.ndarray:
    """The same of a power, by its own exponent where that is known."""
    stated = VARYING[ca.OP_POW](base, exponent)
    times = np.fmax(np.abs(exponent.range[0]), 1.0)
    by_logarithm = np.where(stated > 0, times * np.log(np.fmax(FACTOR * base.factor, 1.0)) / CHANGE, 0.0)
    return np.where(exponent.range[0] == exponent.range[1], by_logarithm, stated)


FROM_AFAR: Rules = {
    **{operation: rule if operation in LOCAL else _by_logarithm(rule) for operation, rule in RULES.items()},
    **dict.fromkeys(POWERS, _power),
}
"""How far arguments may go unseen from the middle of where a run has been, up to WIDE."""


@spelled
@dataclass(frozen=True)
class Attentive:
    """An ``engine`` whose runs do not step over what is narrow."""

    engine: Engine

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return self.engine.name

    def compile(
        self, system: ca.Function, stops: ca.Function | None = None, *, watching: int = 0,
        at_ends: tuple[int, ...] = (),
    ) -> Flow:  # fmt: skip
        """See :meth:`Engine.compile`."""
        flow = self.engine.compile(system, stops, watching=watching, at_ends=at_ends)
        try:
            formula = scalar_function(system)
        except CannotLower:
            return flow
        return flow if gentle(formula, RULES) else AttentiveFlow(self.engine, formula, stops, flow, at_ends)


@dataclass(frozen=True)
class AttentiveFlow:
    """A ``system`` that may hold something narrow; its verbs are the protocol's."""

    engine: Engine
    system: ca.Function
    stops: ca.Function | None
    free: Flow
    at_ends: tuple[int, ...] = ()

    @property
    def compiled(self) -> bool:
        """See :attr:`Flow.compiled`."""
        return self.free.compiled

    @cached_property
    def watched(self) -> Flow:
        """The system with its companions."""
        stops = self.stops
        if stops is not None:
            s, state, numbers = (ca.SX.sym(name, self._accompanied.numel_in(k)) for k, name in enumerate("sYc"))
            stops = ca.Function("stops", [s, state, numbers], [stops(s, state[: self._size], numbers)])
        extra = self._accompanied.numel_in(1) - self._size
        return self.engine.compile(self._accompanied, stops, watching=extra, at_ends=self.at_ends)

    @cached_property
    def _accompanied(self) -> ca.Function:
        return with_companions(self.system)

    @cached_property
    def _rates(self) -> PointEvaluator:
        return PointEvaluator(self.system)

    @cached_property
    def _narrowing(self) -> list[int]:
        """The states on which it depends whether something narrow is met: where rays are, and not where they head."""
        return varied_by(self.system, FROM_AFAR, 1)

    @cached_property
    def _narrowing_rates(self) -> PointEvaluator:
        """The rates of those states alone."""
        arguments = [ca.SX.sym(name, self.system.sparsity_in(k)) for k, name in enumerate("sYc")]
        rates = ca.densify(self.system(*arguments))
        return PointEvaluator(ca.Function("narrowing", arguments, [rates[self._narrowing]]))

    @property
    def _size(self) -> int:
        return self.system.numel_in(1)

    def _extended(self, states: np.ndarray) -> np.ndarray:
        """States (..., N) with companions, which begin at zero."""
        extra = self._accompanied.numel_in(1) - self._size
        return np.concatenate([states, np.zeros((*states.shape[:-1], extra))], axis=-1)

    def _wide(self, low: np.ndarray, high: np.ndarray, s: np.ndarray, constants: np.ndarray) -> np.ndarray:
        """True (m,) for boxes in which something narrow may be; ``s`` (m, 2), ``constants`` (m, c).

        The sides ``low`` and ``high`` (m, k) are those of the states on which it depends.
        """

        def sides(first: np.ndarray, last: np.ndarray) -> list[Between]:
            middles = ((a + b) / 2 for a, b in zip(first.T, last.T, strict=True))
            return [Between((a, b), middle, middle) for a, b, middle in zip(first.T, last.T, middles, strict=True)]

        with np.errstate(all="ignore"):
            known = dict(zip(self._narrowing, sides(low, high), strict=True))
            boxes = [sides(s[:, :1], s[:, 1:]), known, sides(constants, constants)]
            return ~(excess(self.system, boxes, (len(low),), FROM_AFAR) <= WIDE)

    def _wide_along(self, runs: Sequence[Run], constants: np.ndarray) -> np.ndarray:
        """True (m,) for runs where something narrow may be in the box of all places where they have been."""
        been = [run.states[np.all(np.isfinite(run.states), axis=1)][:, self._narrowing] for run in runs]
        low, high = np.array([places.min(0) for places in been]), np.array([places.max(0) for places in been])
        ends = np.sort([[run.abscissae[0], run.reached] for run in runs], axis=1)
        return self._wide(low, high, ends, np.reshape(constants, (1, -1)))

    def _unseen_along(self, runs: Sequence[Run], constants: np.ndarray) -> np.ndarray:
        """The same of the boxes between closer places, as enclosures are wide in wide boxes.

        What the places themselves show a run need not have seen: there its rates must be the system's.
        """
        unseen, abscissae = np.ones(len(runs), dtype=bool), runs[0].abscissae
        grid = np.linspace(abscissae[0], abscissae[-1], RUN_PLACES)
        states = np.array([run.states for run in runs])[:, np.isin(abscissae, grid)]
        told = np.flatnonzero([run.completed for run in runs] & np.all(np.isfinite(states), axis=(1, 2)))
        states = states[told]
        s, numbers = np.sort(np.column_stack([grid[:-1], grid[1:]]), axis=1), np.reshape(constants, (1, -1))
        m, size = len(told), states.shape[-1]
        rates = self._rates(m * len(grid), np.tile(grid, m)[:, None], states.reshape(-1, size), numbers)
        rates = rates.reshape(states.shape)
        along = states.transpose(1, 0, 2).reshape(len(grid), -1)
        slopes = _differentiated(along, grid[1] - grid[0]).reshape(len(grid), m, size).transpose(1, 0, 2)
        most = MISSED * np.abs(rates).max(axis=1, keepdims=True) + np.finfo(float).tiny
        followed = np.all(np.abs(slopes - rates) <= most, axis=(1, 2))
        if not followed.any():
            return unseen

        def sides(values: np.ndarray) -> list[Between]:
            """The boxes between neighbouring places, with what the values are at both."""
            first, last = values[:, :-1].reshape(-1, size).T, values[:, 1:].reshape(-1, size).T
            room = RANGE_MARGIN * np.abs(last - first)
            ranges = zip(np.minimum(first, last) - room, np.maximum(first, last) + room, strict=True)
            return [Between(box, a, b) for box, a, b in zip(ranges, first, last, strict=True)]

        fixed = [Between((value, value), value, value) for value in numbers.T]
        low, high = (np.tile(side, int(followed.sum())) for side in s.T)
        with np.errstate(all="ignore"):
            boxes = [[Between((low, high), low, high)], sides(states[followed]), fixed]
            seen = excess(self.system, boxes, low.shape, RULES).reshape(-1, len(s)) <= 1.0
        unseen[told[followed]] = ~seen.all(axis=1)
        return unseen

    def trajectory(
        self, abscissae: np.ndarray, state: np.ndarray, constants: np.ndarray, *, level: int = 0,
        longest: float | None = None, dense: bool = False,
    ) -> Run:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.trajectory`."""
        grid, own = _looked_at(abscissae)
        run = self.free.trajectory(grid, state, constants, level=level, longest=longest, dense=dense)
        if self._wide_along([run], constants)[0] and self._unseen_along([run], constants)[0]:
            more = self.watched.trajectory(
                abscissae, self._extended(state), constants, level=level, longest=longest, dense=dense
            )
            told = self._without_companions(more)
            if told is not None:
                return told
        return replace(run, abscissae=np.asarray(abscissae), states=run.states[own])

    def trajectories(self, abscissae: np.ndarray, states: np.ndarray, constants: np.ndarray) -> list[Run]:
        """See :meth:`Flow.trajectories`: one look at the boxes of all of them."""
        if not len(states):
            return []
        grid, own = _looked_at(abscissae)
        runs = self.free.trajectories(grid, states, constants)
        wide = np.flatnonzero(self._wide_along(runs, constants))
        parts = np.array_split(wide, math.ceil(len(wide) / MOST_AT_ONCE)) if len(wide) else []
        again = [k for some in parts for k in some[self._unseen_along([runs[k] for k in some], constants)]]
        told = [replace(run, abscissae=np.asarray(abscissae), states=run.states[own]) for run in runs]
        # one that ends early would end all beside it
        whole = [k for k in again if runs[k].completed]
        early = [k for k in again if not runs[k].completed]
        watched = [self.watched.trajectory(abscissae, self._extended(states[k]), constants) for k in early]
        if whole:
            watched += self.watched.trajectories(abscissae, self._extended(states[whole]), constants)
        for k, more in zip(early + whole, watched, strict=True):
            told[k] = self._without_companions(more) or told[k]
        return told

    def _without_companions(self, watched: Run) -> Run | None:
        """A watched run; None where it is no number from the start."""
        if watched.outcome is RunOutcome.NOT_FINITE:
            return None
        inner = watched.trajectory
        kept = None if inner is None else _Shortened(inner, self._size)
        return replace(watched, states=watched.states[:, : self._size], trajectory=kept)

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
        landing = self.free.ensemble(
            states, constants, start=start, until=until, level=level, longest=longest, dense=dense, leaving=leaving
        )
        rows = self._doubtful(states, constants, np.broadcast_to(start, len(states)), landing)
        if len(rows) == 0:
            return landing
        begin, end = (np.broadcast_to(values, len(states))[rows] for values in (start, until))
        more = self.watched.ensemble(
            self._extended(states[rows]), constants[rows], start=begin, until=end, level=level,
            longest=None if longest is None else longest[rows], dense=dense, leaving=leaving,
        )  # fmt: skip
        landing.states[rows] = more.states[:, : self._size]
        for name in ("reached", "outcomes", "stopped_by", "steps"):
            getattr(landing, name)[rows] = getattr(more, name)
        landing.rounds += more.rounds
        if dense and landing.dense is not None and more.dense is not None:
            between = list(landing.dense)
            for row, inner in zip(rows, more.dense, strict=True):
                between[row] = None if inner is None else _Shortened(inner, self._size)
            landing.dense = between
        return landing

    def _doubtful(self, states: np.ndarray, constants: np.ndarray, start: np.ndarray, landing: Landing) -> np.ndarray:
        """The numbers of runs that may have gone over something; of all together first, which is mostly enough."""
        taken = np.abs(landing.reached - start)
        first, last = states[:, self._narrowing], landing.states[:, self._narrowing]
        ends = (start, states), (landing.reached, landing.states)
        rates, others = (self._narrowing_rates(len(states), s[:, None], y, constants) for s, y in ends)
        # in place: new arrays of this size are fetched from the system, and cleared
        strayed = np.fmax(np.abs(rates, out=rates), np.abs(others, out=others), out=rates)
        low, high = np.minimum(first, last), np.maximum(first, last)
        with np.errstate(all="ignore"):
            strayed *= taken[:, None]
            strayed -= np.subtract(high, low, out=others)
            strayed /= 2
        strayed[np.isnan(strayed)] = np.inf
        np.maximum(strayed, 0.0, out=strayed)
        low -= strayed
        high += strayed
        times = np.sort(np.column_stack([start, landing.reached]), axis=1)
        all_times = np.array([[times[:, 0].min(), times[:, 1].max()]])
        alike = len(constants) > 0 and bool(np.all(constants == constants[:1]))
        if alike and not self._wide(low.min(0)[None], high.max(0)[None], all_times, constants[:1])[0]:
            return np.zeros(0, dtype=int)
        return np.flatnonzero(self._wide(low, high, times, constants))


def _looked_at(abscissae: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The places of a run at which it is looked at, and which of them are its ``abscissae``."""
    first, last = float(abscissae[0]), float(abscissae[-1])
    grid = np.union1d(np.linspace(first, last, RUN_PLACES), abscissae)[:: 1 if last > first else -1]
    return grid, np.flatnonzero(np.isin(grid, abscissae))


def _differentiated(values: np.ndarray, step: float) -> np.ndarray:
    """The derivatives of columns (m, N) at equal steps, by polynomials through nine neighbours."""
    offsets = np.arange(9.0) - 4
    powers = np.arange(9)
    table = np.vander(offsets, increasing=True)
    slopes = np.column_stack([np.zeros(9), table[:, :-1] * powers[1:]])
    weights = np.linalg.solve(table.T, slopes.T).T / step  # of the nine values for the slope at each of them
    windows = np.lib.stride_tricks.sliding_window_view(values, 9, axis=0)
    return np.concatenate([weights[:4] @ values[:9], windows @ weights[4], weights[5:] @ values[-9:]])


@dataclass(frozen=True)
class _Shortened:
    """A trajectory without the companions."""

    trajectory: Callable[[np.ndarray], np.ndarray]
    size: int

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return self.trajectory(times)[:, : self.size]


def with_companions(system: ca.Function) -> ca.Function:
    """``(s, Y (N,), c) -> dY/ds`` with k states more: arsinh u, or ln |u| where u matters by factors.

    Their series end where the operation on u begins to matter. They begin at zero: only their rates count.
    """
    s, state, constants = (ca.SX.sym(name, system.numel_in(k)) for k, name in enumerate("sYc"))
    rates = ca.densify(system(s, state, constants))
    logarithms: list[Expression] = []
    arguments: list[Expression] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        """The operation; what it is to be watched for is kept, where it moves along a run."""
        for found, kept in zip(_watched(operation, operands), (arguments, logarithms), strict=True):
            for u in found:
                moves = ca.depends_on(u, ca.vertcat(s, state))
                if moves and not any(ca.is_equal(u, known, 8) for known in kept):
                    kept.append(u)
        return operate(operation, operands)

    interpret(system, [ca.vertsplit(s), ca.vertsplit(state), ca.vertsplit(constants)], ca.SX, applied)

    def rate(u: Expression) -> Expression:
        return ca.jtimes(u, state, rates) + ca.jacobian(u, s)

    by_size = [u * rate(u) / (u**2 + SOFT**2) for u in logarithms]
    on_own_scale = [rate(u) / ca.sqrt(1 + (u + OFF_CENTRE) ** 2) for u in arguments]
    count = len(by_size) + len(on_own_scale)
    longer = ca.SX.sym("Z", state.numel() + count)
    all_rates = ca.substitute(ca.vertcat(rates, *by_size, *on_own_scale), state, longer[: state.numel()])
    return ca.Function("with_companions", [s, longer, constants], [ca.densify(all_rates)], {"cse": True})


def _watched(operation: int, operands: Sequence[Expression]) -> tuple[list[Expression], list[Expression]]:
    """The arguments of an operation that matter by their value, and those that matter by their size."""
    a, b = operands[0], operands[-1]
    if operation not in RULES:
        return [], []
    if operation in POWERS:
        whole = b.is_constant() and float(b).is_integer() and 0 <= float(b) < LEAST_POWER
        return ([] if b.is_constant() else [b]), ([] if whole else [a])
    if operation in LENGTHS:
        return [], [a**2 + b**2]
    if operation in FROM_EDGES:
        return [], [a - edge for edge in FROM_EDGES[operation]]
    if operation == ca.OP_DIV:
        return [], [b]
    return ([a], []) if operation in LOCAL else ([], [a])
