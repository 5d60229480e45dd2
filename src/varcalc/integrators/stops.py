"""Stopping functions: their values and rates along the solutions, and where a step crosses one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import check_system
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import Interval, enclosures

STRAYING = 2.0
"""By how many times the greater rate at the two ends of a step a solution may leave the line between them."""
STEP_PLACES = 12
"""Places along a step where the stopping functions are looked at."""
ROUNDS = 60
"""Newton's steps and bisections that bring any bracket to round-off."""
LAST_CHANGE = 1e-10
"""Of a step: a zero of its interpolant, which is some digits off, that is known so far is polished on the stop."""
POLISHES = 2
"""Newton's steps from an interpolant, which is some digits off, onto the stop itself."""


@dataclass(frozen=True)
class Interpolant:
    """The solution within m steps: from ``time`` (m,) by ``length`` (m,), states (m, N), coefficients (7, m, N)."""

    time: np.ndarray
    length: np.ndarray
    state: np.ndarray
    shape: np.ndarray

    def __call__(self, part: np.ndarray) -> np.ndarray:
        """States (m, N) after a ``part`` (m,) of each step."""
        x, total = part[:, None], np.zeros_like(self.state)
        for k in range(6, -1, -1):
            total = (total + self.shape[k]) * (x if k % 2 == 0 else 1 - x)
        return self.state + total

    def at(self, parts: np.ndarray) -> np.ndarray:
        """States (p, m, N) after the same ``parts`` (p,) of every step, by one product of matrices."""
        weights = np.cumprod(np.where(np.arange(7) % 2 == 0, parts[:, None], 1 - parts[:, None]), axis=1)
        moved = (weights @ self.shape.reshape(7, -1)).reshape(len(parts), *self.state.shape)
        moved += self.state
        return moved

    def __getitem__(self, rows: np.ndarray) -> Interpolant:
        """Some of the steps."""
        return Interpolant(self.time[rows], self.length[rows], self.state[rows], self.shape[:, rows])

    @classmethod
    def joined(cls, parts: Sequence[Interpolant]) -> Interpolant:
        """The steps of all ``parts``, one after the other; at least one."""
        time, length, state = (
            np.concatenate([getattr(p, name) for p in parts]) for name in ("time", "length", "state")
        )
        return cls(time, length, state, np.concatenate([p.shape for p in parts], axis=1))


