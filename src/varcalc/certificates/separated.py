"""Lengths that begin where a power of the depth makes the metric infinite: Hamilton and Jacobi's equation, separated.

Let the metric be n = N^(1/2) u^(-r/2), 0 < r < 2, at the depth u below a line through an end. By Cauchy and Schwarz
n |(x', u')| >= p x' + (n^2 - p^2)^(1/2) u' for each p, where n >= p. So any curve from the line to the depth u and the
distance x, that goes no deeper than where n = p, is no shorter than

    p x + W(p, u),   W(p, u) = integral of (n^2 - p^2)^(1/2) from 0 to u,

with equality for the ray whose momentum along the line is p (Landau and Lifshitz, "Mechanics", sect. 48). W is a
binomial series in p^2 u^r/N. With p = p0 + c (u - u0), whatever c, the bound is one by a quadratic in u - u0. It is
made the cost of a free end at a place x0 where the metric is regular, for the rest of the curve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, below, flint
from varcalc.certificates.degree import degrees
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.statement import squared
from varcalc.problem.conditions import Fixed, Free
from varcalc.problem.functional import unused_names
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression

RATIO = 0.25
"""p^2 u^r/N at the place up to which the curve is bounded so: it turns where that is 1."""
GREATEST_SHARE, SURROUNDINGS = 0.5, 2.0**-9
"""Greatest share of the interval for that, and how far curves may lie from this one at its end, relative to u."""
SERIES_TERMS = 80
"""Terms of the series."""
LESS_BENT = 2.0**-10
"""What the cost bends less than the bound, relative to it."""
REFINEMENTS = 8
"""Of Newton's method for p."""
COST = ["cost_slope", "cost_bend", "cost_place"]
"""The parameters of the cost."""

Powers = list[tuple[Expression, Fraction]]


@dataclass(frozen=True)
class Depths:
    """W and its derivatives, for the metric N^(1/2) u^(-r/2)."""

    N: Ball
    r: Fraction

    def _sum(self, power: Fraction, first: Fraction, p: Ball, u: Ball) -> Ball:
        """The integral from 0 to u of v^(first - 1) (1 - p^2 v^r/N)^power, -2 < power < 1."""
        arb = flint().arb
        r, a, e = (arb(f.numerator) / f.denominator for f in (self.r, power, first))
        ratio = p * p / self.N * u**r
        if not ratio * 3 < 2:
            raise Unproved("beside the line where L is infinite curves may go deeper than where they turn")
        term, total = u**e, arb(0)
        for k in range(SERIES_TERMS):
            total += term / (e + r * k)
            term *= (k - a) / (k + 1) * ratio
        # from term to term they fall by the ratio times (k - a)/(k + 1) < 3/2 at least
        rest = abs(term) / (e + r * SERIES_TERMS) / (1 - ratio * 3 / 2)
        return total + arb(0, 1) * rest.upper()

    @property
    def _size(self) -> Ball:
        return self.N.sqrt()

    def value(self, p: Ball, u: Ball) -> Ball:
        """W."""
        return self._size * self._sum(Fraction(1, 2), 1 - self.r / 2, p, u)

    def across(self, p: Ball, u: Ball) -> Ball:
        """-W_p: how far along the line the ray of momentum p has come at the depth u."""
        return p / self._size * self._sum(Fraction(-1, 2), 1 + self.r / 2, p, u)

    def spread(self, p: Ball, u: Ball) -> Ball:
        """-W_pp: by how much farther that is for a little more momentum."""
        return self._sum(Fraction(-3, 2), 1 + self.r / 2, p, u) / self._size

    def slope(self, p: Ball, u: Ball) -> Ball:
        """W_u."""
        return (self.square(u) - p * p).sqrt()

    def bend(self, p: Ball, u: Ball, c: Ball) -> Ball:
        """The second derivative of W(p + c h, u + h) by h."""
        slope, r = self.slope(p, u), flint().arb(self.r.numerator) / self.r.denominator
        return -(r * self.square(u) / u / 2 + 2 * c * p) / slope - c * c * self.spread(p, u)

    def square(self, u: Ball) -> Ball:
        """The square of the metric at the depth u."""
        return self.N / u ** (flint().arb(self.r.numerator) / self.r.denominator)


