"""Kinks that a Lagrangian names, convex ones: lines of support take their place below, and the curve itself is above.

With c phi(e) in L, c(x) >= 0 and phi convex, the Lagrangian with a line of support of phi in its place is smooth and
nowhere more than L, so what is proved of its integral bounds that of L from below (Ekeland and Temam, "Convex Analysis
and Variational Problems", ch. III). Where the curve follows a kink its slope is what the Euler-Lagrange equation asks
for, a subgradient. Of L's integral itself along the solution's curve the rest is a bound.
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
from varcalc.certificates.convex_terms import FOLLOWED, ConvexTerm
from varcalc.certificates.curve import (
    CURVE_DEGREE,
    Piece,
    fitted,
    in_powers,
    mean_inside,
    nodes_within,
    own_variable,
    polynomial_at,
    sampled,
    widened,
)
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.kink_reading import convex_terms
from varcalc.certificates.levels import meeting
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting, as_graph, setting_of
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement, statement
from varcalc.problem.conditions import Isoperimetric, Through
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.given_curve import DISTINCT_NODES, distinct

POINTS_FOR_SIGNS = 33
"""Points of a piece at which signs are looked at."""
MARGIN, SUBGRADIENT_NOISE = 1e-13, 1e-11
"""What a subgradient is shrunk by to stay within its bounds; coefficients, relative to it, that are left out."""
ROUGH = 1e-2
"""What a subgradient may be more than 1 by in size between the nodes, where it is shrunk."""
PLAUSIBLE = 1.5
"""Size of a subgradient from which on the curve does not follow the kink."""
MOST_SIGN_BOXES = 400
"""Boxes of one piece of which signs are looked at."""


@dataclass(frozen=True)
class Kinked:
    """A curve of a Lagrangian that is ``smooth`` plus what ``kinks`` add, in the minimising sense."""

    along: AlongCurve
    smooth: Expression
    kinks: Sequence[ConvexTerm]

    @cached_property
    def edges(self) -> list[float]:
        """Abscissae between which each kink is on one side of the curve, or is followed by it."""
        vertices = distinct(self.along.vertices)
        mesh = np.concatenate([np.linspace(a, b, POINTS_FOR_SIGNS) for a, b in pairwise(vertices)])
        crossings: list[float] = []
        for k, arguments in enumerate(self._arguments(mesh).T):
            for at in self.kinks[k].breaks:
                values = arguments - at
                seen = np.abs(values) > FOLLOWED * self._sizes[k]
                changes = np.flatnonzero((values[1:] * values[:-1] < 0) & (seen[1:] | seen[:-1]))
                crossings += [self._crossing(k, at, mesh[i], mesh[i + 1]) for i in changes]
        # of what all but coincides the vertex is taken: beside it the curve is another polynomial
        alike = DISTINCT_NODES * (vertices[-1] - vertices[0])
        apart = [x for x in crossings if np.abs(vertices - x).min() > alike]
        # a mesh may end a bit of round-off before or after the interval does
        return [self.along.span[0], *distinct(np.append(vertices, apart))[1:-1].tolist(), self.along.span[1]]

    def _crossing(self, number: int, at: float, a: float, b: float) -> float:
        """Where a kink's argument goes through a break between a and b; that of the two where it all but does."""

        def argument(x: float) -> float:
            return float(self._arguments(np.array([x]))[0, number]) - at

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
        return np.abs(self._arguments(np.linspace(a, b, 8 * POINTS_FOR_SIGNS)[1:-1])).max(axis=0)

    @cached_property
    def sides(self) -> list[list[int]]:
        """Of each piece the side of each kink that the curve is on."""
        rows = []
        for a, b in pairwise(self.edges):
            columns = self._arguments(np.linspace(a, b, POINTS_FOR_SIGNS)[1:-1]).T
            rows.append([k.side(*one) for k, *one in zip(self.kinks, columns, self._sizes.tolist(), strict=True)])
        if any(sum(k.follows(side) for k, side in zip(self.kinks, row, strict=True)) > 1 for row in rows):
            raise Unproved("a curve that follows several kinks at once is not covered")
        return rows

    @cached_property
    def subgradients(self) -> list[list[np.ndarray]]:
        """Coefficients, in powers of each piece's own variable, of each kink's sigma or of the place m of its line."""
        rows = [[np.zeros(1) for _ in row] for row in self.sides]
        for number, row in enumerate(self.sides):
            for k, (side, kink) in enumerate(zip(row, self.kinks, strict=True)):
                if kink.follows(side):
                    rows[number][k] = self._subgradient(number, k)
                elif kink.between(side) is not None:
                    rows[number][k] = self._place(number, k)
        return rows

    def _place(self, number: int, k: int) -> np.ndarray:
        """m of a line of support: the argument along the curve, a little within the part that the line is of."""
        between, size = self.kinks[k].between(self.sides[number][k]), MARGIN * self._sizes[k]
        assert between is not None
        low, high = (None if end is None else float(end.mid()) for end in between)
        values = self._arguments(nodes_within(*self._piece(number)))[:, k]
        powers = in_powers(fitted(values, size))
        reached = np.polynomial.polynomial.polyval(np.linspace(-1.0, 1.0, 8 * POINTS_FOR_SIGNS), powers)
        under = 0.0 if low is None else size + max(0.0, low - float(reached.min()))
        over = 0.0 if high is None else size + max(0.0, float(reached.max()) - high)
        if low is not None and high is not None:
            powers *= 1.0 - (under + over) / (high - low)
            powers[0] += (high * under + low * over) / (high - low)
        else:
            powers[0] += under - over
        return powers

    def _subgradient(self, number: int, k: int) -> np.ndarray:
        """Sigma of a kink that is followed, from the Euler-Lagrange equation on that piece."""
        s, kink = self.along.symbols, self.kinks[k]
        (a, b), row = self._piece(number), self.sides[number]
        rest = self.smooth + sum(other.expression(side) for side, other in zip(row, self.kinks, strict=True))
        rest += sum(float(c) * g for c, g in zip(self.along.lambdas, self.along.integrals, strict=True))
        size = kink.turn(row[k])
        by_y, by_v = ca.depends_on(kink.argument, s.y), ca.depends_on(kink.argument, s.dy)
        if by_y and by_v:
            raise Unproved("a curve that follows a kink in both the curve and its slope is not covered")
        x = nodes_within(a, b)
        column = [ca.gradient(rest, s.y), ca.gradient(rest, s.dy), ca.gradient(size, s.dy if by_v else s.y)]
        force, momentum, bend = (v[:, :, 0] for v in self.along.function(*map(ca.densify, column))(x))
        scale = (bend**2).sum(axis=1)
        if by_y:
            rate = differentiation(CURVE_DEGREE) @ momentum / (0.5 * (b - a))
            sigma = ((rate - force) * bend).sum(axis=1) / scale
            # where a mesh is fine about a kink that is gone through the curve seems to follow it on a piece
            return _shrunk(sigma if np.abs(sigma).max() < PLAUSIBLE else self._between(number, k, 0.0 * sigma))
        grown = 0.5 * (b - a) * np.linalg.solve(differentiation(CURVE_DEGREE)[1:, 1:], force[1:])
        p = np.vstack([np.zeros((1, force.shape[1])), grown])
        return _shrunk(self._between(number, k, ((p - momentum) * bend).sum(axis=1) / scale))

    def _between(self, number: int, k: int, values: np.ndarray) -> np.ndarray:
        """Sigma up to a constant as it goes on from the pieces beside: momenta are continuous."""
        followed, there = self.sides[number][k], range(len(self.sides))
        beside = [int(np.sign(self.sides[n][k] - followed)) if n in there else 0 for n in (number - 1, number + 1)]
        missed = [side - values[at] for side, at in zip(beside, (0, -1), strict=True) if side]
        if not missed:
            return values - 0.5 * (values.max() + values.min())
        return (
            values
            + np.linspace(missed[0], missed[-1], 2)[0]
            + (missed[-1] - missed[0]) * 0.5 * (1 + nodes(CURVE_DEGREE))
        )

    @property
    def met(self) -> bool:
        """Whether the curve follows a kink, or goes through one."""
        rows = self.sides
        return len({*map(tuple, rows)}) > 1 or any(k.on(side) for k, side in zip(self.kinks, rows[0], strict=True))

    def guess(self, at: Any) -> np.ndarray:
        """A curve close to the solution's, in far less time than it takes where corners were unknown."""
        x, rows = self._polygon
        return np.array([np.interp(at, x, row) for row in rows])

    @cached_property
    def _polygon(self) -> tuple[np.ndarray, np.ndarray]:
        x = np.concatenate([np.linspace(a, b, POINTS_FOR_SIGNS) for a, b in pairwise(self.edges)])
        return x, self.along.evaluate(x, 0)

    def _piece(self, number: int) -> tuple[float, float]:
        return self.edges[number], self.edges[number + 1]

    def lower(self, problem: Problem) -> Problem:
        """The problem of the Lagrangian with sigma e in place of each |e|."""
        integrand = problem.sign * self._stated(below=True)
        return problem.with_integrand(integrand, breakpoints=tuple(self.edges[1:-1]))

    def _stated(self, *, below: bool) -> Expression:
        """The Lagrangian with lines of support for kinks: ``below``, or only where the curve follows a break."""
        found = self.smooth
        for k, kink in enumerate(self.kinks):
            parts = [
                (kink.below if below else kink.along)(row[k], self._polynomial(number, powers[k]))
                for number, (row, powers) in enumerate(zip(self.sides, self.subgradients, strict=True))
            ]
            found = found + self._pieced(parts)
        return found

    def _polynomial(self, number: int, powers: np.ndarray) -> Expression:
        """A polynomial in the variable of a piece."""
        return polynomial_at(own_variable(self.along.symbols.x, *self._piece(number)), powers.tolist())

    def _pieced(self, values: Sequence[Expression]) -> Expression:
        """Of expressions that of the piece on which x lies."""
        x, found = self.along.symbols.x, ca.SX(0)
        for number, value in enumerate(values):
            a, b = self._piece(number)
            found = ca.if_else(ca.logic_and(x >= a, x < b), value, found)
        return found

    def prove(self) -> None:
        """Prove each sigma in [-1, 1], and each line of support one of the part it is of; Unproved where it may not."""
        found = flint()
        for number, (sides, row) in enumerate(zip(self.sides, self.subgradients, strict=True)):
            a, b = self._piece(number)
            # the piece's own variable, whose numbers are rounded, may leave [-1, 1] a little
            low, high = (own_variable(found.arb(x), a, b) for x in (a, b))
            for kink, side, powers in zip(self.kinks, sides, row, strict=True):
                poly, between = found.arb_poly([found.arb(float(c)) for c in powers]), kink.between(side)
                least, most = (found.arb(-1), found.arb(1)) if kink.follows(side) else between or (None, None)
                told = "what takes the place of a kink is not proved to be a subgradient of it"
                told = "a line of support is not proved to touch the part it is of" if between else told
                above = [] if least is None else [poly - least]
                for rest in [*above, *([] if most is None else [most - poly])]:
                    if not positive(rest, low.lower(), high.upper()):
                        raise Unproved(told)

    def above(self, setting: Setting) -> Attained:
        """A curve near the solution's, with the value of L; ``setting`` is that of :meth:`lower`."""
        vertices = np.array([*(s.start for s in setting.samples), self.edges[-1]])
        own = statement(replace(self.along, integrand=self._stated(below=False), vertices=vertices))
        found = setting_of(own, sampled(own), float(setting.along.value.mid()))
        value, moved = found.along.value, [flint().arb(0)] * (own.states + own.n)
        if own.levels:
            met = meeting(found)
            moved, value = met.moved(), value + met.correction()
            for c, condition in zip(self.along.lambdas, self.along.form.conditions.integrals, strict=True):
                value -= flint().arb(float(c)) * condition.lower
        value += sum((self._excess(own, piece, moved) for piece in found.pieces), flint().arb(0))
        return Attained(value, found.pieces, moved)

    @cached_property
    def _program(self) -> Program:
        rows = [ca.vertcat(*(k.factor for k in self.kinks)), ca.vertcat(*(k.argument for k in self.kinks))]
        return Program(ca.Function("kinks", self.along.symbols.all, list(map(ca.densify, rows))))

    def _excess(self, stated: Statement, piece: Piece, moved: Sequence[Ball]) -> Ball:
        """The integral over a piece of c (|e| - sigma e), from above, of a curve that is ``moved`` a little.

        Unproved where c may be negative.
        """
        total, sides = flint().arb(0), self.sides[int(np.searchsorted(self.edges, float(piece.centre.mid()))) - 1]
        waiting, most = deque([piece.box()]), MOST_SIGN_BOXES
        while waiting:
            box, most = waiting.popleft(), most - 1
            try:
                factors, arguments = self._on(stated, piece, box, moved)
            except Undecided as undecided:
                raise Unproved(f"a kink is not enclosed near {box.at:.6g}: {undecided}") from None
            if not all(factor >= 0 for factor in factors):
                raise Unproved("what a kink is multiplied by is not proved positive")
            off = [kink.beyond(e, side) for kink, e, side in zip(self.kinks, arguments, sides, strict=True)]
            known = all(kink.on(side) or one.is_zero() for kink, one, side in zip(self.kinks, off, sides, strict=True))
            if not known and most > 0 and not box.narrow:
                waiting += box.halves()
            else:
                more = [one + kink.slack for kink, one in zip(self.kinks, off, strict=True)]
                total += 2 * box.unit * sum((f * one).upper() for f, one in zip(factors, more, strict=True))
        return total

    def _on(self, stated: Statement, piece: Piece, box: Box, moved: Sequence[Ball]) -> list[list[Ball]]:
        """The factors and the arguments of the kinks on a box."""
        around = Around(box, 1, whole=True)
        states, controls = piece.lifted(around)
        if stated.levels:
            states, controls = widened(stated, states, controls, moved)
        arguments = stated.arguments(Jet(around.abscissa()), [Jet(s) for s in states], [Jet(s) for s in controls])
        return [[flint().arb(0) + head(jet.value) for jet in row] for row in jets(self._program, arguments[:-2], 0)]


