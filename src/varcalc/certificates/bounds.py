"""Bounds along the curve: a lower bound by duality, an upper one from a curve proved to lie within them.

With multipliers mu_k(x) of the right signs L + mu (h - limit) is nowhere more than L on curves within the bounds, so
what is proved of its integral over all curves bounds theirs from below (Kinderlehrer and Stampacchia, "An Introduction
to Variational Inequalities and Their Applications", ch. II). The multipliers are polynomials close to those of the
solution; where it does not touch they are zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, groupby, pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Poly, differentiation, enclosed, flint, nodes, polynomial
from varcalc.certificates.curve import DEGREE, Piece, integrated, nodes_within
from varcalc.certificates.integrals import Unproved, along_curve
from varcalc.certificates.jets import Jet, Undecided, jets, without_enclosure
from varcalc.certificates.levels import meeting
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import Statement, statement
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.given_curve import distinct

TOUCHING = 1e-6
"""Relative distance from a bound within which all of a piece touches it."""
SAMPLES = 129
"""Points at which the size of what is bounded is looked at."""
NOISE = 1e-9
"""Coefficients of a multiplier, relative to its size, that are left out, and what it is moved by to have one sign."""
TERMS = 8
"""Order of the Taylor forms by which a curve is proved to lie within its bounds."""
NARROWEST = 30
"""How often a box is halved at most."""
SLIGHT = 1e-2
"""Share of the largest multiplier that one may have the wrong sign by where it is moved to have the right one."""
WEIGHTS = (0.0, 100.0)
"""Weights that are tried: without one the proof may hold among all curves."""
LIFTS = 13
"""How many distances from the bound are tried, each eight times the one before."""


@dataclass(frozen=True)
class Side:
    """One side of a bound that is touched on a piece: ``sign`` (h - ``limit``) >= 0, and -``sign`` mu >= 0."""

    number: int
    limit: float
    sign: float


@dataclass(frozen=True)
class Bounds:
    """A curve within bounds: ``along`` without multipliers, and the Lagrangian with them.

    With a ``weight`` t = h - limit gives way to t/(1 + c |t|), |t| being the distance within the bound: it has the sign
    of t there, and bends (augmented Lagrangians: Bertsekas, "Constrained Optimization and Lagrange Multiplier Methods",
    1982, ch. 5).
    """

    along: AlongCurve
    weight: float = 0.0

    @cached_property
    def _edges(self) -> list[float]:
        return [self.along.span[0], *distinct(self.along.vertices)[1:-1].tolist(), self.along.span[1]]

    @cached_property
    def touched(self) -> list[list[Side]]:
        """What each piece touches all along."""
        return [self._touched(a, b) for a, b in pairwise(self._edges)]

    def _touched(self, a: float, b: float) -> list[Side]:
        values = self._heights(0.5 * (a + b) + 0.5 * (b - a) * nodes(DEGREE)[1:-1])
        whole = self._heights(np.linspace(self._edges[0], self._edges[-1], SAMPLES))
        sides = []
        for k, limit in enumerate(self.along.limits):
            for at, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
                near = TOUCHING * float(np.abs(whole[:, k] - at).max())
                if np.isfinite(at) and (np.abs(values[:, k] - at) <= near).all():
                    sides.append(Side(k, at, sign))
        if len(sides) > 1 and any(self._of_slope(side) for side in sides):
            raise Unproved(f"bounds on the slope are touched beside others between {a:.6g} and {b:.6g}")
        return sides

    def _heights(self, x: np.ndarray) -> np.ndarray:
        """What is bounded at x (m,), one column for each bound."""
        return self.along.function(ca.vertcat(*self.along.paths))(x)[0][:, :, 0]

    @property
    def on_the_curve(self) -> bool:
        """Whether anything is touched that does not hang on the slope."""
        return not all(map(self._of_slope, chain(*self.touched)))

    def _of_slope(self, side: Side) -> bool:
        return bool(ca.depends_on(self.along.paths[side.number], self.along.symbols.dy))

    @cached_property
    def multipliers(self) -> list[list[np.ndarray]]:
        """Coefficients in powers of the piece's own variable of mu of each side that a piece touches."""
        values = self._of_momenta()
        for number, sides in enumerate(self.touched):
            if sides and not self._of_slope(sides[0]):
                values[number] = self._of_force(number, sides)
        size = max((float(np.abs(row).max()) for row in values.values()), default=0.0)
        return [
            [_in_powers(mu, side.sign, size) for side, mu in zip(sides, values[number].T, strict=True)] if sides else []
            for number, sides in enumerate(self.touched)
        ]

    def _of_force(self, number: int, sides: list[Side]) -> np.ndarray:
        """The multipliers (N + 1, sides) of what hangs on the curve: L_y + mu h_y = p'."""
        along, s = self.along, self.along.symbols
        a, b = self._edges[number : number + 2]
        x, L = nodes_within(a, b), self._integrand
        heights = ca.vertcat(*(along.paths[side.number] for side in sides))
        by_y, by_v = (v[:, :, 0] for v in self.plain.function(ca.gradient(L, s.y), ca.gradient(L, s.dy))(x))
        bends = along.function(ca.jacobian(heights, s.y))(x)[0]
        force = differentiation(DEGREE) @ by_v / (0.5 * (b - a)) - by_y
        return np.array([np.linalg.lstsq(bend.T, row, rcond=None)[0] for bend, row in zip(bends, force, strict=True)])

    def _of_momenta(self) -> dict[int, np.ndarray]:
        """The multipliers (N + 1, 1) of what hangs on the slope, of each piece that touches such a bound.

        L_v + mu h_v = p, where p grows by L_y from piece to piece, but where bounds on the curve are touched.
        """
        found: dict[int, np.ndarray] = {}
        kinds = [None if not sides else self._of_slope(sides[0]) for sides in self.touched]
        jumps = np.cumsum([x in dict(self.along.form.conditions.waypoints) for x in self._edges[:-1]])
        for (bound, _), group in groupby(range(len(kinds)), lambda k: (kinds[k] is False, jumps[k])):
            run = list(group)
            if not bound and any(kinds[k] for k in run):
                found |= self._of_run(run)
        return found

    def _of_run(self, run: list[int]) -> dict[int, np.ndarray]:
        """The same on pieces that follow each other; what p begins with is told by those that touch nothing."""
        along, s = self.along, self.along.symbols
        columns = [ca.gradient(self._integrand, v) for v in (s.y, s.dy)]
        reached, missed, offsets, lengths = 0.0, {}, [], []
        for number in run:
            a, b = self._edges[number : number + 2]
            by_y, by_v = (v[:, :, 0] for v in self.plain.function(*map(ca.densify, columns))(nodes_within(a, b)))
            p = reached + 0.5 * (b - a) * integrated(by_y)
            reached = p[-1]
            missed[number] = p - by_v
            if not self.touched[number]:
                offsets.append(missed[number].mean(axis=0))
                lengths.append(b - a)
        if offsets:
            offset = np.average(offsets, axis=0, weights=lengths)
        elif run[-1] == len(self.touched) - 1 and self._is_free(1):
            offset = reached
        else:
            raise Unproved(f"no part of the curve about {self._edges[run[0]]:.6g} tells the multiplier of a bound")
        found = {}
        for number in run:
            if self.touched[number]:
                height = along.paths[self.touched[number][0].number]
                x = nodes_within(*self._edges[number : number + 2])
                bend = along.function(ca.densify(ca.gradient(height, s.dy)))(x)[0][:, :, 0]
                found[number] = (((missed[number] - offset) * bend).sum(axis=1) / (bend**2).sum(axis=1))[:, None]
        return found

    def _is_free(self, end: int) -> bool:
        ends = self.along.form.ends
        if ends.joint is not None or ends.periodic:
            return False
        return bool(np.isnan(np.asarray((ends.start, ends.end)[end])[0]).all())

    @cached_property
    def _integrand(self) -> Expression:
        """What is minimised: L, or of a length the square of its integrand."""
        return statement(self.plain).lagrangian

    @cached_property
    def terms(self) -> Expression:
        """The sum of mu t, t = h - limit, to be added to the Lagrangian; with a weight t/(1 + c |t|) for t."""
        along, x = self.along, self.along.symbols.x
        total = along.symbols.kind(0)
        for (a, b), sides, rows in zip(pairwise(self._edges), self.touched, self.multipliers, strict=True):
            u = (2 * x - (a + b)) / (b - a)
            for side, powers in zip(sides, rows, strict=True):
                mu = along.symbols.kind(0)
                for c in powers[::-1]:
                    mu = mu * u + float(c)
                t = along.paths[side.number] - side.limit
                if self.weight and not self._of_slope(side):
                    t = t / (1 + side.sign * self._bend * t)
                total = total + ca.if_else(ca.logic_and(x >= a, x <= b), mu * t, 0)
        return total

    @cached_property
    def _bend(self) -> float:
        """The c of :meth:`terms`, by which a bound that is touched adds up to ``weight`` L_vv/T^2 to L_yy."""
        s, most_added = self.along.symbols, 0.0
        for (a, b), sides, rows in zip(pairwise(self._edges), self.touched, self.multipliers, strict=True):
            for side, powers in zip(sides, rows, strict=True):
                slope = self.along.function(ca.gradient(self.along.paths[side.number], s.y))(nodes_within(a, b))[0]
                size = np.abs(np.polynomial.polynomial.polyval(nodes(DEGREE), powers))
                most_added = max(most_added, float((2 * size * (slope[:, :, 0] ** 2).sum(axis=1)).max()))
        within = np.linspace(self._edges[0], self._edges[-1], SAMPLES)[1:-1]
        stiffness = self.plain.function(ca.hessian(self._integrand, s.dy)[0])(within)[0]
        least = float(np.linalg.eigvalsh(stiffness)[:, -1].min())
        return self.weight * least / (self.along.length**2 * (most_added or 1.0))

    @cached_property
    def plain(self) -> AlongCurve:
        """The curve without its bounds."""
        return replace(self.along, paths=(), limits=(), forces=())

    def prove_signs(self) -> None:
        """Prove that no multiplier has the wrong sign."""
        found = flint()
        for (a, b), sides, rows in zip(pairwise(self._edges), self.touched, self.multipliers, strict=True):
            # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
            low, high = ((2 * found.arb(x) - (a + b)) / (b - a) for x in (a, b))
            for side, powers in zip(sides, rows, strict=True):
                poly = found.arb_poly([found.arb(-side.sign * float(c)) for c in powers])
                if not positive(poly, low.lower(), high.upper()):
                    raise Unproved("the multiplier of a bound is not proved to have its sign")

    def above(self, setting: Setting) -> Attained:
        """A curve near that of a setting that is proved to lie within the bounds; Unproved if none is."""
        stated, tolerance = statement(self.plain), 1e-19 * (float(abs(setting.along.value).upper()) or 1.0)
        size = float(setting.sizes[0][0])
        lift = 2.0**-50 * size
        ways = self._chord(setting) if any(map(self._of_slope, chain(*self.touched))) else self._off(setting)
        if stated.levels:
            ways = self._level(ways, setting)
        for _ in range(LIFTS):
            pieces = [_lifted(piece, way, stated, lift) for piece, way in zip(setting.pieces, ways, strict=True)]
            if all(self._within(stated, piece, ()) for piece in pieces):
                along = along_curve(stated, pieces, setting.sizes, tolerance)
                found = self._met(replace(setting, statement=stated, pieces=pieces, along=along))
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
        for c, condition in zip(self.along.lambdas, self.along.form.conditions.integrals, strict=True):
            value -= flint().arb(float(c)) * condition.lower
        return Attained(value, own.pieces, moved)

    def _level(self, ways: list[list[Poly]], setting: Setting) -> list[list[Poly]]:
        """The ways with bumps on pieces that touch nothing, so that they all but leave what is integrated as it is."""
        stated, bump = setting.statement, flint().arb_poly([1, 0, -1])
        free = [k for k, piece in enumerate(setting.pieces) if not self.touched[self._number(piece)]]
        offered = [(k, i) for k in free for i in range(stated.n)]
        if not offered:
            raise Unproved("a curve that touches bounds all along is not covered beside prescribed integrals")
        effects = np.array([_effect(setting, k, [bump * (j == i) for j in range(stated.n)]) for k, i in offered]).T
        missed = sum((_effect(setting, k, way) for k, way in enumerate(ways)), np.zeros(stated.levels))
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
        return int(np.searchsorted(self._edges, float(piece.centre.mid()))) - 1

    def _chord(self, setting: Setting) -> list[list[Poly]]:
        """The way to the straight lines between what the curve is held at, whose slopes are between its own."""
        found, n, (a, b) = flint(), self.along.n, self.along.span
        starts = [float(s.x[0]) for s in setting.samples]
        knots = [a, *sorted(setting.statement.waypoints), b]
        values = [setting.joints[0], *(setting.joints[starts.index(x)] for x in knots[1:-1]), setting.joints[-1]]
        size, ways = found.arb(float(setting.sizes[0][0])), []
        for piece in setting.pieces:
            k = int(np.searchsorted(knots, float(piece.centre.mid()))) - 1
            low, high = found.arb(knots[k]), found.arb(knots[k + 1])
            share = found.arb_poly([piece.centre - low, piece.half]) * (1 / (high - low))
            lines = [found.arb(float(u)) + share * (found.arb(float(v)) - float(u))
                     for u, v in zip(values[k][:n], values[k + 1][:n], strict=True)]  # fmt: skip
            ways.append([(line - f) * (1 / size) for line, f in zip(lines, piece.functions, strict=True)])
        return ways

    def _off(self, setting: Setting) -> list[list[Poly]]:
        """The way off what is touched: along the gradients there, between these in straight lines, none where held."""
        edges = [float(s.x[0]) for s in setting.samples] + [float(setting.samples[-1].x[-1])]
        rows = [self._gradients(a, b) for a, b in pairwise(edges)]
        known = _at_joints(rows)
        places, columns = [edges[k] for k in sorted(known)], np.array([known[k] for k in sorted(known)]).T
        joints = np.array([[np.interp(x, places, column) for column in columns] for x in edges])
        ways = []
        for k, row in enumerate(rows):
            if not known:
                ways.append([flint().arb_poly([0])] * self.along.n)
                continue
            (start, end), share = joints[k : k + 2], 0.5 * (1 + nodes(DEGREE))[:, None]
            line = start + share * (end - start)
            if row is not None:
                line = row + (start - row[0]) * (1 - share) + (end - row[-1]) * share
            line[0], line[-1] = start, end  # continuous to the last bit
            shape = self._shape(setting, setting.pieces[k])
            ways.append([polynomial(column) * shape for column in line.T])
        return ways

    def _gradients(self, a: float, b: float) -> np.ndarray | None:
        """The sum of the gradients (N + 1, n), of length one, of what a piece touches; None where that is nothing."""
        number = int(np.searchsorted(self._edges, 0.5 * (a + b))) - 1
        if not self.touched[number]:
            return None
        total, x = np.zeros((DEGREE + 1, self.along.n)), nodes_within(a, b)
        for side in self.touched[number]:
            bend = self.along.function(ca.gradient(self.along.paths[side.number], self.along.symbols.y))(x)[0][:, :, 0]
            total += side.sign * bend / np.linalg.norm(bend, axis=1, keepdims=True)
        return total

    def _shape(self, setting: Setting, piece: Piece) -> Poly:
        """What vanishes where the curve is held, and where its ends are one or cost something; about 1 elsewhere."""
        found, (a, b) = flint(), self.along.span
        length = found.arb(b) - a
        shape = found.arb_poly([1])
        for end, at in enumerate((a, b)):
            stated = setting.statement
            if stated.held[end].any() or stated.periodic or stated.cost is not None:
                sign = -1 if end else 1
                shape *= found.arb_poly([(piece.centre - at) * sign, piece.half * sign]) * (2 / length)
        for at in setting.statement.waypoints:
            shape *= (found.arb_poly([piece.centre - at, piece.half]) * (2 / length)) ** 2
        return shape

    @cached_property
    def _program(self) -> Program:
        along = self.along
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
        limit = self.along.limits[k]
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


