"""A curve a little off the bounds that it touches, proved to lie within them: it bounds the infimum from above."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise, product
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Poly, Series, coefficient, flint, nodes, polynomial
from varcalc.certificates.curve import CURVE_DEGREE, Piece, edges_of, end_values, integrated, nodes_within, widened
from varcalc.certificates.integrals import Unproved, along_curve, check_enclosed
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.levels import meeting
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import VALUE_TOLERANCE, Setting
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.statement import Statement, statement
from varcalc.certificates.taylor import AtEnd, Values, views_of
from varcalc.symbolic.instructions import Program
from varcalc.verify.along_curve import AlongCurve

if TYPE_CHECKING:
    from varcalc.certificates.bounds import Bounds, Side

NARROWEST = 30
"""How often a box is halved at most."""
LIFTS = 13
"""How many distances from the bound are tried, each eight times the one before."""


@dataclass(frozen=True)
class Within:
    """The curve of a setting, and the bounds that it is to be moved within."""

    bounds: Bounds
    setting: Setting

    @property
    def _along(self) -> AlongCurve:
        return self.bounds.along

    def attained(self) -> Attained:
        """A curve near that of the setting that is proved to lie within the bounds; Unproved if none is."""
        stated, ways = statement(self.bounds.plain), self._ways()
        if stated.levels:
            ways = self._level(ways)
        tolerance = VALUE_TOLERANCE * (float(abs(self.setting.along.value).upper()) or 1.0)
        for pieces in self._tried(stated, ways):
            along = along_curve(stated, pieces, self.setting.sizes, tolerance)
            found = self._met(replace(self.setting, statement=stated, pieces=pieces, along=along))
            if found is not None:
                return found
        raise Unproved("no curve near the one that was found is proved to lie within its bounds")

    def _tried(self, stated: Statement, ways: list[list[Poly]]) -> Iterator[list[Piece]]:
        """Curves that are proved to lie within the bounds, each farther off than the one before.

        Where a solver's slopes go far beyond a bound on a short piece that is a straight line, if nothing else does.
        """
        lifts = [float(self.setting.sizes[0][0]) * 2.0**-50 * 8.0**k for k in range(LIFTS)]
        for straight, lift in product((False, True), lifts):
            pieces = [_lifted(piece, way, stated, lift) for piece, way in zip(self.setting.pieces, ways, strict=True)]
            numbers: Iterable[int] = range(len(pieces))
            if straight:
                numbers = [k for k in numbers if not self._within(stated, pieces, k, ())]
                pieces = [_straight(piece) if k in numbers else piece for k, piece in enumerate(pieces)]
            if all(self._within(stated, pieces, k, ()) for k in numbers):
                yield pieces

    def _met(self, own: Setting) -> Attained | None:
        """The curve of a setting as what is attained; beside levels one near it that meets these, if it is within."""
        stated, value = own.statement, own.along.value + self._dearer(own)
        if not stated.levels:
            return Attained(value, own.pieces)
        met = meeting(own)
        moved = met.moved()
        if not all(self._within(stated, own.pieces, k, moved) for k in range(len(own.pieces))):
            return None
        value += met.correction()
        for c, condition in zip(self._along.lambdas, self._along.form.conditions.integrals, strict=True):
            value -= flint().arb(float(c)) * condition.lower
        return Attained(value, own.pieces, moved)

    def _dearer(self, own: Setting) -> Ball:
        """What the ends of a moved curve cost more than those of the setting's."""
        cost, found = self.setting.statement.cost, flint()
        if cost is None:
            return found.arb(0)
        start, end, numbers = end_values(self.setting.statement, self.setting.joints)
        first, last = ([f(found.arb(at)) for f in own.pieces[k].functions] for k, at in ((0, -1), (-1, 1)))
        return cost.jet(first, last, numbers, 0).value - cost.jet(start, end, numbers, 0).value

    def _level(self, ways: list[list[Poly]]) -> list[list[Poly]]:
        """The ways with bumps on pieces that touch nothing, so that they all but leave what is integrated as it is.

        They are level at their ends, where a slope may be at its bound.
        """
        stated, bump = self.setting.statement, flint().arb_poly([1, 0, -2, 0, 1])
        free = [k for k, piece in enumerate(self.setting.pieces) if not self.bounds.touched[self._number(piece)]]
        offered = [(k, i) for k in free for i in range(stated.n)]
        if not offered:
            raise Unproved("a curve that touches bounds all along is not covered beside prescribed integrals")
        effects = np.array([_effect(self.setting, k, [bump * (j == i) for j in range(stated.n)]) for k, i in offered]).T
        missed = sum((_effect(self.setting, k, way) for k, way in enumerate(ways)), np.zeros(stated.levels))
        chosen: list[int] = []
        rest = effects / np.abs(effects).max(axis=1, keepdims=True)
        for _ in range(stated.levels):
            best = int(np.linalg.norm(rest, axis=0).argmax())
            along = rest[:, best] / np.linalg.norm(rest[:, best])
            rest = rest - np.outer(along, along @ rest)
            chosen.append(best)
        shares = np.linalg.lstsq(effects[:, chosen], -missed, rcond=None)[0]
        levelled = [list(way) for way in ways]
        for at, share in zip(chosen, shares.tolist(), strict=True):
            k, i = offered[at]
            levelled[k][i] = levelled[k][i] + bump * flint().arb(share)
        return levelled

    def _number(self, piece: Piece) -> int:
        """The number of the part between edges that a piece lies in."""
        return int(np.searchsorted(self.bounds.edges, float(piece.centre.mid()))) - 1

    def _ways(self) -> list[list[Poly]]:
        """A way of the functions on each piece by which they leave what they touch."""
        if not any(map(self.bounds.of_slope, chain(*self.bounds.touched))):
            return self._off()
        held = self.setting.statement.held
        return self._chord() if (held[0] & held[1]).all() or self.setting.statement.periodic else self._slower()

    def _slower(self) -> list[list[Poly]]:
        """The way whose slopes lead off what slopes touch, from an end that is held."""
        found, held = flint(), self.setting.statement.held
        from_end = held[1].any() and not held[0].all()
        ways, reached = [], [found.arb(0)] * self._along.n
        scale = found.arb(1) / self._along.length
        pieces, rates = self.setting.pieces, self._between()
        for piece, rate in zip(pieces[::-1], rates[::-1], strict=True) if from_end else zip(pieces, rates, strict=True):
            grown = [(polynomial(column) * (piece.half * scale)).integral() for column in rate.T]
            first, last = (1, -1) if from_end else (-1, 1)
            grown = [poly - poly(found.arb(first)) + start for poly, start in zip(grown, reached, strict=True)]
            reached = [poly(found.arb(last)) for poly in grown]
            ways.append(grown)
        return ways[::-1] if from_end else ways

    def _chord(self) -> list[list[Poly]]:
        """The way to the straight lines between what the curve is held at, whose slopes are between its own."""
        found, n, (a, b) = flint(), self._along.n, self._along.span
        edges = edges_of(self.setting.samples)
        knots = [a, *sorted(self.setting.statement.waypoints), b]
        values = [
            self.setting.joints[0],
            *(self.setting.joints[edges.index(x)] for x in knots[1:-1]),
            self.setting.joints[-1],
        ]
        size, ways = found.arb(float(self.setting.sizes[0][0])), []
        for piece in self.setting.pieces:
            k = int(np.searchsorted(knots, float(piece.centre.mid()))) - 1
            low, high = found.arb(knots[k]), found.arb(knots[k + 1])
            share = found.arb_poly([piece.centre - low, piece.half]) * (1 / (high - low))
            lines = [found.arb(float(u)) + share * (found.arb(float(v)) - float(u))
                     for u, v in zip(values[k][:n], values[k + 1][:n], strict=True)]  # fmt: skip
            ways.append([(line - f) * (1 / size) for line, f in zip(lines, piece.functions, strict=True)])
        return ways

    def _off(self) -> list[list[Poly]]:
        """The way off what is touched: along the gradients there, between these in straight lines, none where held."""
        shapes = map(self._shape, self.setting.pieces)
        rows = zip(self._between(), shapes, strict=True)
        return [[polynomial(column) * shape for column in line.T] for line, shape in rows]

    def _between(self) -> list[np.ndarray]:
        """The gradients (N + 1, n) of what is touched on each piece, and between these straight lines."""
        edges = edges_of(self.setting.samples)
        rows = [self._gradients(a, b) for a, b in pairwise(edges)]
        known = _at_joints(rows) or self._at_ends()
        if not known:
            return [np.zeros((CURVE_DEGREE + 1, self._along.n))] * len(rows)
        places, columns = [edges[k] for k in sorted(known)], np.array([known[k] for k in sorted(known)]).T
        joints = np.array([[np.interp(x, places, column) for column in columns] for x in edges])
        lines = []
        for k, row in enumerate(rows):
            (start, end), share = joints[k : k + 2], 0.5 * (1 + nodes(CURVE_DEGREE))[:, None]
            line = start + share * (end - start)
            if row is not None:
                line = row + (start - row[0]) * (1 - share) + (end - row[-1]) * share
            line[0], line[-1] = start, end  # continuous to the last bit
            lines.append(line)
        return lines

    def _at_ends(self) -> dict[int, np.ndarray]:
        """The gradients where an end alone touches, by the numbers of the joints."""
        last, span = len(self.setting.pieces), self._along.span
        found = {}
        for end, joint in ((0, 0), (1, last)):
            x = np.array([span[end]])
            sides = self.bounds.touched_at(x)
            if sides and not self.setting.statement.held[end].all():
                found[joint] = sum((self._normal(side, x) for side in sides), np.zeros((1, self._along.n)))[0]
        return found

    def _normal(self, side: Side, x: np.ndarray) -> np.ndarray:
        """The gradient (m, n) of what a side bounds, inwards and of length one."""
        s = self._along.symbols
        bend = ca.gradient(self._along.paths[side.number], s.dy if self.bounds.of_slope(side) else s.y)
        found = self._along.function(bend)(x)[0][:, :, 0]
        return side.sign * found / np.linalg.norm(found, axis=1, keepdims=True)

    def _gradients(self, a: float, b: float) -> np.ndarray | None:
        """The sum of the gradients (N + 1, n), of length one, of what a piece touches; None where that is nothing."""
        number = int(np.searchsorted(self.bounds.edges, 0.5 * (a + b))) - 1
        if not self.bounds.touched[number]:
            return None
        x = nodes_within(a, b)
        return sum((self._normal(side, x) for side in self.bounds.touched[number]), np.zeros((len(x), self._along.n)))

    def _shape(self, piece: Piece) -> Poly:
        """What vanishes where the curve is held, and where its ends are one; about 1 elsewhere."""
        found, (a, b) = flint(), self._along.span
        length = found.arb(b) - a
        shape = found.arb_poly([1])
        for end, at in enumerate((a, b)):
            stated = self.setting.statement
            if stated.held[end].any() or stated.periodic:
                sign = -1 if end else 1
                shape *= found.arb_poly([(piece.centre - at) * sign, piece.half * sign]) * (2 / length)
        for at in self.setting.statement.waypoints:
            shape *= (found.arb_poly([piece.centre - at, piece.half]) * (2 / length)) ** 2
        return shape

    @cached_property
    def _program(self) -> Program:
        along = self._along
        function = ca.Function("bounds", along.symbols.all, [ca.vertcat(*along.paths)])
        check_enclosed(function, "a bound")
        return Program(function)

    def _within(self, stated: Statement, pieces: Sequence[Piece], k: int, moved: Sequence[Ball]) -> bool:
        """Whether a piece, ``moved`` by no more than that, is proved to lie within all bounds."""
        waiting, (a, b) = [(pieces[k].box(), 0)], self._along.span
        while waiting:
            box, depth = waiting.pop()
            views = views_of(box, None if k else a, b if k == len(pieces) - 1 else None)
            try:
                values = [self._values(stated, pieces[k], view, moved) for view in views]
                if all(self._inside(number, Values.on(views, v)) for number, v in enumerate(zip(*values, strict=True))):
                    continue
            except Undecided:
                pass
            if depth == NARROWEST:
                return False
            waiting += [(half, depth + 1) for half in box.halves()]
        return True

    def _inside(self, k: int, value: Values) -> bool:
        limit = self._along.limits[k]
        sides = ((limit.lower, 1), (limit.upper, -1))
        return all(not np.isfinite(at) or ((value - at) * sign).positive for at, sign in sides)

    def _values(self, stated: Statement, piece: Piece, around: Around, moved: Sequence[Ball]) -> list[Any]:
        states, controls = piece.lifted(around)
        if isinstance(around, AtEnd):
            # an end that is held is exactly where it is held
            end = (around.side + 1) // 2
            given = zip(states, stated.held[end], stated.values[end].tolist(), strict=False)
            states = [_beginning(s, at) if held else s for s, held, at in given]
        if moved:
            states, controls = widened(stated, states, controls, moved)
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [flint().arb_series([0], around.terms) + jet.value for jet in jets(self._program, arguments[:-2], 0)[0]]


