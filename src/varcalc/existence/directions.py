"""Departures from a known curve, and what their functional adds at a place."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.formulation.height import breadths
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.conditions import Bound, Isoperimetric, Through
from varcalc.problem.end_cost import costs_of_ends
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve
from varcalc.solution import Solution
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import Interval

SIZED_PLACES = 65
"""Places of the curve by which its size is told."""
ON_BOUND = 1e-7
"""How far beyond a bound, in units of its own size or 1, a curve may lie that rests on it."""
SHAPE_PLACES, SHAPE_SLOPES = (0.21, 0.5, 0.83), np.sinh(np.linspace(-5.0, 5.0, 15))
"""Where on the way, and at what slopes in units of the curve's, it is asked how functions bend in the slope."""
BEND_ALIKE, BENDS_ROUNDED = 1 - 1e-6, 1e-12
"""Cosine from which on two functions bend alike; what round-off makes of none, in units of their values."""
SLACK = 1e-10
"""Multiplier of a level that does not hold the curve."""
Rows = Sequence[np.ndarray | None]
"""One array a function, all of which broadcast."""


class Departures:
    """Curves over ``span`` that depart from a known one, and what their functional adds at a place.

    A level is replaced by its one of the ``multipliers``, so that what is lower need not keep it. At second order they
    bend as the known curve does. Beyond a bound nothing is admitted. The landscape is one of its breadths wide: the
    first, unless it is told; none for a Curve, which has a size of its own.
    """

    def __init__(
        self, problem: Functional, curve: CurveOrSlope, span: tuple[float, float],
        multipliers: Sequence[Any], unknowns: Sequence[float], breadth: float | None = None,
    ) -> None:  # fmt: skip
        self.problem, self.curve, self.sign, self.span = problem, curve, problem.sign, span
        self.closed = bool(problem.start.periodic)
        self._breadth = breadth
        levels = any(isinstance(c, Isoperimetric) for c in problem.constraints)
        # a level is one that these curves do not keep, and bending costs something
        self.approximate = levels or problem.order > 1
        self.waypoints = tuple(c.x for c in problem.constraints if isinstance(c, Through))
        self._multipliers = [
            m if isinstance(c, Isoperimetric) else 0.0
            for c, m in zip(problem.constraints, multipliers, strict=False)
            if isinstance(c, Isoperimetric | Bound)
        ]
        self.numbers = problem.parameter_values.tolist(), list(unknowns)
        self._known: dict[bytes, list[np.ndarray]] = {}

    @classmethod
    def of(cls, solution: Solution, curve: CurveOrSlope | None = None, breadth: float | None = None) -> Departures:
        """Those from the curve of a solution, or from one beside it."""
        known = curve or solution.curve
        assert known is not None
        unknowns = list(solution.unknowns.values())
        return cls(solution.problem, known, solution.interval, solution.multipliers, unknowns, breadth)

    @cached_property
    def _rows(self) -> np.ndarray:
        """The curve (n, m) at places that show its size."""
        return self.curve(np.linspace(*self.span, SIZED_PLACES), 0)

    @cached_property
    def sizes(self) -> np.ndarray:
        """The size (n,) of each of its functions, one for all coordinates of a Curve."""
        extents = np.ptp(self._rows, axis=1)
        found = np.where(extents > 0, extents, np.abs(self._rows).max(axis=1))
        if isinstance(self.problem, Curve):
            return np.full(self.problem.n, found.max() or 1.0)
        return np.where(found > 0, found, self.breadth)

    @property
    def breadth(self) -> float:
        """How broad the landscape is."""
        return self._breadth if self._breadth is not None else breadths(formulate(self.problem))[0]

    @property
    def units(self) -> np.ndarray:
        """The larger (n,) of their sizes and how broad the landscape is."""
        return np.maximum(self.sizes, self.breadth)

    def free(self, side: int) -> list[int]:
        """The functions that are free at the start (0) or the end (1), by their numbers."""
        end = self.problem.end if side else self.problem.start
        return np.flatnonzero(np.isnan(end.values(self.problem.n))).tolist()

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors that span the departures: along a Curve between two places those across the way are all."""
        axes = np.eye(self.problem.n)
        way = self._rows[:, -1] - self._rows[:, 0]
        if not isinstance(self.problem, Curve) or self.problem.n == 1 or not way.any():
            return axes
        return np.linalg.svd(way[None] / np.abs(way).max())[2][1:]

    def held(self, functions: np.ndarray) -> tuple[bool, bool]:
        """Which ends let no curve depart in any of the ``functions``, a mask (n,)."""
        problem = self.problem
        ends = ((end.slides, end.values(problem.n)[functions]) for end in (problem.start, problem.end))
        start, end = (not self.closed and bool(slides or np.isfinite(values).any()) for slides, values in ends)
        return start, end

    def given_slopes(self, functions: np.ndarray) -> tuple[bool, bool]:
        """At which ends the slope of any of the ``functions``, a mask (n,), is given."""
        ends = (self.problem.start, self.problem.end)
        start, end = (bool(np.isfinite(end.slopes(self.problem.n)[functions]).any()) for end in ends)
        return start, end

    def own(self, x: np.ndarray) -> list[np.ndarray]:
        """The curve and its derivatives at x, each (n, *x.shape)."""
        key = x.tobytes()
        if key not in self._known:
            with np.errstate(all="ignore"):
                self._known[key] = [self.curve(x.ravel(), k) for k in range(self.problem.order + 1)]
        return [rows.reshape(len(rows), *x.shape) for rows in self._known[key]]  # there may be no places

    def values(self, x: np.ndarray, away: Rows, rates: Rows, turns: Rows | None = None) -> np.ndarray:
        """L with its levels by their multipliers, as it is minimised; infinite beyond a bound.

        Of a function that does not depart ``away`` and ``rates`` are None. Without ``turns``, the second derivatives
        of what departs, all bend as the known curve does.
        """
        with np.errstate(all="ignore"):  # far out there is what overflows
            return self.least([(v, v) for v in self._columns(x, away, rates, turns)])

    def known(self, x: np.ndarray, away: Rows, rates: Rows) -> np.ndarray:
        """Where (m,) L and what is bounded or levelled are numbers, beyond bounds as well."""
        with np.errstate(all="ignore"):
            return np.all([np.isfinite(np.broadcast_to(v, x.shape)) for v in self._columns(x, away, rates)], axis=0)

    def _columns(self, x: np.ndarray, away: Rows, rates: Rows, turns: Rows | None = None) -> list[np.ndarray]:
        """L and what is bounded or levelled, as they are stated."""
        own, slopes, *bends = self.own(x)
        place = [c if y is None else c + y for c, y in zip(own, away, strict=True)]
        turned = [c if v is None else c + v for c, v in zip(slopes, rates, strict=True)]
        bent = [row for rows in bends for row in rows]
        if turns is not None:
            bent = [c if a is None else c + a for c, a in zip(bent, turns, strict=True)]
        return stated_at_points(self.problem).columns(x, place, turned, bent, *self.numbers)

    def least_at(self, x: np.ndarray, *rows: Sequence[np.ndarray]) -> np.ndarray:
        """What ``values`` are, of curves with these ordinates, slopes and second derivatives."""
        with np.errstate(all="ignore"):
            return self.least([(v, v) for v in stated_at_points(self.problem).columns(x, *rows, *self.numbers)])

    @property
    def levels(self) -> list[Isoperimetric]:
        """What is levelled, one after the other."""
        return list(self.problem.of_type(Isoperimetric))

    def mixed_by_level(self, number: int) -> bool:
        """Whether slopes of one function that alternate may be lower beside one level, by its number.

        Where L and what is levelled bend alike in the slope, their sum with any multiplier is convex or concave in it,
        and no two slopes come lower than one.
        """
        if self.problem.n > 1:
            return False
        x = np.quantile(self.span, SHAPE_PLACES)[:, None]
        own, slopes = (np.abs(self.curve(x.ravel(), k)).max() for k in (0, 1))
        size = float(max(slopes, own / (self.span[1] - self.span[0]))) or 1.0
        with np.errstate(all="ignore"):  # at some slopes there is no number
            parts = self.beside_level(number, x, [np.zeros_like(x)], [size * SHAPE_SLOPES])
            rows = np.stack(np.broadcast_arrays(*parts))
            bends = np.nan_to_num(np.diff(np.diff(rows) / np.diff(SHAPE_SLOPES)), posinf=0.0, neginf=0.0)
        sizes = np.linalg.norm(bends, axis=-1)  # (2, places)
        rounded = BENDS_ROUNDED * np.abs(np.nan_to_num(rows, posinf=0.0, neginf=0.0)).max(-1)
        alike = np.abs((bends[0] * bends[1]).sum(-1)) >= BEND_ALIKE * sizes[0] * sizes[1]
        return bool((~alike & (sizes > rounded).all(0)).any())

    def beside_level(self, number: int, x: np.ndarray, away: Rows, rates: Rows) -> tuple[np.ndarray, np.ndarray]:
        """What ``values`` are without one level, by its number, and what is levelled by it."""
        kept = [c for c in self.problem.constraints if isinstance(c, Isoperimetric | Bound)]
        index = next(k for k, c in enumerate(kept) if c is self.levels[number])
        columns = self._columns(x, away, rates)
        values, levelled = self.least([(v, v) for v in columns]), columns[1 + index]
        return values + self.sign * self._multipliers[index] * levelled, levelled

    def free_of_levels(self, x: np.ndarray, weights: np.ndarray, away: Rows, rates: Rows) -> bool:
        """Whether the values of curves that depart so are their own: no level holds the known curve, and all are kept.

        They are known at x (m,) with the ``weights`` of a rule.
        """
        if self.problem.order > 1 or any(abs(m) > SLACK for m in self._multipliers):
            return False
        kept = [c for c in self.problem.constraints if isinstance(c, Isoperimetric | Bound)]
        for constraint, value in zip(kept, self._columns(x, away, rates)[1:], strict=True):
            low, high = constraint.interval
            if isinstance(constraint, Isoperimetric) and not low <= np.broadcast_to(value, x.shape) @ weights <= high:
                return False
        return True

    def least(self, enclosed: Sequence[Interval]) -> np.ndarray:
        """The least of L with its levels by their multipliers, as it is minimised; infinite beyond a bound.

        What it is made of, as :func:`stated` gives it, is ``enclosed``.
        """
        total, *others = ((low, high) if self.sign > 0 else (-high, -low) for low, high in enclosed)
        found = total[0]
        kept = [c for c in self.problem.constraints if isinstance(c, Isoperimetric | Bound)]
        for constraint, multiplier, (low, high) in zip(kept, self._multipliers, others, strict=True):
            if isinstance(constraint, Isoperimetric):
                found = found - multiplier * (high if multiplier > 0 else low)
                continue
            room = [ON_BOUND * max(1.0, abs(b)) for b in constraint.interval]
            first, last = constraint.interval[0] - room[0], constraint.interval[1] + room[1]
            first, last = (first, last) if self.sign > 0 else (-last, -first)
            found = np.where((high >= first) & (low <= last), found, np.inf)
        return found

    def at_end(self, side: int, away: np.ndarray) -> np.ndarray:
        """The cost (m,) of the ends that depart by ``away`` (m, n) from the known one; of the start, what that adds."""
        if self.problem.end_cost is None:
            return np.zeros(len(away))
        x = np.array(self.span)
        ends = [np.repeat(own[:, None], 1 + len(away), axis=1) for own in self.curve(x, 0).T]
        ends[side][:, 1:] += away.T
        found = costs_of_ends(self.problem, (x[:1], ends[0]), (x[1:], ends[1]), np.array(self.numbers[1])[None])
        return found[1:] if side else found[1:] - found[0]


def polygonal(x: np.ndarray, y: np.ndarray) -> CurveOrSlope:
    """The polygon with vertices x (m,) and y (n, m), and its slopes."""
    slopes = np.diff(y) / np.diff(x)

    def curve(at: np.ndarray, derivative: int) -> np.ndarray:
        """The ordinates, or the slopes, at (m,) places: (n, m)."""
        if derivative == 0:
            return np.array([np.interp(at, x, row) for row in y])
        return slopes[:, np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)]

    return curve


@derived
def stated(problem: Functional) -> ca.Function:
    """L and what is bounded or levelled."""
    told = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric | Bound)]
    return ca.Function("L", problem.symbols.all, [problem.integrand, *told])


@derived
def stated_at_points(problem: Functional) -> PointEvaluator:
    """The same at points, or of columns where NumPy has a form of it."""
    return PointEvaluator(stated(problem))
