"""Least polygons over a lattice of abscissae and ordinates: the valleys of a functional, by dynamic programming.

The least polygon through each node is found forward and backward in a few operations on arrays (Bellman, "Dynamic
Programming", 1957, ch. 9). Where the least polygons through the nodes of one abscissa have more than one minimum there
is more than one valley.

A lattice about a curve is fine near it and coarse far from it. Hills and wells have places and widths of their own:
along each of some vertical lines it is seen where L turns, and between these places the levels of another lattice lie
evenly, with the ones on which a resting curve is cheapest among them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.existence.falling import Fall, falls_along
from varcalc.problem.problem import Problem

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
MOST_PATHS = 16
"""Polygons that are read, the lowest first."""
BETWEEN = np.array([0.25, 0.5, 0.75])[:, None]
"""Where on the way from one polygon to another a ridge is looked for."""
FARTHEST = 1e12 * 10.0 ** -np.arange(0, 10, 3.0)
"""How far out an arch is tried at most, in extents, and less far where L is no number there."""
FALLEN = 1e3
"""How far below what the curve's own polygon sums it has to lie there."""
APART = 1.5
"""Levels by which two polygons differ somewhere that are in valleys of their own."""
NO_RIDGE = 1e-12
"""Height of a ridge, relative to what is summed, that is round-off."""
PIECES_ACROSS, LEVELS = 24, 64
"""Pieces of the polygons, and levels that lie evenly."""
DEPARTURES = 2.0 ** np.arange(-10, 6, 0.25)
"""Departures at which L is asked for its turns, either way, in units of the larger of the extent and the interval."""
NO_CHANGE = 1e-7
"""Change of L from one to the next, relative to its size there, that is none."""
NEAREST_TURNS = 8
"""Turns of a vertical line that are taken, the nearest ones: what is periodic has no end of them."""
LEVEL_MARGIN = 0.25
"""Share of their range by which the levels go beyond the turns."""
CLOSER_LEVELS = 8
"""Times as many levels at which the cheapest ones for a curve at rest are looked for."""


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


