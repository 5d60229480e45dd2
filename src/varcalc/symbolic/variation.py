"""Whether an expression may vary between samples of its arguments: read from its operations.

Sums and products of what varies gently vary gently. What is narrower than the box it lies in comes of an operation
whose argument goes, inside the box, through more than the scale on which the operation itself varies: exp(u) where u
changes by more than a few, 1/u where u changes by a factor. The arguments are enclosed, so nothing lies between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import instructions, interpret
from varcalc.symbolic.intervals import Interval, applied, constant

CHANGE = 1.5
"""By how much the argument of a function of scale 1 (exp, sin, tanh) may change inside a box."""
FACTOR = 4.0
"""By what factor the argument of a root, a logarithm or a reciprocal may change inside a box."""
VANISHED = -50.0
"""Exponent below which what is left of an exponential is nothing, whatever it is multiplied by."""
CONSTANT_TANH, CONSTANT_ERF = 20.0, 6.0
"""Sizes of the argument beyond which a function is constant to round-off."""
LEAST_POWER = 12
"""Whole power from which on it matters by what factor its base changes."""


def gentle(function: ca.Function) -> bool:
    """Whether nothing narrow can come of any operation of an SX function, whatever its arguments."""
    fixed: dict[int, bool] = {}
    for i in instructions(function):
        fixed[i.target] = i.operation == ca.OP_CONST
        varied = i.sources[-1:] if i.operation == ca.OP_DIV else i.sources
        if i.operation in VARYING and not all(fixed.get(s, False) for s in varied):
            return False
    return True


def excess(function: ca.Function, boxes: Sequence[Sequence[Interval]], shape: tuple[int, ...]) -> np.ndarray:
    """By what factor the worst operation of an SX function varies too much over each box; at most 1 where none does.

    ``boxes`` are the intervals of the nonzeros of each argument, arrays that broadcast to ``shape``.
    """
    worst = np.zeros(shape)

    def watched(operation: int, operands: Sequence[Interval]) -> Interval:
        variation = VARYING.get(operation)
        if variation is not None:
            np.fmax(worst, variation(*operands), out=worst)
        return applied(operation, operands)

    with np.errstate(all="ignore"):
        interpret(function, boxes, constant, watched)
    return worst


def _change(a: Interval) -> np.ndarray:
    return (a[1] - a[0]) / CHANGE


def _exponent(a: Interval) -> np.ndarray:
    return np.where(a[1] < VANISHED, 0.0, _change((np.maximum(a[0], VANISHED), a[1])))


def _saturated(beyond: float) -> Callable[[Interval], np.ndarray]:
    """The change inside the range of arguments within which a function is not constant."""
    return lambda a: _change((np.clip(a[0], -beyond, beyond), np.clip(a[1], -beyond, beyond)))


def _beyond_one(a: Interval) -> np.ndarray:
    """The change of the argument of a function that varies on the scale of max(1, abs(u))."""
    return _change(a) / np.maximum(1.0, _least_size(a))


def _least_size(a: Interval) -> np.ndarray:
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))


def _factor(a: Interval) -> np.ndarray:
    """By what factor of its size an interval changes; infinite for one that holds zero and more."""
    size, least = np.maximum(np.abs(a[0]), np.abs(a[1])), _least_size(a)
    return np.where(a[0] == a[1], 0.0, np.where(least > 0, size / least, np.inf) / FACTOR)


def _from(edge: float) -> Callable[[Interval], np.ndarray]:
    """The factor by which the distance from an ``edge`` of the domain changes."""
    return lambda a: _factor((a[0] - edge, a[1] - edge))


def _from_one(a: Interval) -> np.ndarray:
    return np.fmax(_from(1.0)(a), _from(-1.0)(a))


def _power(a: Interval, b: Interval) -> np.ndarray:
    """Of a whole power nothing narrow comes unless it is high, of another where the base changes by a factor."""
    fixed = b[0] == b[1]
    whole = fixed & (b[0] == np.round(b[0])) & (b[0] >= 0)
    size = np.maximum(np.abs(a[0]), np.abs(a[1]))
    # the largest of u^k is what counts: what is small beside it varies as it likes
    high = np.where(a[0] == a[1], 0.0, b[1] * (1.0 - _least_size(a) / np.where(size > 0, size, 1.0)) / LEAST_POWER)
    varying = np.where(fixed, _factor(a), np.fmax(_factor(a), _change(_times_logarithm(a, b))))
    return np.where(whole, np.where(b[0] < LEAST_POWER, 0.0, high), varying)


def _times_logarithm(a: Interval, b: Interval) -> Interval:
    return applied(ca.OP_MUL, [b, applied(ca.OP_LOG, [a])])


def _divided(_: Interval, b: Interval) -> np.ndarray:
    return _factor(b)


def _length(a: Interval, b: Interval) -> np.ndarray:
    """The factor of the distance from the origin."""
    return _factor(applied(ca.OP_HYPOT, [a, b]))


VARYING: dict[int, Callable[..., np.ndarray]] = {
    ca.OP_EXP: _exponent, ca.OP_EXPM1: _exponent, ca.OP_SINH: _change, ca.OP_COSH: _change, ca.OP_SIN: _change,
    ca.OP_COS: _change, ca.OP_TAN: _change, ca.OP_TANH: _saturated(CONSTANT_TANH), ca.OP_ERF: _saturated(CONSTANT_ERF),
    ca.OP_ATAN: _beyond_one, ca.OP_ASINH: _beyond_one, ca.OP_SQRT: _factor, ca.OP_LOG: _factor, ca.OP_INV: _factor,
    ca.OP_DIV: _divided, ca.OP_LOG1P: _from(-1.0), ca.OP_ACOSH: _from(1.0), ca.OP_ASIN: _from_one,
    ca.OP_ACOS: _from_one, ca.OP_ATANH: _from_one, ca.OP_POW: _power, ca.OP_CONSTPOW: _power, ca.OP_HYPOT: _length,
    ca.OP_ATAN2: _length,
}  # fmt: skip
"""By what factor an operation varies too much over intervals of its operands, by CasADi's codes."""
