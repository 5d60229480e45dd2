"""Equations that hold all along the curve, phi(x, y) = 0: multipliers below, a curve that meets them exactly above.

With multipliers mu(x) and weights c, H = L + mu phi + c phi^2/2 is L on every admissible curve, so that what is proved
of its integral over all curves nearby bounds theirs from below (Bertsekas, "Constrained Optimization and Lagrange
Multiplier Methods", 1982, sect. 2.2, at each x). Of the upper bound the curve is y0 + phi_y^T e: that there is one
e(x) near zero with phi = 0 is proved by Newton's interval operator at all points of a box at once (Moore, Kearfott and
Cloud, "Introduction to Interval Analysis", SIAM 2009, sect. 8.4), and e' by differentiating the equation.

Ends and waypoints are doubles, and seldom lie on phi = 0 exactly: phi is then held to the lines between its values
there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Series, enclosed, flint, largest, solved
from varcalc.certificates.certificate import Hypothesis, Means
from varcalc.certificates.curve import Piece, fitted, in_powers, nodes_within, own_variable, polynomial_at
from varcalc.certificates.integrals import Unproved, check_enclosed
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement, statement
from varcalc.formulation import Sampled
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.given_curve import distinct

WEIGHTS = (10.0, 1.0, 100.0)
"""Weights c that are tried, in units in which they bend H as much as the slope does over the length of the interval."""
MULTIPLIER_NOISE = 1e-13
"""Coefficients of a multiplier, relative to its size, that are left out."""
EQUATION_ORDER = 16
"""Order of the Taylor forms of the equations."""
WIDER = 4.0
"""How much wider than Newton's step the box is in which the equations are proved to be met."""


VANISHING = "multipliers of the conditions along the curve change nothing on curves that meet these"
EQUATIONS_MET = (
    "a curve near y0 meets the conditions along it at each of its points; its value lies below the upper bound"
)
OFF = "the ends meet the conditions along the curve to {:.1g}: these are meant as the line between their values there"


