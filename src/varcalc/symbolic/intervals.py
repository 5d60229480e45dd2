"""Natural interval extensions: what an expression can be over a box of its arguments.

Every operation is carried out on pairs of least and greatest values (Moore, Kearfott and Cloud,
"Introduction to Interval Analysis", SIAM 2009, ch. 5), on arrays of boxes at once. The ends are rounded to
nearest: an enclosure tells where samples cannot be trusted, it is no proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import UNARY, Call, interpret
from varcalc.symbolic.look_up import enclosed

Interval = tuple[np.ndarray, np.ndarray]
"""Least and greatest values, of one shape."""

RIGHT = np.array(math.pi / 2)
EVERYTHING: Interval = np.array(-math.inf), np.array(math.inf)


def enclosures(function: ca.Function, boxes: Sequence[Sequence[Interval]]) -> list[list[Interval]]:
    """Enclosures of the nonzeros of each result of an SX ``function`` over boxes of the nonzeros of its arguments.

    All intervals have one shape, or shapes that broadcast. An operation of which no enclosure is known encloses
    everything. Raises TypeError for a function that is not an SXFunction.
    """
    with np.errstate(all="ignore"):
        return interpret(function, boxes, constant, applied)


def constant(value: float) -> Interval:
    """The interval of one number."""
    return np.array(value), np.array(value)


def applied(operation: int, operands: Sequence[Interval]) -> Interval:
    """An enclosure of an operation, given by CasADi's code, on enclosures of its operands.

    CasADi writes a choice as a sum of two branches, one of which is zero: it is one or the other, and no sum.
    """
    if operation == ca.OP_ADD and (chosen := _chosen(*operands)) is not None:
        return chosen
    low, high = _carried_out(operation, operands)
    if operation == ca.OP_IF_ELSE_ZERO:
        return _Branch((low, high), operands)
    return _Negated((low, high), operands) if operation == ca.OP_NOT else (low, high)


class _Made(tuple[np.ndarray, np.ndarray]):
    """An interval that knows the operands it was made of."""

    operands: Sequence[Interval]

    def __new__(cls, interval: Interval, operands: Sequence[Interval]) -> _Made:  # noqa: PYI034
        """The interval, with what it was made of."""
        made = super().__new__(cls, interval)
        made.operands = operands
        return made


class _Branch(_Made):
    """What is a value where a condition holds, and zero elsewhere."""


class _Negated(_Made):
    """The opposite of a condition."""


def _chosen(a: Interval, b: Interval) -> Interval | None:
    """The hull of two branches, one of which holds where the other does not; None for no such two."""
    if not (isinstance(a, _Branch) and isinstance(b, _Branch)):
        return None
    (holds, first), (fails, second) = a.operands, b.operands
    if isinstance(holds, _Negated) and holds.operands[0] is fails:
        (holds, first), (fails, second) = (fails, second), (holds, first)
    if not (isinstance(fails, _Negated) and fails.operands[0] is holds):
        return None
    low, high = _true(holds)
    sure, never = low == 1.0, high == 0.0
    least, most = np.minimum(first[0], second[0]), np.maximum(first[1], second[1])
    return (
        np.where(sure, first[0], np.where(never, second[0], least)),
        np.where(sure, first[1], np.where(never, second[1], most)),
    )


def _carried_out(operation: int, operands: Sequence[Interval]) -> Interval:
    """The same of an operation by itself."""
    if isinstance(operation, Call):
        found = enclosed(operation.function, *operands[0]) if len(operands) == 1 else None
    else:
        rule = RULES.get(operation)
        found = rule(*operands) if rule is not None else None
    if found is None:
        return EVERYTHING
    low, high = found
    # not a number: the operation is undefined somewhere in the box
    return np.fmax(low, -math.inf), np.fmin(high, math.inf)


def _increasing(operation: int) -> Callable[[Interval], Interval]:
    of = UNARY[operation]
    return lambda a: (of(a[0]), of(a[1]))


def _decreasing(operation: int) -> Callable[[Interval], Interval]:
    of = UNARY[operation]
    return lambda a: (of(a[1]), of(a[0]))


def _held(operation: int, least: float, greatest: float) -> Callable[[Interval], Interval]:
    """An increasing function that is defined between two numbers, of the part of the interval that lies there."""
    of = UNARY[operation]

    def held(a: Interval) -> Interval:
        """The range over ``a``; NaN where ``a`` lies outside the domain."""
        outside = (a[1] < least) | (a[0] > greatest)
        low, high = (of(np.clip(v, least, greatest)) for v in a)
        return np.where(outside, math.nan, low), np.where(outside, math.nan, high)

    return held


def _added(a: Interval, b: Interval) -> Interval:
    return a[0] + b[0], a[1] + b[1]


def _subtracted(a: Interval, b: Interval) -> Interval:
    return a[0] - b[1], a[1] - b[0]


def _multiplied(a: Interval, b: Interval) -> Interval:
    corners = [p * q for p in a for q in b]
    low = _of_all(np.minimum, corners)
    if np.isnan(low).any():  # 0 times an end at infinity
        corners = [np.where(np.isnan(c), 0.0, c) for c in corners]
        low = _of_all(np.minimum, corners)
    return low, _of_all(np.maximum, corners)


def _of_all(extreme: np.ufunc, corners: Sequence[np.ndarray]) -> np.ndarray:
    first, second, third, fourth = corners
    return extreme(extreme(first, second), extreme(third, fourth))


def _inverted(a: Interval) -> Interval:
    low, high = a
    inside = (low < 0) & (high > 0)
    least = np.where(inside | (high == 0), -math.inf, 1.0 / high)
    greatest = np.where(inside | (low == 0), math.inf, 1.0 / low)
    return least, greatest


def _squared(a: Interval) -> Interval:
    return _sized(a, a[0] ** 2, a[1] ** 2)


def _absolute(a: Interval) -> Interval:
    return _sized(a, np.abs(a[0]), np.abs(a[1]))


def _sized(a: Interval, low: np.ndarray, high: np.ndarray) -> Interval:
    """An even function, growing with the size of its argument, by its values at the ends."""
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(low, high)), np.maximum(low, high)


def _raised(a: Interval, b: Interval) -> Interval:
    exponent = b[0]
    fixed = exponent == b[1]
    whole, even = fixed & (exponent == np.round(exponent)), fixed & (exponent % 2 == 0)
    with_sign = np.where(whole, a[0], np.maximum(a[0], 0.0)), np.where(whole, a[1], np.maximum(a[1], 0.0))
    size = np.abs(exponent)
    low, high = (np.power(v, size) for v in with_sign)
    spread = _sized(with_sign, low, high)
    power = np.where(even, spread[0], low), np.where(even, spread[1], high)
    inverse = _inverted(power)
    down = exponent < 0
    found = np.where(down, inverse[0], power[0]), np.where(down, inverse[1], power[1])
    any_base = _exponential(_multiplied(b, _logarithm(a)))  # an exponent that varies
    return np.where(fixed, found[0], any_base[0]), np.where(fixed, found[1], any_base[1])


def _cosine_from(start: float) -> Callable[[Interval], Interval]:
    """cos(a - start)."""

    def cosine(a: Interval) -> Interval:
        """The range of cos(a - start)."""
        low, high = a[0] - start, a[1] - start
        turns, half = 2 * math.pi, math.pi
        top = np.floor(high / turns) >= np.ceil(low / turns)
        bottom = np.floor((high - half) / turns) >= np.ceil((low - half) / turns)
        first, last = np.cos(low), np.cos(high)
        return np.where(bottom, -1.0, np.minimum(first, last)), np.where(top, 1.0, np.maximum(first, last))

    return cosine


def _tangent(a: Interval) -> Interval:
    pole = np.floor(a[1] / math.pi + 0.5) != np.floor(a[0] / math.pi + 0.5)
    return np.where(pole, -math.inf, np.tan(a[0])), np.where(pole, math.inf, np.tan(a[1]))


def _cosh(a: Interval) -> Interval:
    low, high = np.cosh(a[0]), np.cosh(a[1])
    return np.where((a[0] <= 0) & (a[1] >= 0), 1.0, np.minimum(low, high)), np.maximum(low, high)


def _remainder_of(a: Interval, b: Interval) -> Interval:
    """fmod: what is left of a, with its sign, when whole multiples of b are taken off."""
    size = np.maximum(np.abs(b[0]), np.abs(b[1]))
    first, last = np.trunc(a[0] / size), np.trunc(a[1] / size)
    whole = (b[0] == b[1]) & (first == last)
    low = np.where(whole, a[0] - first * size, np.where(a[0] >= 0, 0.0, -size))
    return low, np.where(whole, a[1] - first * size, np.where(a[1] <= 0, 0.0, size))


def _compared(below: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Callable[[Interval, Interval], Interval]:
    """1 where ``below`` holds of all pairs, at least 0, and at most 1 where it holds of one."""
    return lambda a, b: (np.where(below(a[1], b[0]), 1.0, 0.0), np.where(below(a[0], b[1]), 1.0, 0.0))


def _equal(a: Interval, b: Interval) -> Interval:
    certain = (a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0])
    return np.where(certain, 1.0, 0.0), np.where((a[0] <= b[1]) & (b[0] <= a[1]), 1.0, 0.0)


def _true(a: Interval) -> Interval:
    """Whether what is 0 or not is not 0: as an interval of 0 and 1."""
    return np.where((a[0] > 0) | (a[1] < 0), 1.0, 0.0), np.where((a[0] == 0) & (a[1] == 0), 0.0, 1.0)


def _not(a: Interval) -> Interval:
    low, high = _true(a)
    return 1.0 - high, 1.0 - low


def _where(condition: Interval, value: Interval) -> Interval:
    """``value`` where the condition is true, 0 where it is not."""
    low, high = _true(condition)
    sure, never = low == 1.0, high == 0.0
    least = np.where(sure, value[0], np.where(never, 0.0, np.minimum(value[0], 0.0)))
    return least, np.where(sure, value[1], np.where(never, 0.0, np.maximum(value[1], 0.0)))


_exponential, _logarithm = _increasing(ca.OP_EXP), _held(ca.OP_LOG, 0.0, math.inf)

RULES: dict[int, Callable[..., Interval]] = {
    **{
        operation: _increasing(operation)
        for operation in (
            ca.OP_ASSIGN, ca.OP_EXP, ca.OP_TWICE, ca.OP_ATAN, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN, ca.OP_ERF,
            ca.OP_SINH, ca.OP_TANH, ca.OP_ASINH, ca.OP_EXPM1,
        )
    },
    ca.OP_NEG: _decreasing(ca.OP_NEG), ca.OP_LOG: _logarithm, ca.OP_SQRT: _held(ca.OP_SQRT, 0.0, math.inf),
    ca.OP_ASIN: _held(ca.OP_ASIN, -1.0, 1.0), ca.OP_ACOSH: _held(ca.OP_ACOSH, 1.0, math.inf),
    ca.OP_ATANH: _held(ca.OP_ATANH, -1.0, 1.0), ca.OP_LOG1P: _held(ca.OP_LOG1P, -1.0, math.inf),
    ca.OP_ACOS: lambda a: _subtracted((RIGHT, RIGHT), _held(ca.OP_ASIN, -1.0, 1.0)(a)),
    ca.OP_SQ: _squared, ca.OP_FABS: _absolute, ca.OP_INV: _inverted, ca.OP_COSH: _cosh, ca.OP_NOT: _not,
    ca.OP_SIN: _cosine_from(math.pi / 2), ca.OP_COS: _cosine_from(0.0), ca.OP_TAN: _tangent,
    ca.OP_ADD: _added, ca.OP_SUB: _subtracted, ca.OP_MUL: _multiplied,
    ca.OP_DIV: lambda a, b: _multiplied(a, _inverted(b)), ca.OP_POW: _raised, ca.OP_CONSTPOW: _raised,
    ca.OP_FMIN: lambda a, b: (np.fmin(a[0], b[0]), np.fmin(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (np.fmax(a[0], b[0]), np.fmax(a[1], b[1])),
    ca.OP_LT: _compared(np.less), ca.OP_LE: _compared(np.less_equal), ca.OP_EQ: _equal,
    ca.OP_NE: lambda a, b: _not(_equal(a, b)), ca.OP_IF_ELSE_ZERO: _where,
    ca.OP_AND: lambda a, b: _multiplied(_true(a), _true(b)),
    ca.OP_OR: lambda a, b: _not(_multiplied(_not(a), _not(b))),
    ca.OP_FMOD: _remainder_of,
    ca.OP_HYPOT: lambda a, b: _increasing(ca.OP_SQRT)(_added(_squared(a), _squared(b))),
}  # fmt: skip
"""Enclosures of the operations, by CasADi's codes."""
