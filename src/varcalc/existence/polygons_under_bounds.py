"""Least polygons under bounds, on meshes that know where what they come to is narrow.

A curve comes to the tip of a spike over a stretch that is far shorter than the spike is wide. The mesh is made finer
where what lies between its vertices breaks a bound, and where a curve comes to a kink or to a bound, or leaves it.
Every convex kink is a function of its own (:mod:`varcalc.formulation.epigraph`), which is one number on each piece.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.existence.directions import polygonal
from varcalc.existence.rests import Surfaces
from varcalc.formulation import Contact, Form, Sampled
from varcalc.methods.ritz.ipopt import quiet
from varcalc.numerics.mesh import GAUSS_SHARES
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import breaks
from varcalc.problem.problem import Problem
from varcalc.symbolic.evaluation import in_columns
from varcalc.symbolic.variation import gentle_boxes

EVENLY, MOST_EDGES = 32, 400
"""Pieces of the first polygon, and abscissae at most between which bounds vary gently."""
INSIDE_A_PIECE = (1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 0.9999)
"""Places of a piece at which it is seen whether it keeps bounds between its vertices."""
BROKEN_INSIDE, ROUGHLY_KEPT, VERTEX_AT_BOUND, PIECE_ON_KINK = 1e-10, 1e-4, 1e-7, 1e-6
"""By how much a bound may be broken there, and how near one a vertex is at it, or a piece on a kink, in their sizes."""
SHORT_PIECE, LEAST_PIECE = 2e-4, 1e-10
"""Length, in units of the interval, of pieces beside which a curve may come to a kink or a bound; of any piece."""
OF_STRETCH = 0.1
"""The same of the first, in units of the stretch at a bound."""
LEAST_RIDE = 4
"""How many such pieces make a stretch along a kink, and no place at which it is gone through."""
ROUNDS, MOST_PIECES, PARTS = 9, 1500, 4
"""Times that a polygon is made finer, its pieces at most, and into how many a piece is cut."""
OPTIONS = quiet({"tol": 1e-10, "max_iter": 150, "bound_relax_factor": 0.0})
"""Of IPOPT, for one polygon."""
ABOVE = 1e-2
"""How far above both branches a function begins, in units of the largest."""


@dataclass(frozen=True)
class PolygonUnderBounds:
    """Vertices x (m,) with ordinates (m,), the functional, which vertices are at bounds, the state of each piece.

    The state tells for each kink on which of its sides a piece is, 0 where it is on it.
    """

    x: np.ndarray
    y: np.ndarray
    value: float
    at_bounds: np.ndarray
    states: np.ndarray

    def ordinates(self, x: np.ndarray) -> np.ndarray:
        """The ordinates (1, k) at x (k,)."""
        return np.interp(x, self.x, self.y)[None]


class PolygonsUnderBounds:
    """The least polygons of a form with a function for each kink, its ``lifted`` one."""

    def __init__(self, form: Form, lifted: Form) -> None:
        self.form, self.lifted = form, lifted
        self.problem = form.problem
        assert isinstance(self.problem, Problem)
        self.breaks = np.array(breaks(self.problem))
        self.surfaces = Surfaces(self.problem)
        ends = (self.problem.start, self.problem.end)
        self.held_ends = [x for x, end in zip(form.span, ends, strict=True) if end.fixed]
        symbols = lifted.symbols
        steep = [bool(ca.depends_on(c.expression, symbols.dy)) for c in lifted.conditions.pathwise]
        count = len(form.conditions.pathwise)
        own = lifted.conditions.pathwise[:count]
        self.placed = [c for c, slope in zip(own, steep, strict=False) if not slope]
        self.sloping = [c for c, slope in zip(lifted.conditions.pathwise, steep, strict=True) if slope]
        kinds = (self.placed, self.sloping, lifted.conditions.pathwise[count:])
        self._placed, self._sloping, self._kinked = (
            ca.Function("conditions", symbols.all, [ca.densify(ca.vertcat(*(c.expression for c in kind)))])
            for kind in kinds
        )
        self._integrand = ca.Function("integrand", symbols.all, [lifted.integrand])

    @cached_property
    def first(self) -> np.ndarray:
        """Abscissae between which nothing that a bound of the place says is narrow."""
        s, span = self.lifted.symbols, self.form.span
        said = [ca.substitute(c.expression, s.y, np.zeros(self.lifted.n)) for c in self.placed]
        numbers = self.problem.parameter_values
        said = [ca.substitute(e, s.parameters, numbers) for e in said]
        function = ca.Function("bounds", [s.x], [ca.vertcat(*said)])
        edges = gentle_boxes(function, np.linspace(*span, EVENLY + 1), MOST_EDGES)
        return np.unique([*np.linspace(*span, EVENLY + 1), *edges, *self.breaks])

    def least(self, curve: Sampled) -> PolygonUnderBounds | None:
        """The least polygon, on a mesh that is made finer until it keeps the bounds, and knows where it meets what."""
        x, polygon = self.first, None
        y = curve(x)[0]
        for _ in range(ROUNDS):
            found = self._minimised(x, y)
            if found is None:
                return polygon
            polygon = self._seen(x, *found)
            cut = self._cut(polygon)
            if not cut.any() or len(x) > MOST_PIECES:
                return polygon
            inner = x[:-1][cut, None] + np.diff(x)[cut, None] * (np.arange(1, PARTS) / PARTS)
            finer = np.union1d(x, inner.ravel())
            x, y = finer, np.interp(finer, x, polygon.y)
        return polygon

    def _minimised(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float] | None:
        """The ordinates (m,) and the value of the least polygon on a mesh, begun from others; None for none."""
        kinks, m, steps = self.lifted.n - 1, len(x), np.diff(x)
        # slopes are numbers of their own: ordinates beside each other do not tell those of short pieces
        z, slopes = ca.MX.sym("z", 1, m), ca.MX.sym("slopes", 1 + kinks, m - 1)
        rise = slopes[0, :] * ca.DM(steps).T
        value = ca.MX(0)
        for share in GAUSS_SHARES:
            sums = self._integrand.map(m - 1)(*self._columns(x[:-1] + share * steps, z[:-1] + share * rise, slopes))
            value += 0.5 * ca.dot(sums, ca.DM(steps).T)
        sloping = self._sloping.map(m - 1)(*self._columns(0.5 * (x[1:] + x[:-1]), z[:-1] + 0.5 * rise, slopes))
        placed = self._placed.map(m)(*self._columns(x, z, ca.MX.zeros(1 + kinks, m)))
        lower, upper = np.hstack([
            np.zeros((2, m - 1)), *(
                np.tile(np.array([c.bounds for c in kind]).T, count)
                for kind, count in ((self.sloping, m - 1), (self.placed, m))
            )
        ])  # fmt: skip
        ends = np.full((2, m), [[-np.inf], [np.inf]])
        for k, side in ((0, self.lifted.ends.start), (-1, self.lifted.ends.end)):
            if np.isfinite(side[0, 0]):
                ends[:, k] = side[0, 0]
        room = np.full(slopes.numel(), np.inf)
        asked = (z[:-1] + rise - z[1:]).T, ca.vec(sloping), ca.vec(placed)
        program = {"x": ca.vertcat(z.T, ca.vec(slopes)), "f": value, "g": ca.vertcat(*asked)}
        solver = ca.nlpsol("polygon", "ipopt", program, OPTIONS)
        box = {"lbx": [*ends[0], *-room], "ubx": [*ends[1], *room], "lbg": lower, "ubg": upper}
        with np.errstate(all="ignore"):
            begun = np.vstack([np.diff(y) / steps, self._above(x, y)])
            result = solver(x0=[*y, *begun.T.ravel()], **box)
        return (result["x"].full().ravel()[:m], float(result["f"])) if solver.stats()["success"] else None

    def _branches(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """How far a top of zero is above the two branches of each kink in the middles of pieces (kinks, 2, m - 1)."""
        slopes = np.vstack([np.diff(y) / np.diff(x), np.zeros((self.lifted.n - 1, len(x) - 1))])
        columns = self._columns(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])[None], slopes)
        return np.asarray(self._kinked(*columns)).reshape(-1, 2, len(x) - 1)

    def _above(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Tops above both branches."""
        greater = -self._branches(x, y).min(1)
        return greater + ABOVE * np.abs(greater).max(1, keepdims=True)

    def _columns(self, x: np.ndarray, y: ca.MX | np.ndarray, slopes: ca.MX | np.ndarray) -> list[ca.MX | np.ndarray]:
        """The arguments of the lifted form's expressions, a column for each x (m,), of the first function's y."""
        numbers = in_columns(len(x), self.problem.parameter_values, self.lifted.start.unknowns)
        others = np.zeros((self.lifted.n - 1, len(x)))
        return [x[None], ca.vertcat(y, others), slopes, np.zeros((0, len(x))), *numbers]

    def _seen(self, x: np.ndarray, y: np.ndarray, value: float) -> PolygonUnderBounds:
        """A polygon with what it is at, by its vertices and the middles of its pieces."""
        excess, sizes = self._beyond(x, y)
        at_bounds = np.asarray((excess >= -VERTEX_AT_BOUND * sizes).any(0))
        apart = np.diff(self._branches(x, y), axis=1)[:, 0]
        size = np.maximum(np.abs(apart).max(1, keepdims=True), 1e-300)
        states = np.where(np.abs(apart) <= PIECE_ON_KINK * size, 0.0, np.sign(apart))
        return PolygonUnderBounds(x, y, value, at_bounds, states)

    def _beyond(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far ordinates (m,) at x (m,) lie beyond each level of a bound of the place, and the sizes of these."""
        values = np.asarray(self._placed(*self._columns(x, y[None], np.zeros((self.lifted.n, len(x))))))
        found, sizes = list[np.ndarray](), list[float]()
        for condition, row in zip(self.placed, values, strict=True):
            for level, way in ((condition.lower, -1.0), (condition.upper, 1.0)):
                if np.isfinite(level):
                    found.append(way * (row - level))
                    sizes.append(max(float(np.ptp(row)), 1e-300))
        return np.array(found), np.array(sizes)[:, None]

    def _cut(self, polygon: PolygonUnderBounds) -> np.ndarray:
        """The pieces that break a bound between their vertices, or beside which the polygon changes its state."""
        x, y, steps = polygon.x, polygon.y, np.diff(polygon.x)
        unit = self.form.span[1] - self.form.span[0]
        broken, along = np.zeros(len(steps), dtype=bool), polygon.at_bounds[1:] & polygon.at_bounds[:-1]
        for share in INSIDE_A_PIECE:
            at, ordinates = x[:-1] + share * steps, y[:-1] + share * np.diff(y)
            excess, sizes = self._beyond(at, ordinates)
            broken |= (excess > np.where(along, ROUGHLY_KEPT, BROKEN_INSIDE) * sizes).any(0)
        comes = polygon.at_bounds[1:] != polygon.at_bounds[:-1]
        comes[1:] |= comes[:-1] & along[1:]
        comes[:-1] |= comes[1:] & along[:-1]
        shortest = np.minimum(SHORT_PIECE * unit, OF_STRETCH * self._stretches(polygon))
        turned = (polygon.states[:, 1:] != polygon.states[:, :-1]).any(0)
        changes = np.zeros(len(steps), dtype=bool)
        changes[1:] |= turned
        changes[:-1] |= turned
        for k, end in ((0, self.problem.start), (-1, self.problem.end)):
            changes[k] |= not end.fixed  # beside a free end the momentum goes to what that asks for
        cut = broken | (comes & (steps > shortest)) | (changes & (steps > SHORT_PIECE * unit))
        return cut & (steps > LEAST_PIECE * unit)

    @staticmethod
    def _stretches(polygon: PolygonUnderBounds) -> np.ndarray:
        """How long the stretch at a bound is that a piece belongs to, or ends at; infinite where that is a point."""
        found = np.full(len(polygon.x) - 1, np.inf)
        for first, last in runs(polygon.at_bounds):
            if first < last:
                beside = slice(max(first - 1, 0), last + 1)
                found[beside] = np.minimum(found[beside], polygon.x[last] - polygon.x[first])
        return found

    def contacts(self, polygon: PolygonUnderBounds) -> list[Contact]:
        """The contacts of a polygon with bounds and kinks."""
        x, y, surfaces, found = polygon.x, polygon.y, self.surfaces, list[Contact]()
        excess, sizes = self._beyond(x, y)
        touches = (excess >= -VERTEX_AT_BOUND * sizes) & ~np.isin(x, self.held_ends)
        levels = [(c.index, v) for c in self.placed for v in c.bounds if np.isfinite(v)]
        for (index, level), row in zip(levels, touches, strict=True):
            found += [Contact(index, level, float(x[a]), float(x[b])) for a, b in runs(row)]
        values = surfaces.values(polygonal(x, y[None]), 0.5 * (x[1:] + x[:-1]))[: len(surfaces.switches)]
        for index, row in enumerate(values, len(self.problem.constraints)):
            side = np.where(np.abs(row) <= PIECE_ON_KINK * np.abs(row).max(), 0.0, np.sign(row))
            rides = _rides(x, side)
            found += [Contact(index, 0.0, float(x[a]), float(x[b])) for a, b in rides]
            if not surfaces.slopes[index]:
                found += [Contact(index, 0.0, place, place) for place in _gone_through(x, side, rides)]
        return sorted(found, key=lambda c: c.start)


def _rides(x: np.ndarray, side: np.ndarray) -> list[tuple[int, int]]:
    """The first and the last vertices of stretches along a kink, on whose ``side`` pieces are, or on it: long ones."""
    least = LEAST_RIDE * SHORT_PIECE * (x[-1] - x[0])
    found: list[tuple[int, int]] = []
    for first, last in ((a, b + 1) for a, b in runs(side == 0.0)):
        if found and x[first] - x[found[-1][1]] <= least:
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    return [(a, b) for a, b in found if x[b] - x[a] > least]


def _gone_through(x: np.ndarray, side: np.ndarray, rides: list[tuple[int, int]]) -> Iterator[float]:
    """Where a polygon goes from one side of a kink to the other, but for the ends of stretches along it."""
    for i, j in pairwise(np.flatnonzero(side != 0.0).tolist()):
        if side[i] != side[j] and not any(a <= i + 1 and j <= b for a, b in rides):
            yield float(0.5 * (x[i + 1] + x[j]))
