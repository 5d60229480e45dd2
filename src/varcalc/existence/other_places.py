"""Where else on phi = 0 an end that slides may be best: the known curve is drawn to other points of it.

phi is told on a grid about the known curve, and between two of its places that phi parts lies a point of phi = 0. The
known curve, bent evenly towards such a point, is a curve that the problem admits where nothing else is asked of it.
Points at which what is minimised along it is least of all around are where other valleys begin.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.existence.directions import end_cost
from varcalc.formulation import Sampled
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import AnyEnd, Bound, Isoperimetric, OnCurve, OnSurface, Through
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution

REACHES = 0.25, 1.0, 4.0
"""How far from the known end points of phi = 0 are looked for, in units of the curve's extents: on three grids."""
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
MOST_PLACES = 3
"""Points of one end from which valleys are followed."""
LABELS = "start", "end"


@dataclass(frozen=True)
class PlaceOfEnd:
    """A ``point`` of phi = 0, with the ``start`` of a curve to it and the ``value`` of what is minimised along that.

    ``end`` slides from there, at the side 0 or 1 of the interval, and ``span`` is the interval.
    """

    point: np.ndarray
    value: float
    side: int
    end: AnyEnd
    span: tuple[float, float]
    start: Sampled

    @property
    def label(self) -> str:
        """What the end is called."""
        return LABELS[self.side]


def looked_for(best: Solution) -> bool:
    """Whether drawn curves tell where else an end may be best.

    Those of graphs of one function or two, and of curves of the plane or of space, without levels and waypoints.
    """
    problem = best.problem
    coordinates = problem.n + isinstance(problem, Problem)
    asked = any(isinstance(c, Isoperimetric | Through) for c in problem.constraints)
    known = problem.order == 1 and coordinates in PLACES_ON_GRID and not (problem.unknowns or asked)
    return known and best.curve is not None


def other_places(best: Solution) -> list[PlaceOfEnd]:
    """Where else the ends that slide may be best, the lowest first; none where that is not :func:`looked_for`."""
    problem = best.problem
    if not looked_for(best):
        return []
    found = [place for side in (0, 1) if problem.slides[side] for place in _Drawn(best, side).places()]
    return sorted(found, key=lambda place: place.value)