class Lattice:
    """Polygons through ``nodes`` (K + 1, J), ascending ordinates at the abscissae x; ``own`` are those of a curve."""

    def __init__(self, problem: Problem, x: np.ndarray, nodes: np.ndarray, own: np.ndarray, reach: float) -> None:
        self.problem, self.x, self.nodes, self.own, self.reach = problem, x, nodes, own, reach
        self.c = nodes[np.arange(len(x)), own]
        self.steps = np.diff(x)
        self.middle, self.centre = 0.5 * (x[1:] + x[:-1]), 0.5 * (self.c[1:] + self.c[:-1])
        self.slope = np.diff(self.c) / self.steps
        self.steep = max(float(np.ptp(self.c)), x[-1] - x[0]) / (x[-1] - x[0])

    @cached_property
    def costs(self) -> np.ndarray:
        """What each piece adds that leads from one node to another, (K, J, J), by the midpoint rule."""
        first, last, h = self.nodes[:-1, :, None], self.nodes[1:, None, :], self.steps[:, None, None]
        values = values_of(self.problem, self.middle[:, None, None], 0.5 * (first + last), (last - first) / h)
        return np.where(np.isfinite(values), values, np.inf) * h

    @cached_property
    def walls(self) -> np.ndarray:
        """The nodes (K + 1, J) at which L is concave in the slope: beyond them it is another functional."""
        v = np.gradient(self.c, self.x)[:, None]
        walls = concave_at(self.problem, self.x[:, None], self.nodes, v, self.steep)
        walls[np.arange(len(self.x)), self.own] = False
        return walls

    def valleys(self) -> list[Valley]:
        """The least polygons through nodes at which a row has a minimum, but for the curve's own, the lowest first."""
        count, J = len(self.steps), self.nodes.shape[1]
        costs = np.where(self.walls[1:, None, :], np.inf, self.costs)
        forward, backward = np.full((2, count + 1, J), np.inf)
        forward[0, slice(None) if not self.problem.start.fixed else self.own[0]] = 0.0
        backward[count, slice(None) if not self.problem.end.fixed else self.own[-1]] = 0.0
        for k in range(count):
            np.min(forward[k][:, None] + costs[k], axis=0, out=forward[k + 1])
        for k in range(count - 1, -1, -1):
            np.min(costs[k] + backward[k + 1], axis=1, out=backward[k])
        through = np.pad(forward + backward, ((0, 0), (1, 1)), constant_values=np.inf)
        inner = through[:, 1:-1]
        least = (inner <= through[:, :-2]) & (inner <= through[:, 2:]) & (inner < self.ceiling)
        least[np.arange(count + 1), self.own] = False
        paths: dict[tuple[int, ...], float] = {}
        passed: set[tuple[int, int]] = set()
        nodes = np.argwhere(least)
        for k, j in nodes[np.argsort(inner[least], kind="stable")].tolist():
            if (k, j) in passed:  # the least polygon through it is known
                continue
            path = [j]
            for i in range(k, 0, -1):
                path.insert(0, int(np.argmin(forward[i - 1] + costs[i - 1][:, path[0]])))
            for i in range(k, count):
                path.append(int(np.argmin(costs[i][path[-1]] + backward[i + 1])))
            paths[tuple(path)] = float(inner[k, j])
            passed |= set(enumerate(path))
            if len(paths) == MOST_PATHS:
                break
        return [self._valley(path, value) for path, value in sorted(paths.items(), key=lambda p: p[1])]

    def _valley(self, path: tuple[int, ...], value: float) -> Valley:
        numbers = np.array(path)
        edge = bool(((numbers <= 1) | (numbers >= self.nodes.shape[1] - 2)).any())
        return Valley(self.x, self.nodes[np.arange(len(self.x)), numbers], value, edge)

    @property
    def own_costs(self) -> np.ndarray:
        """What the pieces of the curve's own polygon add, (K,)."""
        return self.costs[np.arange(len(self.steps)), self.own[:-1], self.own[1:]]

    @property
    def summed(self) -> float:
        """The size of what the curve's own polygon sums."""
        return float(np.abs(self.own_costs).sum())

    @property
    def ceiling(self) -> float:
        """The value from which on a valley is not worth following."""
        return float(self.own_costs.sum()) + WORTH_FOLLOWING * self.summed

    def distinct(self) -> list[Valley]:
        """The lowest valleys of which none comes near another, or the curve's own polygon, all along."""
        room = APART * float(np.median(np.diff(self.nodes, axis=1)))
        kept, found = [self.c], []
        for valley in self.valleys():
            if all(np.abs(valley.y - y).max() > room for y in kept):
                kept.append(valley.y)
                found.append(valley)
        return found

    def fall(self, valley: Valley) -> Fall | None:
        """The line from the curve's polygon through a valley that leaves the lattice, where it leads down for ever."""
        if not valley.edge or not (self.problem.start.fixed and self.problem.end.fixed):
            return None
        return falls_along(self.problem, self.x, self.c, valley.y - self.c)

    def fall_far_out(self) -> Fall | None:
        """The line from the curve's polygon over arches, where it leads down for ever, however late it begins to.

        Of v^2/2 - c y^3 that is beyond a distance of some 1/c. Where L is concave in the slope it is another
        functional.
        """
        if not (self.problem.start.fixed and self.problem.end.fixed):
            return None
        arch = np.sin(math.pi * (self.x - self.x[0]) / (self.x[-1] - self.x[0]))
        sizes = self.steep * (self.x[-1] - self.x[0]) * np.concatenate([FARTHEST, -FARTHEST])[:, None]
        curves = self.c + sizes * arch
        heights, slopes = 0.5 * (curves[:, 1:] + curves[:, :-1]), np.diff(curves) / self.steps
        sums = values_of(self.problem, self.middle, heights, slopes) @ self.steps
        deep = sums < float(self.own_costs.sum()) - FALLEN * self.summed
        for k in np.flatnonzero(deep).tolist():
            # of what is steep no curvature is told: it is looked at with the curve's own slopes as well
            about = (slopes[k], self.slope)
            if not any(concave_at(self.problem, self.middle, heights[k], v, self.steep).any() for v in about):
                return falls_along(self.problem, self.x, self.c, sizes[k] * arch)
        return None

    def apart(self, valley: Valley) -> bool:
        """Whether a ridge lies between the curve's polygon and a valley, or nothing but a way down leads there."""
        away = valley.y - self.c
        shares = np.vstack([BETWEEN, [[0.0]], [[1.0]]])
        y = self.centre + shares * 0.5 * (away[1:] + away[:-1])
        values = values_of(self.problem, self.middle, y, self.slope + shares * np.diff(away) / self.steps)
        sums = (values * self.steps).sum(1)
        own, there = sums[-2], sums[-1]
        if not np.isfinite(sums).all():
            return True
        return bool(sums[:-2].max() > max(own, there) + NO_RIDGE * abs(own)) or (valley.edge and there < own)


