"""Whether the known curve with its free ends elsewhere is lower: what ends cost may be low in a narrow place.

The known curve is bent evenly toward other ends. What these cost is enclosed between them, so that no well of the cost
is too narrow to be seen; what the way adds is told at points.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product

import casadi as ca
import numpy as np

from varcalc.existence.directions import Departures
from varcalc.existence.polygons import Valley
from varcalc.existence.together import AlongAxes
from varcalc.numerics.branch_and_bound import boxes_about, least_points
from varcalc.problem.conditions import Through
from varcalc.problem.end_cost import end_cost
from varcalc.solution import Solution
from varcalc.symbolic.intervals import Interval, enclosures
from varcalc.symbolic.variation import SWITCHED, VARYING, Rules, gentle

MOST_FREE = 3
"""Coordinates of both ends that may be free."""
PIECES_OF_WAY = 10
"""Pieces of the way along which L is summed."""
SHELLS = np.array([0.25, 1.0, 4.0, 16.0, 64.0, 1024.0])
"""Departures between which the first boxes lie, either way, in units of the larger of the curve's size and interval."""
HIDES_WELLS: Rules = {**VARYING, **SWITCHED}
"""Operations of which a narrow well of what ends cost may come."""
SECOND_STEP = 1e-4
"""Departure, in units of the curve's size, by which second derivatives are taken."""
LOWER_ENDS, SHARE_TOLD = 1e-3, 1e-6
"""How much lower, relative to what is summed, another curve has to be, and how nearly the lowest one is told: to that,
or to a share of how much lower it is."""


