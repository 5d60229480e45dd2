"""The convexified problem: what finer and finer corners bring the functional down to.

Where L is not convex in the slope, curves that alternate between two slopes
come lower than any smooth one, and in the limit replace L by its convex
envelope in the slope (Dacorogna, "Direct Methods in the Calculus of
Variations", ch. 9). By Caratheodory's theorem two slopes suffice for one
unknown function: the relaxed problem is solved over polygons, each piece of
which has two slopes and their shares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import gauss
from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric, Through
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem

SPREADS = (0.3, 1.0, 3.0)
"""Half distances of the two slopes at the start, in units of the problem's slope."""
TRIED_SLOPES = np.concatenate([-(2.0 ** np.arange(7, -11, -0.25)), [0.0], 2.0 ** np.arange(-10, 7.25, 0.25)])
"""Slopes between which a chord is sought below L, in units of the problem's slope, about 0 and about the chord."""
MIXED = 1e-2
"""Share of the lesser slope from which a piece counts as mixed."""
LEVEL = 1e-3
"""Rise of the chord, relative to its ordinates, that tells nothing of slopes."""
PIECE_POINTS = 3
IPOPT_ITERATIONS = 300


@dataclass(frozen=True)
class Relaxed:
    """A minimum of the convexified functional over polygons on ``x`` (pieces + 1,).

    ``value`` is the functional (with the person's sign), ``y`` the ordinates,
    ``slopes`` (2, pieces) the slopes of each piece and ``shares`` (2, pieces)
    the parts of it that have them.
    """

    value: float
    x: np.ndarray
    y: np.ndarray
    slopes: np.ndarray
    shares: np.ndarray

    @property
    def mixed(self) -> np.ndarray:
        """Pieces on which two different slopes alternate, shape (pieces,) of bool."""
        apart = np.abs(np.diff(self.slopes, axis=0)[0]) > MIXED * np.abs(self.slopes).max()
        return (self.shares.min(0) > MIXED) & apart


def applies(problem: Functional) -> bool:
    """Whether the relaxed problem can be stated: one function, first order, fixed abscissae, no other unknowns."""
    return (
        isinstance(problem, Problem)
        and problem.n == 1
        and problem.order == 1
        and not (problem.unknowns or problem.end_cost or breaks(problem))
        and not any(end.slides or end.periodic for end in (problem.start, problem.end))
        and not any(isinstance(c, Holonomic | Through) for c in problem.constraints)
    )


def relaxed(problem: Problem, pieces: int) -> Relaxed | None:
    """The lowest polygon of the convexified functional that IPOPT reaches from several starts; None when none."""
    program = _RelaxedProgram(problem, pieces)
    found = [program.solved(start) for start in program.starts()]
    sign = problem.sign
    return min((f for f in found if f is not None), key=lambda f: sign * f.value, default=None)


