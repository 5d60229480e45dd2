"""Least polygons under bounds of the place where L jumps: over all levels at once, however narrow bounds are.

Where L jumps, a curve that goes beyond the jump and comes back for a spike of a bound, and one that never does, lie in
valleys of their own, and neither leads to the other. The least polygon is found over a lattice by dynamic programming
(Bellman, "Dynamic Programming", 1957, ch. 9), whose levels are those of the bounds' spikes and of the jumps as well;
then on ever more pieces, in ever smaller steps (Luus, "Iterative Dynamic Programming", 2000, ch. 3).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.existence.directions import polygonal
from varcalc.existence.moved_polygons import least_through
from varcalc.existence.polygons import Graphs, values_of
from varcalc.existence.rests import ASIDE_OF_JUMP, Surfaces, treated
from varcalc.formulation import Contact, formulate
from varcalc.formulation.form import SideCondition
from varcalc.methods.crossings import crossings
from varcalc.numerics.mesh import GAUSS_SHARES, CurveOrSlope, composite_gauss
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import breaks, on_curve
from varcalc.problem.functional import arguments_at
from varcalc.problem.problem import Problem
from varcalc.symbolic.switches import Switch
from varcalc.symbolic.variation import gentle_boxes

EVEN_PIECES, GENTLE_EDGES = 24, 150
"""Pieces of the first polygon, and abscissae at most between which bounds vary gently."""
EVEN_LEVELS = np.linspace(-1.0, 1.0, 100)
"""Levels about what is near the ends and bounds, and about the jumps as well, in units of twice that range."""
MOST_TIPS, THIRDS_TO_TIP = 24, 60
"""Tips of bounds at most, on either side, and thirds by which each is closed in on."""
TIMES_WIDENED = 3
"""Times that the levels are drawn further apart where the least polygon goes along the outermost."""
STEPS_AT_ONCE = np.arange(-3.0, 4.0)
"""Steps that vertices are moved by at once."""
SWEEPS_BY_STEPS, HALVINGS_OF_STEPS, PIECES_ENOUGH, PIECES_AT_MOST = 4, 9, 100, 400
"""How often they are moved with one step, how many steps there are, each half the last; pieces that are enough, and
how many there may be."""
INSIDE_A_PIECE = (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99)
"""Places of a piece at which it is seen whether it keeps bounds between its vertices."""
BROKEN_INSIDE, ROUGHLY_KEPT, LEAST_PIECE = 1e-5, 2e-4, 1e-8
"""By how much a bound may be broken there, where more pieces mend that, and at last, in units of the larger of interval
and extent; the least length of a piece, in units of the interval."""
NEAREST_TO_TIP, PLACES_NEAR, TIMES_NEARER = 1e-9, 200, 3
"""Places beside the tip of a bound at which its slope is seen, from the nearest one on, and how often more closely."""
AT_BOUND, BESIDE_JUMP, LEAST_RUN = 1e-9, 1e-6, 2
"""How near to a bound vertices are at it, in units of 1 and its level, and to a jump, in units of the largest argument;
pieces that make a run along that."""
RULES, RULES_APART = (8, 12), 10.0
"""Gauss points a piece of two rules by which a polygon's value is told, and how often their difference is its error."""


@dataclass(frozen=True)
class PolygonBesideJumps:
    """The polygon, what is minimised along it, at most, and its contacts with ``surfaces``."""

    surfaces: Surfaces
    curve: CurveOrSlope
    value: float
    contacts: list[Contact]


def least_beside_jumps(problem: Problem) -> PolygonBesideJumps | None:
    """The least polygon of a graph of one function whose L jumps under bounds of its place; None for others."""
    ends = any(problem.slides) or problem.start.periodic or problem.end_cost is not None
    if ends or not treated(problem) or not _jumps(problem) or not problem.vectorised:
        return None
    surfaces = Surfaces(problem)
    if not _linear(surfaces):
        return None
    with np.errstate(all="ignore"):  # beside what an end is given, a bound may have no slope
        return _Lattice(surfaces).least()


def _jumps(problem: Problem) -> list[Switch]:
    """The jumps of the place."""
    return [s for s in on_curve(problem) if s.jumps and not s.stepped and not s.depends_on(problem.symbols.highest)]


def _linear(surfaces: Surfaces) -> bool:
    """Whether there are bounds, each of the place, in which it is linear."""
    s, bounds = surfaces.problem.symbols, surfaces.bounds
    return bool(bounds) and not any(
        ca.depends_on(c.expression, s.dy) or ca.depends_on(ca.jacobian(c.expression, s.y), s.y) for c in bounds
    )


