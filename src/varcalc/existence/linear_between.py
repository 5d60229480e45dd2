"""Minima of L that is linear in the slope but for a kink, as where total variation is weighed against a fit to data.

Where such a curve moves Euler and Lagrange's equation holds no second derivative: it says where the curve is. Elsewhere
the kink holds it on a line, until that comes to such a curve again; what presses it along the line is what its momentum
changes by. (For sums of y'^2 that is Rudin, Osher and Fatemi, Physica D 60, 1992.) Which lines there are is seen by a
dynamic programme over all ordinates of a lattice, in which from one abscissa to the next only the nearest ordinates
matter, as ways in between add up (Felzenszwalb and Huttenlocher, Theory of Computing 8, 2012, sect. 2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.optimize import root

from varcalc.existence.directions import CurveOrSlope, polygonal
from varcalc.existence.rests import with_rests
from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import breaks, on_curve
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Status, Verdict, no_answer, refused
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import Switch, held
from varcalc.symbolic.tracing import Expression

PATH_PIECES, PATH_LEVELS, DRAWN_CLOSER = 256, 513, 3
"""Abscissae and ordinates of the lattice, and times that it is drawn closer about the least curve."""
PATH_MARGIN, WIDENED_BY, TIMES_WIDENED = 0.1, 3.0, 12
"""How far it reaches beyond what it is drawn about, in units of that; by what, and how often, it is widened."""
RESTING, OFF_EQUATION = 1.5, 4.0
"""How far off its equation a curve is, in units of the levels, from which on it is at rest, and is at a jump for sure.

One that moves goes from one level to the next.
"""
SEAMS_AT_ONCE = 16
"""Ordinates at once at which it is tried where a closed curve begins."""
SHORTEST_REST = 2
"""Pieces of the lattice that a rest is longer than."""
PIECES_OF_LINE, POINTS_OF_LINE = 16, 12
"""Pieces of a line, and Gauss points on each, by which it is summed what presses it."""
MOST_PARTS = 4
"""Parts at most of what looks like one rest."""
PLACES_ALONG, BEYOND_KINK = 1025, 1e-4
"""Places of a rest at which its momentum is looked at, and by what part of the kink's it may be beyond that."""
REST_PLACED = 1e-9
"""What the equations of a line may be missed by, in units of their own terms."""


def least_by_lines(problem: Problem, method: Ritz, tol: float) -> Solution | None:
    """The least curve where L is linear in the slope but for one kink; None for others, and where none counts."""
    kink = _kink(problem)
    if kink is None:
        return None
    with np.errstate(all="ignore"):
        path = _least_path(kink)
        lines = [] if path is None else [placed for line in path.lines() for placed in kink.placed(line)]
    if path is None:
        return None
    if (jump := path.jump()) is not None:
        return refused(no_answer(problem, method, Status.REFUSED, ""), jump)
    found = [Crossing(kink.switch, line.start, until=line.end) for line in lines]
    return with_rests(problem, method, tol, path.curve, sorted(found, key=lambda c: c.x))


@dataclass(frozen=True)
class _Rest:
    """A rest between two abscissae, at y - slope x = ``level``, to which the curve comes from a side and leaves to one.

    A side is 1 where the slope is greater than the kink's, -1 where it is less, and 0 at an end of the interval.
    """

    start: float
    end: float
    level: float
    sides: tuple[int, int]


