"""Where an expression ceases to be a number: zeros of what is divided by, of roots and logarithms.

A product vanishes with any of its factors and a power with its base, so that 1/r² is singular where r is zero, not
where r² is; the zeros of each factor are found by :func:`varcalc.symbolic.places.places`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from varcalc.symbolic.instructions import NAMES, POWERS, interpret, operate
from varcalc.symbolic.switches import Switch
from varcalc.symbolic.tracing import Expression

SAME_ZEROS = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_SQRT, ca.OP_FABS}
"""Operations of one argument that vanish where it does."""


@dataclass(frozen=True)
class _Factored:
    """An expression that vanishes where one of the ``factors`` does, and nowhere else."""

    written: Expression
    factors: tuple[Expression, ...]


def poles(expressions: Sequence[Expression], symbols: Sequence[Expression]) -> tuple[Switch, ...]:
    """Where SX ``expressions`` may be singular or end: as places at which an ``argument`` vanishes, each once."""
    function = ca.Function("read", list(symbols), [ca.densify(ca.vertcat(*expressions))])
    found: list[Switch] = []

    def applied(operation: int, operands: Sequence[_Factored]) -> _Factored:
        """The operation with its factors; where it may be singular is noted."""
        written = operate(operation, [o.written for o in operands])
        for argument in _singular(operation, operands):
            known = any(ca.is_equal(argument, one.argument, 8) for one in found)
            if not argument.is_constant() and not known:
                found.append(Switch(argument, NAMES[operation], jumps=False))
        return _Factored(written, _factors(operation, operands, written))

    arguments = [[_Factored(x, (x,)) for x in s.nonzeros()] if s.numel() else [] for s in symbols]
    interpret(function, arguments, lambda c: _Factored(ca.SX(c), ()), applied)
    return tuple(found)


def _factors(operation: int, operands: Sequence[_Factored], written: Expression) -> tuple[Expression, ...]:
    if operation in SAME_ZEROS or operation == ca.OP_DIV or (operation in POWERS and not _falls(operands)):
        return operands[0].factors
    if operation == ca.OP_MUL:
        return operands[0].factors + operands[1].factors
    return () if operation == ca.OP_INV or operation in POWERS else (written,)


def _singular(operation: int, operands: Sequence[_Factored]) -> tuple[Expression, ...]:
    """What the result is singular at the zeros of."""
    rule = SINGULAR_AT_ZEROS.get(operation)
    if rule is not None:
        return rule(operands)
    return operands[0].factors if operation in POWERS and not _whole(operands) else ()


def _falls(operands: Sequence[_Factored]) -> bool:
    """Whether a power may be infinite where its base vanishes."""
    return not operands[1].written.is_constant() or float(operands[1].written) <= 0


def _whole(operands: Sequence[_Factored]) -> bool:
    """Whether a power is smooth where its base vanishes."""
    return not _falls(operands) and float(operands[1].written).is_integer()


SINGULAR_AT_ZEROS: dict[int, Callable[[Sequence[_Factored]], tuple[Expression, ...]]] = {
    ca.OP_INV: lambda o: o[0].factors,
    ca.OP_DIV: lambda o: o[1].factors,
    ca.OP_LOG: lambda o: o[0].factors,
    ca.OP_SQRT: lambda o: o[0].factors,
    ca.OP_TAN: lambda o: (ca.cos(o[0].written),),
    ca.OP_LOG1P: lambda o: (1 + o[0].written,),
    ca.OP_ASIN: lambda o: (1 - o[0].written, 1 + o[0].written),
    ca.OP_ACOS: lambda o: (1 - o[0].written, 1 + o[0].written),
    ca.OP_ACOSH: lambda o: (o[0].written - 1,),
    ca.OP_ATANH: lambda o: (1 - o[0].written, 1 + o[0].written),
}
"""What operations are singular at the zeros of, by CasADi's codes."""
