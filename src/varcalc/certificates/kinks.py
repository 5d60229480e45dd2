"""Kinks that a Lagrangian names, convex ones: |e| is at least sigma e for any sigma(x) between -1 and 1.

With c |e| in L, c(x) >= 0, the Lagrangian with c sigma e in its place is smooth and nowhere more than L, so what is
proved of its integral bounds that of L from below (Ekeland and Temam, "Convex Analysis and Variational Problems", ch.
III). Where the curve keeps off the kink sigma is the sign of e; where it follows the kink sigma is what the
Euler-Lagrange equation asks for, a subgradient. Of L's integral itself along the solution's curve the rest is a bound.

A power p > 1 of M = |e| or fmax(e, 0) is no kink, but has no second derivative there: M^p is at least its tangent
p m^(p-1) M - (p-1) m^p at any m(x) >= 0, and M at least e, -e or 0, whichever the curve is at.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from varcalc.certificates.balls import Around, Ball, Box, differentiation, flint, nodes
from varcalc.certificates.bounds import positive
from varcalc.certificates.curve import DEGREE, Piece, joint_states, nodes_within, pieces, sampled
from varcalc.certificates.degree import degrees
from varcalc.certificates.integrals import Unproved, along_curve
from varcalc.certificates.jets import Jet, Undecided, head, jets
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import Statement, statement
from varcalc.formulation.graph import graph_form
from varcalc.methods.answer import Extremal
from varcalc.problem.conditions import Through
from varcalc.problem.functional import rebuilt
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.instructions import Program, operate
from varcalc.symbolic.tracing import Expression, TracedFunction
from varcalc.verify.along_curve import AlongCurve, in_form
from varcalc.verify.given_curve import DISTINCT_NODES, distinct

FOLLOWED = 1e-6
"""Size of e, relative to its largest, within which a piece of the curve follows a kink."""
SAMPLES = 33
"""Points of a piece at which signs are looked at."""
MARGIN, NOISE = 1e-13, 1e-11
"""What a subgradient is shrunk by to stay within its bounds; coefficients, relative to it, that are left out."""
MOST_BOXES = 400
"""Boxes of one piece of which signs are looked at."""
DEEPEST = 20
"""Operations down to which the arguments of two kinks are compared."""
POWERS = {ca.OP_POW, ca.OP_CONSTPOW}
KINKS = {ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN}


@dataclass(frozen=True)
class Kink:
    """``factor`` times the size of ``argument``, expressions in the symbols of the problem.

    With a ``power`` beyond 1 it is that power of M, the size or, ``one_sided``, the positive part of the argument.
    """

    factor: Expression
    argument: Expression
    power: float = 1.0
    one_sided: bool = False

    @property
    def convex(self) -> bool:
        """Whether it is one of those that are bounded from below here, for a factor that is not negative."""
        return self.power > 1.0 or (self.power == 1.0 and not self.one_sided)

    def expression(self, sign: int) -> Expression:
        """What the kink adds where the argument has a sign."""
        if self.power == 1.0:
            return float(sign) * self.factor * self.argument
        return self.factor * self.branch(sign) ** self.power if self.rises(sign) else ca.SX(0)

    def rises(self, sign: int) -> bool:
        """Whether a power of M is not zero where the argument has a sign."""
        return sign > 0 or (sign < 0 and not self.one_sided)

    def branch(self, sign: int) -> Expression:
        """M where the argument has a sign."""
        return float(sign) * self.argument

    def tangent(self, sign: int, at: Expression) -> Expression:
        """What is nowhere more than the factor times M^p: the tangent where M is ``at``, on the side of a sign."""
        p = self.power
        if not self.rises(sign):
            return ca.SX(0)
        # p = 2 and 3 as they are carried out exactly
        slope = at if p == 2.0 else at ** (p - 1.0)
        return self.factor * slope * (p * self.branch(sign) - (p - 1.0) * at)


@dataclass(frozen=True)
class Kinked:
    """A curve of a Lagrangian that is ``smooth`` plus what ``kinks`` add, in the minimising sense."""

    along: AlongCurve
    smooth: Expression
    kinks: Sequence[Kink]

    @cached_property
    def edges(self) -> list[float]:
        """Abscissae between which each kink is on one side of the curve, or is followed by it."""
        vertices = distinct(self.along.vertices)
        mesh = np.concatenate([np.linspace(a, b, SAMPLES) for a, b in pairwise(vertices)])
        crossings: list[float] = []
        for k, values in enumerate(self._arguments(mesh).T):
            seen = np.abs(values) > FOLLOWED * self._sizes[k]
            changes = np.flatnonzero((values[1:] * values[:-1] < 0) & (seen[1:] | seen[:-1]))
            crossings += [self._crossing(k, mesh[i], mesh[i + 1]) for i in changes]
        # of what all but coincides the vertex is taken: beside it the curve is another polynomial
        alike = DISTINCT_NODES * (vertices[-1] - vertices[0])
        apart = [x for x in crossings if np.abs(vertices - x).min() > alike]
        # a mesh may end a bit of round-off before or after the interval does
        return [self.along.span[0], *distinct(np.append(vertices, apart))[1:-1].tolist(), self.along.span[1]]

    def _crossing(self, number: int, a: float, b: float) -> float:
        """Where a kink's argument changes its sign between a and b; that of the two where it all but vanishes."""

        def argument(x: float) -> float:
            return float(self._arguments(np.array([x]))[0, number])

        first, last = argument(a), argument(b)
        if first * last < 0:
            root: Any = brentq(argument, a, b)
            return root
        # round-off alone had another sign where it was evaluated among others
        return a if abs(first) < abs(last) else b

    def _arguments(self, x: np.ndarray) -> np.ndarray:
        """The kinks' arguments at x (m,), one column for each."""
        return self.along.function(ca.vertcat(*(k.argument for k in self.kinks)))(x)[0][:, :, 0]

    @cached_property
    def _sizes(self) -> np.ndarray:
        """The largest size of each argument along the curve."""
        a, b = self.along.span
        return np.abs(self._arguments(np.linspace(a, b, 8 * SAMPLES)[1:-1])).max(axis=0)

    @cached_property
    def signs(self) -> list[list[int]]:
        """Of each piece the sign of each kink's argument, 0 where the curve follows the kink."""
        rows = []
        for a, b in pairwise(self.edges):
            values = self._arguments(np.linspace(a, b, SAMPLES)[1:-1])
            largest = values[np.abs(values).argmax(axis=0), np.arange(len(self.kinks))]
            rows.append(np.where(np.abs(largest) > FOLLOWED * self._sizes, np.sign(largest), 0).astype(int).tolist())
        plain = [k for k, kink in enumerate(self.kinks) if kink.power == 1.0]
        if any([row[k] for k in plain].count(0) > 1 for row in rows):
            raise Unproved("a curve that follows several kinks at once is not covered")
        return rows

    @cached_property
    def subgradients(self) -> list[list[np.ndarray]]:
        """Coefficients, in powers of each piece's own variable, of the factor sigma of each kink; of a power, of m."""
        rows = [[np.array([float(sign)]) for sign in row] for row in self.signs]
        for number, row in enumerate(self.signs):
            for k, (sign, kink) in enumerate(zip(row, self.kinks, strict=True)):
                if kink.power > 1.0:
                    rows[number][k] = self._place(number, k) if kink.rises(sign) else np.zeros(1)
                elif not sign:
                    rows[number][k] = self._subgradient(number, k)
        return rows

    def _place(self, number: int, k: int) -> np.ndarray:
        """m of a power: M along the curve, a little more than nothing where it vanishes."""
        values = np.abs(self._arguments(nodes_within(*self._piece(number)))[:, k])
        size = MARGIN * self._sizes[k]
        series: Any = np.polynomial.Chebyshev.fit(nodes(DEGREE), values, DEGREE, domain=[-1, 1])
        powers: np.ndarray = series.trim(size).convert(kind=np.polynomial.Polynomial).coef
        lowest = float(np.polynomial.polynomial.polyval(np.linspace(-1.0, 1.0, 8 * SAMPLES), powers).min())
        powers[0] += size + max(0.0, -lowest)
        return powers

    def _subgradient(self, number: int, k: int) -> np.ndarray:
        """Sigma of a kink that is followed, from the Euler-Lagrange equation on that piece."""
        s, kink = self.along.symbols, self.kinks[k]
        (a, b), row = self._piece(number), self.signs[number]
        rest = self.smooth + sum(other.expression(sign) for sign, other in zip(row, self.kinks, strict=True))
        size = kink.factor * kink.argument
        by_y, by_v = ca.depends_on(kink.argument, s.y), ca.depends_on(kink.argument, s.dy)
        if by_y and by_v:
            raise Unproved("a curve that follows a kink in both the curve and its slope is not covered")
        x = nodes_within(a, b)
        column = [ca.gradient(rest, s.y), ca.gradient(rest, s.dy), ca.gradient(size, s.dy if by_v else s.y)]
        force, momentum, bend = (v[:, :, 0] for v in self.along.function(*map(ca.densify, column))(x))
        scale = (bend**2).sum(axis=1)
        if by_y:
            rate = differentiation(DEGREE) @ momentum / (0.5 * (b - a))
            return _shrunk(((rate - force) * bend).sum(axis=1) / scale)
        grown = 0.5 * (b - a) * np.linalg.solve(differentiation(DEGREE)[1:, 1:], force[1:])
        p = np.vstack([np.zeros((1, force.shape[1])), grown])
        return _shrunk(self._between(number, k, ((p - momentum) * bend).sum(axis=1) / scale))

    def _between(self, number: int, k: int, values: np.ndarray) -> np.ndarray:
        """Sigma up to a constant as it goes on from the pieces beside: momenta are continuous."""
        beside = [self.signs[n][k] if 0 <= n < len(self.signs) else 0 for n in (number - 1, number + 1)]
        missed = [side - values[at] for side, at in zip(beside, (0, -1), strict=True) if side]
        if not missed:
            return values - 0.5 * (values.max() + values.min())
        return values + np.linspace(missed[0], missed[-1], 2)[0] + (missed[-1] - missed[0]) * 0.5 * (1 + nodes(DEGREE))

    @property
    def met(self) -> bool:
        """Whether the curve follows a kink, or goes through one."""
        return len({tuple(row) for row in self.signs}) > 1 or 0 in self.signs[0]

    def guess(self, at: Any) -> np.ndarray:
        """A curve close to the solution's, in far less time than it takes where corners were unknown."""
        x, rows = self._polygon
        return np.array([np.interp(at, x, row) for row in rows])

    @cached_property
    def _polygon(self) -> tuple[np.ndarray, np.ndarray]:
        x = np.concatenate([np.linspace(a, b, SAMPLES) for a, b in pairwise(self.edges)])
        return x, self.along.evaluate(x, 0)

    def _piece(self, number: int) -> tuple[float, float]:
        return self.edges[number], self.edges[number + 1]

    def lower(self, problem: Problem) -> Problem:
        """The problem of the Lagrangian with sigma e in place of each |e|."""
        s, total = self.along.symbols, self._stated(below=True)

        def put(traced: TracedFunction) -> TracedFunction:
            return traced

        (_, *ends, constraints), options = problem.sent(put)
        arguments = [s.x, s.y, s.dy, s.parameters, s.unknowns]
        function = ca.Function("traced", arguments, [problem.sign * total])
        lagrangian = TracedFunction(function, (tuple(problem.parameters), tuple(problem.unknowns)))
        found = rebuilt(Problem, (lagrangian, *ends, constraints), options | {"breakpoints": tuple(self.edges[1:-1])})
        assert isinstance(found, Problem)
        return found

    def _stated(self, *, below: bool) -> Expression:
        """The Lagrangian with sigma e for each |e|, and for powers their tangents ``below``, or what the curve has."""
        total, rows = self.smooth, list(zip(self.signs, self.subgradients, strict=True))
        for k, kink in enumerate(self.kinks):
            given = [self._polynomial(n, powers[k]) for n, (_, powers) in enumerate(rows)]
            if kink.power == 1.0:
                total = total + self._pieced(given) * kink.factor * kink.argument
                continue
            sides = [signs[k] for signs, _ in rows]
            tangents = [kink.tangent(*each) for each in zip(sides, given, strict=True)]
            total = total + self._pieced(tangents if below else [kink.expression(sign) for sign in sides])
        return total

    def _polynomial(self, number: int, powers: np.ndarray) -> Expression:
        """A polynomial in the variable of a piece."""
        (a, b), x = self._piece(number), self.along.symbols.x
        value, t = ca.SX(0), (2 * x - (a + b)) / (b - a)
        for c in powers[::-1]:
            value = value * t + float(c)
        return value

    def _pieced(self, values: Sequence[Expression]) -> Expression:
        """Of expressions that of the piece on which x lies."""
        x, found = self.along.symbols.x, ca.SX(0)
        for number, value in enumerate(values):
            a, b = self._piece(number)
            found = ca.if_else(ca.logic_and(x >= a, x < b), value, found)
        return found

    def prove(self) -> None:
        """Prove that no sigma leaves [-1, 1], and that no kink is turned over; Unproved where that may be."""
        found = flint()
        for number, row in enumerate(self.subgradients):
            a, b = self._piece(number)
            # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
            low, high = ((2 * found.arb(x) - (a + b)) / (b - a) for x in (a, b))
            for kink, powers in zip(self.kinks, row, strict=True):
                ways = (1, -1) if len(powers) > 1 and kink.power == 1.0 else ()
                place = found.arb_poly([found.arb(float(c)) for c in powers])
                if kink.power > 1.0 and powers.any() and not positive(place, low.lower(), high.upper()):
                    raise Unproved("the place of a tangent is not proved positive")
                for way in ways:
                    poly = 1 - way * found.arb_poly([found.arb(float(c)) for c in powers])
                    if not positive(poly, low.lower(), high.upper()):
                        raise Unproved("what takes the place of a kink is not proved to be a subgradient of it")

    def above(self, setting: Setting) -> Attained:
        """A curve near the solution's, with the value of L; ``setting`` is that of :meth:`lower`."""
        vertices = np.array([float(s.x[0]) for s in setting.samples] + [self.edges[-1]])
        own = statement(replace(self.along, integrand=self._stated(below=False), vertices=vertices))
        samples = sampled(own)
        built = pieces(own, samples, joint_states(own, samples))
        tolerance = 1e-19 * (float(abs(setting.along.value).upper()) or 1.0)
        value = along_curve(own, built, setting.sizes, tolerance).value
        return Attained(value + sum((self._excess(own, piece) for piece in built), flint().arb(0)), built)

    @cached_property
    def _program(self) -> Program:
        rows = [ca.vertcat(*(k.factor for k in self.kinks)), ca.vertcat(*(k.argument for k in self.kinks))]
        return Program(ca.Function("kinks", self.along.symbols.all, list(map(ca.densify, rows))))

    def _excess(self, stated: Statement, piece: Piece) -> Ball:
        """The integral over a piece of c (|e| - sigma e), from above; Unproved where c may be negative."""
        total, signs = flint().arb(0), self.signs[int(np.searchsorted(self.edges, float(piece.centre.mid()))) - 1]
        waiting, most = deque([piece.box()]), MOST_BOXES
        while waiting:
            box, most = waiting.popleft(), most - 1
            try:
                factors, arguments = self._on(stated, piece, box)
            except Undecided as undecided:
                raise Unproved(f"a kink is not enclosed near {box.at:.6g}: {undecided}") from None
            unknown = any(sign and e.contains(0) for sign, e in zip(signs, arguments, strict=True))
            if unknown and most > 0 and not box.narrow:
                waiting += box.halves()
            else:
                each = zip(self.kinks, factors, arguments, signs, strict=True)
                total += 2 * box.unit * sum(_beyond(*one) for one in each)
        return total

    def _on(self, stated: Statement, piece: Piece, box: Box) -> list[list[Ball]]:
        """The factors and the arguments of the kinks on a box."""
        around = Around(box, 1, whole=True)
        states, controls = piece.lifted(around)
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [[flint().arb(0) + head(jet.value) for jet in row] for row in jets(self._program, arguments[:-2], 0)]


