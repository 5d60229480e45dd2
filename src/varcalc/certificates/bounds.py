"""Bounds along the curve: a lower bound by duality, an upper one from a curve proved to lie within them.

With multipliers mu_k(x) of the right signs L + mu (h - limit) is nowhere more than L on curves within the bounds, so
what is proved of its integral over all curves bounds theirs from below (Kinderlehrer and Stampacchia, "An Introduction
to Variational Inequalities and Their Applications", ch. II). The multipliers are polynomials close to those of the
solution; where it does not touch they are zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, groupby, pairwise

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, Poly, differentiation, flint, nodes
from varcalc.certificates.contacts import TouchedArc, at_contacts
from varcalc.certificates.curve import (
    CURVE_DEGREE,
    fitted,
    in_powers,
    integrated,
    mean_inside,
    nodes_within,
    own_variable,
    polynomial_at,
)
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import statement
from varcalc.certificates.within import Within
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.given_curve import distinct

TOUCHING = 1e-6
"""Relative distance from a bound within which all of a piece touches it."""
NEVER_APART = 1e-3
"""Distance from a bound, relative to it, that a curve is taken to be apart from it somewhere."""
POINTS_FOR_SIZE = 129
"""Points at which the size of what is bounded is looked at."""
BOUND_NOISE = 1e-9
"""Coefficients of a multiplier, relative to its size, that are left out, and what it is moved by to have one sign."""
NARROWEST = 30
"""How often an interval is halved at most."""
SLIGHT = 1e-2
"""Share of the largest multiplier that one may have the wrong sign by where it is moved to have the right one."""
WEIGHTS = (0.0, 100.0)
"""Weights that are tried: without one the proof may hold among all curves."""


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
    def edges(self) -> list[float]:
        """Where the pieces of the curve begin, and where the last one ends."""
        return [self.along.span[0], *distinct(self.along.vertices)[1:-1].tolist(), self.along.span[1]]

    @cached_property
    def touched(self) -> list[list[Side]]:
        """What each piece touches all along."""
        return [self._touched(a, b) for a, b in pairwise(self.edges)]

    def _touched(self, a: float, b: float) -> list[Side]:
        sides = self.touched_at(0.5 * (a + b) + 0.5 * (b - a) * nodes(CURVE_DEGREE)[1:-1])
        if len(sides) > 1 and any(self.of_slope(side) for side in sides):
            raise Unproved(f"bounds on the slope are touched beside others between {a:.6g} and {b:.6g}")
        return sides

    def touched_at(self, x: np.ndarray) -> list[Side]:
        """What the curve touches at each of some abscissae."""
        values = self._heights(x)
        whole = self._heights(np.linspace(self.edges[0], self.edges[-1], POINTS_FOR_SIZE))
        sides = []
        for k, limit in enumerate(self.along.limits):
            for at, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
                if not np.isfinite(at):
                    continue
                # a curve that touches all along is nowhere apart from the bound but for round-off
                least = NEVER_APART * max(abs(at), float(np.abs(whole[:, k]).max()))
                near = TOUCHING * max(float(np.abs(whole[:, k] - at).max()), least)
                if (np.abs(values[:, k] - at) <= near).all():
                    sides.append(Side(k, at, sign))
        return sides

    def _heights(self, x: np.ndarray) -> np.ndarray:
        """What is bounded at x (m,), one column for each bound."""
        return self.along.function(ca.vertcat(*self.along.paths))(x)[0][:, :, 0]

    def at_contacts(self) -> AlongCurve | None:
        """The curve with places of contact that are known to round-off; None where these are, or are not found."""
        if any(map(self.of_slope, chain(*self.touched))):
            return None
        pieces = [
            TouchedArc(a, b, tuple(self.along.paths[side.number] - side.limit for side in sides))
            for (a, b), sides in zip(pairwise(self.edges), self.touched, strict=True)
        ]
        nearer = at_contacts(self.plain, self._integrand, pieces)
        return None if nearer is None else replace(self.along, evaluate=nearer.evaluate, vertices=nearer.vertices)

    @property
    def on_the_curve(self) -> bool:
        """Whether anything is touched that does not hang on the slope."""
        return not all(map(self.of_slope, chain(*self.touched)))

    def of_slope(self, side: Side) -> bool:
        """Whether what a side bounds hangs on the slope."""
        return bool(ca.depends_on(self.along.paths[side.number], self.along.symbols.dy))

    @cached_property
    def multipliers(self) -> list[list[np.ndarray]]:
        """Coefficients in powers of the piece's own variable of mu of each side that a piece touches."""
        values = self._of_momenta()
        for number, sides in enumerate(self.touched):
            if sides and not self.of_slope(sides[0]):
                values[number] = self._of_force(number, sides)
        size = max((float(np.abs(row).max()) for row in values.values()), default=0.0)
        return [
            [_powers_of(mu, side.sign, size) for side, mu in zip(sides, values[number].T, strict=True)] if sides else []
            for number, sides in enumerate(self.touched)
        ]

    def _of_force(self, number: int, sides: list[Side]) -> np.ndarray:
        """The multipliers (N + 1, sides) of what hangs on the curve: L_y + mu h_y = p'."""
        along, s = self.along, self.along.symbols
        a, b = self.edges[number : number + 2]
        x, L = nodes_within(a, b), self._integrand
        heights = ca.vertcat(*(along.paths[side.number] for side in sides))
        by_y, by_v = (v[:, :, 0] for v in self.plain.function(ca.gradient(L, s.y), ca.gradient(L, s.dy))(x))
        bends = along.function(ca.jacobian(heights, s.y))(x)[0]
        force = differentiation(CURVE_DEGREE) @ by_v / (0.5 * (b - a)) - by_y
        return np.array([np.linalg.lstsq(bend.T, row, rcond=None)[0] for bend, row in zip(bends, force, strict=True)])

    def _of_momenta(self) -> dict[int, np.ndarray]:
        """The multipliers (N + 1, 1) of what hangs on the slope, of each piece that touches such a bound.

        L_v + mu h_v = p, where p grows by L_y from piece to piece, but where bounds on the curve are touched.
        """
        found: dict[int, np.ndarray] = {}
        kinds = [None if not sides else self.of_slope(sides[0]) for sides in self.touched]
        jumps = np.cumsum([x in dict(self.along.form.conditions.waypoints) for x in self.edges[:-1]])
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
            a, b = self.edges[number : number + 2]
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
            raise Unproved(f"no part of the curve about {self.edges[run[0]]:.6g} tells the multiplier of a bound")
        found = {}
        for number in run:
            if self.touched[number]:
                height = along.paths[self.touched[number][0].number]
                x = nodes_within(*self.edges[number : number + 2])
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
        for (a, b), sides, rows in zip(pairwise(self.edges), self.touched, self.multipliers, strict=True):
            u = own_variable(x, a, b)
            for side, powers in zip(sides, rows, strict=True):
                mu = polynomial_at(u, powers.tolist())
                t = along.paths[side.number] - side.limit
                if self.weight and not self.of_slope(side):
                    t = t / (1 + side.sign * self._bend * t)
                total = total + ca.if_else(ca.logic_and(x >= a, x <= b), mu * t, 0)
        return total

    @cached_property
    def _bend(self) -> float:
        """The c of :meth:`terms`, by which a bound that is touched adds up to ``weight`` L_vv/T^2 to L_yy."""
        s, most_added = self.along.symbols, 0.0
        for (a, b), sides, rows in zip(pairwise(self.edges), self.touched, self.multipliers, strict=True):
            for side, powers in zip(sides, rows, strict=True):
                slope = self.along.function(ca.gradient(self.along.paths[side.number], s.y))(nodes_within(a, b))[0]
                size = np.abs(np.polynomial.polynomial.polyval(nodes(CURVE_DEGREE), powers))
                most_added = max(most_added, float((2 * size * (slope[:, :, 0] ** 2).sum(axis=1)).max()))
        within = np.linspace(self.edges[0], self.edges[-1], POINTS_FOR_SIZE)[1:-1]
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
        for (a, b), sides, rows in zip(pairwise(self.edges), self.touched, self.multipliers, strict=True):
            # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
            low, high = (own_variable(found.arb(x), a, b) for x in (a, b))
            for side, powers in zip(sides, rows, strict=True):
                poly = found.arb_poly([found.arb(-side.sign * float(c)) for c in powers])
                if not positive(poly, low.lower(), high.upper()):
                    raise Unproved("the multiplier of a bound is not proved to have its sign")

    def above(self, setting: Setting) -> Attained:
        """A curve near that of a setting that is proved to lie within the bounds; Unproved if none is."""
        return Within(self, setting).attained()


def _powers_of(mu: np.ndarray, sign: float, size: float) -> np.ndarray:
    """Coefficients in powers of a multiplier of the right sign, close to that of the curve.

    On short pieces about the place where the curve comes to a bound it is known but roughly: its mean will do, as any
    of that sign would.
    """
    series = fitted(mu, BOUND_NOISE * size)
    powers = in_powers(series)
    wrong = float((sign * series(np.linspace(-1.0, 1.0, POINTS_FOR_SIZE))).max())
    if len(powers) > CURVE_DEGREE or wrong > SLIGHT * size:
        powers = np.array([-sign * max(0.0, -sign * mean_inside(mu))])
        wrong = 0.0
    powers[0] -= sign * (BOUND_NOISE * size + max(0.0, wrong))
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
    first = Bounds(along)
    along = first.at_contacts() or along
    found = [Bounds(along, weight) for weight in WEIGHTS]
    return found if found[0].on_the_curve else found[:1]