def _shrunk(values: np.ndarray) -> np.ndarray:
    """A polynomial in powers, within [-1, 1] where ``values`` at the nodes all but are."""
    series = fitted(values, SUBGRADIENT_NOISE)
    # as it is with what was left out: next to a piece beside the kink it is 1 or -1
    t = np.linspace(-1.0, 1.0, 8 * POINTS_FOR_SIGNS)
    reached = np.abs(series(t))
    if reached[1:-1].max() > 1.0 + ROUGH:
        # round-off, on a short piece about where the curve comes to the kink: any subgradient will do
        return np.array([(1 - MARGIN) * min(1.0, max(-1.0, mean_inside(values))), 0.0])
    # between two points it may be more, by what its second derivative makes of half their distance
    between = float(np.abs(series.deriv(2)(t)).max()) * (t[1] - t[0]) ** 2 / 8 if len(series.coef) > 2 else 0.0
    size = max(1.0, float(reached[0]), float(reached[-1]), float(reached[1:-1].max()) + between)
    return np.r_[in_powers(series) * ((1 - MARGIN) / size), 0.0]


def kinks(solution: Solution) -> Kinked | None:
    """What is convex in a graph's Lagrangian but has kinks; None where there are none, or of another kind."""
    problem = solution.problem
    if not isinstance(problem, Problem) or problem.symbols.kind is not ca.SX or problem.order == 2:
        return None
    covered = all(isinstance(c, Through) or (isinstance(c, Isoperimetric) and c.equality) for c in problem.constraints)
    along = as_graph(solution) if covered and problem.end_cost is None else None
    if along is None:
        return None
    read = convex_terms(along.symbols, along.integrand, problem.parameter_values.tolist())
    return None if read is None else Kinked(along, *read)
