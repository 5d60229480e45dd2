"""The Taylor series of a solution, as expressions of the state at which it is expanded.

With every operation of a system goes a recurrence that gives the kth
coefficient of its result from those of its arguments up to the kth (Jorba and
Zou, "A software package for the numerical integration of ODEs by means of
high-order Taylor methods", Experimental Mathematics 14 (2005), sect. 2;
Griewank and Walther, "Evaluating Derivatives", ch. 13). Y' = f(Y) then gives
the coefficients of Y one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import CannotLower, scalar_function
from varcalc.symbolic.instructions import NAMES, interpret

Expression = Any
"""A CasADi SX scalar."""
Operation = Callable[[Expression, Expression | float], Expression]
Term = Callable[[int], Expression]
"""The kth coefficient of a series, from those that are known when it is asked for."""
PARALLEL = 4
"""Running sums of a long sum: a processor adds as many at a time."""


@dataclass(eq=False)
class Series:
    """A power series whose coefficients, those ``known``, are found one after the other by ``term``.

    One that is a number times another tells so by ``multiple``: what becomes of it is multiplied once, and not at every
    operation on the way. One that is divided by another tells so by ``ratio``, one that is a ``number`` by that.
    """

    term: Term
    known: list[Expression] = field(default_factory=list)
    multiple: tuple[float, Series] | None = None
    ratio: tuple[Series, Series] | None = None
    number: float | None = None

    def __getitem__(self, k: int) -> Expression:
        while len(self.known) <= k:
            self.known.append(self.term(len(self.known)))
        return self.known[k]


# CasADi's own operators first try whether their operands are numbers or matrices of them, which takes eight times as
# long as the operation; a system has thousands of them.
_plus: Operation = partial(ca.SX.binary, ca.OP_ADD)
_minus: Operation = partial(ca.SX.binary, ca.OP_SUB)
_times: Operation = partial(ca.SX.binary, ca.OP_MUL)


def solution_series(system: ca.Function, stops: ca.Function, order: int) -> tuple[list[Any], list[Any], Any, Any]:
    """The series of Y and of the stopping functions along Y' = f(Y), of ``order``, as columns of coefficients.

    Returns a list of N and one of k columns (order + 1,), and the symbols Y (N,) and constants (c,) they are
    expressed by. Raises :class:`CannotLower`, naming the operation, where there is no recurrence.
    """
    s, state, constants = (ca.SX.sym(name, system.numel_in(k)) for k, name in enumerate("sYc"))
    solution = [_constant(start) for start in ca.vertsplit(state)]
    both = ca.vertcat(*(ca.densify(f(s, state, constants)) for f in (system, stops)))
    # what the stops share with the rates is expanded once
    function = ca.Function("both", [s, state, constants], [ca.cse(both)])
    results = carried(function, solution, constants)
    for series, rate in zip(solution, results[: len(solution)], strict=True):
        series.term = _integral(rate)
    levels = results[len(solution) :]
    for k in range(order + 1):  # in order, so that no recurrence goes deep
        for series in (*solution, *levels):
            series[k]
    columns = [ca.vertcat(*series.known) for series in (*solution, *levels)]
    return columns[: len(solution)], columns[len(solution) :], state, constants


def carried(function: ca.Function, state: Sequence[Series], constants: Any) -> list[Series]:
    """The results of ``function``, ``(s, Y, constants)`` without dependence on s, as series."""
    function = scalar_function(function)
    inputs = [[_constant(0.0)], [state[k] for k in _rows(function, 1)], []]
    inputs[0] = inputs[0][: function.nnz_in(0)]
    inputs[2] = [_constant(constants[k]) for k in _rows(function, 2)]
    found = interpret(function, inputs, _constant, _apply)[0]
    results = [_constant(0.0)] * function.numel_out(0)
    for place, series in zip(function.sparsity_out(0).row(), found, strict=True):
        results[place] = series
    return results


def _rows(function: ca.Function, argument: int) -> list[int]:
    return list(function.sparsity_in(argument).row())


def _apply(operation: int, operands: Sequence[Series]) -> Series:
    rules = _RULES.get(operation)
    if rules is None:
        raise CannotLower(
            f"the system uses `{NAMES.get(operation, operation)}`, which has no Taylor series the engine knows; "
            "use the Dop853 engine"
        )
    return rules(*operands)


def _constant(value: Expression) -> Series:
    value = ca.SX(value)
    return Series(lambda _: ca.SX(0), [value], number=float(value) if value.is_constant() else None)


def _convolved(a: Series, b: Series, k: int, terms: range, weight: Callable[[int], float] | None = None) -> Expression:
    """The sum of a_j b_(k-j) over the ``terms`` j, each with its ``weight(j)``, as several running sums."""
    if not terms:
        return ca.SX(0)
    factors = [a[j] if weight is None else _times(a[j], weight(j)) for j in terms]
    products = [_times(factor, b[k - j]) for j, factor in zip(terms, factors, strict=True)]
    return reduce(_plus, [reduce(_plus, products[start::PARALLEL]) for start in range(min(PARALLEL, len(terms)))])


def _linear(a: Series, b: Series, sign: float) -> Series:
    operation = _plus if sign > 0 else _minus
    return Series(lambda k: operation(a[k], b[k]))


def _parts(a: Series) -> tuple[float, Series]:
    """A number and a series, of which ``a`` is the product."""
    return (1.0, a) if a.multiple is None else a.multiple


def _scaled(a: Series, by: float) -> Series:
    number, whole = _parts(a)
    by = number * by
    if by == 0.0:
        return _constant(0.0)
    return whole if by == 1.0 else Series(lambda k: _times(whole[k], by), multiple=(by, whole))


def _product(a: Series, b: Series) -> Series:
    for one, other in ((a, b), (b, a)):
        if one.number is not None:
            return _scaled(other, one.number)
    (first, a), (second, b) = _parts(a), _parts(b)
    if a is b:
        return _scaled(_whole_square(a), first * second)
    for one, other in ((a, b), (b, a)):
        if one.ratio is not None and one.ratio[0] is other:  # b (b/v), of which derivatives are full, is b²/v
            return _scaled(_whole_quotient(_whole_square(other), one.ratio[1]), first * second)
    return _scaled(Series(lambda k: _convolved(a, b, k, range(k + 1))), first * second)


def _square(a: Series) -> Series:
    return _product(a, a)


def _whole_square(a: Series) -> Series:
    def term(k: int) -> Expression:
        crossed = _times(_convolved(a, a, k, range((k + 1) // 2)), 2)
        return crossed if k % 2 else _plus(crossed, _times(a[k // 2], a[k // 2]))

    return Series(term)


def _quotient(a: Series, b: Series) -> Series:
    if b.number:
        return _scaled(a, 1 / b.number)
    (first, a), (second, b) = _parts(a), _parts(b)
    return _scaled(_whole_quotient(a, b), first / second)


def _whole_quotient(a: Series, b: Series) -> Series:
    def term(k: int) -> Expression:
        return _times(_minus(a[k], _convolved(b, result, k, range(1, k + 1))), over)

    over = 1 / b[0]
    result = Series(term, ratio=(a, b))
    return result


def _integral(rate: Series) -> Term:
    number, whole = _parts(rate)
    return lambda k: _times(whole[k - 1], number / k)


def _root(a: Series) -> Series:
    def term(k: int) -> Expression:
        """The k-th coefficient, from a = w²."""
        if k == 0:
            return ca.sqrt(a[0])
        half, odd = k // 2, k % 2
        pairs = _convolved(result, result, k, range(1, half + odd))
        rest = _minus(a[k], _times(pairs, 2))
        return _times(rest if odd else _minus(rest, _times(result[half], result[half])), over)

    result = Series(term)
    over = 1 / (2 * result[0])
    return result


def _power(a: Series, exponent: float) -> Series:
    """a to a constant power; to small natural powers by products, since those are regular where a is zero."""
    if exponent in {0.0, 1.0}:
        return a if exponent else _constant(1.0)
    if exponent == 0.5:
        return _root(a)
    if exponent in {2.0, 3.0, 4.0}:
        squared = _square(a)
        return {2.0: squared, 3.0: _product(squared, a), 4.0: _square(squared)}[exponent]

    def term(k: int) -> Expression:
        """The k-th coefficient, from a w' = ``exponent`` w a'."""
        if k == 0:
            return a[0] ** exponent
        terms = _convolved(a, result, k, range(1, k + 1), lambda j: exponent * j - (k - j))
        return _times(_times(terms, over), 1 / k)

    over = 1 / a[0]
    result = Series(term)
    return result


def _to_power(a: Series, b: Series) -> Series:
    if b.number is not None:
        return _power(a, b.number)
    return _exponential(_product(b, _logarithm(a)))


def _along(a: Series, start: Callable[[Expression], Expression], slope: Callable[[Series], Series]) -> Series:
    """The series w of a function with w' = g a', from its first coefficient and g = ``slope(w)``."""

    def term(k: int) -> Expression:
        """The k-th coefficient, from w' = g a'."""
        if k == 0:
            return start(a[0])
        return _times(_convolved(a, rate, k, range(1, k + 1), float), 1 / k)

    result = Series(term)
    rate = slope(result)
    return result


def _exponential(a: Series) -> Series:
    return _along(a, ca.exp, lambda w: w)


def _logarithm(a: Series) -> Series:
    return _along(a, ca.log, lambda _: _quotient(_constant(1.0), a))


def _pair(a: Series, odd: Any, even: Any, sign: float) -> tuple[Series, Series]:
    """Sine and cosine (``sign`` -1), or hyperbolic sine and cosine."""
    sine, cosine = Series(lambda _: 0), Series(lambda _: 0)

    def follows(start: Any, rate: Series, factor: float) -> Term:
        """The coefficients of that one of the two whose derivative is ``factor`` times ``rate`` times a'."""

        def term(k: int) -> Expression:
            """The k-th coefficient."""
            if k == 0:
                return start(a[0])
            return _times(_convolved(a, rate, k, range(1, k + 1), float), factor / k)

        return term

    sine.term, cosine.term = follows(odd, cosine, 1.0), follows(even, sine, sign)
    return sine, cosine