@dataclass(frozen=True)
class Separated:
    """A length from the ``end`` (0 or 1) of a graph at which the metric is infinite, parted where x is ``at``.

    ``u`` is the depth there, ``y`` what it is at, ``side`` the sign of y less that on the line.
    """

    problem: Problem
    depths: Depths
    end: int
    at: float
    y: float
    side: int
    guess: Any

    def moved(self, y: float) -> Separated:
        """The same, parted where y is another."""
        return replace(self, y=y)

    @property
    def _line(self) -> Ball:
        return flint().arb(float((self.problem.start, self.problem.end)[self.end].values(1)[0]))

    def _depth(self, y: float) -> Ball:
        return (flint().arb(y) - self._line) * self.side

    @cached_property
    def _x(self) -> Ball:
        """The distance along the line."""
        return abs(flint().arb(self.at) - self.problem.span[self.end])

    @cached_property
    def _p(self) -> Ball:
        """The momentum of the ray to the place; it need not be known exactly."""
        u = self._depth(self.y)
        p = (RATIO * self.depths.square(u)).sqrt().mid()
        for _ in range(REFINEMENTS):
            p = (p + (self._x - self.depths.across(p, u)) / self.depths.spread(p, u)).mid()
        return p

    @cached_property
    def room(self) -> float:
        """How far from the curve others may lie."""
        return SURROUNDINGS * below(self._depth(self.y))

    @cached_property
    def _turned(self) -> Ball:
        """The c of the best bound, about."""
        u = self._depth(self.y)
        return (-self._p / self.depths.slope(self._p, u) / self.depths.spread(self._p, u)).mid()

    @cached_property
    def _bend(self) -> Ball:
        """What the best bound bends by, wherever the curves of the room are that end a little off the place."""
        near, c = flint().arb(0, 2 * self.room), self._turned
        return self.depths.bend(self._p + c * near, self._depth(self.y) + near, c)

    @cached_property
    def cost(self) -> tuple[float, float]:
        """Slope and bend of the cost in the depth."""
        slope = self.depths.slope(self._p, self._depth(self.y))
        return float(slope.mid()), below(self._bend - LESS_BENT * abs(self._bend))

    def _check_sign(self) -> None:
        """Unproved where L, of which the square was read, is not proved positive at the place: it vanishes nowhere."""
        s, ball = self.problem.symbols, flint().arb
        place = [[Jet(ball(v))] for v in (self.at, self.y, 0.0)]
        given = [*place, [], [Jet(ball(float(v))) for v in self.problem.parameter_values], []]
        if not ball(0) + jets(Program(ca.Function("L", s.all, [self.problem.integrand])), given, 0)[0][0].value > 0:
            raise Unproved("the length is not proved positive")

    def lower(self) -> Ball:
        """What the length up to the place is at least, less the cost."""
        self._check_sign()
        (slope, bend), u = self.cost, self._depth(self.y)
        missed = self._turned * (self._x - self.depths.across(self._p, u)) + self.depths.slope(self._p, u) - slope
        room = self._bend - bend
        if not room > 0:
            raise Unproved("beside the line where L is infinite its bound is not proved")
        return self._p * self._x + self.depths.value(self._p, u) - missed * missed / (2 * room)

    def upper(self, y: float) -> Ball:
        """What the ray to the place comes to at most, if it ends at ``y``."""
        u = self._depth(y)
        near = self._p * (1 + flint().arb(0, SURROUNDINGS))
        if not abs(y - self.y) <= self.room or not (
            self.depths.across(near.lower(), u) < self._x and self.depths.across(near.upper(), u) > self._x
        ):
            raise Unproved("the ray to the place where the curve is parted is not proved to exist")
        missed = self._x - self.depths.across(self._p, u)
        return self._p * self._x + self.depths.value(self._p, u) + missed * missed / (2 * self.depths.spread(near, u))

    def rest(self) -> Problem:
        """The problem of the rest of the curve, from a free end that costs what was left out."""
        slope, bend = self.cost
        added = unused_names(self.problem, COST)
        numbers = dict(zip(added, (self.side * slope, bend, self.y), strict=True))

        def cost(x0: Any, y0: Any, x1: Any, y1: Any, p: Any) -> Any:
            """What was left out, to the second order in how far the end lies from where it was cut off."""
            by_slope, by_bend, place = (getattr(p, name) for name in added)
            off = (y1 if self.end else y0) - place
            return by_slope * off + by_bend * off**2 / 2

        symbols = self.problem.symbols.kind.sym("numbers", len(numbers))
        end = {"end" if self.end else "start": Free(self.at)}
        return self.problem.with_integrand(self.problem.integrand, numbers, symbols, end_cost=cost, **end)


def separated(solution: Solution) -> Separated | None:
    """A length whose metric is a power of the depth below a line through one end; None where it is no such."""
    problem = solution.problem
    if not isinstance(problem, Problem) or solution.curve is None or problem.symbols.kind is not ca.SX:
        return None
    held = problem.constraints or problem.end_cost is not None or problem.unknowns or any(problem.slides)
    if held or problem.order == 2 or problem.n > 1 or problem.maximise or problem.start.periodic:
        return None
    ends = (problem.start, problem.end)
    read = _metric(problem)
    if read is None:
        return None
    for end in (0, 1):
        depths = _below(problem, *read, ends[end]) if isinstance(ends[end], Fixed) else None
        if depths is not None:
            return _parted(solution, problem, *depths, end)
    return None