class CheaperEnds:
    """The known curve, and the least of those that are bent toward other ends, as polygons of departures."""

    def __init__(self, departures: Departures, cost: ca.Function) -> None:
        self.landscape = AlongAxes(departures, np.eye(departures.problem.n))
        self._numbers, self._ends_cost = departures.numbers, cost
        self._second_order = departures.problem.order > 1
        self._x = np.linspace(*departures.span, PIECES_OF_WAY + 1)
        self._known = departures.curve(np.array(departures.span), 0).T
        self._free = [(side, i) for side in (0, 1) for i in departures.free(side)]
        self._units = np.array([[departures.units[i]] for _, i in self._free])
        self._sizes = departures.sizes
        own = self.landscape.values(0.5 * (self._x[1:] + self._x[:-1]), *np.zeros((2, PIECES_OF_WAY, len(self._sizes))))
        self.summed = float(np.abs(own) @ np.diff(self._x))
        self.own_value = float(self._value(np.zeros((len(self._free), 1)))[0])

    def distinct(self) -> list[Valley]:
        """The least of the bent curves where it is lower."""
        low, high = boxes_about(np.concatenate([-SHELLS[::-1], [0.0], SHELLS]), len(self._free))
        low, high, near = self._units * low, self._units * high, LOWER_ENDS * self.summed
        enough = np.array([self.own_value - near])
        ends, least = least_points(
            low, high, np.zeros(low.shape[1], dtype=int), lambda at, _: self._value(at),
            lambda low, high, _: self._bound(low, high), enough, near, SHARE_TOLD,
        )  # fmt: skip
        if np.isnan(ends).any():
            return []
        return [Valley(self._x, polygon, float(least[0]), False) for polygon in self._bent(ends)[-1]]

    def _bent(self, ends: np.ndarray) -> np.ndarray:
        """The departures (s, m, K + 1, n) along the ways of each shape to ``ends`` (f, m)."""
        return np.einsum("fm,sfkn->smkn", ends, self._shapes)

    @cached_property
    def _shapes(self) -> np.ndarray:
        """The shapes (s, f, K + 1, n) of ways on which one free coordinate departs by 1: even ones, and the least ones.

        The least ones are those of the second variation, where it has a minimum.
        """
        share, n = (self._x - self._x[0]) / (self._x[-1] - self._x[0]), self._known.shape[1]
        if self._second_order:  # the slopes of the ends are kept
            share = share**2 * (3 - 2 * share)
        even = np.zeros((len(self._free), len(share), n))
        for shape, (side, i) in zip(even, self._free, strict=True):
            shape[:, i] = share if side else 1 - share
        second = self._second_variation()
        inner, outer = np.arange(n, len(second) - n), np.r_[0:n, len(second) - n : len(second)]
        stiff = second[np.ix_(inner, inner)]
        if not np.isfinite(second).all() or np.linalg.eigvalsh(stiff)[0] <= 0:
            return even[None]
        least = even.reshape(len(even), -1).copy()
        least[:, inner] = -np.linalg.solve(stiff, second[np.ix_(inner, outer)] @ least[:, outer].T).T
        return np.array([even, least.reshape(even.shape)])

    def _second_variation(self) -> np.ndarray:
        """The second derivatives, by differences, of what a polygon sums in its vertices, ((K + 1) n, (K + 1) n)."""
        n, h = self._known.shape[1], np.diff(self._x)
        steps = SECOND_STEP * np.concatenate([self._sizes, self._sizes / (self._x[-1] - self._x[0])])
        single = np.diag(steps)
        pairs = np.array([p * single[:, None] + q * single for p in (1, -1) for q in (1, -1)])[..., None, :]
        x = 0.5 * (self._x[1:] + self._x[:-1])
        values = self.landscape.values(x, pairs[..., :n], pairs[..., n:]).T  # (K, 2n, 2n, 4)
        second = values @ np.array([1.0, -1.0, -1.0, 1.0]) / (4 * np.outer(steps, steps))
        total = np.zeros((len(self._x) * n,) * 2)
        for k, (own, step) in enumerate(zip(second, h, strict=True)):
            to_piece = np.vstack([np.hstack([np.eye(n) / 2] * 2), np.hstack([-np.eye(n), np.eye(n)]) / step])
            total[k * n : (k + 2) * n, k * n : (k + 2) * n] += step * to_piece.T @ own @ to_piece
        return total

    def _way(self, ends: np.ndarray) -> np.ndarray:
        """What the cheaper way to each of ``ends`` (f, m) adds, (m,)."""
        away, h = self._bent(ends), np.diff(self._x)
        x = 0.5 * (self._x[1:] + self._x[:-1])
        values = self.landscape.values(
            x, 0.5 * (away[..., 1:, :] + away[..., :-1, :]), np.diff(away, axis=-2) / h[:, None]
        )
        return (np.where(np.isfinite(values), values, np.inf) @ h).min(0)

    def _value(self, ends: np.ndarray) -> np.ndarray:
        """The functional (m,) of the curves to ``ends`` (f, m)."""
        return self._way(ends) + self._cost(ends, ends)

    def _bound(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The least that ends between ``low`` (f, m) and ``high`` cost, with what the way to some of them adds."""
        corners = (np.where(np.array(upper)[:, None], high, low) for upper in product((0, 1), repeat=len(low)))
        return np.min([self._way(at) for at in (0.5 * (low + high), *corners)], axis=0) + self._cost(low, high)

    def _cost(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The least that ends (m,) cost whose free coordinates depart from ``low`` (f, m) to ``high``."""
        place: list[list[Interval]] = [[(value, value) for value in end] for end in self._known]
        for (side, i), *by in zip(self._free, low, high, strict=True):
            place[side][i] = (self._known[side, i] + by[0], self._known[side, i] + by[1])
        first, last = ([(np.array(x), np.array(x))] for x in (self._x[0], self._x[-1]))
        numbers = [[(np.array(v), np.array(v)) for v in row] for row in self._numbers]
        ((cost,),) = enclosures(self._ends_cost, [first, place[0], last, place[1], *numbers])
        return np.broadcast_to(cost[0] if self.landscape.sign > 0 else -cost[1], low.shape[1:])


def cheaper_ends(solution: Solution) -> CheaperEnds | None:
    """The curves with other ends, where narrow wells of what they cost may have been missed; None where there are none.

    Problems are looked at whose ends do not slide, without waypoints.
    """
    problem = solution.problem
    fixed = any(problem.slides) or problem.start.periodic or any(problem.of_type(Through))
    if fixed or problem.symbols.kind is not ca.SX:
        return None
    cost, departures = end_cost(problem), Departures.of(solution)
    if cost is None or gentle(cost, HIDES_WELLS) or not 0 < sum(len(departures.free(k)) for k in (0, 1)) <= MOST_FREE:
        return None
    return CheaperEnds(departures, cost)
