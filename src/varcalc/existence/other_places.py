"""Where else on phi = 0 an end that slides may be best: the known curve is drawn to other points of it.

phi is told on a grid about the known curve, and between two of its places that phi parts lies a point of phi = 0. The
known curve, bent evenly towards such a point, is a curve that the problem admits where nothing else is asked of it.
Points at which what is minimised along it is least of all around are where other valleys begin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.existence.directions import SLACK, end_cost
from varcalc.formulation import Sampled, formulate
from varcalc.formulation.height import breadths
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import AnyEnd, Bound, Isoperimetric, OnCurve, Through
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution

REACHES = 0.25, 1.0, 4.0
"""How far from the known end points of phi = 0 are looked for, in units of the curve's extents: on three grids."""
DRAWN_TO_NOTHING, FARTHER = 1e-2, (16.0, 64.0)
"""Of the interval that was told: a curve that is so short says nothing of how far to look, which is farther then."""
PLACES_ON_GRID = {2: 29, 3: 11}
"""Along each coordinate of a grid on which phi is told, by the number of coordinates."""
PIECES_DRAWN, POINTS_DRAWN = 8, 3
"""Pieces of the known curve, and Gauss points on each, by which a drawn curve is summed."""
ONE_VALLEY = 2.1
"""Distance of points, in steps of the grid, within which one of them is the least."""
WORTH_FOLLOWING = 0.5
"""How far above the known value, in units of what is summed, a drawn curve may be for a valley to be lower."""
NEAREST_ABSCISSA = 1e-2
"""Of the interval: how near to the other end the abscissa of a sliding end is looked for."""
PLACES_HELD_TO_BOUNDS = 257
"""Of a drawn curve."""
LEVEL_TOLD = 1e-3
"""How nearly these tell what it sums for a level, in units of that without its signs."""
MOST_PLACES = 3
"""Points of one end from which valleys are followed."""
PLACES_OF_EACH = 20
"""Points of each of two ends from which pairs are made."""
LABELS = "start", "end"


@dataclass(frozen=True)
class PlaceOfEnds:
    """Points of phi = 0, with the ``start`` of a curve to them and the ``value`` of what is minimised along that.

    ``ends`` slide from there, None for one that stays, and ``span`` is the interval.
    """

    value: float
    ends: tuple[AnyEnd | None, AnyEnd | None]
    span: tuple[float, float]
    start: Sampled

    @property
    def label(self) -> str:
        """What the ends that move are called."""
        moved = [label for label, end in zip(LABELS, self.ends, strict=True) if end is not None]
        return " and its ".join(moved)


def looked_for(best: Solution) -> bool:
    """Whether drawn curves tell where else an end may be best.

    Those of graphs of one function or two, and of curves of the plane or of space, without waypoints. A level is asked
    by its multiplier: what is begun there keeps it.
    """
    problem = best.problem
    coordinates = problem.n + isinstance(problem, Problem)
    asked = any(isinstance(c, Through) for c in problem.constraints)
    known = problem.order == 1 and coordinates in PLACES_ON_GRID and not (problem.unknowns or asked)
    return known and best.curve is not None


def other_places(best: Solution) -> list[PlaceOfEnds]:
    """Where else the ends that slide may be best, the lowest first; none where that is not :func:`looked_for`.

    Where both slide they are moved together as well: a curve may have drawn to nothing between them.
    """
    problem = best.problem
    if not looked_for(best):
        return []
    sliding = [side for side in (0, 1) if problem.slides[side]]
    moved = [(side,) for side in sliding] + ([(0, 1)] if len(sliding) == 2 else [])
    found = [place for sides in moved for place in _Drawn(best, sides).places()]
    return sorted(found, key=lambda place: place.value)