class _KinkedBetween:
    """The kink of such an L, at one ``slope``, and what L is on its sides, the lower and the upper."""

    def __init__(self, problem: Problem, switch: Switch, slope: float) -> None:
        self.problem, self.switch, self.slope = problem, switch, slope
        s, x = problem.symbols, 0.5 * sum(problem.span)
        y = formulate(problem).start.curve(np.array([x]))[:, 0]
        none, numbers = np.zeros(0), problem.parameter_values
        beside = [[np.array([x]), y, np.array([slope + side]), none, numbers, none] for side in (-1.0, 1.0)]
        moving = ca.vertcat(s.y, s.dy)
        self._pieces = [held([problem.sign * problem.integrand], s.all, at, moving)[0] for at in beside]

    @property
    def places(self) -> bool:
        """Whether L is linear in the slope on both sides, and what is missed of its equation there says where y is."""
        dy, y = self.problem.symbols.dy, self.problem.symbols.y
        momenta = [ca.gradient(piece, dy) for piece in self._pieces]
        told = ca.vertcat(*map(self._missed, self._pieces, momenta))
        return bool(ca.depends_on(told, y)) and not any(ca.depends_on(momentum, dy) for momentum in momenta)

    def _missed(self, piece: Expression, momentum: Expression) -> Expression:
        """What is missed of Euler and Lagrange's equation by a curve of any slope, where L is a ``piece``."""
        s = self.problem.symbols
        return ca.gradient(piece, s.y) - ca.gradient(momentum, s.x) - ca.gradient(momentum, s.y) * s.dy

    @cached_property
    def _stated(self) -> tuple[PointEvaluator, PointEvaluator]:
        """At (x, y): L and its momenta on both sides; these, what they miss of their equations, what presses a line."""
        s = self.problem.symbols
        momenta = [ca.gradient(piece, s.dy) for piece in self._pieces]
        missed = list(map(self._missed, self._pieces, momenta))
        rates = [ca.gradient(r, s.y) for r in missed]
        stated = [self._pieces[0], *momenta], [*momenta, *missed, *rates, ca.gradient(self._pieces[0], s.y)]
        known = [s.dy, s.parameters], [ca.SX(self.slope), ca.SX(self.problem.parameter_values)]
        first, second = (
            PointEvaluator(ca.Function("on_lines", [s.x, s.y], ca.substitute([ca.densify(ca.vertcat(*each))], *known)))
            for each in stated
        )
        return first, second

    def summed(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """L on lines of its slope through points (m,), and its momenta beside that, below and above: (3, m)."""
        return self._stated[0](len(x), self._around(x)[:, None], y[:, None]).T

    def along(self, x: np.ndarray, level: float | np.ndarray) -> np.ndarray:
        """Its momenta along a line, what is missed of their equations and its rates, and what presses it: (7, m)."""
        y = np.broadcast_to(level + self.slope * x, x.shape)
        return self._stated[1](len(x), self._around(x)[:, None], y[:, None]).T

    def _around(self, x: np.ndarray) -> np.ndarray:
        """Abscissae in the interval: before the start of a closed curve it is at its end."""
        first, last = self.problem.span
        return np.where(x < first, x + (last - first), x) if self.problem.start.periodic else x

    def placed(self, line: _Rest, parts: int = MOST_PARTS) -> Iterator[_Rest]:
        """A rest that ends where it comes to curves that move, and is pressed as it should be; none where none is near.

        One along which the momentum would be more than the kink takes is at most so many ``parts``, and one that begins
        before the start of a closed curve is two.
        """
        first, last = self.problem.span
        rest = line if line.sides == (0, 0) else self._solved(line)
        if rest is None:
            return
        if parts > 1 and (place := self._beyond(rest)) is not None:
            x, side = place
            yield from self.placed(replace(rest, end=x, sides=(rest.sides[0], side)), parts - 1)
            yield from self.placed(replace(rest, start=x, sides=(side, rest.sides[1])), parts - 1)
        elif rest.start < first and self.problem.start.periodic:
            yield replace(rest, start=first)
            yield replace(rest, start=rest.start + (last - first), end=last)
        else:
            yield rest

    def _solved(self, line: _Rest) -> _Rest | None:
        """The rest that begins and ends where the equations say, begun from a ``line``; None where it has no length."""
        given = [end.fixed for end in (self.problem.start, self.problem.end)]
        x, weights = composite_gauss(np.linspace(0.0, 1.0, PIECES_OF_LINE + 1), POINTS_OF_LINE)

        def missed(z: np.ndarray) -> list[float]:
            a, b, level = z
            ends = self.along(np.array([a, b]), level)
            momenta = [ends[int(side > 0), k] if side else 0.0 for k, side in enumerate(line.sides)]
            turned = momenta[1] - momenta[0] - (b - a) * float(self.along(a + (b - a) * x, level)[6] @ weights)
            out = [
                ends[2 + int(side > 0), k] if side else z[k] - edge
                for k, (side, edge) in enumerate(zip(line.sides, (line.start, line.end), strict=True))
            ]
            held = any(given[k] and not side for k, side in enumerate(line.sides))
            return [*out, level - line.level if held else turned]

        found = root(missed, [line.start, line.end, line.level], tol=REST_PLACED)
        rest = replace(line, start=found.x[0], end=found.x[1], level=found.x[2]) if found.success else line
        return rest if rest.start < rest.end else None

    def _beyond(self, rest: _Rest) -> tuple[float, int] | None:
        """Where the momentum along a rest is furthest beyond what the kink takes, and on which side; else None."""
        if not any(rest.sides):
            return None
        x = np.linspace(rest.start, rest.end, PLACES_ALONG)
        along = self.along(x, rest.level)
        momenta = np.append(0.0, np.cumsum(0.5 * (along[6, 1:] + along[6, :-1]) * np.diff(x)))
        known = 0 if rest.sides[0] else -1
        momenta += along[int(rest.sides[known] > 0), known] - momenta[known]
        over = np.array([along[0] - momenta, momenta - along[1]])
        side, at = np.unravel_index(int(np.argmax(over)), over.shape)
        beyond = over[side, at] > BEYOND_KINK * float((along[1] - along[0]).max())
        return (float(x[at]), 2 * int(side) - 1) if beyond else None


@dataclass(frozen=True)
class _LeastPath:
    """The least way over the levels (k,) of a lattice, by which of them it has at the abscissae (m,)."""

    kink: _KinkedBetween
    x: np.ndarray
    levels: np.ndarray
    chosen: np.ndarray
    value: float

    @property
    def curve(self) -> CurveOrSlope:
        """The polygon that it is."""
        return polygonal(self.x, (self.levels[self.chosen] + self.kink.slope * self.x)[None])

    def jump(self) -> Finding | None:
        """What is found where it leaves a level at once for another that a curve which moves would come to later."""
        rises = np.diff(self.chosen)
        for piece in np.flatnonzero(np.abs(rises) > OFF_EQUATION).tolist():
            if self._at_given_end(piece) if piece in (0, len(rises) - 1) else self._across(piece):
                step, sign = self.levels[1] - self.levels[0], self.kink.problem.sign
                value = sign * (self.value - self._at_end_alone(piece))
                sentence = (
                    f"the {'infimum' if sign > 0 else 'supremum'} is not attained: graphs that are ever steeper near "
                    f"x = {self.x[piece + (piece > 0)]:.6g}, where the best curve jumps by about "
                    f"{rises[piece] * step:.3g}, come as near as one likes to about {value:.3g}"
                )
                return Finding(Verdict.NOT_ATTAINED, sentence, {"limit": value})
        return None

    def _at_given_end(self, piece: int) -> bool:
        """Whether it begins or ends on the side of a curve which moves that it goes to: else it rests for a moment."""
        at, end, way = (0, self.kink.problem.start, 1) if piece == 0 else (-1, self.kink.problem.end, -1)
        rise = way * (self.chosen[piece + 1] - self.chosen[piece])
        side, step = int(way * rise > 0), self.levels[1] - self.levels[0]
        along = self.kink.along(self.x[[at]], self.levels[self.chosen[at]])[:, 0]
        return end.fixed and -math.copysign(1.0, rise) * along[2 + side] > OFF_EQUATION * step * abs(along[4 + side])

    def _at_end_alone(self, piece: int) -> float:
        """What is summed of L at a given end that the path leaves at once, where a jump has no width."""
        if 0 < piece < len(self.x) - 2:
            return 0.0
        at = 0 if piece == 0 else -1
        ordinates = self.levels[self.chosen[[piece, piece + 1]]] + self.kink.slope * self.x[at]
        there, beside = self.kink.summed(np.repeat(self.x[at], 2), ordinates)[0][:: 1 if piece == 0 else -1]
        return float(0.5 * (self.x[1] - self.x[0]) * (there - beside))

    def _across(self, piece: int) -> bool:
        """Whether it leads across a hill, or L changes there: elsewhere a jump pays nowhere but at a given end."""
        if any(self.x[piece] <= place <= self.x[piece + 1] for place in breaks(self.kink.problem)):
            before, rise, after = np.abs(np.diff(self.chosen[piece - 1 : piece + 3]))
            return bool(rise > OFF_EQUATION + 2 * max(before, after))  # what moves there moves beside it as well
        first, last = self.chosen[piece : piece + 2]
        middle = np.full(abs(last - first) + 1, 0.5 * (self.x[piece] + self.x[piece + 1]))
        along = self.kink.along(middle, self.levels[min(first, last) : max(first, last) + 1])
        return bool((along[4 + int(last > first)] < 0.0).any())

    def lines(self) -> Iterator[_Rest]:
        """The rests that the path shows: where it keeps a level at which no curve that moves would be.

        That of a closed curve which goes on past the end begins before the start.
        """
        moves = np.diff(self.chosen)
        edges = np.flatnonzero(moves).tolist()
        sides = [0, *(int(np.sign(m)) for m in moves[edges]), 0]
        runs = list(zip(self.x[[0, *(e + 1 for e in edges)]], self.x[[*edges, -1]], pairwise(sides), strict=True))
        if self.kink.problem.start.periodic and len(runs) > 1:
            (_, end, after), (start, last, before) = runs[0], runs.pop()
            runs[0] = start - (last - self.x[0]), end, (before[0], after[1])
        step, piece, problem = self.levels[1] - self.levels[0], self.x[1] - self.x[0], self.kink.problem
        free = [not (end.fixed or end.periodic) for end in (problem.start, problem.end)]
        for start, end, sides in runs:
            level = self.levels[self.chosen[np.searchsorted(self.x, end)]]
            # the momentum changes its sign, or comes to zero at a free end
            turns = sides[0] * sides[1] < 0 or any(f and not side for f, side in zip(free, sides, strict=True))
            at = self.kink.along(np.linspace(start, end, PIECES_OF_LINE + 1), level)
            # to go on as it came the momentum falls and rises again, or the other way round
            far = RESTING * step * np.abs(at[4:6])
            above, below = ((way * at[2:4] > far).all(axis=0).any() for way in (1.0, -1.0))
            off = (above and below) if sides[0] == sides[1] else (above or below)
            if turns or (off and end - start > SHORTEST_REST * piece):
                longer = 0.5 * max(piece - (end - start), 0.0)
                yield _Rest(start - longer * abs(sides[0]), end + longer * abs(sides[1]), float(level), sides)


def _least_path(kink: _KinkedBetween) -> _LeastPath | None:
    """The least path over a lattice that is drawn close about it; None where it leads out of all of them."""
    form = formulate(kink.problem)
    x = np.linspace(*kink.problem.span, PATH_PIECES + 1)
    u = form.start.curve(x)[0] - kink.slope * x
    half, closer = 0.5 * np.ptp(u) + height(form), 0
    for _ in range(TIMES_WIDENED):
        path = _over(kink, x, 0.5 * (u.max() + u.min()) + half * np.linspace(-1.0, 1.0, PATH_LEVELS))
        if path is None:
            return None
        inside = path.chosen.min() > 1 and path.chosen.max() < PATH_LEVELS - 2
        if inside and closer == DRAWN_CLOSER:
            return path
        closer = closer + 1 if inside else 0
        u = path.levels[path.chosen]
        half = 0.5 * np.ptp(u) + (PATH_MARGIN if inside else WIDENED_BY) * half
    return None


def _over(kink: _KinkedBetween, x: np.ndarray, levels: np.ndarray) -> _LeastPath | None:
    """The least path over ``levels`` at abscissae x; None where L is no number there, or its kink points up."""
    widths, problem = np.diff(x), kink.problem
    weights = 0.5 * (np.append(widths, 0.0) + np.append(0.0, widths))
    costs = weights[:, None] * _on_lattice(kink, x, levels)[0]
    falls, rises = _on_lattice(kink, x[:-1] + 0.5 * widths, levels)[1:3]
    if not np.isfinite(costs).all() or not (rises >= falls).all():
        return None
    # what it costs to come to each level from below, and from above
    ways = [
        np.hstack([np.zeros((len(v), 1)), np.cumsum(0.5 * (v[:, 1:] + v[:, :-1]) * np.diff(levels), axis=1)])
        for v in (rises, falls)
    ]
    if not problem.start.periodic:
        given = [float(end.values(1)[0]) for end in (problem.start, problem.end)]
        ends = [_given(kink, y, at, levels)[None] for y, at in zip(given, problem.span, strict=True)]
        return _LeastPath(kink, x, levels, *_chosen(costs, ways, *ends))
    best, apart, chosen, value = len(levels) // 2, (len(levels) - 1) // SEAMS_AT_ONCE, np.zeros(0), math.inf
    while apart:
        seams = np.unique(
            np.clip(best + apart * np.arange(-(SEAMS_AT_ONCE // 2), SEAMS_AT_ONCE // 2 + 1), 0, len(levels) - 1)
        )
        starts = np.where(np.arange(len(levels)) == seams[:, None], 0.0, math.inf)
        ends = np.array([_given(kink, levels[seam] + kink.slope * x[0], x[-1], levels) for seam in seams])
        chosen, value = _chosen(costs, ways, starts, ends)
        best, apart = int(chosen[0]), apart // (SEAMS_AT_ONCE // 4)
    return _LeastPath(kink, x, levels, chosen, value)


def _chosen(
    costs: np.ndarray, ways: Sequence[np.ndarray], start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, float]:
    """The least of all paths (m,) and its value; ``start`` and ``end`` (paths, k) are what levels cost there."""
    numbers = np.arange(costs.shape[1])
    least, came = start + costs[0], list[np.ndarray]()
    for up, down, cost in zip(*ways, costs[1:], strict=True):
        below, from_below = _least_before(least - up, numbers)
        above, from_above = (v[:, ::-1] for v in _least_before((least - down)[:, ::-1], numbers[::-1]))
        upwards, downwards = below + up, above + down
        came.append(np.where(upwards <= downwards, from_below, from_above))
        least = np.minimum(upwards, downwards) + cost
    path, level = np.unravel_index(int(np.argmin(least + end)), least.shape)
    chosen = [int(level)]
    for before in reversed(came):
        chosen.append(int(before[path, chosen[-1]]))
    return np.array(chosen[::-1]), float((least + end).min())


def _on_lattice(kink: _KinkedBetween, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """L and its momenta on a lattice, (3, m, k)."""
    places, on = (v.ravel() for v in np.meshgrid(x, levels, indexing="ij"))
    return kink.summed(places, on + kink.slope * places).reshape(-1, len(x), len(levels))


def _least_before(values: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least of all values (paths, k) up to each, and its number."""
    least = np.minimum.accumulate(values, axis=1)
    new = np.hstack([np.ones((len(values), 1), dtype=bool), values[:, 1:] < least[:, :-1]])
    return least, numbers[np.maximum.accumulate(np.where(new, np.arange(values.shape[1]), 0), axis=1)]


def _given(kink: _KinkedBetween, y: float, x: float, levels: np.ndarray) -> np.ndarray:
    """What the levels (k,) cost at an end: of those where an ordinate is given the nearest, if one is, is free."""
    if math.isnan(y):
        return np.zeros(len(levels))
    off = np.abs(levels - (y - kink.slope * x))
    nearest = (np.arange(len(levels)) == np.argmin(off)) & (off <= levels[1] - levels[0])
    return np.where(nearest, 0.0, math.inf)


def _kink(problem: Problem) -> _KinkedBetween | None:
    """The kink of a graph of one function, at a known slope, where L is linear in that on both sides; else None."""
    s, switches = problem.symbols, on_curve(problem)
    graph = problem.n == problem.order == 1 and s.kind is ca.SX and not (problem.unknowns or problem.constraints)
    if not graph or problem.end_cost is not None or len(switches) != 1 or any(problem.slides):
        return None
    switch = switches[0]
    rate = ca.gradient(switch.argument, s.dy)
    level = ca.substitute(switch.argument, s.dy, 0.0)
    moving = ca.vertcat(s.x, s.y, s.dy)
    if switch.jumps or switch.stepped or switch.smooth or ca.depends_on(ca.vertcat(rate, level), moving):
        return None
    numbers = ca.Function("kink", [s.parameters], [switch.levels[0] - level, rate])
    away, per_slope = (float(v) for v in numbers(problem.parameter_values))
    if len(switch.levels) > 1 or per_slope == 0.0:
        return None
    kink = _KinkedBetween(problem, switch, away / per_slope)
    return kink if kink.places else None
