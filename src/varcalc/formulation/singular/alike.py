"""Whether a problem at other parameter values, its ends among them, has the form that it has at its own.

Which form is tried first follows from what the Lagrangian does at the ends.
All of that is measured again here, in one function of the values. Where a
measurement comes out differently, or nearly so, the answer is no: then the
forms of that value have to be found for themselves.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.curve import positive_along
from varcalc.formulation.singular.detection import (
    A_FRACTION,
    ACROSS,
    ASLANT,
    FIT,
    POWERS,
    PROBE,
    PROBED_SLOPES,
    QUADRATIC,
    RING,
    SHARE_LEFT,
    STEP_ASIDE,
    SURVEY,
    Blowup,
    end_points,
    rational,
)
from varcalc.problem.conditions import parameters_of
from varcalc.problem.functional import Functional
from varcalc.problem.problem import NUDGE, Curve, Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

AROUND = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Steps to an end and to either side of it along the axes."""
SAME_NORMAL = 1e-6
"""Difference of two unit normals that is none."""
PARALLEL = 1e-4
"""By how much normals around an end may differ where a line goes through it."""
LARGEST = float(np.finfo(float).max)
WRITTEN_OUT = 3
"""Functions up to which L is written out for every point at which it is measured: a third of the time, to be built."""


def ends_at(problem: Functional, values: np.ndarray) -> np.ndarray:
    """The ends of ``problem`` at ``values`` (K, m) of its parameters: (K, 2, coordinates), NaN where free."""
    own, moved = _own_ends(problem)
    points = np.repeat(own, len(values), axis=0)
    for end, parameter, place in moved:
        points[:, end, place] = values[:, parameter]
    return points


@derived
def _own_ends(problem: Functional) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    return np.array(end_points(problem))[None], _moved(problem)


def _moved(problem: Functional) -> list[tuple[int, int, int]]:
    """Coordinates of the ends that are parameters: number of the end, of the parameter, of the coordinate."""
    names, first = list(problem.parameters), 1 if isinstance(problem, Problem) else 0
    return [
        (end, names.index(name), 0 if field == "x" else first + component)
        for end, template in enumerate(problem.templates)
        for name, field, component in parameters_of(template)
    ]


def energetic_at(problem: Curve, values: np.ndarray) -> np.ndarray:
    """At which ``values`` (K, m) a Curve is solved by its energy in its own coordinates; (K,) of bool.

    F must be positive wherever it was measured (:func:`varcalc.formulation.curve.positive_along`), finite at both
    ends, and not fall steeply from either.
    """
    with np.errstate(all="ignore"):
        points = ends_at(problem, values)
        known = ~np.isnan(points)
        points = np.where(known, points, np.nan_to_num(points[:, ::-1]))
        chord = points[:, 1] - points[:, 0]
        size = np.abs(np.where(known.all(1), chord, 0.0)).max(1)
        places, directions = positive_along(points, chord)
        sign = problem.sign
        across = sign * _many(problem, places, directions, values)
        found = ~(np.isfinite(across) & (across <= 0)).any(1) & np.isfinite(across).any(1) & (size > 0)
        slopes = np.ones((len(PROBED_SLOPES), problem.n))
        slopes[:, 1:] = PROBED_SLOPES[:, None]
        here = _many(problem, np.repeat(points, len(slopes), axis=1), np.tile(slopes, (2, 1)), values)
        found &= np.isfinite(here).all(1)
        if problem.n == 2:
            around = points[:, :, None] + STEP_ASIDE * size[:, None, None, None] * AROUND
            near = np.abs(_many(problem, around.reshape(len(values), -1, 2), slopes[1:2], values))
            near = near.reshape(len(values), 2, -1)
            least = np.where(np.isnan(near), np.inf, near).min(2)
            found &= ~(least < SHARE_LEFT * near[:, :, 0]).any(1)
    return found


def _many(problem: Curve, points: np.ndarray, directions: np.ndarray, values: np.ndarray) -> np.ndarray:
    """F at points (K, M, n) in directions that broadcast to them, for ``values`` (K, m); shape (K, M)."""
    count, places, n = points.shape
    along = np.broadcast_to(directions, points.shape).reshape(-1, n)
    found = problem.integrand_values(points.reshape(-1, n).T, along.T, np.repeat(values, places, axis=0))
    return found.reshape(count, places)


def alike(problem: Problem, values: np.ndarray, lines: dict[bool, Blowup], conformal: bool) -> np.ndarray:
    """At which ``values`` (K, m) the first form of a problem is the one that it has at its own values; (K,) of bool.

    ``lines`` are the singular lines through its ends, at the start (True) and the end, ``conformal`` tells the kind
    of its metric where there are any.
    """
    kept = _measurements(problem)
    line_keys = ((at_start, x.origin.tobytes(), x.normal.tobytes(), x.power) for at_start, x in lines.items())
    key = (*line_keys, conformal)
    if key not in kept:
        kept[key] = PointEvaluator(_Measurement(problem, lines, conformal).function())
    ends = ends_at(problem, values).reshape(len(values), -1)
    return kept[key](len(values), ends, values)[:, 0] == 1.0


