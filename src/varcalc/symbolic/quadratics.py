"""Polynomials of degree two whose coefficients depend on the abscissa, and proofs that they bend one way.

A coefficient is a number, or an expression in x that is enclosed on the pieces of an interval when its sign is asked
for, and not before: most are never asked. A number is exact: where an operation on numbers would round, its result is
an enclosure as well, and the ends of enclosures are rounded outward, so that a proof is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import BINARY, SUMS, UNARY
from varcalc.symbolic.intervals import EVERYTHING, Interval, applied

INTERVAL_PIECES = 16
"""Pieces of the interval on which a coefficient is enclosed."""
SHARES = np.arange(INTERVAL_PIECES + 1) / INTERVAL_PIECES

DEFINED = {
    ca.OP_ASSIGN, ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_EXP, ca.OP_SIN, ca.OP_COS,
    ca.OP_ATAN, ca.OP_TANH, ca.OP_COSH, ca.OP_SINH, ca.OP_ASINH, ca.OP_ERF, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX,
    ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT,
    ca.OP_IF_ELSE_ZERO, ca.OP_HYPOT,
}  # fmt: skip
"""Operations that give a number whatever numbers they are given."""
FORGETTING = {
    ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT, ca.OP_HYPOT,
    ca.OP_POW, ca.OP_CONSTPOW,
}  # fmt: skip
"""Operations that may give a number where they are given none: an enclosure of their arguments says nothing there."""
RATIONAL: dict[int, Callable[..., Fraction]] = {
    ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b, ca.OP_SQ: lambda a: a * a, ca.OP_INV: lambda a: 1 / a,
}  # fmt: skip
"""Operations whose results may be held against exact ones."""
EXACT = {
    ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN,
    ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT, ca.OP_IF_ELSE_ZERO,
}  # fmt: skip
"""Operations that do not round."""
ROUNDED = 16.0 * np.finfo(float).eps
"""Relative error that no operation of the table exceeds, NumPy's and SciPy's functions among them."""
TINY, HUGE = 1e-150, 1e150
"""Sizes beyond which products and powers may leave the range of doubles."""
LARGEST_ANGLE = 1e7
"""Size of an angle up to which a sine between two ends is within round-off of one where its crest may be missed."""
NEAR_POLE = 1e12
"""A tangent that large is too near to a pole for its argument to be trusted."""


class AlongX:
    """What depends on the abscissa alone: ``operation`` on ``operands``, enclosed on the pieces when asked.

    ``defined`` tells that it is a number at every x.
    """

    __slots__ = ("_enclosure", "defined", "operands", "operation")

    def __init__(self, operation: int, operands: tuple[Coefficient, ...], enclosure: Interval | None = None) -> None:
        self.operation, self.operands = operation, operands
        known = all(map(defined, operands))
        self.defined = known and operation in DEFINED
        self._enclosure = enclosure
        if not known and (operation in FORGETTING or (operation == ca.OP_IF_ELSE_ZERO and not defined(operands[0]))):
            self._enclosure = EVERYTHING

    @classmethod
    def abscissa(cls, low: float, high: float) -> AlongX:
        """The abscissa itself, between two numbers."""
        edges = low + (high - low) * SHARES
        edges[-1] = high
        return cls(ca.OP_ASSIGN, (), (edges[:-1], edges[1:]))

    @classmethod
    def between(cls, low: np.ndarray, high: np.ndarray) -> AlongX:
        """What lies between two numbers on each of a number of boxes, by arrays of these."""
        return cls(ca.OP_ASSIGN, (), (low, high))

    @property
    def enclosure(self) -> Interval:
        """Least and greatest values on each piece."""
        if self._enclosure is None:
            self._enclosure = outward(self.operation, [_enclosed(o) for o in self.operands])
        return self._enclosure

    def __add__(self, other: Coefficient) -> Coefficient:
        return self if other == 0.0 else AlongX(ca.OP_ADD, (self, other))

    __radd__ = __add__

    def __mul__(self, other: Coefficient) -> Coefficient:
        if other is self:
            return AlongX(ca.OP_SQ, (self,))
        if isinstance(other, float) and other in (0.0, 1.0):
            return self if other else 0.0
        return AlongX(ca.OP_MUL, (self, other))

    __rmul__ = __mul__

    def __neg__(self) -> Coefficient:
        return AlongX(ca.OP_NEG, (self,))

    def __truediv__(self, other: Coefficient) -> Coefficient:
        return AlongX(ca.OP_DIV, (self, other))

    def __rtruediv__(self, other: float) -> Coefficient:
        return AlongX(ca.OP_DIV, (other, self))


Coefficient: TypeAlias = float | AlongX
"""A number, or what depends on the abscissa alone."""


def defined(value: Coefficient) -> bool:
    """Whether a coefficient is a number at every x."""
    return value.defined if isinstance(value, AlongX) else math.isfinite(value)


def outward(operation: int, operands: Sequence[Interval]) -> Interval:
    """An enclosure of an operation on enclosures, its ends rounded outward."""
    low, high = applied(operation, operands)
    if operation in EXACT:
        return low, high
    sizes = [np.abs(end) for operand in operands for end in operand]
    if operation not in SUMS and any(
        bool(np.any(np.isfinite(size) & (size != 0.0) & ((size < TINY) | (size > HUGE)))) for size in sizes
    ):
        return EVERYTHING
    if operation == ca.OP_TAN and not bool(np.all(np.maximum(np.abs(low), np.abs(high)) < NEAR_POLE)):
        return EVERYTHING
    if operation in (ca.OP_SIN, ca.OP_COS):
        low, high = _oscillating(UNARY[operation], operands[0], low, high)
    return rounded_down(low), rounded_up(high)


def _oscillating(of: Callable[[Any], Any], argument: Interval, low: np.ndarray, high: np.ndarray) -> Interval:
    """A sine or cosine by its values at the ends, which ``low`` and ``high`` are those of a shifted argument."""
    with np.errstate(all="ignore"):
        first, last = (of(end) for end in argument)
    near = np.maximum(*map(np.abs, argument)) < LARGEST_ANGLE
    down, up = near & (low > -1.0), near & (high < 1.0)
    return np.where(down, np.minimum(first, last), -1.0), np.where(up, np.maximum(first, last), 1.0)


def rounded_down(value: Any) -> Any:
    """Numbers less than those that were rounded a few times; a zero is taken to be exact."""
    return value - ROUNDED * abs(value)


def rounded_up(value: Any) -> Any:
    """Numbers greater than those that were rounded a few times; a zero is taken to be exact."""
    return value + ROUNDED * abs(value)


NOWHERE_KNOWN = AlongX(ca.OP_ERFINV, (), EVERYTHING)
"""A coefficient of which nothing is known."""


def coefficient(operation: int, *operands: Coefficient) -> Coefficient:
    """An operation on what depends on the abscissa at most; a number where the operands are and it does not round."""
    if AlongX in map(type, operands):
        return AlongX(operation, operands)
    carried_out = (UNARY if len(operands) == 1 else BINARY).get(operation)
    if carried_out is None:
        return NOWHERE_KNOWN
    with np.errstate(all="ignore"):
        value = float(carried_out(*operands))
    if not math.isfinite(value):
        return NOWHERE_KNOWN
    if operation in EXACT or (operation in RATIONAL and value == RATIONAL[operation](*map(Fraction, operands))):  # pyright: ignore[reportArgumentType]  all are numbers
        return value
    rounded = AlongX(operation, operands)
    rounded.defined = True
    return rounded


def added(a: Any, b: Any) -> Any:
    """The sum of two coefficients, or of two Fractions."""
    return coefficient(ca.OP_ADD, a, b) if type(a) is type(b) is float else a + b


def multiplied(a: Any, b: Any) -> Any:
    """The product of two coefficients, or of two Fractions."""
    return coefficient(ca.OP_MUL, a, b) if type(a) is type(b) is float else a * b


def _enclosed(value: Coefficient) -> Interval:
    if isinstance(value, AlongX):
        return value.enclosure
    number = np.asarray(value)
    return number, number


def least(value: Any) -> float:
    """No value of a coefficient is less; a number itself, a Fraction included."""
    if not isinstance(value, AlongX):
        return value
    with np.errstate(all="ignore"):
        return float(np.min(value.enclosure[0]))


def greatest(value: Any) -> float:
    """No value of a coefficient is greater."""
    if not isinstance(value, AlongX):
        return value
    with np.errstate(all="ignore"):
        return float(np.max(value.enclosure[1]))


Squares: TypeAlias = dict[tuple[int, int], Any]
"""Coefficients of a quadratic form by the pair of its entries, the lesser first."""


class Polynomial(NamedTuple):
    """``constant + sum linear[i] z_i + sum quadratic[i, j] z_i z_j``: never changed once it is made."""

    constant: Coefficient
    linear: dict[int, Coefficient]
    quadratic: Squares

    def plus(self, other: Polynomial) -> Polynomial:
        """The sum of two."""
        return Polynomial(
            added(self.constant, other.constant),
            _summed(self.linear, other.linear),
            _summed(self.quadratic, other.quadratic),
        )

    def times(self, factor: Coefficient) -> Polynomial:
        """Every coefficient times one."""
        return Polynomial(
            multiplied(self.constant, factor),
            {i: multiplied(c, factor) for i, c in self.linear.items()},
            {pair: multiplied(c, factor) for pair, c in self.quadratic.items()},
        )

    def where(self, condition: AlongX) -> Polynomial:
        """The polynomial where a condition on x is true, nothing where it is not."""
        return Polynomial(
            coefficient(ca.OP_IF_ELSE_ZERO, condition, self.constant),
            {i: coefficient(ca.OP_IF_ELSE_ZERO, condition, c) for i, c in self.linear.items()},
            {pair: coefficient(ca.OP_IF_ELSE_ZERO, condition, c) for pair, c in self.quadratic.items()},
        )

    def product(self, other: Polynomial) -> Polynomial:
        """The product of two of degree one."""
        squares: Squares = {}
        for i, c in self.linear.items():
            for j, d in other.linear.items():
                pair = (i, j) if i <= j else (j, i)
                term = multiplied(c, d)
                squares[pair] = added(squares[pair], term) if pair in squares else term
        lines = ({i: multiplied(d, c) for i, d in p.linear.items()} if (c := q.constant) != 0.0 else {}
                 for p, q in ((self, other), (other, self)))  # fmt: skip
        return Polynomial(multiplied(self.constant, other.constant), _summed(*lines), squares)

    @property
    def affine(self) -> bool:
        """Whether it is of degree one at most."""
        return not self.quadratic

    @property
    def convex(self) -> bool:
        """Whether its matrix is proved positive semidefinite at every x."""
        return semidefinite(self.quadratic)

    @property
    def concave(self) -> bool:
        """Whether its matrix is proved negative semidefinite at every x."""
        return semidefinite({pair: -1.0 * c for pair, c in self.quadratic.items()})

    @property
    def nonnegative(self) -> bool:
        """Whether it is proved nowhere negative; its root is then the length of an affine vector, hence convex.

        It is the value at t = 1 of a quadratic form in t and its entries, and nowhere negative if and only if that is.
        """
        lines = {(-1, i): c for i, c in self.linear.items()}
        return semidefinite({(-1, -1): self.constant, **lines, **self.quadratic})


def _summed(a: dict[Any, Any], b: dict[Any, Any]) -> dict[Any, Any]:
    if not a or not b:
        return a or b
    total = dict(a)
    for key, c in b.items():
        total[key] = added(total[key], c) if key in total else c
        if total[key] == 0.0:
            del total[key]
    return total


def semidefinite(squares: Squares) -> bool:
    """Whether a quadratic form is proved nowhere negative, at any x, by elimination.

    Numbers are eliminated exactly, as fractions, coefficients that depend on x as intervals.
    """
    if all(i == j for i, j in squares):
        return all(least(c) >= 0 for c in squares.values())
    if any(least(squares.get((i, i), 0.0)) <= 0 for pair in squares if pair[0] != pair[1] for i in pair):
        return False  # an entry that is coupled to others, and has no square of its own
    if not any(isinstance(c, AlongX) for c in squares.values()):
        if not all(map(math.isfinite, squares.values())):
            return False
        squares = {pair: Fraction(c) for pair, c in squares.items()}
    matrix = {(i, j): c if i != j else c + c for (i, j), c in squares.items()}
    entries = sorted({i for pair in matrix for i in pair})
    while entries:
        pivot = entries.pop()
        beside = [i for i in entries if matrix.get((i, pivot), 0) != 0]
        size = matrix.get((pivot, pivot), 0)
        if least(size) < 0 or (beside and least(size) == 0):
            return False
        _eliminate(matrix, pivot, beside, size)
    return True


def _eliminate(matrix: Squares, pivot: int, beside: Iterable[int], size: Any) -> None:
    """Take from the matrix of the entries before ``pivot`` what the square completed with it takes."""
    rows = [(i, matrix[i, pivot]) for i in beside]
    for place, (i, b) in enumerate(rows):
        for j, c in rows[place:]:
            product, known = multiplied(b, c), matrix.get((i, j))
            taken = coefficient(ca.OP_DIV, product, size) if type(product) is type(size) is float else product / size
            matrix[i, j] = -taken if known is None else added(known, -taken)
