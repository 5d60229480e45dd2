"""Whether another valley of a functional is lower: the polygons of a whole lattice at once.

Over a lattice of abscissae and departures from a known curve, the least polygon through each node is found by dynamic
programming (Bellman, "Dynamic Programming", 1957, ch. 9), forward and backward in a few operations on arrays. Where
the least polygons through the nodes of one abscissa have more than one minimum there is more than one valley. Each is
followed to its bottom by the direct method, and what that ends in counts by its own value, not by the lattice's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice

import casadi as ca
import numpy as np

from varcalc.existence.broken_curve import with_rival
from varcalc.existence.falling import Fall, falls_along
from varcalc.formulation import Sampled
from varcalc.methods.answer import composite_gauss
from varcalc.methods.ritz.method import Ritz
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import PROVED, Solution

PIECES = 10
"""Pieces of the polygons."""
UNITS = 2.0 ** np.arange(-18, 7)
"""Shifts of the whole curve at which its functional is measured, in units of the larger of its extent and interval."""
LEAST_UNIT = 0.02
"""The least unit, in extents, where there are larger ones."""
TURN_NOISE = 1e-7
"""Change of that, relative to what is summed, that is none."""
NEAR = np.array([1 / 16, *np.arange(1, 9) / 4.0])
"""Departures of the nodes, either way, in the problem's own unit."""
FAR, OUTWARD, REACH = 9, 1.5, 1000.0
"""How many there are further out, by what factor the first of them, and how many extents the last at least."""
STEEPER = 0.1
"""Change of the slope, in units of the problem's and of its own, over which a second derivative is taken."""
CONCAVE = -1e-7
"""Second derivative of L in the slope, relative to L, that is one and not round-off."""
WORTH_FOLLOWING = 0.5
"""How far above the known curve's polygon a valley may lie to be followed, in units of what that one sums."""
MOST_NODES = 16
"""Minima among the nodes from which valleys are read, the lowest first."""
FAR_LOWER = 0.5
"""How far below the chord a polygon lies that is worth starting from, in units of what the chord sums."""
FOLLOWED = 3
"""Valleys that are followed from one curve."""
DESCENTS = 4
"""Times that a lower curve is looked around in its turn."""
LOWER = 1e-9
"""Relative difference of two values that is one."""
SURELY_LOWER = 1e-3
"""The same for a polygon's value, of which no error is known."""
BETWEEN = np.array([0.25, 0.5, 0.75])[:, None]
"""Where on the way from one polygon to another a ridge is looked for."""
NO_RIDGE = 1e-12
"""Height of a ridge, relative to what is summed, that is round-off."""
POLYGON_RULES = (16, 24)
"""Gauss points a piece of two rules by which a polygon's value is told."""

ROUGH, EXACT = Ritz(elements=8, degree=3, refine=False, starts=1), Ritz(starts=1)
"""The direct method, to see whether a valley may be lower, and to its bottom."""
STEP_PIECES, AT_REST = 4, 0.2
"""Pieces on which a curve makes its step, and the share of its rises that it makes on all others, at rest there."""
FINE = Ritz(elements=64, starts=1)
"""The same from a curve that is steep in one place."""
ROUGHLY = 0.05
"""How far above the known value a rough one may be, in units of what is summed, for the valley to be lower."""

Polish = Callable[[Ritz, Sampled], Solution]
"""The answer of the direct method from a curve to start from."""


