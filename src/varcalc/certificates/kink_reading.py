"""An integrand read as smooth terms and convex ones with kinks.

What switches is read as a function of one expression e that is a polynomial between breaks: every operation on such
functions of the same e, and on numbers, makes another. Powers of sizes that are no whole ones are known besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import TypeAlias

import casadi as ca

from varcalc.certificates.convex_terms import BrokenTerm, ConvexTerm, Power
from varcalc.certificates.degree import degrees
from varcalc.certificates.piecewise import NotPiecewise, PiecewisePolynomial, applied, between
from varcalc.problem.functional import Symbols
from varcalc.symbolic.instructions import POWERS, SUMS, Program, operate
from varcalc.symbolic.tracing import Expression

LOST = 2.0**-48
"""What numbers may be rounded by at most, relative to them, where parts are lowered that all but meet."""
DEEPEST = 20
"""Operations down to which expressions are compared."""
KINKS = {ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN}
SWITCHING = {*KINKS, ca.OP_SIGN, ca.OP_LT, ca.OP_LE}
SHARES_OF_PART = (Fraction(1, 2), Fraction(3, 7), Fraction(8, 13), Fraction(5, 19))
"""Shares of a part at which its branch is looked at."""


Parameters: TypeAlias = Sequence[tuple[Expression, float]]
"""Symbols of parameters, with their values."""


@dataclass(frozen=True)
class _Value:
    """An expression, and where it is a function of one expression that of the ``base`` of that number.

    ``inner`` is it as an expression of the symbol that stands for the base. A number is a function of any. What
    ``switches`` must have a symbol in its place before it is put together with what is no function of its base.
    """

    expression: Expression
    base: int | None = None
    function: PiecewisePolynomial | None = None
    inner: Expression = None
    switches: bool = False

    @property
    def number(self) -> bool:
        """Whether it is a number."""
        return self.base is None and self.function is not None


class _TermReader:
    """Carries operations out; ``found`` are the terms that symbols stand for, ``values`` those of the parameters."""

    def __init__(self, bases: Sequence[Expression], values: Parameters) -> None:
        self.bases, self.values = bases, values
        self.variable: Expression = ca.SX.sym("e")
        self.found: list[ConvexTerm] = []
        self.symbols: list[Expression] = []
        self.closings: dict[int, _Value] = {}

    def constant(self, number: float) -> _Value:
        """A number."""
        return self.given(ca.SX(number), number)

    def given(self, expression: Expression, number: float) -> _Value:
        """An expression that stands for a number."""
        return _Value(expression, None, PiecewisePolynomial.constant(number), expression)

    def plain(self, expression: Expression) -> _Value:
        """An expression, which may be one of the bases."""
        for base, known in enumerate(self.bases):
            if ca.is_equal(known, expression, DEEPEST):
                return _Value(expression, base, PiecewisePolynomial.identity(), self.variable)
        return _Value(expression)

    def applied(self, operation: int, operands: Sequence[_Value]) -> _Value:
        """An operation on values."""
        powered = self._powered(operation, operands)
        if powered is not None:
            return powered
        if not any(o.switches for o in operands):
            written = self.plain(operate(operation, [o.expression for o in operands]))
            if written.base is not None:
                return written
        within = self._within(operation, operands)
        if within is not None:
            return within
        if operation in KINKS and len(operands) == 2:
            # fmax and fmin are half the sum, and half the size of the difference more or less
            half, (a, b) = self.constant(0.5), operands
            size = self.applied(ca.OP_FABS, [self.applied(ca.OP_SUB, [a, b])])
            way = ca.OP_ADD if operation == ca.OP_FMAX else ca.OP_SUB
            mean = self.applied(ca.OP_MUL, [half, self.applied(ca.OP_ADD, [a, b])])
            return self.applied(way, [mean, self.applied(ca.OP_MUL, [half, size])])
        return _Value(operate(operation, [self.closed(o) for o in operands]))

    def _within(self, operation: int, operands: Sequence[_Value]) -> _Value | None:
        """The function of one base that an operation makes; None where it makes none, or where its terms are apart."""
        bases = {o.base for o in operands if o.base is not None}
        functions = [o.function for o in operands if o.function is not None]
        if len(bases) > 1 or len(functions) < len(operands):
            return None
        if operation in SUMS and self._apart(operation, operands):
            return None
        inner, base = operate(operation, [o.inner for o in operands]), bases.pop() if bases else None
        try:
            function = applied(operation, functions)
            if base is None or not (any(o.switches for o in operands) or operation in SWITCHING):
                return _Value(operate(operation, [o.expression for o in operands]), base, function, inner)
            if not function.breaks:
                (inner,) = self._branches(inner, function)
                expression = ca.substitute([inner], [self.variable], [self.bases[base]])[0]
                return _Value(expression, base, function, inner)
        except NotPiecewise:
            return None
        # what switches has no expression of its own: a symbol takes its place
        return _Value(ca.SX.nan(), base, function, inner, switches=True)

    def _apart(self, operation: int, operands: Sequence[_Value]) -> bool:
        """Whether a convex function that switches is added to what does not, which needs no line of support."""
        first, last = operands
        if first.switches == last.switches or first.number or last.number:
            return False
        switching = first if first.switches else last
        assert switching.function is not None
        return switching.function.convex and (operation == ca.OP_ADD or switching is first)

    def closed(self, value: _Value) -> Expression:
        """The expression of a value, with a symbol for what switches."""
        if not value.switches or value.base is None or value.function is None:
            return value.expression
        branches = self._branches(value.inner, value.function)
        symbol = self._symbol(BrokenTerm(ca.SX(0), self.bases[value.base], value.function, branches, self.variable))
        self.closings.setdefault(next(k for k, known in enumerate(self.symbols) if known is symbol), value)
        return symbol

    def _branches(self, inner: Expression, function: PiecewisePolynomial) -> tuple[Expression, ...]:
        """The parts of a function as its expression writes them; NotPiecewise where none is exactly a part.

        Where what switches is zero it tells of no branch, so that several places of a part are tried.
        """
        found = []
        for part, places in zip(
            function.parts, zip(*map(partial(between, function.breaks), SHARES_OF_PART), strict=True), strict=True
        ):
            whole = PiecewisePolynomial((), (part,))
            tried = (_branch(inner, self.variable, self.values, at) for at in places)
            found.append(next((e for e in tried if self._function(e) == whole), None))
        if None in found:
            raise NotPiecewise("no branch is the part")
        return tuple(found)

    def _function(self, inner: Expression) -> PiecewisePolynomial:
        """The function that an expression of the variable is."""
        program = Program(ca.Function("inner", [self.variable, *(symbol for symbol, _ in self.values)], [inner]))
        given = [[PiecewisePolynomial.identity()], *([PiecewisePolynomial.constant(v)] for _, v in self.values)]
        return program.run(given, PiecewisePolynomial.constant, applied)[0][0]

    def put_together(self, factors: dict[int, Expression]) -> tuple[Expression, list[ConvexTerm]]:
        """The terms of some numbers with their factors; those of one base that numbers multiply are one term.

        Before it comes what is smooth of these.
        """
        sums: dict[int, _Value] = {}
        terms: list[ConvexTerm] = []
        for k, factor in factors.items():
            value, number = self.closings.get(k), _number(factor, self.values)
            if value is None or value.base is None or number is None:
                terms.append(replace(self.found[k], factor=factor))
                continue
            multiple = self.applied(ca.OP_MUL, [_Value(factor, None, number, factor), value])
            before = sums.get(value.base)
            sums[value.base] = multiple if before is None else self.applied(ca.OP_ADD, [before, multiple])
        smooth = sum((v.expression for v in sums.values() if not v.switches), ca.SX(0))
        symbols = [self.closed(v) for v in sums.values() if v.switches]
        places = [k for k, known in enumerate(self.symbols) if any(ca.is_equal(known, one) for one in symbols)]
        return smooth, [*terms, *(replace(self.found[k], factor=ca.SX(1)) for k in places)]

    def _symbol(self, term: ConvexTerm) -> Expression:
        for known, symbol in zip(self.found, self.symbols, strict=True):
            if _alike(known, term):
                return symbol
        self.found.append(term)
        self.symbols.append(ca.SX.sym("term"))
        return self.symbols[-1]

    def _powered(self, operation: int, operands: Sequence[_Value]) -> _Value | None:
        """A power that is no whole number of |e| or of the positive part of e; None for another thing."""
        if operation not in POWERS or not operands[1].number:
            return None
        base, exponent = operands[0], operands[1].expression
        if base.base is None or base.function is None or len(base.function.breaks) != 1:
            return None
        at = base.function.breaks[0]
        if not exponent.is_constant() or float(exponent) == round(float(exponent)) or Fraction(float(at)) != at:
            return None
        power, argument = float(exponent), self.bases[base.base] - (float(at) if at else 0)
        for sign in (1, -1):
            for one_sided in (True, False):
                if power > 1.0 and base.function == _size(sign, at, one_sided=one_sided):
                    return _Value(self._symbol(Power(ca.SX(0), sign * argument, power, one_sided)))
        return None


def _size(sign: int, at: Fraction, *, one_sided: bool) -> PiecewisePolynomial:
    """The distance from a number, or the positive part of it on one side of that number."""
    zero = PiecewisePolynomial.constant(0.0)
    away = PiecewisePolynomial((), ((-sign * at, Fraction(sign)) if at else (Fraction(0), Fraction(sign)),))
    return applied(ca.OP_FMAX, [away, zero]) if one_sided else applied(ca.OP_FABS, [away])


def _alike(a: ConvexTerm, b: ConvexTerm) -> bool:
    if not ca.is_equal(a.argument, b.argument, DEEPEST):
        return False
    if isinstance(a, BrokenTerm) and isinstance(b, BrokenTerm):
        return a.function == b.function
    return isinstance(a, Power) and isinstance(b, Power) and (a.power, a.one_sided) == (b.power, b.one_sided)


def _branch(inner: Expression, variable: Expression, values: Parameters, at: Fraction) -> Expression:
    """An expression of one variable as it is on the part where that has a value."""
    symbols = [variable, *(symbol for symbol, _ in values)]
    places = [at, *(Fraction(value) for _, value in values)]
    given = [
        [(symbol, PiecewisePolynomial((), ((place,) if place else (),)))]
        for symbol, place in zip(symbols, places, strict=True)
    ]
    program = Program(ca.Function("inner", symbols, [inner]))
    return program.run(given, lambda c: (ca.SX(c), PiecewisePolynomial.constant(c)), _resolved)[0][0][0]


def _number(expression: Expression, values: Parameters) -> PiecewisePolynomial | None:
    """The number that an expression of parameters is, exactly; None where it is none."""
    if not all(any(ca.is_equal(symbol, known) for known, _ in values) for symbol in ca.symvar(expression)):
        return None
    program = Program(ca.Function("number", [symbol for symbol, _ in values], [expression]))
    try:
        return program.run(
            [[PiecewisePolynomial.constant(number)] for _, number in values], PiecewisePolynomial.constant, applied
        )[0][0]
    except NotPiecewise:
        return None


_Resolved: TypeAlias = tuple[Expression, PiecewisePolynomial]
"""An expression without switches, and the number that it is."""


def _resolved(operation: int, operands: Sequence[_Resolved]) -> _Resolved:
    """An operation at numbers, of which what switches is the operand that it takes."""
    found = applied(operation, [number for _, number in operands])
    expressions = [expression for expression, _ in operands]
    if operation == ca.OP_FABS:
        return (expressions[0] if found == operands[0][1] else -expressions[0]), found
    if operation in KINKS:
        return expressions[0 if found == operands[0][1] else 1], found
    if operation == ca.OP_IF_ELSE_ZERO:
        return (expressions[1] if operands[0][1].parts[0] else ca.SX(0)), found
    if operation in SWITCHING or operation in {ca.OP_NOT, ca.OP_AND, ca.OP_OR}:
        return ca.SX(float(found.parts[0][0]) if found.parts[0] else 0.0), found
    return operate(operation, expressions), found


def _bases(
    function: ca.Function, curve: Expression, x: Expression, entries: Sequence[Sequence[Expression]]
) -> list[Expression]:
    """The expressions of which what switches is to be read as a function, each without the numbers beside it."""
    found: list[Expression] = []

    def add(expression: Expression) -> None:
        if not any(ca.is_equal(known, expression, DEEPEST) for known in found):
            found.append(expression)

    def look(operation: int, operands: Sequence[tuple[Expression, bool]]) -> tuple[Expression, bool]:
        """An operation as it is written, and whether anything in it switches; what it switches by is added."""
        expressions = [e for e, _ in operands]
        written, switched = operate(operation, expressions), any(s for _, s in operands)
        if operation in SWITCHING and ca.depends_on(written, curve):
            cores = [_core(e, ca.vertcat(curve, x)) for e, s in operands if not s and ca.depends_on(e, curve)]
            alike = len(cores) < 2 or ca.is_equal(cores[0], cores[1], DEEPEST)
            add_all = cores[:1] if alike else [_core(expressions[0] - expressions[1], ca.vertcat(curve, x))]
            for one in add_all:
                add(one)
            switched = True
        return written, switched

    Program(function).run([[(e, False) for e in row] for row in entries], lambda c: (ca.SX(c), False), look)
    return found


def _core(e: Expression, varying: Expression) -> Expression:
    """An expression without its sign, and without the numbers that are added to it or that it is multiplied by."""
    while True:
        if e.is_op(ca.OP_NEG) or e.is_op(ca.OP_TWICE):
            e = e.dep(0)
        elif any(map(e.is_op, (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV))):
            first, last = (ca.depends_on(e.dep(k), varying) for k in (0, 1))
            if first == last or (last and e.is_op(ca.OP_DIV)):
                return e
            e = e.dep(0) if first else e.dep(1)
        else:
            return e


def convex_terms(
    symbols: Symbols, integrand: Expression, parameters: Sequence[float]
) -> tuple[Expression, list[ConvexTerm]] | None:
    """An integrand as smooth terms and convex ones with kinks; None where there are none, or kinks of another kind."""
    curve, function = ca.vertcat(symbols.y, symbols.dy), ca.Function("L", symbols.all, [integrand])
    entries = [s.nonzeros() if s.numel() else [] for s in symbols.all]
    reader = _TermReader(_bases(function, curve, symbols.x, entries), list(zip(entries[4], parameters, strict=True)))
    given = [[reader.plain(e) for e in row] for row in entries]
    given[4] = [reader.given(*pair) for pair in reader.values]
    try:
        total = reader.closed(Program(function).run(given, reader.constant, reader.applied)[0][0])
        read = _linear(symbols, curve, total, reader)
    except NotPiecewise:
        return None
    terms = [] if read is None else [_joined(t) if isinstance(t, BrokenTerm) else t for t in read[1]]
    known = [t for t in terms if t is not None]
    return None if read is None or not known or len(known) < len(terms) else (read[0], known)


def _joined(term: BrokenTerm) -> BrokenTerm | None:
    """A term as one of a convex function, whose parts may meet up to round-off; None where it is of none."""
    if term.function.convex:
        return term
    found = term.function.joined()
    if found is None or not found[0].convex:
        return None
    function, lowered = found
    # more than what a number that is taken away from another may be rounded by
    size = max(abs(float(c)) for part in term.function.parts for c in part)
    return replace(term, function=function, lowered=float(max(lowered)) * (1 + LOST) + LOST * size)


def _linear(
    symbols: Symbols, curve: Expression, total: Expression, reader: _TermReader
) -> tuple[Expression, list[ConvexTerm]] | None:
    """An expression without its terms, and these with their factors; None where it is no sum of multiples of them."""
    column = ca.vertcat(*reader.symbols)
    kept = [k for k, symbol in enumerate(reader.symbols) if ca.depends_on(total, symbol)]
    if not kept:
        return None
    watched = [[False] * int(s.numel()) for s in symbols.all]
    factors = ca.vertsplit(ca.densify(ca.gradient(total, column)))
    linear = degrees(ca.Function("L", [*symbols.all, column], [total]), [*watched, [True] * len(factors)])[0][0] <= 1.0
    if not linear or any(ca.depends_on(factors[k], curve) for k in kept):
        return None
    rest, terms = reader.put_together({k: factors[k] for k in kept})
    return ca.substitute([total], [column], [ca.SX.zeros(len(factors))])[0] + rest, terms
