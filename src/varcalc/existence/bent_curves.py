"""Least curves of second order, through a box of departures and slopes.

A polygon bends nowhere, or without bound: where L feels the curvature none is admitted. Curves of cubic pieces are,
that are told by what they depart by at vertices, and by how steeply (Hermite). The least ones through the nodes of a
coarse box are found and moved as polygons are that depart along several axes: at each vertex there are twice as many
numbers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from varcalc.existence.falling import Fall, falling_on
from varcalc.existence.moved_polygons import kept_vertices
from varcalc.existence.polygons import Valley, concave
from varcalc.existence.shapes import closer_nearby, led_to
from varcalc.existence.together import AlongAxes, Looked, PolygonsTogether, in_box
from varcalc.numerics.mesh import gauss
from varcalc.problem.conditions import Isoperimetric

PIECES_BENT = 4
"""Pieces of the curves through the nodes of the box: the more there are, the more it costs not to come by a node."""
LEVELS_BENT = 9
"""Levels of the departures of one function, and of its slopes."""
STEEPEST = 4.0
"""The steepest departure of the box, in units of the farthest one and the interval."""
POINTS_BENT, MANY_POINTS, RULES_APART = 3, (16, 24), 10.0
"""Gauss points on a piece; those of two rules that tell what a curve sums, how often their difference is the error."""
AT_ENDS = tuple(np.poly1d(c) for c in ((2, -3, 0, 1), (1, -2, 1, 0), (-2, 3, 0, 0), (1, -1, 0, 0)))
"""Shapes of an interval of length 1 of which the departure at the start is 1, the slope there, and those at the end."""
NONE_AT_ENDS = tuple(np.poly1d([1, -2, 1, 0, 0]) * np.poly1d(c) for c in ([1], [-2, 1], [14 / 3, -14 / 3, 1]))
"""Shapes that are none at either end, with their slopes."""
BENDING = np.linspace(0, 1, 33)
"""Places of that interval by which it is known how shapes bend."""
SHAPES_WITHIN = 3, 1
"""How many of those: of one function, of each of several."""
SHAPES_CLOSED = 2
"""The same of a closed curve, besides the one that shifts it as a whole."""
FAR_OUT, LINE_DOUBLINGS, LINES = 1e4, 6, 4
"""How far out, in units of the known curve, it is seen whether a line leads down for ever; doublings; lines."""
BENT_MORE = 0.1
"""Change of a second derivative, in units of the largest one and 1, by which it is seen whether L is convex in it."""
SHOWN = 8
"""Points of a piece by which a curve is handed on."""


class BentAlong(AlongAxes):
    """The functional of the curves c + t A, where t are cubic between vertices.

    Of k axes there are 2 k numbers at a vertex: the departures t, then their slopes.
    """

    pieces = PIECES_BENT

    def costs(self, x: np.ndarray, nodes: np.ndarray, points: int = POINTS_BENT) -> np.ndarray:
        """What each piece adds between nodes (P, K + 1, S, 2 k) of neighbouring rows, (P, K, S, S)."""
        h, sums = np.diff(x)[:, None, None], 0.0
        for point, weight in zip(*gauss(points), strict=True):
            share = 0.5 * (1 + float(point))
            told = self._cubic(share, h[..., None], nodes[:, :-1, :, None], nodes[:, 1:, None])
            rows = [[t @ column for column in self.axes.T] for t in told]
            sums = sums + 0.5 * float(weight) * self.departures.values(x[:-1, None, None] + share * h, *rows)
        return np.where(np.isfinite(sums), sums, np.inf) * h

    def box_costs(self, x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """The same, as exactly: by one point of a piece nothing is told of how it bends."""
        return self.costs(x, nodes)

    def _cubic(self, share: float, h: np.ndarray, first: np.ndarray, last: np.ndarray) -> list[np.ndarray]:
        """The departures, their slopes and second derivatives at a ``share`` of pieces that are ``h`` long."""
        (p, v), (q, w) = (np.split(ends, 2, axis=-1) for ends in (first, last))
        rise, s = (q - p) / h, share
        bends = 2 * (3 * rise - 2 * v - w) / h, 6 * (v + w - 2 * rise) / h  # at the beginning, and how much it changes
        turned = v + s * h * (bends[0] + 0.5 * s * bends[1])
        return [p + s * h * (v + s * h * (bends[0] / 2 + s * bends[1] / 6)), turned, bends[0] + s * bends[1]]

    def kept(self, x: np.ndarray) -> np.ndarray:
        """Which departures, and slopes of them, are none at vertices x (K + 1,), (K + 1, 2 k)."""
        functions = (self.axes != 0).any(0)
        slopes = np.zeros(len(x), dtype=bool)
        slopes[[0, -1]] = np.array(self.departures.given_slopes(functions)) | self.closed
        return np.repeat(np.column_stack([kept_vertices(self, x), slopes]), len(self.axes), axis=1)

    def levels(self, low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
        """Those of each departure as far as ``low`` (k,) and ``high``, and of each slope, closer nearby."""
        far = np.maximum(-low, high)
        shares = closer_nearby(np.linspace(-1, 1, LEVELS_BENT))
        return [size * shares for size in (*far, *STEEPEST * far / (self.span[1] - self.span[0]))]

    def step(self, levels: np.ndarray) -> float:
        """That between the closest ones."""
        return float(np.diff(levels).min())

    def starts(self, x: np.ndarray, levels: list[np.ndarray], seen: Callable[[], np.ndarray]) -> np.ndarray:
        """The lowest curves that few shapes of the whole interval lead to; of one function, those through a box too.

        What is stiff costs much to come by a node, and what is not may turn between them.
        """
        shaped = self._shaped(x, np.array([row.max() for row in levels[: len(self.axes)]]))
        return shaped if len(self.axes) > 1 else np.concatenate([super().starts(x, levels, seen), shaped])

    def _shaped(self, x: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The lowest curves (P, K + 1, 2 k) that shapes of the whole interval lead to, as large as ``sizes`` (k,)."""
        return led_to(partial(self.sums, x), self._shapes(x, sizes))

    def far_out(self, x: np.ndarray) -> np.ndarray:
        """The lowest curve (1, K + 1, 2 k) far out, where it lies below the known one."""
        sizes = FAR_OUT * self.unit / np.abs(self.axes).max(axis=1)
        curves = led_to(partial(self.sums, x), self._shapes(x, sizes))
        values = self.sums(x, curves)
        return curves[[np.argmin(values)]] if values.min() < self.sums(x, 0 * curves[:1])[0] else curves[:0]

    def _shapes(self, x: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Departures of the whole interval of which one does not bend as another does, (m, K + 1, 2 k)."""
        found, k, t = [], len(self.axes), (x - x[0]) / (x[-1] - x[0])
        for axis, size in enumerate(sizes):
            if self.closed:
                shapes = [np.poly1d([1.0]), *NONE_AT_ENDS[:SHAPES_CLOSED]]
            else:
                free = ~self.kept(x)[[0, -1]][:, [axis, k + axis]].ravel()
                shapes = [*itertools.compress(AT_ENDS, free), *NONE_AT_ENDS[: SHAPES_WITHIN[k > 1]]]
            bends = np.array([shape.deriv(2)(BENDING) for shape in shapes])
            for shares in np.linalg.eigh(bends @ bends.T)[1].T:
                shape = sum((c * shape for c, shape in zip(shares, shapes, strict=True)), np.poly1d([0]))
                row = np.zeros((len(x), 2 * k))
                row[:, axis], row[:, k + axis] = shape(t), shape.deriv()(t) / (x[-1] - x[0])
                found.append(row * size / np.abs(shape(BENDING)).max())
        return np.array(found)

    def sums(self, x: np.ndarray, y: np.ndarray, points: int = POINTS_BENT) -> np.ndarray:
        """What curves y (P, K + 1, 2 k) sum, (P,)."""
        at_ends = self.at_end(0, y[:, 0]) + self.at_end(1, y[:, -1])
        return self.costs(x, y[:, :, None], points)[..., 0, 0].sum(1) + at_ends

    def halved(self, x: np.ndarray, y: np.ndarray, finer: np.ndarray) -> np.ndarray:
        """The same curves (P, K + 1, 2 k) with more vertices."""
        spline = CubicHermiteSpline(x, *np.split(y, 2, axis=2), axis=1)
        return np.concatenate([spline(finer), spline(finer, 1)], axis=2)

    def valley(self, x: np.ndarray, y: np.ndarray, value: float, size: float) -> Valley:
        """A curve y (K + 1, 2 k), by many of its points, to be followed."""
        own, slopes = np.split(y, 2, axis=1)
        places = np.interp(np.arange(SHOWN * (len(x) - 1) + 1) / SHOWN, np.arange(len(x)), x)
        less, more = (float(self.sums(x, y[None], points)[0]) for points in MANY_POINTS)
        levels = any(self.departures.problem.of_type(Isoperimetric))  # which these curves do not keep
        summed = math.nan if levels else max(less, more) + RULES_APART * abs(more - less)
        return Valley(places, CubicHermiteSpline(x, own, slopes)(places), value, False, summed=summed, size=size)

    @property
    def unit(self) -> float:
        """The larger of the known curve's size and the interval."""
        return float(self.departures.units.max())

    def convex_along(self, x: np.ndarray, y: np.ndarray) -> bool:
        """Whether L is convex in the second derivative of each axis half way along the pieces of a curve."""
        h, half = np.diff(x), 0.5 * (x[1:] + x[:-1])
        told = self._cubic(0.5, h[:, None], y[:-1], y[1:])
        for axis in np.eye(len(self.axes)):
            size = BENT_MORE * (1.0 + np.abs(told[2]).max()) * axis
            rows = [[[t @ row for row in self.axes.T] for t in (*told[:2], told[2] + k * size)] for k in (-1, 0, 1)]
            if concave(*(self.departures.values(half, *row) for row in rows)).any():
                return False
        return True

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ends that depart by the first k of y (..., 2 k) add."""
        return super().at_end(side, y[..., : len(self.axes)])


class BentTogether(PolygonsTogether):
    """The curves of second order that starts lead to."""

    landscape: BentAlong

    def fall(self) -> Fall | None:
        """The line from the known curve through a low one, or one far out, that leads down for ever; L stays convex.

        None where there are levels, which such lines do not keep.
        """
        if any(self.landscape.departures.problem.of_type(Isoperimetric)):
            return None
        axes, far = self.landscape.axes, FAR_OUT * self.landscape.unit * 2.0 ** np.arange(LINE_DOUBLINGS)
        own = np.zeros((1, len(self.x), 2 * len(axes)))
        low = [row for row, value in self.found[:LINES] if value < self.own_value]
        for row in (*low, *self.landscape.far_out(self.x)):
            size = float(np.abs(row[:, : len(axes)] @ axes).max())
            lines = np.concatenate([own, (far / size)[:, None, None] * row])
            sums = self.landscape.sums(self.x, lines)
            if self.landscape.convex_along(self.x, lines[-1]):
                fall = falling_on(float(sums[0]), sums[1:], far, self.landscape.sign)
                if fall is not None:
                    return fall
        return None


def least_bent(looked: Sequence[Looked]) -> BentTogether | None:
    """The least curves of second order about one that was looked about; None where none is admitted."""
    box = in_box(BentAlong, looked)
    return None if box is None else BentTogether(*box)