def _by_slope(function: Any, slope: Callable[[Series, Series], Series]) -> Callable[[Series], Series]:
    """The rule of a function from its derivative, ``slope(a, w)`` of its argument and itself."""
    return lambda a: _along(a, function, lambda w: slope(a, w))


def _one_and(a: Series, sign: float) -> Series:
    return _linear(_constant(1.0), _square(a), sign)


def _inverse(a: Series) -> Series:
    return _quotient(_constant(1.0), a)


def _atan2(y: Series, x: Series) -> Series:
    """θ' = (x y' - y x')/(x² + y²)."""
    radius = _linear(_square(x), _square(y), 1.0)
    across, along = _quotient(x, radius), _quotient(y, radius)

    def term(k: int) -> Expression:
        """The k-th coefficient of θ."""
        if k == 0:
            return ca.atan2(y[0], x[0])
        terms = range(1, k + 1)
        turned = _minus(_convolved(y, across, k, terms, float), _convolved(x, along, k, terms, float))
        return _times(turned, 1 / k)

    return Series(term)


def _chosen(test: Callable[..., Expression]) -> Callable[..., Series]:
    """A function that is constant but for its jumps."""
    return lambda *operands: _constant(test(*(operand[0] for operand in operands)))


def _piece(condition: Expression, a: Series, b: Series) -> Series:
    return Series(lambda k: ca.if_else(condition, a[k], b[k]))