class _Lattice:
    """Polygons with vertices on levels, beside jumps and at bounds, between which all vertices are."""

    def __init__(self, surfaces: Surfaces) -> None:
        self.surfaces, self.problem = surfaces, surfaces.problem
        self.graphs, self.bounds = Graphs(surfaces.problem), surfaces.bounds
        s = self.problem.symbols
        told = ca.vertcat(*(c.expression for c in self.bounds))
        still = ca.substitute(told, s.y, 0.0)
        self._bounds = ca.Function("bounds", s.all, [still, ca.densify(ca.jacobian(told, s.y))])
        jumps = ca.vertcat(*(switch.argument - switch.levels[0] for switch in _jumps(self.problem)))
        self._jumps = ca.Function("jumps", s.all, [ca.densify(jumps)])
        at = ca.substitute(ca.vertcat(still, ca.jacobian(told, s.y)), s.parameters, self.problem.parameter_values)
        self._at_abscissae = ca.Function("bounds", [s.x], [at])

    def least(self) -> PolygonBesideJumps | None:
        """The least polygon, moved on ever more pieces; None where none is admitted, or no levels hold it."""
        first = self._first()
        if first is None:
            return None
        x, y, step = first
        y = self._moved(x, y, step)
        for _ in range(HALVINGS_OF_STEPS):
            x, between = self._finer(x, y)
            y = np.clip(between, *self._room(x))
            step = max(0.5 * step, float(np.abs(y - between).max()))
            y = self._moved(x, y, step)
        curve = polygonal(x, y[None])
        return PolygonBesideJumps(self.surfaces, curve, self._value(x, y), self._contacts(x, curve))

    def _moved(self, x: np.ndarray, y: np.ndarray, step: float) -> np.ndarray:
        """The ordinates of a polygon that is moved by steps to where it is less."""
        lower, upper = (r[:, None] for r in self._room(x))
        for _ in range(SWEEPS_BY_STEPS):
            moved = np.clip(y[:, None] + step * STEPS_AT_ONCE, lower, upper)
            y, _ = self._over(x, np.hstack([moved, self._beside_jumps(x, y)]))
        return y

    def _first(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """The vertices and ordinates of the least polygon over the whole lattice, and the distance of its levels."""
        span = self.problem.span
        even = np.linspace(*span, EVEN_PIECES + 1)
        x = np.unique([*even, *gentle_boxes(self._at_abscissae, even, GENTLE_EDGES), *breaks(self.problem)])
        apart = LEAST_PIECE * (span[1] - span[0])
        x = np.unique([*x, *(tip for tip in self._tips(x) if np.abs(x - tip).min() > apart)])
        lower, upper = self._room(x)
        if (lower > upper).any():
            return None
        line = formulate(self.problem).start.curve(x)[0]
        beside = self._beside_jumps(x, line)
        near = np.concatenate([line, np.clip(line, lower, upper)])
        drawn = [_drawn_about(ordinates, span) for ordinates in (near, np.append(near, beside))]
        tips = np.concatenate([upper[1:-1][_are_tips(upper)], lower[1:-1][_are_tips(-lower)], line[[0, -1]]])
        for wide in range(TIMES_WIDENED):
            evenly = [middle + 2**wide * half * EVEN_LEVELS for middle, half in drawn]
            levels = np.unique(np.concatenate([*evenly, tips]))
            nodes = np.clip(np.tile(levels, (len(x), 1)), lower[:, None], upper[:, None])
            y, value = self._over(x, np.hstack([nodes, beside]))
            if not np.isfinite(value):
                return None
            if levels[0] < y.min() and y.max() < levels[-1]:
                return x, y, 2**wide * drawn[-1][1] * float(EVEN_LEVELS[1] - EVEN_LEVELS[0])
        return None

    def _tips(self, x: np.ndarray) -> np.ndarray:
        """The abscissae of the tips of bounds, each found between the neighbours of the vertex nearest to it."""
        found = list[np.ndarray]()
        for side, way in ((0, -1.0), (1, 1.0)):
            at = np.flatnonzero(_are_tips(way * self._room(x)[side]))[:MOST_TIPS]
            first, last = x[at], x[at + 2]
            for _ in range(THIRDS_TO_TIP if len(at) else 0):
                third = (last - first) / 3
                one, other = (way * self._room(place)[side] for place in (first + third, last - third))
                first, last = np.where(one > other, first + third, first), np.where(one > other, last, last - third)
            found.append(0.5 * (first + last))
        return np.concatenate(found)

    def _room(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The least and the greatest ordinates (m,) at x (m,), which are one where an end is given."""
        values, rates = (np.asarray(v) for v in self._bounds(*self._columns(x, np.zeros_like(x))))
        lower, upper = np.full(len(x), -np.inf), np.full(len(x), np.inf)
        for condition, value, rate in zip(self.bounds, values, rates, strict=True):
            for level, way in ((condition.lower, -1.0), (condition.upper, 1.0)):
                if np.isfinite(level):
                    place = (level - value) / rate
                    upper = np.where(way * rate > 0, np.minimum(upper, place), upper)
                    lower = np.where(way * rate < 0, np.maximum(lower, place), lower)
        for place, end in zip(self.problem.span, (self.problem.start, self.problem.end), strict=True):
            if end.fixed:
                lower[x == place] = upper[x == place] = end.values(1)[0]
        return lower, upper

    def _columns(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """The arguments of expressions of the place, a column for each x (m,) and y (m,)."""
        return arguments_at(self.problem, x, y[None], np.zeros((1, len(x))))

    def _beside_jumps(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Ordinates (m, k) just beside jumps, as far as bounds let them be."""
        found = self.graphs.beside_jumps(x, y)
        return np.clip(np.array(found).T.reshape(len(x), -1), *(r[:, None] for r in self._room(x)))

    def _over(self, x: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, float]:
        """The ordinates and the value of the least polygon through nodes (m, J)."""
        h, first, last = np.diff(x)[:, None, None], nodes[:-1, :, None], nodes[1:, None]
        rises, added, begin = last - first, 0.0, 0.0
        # a rule that does not know where a piece goes through a jump has polygons go just beyond one of its points
        for end in (*self._parts(x, nodes), 1.0):
            for share in GAUSS_SHARES:
                at = begin + share * (end - begin)
                values = values_of(self.graphs, x[:-1, None, None] + at * h, first + at * rises, rises / h)
                added = added + 0.5 * (end - begin) * h * np.where(np.isfinite(values), values, np.inf)
            begin = end
        y, value = least_through(nodes[None, :, :, None], np.asarray(added)[None], np.zeros((1, *nodes.shape)))
        return y[0, :, 0], float(value[0])

    def _parts(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """The shares of pieces between nodes (m, J) at which they go through jumps, in order; 1 for none."""
        columns = self._columns(np.repeat(x, nodes.shape[1]), nodes.ravel())
        sides = np.asarray(self._jumps(*columns)).reshape(-1, *nodes.shape)
        first, last = sides[:, :-1, :, None], sides[:, 1:, None]
        through = first * last < 0
        return np.sort(np.where(through, np.abs(first) / np.abs(first - last), 1.0), axis=0)

    def _finer(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The polygon on more pieces: all are halved, as long as they are few, and those that break a bound."""
        if len(x) > PIECES_AT_MOST:
            return x, y
        long = np.diff(x) > (self.problem.span[1] - self.problem.span[0]) / PIECES_ENOUGH
        finer = np.union1d(x, 0.5 * (x[1:] + x[:-1])[long | self._broken(x, y, BROKEN_INSIDE)])
        return finer, np.interp(finer, x, y)

    def _broken(self, x: np.ndarray, y: np.ndarray, by: float) -> np.ndarray:
        """The pieces that break a bound ``by`` so much between their vertices."""
        steps, unit = np.diff(x), self.problem.span[1] - self.problem.span[0]
        found, room = np.zeros(len(steps), dtype=bool), by * max(unit, float(np.ptp(y)))
        for share in INSIDE_A_PIECE:
            lower, upper = self._room(x[:-1] + share * steps)
            between = y[:-1] + share * np.diff(y)
            found |= np.maximum(between - upper, lower - between) > room
        return found & (steps > LEAST_PIECE * unit)

    def _value(self, x: np.ndarray, y: np.ndarray) -> float:
        """What is minimised along a polygon, with jumps where it meets them, made worse by what two rules differ by.

        Infinite where it breaks bounds for want of pieces.
        """
        if self._broken(x, y, ROUGHLY_KEPT).any():
            return math.inf
        curve = polygonal(x, y[None])
        met = [c.x for c in crossings(self.problem, curve, x, self.problem.unknown_guesses)]
        edges, sums = np.union1d(x, met), list[float]()
        for count in RULES:
            at, weights = composite_gauss(edges, count)
            sums.append(float(self.graphs.values(at, curve(at, 0)[0], curve(at, 1)[0]) @ weights))
        return sums[1] + RULES_APART * abs(sums[1] - sums[0])

    def _contacts(self, x: np.ndarray, curve: CurveOrSlope) -> list[Contact]:
        """The contacts of a polygon with jumps, kinks and bounds."""
        problem = self.problem
        met = crossings(problem, curve, x, problem.unknown_guesses)
        contacts = self.surfaces.contacts(curve, [c for c in met if not c.switch.smooth and c.until is None])
        # how long bounds and jumps hold it its vertices know better than places that lie evenly
        jumps = [c for c in contacts if self.surfaces.jumps(c)]
        found = [c for c in contacts if c.index >= len(problem.constraints) and (c not in jumps or c.start == c.end)]
        given = [x for x, end in zip(problem.span, (problem.start, problem.end), strict=True) if end.fixed]
        count, values = len(self.surfaces.switches), self.surfaces.values(curve, x)
        for condition, row in zip(self.surfaces.conditions[:count], values, strict=False):
            if self.surfaces.jumps(Contact(condition.index, 0.0, *problem.span)):
                found += _along_jump(condition.index, x, row)
        for condition, row in zip(self.bounds, values[count:], strict=True):
            for level in filter(math.isfinite, condition.bounds):
                at = (np.abs(row - level) <= AT_BOUND * max(1.0, abs(level))) & ~np.isin(x, given)
                stretches = (self._stretch(condition, x[[a, b]], curve) for a, b in runs(at))
                found += [Contact(condition.index, level, first, last) for first, last in stretches]
        return sorted(found, key=lambda c: c.start)

    def _stretch(self, condition: SideCondition, met: np.ndarray, curve: CurveOrSlope) -> tuple[float, float]:
        """Between which abscissae a curve is at a bound that a polygon has ``met`` at vertices between two of them.

        Where that is shorter than pieces are, the polygon's slopes on either side are those of the bound at the ends.
        """
        unit = self.problem.span[1] - self.problem.span[0]
        beside, middle = unit / PIECES_ENOUGH, 0.5 * float(met.sum())
        if met[1] - met[0] > beside or np.isin(met, self.problem.span).any():
            return float(met[0]), float(met[1])
        at = np.array([max(met[0] - beside, self.problem.span[0]), middle, min(met[1] + beside, self.problem.span[1])])
        slopes = np.diff(curve(at, 0)[0]) / np.diff(at)
        turn = float(np.sign(slopes[1] - slopes[0]))
        before, after = (
            self._followed(condition, middle, side * beside, float(slope), turn)
            for side, slope in zip((-1.0, 1.0), slopes, strict=True)
        )
        return middle - before, middle + after

    def _followed(self, condition: SideCondition, x: float, most: float, slope: float, turn: float) -> float:
        """How far from x, ``most`` at most, a bound has come to the ``slope`` with which a curve leaves it.

        That is nowhere where the slope jumps to what is beyond that in x itself, about which the curve turns.
        """
        s = self.problem.symbols
        rate = -ca.gradient(condition.expression, s.x) / ca.gradient(condition.expression, s.y)
        apart = ca.Function("apart", s.all, [rate - slope])
        far = np.geomspace(NEAREST_TO_TIP, 1.0, PLACES_NEAR)
        for _ in range(TIMES_NEARER):
            at = x + most * far
            values = np.asarray(apart(*self._columns(at, np.zeros_like(at)))).ravel()
            changes = np.flatnonzero(values[:-1] * values[1:] <= 0)
            if not len(changes) or (far[0] == NEAREST_TO_TIP and values[0] * most * turn > 0):
                return 0.0
            far = np.linspace(far[changes[0]], far[changes[0] + 1], PLACES_NEAR)
        return abs(most) * float(far[0])


def _drawn_about(ordinates: np.ndarray, span: tuple[float, float]) -> tuple[float, float]:
    """The middle of ordinates, and how far beyond it levels go."""
    low, high = float(ordinates.min()), float(ordinates.max())
    return 0.5 * (low + high), (high - low) or span[1] - span[0]


def _along_jump(index: int, x: np.ndarray, argument: np.ndarray) -> Iterator[Contact]:
    """Where vertices lie along a jump, on either side of it, by its ``argument`` (m,) there."""
    size = float(np.abs(argument).max())
    for first, last in runs(np.abs(argument) <= BESIDE_JUMP * size):
        if last - first >= LEAST_RUN:
            side = float(np.sign(argument[(first + last) // 2]))
            yield Contact(index, side * ASIDE_OF_JUMP * size, float(x[first]), float(x[last]))


def _are_tips(upper: np.ndarray) -> np.ndarray:
    """Which vertices, but for the first and the last, have an upper bound that is no less at either neighbour."""
    before, inner, after = upper[:-2], upper[1:-1], upper[2:]
    level = (inner == before) & (inner == after)
    return np.isfinite(inner) & (inner <= before) & (inner <= after) & ~level
