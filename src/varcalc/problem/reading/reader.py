"""Reading an expression: its instructions carried out on sums."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

import casadi as ca

from varcalc.problem.functional import Functional
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.reading.sums import (
    LARGEST_DENOMINATOR,
    ZERO,
    Atom,
    Sum,
    add,
    atom,
    expanded,
    multiply,
    number,
    power,
    symbol,
)
from varcalc.symbolic.instructions import NAMES, POWERS, Call, interpret, operate
from varcalc.symbolic.tracing import Expression

Named = Sequence[tuple[Expression, Sequence[str]]]
"""Symbols with the names of their entries."""
HIGHEST_EXPANDED, MOST_PRODUCTS = 12, 3000
"""Of powers of sums that are multiplied out, and of terms times terms: nobody reads what comes of more."""


def names(problem: Functional) -> Named:
    """The symbols of a problem with the names a person would give them: x, y, y', y'' (or y_1, ...), parameters."""
    return names_of(problem, Lagrangian.of(problem))


def names_of(problem: Functional, lagrangian: Lagrangian) -> Named:
    """:func:`names` for one Lagrangian object, whose symbols for higher derivatives are its own."""
    s = problem.symbols
    bases = [axis.name for axis in problem.ordinates]
    out: list[tuple[Expression, list[str]]] = [(s.x, [problem.abscissa.name])]
    for k, derivative in enumerate(lagrangian.derivatives_of_y):
        out.append((derivative, [base + "'" * k for base in bases]))
    out += [(s.parameters, list(problem.parameters)), (s.unknowns, list(problem.unknowns))]
    return [(symbols, labels) for symbols, labels in out if labels]


class TooLong(ArithmeticError):
    """Products have more terms than anybody reads."""


@dataclass(frozen=True)
class Reader:
    """How products are carried out while an expression is read: kept in factors, or expanded."""

    product: Callable[[Sum, Sum], Sum]

    def read(self, expression: Expression, names: Named) -> Sum:
        """An SX scalar in terms of the given names of symbols' entries."""
        symbols = [s for s, _ in names]
        free = [v for v in ca.symvar(expression) if not any(ca.depends_on(v, s) for s in symbols)]
        inputs = [*symbols, *free]
        function = ca.Function("expression", inputs, [ca.densify(expression)])
        given = [[symbol(n) for n in entries] for _, entries in names]
        return interpret(function, [*given, *([symbol(v.name())] for v in free)], number, self.apply)[0][0]

    def apply(self, operation: int, operands: Sequence[Sum]) -> Sum:
        """One operation on sums."""
        a, b = operands[0], operands[-1]
        rule = self._rules().get(operation)
        if rule is not None:
            return rule(a, b)
        if operation in POWERS and b.number is not None and math.isfinite(b.number):
            return self._raised(a, Fraction(b.number).limit_denominator(LARGEST_DENOMINATOR))
        if all(o.number is not None for o in operands):
            constants = [o.number or 0.0 for o in operands]
            if isinstance(operation, Call):
                return number(float(operation.at(*constants)))
            return number(float(operate(operation, [ca.SX(c) for c in constants])))
        called = operation.function.name() if isinstance(operation, Call) else NAMES.get(operation, str(operation))
        return atom(Atom(called, tuple(operands)))

    def _rules(self) -> dict[int, Callable[[Sum, Sum], Sum]]:
        half, minus = Fraction(1, 2), Fraction(-1)
        return {
            ca.OP_ASSIGN: lambda a, _: a,
            ca.OP_ADD: add,
            ca.OP_SUB: lambda a, b: add(a, b, -1.0),
            ca.OP_NEG: lambda a, _: add(ZERO, a, -1.0),
            ca.OP_TWICE: lambda a, _: self.product(number(2), a),
            ca.OP_MUL: self.product,
            ca.OP_DIV: lambda a, b: self.product(a, power(b, minus)),
            ca.OP_INV: lambda a, _: power(a, minus),
            ca.OP_SQ: lambda a, _: self._raised(a, Fraction(2)),
            ca.OP_SQRT: lambda a, _: power(a, half),
        }

    def _raised(self, a: Sum, exponent: Fraction) -> Sum:
        if self.product is not multiply and exponent.denominator == 1 and len(a.terms) > 1:
            if abs(exponent) > HIGHEST_EXPANDED:
                raise TooLong
            if exponent > 0:
                return reduce(self.product, [a] * int(exponent))
        return power(a, exponent)


def _multiplied_out(a: Sum, b: Sum) -> Sum:
    if len(a.terms) * len(b.terms) > MOST_PRODUCTS:
        raise TooLong
    return expanded(a, b)


FACTORED, EXPANDED = Reader(multiply), Reader(_multiplied_out)