class _Drawn:
    """The known curve drawn to other points by its end at one ``side``, the other end where it is."""

    def __init__(self, best: Solution, side: int) -> None:
        assert best.curve is not None
        self.problem, self.side, self._curve = best.problem, side, best.curve
        self._value = best.problem.sign * best.value
        self._graph = isinstance(best.problem, Problem)
        self._span = (float(best.x.min()), float(best.x.max())) if self._graph else best.problem.span
        self._label = LABELS[side]
        x, self._weights = composite_gauss(np.linspace(*self._span, PIECES_DRAWN + 1), POINTS_DRAWN)
        self._known, self._rates = self._along(x)
        share = (x - self._span[0]) / (self._span[1] - self._span[0])
        self._share, self._rate = (share, 1.0) if side else (1 - share, -1.0)
        self._rate /= self._span[1] - self._span[0]
        self._ends = self._along(np.array(self._span))[0]
        self._places = PLACES_ON_GRID[len(self._ends)]
        extents = np.ptp(np.column_stack([self._known, self._ends]), axis=1)
        if self._graph:  # a curve may have drawn all but to nothing
            extents[0] = max(extents[0], np.ptp(best.problem.span))
        self._extents = np.where(extents > 0, extents, extents.max())

    def _along(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The known curve by all its coordinates, (d, m), and its rates by its parameter."""
        points, rates = self._curve(x, 0), self._curve(x, 1)
        if not self._graph:
            return points, rates
        return np.vstack([x, points]), np.vstack([np.ones_like(x), rates])

    def places(self) -> list[PlaceOfEnd]:
        """The points at which a drawn curve is lower than to all others nearby, and not much above the known one."""
        phi = self._phi()
        if phi is None:
            return []
        with np.errstate(all="ignore"):
            (own,), (size,) = self._values(self._ends[:, [self.side]].T)
            enough = own + WORTH_FOLLOWING * size
            found = [lowest for reach in REACHES for lowest in self._lowest(phi, reach, enough)]
        chosen: list[tuple[float, np.ndarray, float]] = []
        for value, point, apart in sorted(found, key=lambda one: one[0]):
            if all(np.linalg.norm((point - other) / self._extents) > min(apart, of) for _, other, of in chosen):
                chosen.append((value, point, apart))
        # what the rule misses of the known curve, as at an end where L is infinite, it misses of the others
        missed = max(self._value - own, 0.0)
        return [self._place(point, value + missed) for value, point, _ in chosen[:MOST_PLACES]]

    def _lowest(self, phi: ca.Function, reach: float, enough: float) -> list[tuple[float, np.ndarray, float]]:
        """Values below ``enough`` and points of one grid, the least nearby, and how near that is, in extents."""
        points, apart = self._points(phi, reach), ONE_VALLEY * 2 * reach / (self._places - 1)
        if not len(points):
            return []
        values, _ = self._values(points)
        values = np.where(np.isfinite(values), values, np.inf)
        scaled = (points - self._ends[:, self.side]) / self._extents
        away = (scaled**2).sum(axis=1)
        elsewhere = away > apart**2
        low = np.flatnonzero(elsewhere & (values < enough))
        near = away[low, None] + away - 2 * scaled[low] @ scaled.T <= apart**2
        least = low[values[low] <= np.where(near, values, np.inf).min(axis=1, initial=np.inf)]
        return [(float(values[k]), points[k], apart) for k in least.tolist()]

    def _points(self, phi: ca.Function, reach: float) -> np.ndarray:
        """Points (k, d) of phi = 0: on the grid's lines, straight between two places that it parts."""
        end = self._ends[:, self.side]
        low, high = (end + sign * reach * self._extents for sign in (-1, 1))
        if self._graph:  # the ends of the interval keep their order
            other, nearest = self._ends[0, 1 - self.side], NEAREST_ABSCISSA * self._extents[0]
            if self.side:
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
        return np.concatenate(found)

    def _phi(self) -> ca.Function | None:
        """Phi of points (d, m)."""
        kind, n = self.problem.symbols.kind, self.problem.n
        symbols = [kind.sym("x"), kind.sym("y", n)] if self._graph else [kind.sym("q", n)]
        x, y = symbols if self._graph else (kind.sym("t"), *symbols)
        level = self.problem.traced_slide(self._label, x, y, kind)
        if level is None:
            return None
        return ca.Function("phi", [ca.vertcat(*symbols)], [ca.densify(level)])

    def _values(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is minimised along the curves drawn to ``points`` (k, d), and the same of its absolute value; (k,)."""
        away = (points - self._ends[:, self.side])[:, :, None]
        places = self._known + self._share * away
        rates = self._rates + self._rate * away
        columns = [a.transpose(1, 0, 2).reshape(a.shape[1], -1) for a in (places, rates)]
        problem = self.problem
        if isinstance(problem, Problem):
            (x, *y), (dx, *dy) = columns
            along = problem.integrand_values(x, np.array(y), np.array(dy) / dx) * dx
        else:
            assert isinstance(problem, Curve)
            along = problem.integrand_values(*columns)
        along = problem.sign * along.reshape(len(points), -1)
        return along @ self._weights + self._costs(points), np.abs(along) @ self._weights

    def _costs(self, points: np.ndarray) -> np.ndarray:
        """What the ends cost, as it is minimised; (k,)."""
        cost = end_cost(self.problem)
        if cost is None:
            return np.zeros(len(points))
        ends = [np.broadcast_to(self._ends[:, [k]], points.T.shape) for k in (0, 1)]
        ends[self.side] = points.T
        if self._graph:
            handed = [part for end in ends for part in (end[:1], end[1:])]
        else:
            times = (np.full((1, len(points)), t) for t in self._span)
            handed = [part for pair in zip(times, ends, strict=True) for part in pair]
        numbers = [np.tile(self.problem.parameter_values[:, None], len(points)), np.zeros((0, len(points)))]
        return self.problem.sign * np.asarray(cost(*handed, *numbers)).ravel()

    def _place(self, point: np.ndarray, value: float) -> PlaceOfEnd:
        """The point with what a solve that begins there needs."""
        own = getattr(self.problem, self._label)
        away = point - self._ends[:, self.side]
        first, last = self._span
        if not self._graph:
            assert isinstance(own, OnSurface)

            def drawn(t: np.ndarray) -> np.ndarray:
                """The coordinates at parameters t."""
                t = np.atleast_1d(t)
                share = (t - first) / (last - first)
                return self._curve(t, 0) + (share if self.side else 1 - share) * away[:, None]

            return PlaceOfEnd(point, value, self.side, own, self._span, drawn)
        assert isinstance(own, OnCurve)
        a, b = (first, float(point[0])) if self.side else (float(point[0]), last)

        def graph(x: np.ndarray) -> np.ndarray:
            share = np.clip((np.atleast_1d(x) - a) / (b - a), 0.0, 1.0)
            return self._curve(first + share * (last - first), 0) + (share if self.side else 1 - share) * away[1:, None]

        return PlaceOfEnd(point, value, self.side, OnCurve(own.phi, x=float(point[0])), (a, b), graph)


def begun_at(problem: Functional, place: PlaceOfEnd) -> Functional:
    """The problem with the end that slides to begin at a place; a Curve begins where what it starts from does."""
    if not isinstance(problem, Problem):
        return problem
    return problem.restated(start=place.end) if place.side == 0 else problem.restated(end=place.end)


def drawn_within_bounds(problem: Functional, place: PlaceOfEnd) -> bool:
    """Whether the curve drawn to a place keeps the bounds of a graph at the points at which it is looked at."""
    held = [(t.constraint.interval, t.expression) for t in problem.traced if isinstance(t.constraint, Bound)]
    if not held:
        return True
    if not isinstance(problem, Problem):
        return False
    x = np.linspace(*place.span, PLACES_HELD_TO_BOUNDS)
    y, middle, s = place.start(x), 0.5 * (x[1:] + x[:-1]), problem.symbols
    levels = ca.Function("levels", [s.x, s.y, s.dy, s.parameters], [ca.vertcat(*(level for _, level in held))])
    numbers = np.tile(problem.parameter_values[:, None], len(middle))
    values = np.asarray(levels(middle[None], 0.5 * (y[:, 1:] + y[:, :-1]), np.diff(y) / np.diff(x), numbers))
    low, high = np.array([interval for interval, _ in held]).T[:, :, None]
    return bool(np.all((values >= low) & (values <= high)))