def _in_powers(mu: np.ndarray, sign: float, size: float) -> np.ndarray:
    """Coefficients in powers of a multiplier of the right sign, close to that of the curve.

    On short pieces about the place where the curve comes to a bound it is known but roughly: its mean will do, as any
    of that sign would.
    """
    series = np.polynomial.Chebyshev.fit(nodes(DEGREE), mu, DEGREE, domain=[-1, 1]).trim(NOISE * size)
    powers: np.ndarray = series.convert(kind=np.polynomial.Polynomial).coef
    wrong = float((sign * series(np.linspace(-1.0, 1.0, SAMPLES))).max())
    if len(powers) > DEGREE or wrong > SLIGHT * size:
        inside = 1.0 - nodes(DEGREE) ** 2
        powers = np.array([-sign * max(0.0, -sign * float((mu * inside).sum() / inside.sum()))])
        wrong = 0.0
    powers[0] -= sign * (NOISE * size + max(0.0, wrong))
    return powers


def positive(poly: Poly, low: Ball, high: Ball, depth: int = 0) -> bool:
    """Whether a polynomial is proved positive between two numbers."""
    middle = (low + high) / 2
    # about the middle: near an end where it all but vanishes the first coefficients are nearly all there is
    first, *rest = [*poly(flint().arb_poly([middle, (high - low) / 2])).coeffs(), flint().arb(0)]
    if first > sum(abs(c) for c in rest):
        return True
    if depth == NARROWEST or not poly(middle) > 0:
        return False
    return positive(poly, low, middle, depth + 1) and positive(poly, middle, high, depth + 1)


def bounds(along: AlongCurve) -> list[Bounds]:
    """The bounds along a curve, each time with another weight; Unproved where they are not covered."""
    s, form = along.symbols, along.form
    velocities = ca.vertcat(s.dy, *([s.ddy] if along.order == 2 else []))
    if along.order == 2 or form.coordinates.gauged or form.lift is not None:
        raise Unproved("bounds are covered of Lagrangians of first order alone, between ends that do not slide")
    if form.coordinates.energetic and any(ca.depends_on(path, velocities) for path in along.paths):
        raise Unproved("bounds on the direction of a Curve are not covered")
    if along.rides or any(c.equality for c in along.limits) or form.ends.equations:
        raise Unproved("bounds beside other conditions are not covered")
    if any(ca.depends_on(path, velocities) and ca.depends_on(path, s.y) for path in along.paths):
        raise Unproved("bounds on what hangs on both the curve and its slope are not covered")
    if any(limit.where is not None for limit in along.limits):
        raise Unproved("bounds on a part of the interval are not covered")
    found = [Bounds(along, weight) for weight in WEIGHTS]
    return found if found[0].on_the_curve else found[:1]