@dataclass(frozen=True)
class Valley:
    """A least polygon through some node: vertices ``x`` and ``y``, its value on the lattice; ``edge``: it leaves it."""

    x: np.ndarray
    y: np.ndarray
    value: float
    edge: bool

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Ordinates (1, m) at x (m,)."""
        return np.interp(x, self.x, self.y)[None]


class PolygonLattice:
    """Polygons about a curve: K pieces, and at each of the vertices J departures, the middle one 0."""

    def __init__(
        self, problem: Problem, ordinates: Callable[[np.ndarray], np.ndarray], unit: float | None = None
    ) -> None:
        self.problem = problem
        a, b = problem.span
        self.x = np.linspace(a, b, PIECES + 1)
        self.c = ordinates(self.x)
        self.steps = np.diff(self.x)
        self.middle, self.centre = 0.5 * (self.x[1:] + self.x[:-1]), 0.5 * (self.c[1:] + self.c[:-1])
        self.slope = np.diff(self.c) / self.steps
        extent = max(float(np.ptp(self.c)), b - a)
        unit = unit or self._unit(extent)
        self.steep = extent / (b - a)
        last = unit * NEAR[-1]
        # each further out than the last by a factor, and the factor grows
        far = math.log(max(REACH * extent / last, OUTWARD**FAR)) - FAR * math.log(OUTWARD)
        growing = np.exp(far / (FAR * (FAR - 1) / 2) * np.arange(FAR))
        side = np.concatenate([unit * NEAR, last * np.cumprod(OUTWARD * growing)])
        self.departures = np.concatenate([-side[::-1], [0.0], side])
        self.own = len(side)
        self.reach = float(side[-1])

    def _values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L as it is minimised, on arrays that broadcast."""
        shape = np.broadcast_shapes(x.shape, y.shape, v.shape)
        return np.broadcast_to(self.problem.sign * self.problem.integrand_on(x, y, v), shape)

    def _unit(self, extent: float) -> float:
        """A shift of the whole curve beyond which its functional turns; the ``extent`` where it does not."""
        shifts = extent * np.concatenate([-UNITS[::-1], [0.0], UNITS])
        values = self._values(self.middle[:, None], self.centre[:, None] + shifts, self.slope[:, None])
        sums = np.where(np.isfinite(values), values, np.inf).sum(0)
        noise = TURN_NOISE * float(np.abs(values[:, len(UNITS)]).sum())
        found: list[float] = []
        for side in (sums[len(UNITS) :], sums[len(UNITS) :: -1]):
            change = np.diff(side)
            told = np.flatnonzero(np.isfinite(change) & (np.abs(change) > noise))
            turns = told[1:][np.sign(change[told[1:]]) != np.sign(change[told[:-1]])]
            found += (extent * UNITS[turns - 1]).tolist()
        about = [unit for unit in found if unit >= LEAST_UNIT * extent]
        # turns at far smaller shifts alone are those of a problem whose ordinates have another unit than its abscissa
        return min(about) if about else max(found, default=extent)

    @cached_property
    def costs(self) -> np.ndarray:
        """What each piece adds that leads from one departure to another, (K, J, J), by the midpoint rule."""
        d, h = self.departures, self.steps[:, None, None]
        y = self.centre[:, None, None] + 0.5 * (d[:, None] + d)
        v = self.slope[:, None, None] + (d - d[:, None]) / h
        values = self._values(self.middle[:, None, None], y, v)
        return np.where(np.isfinite(values), values, np.inf) * h

    @cached_property
    def walls(self) -> np.ndarray:
        """The nodes (K + 1, J) at which L is concave in the slope: beyond them it is another functional."""
        v = np.gradient(self.c, self.x)[:, None]
        steps = STEEPER * np.maximum(self.steep, np.abs(v)) * np.arange(-1, 2)[:, None, None]
        left, own, right = self._values(self.x[:, None], self.c[:, None] + self.departures, v + steps)
        walls = ~(left - 2 * own + right >= CONCAVE * (np.abs(left) + 2 * np.abs(own) + np.abs(right)))
        walls[:, self.own] = False
        return walls

    def valleys(self) -> list[Valley]:
        """The least polygons through nodes at which a row has a minimum, but for the curve's own, the lowest first."""
        count, J = len(self.steps), len(self.departures)
        costs = np.where(self.walls[1:, None, :], np.inf, self.costs)
        forward, backward = np.full((2, count + 1, J), np.inf)
        forward[0, slice(None) if not self.problem.start.fixed else self.own] = 0.0
        backward[count, slice(None) if not self.problem.end.fixed else self.own] = 0.0
        for k in range(count):
            np.min(forward[k][:, None] + costs[k], axis=0, out=forward[k + 1])
        for k in range(count - 1, -1, -1):
            np.min(costs[k] + backward[k + 1], axis=1, out=backward[k])
        through = np.pad(forward + backward, ((0, 0), (1, 1)), constant_values=np.inf)
        inner = through[:, 1:-1]
        least = (inner <= through[:, :-2]) & (inner <= through[:, 2:]) & (inner < self.ceiling)
        least[:, self.own] = False
        paths: dict[tuple[int, ...], float] = {}
        nodes = np.argwhere(least)
        for k, j in nodes[np.argsort(inner[least], kind="stable")[:MOST_NODES]].tolist():
            path = [j]
            for i in range(k, 0, -1):
                path.insert(0, int(np.argmin(forward[i - 1] + costs[i - 1][:, path[0]])))
            for i in range(k, count):
                path.append(int(np.argmin(costs[i][path[-1]] + backward[i + 1])))
            paths[tuple(path)] = float(inner[k, j])
        return [self._valley(path, value) for path, value in sorted(paths.items(), key=lambda p: p[1])]

    def _valley(self, path: tuple[int, ...], value: float) -> Valley:
        numbers = np.array(path)
        edge = bool((np.abs(numbers - self.own) >= self.own - 1).any())
        return Valley(self.x, self.c + self.departures[numbers], value, edge)

    @property
    def own_costs(self) -> np.ndarray:
        """What the pieces of the curve's own polygon add, (K,)."""
        return self.costs[:, self.own, self.own]

    @property
    def summed(self) -> float:
        """The size of what the curve's own polygon sums."""
        return float(np.abs(self.own_costs).sum())

    @property
    def ceiling(self) -> float:
        """The value from which on a valley is not worth following."""
        return float(self.own_costs.sum()) + WORTH_FOLLOWING * self.summed

    def others(self) -> list[Valley]:
        """The lowest valleys beside the curve's own, as far as they may be lower."""
        return list(islice(filter(self.apart, self.valleys()), FOLLOWED))

    def fall(self, valley: Valley) -> Fall | None:
        """The line from the curve's polygon through a valley that leaves the lattice, where it leads down for ever."""
        if not valley.edge or not (self.problem.start.fixed and self.problem.end.fixed):
            return None
        return falls_along(self.problem, self.x, self.c, valley.y - self.c)

    def apart(self, valley: Valley) -> bool:
        """Whether a ridge lies between the curve's polygon and a valley, or nothing but a way down leads there."""
        away = valley.y - self.c
        shares = np.vstack([BETWEEN, [[0.0]], [[1.0]]])
        y = self.centre + shares * 0.5 * (away[1:] + away[:-1])
        sums = (self._values(self.middle, y, self.slope + shares * np.diff(away) / self.steps) * self.steps).sum(1)
        own, there = sums[-2], sums[-1]
        if not np.isfinite(sums).all():
            return True
        return bool(sums[:-2].max() > max(own, there) + NO_RIDGE * abs(own)) or (valley.edge and there < own)


