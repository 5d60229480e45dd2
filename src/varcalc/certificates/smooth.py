"""Smooth functions of one argument in ball arithmetic, each with its first two derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from varcalc.certificates.balls import Series, flint

Chain = tuple[Series, ...]
"""f, f' and f'' at a value, as far as they are asked for."""


class Undecided(ArithmeticError):
    """An operation has no value, or none that is smooth, throughout a box."""


def head(value: Series) -> Any:
    """The leading coefficient: what the series takes at its point, or points."""
    return value[0] if isinstance(value, flint().arb_series) else value


def positive(value: Series, name: str) -> Series:
    """The value; Undecided, of what has that name, where it is not positive throughout."""
    if not head(value) > 0:
        raise Undecided(f"{name} of what is not positive throughout")
    return value


def reciprocal(value: Series) -> Series:
    """1/value; Undecided where that may vanish."""
    if head(value).contains(0) or not head(value).is_finite():
        raise Undecided("a division by what may vanish")
    return 1 / value


def inverse(a: Series, order: int) -> Chain:
    """1/a; Undecided where a may vanish."""
    value = reciprocal(a)
    slope = -(value * value)
    return value, slope, -2 * slope * value if order == 2 else None


def power(a: Series, exponent: Any, order: int) -> Chain:
    """Of a number c: a^c, c a^(c-1), c (c-1) a^(c-2)."""
    results, factor = [], flint().arb(1)
    for k in range(order + 1):
        results.append(factor * _plain_power(a, exponent - k) if not factor.is_zero() else factor)
        factor = factor * (exponent - k)
    return tuple(results)


def _plain_power(a: Series, exponent: Any) -> Series:
    """a^c of an exact number c, to which whole numbers were added."""
    whole = exponent.unique_fmpz()
    if whole is not None:
        n = int(whole)
        return _whole_power(a, n) if n >= 0 else _whole_power(reciprocal(a), -n)
    twice = (2 * exponent).unique_fmpz()
    positive(a, "pow")
    if twice is not None:
        root = a.sqrt()
        n = int(twice)
        return root**n if n > 0 else reciprocal(root ** (-n))
    return (exponent * a.log()).exp()


def _whole_power(a: Series, n: int) -> Series:
    """a^n for n >= 0, by squares; python-flint's own power of a ball about zero is not a number."""
    if n < 2:
        return a if n else flint().arb(1)
    half = _whole_power(a, n // 2)
    return half * half * a if n % 2 else half * half


def root(a: Series, order: int) -> Chain:
    """The square root; Undecided where a is not positive throughout."""
    value = positive(a, "sqrt").sqrt()
    if order == 0:
        return (value,)
    slope = reciprocal(2 * value)
    return value, slope, -2 * slope * slope * slope if order == 2 else None


def logarithm(a: Series, order: int) -> Chain:
    """ln a; Undecided where a is not positive throughout."""
    value = positive(a, "log").log()
    slope = reciprocal(a)
    return value, slope, -(slope * slope)


def exponential(a: Series, order: int) -> Chain:
    """e^a."""
    value = a.exp()
    return value, value, value


def _sine(a: Series, order: int) -> Chain:
    sine = a.sin()
    return sine, a.cos() if order else None, -sine


def _cosine(a: Series, order: int) -> Chain:
    cosine = a.cos()
    return cosine, -a.sin() if order else None, -cosine


def _tangent(a: Series, order: int) -> Chain:
    value = a.sin() * reciprocal(a.cos())
    slope = 1 + value * value
    return value, slope, 2 * value * slope


def _hyperbolic(a: Series) -> tuple[Series, Series]:
    growing = a.exp()
    falling = reciprocal(growing)
    return (growing - falling) / 2, (growing + falling) / 2


def _sinh(a: Series, order: int) -> Chain:
    sine, cosine = _hyperbolic(a)
    return sine, cosine, sine


def _cosh(a: Series, order: int) -> Chain:
    sine, cosine = _hyperbolic(a)
    return cosine, sine, cosine


def _tanh(a: Series, order: int) -> Chain:
    value = 1 - 2 * reciprocal(1 + (2 * a).exp())
    slope = 1 - value * value
    return value, slope, -2 * value * slope


def arctangent(a: Series, order: int) -> Chain:
    """arctan a."""
    slope = reciprocal(1 + a * a)
    return a.atan(), slope, -2 * a * slope * slope


def _arcsine(a: Series, order: int) -> Chain:
    rest = positive(1 - a * a, "asin")
    slope = reciprocal(rest.sqrt())
    return a.asin(), slope, a * slope * reciprocal(rest)


def _arccosine(a: Series, order: int) -> Chain:
    value, slope, bend = _arcsine(a, order)
    return flint().arb.pi() / 2 - value, -slope, -bend


def _arsinh(a: Series, order: int) -> Chain:
    rest = 1 + a * a
    root = rest.sqrt()
    # odd: of the size, so that no digits are lost where a is negative and large
    value = (a + root).log() if not head(a) < 0 else -((root - a).log())
    return value, reciprocal(root), -a * reciprocal(rest * root)


def _arcosh(a: Series, order: int) -> Chain:
    rest = positive(a * a - 1, "acosh")
    root = rest.sqrt()
    return (positive(a, "acosh") + root).log(), reciprocal(root), -a * reciprocal(rest * root)


def _artanh(a: Series, order: int) -> Chain:
    rest = positive(1 - a * a, "atanh")
    slope = reciprocal(rest)
    return ((1 + a) * reciprocal(1 - a)).log() / 2, slope, 2 * a * slope * slope


def _log1p(a: Series, order: int) -> Chain:
    return logarithm(1 + a, order)


def _expm1(a: Series, order: int) -> Chain:
    value = a.exp()
    return value - 1, value, value


def _error_function(a: Series, order: int) -> Chain:
    slope = 2 * (-(a * a)).exp() / flint().arb.pi().sqrt()
    return a.erf(), slope, -2 * a * slope


SMOOTH: dict[int, Callable[[Series, int], Chain]] = {
    ca.OP_SQ: lambda a, _: (a * a, 2 * a, flint().arb(2)),
    ca.OP_INV: inverse, ca.OP_SQRT: root, ca.OP_EXP: exponential, ca.OP_LOG: logarithm,
    ca.OP_SIN: _sine, ca.OP_COS: _cosine, ca.OP_TAN: _tangent, ca.OP_ASIN: _arcsine, ca.OP_ACOS: _arccosine,
    ca.OP_ATAN: arctangent, ca.OP_SINH: _sinh, ca.OP_COSH: _cosh, ca.OP_TANH: _tanh, ca.OP_ASINH: _arsinh,
    ca.OP_ACOSH: _arcosh, ca.OP_ATANH: _artanh, ca.OP_LOG1P: _log1p, ca.OP_EXPM1: _expm1, ca.OP_ERF: _error_function,
}  # fmt: skip
"""Smooth functions of one argument, with their derivatives."""
