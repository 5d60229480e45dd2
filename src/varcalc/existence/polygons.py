"""Least polygons over a lattice of abscissae and ordinates: the valleys of a functional, by dynamic programming.

The least polygon through each node is found forward and backward in a few operations on arrays (Bellman, "Dynamic
Programming", 1957, ch. 9). Where the least polygons through the nodes of one abscissa have more than one minimum there
is more than one valley. Where the nodes lie, :mod:`varcalc.existence.levels` says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from varcalc.existence.falling import Fall, falls_along
from varcalc.formulation import Sampled
from varcalc.numerics.mesh import gauss
from varcalc.problem.breaks import on_curve
from varcalc.problem.problem import Problem

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
ROUNDED_BITS = 10
"""Binary digits to which a step of the lattice is divided in the polygons that are started from."""
RULES, FINEST_RULE, NEARLY_KNOWN = (1, 2, 4), 8, 0.02
"""Gauss points on a piece; those that are taken to know what a line sums, and to which part of that it has to be known.

What varies along the interval more than once or twice a piece misleads the midpoint rule.
"""
BESIDE_OWN = np.arange(-6, 7, 2)
"""Levels beside the curve's along which it is seen how many are needed."""
NO_RIDGE = 1e-12
"""Height of a ridge, relative to what is summed, that is round-off."""


