"""Stopping functions: their values and rates along the solutions, and where a step crosses one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import check_system
from varcalc.numerics.roots import bracketed_newton
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import Interval, enclosures

STRAYING = 2.0
"""By how many times the greater rate at the two ends of a step a solution may leave the line between them."""
PLACES_A_DEGREE = 3
"""Places along a step, by the degree of its interpolant, where the stopping functions are looked at."""
NEAR_BY_BEND, ON_BY_BEND = 1.5, 1e-9
"""Of the bend between three places: a function that is no nearer to zero at the middle one does not come to it, and one
that is so near at the first sets out there."""
ZOOMS, ZOOM = 4, 16
"""How often, and by how much, the places about a dip close in on it."""
LAST_CHANGE = 1e-7
"""Of a step: a zero of its interpolant that was known so far is known to all digits, as Newton's iteration goes."""
POLISHES = 2
"""Newton's steps from an interpolant, which is some digits off, onto the stop itself."""


@dataclass(frozen=True)
class Interpolant:
    """The solution within m steps: from ``time`` (m,) by ``length`` (m,), states (m, N), coefficients (k, m, N)."""

    time: np.ndarray
    length: np.ndarray
    state: np.ndarray
    shape: np.ndarray

    def __call__(self, part: np.ndarray) -> np.ndarray:
        """States (m, N) after a ``part`` (m,) of each step."""
        x, total = part[:, None], np.zeros_like(self.state)
        for k in reversed(range(len(self.shape))):
            total = (total + self.shape[k]) * (x if k % 2 == 0 else 1 - x)
        return self.state + total

    def at(self, parts: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """The states ``which`` (p, m, k) after the same ``parts`` (p,) of every step, by one product of matrices."""
        turns = np.arange(len(self.shape)) % 2 == 0
        weights = np.cumprod(np.where(turns, parts[:, None], 1 - parts[:, None]), axis=1)
        shape, start = self.shape.transpose(0, 2, 1)[:, list(which)], self.state.T[list(which)]
        moved = (weights @ shape.reshape(len(shape), -1)).reshape(len(parts), *start.shape)
        moved += start
        return moved.transpose(0, 2, 1)

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
        seen = ca.Function("levels", [state[list(used)], constants], [level])
        object.__setattr__(self, "_levels", PointEvaluator(seen))

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
        box: list[Interval] = []
        reach = STRAYING * np.abs(lengths)
        for k in self._used:
            first, last = (ends[:, k] for ends in states)
            farthest = reach * np.maximum(*(np.abs(ends[:, k]) for ends in rates))
            strayed = np.maximum((farthest - np.abs(last - first)) / 2, 0.0)
            box.append((np.minimum(first, last) - strayed, np.maximum(first, last) + strayed))
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
        m, count = len(signs), PLACES_A_DEGREE * len(step.shape)
        above = self._above(step.at(np.arange(count + 1) / count, self._used), constants, signs)
        crossed = above[1:] < 0
        place = crossed.any(axis=1).argmax(axis=0)
        rows, stops = np.nonzero(crossed[place, :, np.arange(m)])
        low, high = place[rows] / count, (place[rows] + 1) / count
        dips = self._dips(step, constants, signs, above)
        rows, stops, low, high = (np.append(a, b) for a, b in zip((rows, stops, low, high), dips, strict=True))
        if len(rows) == 0:
            return rows, np.zeros(0), stops
        zeros = self._zeros(step[rows], constants[rows], signs[rows, stops], stops, low, high)
        order = np.lexsort((stops, zeros, rows))
        rows, zeros, stops = rows[order], zeros[order], stops[order]
        kept = np.append(True, np.diff(rows) > 0)
        return rows[kept], zeros[kept], stops[kept]

    def _above(self, states: np.ndarray, constants: np.ndarray, signs: np.ndarray) -> np.ndarray:
        """The functions (p, k, m) at states (p, m, u), which are those they use, by their ``signs`` (m, k) before."""
        p, m, u = states.shape
        columns = states.transpose(2, 0, 1).reshape(u, p * m)
        levels = self._levels(p * m, columns.T, np.tile(constants, (p, 1))).reshape(p, m, -1)
        return np.multiply(levels.transpose(0, 2, 1), signs.T, order="C")

    def _dips(
        self, step: Interpolant, constants: np.ndarray, signs: np.ndarray, above: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Where functions cross zero and come back between two of the places at which they are ``above`` it.

        Their rows, the numbers of the functions, and the parts of the step before the first zero and between the two.
        Three places close in on the vertex of the parabola through them.
        """
        width = 1 / (len(above) - 1)
        bend = above[:-2] - 2 * above[1:-1] + above[2:]
        before, stops, rows = np.nonzero(
            (above[1:-1] < NEAR_BY_BEND * bend) & (above[:-2] > ON_BY_BEND * bend) & (above[2:] > 0)
        )
        low, three = before * width, np.array([above[before + k, stops, rows] for k in range(3)])
        at, dip = low + width, np.zeros(len(rows), dtype=bool)
        near = np.flatnonzero((three[1] > 0) & (np.abs(_vertex(three)) <= 1.0))
        for _ in range(ZOOMS):
            if len(near) == 0:
                break
            at[near], width = at[near] + width * np.clip(_vertex(three[:, near]), -1.0, 1.0), width / ZOOM
            at[near] = np.clip(at[near], low[near], 1.0)
            own, places = step[rows[near]], np.clip(at[near] + width * np.arange(-1, 2)[:, None], low[near], 1.0)
            states = np.array([own(part)[:, list(self._used)] for part in places])
            found = self._above(states, constants[rows[near]], signs[rows[near]])
            three[:, near] = found[:, stops[near], np.arange(len(near))]
            under = three[:, near].min(axis=0) < 0
            met = near[under]
            at[met], dip[met] = places[three[:, met].argmin(axis=0), np.flatnonzero(under)], True
            near = near[~under]
        return rows[dip], stops[dip], low[dip], at[dip]

    def _zeros(
        self, step: Interpolant, constants: np.ndarray, sign: np.ndarray, stops: np.ndarray, low: np.ndarray,
        high: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """The zero of one function of each row between two places, by Newton's iteration kept inside the bracket."""
        rows = np.arange(len(low))

        def before(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            level, slope, _ = self(step(at), constants)
            return level[rows, stops] * sign, slope[rows, stops] * sign * step.length

        return bracketed_newton(before, low, high, (low + high) / 2, absolute=LAST_CHANGE)[0]

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


def _vertex(three: np.ndarray) -> np.ndarray:
    """Where the parabolas through values (3, n) at -1, 0 and 1 turn."""
    before, here, after = three
    with np.errstate(all="ignore"):
        return np.nan_to_num((before - after) / (2 * (before - 2 * here + after)))