@dataclass(frozen=True)
class Pathwise:
    """A curve ``along`` without its ``equations``, and their multipliers; ``weight`` is one of :data:`WEIGHTS`.

    ``multipliers`` are coefficients, in powers of each piece's own variable, of mu of each equation.
    """

    along: AlongCurve
    equations: tuple[Expression, ...]
    multipliers: Sequence[Sequence[np.ndarray]]
    weight: float

    @cached_property
    def _pieces(self) -> list[tuple[float, float]]:
        return _pieces(self.along)

    @cached_property
    def _weights(self) -> list[float]:
        """c of each equation."""
        along, s = self.along, self.along.symbols
        x = np.concatenate([np.linspace(a, b, 9)[1:-1] for a, b in self._pieces])
        slopes = [ca.gradient(phi, s.y) for phi in self.equations]
        bend, *rows = along.function(ca.hessian(statement(along).lagrangian, s.dy)[0], *slopes)(x)
        stiffness = float(np.abs(bend).max()) / along.length**2
        return [self.weight * stiffness / float((row**2).sum(axis=1).mean() or 1.0) for row in rows]

    @cached_property
    def terms(self) -> Expression:
        """mu phi + c phi^2/2."""
        x, total = self.along.symbols.x, self.along.symbols.kind(0)
        for phi, rows, weight in zip(self.equations, self.multipliers, self._weights, strict=True):
            mu: Any = None
            for powers, piece in zip(rows[::-1], self._pieces[::-1], strict=True):
                part = polynomial_at(own_variable(x, *piece), powers.tolist())
                mu = part if mu is None else ca.if_else(x < piece[1], part, mu)
            total = total + mu * phi + weight / 2 * phi**2
        return total

    @cached_property
    def shift(self) -> Ball:
        """The integral of :attr:`terms` along admissible curves, on which phi is the lines between given values."""
        found, total = flint(), flint().arb(0)
        for k, (rows, weight) in enumerate(zip(self.multipliers, self._weights, strict=True)):
            for powers, (a, b) in zip(rows, self._pieces, strict=True):
                middle, half = (found.arb(a) + found.arb(b)) / 2, (found.arb(b) - found.arb(a)) / 2
                x = found.arb_poly([middle, half])
                start, lines = self._lines(0.5 * (a + b))
                first, slope = lines[k]
                phi = first + slope * (x - start)
                mu = polynomial_at(own_variable(x, a, b), [found.arb(c) for c in powers.tolist()])
                integral = ((mu + phi * (weight / 2)) * phi).integral()
                total += (integral(found.arb(1)) - integral(found.arb(-1))) * half
        # CasADi may have put constants of the terms together, and rounded
        return total * found.arb(1, 2.0**-40)

    def told(self) -> list[Hypothesis]:
        """What the theorem needs of the equations, and where the ends lie if that is not on them."""
        found = [Hypothesis(VANISHING, Means.CONSTRUCTION), Hypothesis(EQUATIONS_MET, Means.BALLS)]
        off = largest([value for row in self._given for value in row])
        return found if off.is_zero() else [*found, Hypothesis(OFF.format(float(off)), Means.CONSTRUCTION)]

    @cached_property
    def _knots(self) -> list[float]:
        """Where the functions are given: at the ends and at waypoints."""
        return [self.along.span[0], *sorted(statement(self.along).waypoints), self.along.span[1]]

    @cached_property
    def _given(self) -> list[list[Ball]]:
        """The value of each equation where the functions are given."""
        stated, found, ends = statement(self.along), flint(), self.along.form.ends
        inside = [stated.waypoints[x] for x in self._knots[1:-1]]
        places = [np.asarray(ends.start)[0], *inside, np.asarray(ends.end)[0]]
        rows = [np.r_[place, self.along.numbers].tolist() for place in places]
        return [
            [jet.value for jet in self._jets(stated, found.arb(x), list(map(found.arb, row)), 0)]
            for x, row in zip(self._knots, rows, strict=True)
        ]

    def _lines(self, x: float) -> tuple[Ball, list[tuple[Ball, Ball]]]:
        """Where the lines about x begin, and of each equation its value there and the slope of the line."""
        k = int(np.searchsorted(self._knots, x)) - 1
        a, b = (flint().arb(at) for at in self._knots[k : k + 2])
        values = zip(self._given[k], self._given[k + 1], strict=True)
        return a, [(first, (last - first) / (b - a)) for first, last in values]

    @cached_property
    def _program(self) -> Program:
        function = ca.Function("phi", self.along.symbols.all, [ca.densify(ca.vertcat(*self.equations))])
        check_enclosed(function, "a condition along the curve")
        return Program(function)

    def _jets(self, stated: Statement, x: Any, states: Sequence[Any], order: int) -> list[Jet]:
        """The equations' left sides, with derivatives by the states."""
        variables = [Jet(v, {i: flint().arb(1)} if order else None) for i, v in enumerate(states)]
        arguments = stated.arguments(Jet(x), variables, [Jet(flint().arb(0))] * stated.n)
        return jets(self._program, arguments[:-2], order)[0]

    def above(self, setting: Setting) -> Attained:
        """A curve near that of a setting that meets the equations exactly, and the integral of H along it."""
        stated, value = setting.statement, setting.along.value
        moved = [flint().arb(0)] * (stated.states + stated.n)
        for (r, q), (k, box) in zip(setting.along.residuals, setting.along.boxes, strict=True):
            try:
                step, rate = self._moved(setting, k, box)
                bend = _bend(setting, k, box, step, rate)
            except Undecided as undecided:
                raise Unproved(f"a condition along the curve is not enclosed near {box.at:.6g}: {undecided}") from None
            for i, (far, fast) in enumerate(zip(step, rate, strict=True)):
                moved[i], moved[stated.states + i] = largest([moved[i], far]), largest([moved[stated.states + i], fast])
            value += 2 * box.unit * (r * _norm(step, setting.sizes[0]) + q * _norm(rate, setting.sizes[1]) + bend)
        return Attained(value, setting.pieces, moved)

    def _moved(self, setting: Setting, k: int, box: Box) -> tuple[list[Ball], list[Ball]]:
        """How far the functions are moved in a box, and their slopes: phi_y^T e and its derivative."""
        stated, piece = setting.statement, setting.pieces[k]
        views = [Around(box, EQUATION_ORDER + whole, whole) for whole in (False, True)]
        along = [self._beside(stated, piece, around, None) for around in views]
        gradients = [[head(v) for v in row] for row in along[1][1]]
        missed = [-enclosed(c, w, EQUATION_ORDER) for c, w in zip(along[0][0], along[1][0], strict=True)]

        def stepped(room: list[Ball], right: list[Ball]) -> list[Ball]:
            """The e for which phi_y phi_y^T e = ``right``, phi_y anywhere in ``room``; Unproved where none is."""
            rows = self._beside(stated, piece, Around(box, 1, whole=True), room)[1]
            heads = [[head(v) for v in row] for row in rows]
            matrix = [[_dotted(row, other) for other in gradients] for row in heads]
            try:
                return solved(matrix, right)
            except ZeroDivisionError:
                raise Unproved(f"the conditions along the curve are not proved independent near {box.at:.6g}") from None

        steps = stepped([flint().arb(0)] * len(missed), missed)
        radius = WIDER * float(largest(steps)) + 1e-300
        room = [flint().arb(0, radius)] * len(missed)
        e = stepped(room, missed)
        if not all(bool(abs(step) < radius) for step in e):
            raise Unproved(f"no curve near is proved to meet the conditions along it near {box.at:.6g}")
        near = [self._beside(stated, piece, around, e)[0] for around in views]
        slopes = [
            -enclosed(views[0].slope(c), views[1].slope(w), EQUATION_ORDER - 1) for c, w in zip(*near, strict=True)
        ]
        rates = stepped(room, slopes)
        turned = [[head(views[1].slope(v)) for v in row] for row in along[1][1]]
        columns = list(zip(*gradients, strict=True))
        step = [_dotted(e, column) for column in columns]
        rate = [_dotted(rates, a) + _dotted(e, b) for a, b in zip(columns, zip(*turned, strict=True), strict=True)]
        return step, rate

    def _beside(
        self, stated: Statement, piece: Piece, around: Around, e: list[Ball] | None
    ) -> tuple[list[Series], list[list[Series]]]:
        """phi, less the line, along y0 + phi_y^T e as series, and its gradients there."""
        states, _ = piece.lifted(around)
        x, zero = around.abscissa(), flint().arb_series([0], around.terms)
        found = self._jets(stated, x, states, 1)
        if e is not None:
            for jet, by in zip(found, e, strict=True):
                states = [s + jet.first.get(i, 0) * by if i < stated.n else s for i, s in enumerate(states)]
            found = self._jets(stated, x, states, 1)
        start, lines = self._lines(float(piece.centre.mid()))
        values = [
            zero + jet.value - first - slope * (x - start) for jet, (first, slope) in zip(found, lines, strict=True)
        ]
        return values, [[zero + jet.first.get(i, 0) for i in range(stated.n)] for jet in found]


