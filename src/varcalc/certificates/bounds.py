"""Bounds along the curve: a lower bound by duality, an upper one from a curve proved to lie within them.

With multipliers mu_k(x) of the right signs L + mu (h - limit) is nowhere more than L on curves within the bounds, so
what is proved of its integral over all curves bounds theirs from below (Kinderlehrer and Stampacchia, "An Introduction
to Variational Inequalities and Their Applications", ch. II). The multipliers are polynomials close to those of the
solution; where it does not touch they are zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Poly, differentiation, enclosed, flint, nodes
from varcalc.certificates.curve import DEGREE, Piece, nodes_within
from varcalc.certificates.integrals import Unproved, along_curve
from varcalc.certificates.jets import Jet, Undecided, jets, without_enclosure
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import Statement, statement
from varcalc.symbolic.instructions import Program
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
LIFTS = 6
"""How many distances from the bound are tried, each four times the one before."""


@dataclass(frozen=True)
class Side:
    """One side of a bound that is touched on a piece: ``sign`` (h - ``limit``) >= 0, and -``sign`` mu >= 0."""

    number: int
    limit: float
    sign: float


@dataclass(frozen=True)
class Bounds:
    """A curve within bounds: ``along`` without multipliers, and the Lagrangian with them."""

    along: AlongCurve

    @cached_property
    def _edges(self) -> list[float]:
        return [self.along.span[0], *distinct(self.along.vertices)[1:-1].tolist(), self.along.span[1]]

    @cached_property
    def touched(self) -> list[Side | None]:
        """What each piece touches all along, if anything."""
        return [self._touched(a, b) for a, b in zip(self._edges[:-1], self._edges[1:], strict=True)]

    def _touched(self, a: float, b: float) -> Side | None:
        values = self._heights(0.5 * (a + b) + 0.5 * (b - a) * nodes(DEGREE)[1:-1])
        whole = self._heights(np.linspace(self._edges[0], self._edges[-1], SAMPLES))
        sides = []
        for k, limit in enumerate(self.along.limits):
            for at, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
                near = TOUCHING * float(np.abs(whole[:, k] - at).max())
                if np.isfinite(at) and (np.abs(values[:, k] - at) <= near).all():
                    sides.append(Side(k, at, sign))
        if len(sides) > 1:
            raise Unproved(f"several bounds are touched at once between {a:.6g} and {b:.6g}")
        return sides[0] if sides else None

    def _heights(self, x: np.ndarray) -> np.ndarray:
        """What is bounded at x (m,), one column for each bound."""
        return self.along.function(ca.vertcat(*self.along.paths))(x)[0][:, :, 0]

    @cached_property
    def multipliers(self) -> list[np.ndarray | None]:
        """Coefficients in powers of the piece's own variable of mu on each piece."""
        pieces = zip(self._edges[:-1], self._edges[1:], self.touched, strict=True)
        return [None if side is None else self._multiplier(a, b, side) for a, b, side in pieces]

    def _multiplier(self, a: float, b: float, side: Side) -> np.ndarray:
        """mu from the Euler-Lagrange equation, H_y = L_y + mu h_y = p'."""
        along, s = self.along, self.along.symbols
        x = nodes_within(a, b)
        L, h = along.integrand, along.paths[side.number]
        by_y, by_v, bend = (
            v[:, :, 0] for v in along.function(*(ca.gradient(*v) for v in ((L, s.y), (L, s.dy), (h, s.y))))(x)
        )
        force = differentiation(DEGREE) @ by_v / (0.5 * (b - a)) - by_y
        mu = (force * bend).sum(axis=1) / (bend**2).sum(axis=1)
        size = float(np.abs(mu).max())
        series = np.polynomial.Chebyshev.fit(nodes(DEGREE), mu, DEGREE, domain=[-1, 1]).trim(NOISE * size)
        powers = series.convert(kind=np.polynomial.Polynomial).coef
        powers[0] -= side.sign * NOISE * size
        return powers

    def with_multipliers(self) -> AlongCurve:
        """The curve with the Lagrangian L + mu (h - limit)."""
        along, x = self.along, self.along.symbols.x
        total = along.integrand
        pieces = zip(self._edges[:-1], self._edges[1:], self.touched, self.multipliers, strict=True)
        for a, b, side, powers in pieces:
            if side is None or powers is None:
                continue
            t = (2 * x - (a + b)) / (b - a)
            mu = along.symbols.kind(0)
            for c in powers[::-1]:
                mu = mu * t + float(c)
            inside = ca.logic_and(x >= a, x <= b)
            total = total + ca.if_else(inside, mu * (along.paths[side.number] - side.limit), 0)
        return replace(self.plain(), integrand=total)

    def plain(self) -> AlongCurve:
        """The curve without its bounds."""
        return replace(self.along, paths=(), limits=(), forces=())

    def prove_signs(self) -> None:
        """Prove that no multiplier has the wrong sign."""
        found = flint()
        pieces = zip(self._edges[:-1], self._edges[1:], self.touched, self.multipliers, strict=True)
        for a, b, side, powers in pieces:
            if side is not None and powers is not None:
                poly = found.arb_poly([found.arb(-side.sign * float(c)) for c in powers])
                # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
                low, high = ((2 * found.arb(x) - (a + b)) / (b - a) for x in (a, b))
                if not positive(poly, low.lower(), high.upper()):
                    raise Unproved("the multiplier of a bound is not proved to have its sign")

    def above(self, setting: Setting) -> Attained:
        """A curve near that of a setting that is proved to lie within the bounds; Unproved if none is."""
        stated, tolerance = statement(self.plain()), 1e-19 * (float(abs(setting.along.value).upper()) or 1.0)
        size = float(setting.sizes[0][0])
        lift = 2.0**-50 * size
        for _ in range(LIFTS):
            pieces = [self._lifted(piece, setting, stated, lift) for piece in setting.pieces]
            if all(self._within(stated, piece) for piece in pieces):
                return Attained(along_curve(stated, pieces, setting.sizes, tolerance).value, pieces)
            lift *= 4.0
        raise Unproved("no curve near the one that was found is proved to lie within its bounds")

    def _lifted(self, piece: Piece, setting: Setting, stated: Statement, lift: float) -> Piece:
        """The piece moved off the bound by a parabola that vanishes at the ends."""
        found = flint()
        a, b = (found.arb(float(x)) for x in (setting.samples[0].x[0], setting.samples[-1].x[-1]))
        shape = found.arb_poly([piece.centre - a, piece.half]) * found.arb_poly([b - piece.centre, -piece.half])
        moved = [f + shape * (4 * lift * way / (b - a) ** 2) for f, way in zip(piece.functions, self._way, strict=True)]
        return replace(piece, functions=moved, switches=stated.switches(piece.centre, piece.half))

    @cached_property
    def _way(self) -> list[float]:
        """The direction away from what is touched, of one sign for each function."""
        s, ways = self.along.symbols, []
        for a, b, side in zip(self._edges[:-1], self._edges[1:], self.touched, strict=True):
            if side is not None:
                x = np.linspace(a, b, 9)[1:-1]
                slope = self.along.function(ca.gradient(self.along.paths[side.number], s.y))(x)[0][:, :, 0]
                ways.extend(side.sign * np.sign(slope))
        if any((way != ways[0]).any() for way in ways):
            raise Unproved("a curve that touches bounds from both sides is not covered")
        return ways[0].tolist() if ways else [0.0] * self.along.n

    @cached_property
    def _program(self) -> Program:
        along = self.along
        function = ca.Function(
            "bounds", [*along.symbols.all, *along.multiplier_symbols[:1]], [ca.vertcat(*along.paths)]
        )
        strange = without_enclosure(function)
        if strange:
            raise Unproved(f"a bound holds {strange}, of which no enclosure is known")
        return Program(function)

    def _within(self, stated: Statement, piece: Piece) -> bool:
        """Whether a piece is proved to lie within all bounds."""
        waiting = [(piece.box(), 0)]
        while waiting:
            box, depth = waiting.pop()
            try:
                views = [self._values(stated, piece, Around(box, TERMS + whole, whole)) for whole in (False, True)]
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

    def _values(self, stated: Statement, piece: Piece, around: Around) -> list[Any]:
        states, controls = piece.lifted(around)
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [flint().arb_series([0], around.terms) + jet.value for jet in jets(self._program, arguments[:-1], 0)[0]]


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


def bounds(along: AlongCurve) -> Bounds:
    """The bounds along a curve; Unproved where they are not covered."""
    s, form = along.symbols, along.form
    velocities = ca.vertcat(s.dy, *([s.ddy] if along.order == 2 else []))
    if along.order == 2 or form.coordinates.energetic or form.coordinates.gauged or form.lift is not None:
        raise Unproved("bounds are covered for graphs of Lagrangians of first order alone")
    if form.held or along.rides or any(c.equality for c in along.limits) or along.integrals:
        raise Unproved("bounds beside other conditions are not covered")
    if any(ca.depends_on(path, velocities) for path in along.paths):
        raise Unproved("bounds on the slope are not covered")
    if any(limit.where is not None for limit in along.limits):
        raise Unproved("bounds on a part of the interval are not covered")
    return Bounds(along)
