"""The known curve drawn to other points of phi = 0, on which its ends slide.

phi is told on a grid about the known curve, and between two of its places that phi parts lies a point of phi = 0. The
known curve, bent evenly towards such a point, is a curve that the problem admits where nothing else is asked of it.
Points at which what is minimised along it is least of all around are where other valleys begin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.existence.hidden_pieces import hidden_points
from varcalc.existence.kept_polygons import LABELS, PIECES_KEPT, KeptPolygon
from varcalc.formulation import Sampled, formulate
from varcalc.formulation.height import breadths
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import AnyEnd, OnCurve
from varcalc.problem.end_cost import costs_of_ends
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution

REACHES = 0.25, 1.0, 4.0
"""How far from the known end points of phi = 0 are looked for, in units of the curve's extents: on three grids."""
DRAWN_TO_NOTHING, FARTHER = 1e-2, (16.0, 64.0)
"""Of the interval that was told: a curve that is so short says nothing of how far to look, which is farther then."""
EXTENTS_ALIKE, REACHES_WIDE = 2.0, (1.0, 4.0)
"""Ratio from which on they are looked for in units of how far the curve might go aside too, of a graph the breadth of
its landscape, of a Curve its largest extent; and how far, in these."""
PLACES_ON_GRID = {2: 29, 3: 18}
"""Along each coordinate of a grid on which phi is told, by the number of coordinates."""
PIECES_DRAWN, POINTS_DRAWN, TOLD_BY = 8, 3, 128
"""Pieces of the known curve, and Gauss points on each, by which drawn curves are compared; pieces by which one is told.

Beside a jump of L the best one by few points is the one whose points miss most of it.
"""
ONE_VALLEY = 2.1
"""Distance of points, in steps of the grid, within which one of them is the least."""
WORTH_FOLLOWING = 0.5
"""How far above the known value, in units of what is summed, a drawn curve may be for a valley to be lower."""
NEAREST_ABSCISSA = 1e-2
"""Of the interval: how near to the other end the abscissa of a sliding end is looked for."""
BEGUN_AT = 4
"""Points on each grid at which polygons begin that keep what is asked."""
SLID_TO_ONE = 0.05
"""Distance of the ends of polygons in one valley, in units of the curve's extents."""
STEPS_ONTO_LEVEL = 4
"""Steps of Newton's method from a point of a grid's line: a point aside may be nearer than any of phi = 0."""
MOST_PLACES = 3
"""Points of one end from which valleys are followed."""
TIMES_CLOSER = 3
"""Grids, each about the best point of the one before, by which a place is told more closely."""
PLACES_OF_EACH = 40
"""Points of each of two ends from which pairs are made."""


@dataclass(frozen=True)
class PlaceOfEnds:
    """Points of phi = 0, with the ``start`` of a curve to them and the ``value`` of what is minimised along that.

    ``ends`` slide from there, None for one that stays, and ``span`` is the interval. ``sure`` tells whether it is
    sure that a curve is admitted there which has this value.
    """

    value: float
    ends: tuple[AnyEnd | None, AnyEnd | None]
    span: tuple[float, float]
    start: Sampled
    sure: bool = True

    @property
    def label(self) -> str:
        """What the ends that move are called."""
        moved = [label for label, end in zip(LABELS, self.ends, strict=True) if end is not None]
        return " and its ".join(moved)


@dataclass(frozen=True)
class _Rule:
    """The known curve by all its coordinates, and its rates by the share of the way, (d, m), at points of a rule.

    ``shares`` (2, m) are those of the way to the start and to the end.
    """

    places: np.ndarray
    rates: np.ndarray
    shares: np.ndarray
    weights: np.ndarray