@dataclass(frozen=True)
class Stops:
    """Stopping functions g(Y, constants) of a system, with dg/ds = g_Y f, on arrays of states.

    Parameters
    ----------
    system, stops : ca.Function
        As :meth:`varcalc.integrators.protocol.Engine.compile` takes them.
    """

    system: ca.Function
    stops: ca.Function
    _call: PointEvaluator = field(init=False, repr=False, compare=False)
    _levels: PointEvaluator = field(init=False, repr=False, compare=False)
    """The functions alone, which are looked at far more often than their rates, and cost far less than the system."""
    _used: tuple[int, ...] = field(init=False, repr=False, compare=False)
    """The states that they depend on, which are mostly few."""

    def __post_init__(self) -> None:
        size = check_system(self.system)
        s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", size), ca.SX.sym("c", self.system.numel_in(2))
        rate = ca.densify(ca.SX(self.system(s, state, constants)))
        level = ca.densify(ca.SX(self.stops(s, state, constants)))
        if ca.depends_on(ca.vertcat(rate, level), s):
            raise ValueError("a system with stopping functions, and these, must not depend on s")
        used = tuple(k for k in range(size) if ca.depends_on(level, state[k]))
        object.__setattr__(self, "_used", used)
        slope = ca.jtimes(level, state, rate)
        results = [level, ca.densify(slope), rate]
        object.__setattr__(self, "_call", PointEvaluator(ca.Function("stops", [state, constants], results)))
        object.__setattr__(self, "_levels", PointEvaluator(ca.Function("levels", [state, constants], [level])))

    def __call__(self, states: np.ndarray, constants: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g (m, k), dg/ds (m, k) and dY/ds (m, N) at states (m, N), constants (m, c)."""
        table, k = self._call(len(states), states, constants), int(self.stops.numel_out(0))
        return table[:, :k], table[:, k : 2 * k], table[:, 2 * k :]

    def sides(self, states: np.ndarray, constants: np.ndarray, leaving: tuple[int, ...]) -> np.ndarray:
        """The signs (m, k) of the functions as runs set out; of those they stand on, and leave, that of the rate."""
        level, slope, _ = self(states, constants)
        signs = np.sign(level)
        signs[:, list(leaving)] = np.sign(slope[:, list(leaving)])
        return signs

    def may_stop(
        self, states: tuple[np.ndarray, np.ndarray], rates: tuple[np.ndarray, np.ndarray], lengths: np.ndarray,
        constants: np.ndarray, signs: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """True (m,) for runs that may meet a stop within a step, which are few: only there has it to be looked for.

        The functions are enclosed over the box in which the step lies, by ``states`` (m, N) and ``rates`` (m, N) at
        its two ends and its ``lengths`` (m,); ``signs`` (m, k) are those before it.
        """
        box: list[Interval] = [(0.0, 0.0)] * states[0].shape[1]
        reach = STRAYING * np.abs(lengths)
        for k in self._used:
            first, last = (ends[:, k] for ends in states)
            farthest = reach * np.maximum(*(np.abs(ends[:, k]) for ends in rates))
            strayed = np.maximum((farthest - np.abs(last - first)) / 2, 0.0)
            box[k] = np.minimum(first, last) - strayed, np.maximum(first, last) + strayed
        ranges = enclosures(self._levels.function, [box, [(c, c) for c in constants.T]])[0]
        beyond = np.zeros(len(signs), dtype=bool)
        for sign, (least, greatest) in zip(signs.T, ranges, strict=True):
            beyond |= ~np.where(sign > 0, least > 0, (sign == 0) | (greatest < 0))
        return beyond

    def first(
        self, step: Interpolant, constants: np.ndarray, signs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The runs that meet a stop along a step: their rows, the part of the step until then, the stop's number.

        ``signs`` (m, k) are those before it.
        """
        m, parts = len(signs), np.arange(1, STEP_PLACES + 1) / STEP_PLACES
        states = step.at(parts).reshape(STEP_PLACES * m, -1)
        levels = self._levels(len(states), states, np.tile(constants, (STEP_PLACES, 1))).reshape(STEP_PLACES, m, -1)
        crossed = levels * signs < 0
        place = crossed.any(axis=2).argmax(axis=0)
        rows, stops = np.nonzero(crossed[place, np.arange(m)])
        if len(rows) == 0:
            return rows, np.zeros(0), stops
        zeros = self._zeros(step[rows], constants[rows], signs[rows, stops], stops, place[rows])
        order = np.lexsort((stops, zeros, rows))
        rows, zeros, stops = rows[order], zeros[order], stops[order]
        kept = np.append(True, np.diff(rows) > 0)
        return rows[kept], zeros[kept], stops[kept]

    def _zeros(
        self, step: Interpolant, constants: np.ndarray, sign: np.ndarray, stops: np.ndarray, place: np.ndarray
    ) -> np.ndarray:
        """The zero of one function of each row between two samples, by Newton's iteration kept inside the bracket."""
        low, high = place / STEP_PLACES, (place + 1) / STEP_PLACES
        at, rows = (low + high) / 2, np.arange(len(place))
        for _ in range(ROUNDS):
            level, slope, _ = self(step(at), constants)
            here, rate = level[rows, stops] * sign, slope[rows, stops] * sign * step.length
            low, high = np.where(here > 0, at, low), np.where(here > 0, high, at)
            newton = at - here / rate
            better = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
            still = np.abs(better - at) > LAST_CHANGE
            at = better
            if not still.any():
                break
        return at

    def polished(
        self, states: np.ndarray, constants: np.ndarray, stopped_by: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (m, N) moved along their rates onto the stops they are at, and by how much in s (m,)."""
        rows, total = np.arange(len(states)), np.zeros(len(states))
        for _ in range(POLISHES):
            level, slope, rate = self(states, constants)
            with np.errstate(all="ignore"):
                shift = -level[rows, stopped_by] / slope[rows, stopped_by]
            shift = np.where(np.isfinite(shift), shift, 0.0)  # a graze: the rate is zero, and so is the level
            states, total = states + shift[:, None] * rate, total + shift
        return states, total