def _beyond(kink: Kink, factor: Ball, argument: Ball, sign: int) -> Ball:
    """How much c |e| may exceed c sigma e; c M^p what the curve's side makes of it."""
    if not factor >= 0:
        raise Unproved("what a kink is multiplied by is not proved positive")
    if (sign > 0 and argument >= 0) or (sign < 0 and argument <= 0):
        return flint().arb(0)
    if kink.power > 1.0:
        largest_size = abs(argument).upper()
        return (2 * factor * largest_size**kink.power).upper() if largest_size > 0 else flint().arb(0)
    return (2 * factor * abs(argument)).upper()


def _shrunk(values: np.ndarray) -> np.ndarray:
    """A polynomial in powers, within [-1, 1] where ``values`` at the nodes all but are."""
    series: Any = np.polynomial.Chebyshev.fit(nodes(DEGREE), values, DEGREE, domain=[-1, 1]).trim(NOISE)
    # as it is with what was left out: next to a piece beside the kink it is 1 or -1
    size = max(1.0, float(np.abs(series(np.linspace(-1.0, 1.0, 8 * SAMPLES))).max()))
    powers: np.ndarray = series.convert(kind=np.polynomial.Polynomial).coef
    return np.r_[powers * ((1 - MARGIN) / size), 0.0]


