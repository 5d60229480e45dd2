"""L dx in the direction (dx, dy), so that first integrals keep their digits at any slope.

With L = n sqrt(1 + y'^2) the first integral y' L_y' - L is a difference of
large numbers where the curve is steep; in the direction (dx, dy) = (c, V s) it
is -n c / sqrt(c^2 + s^2), from the partial derivative by c of a form that is
homogeneous of degree one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class Scaled:
    """The sum of ``mantissa * c**(-power)`` over ``terms``: powers to mantissas that are regular as c goes to 0."""

    terms: dict[float, Expression]

    def plain(self, c: Expression) -> Expression:
        """The sum itself."""
        return sum((m if k == 0 else m * c ** (-k) for k, m in self.terms.items()), ca.SX(0))

    def collected(self, c: Expression) -> tuple[float, Expression]:
        """The same as one term: the highest power and its mantissa."""
        if not self.terms:
            return 0.0, ca.SX(0)
        power = max(self.terms)
        return power, sum((m if k == power else m * c ** (power - k) for k, m in self.terms.items()), ca.SX(0))


def homogeneous(expression: Expression, slope: Expression, c: Expression, s: Expression, scale: float) -> Expression:
    """c * expression at the slope ``scale * s / c``, an SX in which powers of c are collected.

    For an integrand L(x, y, y') this is L dx for dx = c, dy = scale * s.
    """
    others = [v for v in ca.symvar(expression) if not ca.is_equal(v, slope)]
    function = ca.Function("L", [slope, *others], [expression])
    arguments = [[Scaled({1.0: scale * s})], *([Scaled({0.0: v})] for v in others)]

    def apply(operation: int, operands: Sequence[Scaled]) -> Scaled:
        """An operation by its rule on sums of powers of c, or written out where it has none."""
        rule = _SCALED.get(operation)
        result = None if rule is None else rule(c, *operands)
        return Scaled({0.0: operate(operation, [a.plain(c) for a in operands])}) if result is None else result

    result = interpret(function, arguments, lambda number: Scaled({0.0: ca.SX(number)} if number else {}), apply)[0][0]
    return sum((m if k == 1 else m * c ** (1 - k) for k, m in result.terms.items()), ca.SX(0))


def _scaled_sum(a: Scaled, b: Scaled, sign: float) -> Scaled:
    terms = dict(a.terms)
    for power, mantissa in b.terms.items():
        signed = mantissa if sign > 0 else -mantissa
        terms[power] = terms[power] + signed if power in terms else signed
    return Scaled(terms)


def _scaled_map(a: Scaled, rewrite: Callable[[Expression], Expression], shift: float = 0.0) -> Scaled:
    return Scaled({k + shift: rewrite(m) for k, m in a.terms.items()})


def _scaled_product(c: Expression, a: Scaled, b: Scaled) -> Scaled:
    """Distributed over the sum when one factor is a single term."""
    for single, other in ((a, b), (b, a)):
        if len(single.terms) <= 1:
            return Scaled({k + j: m * n for k, m in single.terms.items() for j, n in other.terms.items()})
    (k, m), (j, n) = a.collected(c), b.collected(c)
    return Scaled({k + j: m * n})


def _scaled_quotient(c: Expression, a: Scaled, b: Scaled) -> Scaled:
    power, mantissa = b.collected(c)
    return _scaled_map(a, lambda m: m / mantissa, -power)


def _scaled_power(c: Expression, a: Scaled, b: Scaled) -> Scaled | None:
    exponent = next(iter(b.terms.values()), ca.SX(0))
    if len(b.terms) > 1 or next(iter(b.terms), 0.0) != 0 or not exponent.is_constant():
        return None
    power, mantissa = a.collected(c)
    return Scaled({power * float(exponent): mantissa ** float(exponent)})


def _scaled_root(c: Expression, a: Scaled) -> Scaled:
    power, mantissa = a.collected(c)
    return Scaled({power / 2: ca.sqrt(mantissa)})


def _scaled_size(c: Expression, a: Scaled) -> Scaled:
    power, mantissa = a.collected(c)
    return Scaled({power: ca.fabs(mantissa)})


def _scaled_hypotenuse(c: Expression, a: Scaled, b: Scaled) -> Scaled:
    return _scaled_root(c, _scaled_sum(_scaled_product(c, a, a), _scaled_product(c, b, b), 1.0))


_SCALED: dict[int, Callable[..., Scaled | None]] = {
    ca.OP_ASSIGN: lambda _, a: a,
    ca.OP_NEG: lambda _, a: _scaled_map(a, lambda m: -m),
    ca.OP_TWICE: lambda _, a: _scaled_map(a, lambda m: 2 * m),
    ca.OP_SQ: lambda c, a: _scaled_product(c, a, a),
    ca.OP_INV: lambda c, a: _scaled_quotient(c, Scaled({0.0: ca.SX(1)}), a),
    ca.OP_SQRT: _scaled_root,
    ca.OP_FABS: _scaled_size,
    ca.OP_ADD: lambda _, a, b: _scaled_sum(a, b, 1.0),
    ca.OP_SUB: lambda _, a, b: _scaled_sum(a, b, -1.0),
    ca.OP_MUL: _scaled_product,
    ca.OP_DIV: _scaled_quotient,
    ca.OP_POW: _scaled_power,
    ca.OP_CONSTPOW: _scaled_power,
    ca.OP_HYPOT: _scaled_hypotenuse,
}
"""How powers of c pass through an operation; None where they cannot be told."""
