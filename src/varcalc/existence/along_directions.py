"""Departures from a known curve in one direction, each told by one function, of which a lattice of polygons holds all.

Where there are several unknown functions, a parameter along the curve, conditions or a cost of the ends, no lattice
holds all curves. One holds those that depart from the known curve c in a direction d, c + t d, of which t is the one
function. The directions are the axes, and sums and differences of two.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from varcalc.existence.directions import Departures, polygonal
from varcalc.existence.features import NOTHING, Features, features
from varcalc.existence.landscape import ValuesAt
from varcalc.formulation import Sampled
from varcalc.methods.crossings import beside_jumps
from varcalc.problem.breaks import uneven
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

MOST_DIRECTIONS, BESIDE_AXES = 10, 3
"""Directions that are looked along: all of three functions, of many more the axes and a few besides."""


class AlongDirection:
    """The landscape of the curves c + t d, of which t is the one function; t is 0 along c itself.

    The direction d has ``shares`` (k,) of the ``axes`` (k, n).
    """

    def __init__(self, departures: Departures, axes: np.ndarray, shares: np.ndarray, width: float) -> None:
        self.departures, self.shares, self.direction = departures, shares, shares @ axes
        self.problem = departures.problem
        self._unit = max(1.0, width / float(np.abs(self.direction).max()))
        self.span, self.sign, self.closed = departures.span, departures.sign, departures.closed
        self.approximate, self.waypoints = departures.approximate, departures.waypoints
        self.held = departures.held(self.direction != 0)

    def along(self, valley: Sampled) -> Sampled:
        """The curve of the problem that a function of x, which gives (1, m), stands for."""
        curve = self.departures.curve
        return lambda x: curve(np.atleast_1d(x), 0) + self.direction[:, None] * valley(np.atleast_1d(x))

    def values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L as it is minimised."""
        directions = self.direction.tolist()
        return self.departures.values(x, *([t * d if d else None for d in directions] for t in (y, v)))

    def at(self, x: np.ndarray) -> ValuesAt:
        """The same at abscissae x (G, K), where the curve is told once."""
        own, slopes, *bends = self.departures.own(x)

        def moved(rows: np.ndarray, some: slice, by: np.ndarray) -> list[np.ndarray]:
            """The curve or its slope at some of the abscissae, moved by so much of the direction."""
            curve = rows[:, :, some, None, None]
            return [c + d * by if d else c for c, d in zip(curve, self.direction.tolist(), strict=True)]

        def values(some: slice, y: np.ndarray, v: np.ndarray) -> np.ndarray:
            """L at some of the abscissae."""
            bent = [row[:, some, None, None] for rows in bends for row in rows]
            place, turned = moved(own, some, y), moved(slopes, some, v)
            return self.departures.least_at(x[:, some, None, None], place, turned, bent)

        return values

    def own_values(self, x: np.ndarray, weights: np.ndarray, y: np.ndarray, v: np.ndarray) -> bool:
        """Whether ``values`` along a curve are the functional's own."""
        directions = self.direction.tolist()
        rows = [[t * d if d else None for d in directions] for t in (y, v)]
        return not self.approximate or self.departures.free_of_levels(x, weights, *rows)

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ends that depart by y add."""
        return self.departures.at_end(side, np.outer(y, self.direction)).reshape(np.shape(y))

    def beside_jumps(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """Departures (m,) just beside those at which L of one function jumps."""
        problem, own = self.departures.problem, self.departures.curve(x, 0)
        if not isinstance(problem, Problem) or len(own) > 1:
            return []
        scale = float(self.direction[0])
        return [(row - own[0]) / scale for row in beside_jumps(problem, x, own[0] + scale * y)]

    @property
    def narrow(self) -> Features:
        """Where L of one function is narrow."""
        return features(self.problem) if isinstance(self.problem, Problem) and uneven(self.problem) else NOTHING

    def placed(self, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """The departures (m, j) at x (m,) that lead to ordinates (j,) of one function."""
        if not len(levels):
            return np.zeros((len(x), 0))
        return (levels - self.departures.curve(x, 0)[0][:, None]) / float(self.direction[0])

    def extent(self, y: np.ndarray) -> float:  # noqa: ARG002  it is the same about any curve
        """The unit of the departures."""
        return self._unit


def in_directions(solution: Solution, breadth: float | None = None) -> Iterator[AlongDirection]:
    """The departures from a solution that are looked at."""
    return along_directions(Departures.of(solution, None, breadth))


def is_polygonal(problem: Functional) -> bool:
    """Whether curves are graphs of one function of first order, of which polygons are some."""
    return isinstance(problem, Problem) and problem.n == problem.order == 1


def from_polygon(solution: Solution, pieces: int, breadth: float | None = None) -> AlongDirection:
    """The departures from the polygon through a solution that is the graph of one function, on so many pieces.

    What departs from it is a polygon itself, and stays in between straight bounds.
    """
    known, curve = Departures.of(solution), solution.curve
    assert curve is not None
    x = np.union1d(np.linspace(*known.span, pieces + 1), known.waypoints)
    return next(along_directions(Departures.of(solution, polygonal(x, curve(x, 0)), breadth)))


def along_directions(departures: Departures) -> Iterator[AlongDirection]:
    """The directions of departures that are looked at."""
    axes = departures.axes * departures.sizes
    for shares in _shares(len(axes)):
        yield AlongDirection(departures, axes, shares, departures.breadth)


def _shares(count: int) -> np.ndarray:
    """The axes, their sum, then sums and differences of two, as many as are looked along, in shares of ``count`` axes.

    What is coupled comes into another valley together, or hardly.
    """
    axes = np.eye(count)
    together = [np.ones(count)] if count > 2 else []
    mixed = [a + sign * b for a, b in combinations(axes, 2) for sign in (1.0, -1.0)]
    return np.array([*axes, *together, *mixed])[: max(MOST_DIRECTIONS, count + BESIDE_AXES)]