@derived
def _measurements(problem: Problem) -> dict[tuple[Any, ...], PointEvaluator]:
    """What has been measured of a problem by its singular lines and its metric."""
    return {}


class _Measurement:
    """What is measured of L at the ends of a problem, stated in symbols: the ``points`` and the parameters.

    Which coordinates are free is the same for all values, and they are NaN; ``known`` (2, 1 + n) tells the others.
    """

    def __init__(self, problem: Problem, lines: dict[bool, Blowup], conformal: bool) -> None:
        self.problem, self.lines, self.conformal = problem, lines, conformal
        self.n = problem.n
        self.kind = problem.symbols.kind if self.n <= WRITTEN_OUT else ca.MX
        self.known: np.ndarray = np.logical_not(np.isnan(np.array(end_points(problem))))
        self.flat = self.kind.sym("ends", 2 * (1 + self.n))
        self.parameters = self.kind.sym("parameters", len(problem.parameters))
        self.points = ca.reshape(self.flat, 1 + self.n, 2)
        apart = [ca.fabs(self.points[k, 1] - self.points[k, 0]) for k in np.flatnonzero(self.known.all(0)).tolist()]
        self.extent = reduce(ca.fmax, apart, self.kind(0))
        s = problem.symbols
        rows = ca.vertcat(problem.integrand, ca.gradient(problem.integrand, ca.vertcat(s.x, s.y)))
        self.gradient = ca.Function("metric", s.all, [ca.densify(rows)])
        self.lagrangian = ca.Function("L", s.all, [problem.integrand])

    def function(self) -> ca.Function:
        """1 where everything is as it is at the problem's own values, of (ends, parameters)."""
        whole = np.asarray(self.known.all(1))
        found = [self.points[0, 1] > self.points[0, 0]]
        for end, at_start in enumerate((True, False)):
            if whole[end]:
                found += [self._inside(end), self._infinite(end) == float(at_start in self.lines)]
                found += [ca.logic_not(self._steep(end))] if self.n == 1 else []
            elif at_start in self.lines:
                found.append(self.kind(0))
            if at_start in self.lines:
                found += self._line(end, self.lines[at_start])
        if self.lines:
            found += self._metric()
        return ca.Function("alike", [self.flat, self.parameters], [reduce(ca.logic_and, found)])

    def _evaluated(self, function: ca.Function, x: Any, y: Any, slopes: Any) -> Expression:
        """A function of the problem's symbols at points, one a column; slopes of one component are those of all."""
        count = x.shape[1]
        slopes = self.kind(slopes)
        slopes = slopes if slopes.shape[0] == self.n else ca.repmat(slopes, self.n, 1)
        numbers = [self.parameters, self.kind(self.problem.unknown_guesses)]
        return function.map(count)(x, y, slopes, self.kind(0, count), *(ca.repmat(v, 1, count) for v in numbers))

    def _around(self, end: int, step: Expression, offsets: np.ndarray) -> tuple[Expression, Expression]:
        """Abscissae and ordinates at ``offsets`` (1 + n, m) from an end, in units of ``step``."""
        points = ca.repmat(self.points[:, end], 1, offsets.shape[1]) + step * self.kind(ca.DM(offsets))
        return points[0, :], points[1:, :]

    def _inside(self, end: int) -> Expression:
        """Whether L is a number at an end, however it is approached."""
        n = self.n
        size = reduce(ca.fmax, [ca.fabs(self.points[1 + k, end]) for k in range(n)], self.kind(1))
        offsets = np.vstack([np.zeros(1 + 2 * n), np.hstack([np.zeros((n, 1)), np.eye(n), -np.eye(n)])])
        rise = self.points[1:, 1] - self.points[1:, 0]
        rise = ca.vertcat(*(rise[k] if self.known[:, 1 + k].all() else self.kind(0) for k in range(n)))
        slope = rise / (self.points[0, 1] - self.points[0, 0])
        values = self._evaluated(
            self.lagrangian, *self._around(end, NUDGE * size, offsets), ca.repmat(slope, 1, 1 + 2 * n)
        )
        return _any(ca.logic_or(values <= 0, values > 0))

    def _infinite(self, end: int) -> Expression:
        """Whether L is infinite or no number at an end, for any slope tried."""
        place = self._around(end, self.kind(0), np.zeros((1 + self.n, len(PROBED_SLOPES))))
        return ca.logic_not(_all(_finite(self._evaluated(self.lagrangian, *place, ca.DM(PROBED_SLOPES).T))))

    def _steep(self, end: int) -> Expression:
        """Whether L falls so steeply from an end that it may be infinite just beyond, of one function."""
        offsets = np.array([[0.0, 1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, -1.0]])
        place = self._around(end, STEP_ASIDE * self.extent, offsets)
        values = ca.fabs(self._evaluated(self.lagrangian, *place, ca.DM(np.full((1, 5), PROBED_SLOPES[1]))))
        here = values[0]
        return ca.logic_and(_finite(here), _any(values < SHARE_LEFT * here))

    def _line(self, end: int, line: Blowup) -> list[Expression]:
        """Whether L falls from an end as from the known line through it."""
        ring = RING.shape[1]
        offsets = np.hstack([PROBE[0] * RING, np.outer(line.normal, PROBE)])
        x, y = self._around(end, self.extent, offsets)
        rows = [self._evaluated(self.gradient, x, y, ca.DM(np.full((1, ring + 2), v))) for v in ASLANT]
        one, other = rows
        values = one[0, :] ** 2 + other[0, :] ** 2
        slopes = 2 * (ca.repmat(one[0, :], 2, 1) * one[1:, :] + ca.repmat(other[0, :], 2, 1) * other[1:, :])
        slopes = slopes / ca.repmat(values, 2, 1)
        far, near = values[ring], values[ring + 1]
        values, slopes = values[:ring], slopes[:, :ring]
        length = ca.sqrt(ca.sum1(slopes**2))
        usable = ca.logic_and(ca.logic_and(_finite(values), values > 0), ca.logic_and(_finite(length), length > 0))
        normals = -slopes / ca.repmat(length, 2, 1)
        along = ca.fabs(ca.mtimes(ca.DM(line.normal).T, normals)) >= 1 - PARALLEL
        first = ca.logic_and(usable, ca.cumsum(usable.T).T == 1)
        turned = ca.fabs(normals - ca.repmat(ca.DM(line.normal), 1, ring)) > SAME_NORMAL
        power = 0.5 * ca.log(near / far) / np.log(PROBE[0] / PROBE[1])
        # a power that is no fraction was measured, and may be another one there
        a_fraction = float(rational(line.power + A_FRACTION / 2) == line.power)
        return [
            _any(usable), _all(ca.logic_or(along, ca.logic_not(usable))),
            ca.logic_not(_any(ca.logic_and(ca.repmat(first, 2, 1), turned))),
            ca.fabs(power - line.power) < A_FRACTION, self.kind(a_fraction),
            _all(self.points[:, end] == ca.DM(line.origin)),
        ]  # fmt: skip

    def _metric(self) -> list[Expression]:
        """Whether L^2 is quadratic in the slope, and conformal or not, and L of one sign across the problem."""
        start, end = (ca.vertcat(*(self.points[k, e if self.known[e, k] else 1 - e] for k in range(2))) for e in (0, 1))
        points = ca.repmat(start, 1, SURVEY.shape[1]) + ca.mtimes(end - start, ca.DM(SURVEY[0]).T)
        y = points[1, :] + self.extent * ca.DM(SURVEY[1]).T
        values = self._evaluated(self.lagrangian, points[0, :], y, ca.DM(SURVEY[2]).T)
        values = -values if self.problem.maximise else values
        fans, slopes = (SURVEY.shape[1] - len(ACROSS)) // len(PROBED_SLOPES), len(PROBED_SLOPES)
        across, sampled = values[fans * slopes :], ca.reshape(values[: fans * slopes], slopes, fans)
        usable = ca.sum1(ca.logic_and(_finite(sampled), sampled > 0)) == slopes
        squares = ca.if_else(ca.repmat(usable, slopes, 1), sampled**2, 1)
        largest = reduce(ca.fmax, [squares[k, :] for k in range(slopes)])
        fit = ca.mtimes(ca.DM(FIT), squares)
        off = ca.fabs(ca.mtimes(ca.DM(POWERS), fit) - squares) > QUADRATIC * ca.repmat(largest, slopes, 1)
        skew = ca.fabs(fit[1, :]) + ca.fabs(fit[2, :] - fit[0, :]) > QUADRATIC * ca.fabs(fit[0, :])
        return [
            ca.logic_not(_any(ca.logic_and(_finite(across), across <= 0))), _any(_finite(across)),
            ca.sum2(usable) >= 2, ca.logic_not(_any(ca.logic_and(off, ca.repmat(usable, slopes, 1)))),
            _any(ca.logic_and(skew, usable)) != float(self.conformal),
        ]  # fmt: skip


def _finite(values: Expression) -> Expression:
    return ca.fabs(values) <= LARGEST


def _any(flags: Expression) -> Expression:
    return ca.sum1(ca.vec(flags)) > 0


def _all(flags: Expression) -> Expression:
    return ca.sum1(ca.vec(flags)) == flags.numel()