def _beginning(series: Series, value: float) -> Series:
    """A series with that constant."""
    rest = [coefficient(series, k) for k in range(1, series.prec)]
    return flint().arb_series([flint().arb(value), *rest], series.prec)


def _effect(setting: Setting, k: int, way: list[Poly]) -> np.ndarray:
    """What a way of the functions on a piece changes of what is integrated to levels, in numbers and to first order."""
    s, bare = setting.samples[k], setting.statement.bare
    places = [flint().arb(float(t)) for t in nodes(CURVE_DEGREE)]
    total = np.zeros((len(s.x), setting.statement.levels))
    for i, poly in enumerate(way):
        slope = poly.derivative()
        values, rates = (np.array([float(p(t).mid()) for t in places]) for p in (poly, slope))
        total += s.turning[:, :, i] * values[:, None] + s.turning[:, :, bare + i] * rates[:, None] / s.half
    return s.half * integrated(total)[-1]


def _straight(piece: Piece) -> Piece:
    """The straight lines between the ends of a piece, whose slopes are between those of the piece."""
    found = flint()
    ends = [[f(found.arb(at)) for at in (-1, 1)] for f in piece.functions]
    return replace(piece, functions=[found.arb_poly([(a + b) / 2, (b - a) / 2]) for a, b in ends])


def _lifted(piece: Piece, way: list[Poly], stated: Statement, lift: float) -> Piece:
    """The piece moved some way off what it touches."""
    moved = [f + w * lift for f, w in zip(piece.functions, way, strict=True)]
    return replace(piece, functions=moved, switches=stated.switches(piece.centre, piece.half))


def _at_joints(rows: list[np.ndarray | None]) -> dict[int, np.ndarray]:
    """What goes off is along where touched pieces end: the mean of both where two of them meet."""
    found: dict[int, np.ndarray] = {}
    for k, row in enumerate(rows):
        if row is not None:
            found[k] = row[0] if k not in found else 0.5 * (found[k] + row[0])
            found[k + 1] = row[-1]
    return found
