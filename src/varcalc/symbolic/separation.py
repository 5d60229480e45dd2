"""Whether an expression is a factor f(y) times a root of what is of second degree in the slope alone.

Every operation is carried out on what is known of its operands; what no rule covers is no such product.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import BINARY, POWERS, UNARY, interpret


@dataclass(frozen=True, slots=True)
class _Product:
    """(c + k v²) to a power, with c and k not negative; times a number or a factor of the place if ``factored``."""

    c: float = 1.0
    k: float = 0.0
    exponent: float = 0.0
    factored: bool = True

    @property
    def of_place(self) -> bool:
        """Whether the slope is not in it."""
        return self.exponent == 0.0

    @property
    def is_sum(self) -> bool:
        """Whether it is c + k v² itself."""
        return self.exponent == 1.0 and not self.factored


@dataclass(frozen=True, slots=True)
class _Slope:
    """The slope v, so many times."""

    times: float = 1.0


Element: TypeAlias = float | _Product | _Slope | None
"""A number, a product, a multiple of the slope; None for anything else."""

PLACE = _Product()


def separates(function: ca.Function, numbers: Sequence[float]) -> bool:
    """Whether L(x, y, v, .., numbers, ..) of one y and one v is L(y, 0) √(1 + k v²) with k > 0, by its operations.

    ``function`` is an SX function whose first result is L, of abscissa, ordinate, slope, an empty second slope,
    parameters and unknowns, of which it does without the first and the last; ``numbers`` are the parameters' values.

    >>> x, y, v, none = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v"), ca.SX(0, 1)
    >>> separates(ca.Function("L", [x, y, v, none, none, none], [ca.sqrt((1 + v**2) / (2 * y))]), [])
    True
    >>> separates(ca.Function("L", [x, y, v, none, none, none], [ca.sqrt(y**2 + v**2)]), [])
    False
    """
    without = [[None] * function.nnz_in(k) for k in (0, 3, 5)]
    arguments: list[Sequence[Element]] = [without[0], [PLACE], [_Slope()], without[1], [*numbers], without[2]]
    found = interpret(function, arguments, float, _applied)[0][0]
    return isinstance(found, _Product) and found.exponent == 0.5 and found.c > 0 and found.k > 0


def _applied(operation: int, operands: Sequence[Element]) -> Element:
    a, b = operands[0], operands[-1]
    if a is None or b is None:
        return None
    if all(isinstance(o, float) for o in operands):
        return _number(operation, [o for o in operands if isinstance(o, float)])
    if operation in _RULES:
        return _RULES[operation](a, b)
    if operation in POWERS:
        return _power(a, b) if isinstance(b, float) else _of_place(operands)
    return _of_place(operands)


def _number(operation: int, operands: Sequence[float]) -> Element:
    """What an operation makes of numbers; None where that is no number."""
    carried_out = (UNARY if len(operands) == 1 else BINARY).get(operation)
    if carried_out is None:
        return None
    with np.errstate(all="ignore"):
        found = float(carried_out(*operands))
    return found if math.isfinite(found) else None


def _of_place(operands: Sequence[Element]) -> Element:
    """A function of the place alone."""
    return PLACE if all(isinstance(o, float) or (isinstance(o, _Product) and o.of_place) for o in operands) else None


def _times(a: Element, b: Element) -> Element:
    if isinstance(a, float):
        a, b = b, a
    if isinstance(a, _Slope):
        return _slope_times(a, b)
    if not isinstance(a, _Product):
        return None
    if isinstance(b, float):
        return replace(a, c=b * a.c, k=b * a.k) if a.is_sum and b >= 0 else replace(a, factored=True)
    if not isinstance(b, _Product) or not (a.of_place or b.of_place or (a.c, a.k) == (b.c, b.k)):
        return None
    known = b if a.of_place else a
    return replace(known, exponent=a.exponent + b.exponent, factored=a.factored or b.factored)


def _slope_times(slope: _Slope, b: Element) -> Element:
    if isinstance(b, float):
        return _Slope(slope.times * b)
    if isinstance(b, _Slope) and slope.times * b.times >= 0:
        return _Product(0.0, slope.times * b.times, 1.0, factored=False)
    return None


def _root_of_squares(a: Element, b: Element) -> Element:
    squares = [o * o if isinstance(o, float) else _power(o, 2.0) for o in (a, b)]
    return None if None in squares else _power(_sum(*squares), 0.5)


def _power(a: Element, exponent: Element) -> Element:
    if isinstance(a, _Slope):
        return _times(a, a) if exponent == 2.0 else None
    if not isinstance(a, _Product) or not isinstance(exponent, float):
        return None
    return replace(a, exponent=a.exponent * exponent)


def _over(a: Element, b: Element) -> Element:
    return _times(a, 1 / b if isinstance(b, float) else _power(b, -1.0))


def _sum(a: Element, b: Element) -> Element:
    if isinstance(a, float):
        a, b = b, a
    if isinstance(a, _Product) and a.is_sum:
        more = _Product(b, 0.0, 1.0, factored=False) if isinstance(b, float) else b
        if isinstance(more, _Product) and more.is_sum and a.c + more.c >= 0:
            return replace(a, c=a.c + more.c, k=a.k + more.k)
        return None
    return _of_place([a, b])


_RULES = {
    ca.OP_ASSIGN: lambda a, _: a,
    ca.OP_MUL: _times,
    ca.OP_TWICE: lambda a, _: _times(a, 2.0),
    ca.OP_NEG: lambda a, _: _times(a, -1.0),
    ca.OP_SQ: lambda a, _: _power(a, 2.0),
    ca.OP_SQRT: lambda a, _: _power(a, 0.5),
    ca.OP_INV: lambda a, _: _power(a, -1.0),
    ca.OP_DIV: _over,
    ca.OP_HYPOT: _root_of_squares,
    ca.OP_ADD: _sum,
    ca.OP_SUB: lambda a, b: _sum(a, _times(b, -1.0) if not isinstance(b, float) else -b),
}
"""What comes of two operands, or of one that is given twice."""