def _ordinates(solution: Solution, x: np.ndarray) -> np.ndarray:
    """The curve at x (m,), straight between the points its method had, where x(s) would have to be inverted."""
    assert solution.curve is not None
    extremal = solution.extremal
    known = None if extremal is None else extremal.samples
    if extremal is None or known is None or not extremal.form.stated.is_lifted:
        return solution.curve(x, 0)[0]
    ends = [end.values(1)[0] for end in (solution.problem.start, solution.problem.end)]
    y = np.interp(x, known.x, known.y[0])
    for k, end in zip((0, -1), ends, strict=True):
        y[k] = y[k] if np.isnan(end) else end
    return y


def looked_around(solution: Solution, polish: Polish, *, followed: bool) -> Solution:
    """The solution, or a lower one; marked local where something lower is known of that is no solution.

    Where lower valleys are ``followed``, what ``polish`` finds in one is the answer; else it is only told of.
    """
    problem = solution.problem
    reason = _not_looked(problem)
    if reason:
        return replace(solution, searched=f"other valleys were not looked for: {reason}")
    if proved_jointly_convex(problem):
        return replace(solution, searched=f"{PROVED} in the curve and its slope: there is no other valley")
    assert isinstance(problem, Problem)
    best, number, reach = solution, 0, 0.0
    for _ in range(DESCENTS):
        with np.errstate(all="ignore"):
            lattice = PolygonLattice(problem, partial(_ordinates, best))
            valleys = lattice.others()
        reach = lattice.reach
        lower = _lower(best, lattice, valleys, polish)
        number += len(valleys)
        if lower is None or not lower.status.ok or lower.local or not followed:
            return _told(best, lower, reach, number)
        best = replace(lower, method=solution.method)
    return _told(best, None, reach, number)


def least_polygons(problem: Functional) -> list[Valley]:
    """The least polygons about the chord, where they are far lower, to start from where the chord led nowhere."""
    if _not_looked(problem) or not (problem.start.fixed and problem.end.fixed):
        return []
    assert isinstance(problem, Problem)
    ends = [float(end.values(1)[0]) for end in (problem.start, problem.end)]
    levels = abs(ends[1] - ends[0]) / (PIECES * NEAR[1])  # so that polygons rest on the level of either end
    with np.errstate(all="ignore"):
        lattice = PolygonLattice(problem, lambda x: np.interp(x, problem.span, ends), levels)
        enough = float(lattice.own_costs.sum()) - FAR_LOWER * lattice.summed
        found = [valley for valley in lattice.valleys() if valley.value < enough][:FOLLOWED]
    return found if ca.depends_on(problem.integrand, problem.symbols.x) else list(map(_in_the_middle, found))