def _parted(solution: Solution, problem: Problem, depths: Depths, side: int, end: int) -> Separated | None:
    """A place on the curve where the metric is regular, and the curve not yet turned."""
    (a, b), sign = problem.span, 1 - 2 * end
    x = problem.span[end] + sign * GREATEST_SHARE * (b - a) * np.geomspace(2.0**-30, 1.0, 400)
    y, v = np.asarray(solution.y(x), dtype=float).reshape(-1), np.asarray(solution.dy(x), dtype=float).reshape(-1)
    u = side * (y - float((problem.start, problem.end)[end].values(1)[0]))
    steep = 1 / (1 + v**2)  # n/(1 + v^2)^(1/2) is the momentum
    serves = (u > 0) & (steep <= RATIO) & (side * sign * v > 0)
    count = int(np.argmin(serves)) if not serves.all() else len(x)
    if not count:
        return None
    k = count - 1
    return Separated(problem, depths, end, float(x[k]), float(y[k]), side, solution.y)


def _metric(problem: Problem) -> tuple[Powers, Fraction] | None:
    """What the square of the metric is a product of, and its constant factor; None where L is no length in it."""
    s = problem.symbols
    factor, H = squared(problem.sign * problem.integrand)
    powers = list(_factors(H, Fraction(1)))
    unit = [k for k, (e, power) in enumerate(powers) if power == 1 and _is_arc(e, s.dy)]
    if len(unit) != 1 or factor <= 0:
        return None
    powers.pop(unit[0])
    return None if any(ca.depends_on(e, ca.vertcat(s.x, s.dy)) for e, _ in powers) else (powers, factor)


def _is_arc(e: Expression, v: Expression) -> bool:
    """Whether an expression is 1 + v^2."""
    if not e.is_op(ca.OP_ADD):
        return False
    one, square = (e.dep(0), e.dep(1)) if e.dep(0).is_constant() else (e.dep(1), e.dep(0))
    return one.is_one() and square.is_op(ca.OP_SQ) and ca.is_equal(square.dep(0), v)


def _factors(e: Expression, power: Fraction) -> Powers:
    """The factors of a product, each with its power; of roots and powers what they are of."""
    if e.is_op(ca.OP_MUL) or e.is_op(ca.OP_DIV):
        return _factors(e.dep(0), power) + _factors(e.dep(1), power if e.is_op(ca.OP_MUL) else -power)
    if e.is_op(ca.OP_SQ) or e.is_op(ca.OP_SQRT):
        return _factors(e.dep(0), power * (2 if e.is_op(ca.OP_SQ) else Fraction(1, 2)))
    if e.is_op(ca.OP_INV):
        return _factors(e.dep(0), -power)
    if (e.is_op(ca.OP_POW) or e.is_op(ca.OP_CONSTPOW)) and e.dep(1).is_constant():
        return _factors(e.dep(0), power * Fraction(float(e.dep(1))))
    return [(e, power)]


def _below(problem: Problem, powers: Powers, factor: Fraction, end: Fixed) -> tuple[Depths, int] | None:
    """The metric below the line through an end, and on which side of it; None where it is no power there."""
    s, arb = problem.symbols, flint().arb
    place = [k for k, (e, _) in enumerate(powers) if ca.depends_on(e, s.y)]
    if len(place) != 1:
        return None
    base, power = powers[place[0]]
    function = ca.Function("factors", [s.y, s.parameters], [ca.vertcat(base, *(e for e, _ in powers))])
    if not -2 < power < 0 or degrees(function, [[True], [False] * len(problem.parameters)])[0][0] != 1.0:
        return None
    y = Jet(arb(float(end.values(1)[0])), {0: arb(1)})
    found = jets(Program(function), [[y], [Jet(arb(float(v))) for v in problem.parameter_values]], 1)[0]
    slope = arb(0) + found[0].first.get(0, 0)
    if not (arb(0) + found[0].value).is_zero() or slope.contains(0):
        return None
    N = arb(factor.numerator) / factor.denominator
    for k, (_, own) in enumerate(powers):
        base = abs(slope) if k == place[0] else arb(0) + found[k + 1].value
        if not base > 0:
            return None
        N *= base ** (arb(own.numerator) / own.denominator)
    return Depths(N, -power), 1 if slope > 0 else -1