_RULES: dict[int, Callable[..., Series]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_NEG: lambda a: _scaled(a, -1.0),
    ca.OP_TWICE: lambda a: _scaled(a, 2.0),
    ca.OP_ADD: lambda a, b: _linear(a, b, 1.0),
    ca.OP_SUB: lambda a, b: _linear(a, b, -1.0),
    ca.OP_MUL: _product,
    ca.OP_SQ: _square,
    ca.OP_DIV: _quotient,
    ca.OP_INV: _inverse,
    ca.OP_SQRT: _root,
    ca.OP_POW: _to_power,
    ca.OP_CONSTPOW: _to_power,
    ca.OP_HYPOT: lambda a, b: _root(_linear(_square(a), _square(b), 1.0)),
    ca.OP_EXP: _exponential,
    ca.OP_LOG: _logarithm,
    ca.OP_LOG1P: _by_slope(ca.log1p, lambda a, _: _inverse(_linear(_constant(1.0), a, 1.0))),
    ca.OP_EXPM1: _by_slope(ca.expm1, lambda _, w: _linear(_constant(1.0), w, 1.0)),
    ca.OP_SIN: lambda a: _pair(a, ca.sin, ca.cos, -1.0)[0],
    ca.OP_COS: lambda a: _pair(a, ca.sin, ca.cos, -1.0)[1],
    ca.OP_SINH: lambda a: _pair(a, ca.sinh, ca.cosh, 1.0)[0],
    ca.OP_COSH: lambda a: _pair(a, ca.sinh, ca.cosh, 1.0)[1],
    ca.OP_TAN: _by_slope(ca.tan, lambda _, w: _one_and(w, 1.0)),
    ca.OP_TANH: _by_slope(ca.tanh, lambda _, w: _one_and(w, -1.0)),
    ca.OP_ATAN: _by_slope(ca.atan, lambda a, _: _inverse(_one_and(a, 1.0))),
    ca.OP_ATANH: _by_slope(ca.atanh, lambda a, _: _inverse(_one_and(a, -1.0))),
    ca.OP_ASIN: _by_slope(ca.asin, lambda a, _: _inverse(_root(_one_and(a, -1.0)))),
    ca.OP_ACOS: _by_slope(ca.acos, lambda a, _: _scaled(_inverse(_root(_one_and(a, -1.0))), -1.0)),
    ca.OP_ASINH: _by_slope(ca.asinh, lambda a, _: _inverse(_root(_one_and(a, 1.0)))),
    ca.OP_ACOSH: _by_slope(ca.acosh, lambda a, _: _inverse(_root(_linear(_square(a), _constant(1.0), -1.0)))),
    ca.OP_ERF: _by_slope(
        ca.erf, lambda a, _: _scaled(_exponential(_scaled(_square(a), -1.0)), 2 / float(np.sqrt(np.pi)))
    ),
    ca.OP_ATAN2: _atan2,
    ca.OP_NOT: _chosen(ca.logic_not),
    ca.OP_SIGN: _chosen(ca.sign),
    ca.OP_LT: _chosen(lambda a, b: a < b),
    ca.OP_LE: _chosen(lambda a, b: a <= b),
    ca.OP_EQ: _chosen(lambda a, b: a == b),
    ca.OP_NE: _chosen(lambda a, b: a != b),
    ca.OP_AND: _chosen(ca.logic_and),
    ca.OP_OR: _chosen(ca.logic_or),
    ca.OP_FABS: lambda a: _piece(a[0] < 0, _scaled(a, -1.0), a),
    ca.OP_FMIN: lambda a, b: _piece(b[0] < a[0], b, a),
    ca.OP_FMAX: lambda a, b: _piece(a[0] < b[0], b, a),
    ca.OP_COPYSIGN: lambda a, b: _piece((a[0] < 0) == (b[0] < 0), a, _scaled(a, -1.0)),
    ca.OP_IF_ELSE_ZERO: lambda a, b: Series(lambda k: ca.if_else(a[0], b[k], 0)),
}
"""The series of each of CasADi's operations from those of its arguments."""
