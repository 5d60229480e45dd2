"""A curve a little off the bounds that it touches, proved to lie within them: it bounds the infimum from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Poly, enclosed, flint, nodes, polynomial
from varcalc.certificates.curve import DEGREE, Piece, integrated, nodes_within
from varcalc.certificates.integrals import Unproved, along_curve
from varcalc.certificates.jets import Jet, Undecided, jets, without_enclosure
from varcalc.certificates.levels import meeting
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import VALUE_TOLERANCE, Setting
from varcalc.certificates.statement import Statement, statement
from varcalc.symbolic.instructions import Program
from varcalc.verify.along_curve import AlongCurve

if TYPE_CHECKING:
    from varcalc.certificates.bounds import Bounds

TERMS = 8
"""Order of the Taylor forms by which a curve is proved to lie within its bounds."""
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
        stated = statement(self.bounds.plain)
        tolerance = VALUE_TOLERANCE * (float(abs(self.setting.along.value).upper()) or 1.0)
        size = float(self.setting.sizes[0][0])
        lift = 2.0**-50 * size
        ways = self._chord() if any(map(self.bounds.of_slope, chain(*self.bounds.touched))) else self._off()
        if stated.levels:
            ways = self._level(ways)
        for _ in range(LIFTS):
            pieces = [_lifted(piece, way, stated, lift) for piece, way in zip(self.setting.pieces, ways, strict=True)]
            if all(self._within(stated, piece, ()) for piece in pieces):
                along = along_curve(stated, pieces, self.setting.sizes, tolerance)
                found = self._met(replace(self.setting, statement=stated, pieces=pieces, along=along))
                if found is not None:
                    return found
            lift *= 8.0
        raise Unproved("no curve near the one that was found is proved to lie within its bounds")

    def _met(self, own: Setting) -> Attained | None:
        """The curve of a setting as what is attained; beside levels one near it that meets these, if it is within."""
        stated, value = own.statement, own.along.value
        if not stated.levels:
            return Attained(value, own.pieces)
        met = meeting(own)
        moved = met.moved()
        if not all(self._within(stated, piece, moved) for piece in own.pieces):
            return None
        value += met.correction()
        for c, condition in zip(self._along.lambdas, self._along.form.conditions.integrals, strict=True):
            value -= flint().arb(float(c)) * condition.lower
        return Attained(value, own.pieces, moved)

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

    def _chord(self) -> list[list[Poly]]:
        """The way to the straight lines between what the curve is held at, whose slopes are between its own."""
        found, n, (a, b) = flint(), self._along.n, self._along.span
        starts = [float(s.x[0]) for s in self.setting.samples]
        knots = [a, *sorted(self.setting.statement.waypoints), b]
        values = [
            self.setting.joints[0],
            *(self.setting.joints[starts.index(x)] for x in knots[1:-1]),
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
        edges = [float(s.x[0]) for s in self.setting.samples] + [float(self.setting.samples[-1].x[-1])]
        rows = [self._gradients(a, b) for a, b in pairwise(edges)]
        known = _at_joints(rows)
        places, columns = [edges[k] for k in sorted(known)], np.array([known[k] for k in sorted(known)]).T
        joints = np.array([[np.interp(x, places, column) for column in columns] for x in edges])
        ways = []
        for k, row in enumerate(rows):
            if not known:
                ways.append([flint().arb_poly([0])] * self._along.n)
                continue
            (start, end), share = joints[k : k + 2], 0.5 * (1 + nodes(DEGREE))[:, None]
            line = start + share * (end - start)
            if row is not None:
                line = row + (start - row[0]) * (1 - share) + (end - row[-1]) * share
            line[0], line[-1] = start, end  # continuous to the last bit
            shape = self._shape(self.setting.pieces[k])
            ways.append([polynomial(column) * shape for column in line.T])
        return ways

    def _gradients(self, a: float, b: float) -> np.ndarray | None:
        """The sum of the gradients (N + 1, n), of length one, of what a piece touches; None where that is nothing."""
        number = int(np.searchsorted(self.bounds.edges, 0.5 * (a + b))) - 1
        if not self.bounds.touched[number]:
            return None
        total, x = np.zeros((DEGREE + 1, self._along.n)), nodes_within(a, b)
        for side in self.bounds.touched[number]:
            bend = self._along.function(ca.gradient(self._along.paths[side.number], self._along.symbols.y))(x)[0][
                :, :, 0
            ]
            total += side.sign * bend / np.linalg.norm(bend, axis=1, keepdims=True)
        return total

    def _shape(self, piece: Piece) -> Poly:
        """What vanishes where the curve is held, and where its ends are one or cost something; about 1 elsewhere."""
        found, (a, b) = flint(), self._along.span
        length = found.arb(b) - a
        shape = found.arb_poly([1])
        for end, at in enumerate((a, b)):
            stated = self.setting.statement
            if stated.held[end].any() or stated.periodic or stated.cost is not None:
                sign = -1 if end else 1
                shape *= found.arb_poly([(piece.centre - at) * sign, piece.half * sign]) * (2 / length)
        for at in self.setting.statement.waypoints:
            shape *= (found.arb_poly([piece.centre - at, piece.half]) * (2 / length)) ** 2
        return shape

    @cached_property
    def _program(self) -> Program:
        along = self._along
        function = ca.Function("bounds", along.symbols.all, [ca.vertcat(*along.paths)])
        strange = without_enclosure(function)
        if strange:
            raise Unproved(f"a bound holds {strange}, of which no enclosure is known")
        return Program(function)

    def _within(self, stated: Statement, piece: Piece, moved: Sequence[Ball]) -> bool:
        """Whether a piece, ``moved`` by no more than that, is proved to lie within all bounds."""
        waiting = [(piece.box(), 0)]
        while waiting:
            box, depth = waiting.pop()
            try:
                views = [
                    self._values(stated, piece, Around(box, TERMS + whole, whole), moved) for whole in (False, True)
                ]
                if all(self._inside(k, enclosed(c, w, TERMS)) for k, (c, w) in enumerate(zip(*views, strict=True))):
                    continue
            except Undecided:
                pass
            if depth == NARROWEST:
                return False
            waiting += [(half, depth + 1) for half in box.halves()]
        return True

    def _inside(self, k: int, value: Ball) -> bool:
        limit = self._along.limits[k]
        return all(
            not np.isfinite(at) or bool(sign * (value - at) >= 0) for at, sign in ((limit.lower, 1), (limit.upper, -1))
        )

    def _values(self, stated: Statement, piece: Piece, around: Around, moved: Sequence[Ball]) -> list[Any]:
        states, controls = piece.lifted(around)
        if moved:
            room = [flint().arb(0, 1) * far for far in moved]
            states = [v + far for v, far in zip(states, room[: stated.bare], strict=True)]
            controls = [v + far for v, far in zip(controls, room[stated.states :], strict=True)]
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [flint().arb_series([0], around.terms) + jet.value for jet in jets(self._program, arguments[:-2], 0)[0]]


def _effect(setting: Setting, k: int, way: list[Poly]) -> np.ndarray:
    """What a way of the functions on a piece changes of what is integrated to levels, in numbers and to first order."""
    s, bare = setting.samples[k], setting.statement.bare
    places = [flint().arb(float(t)) for t in nodes(DEGREE)]
    total = np.zeros((len(s.x), setting.statement.levels))
    for i, poly in enumerate(way):
        slope = poly.derivative()
        values, rates = (np.array([float(p(t).mid()) for t in places]) for p in (poly, slope))
        total += s.turning[:, :, i] * values[:, None] + s.turning[:, :, bare + i] * rates[:, None] / s.half
    return s.half * integrated(total)[-1]


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