def _bend(setting: Setting, k: int, box: Box, step: list[Ball], rate: list[Ball]) -> Ball:
    """What second derivatives of H add at most where functions are moved by ``step`` and slopes by ``rate``."""
    stated, piece, around, found = setting.statement, setting.pieces[k], Around(box, 1, whole=True), flint()
    states, controls = piece.lifted(around)
    room = [[v + found.arb(0, 1) * abs(w).upper() for v, w in zip(values, moved, strict=False)]
            for values, moved in ((states, step), (controls, rate))]  # fmt: skip
    second = stated.jet(around.abscissa(), room[0] + states[stated.n :], room[1], 2, piece.switches).second
    far = {**dict(enumerate(step)), **{stated.bare + i: w for i, w in enumerate(rate)}}
    total = found.arb(0)
    for (i, j), value in second.items():
        total += abs(head(value) * far.get(i, 0) * far.get(j, 0)).upper() / (2 if i == j else 1)
    return total


def _norm(values: Sequence[Ball], sizes: np.ndarray) -> Ball:
    """The length of a vector in units of ``sizes``, from above."""
    scaled = [abs(v).upper() / float(u) for v, u in zip(values, sizes, strict=False)]
    return _dotted(scaled, scaled).sqrt().upper()


def _dotted(a: Sequence[Ball], b: Sequence[Ball]) -> Ball:
    total: Ball = flint().arb(0)
    for v, w in zip(a, b, strict=True):
        total += v * w
    return total


def _pieces(along: AlongCurve) -> list[tuple[float, float]]:
    return list(pairwise([along.span[0], *distinct(along.vertices)[1:-1].tolist(), along.span[1]]))


def pathwise(along: AlongCurve) -> Iterator[Pathwise]:
    """The equations all along a curve, each time with another weight; Unproved where they are not covered."""
    form, plain = along.form, replace(along, paths=(), limits=(), forces=())
    ends = np.r_[np.asarray(form.ends.start)[: along.order], np.asarray(form.ends.end)[: along.order]]
    reasons = {
        "conditions all along the curve are covered of Lagrangians of first order alone": along.order == 2,
        "conditions all along the curve beside prescribed integrals are not covered": bool(along.integrals),
        "conditions all along the curve are not covered where the Lagrangian is not smooth": not {*form.held}
        <= {at for at, _ in form.conditions.waypoints},
        "conditions all along the curve are covered between ends that are wholly given": bool(np.isnan(ends).any())
        or not form.ends.separate,
    }
    for reason, holds in reasons.items():
        if holds:
            raise Unproved(reason)
    unit = float(statement(plain).factor)
    rows = [[_fitted(force, a, b) / unit for a, b in _pieces(plain)] for force in along.forces]
    yield from (Pathwise(plain, along.paths, rows, weight) for weight in WEIGHTS)


def _fitted(force: Sampled, a: float, b: float) -> np.ndarray:
    """Coefficients in powers of a multiplier between two abscissae."""
    x = nodes_within(a, b)
    values = np.asarray(force(x), dtype=float)
    return in_powers(fitted(values, MULTIPLIER_NOISE * float(np.abs(values).max())))