def kinks(solution: Solution) -> Kinked | None:
    """What is convex in a graph's Lagrangian but has kinks; None where there are none, or of another kind."""
    problem = solution.problem
    if not isinstance(problem, Problem) or problem.symbols.kind is not ca.SX or solution.curve is None:
        return None
    plain = problem.order == 1 and not any(problem.slides) and problem.end_cost is None and not problem.unknowns
    if not plain or not all(isinstance(c, Through) for c in problem.constraints):
        return None
    form = graph_form(problem)
    read = _read(form.symbols.all, form.integrand, ca.vertcat(form.symbols.y, form.symbols.dy))
    if read is None:
        return None
    extremal = Extremal(form, solution.curve, np.zeros(0), distinct(solution.x), np.zeros(0), {})
    return Kinked(in_form(extremal), *read)


def _read(symbols: list[Expression], integrand: Expression, curve: Expression) -> tuple[Expression, list[Kink]] | None:
    """An integrand as smooth terms and kinks of the curve; None where these come in another way, or there are none."""
    read = _Read(curve)
    entries = [ca.vertsplit(s) if s.numel() else [] for s in symbols]
    total = Program(ca.Function("L", symbols, [integrand])).run(entries, ca.SX, read.applied)[0][0]
    total = read.with_sizes(total)
    column = ca.vertcat(*read.symbols)
    kept = [k for k, symbol in enumerate(read.symbols) if ca.depends_on(total, symbol)]
    if not kept:
        return None
    function = ca.Function("L", [*symbols, column], [total])
    watched = [[False] * int(s.numel()) for s in symbols]
    factors = ca.vertsplit(ca.densify(ca.gradient(total, column)))
    nested = ca.depends_on(ca.vertcat(*(read.found[k].argument for k in kept)), column)
    if nested or degrees(function, [*watched, [True] * len(factors)])[0][0] > 1.0:
        return None
    if any(ca.depends_on(factors[k], curve) or not read.found[k].convex for k in kept):
        return None
    smooth = ca.substitute([total], [column], [ca.SX.zeros(len(factors))])[0]
    return smooth, [replace(read.found[k], factor=factors[k]) for k in kept]


