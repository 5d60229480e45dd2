"""Kinks that a Lagrangian names, convex ones: |e| is at least sigma e for any sigma(x) between -1 and 1.

With c |e| in L, c(x) >= 0, the Lagrangian with c sigma e in its place is smooth and nowhere more than L, so what is
proved of its integral bounds that of L from below (Ekeland and Temam, "Convex Analysis and Variational Problems", ch.
III). Where the curve keeps off the kink sigma is the sign of e; where it follows the kink sigma is what the
Euler-Lagrange equation asks for, a subgradient. Of L's integral itself along the solution's curve the rest is a bound.
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
KINKS = {ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN}


@dataclass(frozen=True)
class Kink:
    """``factor`` times the size of ``argument``, expressions in the symbols of the problem."""

    factor: Expression
    argument: Expression

    @property
    def expression(self) -> Expression:
        """The two multiplied: what the kink adds where the argument is positive."""
        return self.factor * self.argument


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
        if any(row.count(0) > 1 for row in rows):
            raise Unproved("a curve that follows several kinks at once is not covered")
        return rows

    @cached_property
    def subgradients(self) -> list[list[np.ndarray]]:
        """Coefficients, in powers of each piece's own variable, of the factor sigma of each kink."""
        rows = [[np.array([float(sign)]) for sign in row] for row in self.signs]
        for number, row in enumerate(self.signs):
            if 0 in row:
                rows[number][row.index(0)] = self._subgradient(number, row.index(0))
        return rows

    def _subgradient(self, number: int, k: int) -> np.ndarray:
        """Sigma of a kink that is followed, from the Euler-Lagrange equation on that piece."""
        s, kink = self.along.symbols, self.kinks[k]
        (a, b), row = self._piece(number), self.signs[number]
        rest = self.smooth + sum(float(sign) * other.expression for sign, other in zip(row, self.kinks, strict=True))
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
        s, total = self.along.symbols, self.smooth
        for k, kink in enumerate(self.kinks):
            sigma = s.kind(0)
            for number, powers in enumerate(row[k] for row in self.subgradients):
                a, b = self._piece(number)
                value, t = s.kind(0), (2 * s.x - (a + b)) / (b - a)
                for c in powers[::-1]:
                    value = value * t + float(c)
                sigma = ca.if_else(ca.logic_and(s.x >= a, s.x < b), value, sigma)
            total = total + sigma * kink.factor * kink.argument

        def put(traced: TracedFunction) -> TracedFunction:
            return traced

        (_, *ends, constraints), options = problem.sent(put)
        arguments = [s.x, s.y, s.dy, s.parameters, s.unknowns]
        function = ca.Function("traced", arguments, [problem.sign * total])
        lagrangian = TracedFunction(function, (tuple(problem.parameters), tuple(problem.unknowns)))
        found = rebuilt(Problem, (lagrangian, *ends, constraints), options | {"breakpoints": tuple(self.edges[1:-1])})
        assert isinstance(found, Problem)
        return found

    def prove(self) -> None:
        """Prove that no sigma leaves [-1, 1], and that no kink is turned over; Unproved where that may be."""
        found = flint()
        for number, row in enumerate(self.subgradients):
            a, b = self._piece(number)
            # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
            low, high = ((2 * found.arb(x) - (a + b)) / (b - a) for x in (a, b))
            for powers in row:
                for way in (1, -1) if len(powers) > 1 else ():
                    poly = 1 - way * found.arb_poly([found.arb(float(c)) for c in powers])
                    if not positive(poly, low.lower(), high.upper()):
                        raise Unproved("what takes the place of a kink is not proved to be a subgradient of it")

    def above(self, setting: Setting) -> Attained:
        """A curve near the solution's, with the value of L; ``setting`` is that of :meth:`lower`."""
        vertices = np.array([float(s.x[0]) for s in setting.samples] + [self.edges[-1]])
        own = statement(replace(setting.statement.along, evaluate=self.along.evaluate, vertices=vertices))
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
                total += 2 * box.unit * sum(_beyond(*each) for each in zip(factors, arguments, signs, strict=True))
        return total

    def _on(self, stated: Statement, piece: Piece, box: Box) -> list[list[Ball]]:
        """The factors and the arguments of the kinks on a box."""
        around = Around(box, 1, whole=True)
        states, controls = piece.lifted(around)
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [[flint().arb(0) + head(jet.value) for jet in row] for row in jets(self._program, arguments[:-2], 0)]


def _beyond(factor: Ball, argument: Ball, sign: int) -> Ball:
    """How much c |e| may exceed c sigma e."""
    if not factor >= 0:
        raise Unproved("what a kink is multiplied by is not proved positive")
    if (sign > 0 and argument >= 0) or (sign < 0 and argument <= 0):
        return flint().arb(0)
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
    arguments: list[Expression] = []
    sizes: list[Expression] = []

    def size(e: Expression) -> Expression:
        for known, symbol in zip(arguments, sizes, strict=True):
            if ca.is_equal(known, e, DEEPEST):
                return symbol
        arguments.append(e)
        sizes.append(ca.SX.sym("size"))
        return sizes[-1]

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        a, b = operands[0], operands[-1]
        if operation in KINKS and ca.depends_on(ca.vertcat(a, b), ca.vertcat(curve, *sizes)):
            if operation == ca.OP_FABS:
                return size(a)
            # fmax and fmin are half the sum, and half the size of the difference more or less
            return (a + b) / 2 + (1 if operation == ca.OP_FMAX else -1) * size(a - b) / 2
        return operate(operation, operands)

    entries = [ca.vertsplit(s) if s.numel() else [] for s in symbols]
    program = Program(ca.Function("L", symbols, [integrand]))
    total = program.run(entries, ca.SX, applied)[0][0]
    if not sizes:
        return None
    column = ca.vertcat(*sizes)
    function = ca.Function("L", [*symbols, column], [total])
    watched = [[False] * int(s.numel()) for s in symbols]
    factors = ca.gradient(total, column)
    nested = ca.depends_on(ca.vertcat(*arguments), column)
    if nested or degrees(function, [*watched, [True] * len(sizes)])[0][0] > 1.0 or ca.depends_on(factors, curve):
        return None
    smooth = ca.substitute([total], [column], [ca.SX.zeros(len(sizes))])[0]
    return smooth, [Kink(f, e) for f, e in zip(ca.vertsplit(ca.densify(factors)), arguments, strict=True)]