class Landscape(Protocol):
    """A functional of first order of curves that one function describes, as it is minimised.

    ``span`` is the interval, ``sign`` -1 where it is maximised, ``held`` tells which ends are fixed, ``closed`` that
    they are one, ``approximate`` that the values are not the functional's own: they show valleys, no more. At the
    ``waypoints`` a curve is where the known one is.
    """

    span: tuple[float, float]
    sign: float
    held: tuple[bool, bool]
    closed: bool
    approximate: bool
    waypoints: tuple[float, ...]

    def values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L on arrays that broadcast."""
        ...

    def own_values(self, x: np.ndarray, weights: np.ndarray, y: np.ndarray, v: np.ndarray) -> bool:
        """Whether the values along one curve, at x (m,) with the weights of a rule, are the functional's own."""
        ...

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ordinates at the start (0) or the end (1) add."""
        ...

    def along(self, valley: Sampled) -> Sampled:
        """The curve of the problem that a function of x, which gives (1, m), stands for."""
        ...


class LandscapeWithUnit(Landscape, Protocol):
    """A landscape that has a unit of its own."""

    def extent(self, y: np.ndarray) -> float:
        """The unit in which departures from a curve with ordinates y (m,) are measured."""
        ...

    def beside_jumps(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """Ordinates (m,) just beside those at which L jumps, from y (m,) at x (m,)."""
        ...


class Graphs:
    """The landscape of the graphs of one function."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.span, self.sign = problem, problem.span, problem.sign
        self.held, self.closed = (problem.start.fixed, problem.end.fixed), False
        self.approximate, self.waypoints = False, ()

    def values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L as it is minimised, on arrays that broadcast."""
        return self.sign * self.problem.integrand_on(x, y, v)

    def own_values(self, x: np.ndarray, weights: np.ndarray, y: np.ndarray, v: np.ndarray) -> bool:  # noqa: ARG002
        """They are: there is no condition."""
        return True

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:  # noqa: ARG002  no end costs anything
        """Nothing."""
        return np.zeros(np.shape(y))

    def extent(self, y: np.ndarray) -> float:
        """The larger of the curve's extent and its interval."""
        return max(float(np.ptp(y)), self.span[1] - self.span[0])

    def beside_jumps(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """Ordinates (m,) just beside those at which L jumps."""
        if not on_curve(self.problem):
            return []
        from varcalc.methods.crossings import beside_jumps  # few problems need them

        return beside_jumps(self.problem, x, y)

    def along(self, valley: Sampled) -> Sampled:
        """The function itself."""
        return valley


@dataclass(frozen=True)
class Polygon:
    """The graph of one function through vertices; those that are equal have one hash."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Ordinates (1, m) at x (m,)."""
        return np.interp(x, self.x, self.y)[None]


@dataclass(frozen=True)
class Valley:
    """A least polygon through some node: vertices ``x`` and ``y``, its value on the lattice; ``edge``: it leaves it.

    Of n functions at once ``y`` is (K + 1, n), of one (K + 1,). The curve there is held by a mesh with the ``marks``.
    What lies ``apart`` by far less is one. Where slopes have bounds it may be as ``steep`` as curves can be.
    """

    x: np.ndarray
    y: np.ndarray
    value: float
    edge: bool
    marks: tuple[float, ...] = ()
    apart: float = 0.0
    steep: bool = False

    @property
    def start(self) -> Sampled:
        """What is started from: where it is known what lies apart, rounded, so that it is one beside curves that are.

        All methods end in one curve but for their errors.
        """
        if not self.apart > 0.0:
            return self
        unit = 2.0 ** (math.floor(math.log2(self.apart)) - ROUNDED_BITS)
        return Polygon(tuple(self.x.tolist()), tuple((unit * np.round(self.y / unit)).tolist()))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Ordinates (1, m), or (n, m), at x (m,)."""
        return np.array([np.interp(x, self.x, row) for row in np.atleast_2d(self.y.T)])


class Valleys(Protocol):
    """What polygons about a known curve show."""

    @property
    def landscape(self) -> Landscape:
        """What the polygons lie in."""
        ...

    @property
    def own_value(self) -> float:
        """The functional along the known curve's own polygon."""
        ...

    @property
    def summed(self) -> float:
        """The size of what that one sums."""
        ...

    def distinct(self) -> list[Valley]:
        """The lowest valleys of which none comes near another, or the curve's own polygon, all along."""
        ...


class Lattice:
    """Polygons through ``nodes`` (K + 1, J), ascending ordinates at the abscissae x; ``own`` are those of a curve.

    They are ``bounded`` where they lie no further apart than slopes lead that have bounds.
    """

    bounded = False

    def __init__(
        self, landscape: Landscape, x: np.ndarray, nodes: np.ndarray, own: np.ndarray, reach: float, steep: float
    ) -> None:
        self.landscape, self.x, self.nodes, self.own, self.reach, self.steep = landscape, x, nodes, own, reach, steep
        self.c = nodes[np.arange(len(x)), own]
        self.steps = np.diff(x)
        self.middle, self.slope = 0.5 * (x[1:] + x[:-1]), (np.diff(self.c, axis=0).T / self.steps).T

    @cached_property
    def costs(self) -> np.ndarray:
        """What each piece adds that leads from one node to another, (K, J, J)."""
        first, last, h = self.nodes[:-1, :, None], self.nodes[1:, None, :], self.steps[:, None, None]
        values = self._meant(self._rule, self.x[:-1, None, None], h, first, last)
        return np.where(np.isfinite(values), values, np.inf) * h

    @cached_property
    def _rule(self) -> int:
        """The Gauss points on a piece: the fewest by which what lines near the curve sum is nearly known, mostly.

        Where none do, as beside a singular end, they are as good as any.
        """
        beside = np.clip(self.own + BESIDE_OWN[:, None], 0, self.nodes.shape[1] - 1)
        lines = self.nodes[np.arange(len(self.x)), beside]
        known, room = self._along(FINEST_RULE, lines), self._known_nearly
        for points in RULES:
            missed = np.abs(self._along(points, lines) - known)
            missed = missed[np.isfinite(missed)]
            if not (len(missed) and np.median(missed) > room):
                return points
        return RULES[0]

    @cached_property
    def _known_nearly(self) -> float:
        """How nearly sums have to be known."""
        pieces = self._meant(FINEST_RULE, self.x[:-1], self.steps, self.c[:-1], self.c[1:])
        return NEARLY_KNOWN * float(np.abs(pieces) @ self.steps)

    @property
    def summable(self) -> bool:
        """Whether what the curve's own polygon sums is nearly known: at a singular end no rule tells it."""
        return abs(float(self._along(FINEST_RULE, self.c)) - float(self.own_costs.sum())) <= self._known_nearly

    def _along(self, points: int, curves: np.ndarray) -> np.ndarray:
        """What polygons through ``curves`` (..., K + 1) sum, by so many Gauss points a piece."""
        return self._meant(points, self.x[:-1], self.steps, curves[..., :-1], curves[..., 1:]) @ self.steps

    def _meant(self, points: int, x: np.ndarray, h: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """L on average along pieces that begin at x, ``h`` long, by so many Gauss points."""
        nodes, weights = gauss(points)
        slope = (last - first) / h
        share = 0.5 * (1 + nodes).reshape(-1, *np.ones(np.ndim(slope), dtype=int))
        values = values_of(self.landscape, x + share * h, first + share * (last - first), slope[None])
        return 0.5 * np.tensordot(weights, values, 1)

    @cached_property
    def walls(self) -> np.ndarray:
        """The nodes (K + 1, J) at which L is concave in the slope: beyond them it is another functional."""
        v = np.gradient(self.c, self.x)[:, None]
        walls = concave_at(self.landscape, self.x[:, None], self.nodes, v, self.steep)
        walls[np.isin(self.x, self.landscape.waypoints)] = True
        walls[np.arange(len(self.x)), self.own] = False
        return walls

    @property
    def walled(self) -> bool:
        """Whether there are walls where curves are admitted: L is concave there."""
        if not self.walls.any():
            return False
        v = np.gradient(self.c, self.x)[:, None]
        admitted = np.isfinite(values_of(self.landscape, self.x[:, None], self.nodes, v))
        return bool((self.walls & admitted)[~np.isin(self.x, self.landscape.waypoints)].any())

    def valleys(self) -> list[Valley]:
        """The least polygons through nodes at which a row has a minimum, but for the curve's own, the lowest first."""
        return self._valleys

    @cached_property
    def _valleys(self) -> list[Valley]:
        costs = np.where(self.walls[1:, None, :], np.inf, self.costs)
        paths = self._closed_paths(costs) if self.landscape.closed else self._paths(costs)
        return [self._valley(path, value) for path, value in sorted(paths.items(), key=lambda p: p[1])]

    def _paths(self, costs: np.ndarray) -> dict[tuple[int, ...], float]:
        """The numbers of the nodes of these polygons, and their values."""
        count, J = len(self.steps), self.nodes.shape[1]
        forward, backward = np.full((2, count + 1, J), np.inf)
        for side, row in enumerate((forward[0], backward[count])):
            own = self.own[-side]
            begun = own if self.landscape.held[side] else slice(None)
            row[begun] = self.landscape.at_end(side, self.nodes[-side])[begun]
        for k in range(count):
            np.min(forward[k][:, None] + costs[k], axis=0, out=forward[k + 1])
        for k in range(count - 1, -1, -1):
            np.min(costs[k] + backward[k + 1], axis=1, out=backward[k])
        through = forward + backward
        least = self.minima(through) & (through < self.ceiling)
        least[np.arange(count + 1), self.own] = False
        paths: dict[tuple[int, ...], float] = {}
        passed: set[tuple[int, int]] = set()
        nodes = np.argwhere(least)
        for k, j in nodes[np.argsort(through[least], kind="stable")].tolist():
            if (k, j) in passed:  # the least polygon through it is known
                continue
            path = [j]
            for i in range(k, 0, -1):
                path.insert(0, int(np.argmin(forward[i - 1] + costs[i - 1][:, path[0]])))
            for i in range(k, count):
                path.append(int(np.argmin(costs[i][path[-1]] + backward[i + 1])))
            paths[tuple(path)] = float(through[k, j])
            passed |= set(enumerate(path))
            if len(paths) == MOST_PATHS:
                break
        return paths

    def _closed_paths(self, costs: np.ndarray) -> dict[tuple[int, ...], float]:
        """The same of polygons that end where they began: the least one from each node of the first row."""
        J = self.nodes.shape[1]
        forward = [np.where(np.eye(J, dtype=bool), 0.0, np.inf)]
        for own in costs:
            forward.append((forward[-1][:, :, None] + own).min(axis=1))
        closed = forward[-1].diagonal()
        least = self.minima(closed) & (closed < self.ceiling)
        least[self.own[0]] = False
        paths: dict[tuple[int, ...], float] = {}
        for j in np.flatnonzero(least).tolist():
            path = [j]
            for i in range(len(costs) - 1, -1, -1):
                path.insert(0, int(np.argmin(forward[i][j] + costs[i][:, path[0]])))
            paths[tuple(path)] = float(closed[j])
        return paths

    def minima(self, values: np.ndarray) -> np.ndarray:
        """The nodes of a row, or of each of several, (..., J), at which nothing beside it is lower."""
        beside = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(1, 1)], constant_values=np.inf)
        return (values <= beside[..., :-2]) & (values <= beside[..., 2:])

    def _valley(self, path: tuple[int, ...], value: float) -> Valley:
        numbers = np.array(path)
        edge = bool(((numbers <= 1) | (numbers >= self.nodes.shape[1] - 2)).any())
        y = self.nodes[np.arange(len(self.x)), numbers]
        apart = float(np.median(np.diff(self.nodes, axis=1)))
        return Valley(self.x, y, value, edge, apart=apart, steep=self.bounded)

    @cached_property
    def own_costs(self) -> np.ndarray:
        """What the pieces of the curve's own polygon add, (K,)."""
        means = self._meant(self._rule, self.x[:-1], self.steps, self.c[:-1], self.c[1:])
        return np.where(np.isfinite(means), means, np.inf) * self.steps

    @property
    def summed(self) -> float:
        """The size of what the curve's own polygon sums."""
        return float(np.abs(self.own_costs).sum())

    @property
    def own_value(self) -> float:
        """The functional along the curve's own polygon."""
        return float(self.own_costs.sum()) + at_ends(self.landscape, self.c)

    @property
    def ceiling(self) -> float:
        """The value from which on a valley is not worth following."""
        return self.own_value + WORTH_FOLLOWING * self.summed

    @cached_property
    def room(self) -> np.ndarray | float:
        """The departure by which two polygons are in valleys of their own."""
        return APART * float(np.median(np.diff(self.nodes, axis=1)))

    def distinct(self, among: Sequence[Valley] | None = None) -> list[Valley]:
        """The lowest valleys, ``among`` some, of which none comes near another, or the own polygon, all along."""
        kept, found = [self.c], []
        for valley in self.valleys() if among is None else among:
            if all((np.abs(valley.y - y) > self.room).any() for y in kept):
                kept.append(valley.y)
                found.append(valley)
        return found

    def fall(self, valley: Valley) -> Fall | None:
        """The line from the curve's polygon through a valley that leaves the lattice, where it leads down for ever."""
        return falls_along(self.landscape, self.x, self.c, valley.y - self.c) if valley.edge else None

    def fall_far_out(self) -> Fall | None:
        """The line from the curve's polygon over arches, where it leads down for ever, however late it begins to.

        Of v^2/2 - c y^3 that is beyond a distance of some 1/c. Where L is concave in the slope it is another
        functional. Free ends are moved as well.
        """
        share = (self.x - self.x[0]) / (self.x[-1] - self.x[0])
        shapes = [np.sin(math.pi * share)]
        if not self.landscape.closed:
            free = not self.landscape.held[0], not self.landscape.held[1]
            shapes += [shape for shape, moves in zip((1 - share, share), free, strict=True) if moves]
        sizes = self.steep * (self.x[-1] - self.x[0]) * np.concatenate([FARTHEST, -FARTHEST])
        away = (np.array(shapes)[:, None] * sizes[:, None]).reshape(-1, len(share))
        curves = self.c + away
        heights, slopes = 0.5 * (curves[:, 1:] + curves[:, :-1]), np.diff(curves) / self.steps
        sums = values_of(self.landscape, self.middle, heights, slopes) @ self.steps
        sums = sums + sum(self.landscape.at_end(side, curves[:, -side]) for side in (0, 1))
        deep = sums < self.own_value - FALLEN * self.summed
        for k in np.flatnonzero(deep).tolist():
            # of what is steep no curvature is told: it is looked at with the curve's own slopes as well
            about = (slopes[k], self.slope)
            if not any(concave_at(self.landscape, self.middle, heights[k], v, self.steep).any() for v in about):
                return falls_along(self.landscape, self.x, self.c, away[k])
        return None

    def apart(self, valley: Valley) -> bool:
        """Whether a ridge lies between the curve's polygon and a valley, or nothing but a way down leads there."""
        away = valley.y - self.c
        shares = np.vstack([BETWEEN, [[0.0]], [[1.0]]])
        sums = self._along(self._rule, self.c + shares * away)
        for side in (0, 1):
            sums = sums + self.landscape.at_end(side, self.c[-side] + shares[:, 0] * away[-side])
        own, there = sums[-2], sums[-1]
        if not np.isfinite(sums).all():
            return True
        return bool(sums[:-2].max() > max(own, there) + NO_RIDGE * abs(own)) or (valley.edge and there < own)


def at_ends(landscape: Landscape, y: np.ndarray) -> float:
    """What the ends of a polygon with ordinates y (m,) add."""
    return sum(float(landscape.at_end(side, y[-side])) for side in (0, 1))


def values_of(landscape: Landscape, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
    """L as it is minimised, on arrays that broadcast, in their common shape."""
    return np.broadcast_to(landscape.values(x, y, v), np.broadcast_shapes(x.shape, y.shape, v.shape))


def concave_at(landscape: Landscape, x: np.ndarray, y: np.ndarray, v: np.ndarray, steep: float) -> np.ndarray:
    """Where L is concave in the slope about v, or no number; ``steep`` is the landscape's unit of slopes."""
    steps = STEEPER * np.maximum(steep, np.abs(v)) * np.arange(-1, 2).reshape(3, *np.ones(np.ndim(y), dtype=int))
    left, own, right = values_of(landscape, x, y, v + steps)
    return concave(left, own, right)


def concave(left: np.ndarray, own: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Whether the middle one of three values at equal steps lies above the chord of the others, or one is no number."""
    return ~(left - 2 * own + right >= CONCAVE * (np.abs(left) + 2 * np.abs(own) + np.abs(right)))