class _RelaxedProgram:
    """The relaxed problem as a nonlinear program in ordinates, shares and slopes, all of size one."""

    def __init__(self, problem: Problem, pieces: int) -> None:
        self.problem, self.pieces = problem, pieces
        a, b = problem.span
        self.x = np.linspace(a, b, pieces + 1)
        ends = np.concatenate([problem.start.values(1), problem.end.values(1)])
        known = ends[~np.isnan(ends)]
        first, last = np.where(np.isnan(ends), known[0] if len(known) else 0.0, ends)
        self.line = np.linspace(first, last, pieces + 1)
        self.free = np.ones(pieces + 1, dtype=bool)
        self.free[[0, -1]] = np.isnan(ends)
        self.height = max(float(np.abs(self.line).max()), float(np.ptp(self.line)), 1e-300)
        self.height = self.height if self.height > 1e-12 * (b - a) else b - a
        rise = float(np.ptp(self.line))
        self.steep = (rise if rise > LEVEL * self.height else self.height) / (b - a)
        self._state()

    def _state(self) -> None:
        """The program in CasADi's symbols."""
        count, width = self.pieces, float(self.x[1] - self.x[0])
        inner, share = ca.MX.sym("ordinates", int(self.free.sum())), ca.MX.sym("shares", count)
        slopes = [ca.MX.sym(name, count) for name in ("steep", "shallow")]
        placed = ca.MX(ca.DM(self.line))
        places = np.flatnonzero(self.free)
        for i, k in enumerate(places):
            placed[int(k)] = inner[i] * self.height
        self._values = ca.Function("values", self.problem.symbols.all, [self._integrands()])
        totals = self._totals(placed, share, [v * self.steep for v in slopes], width)
        mean = (placed[1:] - placed[:-1]) / (width * self.steep)
        rows = [share * slopes[0] + (1 - share) * slopes[1] - mean]
        self._lower, self._upper = [np.zeros(count)], [np.zeros(count)]
        for j, constraint in enumerate(self.problem.of_type(Isoperimetric)):
            rows.append(totals[1 + j])
            self._bounded(constraint.interval, 1)
        self._add_bounds(rows, placed, [v * self.steep for v in slopes])
        self._w = ca.vertcat(inner, share, *slopes)
        self._objective, self._rows = totals[0], ca.vertcat(*rows)

    def _bounded(self, interval: tuple[float, float], count: int) -> None:
        self._lower.append(np.full(count, interval[0]))
        self._upper.append(np.full(count, interval[1]))

    def _integrands(self) -> Any:
        levels = [t.expression for t in self.problem.traced if isinstance(t.constraint, Isoperimetric)]
        sign = self.problem.sign
        return ca.densify(ca.vertcat(sign * self.problem.integrand, *levels))

    def _columns(self, count: int) -> list[Any]:
        numbers = self.problem.parameter_values
        return [np.zeros((0, count)), np.tile(numbers[:, None], (1, count)), np.zeros((0, count))]

    def _totals(self, y: Any, share: Any, slopes: list[Any], width: float) -> Any:
        """The functional and the levels: the integrand for both slopes along the polygon, by their shares."""
        mapped, columns = self._values.map(self.pieces), self._columns(self.pieces)
        nodes, weights = gauss(PIECE_POINTS)
        total: Any = 0
        for node, weight in zip(0.5 * (1 + nodes), 0.5 * weights * width, strict=True):
            x, at = (self.x[:-1] + node * width)[None], (y[:-1] * (1 - node) + y[1:] * node).T
            for part, slope in ((share, slopes[0]), (1 - share, slopes[1])):
                total = total + weight * ca.mtimes(mapped(x, at, slope.T, *columns), part)
        return total

    def _add_bounds(self, rows: list[Any], y: Any, slopes: list[Any]) -> None:
        """Every bound, in the middle of each piece, for both slopes."""
        for t in self.problem.traced:
            if isinstance(t.constraint, Bound):
                function = ca.Function("bound", self.problem.symbols.all, [ca.densify(t.expression)]).map(self.pieces)
                x, at = 0.5 * (self.x[1:] + self.x[:-1])[None], 0.5 * (y[1:] + y[:-1]).T
                for slope in slopes:
                    rows.append(function(x, at, slope.T, *self._columns(self.pieces)).T)
                    self._bounded(t.constraint.interval, self.pieces)

    def starts(self) -> Iterator[np.ndarray]:
        """Starts on the chord: between the slopes of L's convex envelope in its middle, and on either side of it."""
        chord = np.diff(self.line) / (float(self.x[1] - self.x[0]) * self.steep)
        if (touched := self._touched(float(chord.mean()))) is not None:
            low, high = touched
            share = np.clip((high - chord) / (high - low), 0.0, 1.0)
            yield self._start(share, np.full(self.pieces, low), np.full(self.pieces, high))
        for spread in SPREADS:
            yield self._start(np.full(self.pieces, 0.5), chord - spread, chord + spread)

    def _start(self, share: np.ndarray, steep: np.ndarray, shallow: np.ndarray) -> np.ndarray:
        return np.concatenate([self.line[self.free] / self.height, share, steep, shallow])

    def _touched(self, slope: float) -> tuple[float, float] | None:
        """The slopes, in units of their own, at which the chord below L about one touches it; None: L itself does."""
        middle = self.pieces // 2
        tried = np.unique(np.concatenate([TRIED_SLOPES, slope + TRIED_SLOPES]))
        x, y = np.full(len(tried), self.x[middle]), np.full((1, len(tried)), self.line[middle])
        values = np.asarray(self._values(x[None], y, self.steep * tried[None], *self._columns(len(tried))))[0]
        tried, values = tried[np.isfinite(values)], values[np.isfinite(values)]
        hull: list[int] = []
        for k in range(len(tried)):  # Andrew's monotone chain
            while len(hull) > 1 and not _turns_up(tried, values, hull[-2], hull[-1], k):
                hull.pop()
            hull.append(k)
        right = int(np.searchsorted(tried[hull], slope, side="right"))
        if right in (0, len(hull)) or hull[right] - hull[right - 1] == 1:
            return None
        return float(tried[hull[right - 1]]), float(tried[hull[right]])

    def solved(self, guess: np.ndarray) -> Relaxed | None:
        """A minimum from a start."""
        count, start = self.pieces, self.line[self.free]
        size = abs(float(ca.Function("J", [self._w], [self._objective])(ca.DM(guess))))
        if not np.isfinite(size):
            return None
        options = {
            "print_time": False, "show_eval_warnings": False, "no_nlp_grad": True,
            "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": IPOPT_ITERATIONS,
                      "bound_relax_factor": 0.0, "mu_strategy": "adaptive"},
        }  # fmt: skip
        nlp = {"x": self._w, "f": self._objective / (size or 1.0), "g": self._rows}
        solver = ca.nlpsol("relaxed", "ipopt", nlp, options)
        room = np.full(len(guess), np.inf)
        low, high = -room, room.copy()
        low[len(start) : len(start) + count], high[len(start) : len(start) + count] = 0.0, 1.0
        levels = {"lbg": np.concatenate(self._lower), "ubg": np.concatenate(self._upper)}
        result = solver(x0=guess, lbx=low, ubx=high, **levels)
        if solver.stats()["return_status"] not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
            return None
        return self._read(np.asarray(result["x"]).ravel(), float(result["f"]) * (size or 1.0))

    def _read(self, w: np.ndarray, value: float) -> Relaxed:
        inner = int(self.free.sum())
        y = self.line.copy()
        y[self.free] = w[:inner] * self.height
        share, one, other = w[inner:].reshape(3, self.pieces)
        sign = self.problem.sign
        return Relaxed(sign * value, self.x, y, np.array([one, other]) * self.steep, np.array([share, 1 - share]))


def _turns_up(x: np.ndarray, y: np.ndarray, first: int, middle: int, last: int) -> bool:
    """Whether the polygon through three points of a graph is convex."""
    return bool((y[middle] - y[first]) * (x[last] - x[middle]) < (y[last] - y[middle]) * (x[middle] - x[first]))