class DrawnToPlaces:
    """The known curve drawn to other points by its ends at some ``sides``, an end at another where it is."""

    def __init__(self, best: Solution, sides: tuple[int, ...]) -> None:
        assert best.curve is not None
        self.problem, self.sides, self._curve = best.problem, sides, best.curve
        self._value = best.problem.sign * best.value
        self._graph = isinstance(best.problem, Problem)
        self.span = best.interval if self._graph else best.problem.span
        self._rule = self._of_pieces(PIECES_DRAWN)
        self._ends = self._along(np.array(self.span))[0]
        self._places = PLACES_ON_GRID[len(self._ends)]
        extents = np.ptp(np.column_stack([self._rule.places, self._ends]), axis=1)
        reaches: tuple[float, ...] = REACHES
        if self._graph:
            told = float(np.ptp(best.problem.span))
            reaches += FARTHER if extents[0] <= DRAWN_TO_NOTHING * told else ()
            extents[0] = max(extents[0], told)
            breadth = breadths(formulate(best.problem))[0]
            extents[1:] = np.where(extents[1:] > DRAWN_TO_NOTHING * breadth, extents[1:], breadth)
            wide = np.append(extents[0], np.maximum(extents[1:], breadth))
        else:  # where a curve keeps to a line its ends may go aside as far as along it
            extents = np.where(extents > DRAWN_TO_NOTHING * extents.max(), extents, extents.max())
            wide = np.full_like(extents, extents.max())
        self._extents = np.where(extents > 0, extents, extents.max())
        self._halves = [reach * self._extents for reach in reaches]
        # a curve that keeps close to a line here may go as far aside to other places
        if (EXTENTS_ALIKE * self._extents < wide).any():
            self._halves += [reach * wide for reach in REACHES_WIDE]

    @property
    def reach(self) -> float:
        """How far from the known ends others are looked for, along any coordinate."""
        return float(np.max(self._halves))

    def _of_pieces(self, pieces: int) -> _Rule:
        """By the share of the way, as the interval may have drawn to nothing."""
        share, weights = composite_gauss(np.linspace(0, 1, pieces + 1), POINTS_DRAWN)
        length = self.span[1] - self.span[0]
        places, rates = self._along(self.span[0] + share * length)
        return _Rule(places, rates * length, np.array([1 - share, share]), weights)

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
            (own,), (size,) = self._values(self._ends.T[None], self._rule)
            enough = own + WORTH_FOLLOWING * size
            found = [lowest for half in self._halves for lowest in self._lowest(known, half, enough)]
        chosen: list[tuple[float, np.ndarray, np.ndarray]] = []
        for value, ends, apart in sorted(found, key=lambda one: one[0]):
            if all(max(np.linalg.norm((ends - other) / by) for by in (apart, of)) > 1 for _, other, of in chosen):
                chosen.append((value, ends, apart))
        with np.errstate(all="ignore"):
            closely = self._of_pieces(TOLD_BY)
            closer = [self._closer(known, closely, ends, apart) for _, ends, apart in chosen[:MOST_PLACES]]
            (own,), _ = self._values(self._ends.T[None], closely)
        # what the rule misses of the known curve, as at an end where L is infinite, it misses of the others
        missed = max(self._value - own, 0.0)
        return [self._place(ends, value + missed) for value, ends in closer]

    def _closer(
        self, phis: Sequence[ca.Function], rule: _Rule, ends: np.ndarray, apart: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """The least value beside ``ends`` (2, d), by a ``rule``, and where: beside a jump of L a grid tells little."""
        value = float(self._values(ends[None], rule)[0][0])
        taken = bool(len(self.sides) == 1 and np.any(ends[1 - self.sides[0]] != self._ends[:, 1 - self.sides[0]]))
        for _ in range(TIMES_CLOSER):
            for side, phi in zip(self.sides, phis, strict=True):
                points = np.vstack(self._points(phi, side, apart, ends[side]))
                moved = self._in_order(self._moved(ends, side, points, along=taken))
                if len(moved) == 0:
                    continue
                values = self._values(moved, rule)[0]
                values = np.where(np.isfinite(values), values, np.inf)
                if values.min() < value:
                    value, ends = float(values.min()), moved[np.argmin(values)]
            apart = self._beside_points * apart
        return value, ends

    def spread(self) -> np.ndarray:
        """Ends (k, 2, d), a few on each grid, each as far as can be from the known ones and those before it."""
        phis = [phi for phi in map(self._phi, (LABELS[side] for side in self.sides)) if phi is not None]
        chosen = self._ends.T[None]
        for half in self._halves:
            points = self._pairs(phis, half)
            for _ in range(min(BEGUN_AT, len(points))):
                away = (points[:, None] - chosen) / self._extents
                chosen = np.append(chosen, points[[np.argmax((away**2).sum((2, 3)).min(1))]], axis=0)
        return chosen[1:]

    def vertices(self, ends: np.ndarray, turns: int) -> tuple[np.ndarray, np.ndarray]:
        """Abscissae (K + 1,), or parameters, of a polygon of the curve drawn to ``ends`` (2, d), and its ordinates.

        It is bent by so many half waves as well, as high as the curve is.
        """
        start = self._place(ends, np.nan)
        x, share = np.linspace(*start.span, PIECES_KEPT + 1), np.linspace(0.0, 1.0, PIECES_KEPT + 1)
        heights = self._extents[1:] if self._graph else self._extents
        return x, start.start(x) + np.outer(heights, np.sin(turns * np.pi * share))

    def same_place(self, polygon: KeptPolygon, other: KeptPolygon | None) -> bool:
        """Whether the ends of two polygons are next to each other."""
        if other is None:
            return False
        return bool(np.linalg.norm((self._ends_of(polygon) - self._ends_of(other)) / self._extents) <= SLID_TO_ONE)

    def _ends_of(self, polygon: KeptPolygon) -> np.ndarray:
        """Both ends (2, d) of a polygon."""
        both = polygon.y[:, [0, -1]]
        return (np.vstack([polygon.x[[0, -1]], both]) if self._graph else both).T

    def kept_place(self, polygon: KeptPolygon, lower: bool) -> PlaceOfEnds:
        """The place to which a polygon slid, which is ``lower`` than the known curve."""
        ends = self._sliding_from(self._ends_of(polygon), (0, 1))
        span = float(polygon.x[0]), float(polygon.x[-1])
        return PlaceOfEnds(polygon.value, ends, span, polygon, lower and polygon.kept)

    def _lowest(
        self, phis: Sequence[ca.Function], half: np.ndarray, enough: float
    ) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Values below ``enough`` and ends (2, d) of one grid, the least nearby, and how near that is, (d,)."""
        ends, apart = self._pairs(phis, half), self._beside_points * half
        if not len(ends):
            return []
        values, _ = self._values(ends, self._rule)
        values = np.where(np.isfinite(values), values, np.inf)
        scaled = ((ends - self._ends.T) / apart).reshape(len(ends), -1)
        away = (scaled**2).sum(axis=1)
        elsewhere = away > 1
        low = np.flatnonzero(elsewhere & (values < enough))
        near = away[low, None] + away - 2 * scaled[low] @ scaled.T <= 1
        least = low[values[low] <= np.where(near, values, np.inf).min(axis=1, initial=np.inf)]
        return [(float(values[k]), ends[k], apart) for k in least.tolist()]

    def _pairs(self, phis: Sequence[ca.Function], half: np.ndarray) -> np.ndarray:
        """Both ends (k, 2, d) of curves drawn to points of each phi = 0; those of a graph keep their order.

        Where the other end is free it stays, or goes along with the one that is drawn.
        """
        own = self._ends.T
        points = [self._points(phi, side, half, own[side]) for side, phi in zip(self.sides, phis, strict=True)]
        if len(points) == 2:
            first, last = (_some(grid, hidden) for grid, hidden in points)
            ends = np.stack([np.repeat(first, len(last), axis=0), np.tile(last, (len(first), 1))], axis=1)
        else:
            side = self.sides[0]
            ways = (False, True) if np.any(self._free(1 - side)) else (False,)
            ends = np.concatenate([self._moved(own, side, np.vstack(points[0]), along=along) for along in ways])
        return self._in_order(ends)

    def _in_order(self, ends: np.ndarray) -> np.ndarray:
        """Those of the ``ends`` (k, 2, d) between which a graph runs forwards."""
        apart = ends[:, 1, 0] - ends[:, 0, 0] >= NEAREST_ABSCISSA * self._extents[0]
        return ends[apart] if self._graph else ends

    def _free(self, side: int) -> np.ndarray:
        """Which ordinates, or coordinates, of an end (n,) are free."""
        end = getattr(self.problem, LABELS[side])
        return np.isnan(end.values(self.problem.n)) & (not end.slides)

    def _moved(self, ends: np.ndarray, side: int, points: np.ndarray, *, along: bool) -> np.ndarray:
        """The ``ends`` (2, d), that of a ``side`` at points (k, d); the other, as far as it is free, goes ``along``."""
        moved, n = np.repeat(ends[None], len(points), axis=0), self.problem.n
        moved[:, side] = points
        if along:
            moved[:, 1 - side, -n:] += np.where(self._free(1 - side), (points - ends[side])[:, -n:], 0.0)
        return moved

    @property
    def _beside_points(self) -> float:
        """How near to each other the points of a grid are in one valley, in units of its half."""
        return ONE_VALLEY * 2 / (self._places - 1)

    def _points(
        self, phi: ca.Function, side: int, half: np.ndarray, about: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points (k, d) of phi = 0 beside the lines of a grid, where it parts two places, and of pieces between these.

        The grid lies ``about`` a point and reaches ``half`` (d,) to either side.
        """
        low, high = about - half, about + half
        if self._graph and len(self.sides) == 1:  # beyond the other end there is no use for a place
            other, nearest = self._ends[0, 1 - side], NEAREST_ABSCISSA * self._extents[0]
            if side:
                low[0] = max(low[0], other + nearest)
            else:
                high[0] = min(high[0], other - nearest)
        axes = [np.linspace(a, b, self._places) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"))
        levels = np.asarray(phi(grid.reshape(len(axes), -1))[0]).reshape(grid.shape[1:])
        found = []
        for axis in range(len(axes)):
            before, after = (np.take(levels, range(k, self._places - 1 + k), axis) for k in (0, 1))
            a, b = (np.take(grid, range(k, self._places - 1 + k), axis + 1) for k in (0, 1))
            parted = before * after <= 0
            share = before[parted] / np.where(before == after, 1.0, before - after)[parted]
            found.append((a[:, parted] + share * (b - a)[:, parted]).T)
        points = _on_level(phi, np.concatenate(found), np.array([axis[1] - axis[0] for axis in axes]))
        read = self.problem.symbols.kind is ca.SX
        hidden = hidden_points(phi, axes, levels) if read else np.zeros((0, len(axes)))
        return points[np.lexsort(points.T[::-1])], hidden

    def _phi(self, label: str) -> ca.Function | None:
        """Phi of points (d, m) of the end of that ``label``, and its gradient."""
        kind, n = self.problem.symbols.kind, self.problem.n
        symbols = [kind.sym("x"), kind.sym("y", n)] if self._graph else [kind.sym("q", n)]
        x, y = symbols if self._graph else (kind.sym("t"), *symbols)
        level = self.problem.traced_slide(label, x, y, kind)
        if level is None:
            return None
        point = kind.sym("point", n + self._graph)
        at = ca.vertsplit(point, [0, 1, n + 1]) if self._graph else [point]
        level = ca.substitute([level], symbols, at)[0]
        return ca.Function("phi", [point], [ca.densify(level), ca.densify(ca.gradient(level, point))])

    def _values(self, ends: np.ndarray, rule: _Rule) -> tuple[np.ndarray, np.ndarray]:
        """What is minimised along the curves drawn to ``ends`` (k, 2, d), and the same of its absolute value; (k,)."""
        away = ends - self._ends.T
        places = rule.places + np.einsum("ked,em->kdm", away, rule.shares)
        rates = rule.rates + (away[:, 1] - away[:, 0])[:, :, None]
        columns = [a.transpose(1, 0, 2).reshape(a.shape[1], -1) for a in (places, rates)]
        along = self.problem.sign * self._integrand(*columns).reshape(len(ends), -1)
        return along @ rule.weights + self._costs(ends), np.abs(along) @ rule.weights

    def _integrand(self, places: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """L by the share of the way, (m,), at places and rates (d, m)."""
        problem = self.problem
        if isinstance(problem, Problem):
            (x, *y), (dx, *dy) = places, rates
            return problem.integrand_values(x, np.array(y), np.array(dy) / dx) * dx
        assert isinstance(problem, Curve)
        return problem.integrand_values(places, rates)

    def _costs(self, ends: np.ndarray) -> np.ndarray:
        """What ``ends`` (k, 2, d) cost, as it is minimised; (k,)."""
        start, end = (
            (point[0], point[1:]) if self._graph else (np.array([t]), point)
            for point, t in zip(ends.transpose(1, 2, 0), self.span, strict=True)
        )
        return costs_of_ends(self.problem, start, end, self.problem.unknown_guesses[None])

    def _place(self, ends: np.ndarray, value: float) -> PlaceOfEnds:
        """The ``ends`` (2, d) with what a solve that begins there needs."""
        away = ends - self._ends.T
        moved = self._sliding_from(ends, self.sides)
        first, last = self.span
        a, b = ends[:, 0].tolist() if self._graph else self.span
        bent = away[:, 1:] if self._graph else away

        def drawn(x: np.ndarray) -> np.ndarray:
            """The ordinates at x, or the coordinates at parameters."""
            share = np.clip((np.atleast_1d(x) - a) / (b - a), 0.0, 1.0)
            known = self._curve(first + share * (last - first), 0)
            return known + np.outer(bent[0], 1 - share) + np.outer(bent[1], share)

        return PlaceOfEnds(value, moved, (a, b), drawn)

    def _sliding_from(self, ends: np.ndarray, sides: Sequence[int]) -> tuple[AnyEnd | None, AnyEnd | None]:
        """What slides at some ``sides``, from ``ends`` (2, d), None at others."""
        moved: list[AnyEnd | None] = [None, None]
        for side in sides:
            own = getattr(self.problem, LABELS[side])
            if own.slides:
                moved[side] = OnCurve(own.phi, x=float(ends[side, 0])) if self._graph else own
        return moved[0], moved[1]


def _some(grid: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """A few of the points (k, d) of a grid, evenly among all, and of those that it hides."""
    return np.vstack([some[:: max(1, len(some) // PLACES_OF_EACH)] for some in (grid, hidden)])


def _on_level(phi: ca.Function, points: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Points (k, d) moved onto phi = 0 by Newton's method along its gradient, none by more than the ``steps`` (d,)."""
    for _ in range(STEPS_ONTO_LEVEL if len(points) else 0):
        level, gradient = (np.asarray(part) for part in phi(points.T))
        moved = points - (level * gradient / (gradient**2).sum(axis=0)).T
        points = np.where((np.abs(moved - points) <= steps).all(axis=1, keepdims=True), moved, points)
    return points