def _in_the_middle(valley: Valley) -> Valley:
    """The polygon with its pieces in an order in which what rises or falls most lies half way."""
    rises = np.diff(valley.y)
    size = np.abs(rises)
    if not size.any():
        return valley
    turned = np.roll(rises, round(0.5 * (len(rises) - 1) - float(size @ np.arange(len(rises)) / size.sum())))
    return replace(valley, y=valley.y[0] + np.concatenate([[0.0], np.cumsum(turned)]))


def _told(best: Solution, lower: Solution | None, reach: float, number: int) -> Solution:
    """The solution with what was looked at, and marked local where something ``lower`` is known."""
    nodes = 2 * (len(NEAR) + FAR) + 1
    looked = f"all polygons on a lattice of {PIECES} by {nodes} within {reach:.4g} of the curve were compared"
    valleys = "1 other valley" if number == 1 else f"{number} other valleys"
    looked += f", and {valleys} followed" if number else ", and showed no other valley"
    if lower is None:
        return replace(best, searched=looked)
    if lower.status.ok and not lower.local:  # another solution, which is told of
        kind = "maximum" if best.problem.maximise else "minimum"
        message = f"a local {kind} only: {lower.value:.12g} is reached in another valley"
        lower = replace(best, local=True, lower=lower.value, message=message)
    return replace(lower, searched=looked)


def _lower(best: Solution, lattice: PolygonLattice, valleys: list[Valley], polish: Polish) -> Solution | None:
    """A solution in a valley that is lower, the known one marked or refused for what is lower; None for neither."""
    rivalled = with_rival(best)  # a jump is no polygon, and its cost is known exactly
    if rivalled is not best:
        return rivalled
    sign = best.problem.sign
    if (fall := next(filter(None, map(lattice.fall, valleys)), None)) is not None:
        message = f"a local {'maximum' if sign < 0 else 'minimum'} only: {fall.finding.sentence}"
        return replace(best, local=True, lower=-sign * math.inf, message=message)
    for valley in valleys:
        rough = polish(ROUGH, valley)
        if rough.status.ok and sign * (rough.value - best.value) < ROUGHLY * lattice.summed:
            found = polish(EXACT, valley)
            if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
                return found
        value = _along(lattice.problem, valley)
        if _is_lower(value, best, 0.0, SURELY_LOWER):
            message = (
                f"a local {'maximum' if sign < 0 else 'minimum'} only: a polygon has the value {value:.6g}, and leads "
                "to no minimum that could be found"
            )
            return replace(best, local=True, message=message)  # its value says nothing of what is lowest there
    for start in _displaced(best, lattice):
        found = polish(FINE, start)
        if found.status.ok and _is_lower(found.value, best, found.error.value, 0.0):
            return found
    return None


def _displaced(best: Solution, lattice: PolygonLattice) -> Iterable[Sampled]:
    """Lower curves with their step elsewhere, where most of the way the curve rests."""
    rises = np.sort(np.abs(np.diff(lattice.c)))
    if rises[:-STEP_PIECES].sum() > AT_REST * rises.sum():
        return ()
    from varcalc.existence.displaced import displaced  # few curves come to this

    return displaced(best)


def _is_lower(value: float, best: Solution, error: float, share: float) -> bool:
    sign = best.problem.sign
    margin = error + best.error.value + share * max(abs(best.value), abs(value))
    return sign * value < sign * best.value - margin


def _along(problem: Problem, valley: Valley) -> float:
    """The functional along a polygon, infinitely bad where two rules differ."""
    sums = []
    for count in POLYGON_RULES:
        x, weights = composite_gauss(valley.x, count)
        slope = np.repeat(np.diff(valley.y) / np.diff(valley.x), count)
        sums.append(float(problem.integrand_values(x, valley(x), slope[None]) @ weights))
    settled = abs(sums[0] - sums[1]) <= SURELY_LOWER * abs(sums[1])
    return sums[1] if settled else problem.sign * math.inf


def has_lattice(problem: Functional) -> bool:
    """Whether other valleys of a problem can be looked for."""
    return not _not_looked(problem)


def _not_looked(problem: Functional) -> str:
    """Why there is no lattice for a problem; empty where there is one."""
    if not isinstance(problem, Problem):
        return "the curve is given by a parameter"
    reasons = {
        "a table is looked up": not problem.vectorised,
        f"there are {problem.n} unknown functions": problem.n > 1,
        "the functional is of second order": problem.order > 1,
        "there are constraints": bool(problem.constraints),
        "more than a curve is sought": bool(problem.unknowns),
        "the ends have a cost": problem.end_cost is not None,
        "an end is not at a given abscissa": any(e.slides or e.periodic for e in (problem.start, problem.end)),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
