"""From CasADi's expression graph to heyoka's.

An SX function is a list of scalar instructions; each becomes one heyoka
expression. What has no Taylor recurrence in heyoka is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from varcalc.symbolic.instructions import NAMES, interpret

Expression = Any
"""A heyoka expression."""


class CannotLower(ValueError):
    """A system that the Taylor engine cannot take, and why."""


def _unary(hy: Any) -> dict[int, Callable[..., Expression]]:
    """heyoka's form of CasADi's operations of one argument."""
    zero, one = hy.expression(0.0), hy.expression(1.0)
    named = "exp log sqrt sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh erf expm1 log1p"
    table = {getattr(ca, f"OP_{name.upper()}"): getattr(hy, name) for name in named.split()}
    return table | {
        ca.OP_ASSIGN: lambda x: x,
        ca.OP_NEG: lambda x: -x,
        ca.OP_SQ: lambda x: x * x,
        ca.OP_TWICE: lambda x: x * 2.0,
        ca.OP_INV: lambda x: 1.0 / x,
        ca.OP_NOT: lambda x: hy.eq(x, zero),
        ca.OP_FABS: lambda x: hy.select(hy.lt(x, zero), -x, x),
        ca.OP_SIGN: lambda x: hy.select(hy.gt(x, zero), one, hy.select(hy.lt(x, zero), -one, zero)),
    }


def _binary(hy: Any) -> dict[int, Callable[..., Expression]]:
    """heyoka's form of CasADi's operations of two arguments."""
    zero = hy.expression(0.0)
    return {
        ca.OP_ADD: lambda x, y: x + y,
        ca.OP_SUB: lambda x, y: x - y,
        ca.OP_MUL: lambda x, y: x * y,
        ca.OP_DIV: lambda x, y: x / y,
        ca.OP_POW: lambda x, y: x**y,
        ca.OP_CONSTPOW: lambda x, y: x**y,
        ca.OP_ATAN2: hy.atan2,
        ca.OP_HYPOT: lambda x, y: hy.sqrt(x * x + y * y),
        ca.OP_LT: hy.lt,
        ca.OP_LE: hy.lte,
        ca.OP_EQ: hy.eq,
        ca.OP_NE: hy.neq,
        ca.OP_AND: lambda x, y: hy.logical_and([hy.neq(x, zero), hy.neq(y, zero)]),
        ca.OP_OR: lambda x, y: hy.logical_or([hy.neq(x, zero), hy.neq(y, zero)]),
        ca.OP_IF_ELSE_ZERO: lambda x, y: hy.select(hy.neq(x, zero), y, zero),
        ca.OP_FMIN: lambda x, y: hy.select(hy.lt(y, x), y, x),
        ca.OP_FMAX: lambda x, y: hy.select(hy.gt(y, x), y, x),
        ca.OP_COPYSIGN: lambda x, y: hy.select(
            hy.lt(x, zero), hy.select(hy.lt(y, zero), x, -x), hy.select(hy.lt(y, zero), -x, x)
        ),
    }


class _Choices:
    """What CasADi makes of ``if_else``, a sum of what is there if, and what is there unless, as one choice each.

    Expressions are told apart by their addresses, so that all are kept.
    """

    def __init__(self, hy: Any) -> None:
        self.hy = hy
        self.kept: list[Expression] = []
        self.denied: dict[int, Expression] = {}
        self.given: dict[int, tuple[Expression, Expression]] = {}

    def note(self, operation: int, operands: Sequence[Expression], found: Expression) -> None:
        """Keep what an operation made of its operands, and that it denies one or gives one on a condition."""
        self.kept += [*operands, found]
        if operation == ca.OP_NOT:
            self.denied[id(found)] = operands[0]
        elif operation == ca.OP_IF_ELSE_ZERO:
            self.given[id(found)] = operands[0], operands[1]

    def made_of(self, summands: Sequence[Expression]) -> Expression | None:
        """The choice that two summands are; None where they are none."""
        if not all(id(summand) in self.given for summand in summands):
            return None
        (condition, first), (otherwise, last) = (self.given[id(summand)] for summand in summands)
        if self.denied.get(id(otherwise)) is not condition:
            return None
        return self.hy.select(self.hy.neq(condition, self.hy.expression(0.0)), first, last)


def scalar_function(system: ca.Function) -> ca.Function:
    """``system`` as an SX function; CannotLower when it holds what SX cannot express, such as interpolated data."""
    if system.is_a("SXFunction"):
        return system
    try:
        return system.expand()
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise CannotLower(
            "the system holds an operation that is no formula (interpolated data, a callback), "
            f"which the Taylor engine cannot take: {reason}; use the Dop853 engine"
        ) from error


def lower(system: ca.Function, arguments: list[list[Expression]]) -> list[Expression]:
    """The outputs of ``system``, as heyoka expressions of ``arguments`` (one list for each input).

    Raises CannotLower, naming the operation, where heyoka has none like it.
    """
    import heyoka as hy

    system = scalar_function(system)
    if system.get_free():
        raise CannotLower(f"the system has free symbols: {', '.join(system.get_free())}")
    table = _unary(hy) | _binary(hy)
    choices = _Choices(hy)

    def apply(operation: int, operands: Sequence[Expression]) -> Expression:
        """An operation of heyoka; raises CannotLower for one that it has no series of."""
        if operation not in table:
            raise CannotLower(
                f"the system uses `{NAMES.get(operation, operation)}`, which has no Taylor series the engine knows; "
                "use the Dop853 engine"
            )
        found = choices.made_of(operands) if operation == ca.OP_ADD else None
        found = table[operation](*operands) if found is None else found
        choices.note(operation, operands, found)
        return found

    inputs = [[a[k] for k in _entries(system.sparsity_in(i))] for i, a in enumerate(arguments)]
    found = interpret(system, inputs, hy.expression, apply)[0]
    outputs = [hy.expression(0.0)] * system.numel_out(0)
    for place, expression in zip(_entries(system.sparsity_out(0)), found, strict=True):
        outputs[place] = expression
    return outputs


def _entries(sparsity: ca.Sparsity) -> list[int]:
    """The dense position, column by column, of each structural nonzero."""
    rows, columns = sparsity.get_triplet()
    return [row + column * sparsity.size1() for row, column in zip(rows, columns, strict=True)]