class _Drawn:
    """The known curve drawn to other points by its ends at some ``sides``, an end at another where it is."""

    def __init__(self, best: Solution, sides: tuple[int, ...]) -> None:
        assert best.curve is not None
        self.problem, self.sides, self._curve = best.problem, sides, best.curve
        self._value = best.problem.sign * best.value
        self._graph = isinstance(best.problem, Problem)
        self._span = (float(best.x.min()), float(best.x.max())) if self._graph else best.problem.span
        # by the share of the way, as the interval may have drawn to nothing
        share, self._weights = composite_gauss(np.linspace(0, 1, PIECES_DRAWN + 1), POINTS_DRAWN)
        length = self._span[1] - self._span[0]
        self._known, rates = self._along(self._span[0] + share * length)
        self._rates, self._shares = rates * length, np.array([1 - share, share])
        self._ends = self._along(np.array(self._span))[0]
        self._places = PLACES_ON_GRID[len(self._ends)]
        levels = [
            (traced.expression, traced.constraint.interval, float(multiplier))
            for traced, multiplier in zip(self.problem.traced, best.multipliers, strict=False)
            if isinstance(traced.constraint, Isoperimetric)
        ]
        self._level_expressions = [expression for expression, _, _ in levels]
        self._intervals = np.array([interval for _, interval, _ in levels]).reshape(-1, 2).T
        self._multipliers = np.array([multiplier for _, _, multiplier in levels])
        extents = np.ptp(np.column_stack([self._known, self._ends]), axis=1)
        self._reaches: tuple[float, ...] = REACHES
        if self._graph:
            told = float(np.ptp(best.problem.span))
            self._reaches += FARTHER if extents[0] <= DRAWN_TO_NOTHING * told else ()
            extents[0] = max(extents[0], told)
            breadth = breadths(formulate(best.problem))[0]
            extents[1:] = np.where(extents[1:] > DRAWN_TO_NOTHING * breadth, extents[1:], breadth)
        self._extents = np.where(extents > 0, extents, extents.max())

    def _along(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The known curve by all its coordinates, (d, m), and its rates by x, or its parameter."""
        points, rates = self._curve(x, 0), self._curve(x, 1)
        if not self._graph:
            return points, rates
        return np.vstack([x, points]), np.vstack([np.ones_like(x), rates])

    def places(self) -> list[PlaceOfEnds]:
        """The points at which a drawn curve is lower than to all others nearby, and not much above the known one."""
        phis = [self._phi(LABELS[side]) for side in self.sides]
        known = [phi for phi in phis if phi is not None]
        if len(known) < len(phis):
            return []
        with np.errstate(all="ignore"):
            (own,), (size,) = self._values(self._ends.T[None])
            enough = own + WORTH_FOLLOWING * size
            found = [lowest for reach in self._reaches for lowest in self._lowest(known, reach, enough)]
        chosen: list[tuple[float, np.ndarray, float]] = []
        for value, ends, apart in sorted(found, key=lambda one: one[0]):
            if all(np.linalg.norm((ends - other) / self._extents) > min(apart, of) for _, other, of in chosen):
                chosen.append((value, ends, apart))
        # what the rule misses of the known curve, as at an end where L is infinite, it misses of the others; levels are
        # asked by what they change
        missed = self._value - own if self._level_expressions else max(self._value - own, 0.0)
        return [self._place(ends, value + missed) for value, ends, _ in chosen[:MOST_PLACES]]

    def _lowest(
        self, phis: Sequence[ca.Function], reach: float, enough: float
    ) -> list[tuple[float, np.ndarray, float]]:
        """Values below ``enough`` and ends (2, d) of one grid, the least nearby, and how near that is, in extents."""
        ends, apart = self._pairs(phis, reach), ONE_VALLEY * 2 * reach / (self._places - 1)
        if not len(ends):
            return []
        values, _ = self._values(ends)
        values = np.where(np.isfinite(values), values, np.inf)
        scaled = ((ends - self._ends.T) / self._extents).reshape(len(ends), -1)
        away = (scaled**2).sum(axis=1)
        elsewhere = away > apart**2
        low = np.flatnonzero(elsewhere & (values < enough))
        near = away[low, None] + away - 2 * scaled[low] @ scaled.T <= apart**2
        least = low[values[low] <= np.where(near, values, np.inf).min(axis=1, initial=np.inf)]
        return [(float(values[k]), ends[k], apart) for k in least.tolist()]

    def _pairs(self, phis: Sequence[ca.Function], reach: float) -> np.ndarray:
        """Both ends (k, 2, d) of curves drawn to points of each phi = 0; those of a graph keep their order."""
        own = self._ends.T
        points = {side: self._points(phi, side, reach) for side, phi in zip(self.sides, phis, strict=True)}
        if len(points) == 2:
            points = {side: some[:: max(1, len(some) // PLACES_OF_EACH)] for side, some in points.items()}
        first, last = (points.get(side, own[[side]]) for side in (0, 1))
        ends = np.stack([np.repeat(first, len(last), axis=0), np.tile(last, (len(first), 1))], axis=1)
        if not self._graph:
            return ends
        return ends[ends[:, 1, 0] - ends[:, 0, 0] >= NEAREST_ABSCISSA * self._extents[0]]

    def _points(self, phi: ca.Function, side: int, reach: float) -> np.ndarray:
        """Points (k, d) of phi = 0: on the grid's lines, straight between two places that it parts."""
        end = self._ends[:, side]
        low, high = (end + sign * reach * self._extents for sign in (-1, 1))
        if self._graph and len(self.sides) == 1:  # beyond the other end there is no use for a place
            other, nearest = self._ends[0, 1 - side], NEAREST_ABSCISSA * self._extents[0]
            if side:
                low[0] = max(low[0], other + nearest)
            else:
                high[0] = min(high[0], other - nearest)
        axes = [np.linspace(a, b, self._places) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"))
        levels = np.asarray(phi(grid.reshape(len(axes), -1))).reshape(grid.shape[1:])
        found = []
        for axis in range(len(axes)):
            before, after = (np.take(levels, range(k, self._places - 1 + k), axis) for k in (0, 1))
            a, b = (np.take(grid, range(k, self._places - 1 + k), axis + 1) for k in (0, 1))
            parted = before * after <= 0
            share = before[parted] / np.where(before == after, 1.0, before - after)[parted]
            found.append((a[:, parted] + share * (b - a)[:, parted]).T)
        points = np.concatenate(found)
        return points[np.lexsort(points.T[::-1])]

    def _phi(self, label: str) -> ca.Function | None:
        """Phi of points (d, m) of the end of that ``label``."""
        kind, n = self.problem.symbols.kind, self.problem.n
        symbols = [kind.sym("x"), kind.sym("y", n)] if self._graph else [kind.sym("q", n)]
        x, y = symbols if self._graph else (kind.sym("t"), *symbols)
        level = self.problem.traced_slide(label, x, y, kind)
        if level is None:
            return None
        return ca.Function("phi", [ca.vertcat(*symbols)], [ca.densify(level)])

    def _drawn(self, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places and rates (k, d, m) of the curves drawn to ``ends`` (k, 2, d)."""
        away = ends - self._ends.T
        places = self._known + np.einsum("ked,em->kdm", away, self._shares)
        return places, self._rates + (away[:, 1] - away[:, 0])[:, :, None]

    def _values(self, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is minimised along the curves drawn to ``ends`` (k, 2, d), and the same of its absolute value; (k,)."""
        columns = [a.transpose(1, 0, 2).reshape(a.shape[1], -1) for a in self._drawn(ends)]
        along, *levels = (row.reshape(len(ends), -1) for row in self._integrands(*columns))
        along = self.problem.sign * along
        sums = along @ self._weights + self._costs(ends)
        if levels:
            reached = np.array([level @ self._weights for level in levels])
            sums = sums - self.problem.sign * self._multipliers @ reached
            (low, high), room = self._intervals[:, :, None], LEVEL_TOLD * np.abs(reached)
            # one that does not hold the curve has no share in this, and is not to be broken
            broken = ((reached > high + room) | (reached < low - room)) & (np.abs(self._multipliers) <= SLACK)[:, None]
            sums[broken.any(axis=0)] = np.inf
        return sums, np.abs(along) @ self._weights

    def _integrands(self, places: np.ndarray, rates: np.ndarray) -> list[np.ndarray]:
        """L by the share of the way, (m,), at places and rates (d, m), and what levels ask for."""
        problem, s = self.problem, self.problem.symbols
        if isinstance(problem, Problem):
            (x, *y), (dx, *dy) = places, rates
            y, dy = np.array(y), np.array(dy) / dx
            along = problem.integrand_values(x, y, dy)
        else:
            assert isinstance(problem, Curve)
            x, y, dx, dy = np.zeros(places.shape[1]), places, 1.0, rates
            along = problem.integrand_values(places, rates)
        if not self._level_expressions:
            return [along * dx]
        levels = ca.Function("levels", [s.x, s.y, s.dy, s.parameters], [ca.vertcat(*self._level_expressions)])
        numbers = np.tile(problem.parameter_values[:, None], len(x))
        return [row * dx for row in (along, *np.asarray(levels(x[None], y, dy, numbers)))]

    def _costs(self, ends: np.ndarray) -> np.ndarray:
        """What ``ends`` (k, 2, d) cost, as it is minimised; (k,)."""
        cost, count = end_cost(self.problem), len(ends)
        if cost is None:
            return np.zeros(count)
        points = [ends[:, side].T for side in (0, 1)]
        if self._graph:
            handed = [part for point in points for part in (point[:1], point[1:])]
        else:
            times = (np.full((1, count), t) for t in self._span)
            handed = [part for pair in zip(times, points, strict=True) for part in pair]
        numbers = [np.tile(self.problem.parameter_values[:, None], count), np.zeros((0, count))]
        return self.problem.sign * np.asarray(cost(*handed, *numbers)).ravel()

    def _place(self, ends: np.ndarray, value: float) -> PlaceOfEnds:
        """The ``ends`` (2, d) with what a solve that begins there needs."""
        away = ends - self._ends.T
        first, last = self._span
        moved: list[AnyEnd | None] = [None, None]
        if not self._graph:
            for side in self.sides:
                moved[side] = getattr(self.problem, LABELS[side])

            def drawn(t: np.ndarray) -> np.ndarray:
                """The coordinates at parameters t."""
                t = np.atleast_1d(t)
                share = (t - first) / (last - first)
                return self._curve(t, 0) + np.outer(away[0], 1 - share) + np.outer(away[1], share)

            return PlaceOfEnds(value, (moved[0], moved[1]), self._span, drawn)
        for side in self.sides:
            own = getattr(self.problem, LABELS[side])
            assert isinstance(own, OnCurve)
            moved[side] = OnCurve(own.phi, x=float(ends[side, 0]))
        a, b = (float(x) for x in ends[:, 0])

        def graph(x: np.ndarray) -> np.ndarray:
            """The ordinates at x."""
            share = np.clip((np.atleast_1d(x) - a) / (b - a), 0.0, 1.0)
            bent = np.outer(away[0, 1:], 1 - share) + np.outer(away[1, 1:], share)
            return self._curve(first + share * (last - first), 0) + bent

        return PlaceOfEnds(value, (moved[0], moved[1]), (a, b), graph)


def begun_at(problem: Functional, place: PlaceOfEnds) -> Functional:
    """The problem with the ends that slide to begin at a place; a Curve begins where what it starts from does."""
    return problem.restated(*place.ends) if isinstance(problem, Problem) else problem


def drawn_is_admitted(problem: Functional, place: PlaceOfEnds) -> bool:
    """Whether the graph drawn to a place keeps bounds at points at which it is looked at, and levels with some room."""
    asked = [(t.constraint, t.expression) for t in problem.traced if isinstance(t.constraint, Bound | Isoperimetric)]
    if not asked:
        return True
    if not isinstance(problem, Problem):
        return False
    x = np.linspace(*place.span, PLACES_HELD_TO_BOUNDS)
    y, middle, s = place.start(x), 0.5 * (x[1:] + x[:-1]), problem.symbols
    levels = ca.Function("levels", [s.x, s.y, s.dy, s.parameters], [ca.vertcat(*(level for _, level in asked))])
    numbers = np.tile(problem.parameter_values[:, None], len(middle))
    values = np.asarray(levels(middle[None], 0.5 * (y[:, 1:] + y[:, :-1]), np.diff(y) / np.diff(x), numbers))
    return all(_kept(constraint, along, np.diff(x)) for (constraint, _), along in zip(asked, values, strict=True))


def _kept(constraint: Bound | Isoperimetric, along: np.ndarray, steps: np.ndarray) -> bool:
    """Whether what is bounded ``along`` a curve, or its sum over ``steps``, lies between what it is to."""
    if isinstance(constraint, Isoperimetric):
        pieces = along * steps
        room = LEVEL_TOLD * float(np.abs(pieces).sum())
        along = pieces.sum() + np.array([-room, room])
    low, high = constraint.interval
    return bool(np.all((along >= low) & (along <= high)))
