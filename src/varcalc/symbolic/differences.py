"""An expression followed from a base point to a displaced one, with the change in between.

The change never comes from a difference of two nearby numbers where the
operation has a form that avoids it, such as sqrt(a) - sqrt(b) = (a - b) /
(sqrt(a) + sqrt(b)), so that it is exact to round-off however small the
displacement. Turning points and singular ends need just that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import SUMS, in_numbers, interpret, operate
from varcalc.symbolic.tracing import Expression

SMALL_POWER = 8
"""Integer powers up to this are expanded: a^k - b^k = (a - b)(a^(k-1) + ... + b^(k-1))."""
GAUSS_3 = ((0.5 - math.sqrt(0.15), 5 / 18), (0.5, 8 / 18), (0.5 + math.sqrt(0.15), 5 / 18))
"""Gauss-Legendre rule on [0, 1], nodes and weights: exact to degree 5."""
STEPS = frozenset(
    {
        ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN,
        ca.OP_FMOD, ca.OP_REMAINDER, ca.OP_COPYSIGN,
    }
)  # fmt: skip
"""Operations that jump or bend, so that a mean derivative says nothing."""
HIGHEST = 700.0
"""Size of an argument up to which cosh is a number."""
NEARBY = 1e-3
"""Relative displacement below which a mean derivative by GAUSS_3 beats a difference."""


@dataclass(frozen=True)
class Carried:
    """An expression at a displaced point (``value``), at the base point (``base``), and the ``change`` between.

    ``probe`` is the base at a sample of all symbols, which tells where the base is no number.
    """

    value: Expression
    base: Expression
    change: Expression
    probe: float

    @property
    def regular(self) -> bool:
        """True where the base is a number, so that the change means something."""
        return math.isfinite(self.probe)


def fixed(symbol: Expression, probe: float) -> Carried:
    """A quantity that is the same at both points."""
    return Carried(symbol, symbol, ca.SX(0), probe)


def displaced(base: Expression, displacement: Expression, probe: float) -> Carried:
    """A variable at ``base + displacement``."""
    return Carried(base + displacement, base, displacement, probe)


def carry(function: ca.Function, arguments: Sequence[Carried]) -> list[Carried]:
    """The results of ``function`` (scalar SX inputs and outputs) for arguments carried from a base point."""
    with np.errstate(all="ignore"):
        results = interpret(function, [[a] for a in arguments], _constant, _carried)
    return [r[0] for r in results]


def _constant(number: float) -> Carried:
    return Carried(ca.SX(number), ca.SX(number), ca.SX(0), number)


def _carried(operation: int, operands: Sequence[Carried]) -> Carried:
    probe = float(in_numbers(operation)(*(np.float64(o.probe) for o in operands)))
    base = operate(operation, [o.base for o in operands])
    if all(o.change.is_zero() for o in operands):
        same = all(o.value is o.base for o in operands)
        return Carried(base if same else _value(operation, operands), base, ca.SX(0), probe)
    value = _value(operation, operands)
    if not (math.isfinite(probe) and all(o.regular for o in operands)):
        return Carried(value, base, value - base, probe)
    rule = _CHANGES.get(operation)
    change = rule(value, *operands) if rule is not None else None
    if change is None:
        change = _mean_change(operation, operands, value, base)
    if operation in SUMS:
        value = _sum_there(value, operands, base, change)
    return Carried(value, base, change, probe)


def _sum_there(value: Expression, operands: Sequence[Carried], base: Expression, change: Expression) -> Expression:
    """A sum at the displaced point, from its terms there or from the base and the change: the one that loses less."""
    terms = sum((ca.fabs(operand.value) for operand in operands), ca.SX(0))
    return ca.if_else(terms < ca.fabs(base) + ca.fabs(change), value, base + change)


def _value(operation: int, operands: Sequence[Carried]) -> Expression:
    return operate(operation, [o.value for o in operands])


def _mean_change(operation: int, operands: Sequence[Carried], value: Expression, base: Expression) -> Expression:
    """The change of an operation that has no closed form: the mean derivative nearby, the difference further off."""
    if operation in STEPS:
        return value - base
    change = ca.SX(0)
    near = ca.SX(1)
    symbols = [ca.SX.sym("a") for _ in operands]
    partials = [ca.gradient(operate(operation, symbols), a) for a in symbols]
    for k, operand in enumerate(operands):
        if operand.change.is_zero():
            continue
        for node, weight in GAUSS_3:
            point = [o.base + node * o.change for o in operands]
            change += weight * operand.change * ca.substitute([partials[k]], symbols, point)[0]
        near *= ca.fabs(operand.change) < NEARBY * (1 + ca.fabs(operand.base))
    return ca.if_else(near, change, value - base)


def _exponential_change(value: Expression, a: Carried) -> Expression:
    """Told from the larger of the two, beside which the other may be nothing."""
    return ca.if_else(a.change > 0, -value * ca.expm1(-a.change), ca.exp(a.base) * ca.expm1(a.change))


def _tanh_change(value: Expression, a: Carried) -> Expression:
    """By the theorem of addition for neighbours, where no cosh of an argument that is far off may overflow."""
    base, there = (ca.cosh(ca.fmin(ca.fabs(u), HIGHEST)) for u in (a.base, a.value))
    return ca.if_else(ca.fabs(a.change) < 1, ca.sinh(a.change) / base / there, value - ca.tanh(a.base))


def _power_change(value: Expression, a: Carried, b: Carried) -> Expression | None:
    if not b.value.is_constant():
        return None
    exponent = float(b.value)
    if exponent == int(exponent) and 1 <= exponent <= SMALL_POWER:
        k = int(exponent)
        return a.change * sum((a.value**i * a.base ** (k - 1 - i) for i in range(1, k)), a.base ** (k - 1))
    if a.base.is_zero():
        return value
    if a.probe < 0:
        return None
    return a.base**exponent * ca.expm1(exponent * ca.log1p(a.change / a.base))


def _product_change(_: Expression, a: Carried, b: Carried) -> Expression:
    return a.change * b.value + a.base * b.change


def _branch_change(value: Expression, condition: Carried, a: Carried) -> Expression:
    """Of "a where the condition holds, else 0": that of a while the condition stays the same."""
    same = ca.if_else(condition.value, a.change, 0)
    return ca.if_else(condition.value == condition.base, same, value - ca.if_else(condition.base, a.base, 0))


def _extreme_change(operation: int, a: Carried, b: Carried) -> Expression:
    """That of the operand which is the larger, or the less, there; and how far it was from the one that was."""
    there = a.value >= b.value if operation == ca.OP_FMAX else a.value <= b.value
    own, before = (ca.if_else(there, first, second) for first, second in ((a.change, b.change), (a.base, b.base)))
    return own + (before - operate(operation, [a.base, b.base]))


_CHANGES: dict[int, Callable[..., Expression | None]] = {
    ca.OP_ASSIGN: lambda _, a: a.change,
    ca.OP_NEG: lambda _, a: -a.change,
    ca.OP_TWICE: lambda _, a: 2 * a.change,
    ca.OP_ADD: lambda _, a, b: a.change + b.change,
    ca.OP_SUB: lambda _, a, b: a.change - b.change,
    ca.OP_MUL: _product_change,
    ca.OP_SQ: lambda _, a: a.change * (a.value + a.base),
    ca.OP_DIV: lambda value, a, b: (a.change - value * b.change) / b.base,
    ca.OP_INV: lambda value, a: -a.change * value / a.base,
    ca.OP_SQRT: lambda value, a: a.change / (value + ca.sqrt(a.base)),
    ca.OP_FABS: lambda value, a: a.change * (a.value + a.base) / (value + ca.fabs(a.base)),
    ca.OP_FMAX: lambda _, a, b: _extreme_change(ca.OP_FMAX, a, b),
    ca.OP_FMIN: lambda _, a, b: _extreme_change(ca.OP_FMIN, a, b),
    ca.OP_IF_ELSE_ZERO: _branch_change,
    ca.OP_POW: _power_change,
    ca.OP_CONSTPOW: _power_change,
    ca.OP_EXP: _exponential_change,
    ca.OP_LOG: lambda _, a: ca.log1p(a.change / a.base),
    ca.OP_SIN: lambda _, a: 2 * ca.cos(a.base + a.change / 2) * ca.sin(a.change / 2),
    ca.OP_COS: lambda _, a: -2 * ca.sin(a.base + a.change / 2) * ca.sin(a.change / 2),
    ca.OP_TAN: lambda _, a: ca.sin(a.change) / (ca.cos(a.value) * ca.cos(a.base)),
    ca.OP_SINH: lambda _, a: 2 * ca.cosh(a.base + a.change / 2) * ca.sinh(a.change / 2),
    ca.OP_COSH: lambda _, a: 2 * ca.sinh(a.base + a.change / 2) * ca.sinh(a.change / 2),
    ca.OP_TANH: _tanh_change,
    ca.OP_ATAN: lambda _, a: ca.atan2(a.change, 1 + a.value * a.base),
}
"""The change of each operation, free of cancellation, from the value at the displaced point and the operands."""