def values_of(problem: Problem, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
    """L as it is minimised, on arrays that broadcast."""
    shape = np.broadcast_shapes(x.shape, y.shape, v.shape)
    return np.broadcast_to(problem.sign * problem.integrand_on(x, y, v), shape)


def concave_at(problem: Problem, x: np.ndarray, y: np.ndarray, v: np.ndarray, steep: float) -> np.ndarray:
    """Where L is concave in the slope about v, or no number; ``steep`` is the problem's unit of slopes."""
    steps = STEEPER * np.maximum(steep, np.abs(v)) * np.arange(-1, 2).reshape(3, *np.ones(np.ndim(y), dtype=int))
    left, own, right = values_of(problem, x, y, v + steps)
    return ~(left - 2 * own + right >= CONCAVE * (np.abs(left) + 2 * np.abs(own) + np.abs(right)))


class PolygonLattice(Lattice):
    """Polygons about a curve: K pieces, and at each of the vertices J departures, the middle one 0."""

    def __init__(
        self, problem: Problem, ordinates: Callable[[np.ndarray], np.ndarray], unit: float | None = None
    ) -> None:
        a, b = problem.span
        x = np.linspace(a, b, PIECES + 1)
        c = ordinates(x)
        extent = max(float(np.ptp(c)), b - a)
        unit = unit or _unit(problem, x, c, extent)
        last = unit * NEAR[-1]
        # each further out than the last by a factor, and the factor grows
        far = math.log(max(REACH * extent / last, OUTWARD**FAR)) - FAR * math.log(OUTWARD)
        growing = np.exp(far / (FAR * (FAR - 1) / 2) * np.arange(FAR))
        side = np.concatenate([unit * NEAR, last * np.cumprod(OUTWARD * growing)])
        departures = np.concatenate([-side[::-1], [0.0], side])
        super().__init__(problem, x, c[:, None] + departures, np.full(len(x), len(side)), float(side[-1]))


def _unit(problem: Problem, x: np.ndarray, c: np.ndarray, extent: float) -> float:
    """A shift of the whole curve beyond which its functional turns; the ``extent`` where it does not."""
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / np.diff(x)
    shifts = extent * np.concatenate([-UNITS[::-1], [0.0], UNITS])
    values = values_of(problem, middle[:, None], centre[:, None] + shifts, slope[:, None])
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


def across_the_landscape(problem: Problem, ordinates: Callable[[np.ndarray], np.ndarray]) -> Lattice | None:
    """The lattice of levels, with the curve's own ordinates among them; None where L has no two minima in y."""
    x = np.linspace(*problem.span, PIECES_ACROSS + 1)
    c = ordinates(x)
    turns = _turns(problem, x, c)
    if turns is None:
        return None
    low, high = min(turns.min(), c.min()), max(turns.max(), c.max())
    room = LEVEL_MARGIN * (high - low)
    levels = np.linspace(low - room, high + room, LEVELS)
    levels = np.union1d(levels, _rests(problem, x, levels))
    nodes = np.column_stack([c, np.broadcast_to(levels, (len(x), len(levels)))])
    order = np.argsort(nodes, axis=1, kind="stable")
    return Lattice(problem, x, np.take_along_axis(nodes, order, 1), np.argmin(order, axis=1), float(high - low))


def _turns(problem: Problem, x: np.ndarray, c: np.ndarray) -> np.ndarray | None:
    """The ordinates at which L turns as y goes either way from the curve; None where no line has two minima."""
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / np.diff(x)
    unit = max(float(np.ptp(c)), float(np.ptp(x)))
    y = centre[:, None] + unit * np.concatenate([-DEPARTURES[::-1], [0.0], DEPARTURES])
    values = values_of(problem, middle[:, None], y, slope[:, None])
    change = np.diff(values)
    told = np.isfinite(change) & (np.abs(change) > NO_CHANGE * (np.abs(values[:, 1:]) + np.abs(values[:, :-1])))
    found: list[np.ndarray] = []
    several = False
    for row, at, rates in zip(told, y, change, strict=True):
        steps = np.flatnonzero(row)
        signs = np.sign(rates[steps])
        turning = np.flatnonzero(signs[1:] != signs[:-1])
        if not len(steps):
            continue
        # where a hill's foot is flat there is no turn, but it is as low as a minimum
        feet = (steps[0] > 0 and signs[0] > 0, steps[-1] < len(row) - 1 and signs[-1] < 0)
        several = several or int((signs[turning] < 0).sum()) + sum(feet) > 1
        nearest = np.argsort(np.abs(steps[turning] - len(DEPARTURES)), kind="stable")[:NEAREST_TURNS]
        found.append(at[steps[turning[nearest]] + 1])
    return np.concatenate(found) if several else None


def _rests(problem: Problem, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """The levels on which a curve at rest costs least among its neighbours, by a parabola through three."""
    y = np.linspace(levels[0], levels[-1], CLOSER_LEVELS * len(levels))
    values = values_of(problem, 0.5 * (x[1:] + x[:-1])[:, None], y, np.zeros(1)).sum(0)
    inner = values[1:-1]
    k = 1 + np.flatnonzero((inner < values[:-2]) & (inner <= values[2:]))
    before, here, after = values[k - 1], values[k], values[k + 1]
    return y[k] + 0.5 * (y[1] - y[0]) * (before - after) / (before - 2 * here + after)
