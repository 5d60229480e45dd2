"""Expressions whose constants are gathered before anything is rounded.

In coordinates measured from an end at x = 1, a Lagrangian that says 1 - x
becomes 1 - (1 - t), which loses the digits that the coordinate was chosen for.
Sums are therefore carried as a constant and the rest, and 1 - (1 - t) is t.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from varcalc.problem.functional import Symbols
from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.tracing import Expression

PRODUCTS = frozenset({ca.OP_MUL, ca.OP_SQ})
COMPARED = frozenset({ca.OP_LT, ca.OP_LE})
CANCELLED = 1e-15
"""Share of two constants to which their sum cancels where it is zero but for rounding."""


@dataclass(frozen=True)
class _Sum:
    """``constant + rest``; ``rest`` is None where there is none."""

    constant: float
    rest: Expression | None

    @property
    def value(self) -> Expression:
        """The sum as one expression."""
        if self.rest is None:
            return ca.SX(self.constant)
        return self.rest if self.constant == 0.0 else self.constant + self.rest

    def times(self, factor: float) -> _Sum:
        """Both parts times a ``factor``."""
        return _Sum(factor * self.constant, None if self.rest is None else factor * self.rest)

    def plus(self, other: _Sum) -> _Sum:
        """The sum of two, constants with constants."""
        rests = [r for r in (self.rest, other.rest) if r is not None]
        constant = self.constant + other.constant
        constant = constant if abs(constant) > CANCELLED * abs(other.constant) else 0.0
        return _Sum(constant, rests[0] + rests[-1] if len(rests) == 2 else (rests or [None])[0])


def gathered(expression: Expression, symbols: Symbols) -> Expression:
    """The same scalar expression in ``symbols``, with the constants of every sum added up first.

    Expressions that are no formula (interpolated data) are returned as they are.
    """
    return _carried_out(_applied, expression, symbols)


def multiplied_out(expression: Expression, symbols: Symbols) -> Expression:
    """The same with products of sums multiplied out: 1 - (1 - t)^2 is t (2 - t).

    Where it is the constant of a factor that cancels, as 1 - t where t is all but 1, that costs digits.
    """
    return _carried_out(_multiplied, expression, symbols)


def _carried_out(
    algebra: Callable[[int, Sequence[_Sum]], _Sum], expression: Expression, symbols: Symbols
) -> Expression:
    if not isinstance(expression, ca.SX):
        return expression
    function = ca.Function("gathered", [ca.vertcat(*map(ca.vec, symbols.all))], [ca.densify(expression)])
    arguments = [[_Sum(0.0, entry) for entry in ca.vertsplit(ca.vertcat(*map(ca.vec, symbols.all)))]]
    return interpret(function, arguments, lambda number: _Sum(number, None), algebra)[0][0].value


def _multiplied(operation: int, operands: Sequence[_Sum]) -> _Sum:
    first, last = operands[0], operands[-1]
    if operation == ca.OP_DIV and last.rest is None:
        return first.times(1 / last.constant)
    if first.rest is None or last.rest is None or not (first.constant and last.constant):
        return _applied(operation, operands)
    if operation in PRODUCTS:
        rest = first.constant * last.rest + last.constant * first.rest + first.rest * last.rest
        return _Sum(first.constant * last.constant, rest)
    side = 1.0 if first.constant > 0 else -1.0
    if operation == ca.OP_ASIN and abs(first.constant - side) <= CANCELLED:
        # asin(1 - r) = pi/2 - 2 asin(sqrt(r/2)), whose slope is not made of 1 - (1 - r)^2
        return _Sum(side * 0.5 * math.pi, -side * 2 * ca.asin(ca.sqrt(-side * 0.5 * first.rest)))
    return _applied(operation, operands)


def _applied(operation: int, operands: Sequence[_Sum]) -> _Sum:
    first, last = operands[0], operands[-1]
    if operation == ca.OP_ADD:
        return first.plus(last)
    if operation == ca.OP_SUB:
        return first.plus(last.times(-1.0))
    if operation == ca.OP_NEG:
        return first.times(-1.0)
    if operation == ca.OP_TWICE:
        return first.times(2.0)
    if operation == ca.OP_MUL and (first.rest is None or last.rest is None):
        return last.times(first.constant) if first.rest is None else first.times(last.constant)
    if operation in COMPARED:  # on which side of its place a distance is, however small
        operands = [first.plus(last.times(-1.0)), _Sum(0.0, None)]
    return _Sum(0.0, operate(operation, [o.value for o in operands]))