class _Read:
    """Kinks as they are found, each with a symbol in its place."""

    def __init__(self, curve: Expression) -> None:
        self.curve = curve
        self.found: list[Kink] = []
        self.symbols: list[Expression] = []

    def place(self, e: Expression, power: float = 1.0, *, one_sided: bool = False) -> Expression:
        """The symbol of a power of |e|, or ``one_sided`` of the positive part of e."""
        if power % 2 == 0 and not one_sided:
            return e**power
        for kink, symbol in zip(self.found, self.symbols, strict=True):
            same = kink.power == power and kink.one_sided == one_sided
            if same and ca.is_equal(kink.argument, e, DEEPEST):
                return symbol
        self.found.append(Kink(ca.SX(0), e, power, one_sided))
        self.symbols.append(ca.SX.sym("size"))
        return self.symbols[-1]

    def applied(self, operation: int, operands: Sequence[Expression]) -> Expression:
        """An operation, with symbols in place of what has a kink in the curve."""
        a, b = operands[0], operands[-1]
        if operation in KINKS and ca.depends_on(ca.vertcat(a, b), ca.vertcat(self.curve, *self.symbols)):
            if operation == ca.OP_FABS:
                return self.place(a)
            if operation == ca.OP_FMAX and (a.is_zero() or b.is_zero()):
                return self.place(b if a.is_zero() else a, one_sided=True)
            # fmax and fmin are half the sum, and half the size of the difference more or less
            return (a + b) / 2 + (1 if operation == ca.OP_FMAX else -1) * self.place(a - b) / 2
        raised = self._raised(operation, a, b)
        return operate(operation, operands) if raised is None else raised

    def _raised(self, operation: int, a: Expression, b: Expression) -> Expression | None:
        """The power that an operation makes of a size; None where it makes another thing."""
        for base, other in ((a, b), (b, a)):
            kink = self._of(base)
            if kink is None:
                continue
            if operation == ca.OP_SQ:
                return self.place(kink.argument, 2.0 * kink.power, one_sided=kink.one_sided)
            if operation in POWERS and base is a and b.is_constant() and float(b) > 0:
                return self.place(kink.argument, float(b) * kink.power, one_sided=kink.one_sided)
            if operation == ca.OP_MUL:
                more = self._of(other)
                if more is not None and more.one_sided == kink.one_sided and self._alike(more.argument, kink.argument):
                    return self.place(kink.argument, kink.power + more.power, one_sided=kink.one_sided)
                if other.is_op(ca.OP_SQ) and self._alike(other.dep(0), kink.argument):
                    return self.place(kink.argument, kink.power + 2.0, one_sided=kink.one_sided)
        return None

    def _of(self, e: Expression) -> Kink | None:
        """What a symbol stands for; None for another expression."""
        return next((k for k, symbol in zip(self.found, self.symbols, strict=True) if ca.is_equal(symbol, e)), None)

    def _alike(self, a: Expression, b: Expression) -> bool:
        return bool(ca.is_equal(a, b, DEEPEST))

    def with_sizes(self, total: Expression) -> Expression:
        """An expression with half of e and of |e| in place of each positive part of e."""
        for kink, symbol in list(zip(self.found, self.symbols, strict=True)):
            if kink.one_sided and kink.power == 1.0 and ca.depends_on(total, symbol):
                half = (kink.argument + self.place(kink.argument)) / 2
                total = ca.substitute([total], [symbol], [half])[0]
        return total
