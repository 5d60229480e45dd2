"""Functions of one number that are polynomials between breaks, in exact fractions: Huber's loss, dead zones, kinks.

They are closed under sums, products, sizes, maxima and comparisons, as long as what switches is of first degree, so
that breaks are fractions too. That such a function is convex is decided exactly.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import casadi as ca

Coefficients = tuple[Fraction, ...]
"""Of a polynomial in powers, from the constant on; without zeros at the end."""
ALL_BUT = Fraction(1, 2**50)
"""What parts may miss each other by where they meet, relative to their terms there, to be taken for continuous."""
HIGHEST = 8
"""Highest degree of a polynomial."""


class NotPiecewise(ArithmeticError):
    """An operation that makes no polynomials between fractions."""


@dataclass(frozen=True)
class PiecewisePolynomial:
    """Polynomials ``parts``, one more than the ``breaks`` between which they hold, which ascend."""

    breaks: tuple[Fraction, ...]
    parts: tuple[Coefficients, ...]

    @classmethod
    def constant(cls, number: float) -> PiecewisePolynomial:
        """A number."""
        if not math.isfinite(number):
            raise NotPiecewise("a number that is not finite")
        return cls((), (_trimmed([Fraction(number)]),))

    @classmethod
    def identity(cls) -> PiecewisePolynomial:
        """The number itself that it is a function of."""
        return cls((), ((Fraction(0), Fraction(1)),))

    @property
    def is_constant(self) -> bool:
        """Whether it is one number."""
        return not self.breaks and len(self.parts[0]) <= 1

    @property
    def convex(self) -> bool:
        """Whether it is convex."""
        for at, (a, b) in zip(self.breaks, pairwise(self.parts), strict=True):
            if value(a, at) != value(b, at) or value(derivative(b), at) < value(derivative(a), at):
                return False
        ends = [None, *self.breaks, None]
        return all(_bends_up(part, *ends[k : k + 2]) for k, part in enumerate(self.parts))

    def joined(self) -> tuple[PiecewisePolynomial, list[Fraction]] | None:
        """The function with its parts lowered so that they meet where they do but for round-off, and by how much each.

        None where they do not.
        """
        raised = [Fraction(0)]
        for at, (a, b) in zip(self.breaks, pairwise(self.parts), strict=True):
            apart, sizes = value(a, at) - value(b, at), [abs(c * at**k) for part in (a, b) for k, c in enumerate(part)]
            if abs(apart) > ALL_BUT * max(sizes, default=Fraction(0)):
                return None
            raised.append(raised[-1] + apart)
        lowered = [max(raised) - by for by in raised]
        parts = tuple(total(part, (by,), -1) for part, by in zip(self.parts, lowered, strict=True))
        return PiecewisePolynomial(self.breaks, parts), lowered

    def combined(self, other: PiecewisePolynomial, rule: Callable[..., Coefficients]) -> PiecewisePolynomial:
        """A rule for polynomials carried out between the breaks of both."""
        breaks = tuple(sorted({*self.breaks, *other.breaks}))
        pairs = zip(self.on(breaks), other.on(breaks), strict=True)
        return PiecewisePolynomial(breaks, tuple(rule(*pair) for pair in pairs))

    def on(self, breaks: Sequence[Fraction]) -> list[Coefficients]:
        """The polynomials between other breaks, of which its own are some."""
        starts = [None, *breaks]
        return [self.parts[0 if s is None else bisect_right(self.breaks, s)] for s in starts]

    def steps(self) -> PiecewisePolynomial:
        """1 where it is positive, and 0 where it is not."""
        breaks: set[Fraction] = set(self.breaks)
        ends = [None, *self.breaks, None]
        for k, part in enumerate(self.parts):
            if len(part) > 2:
                raise NotPiecewise("what switches is not of first degree")
            if len(part) == 2:
                root, (low, high) = -part[0] / part[1], ends[k : k + 2]
                if (low is None or low < root) and (high is None or root < high):
                    breaks.add(root)
        ordered = tuple(sorted(breaks))
        signs = [value(part, at) > 0 for part, at in zip(self.on(ordered), between(ordered), strict=True)]
        return PiecewisePolynomial(ordered, tuple((Fraction(1),) if sign else () for sign in signs)).simplified()

    def simplified(self) -> PiecewisePolynomial:
        """Without breaks between polynomials that are one."""
        kept = [k for k, (a, b) in enumerate(pairwise(self.parts)) if a != b]
        return PiecewisePolynomial(tuple(self.breaks[k] for k in kept), tuple(self.parts[k] for k in (*kept, -1)))


def value(part: Coefficients, at: Fraction) -> Fraction:
    """A polynomial at a number."""
    total = Fraction(0)
    for c in reversed(part):
        total = total * at + c
    return total


def derivative(part: Coefficients) -> Coefficients:
    """The derivative of a polynomial."""
    return tuple(k * c for k, c in enumerate(part))[1:]


def about(part: Coefficients, at: Fraction) -> list[Fraction]:
    """The coefficients in powers of the distance from a number."""
    found, factor = [], Fraction(1)
    for k in range(len(part)):
        found.append(value(part, at) / factor)
        part, factor = derivative(part), factor * (k + 1)
    return found


def total(a: Coefficients, b: Coefficients, sign: int = 1) -> Coefficients:
    """The sum, or difference."""
    size = max(len(a), len(b))
    padded = [(*v, *[Fraction(0)] * (size - len(v))) for v in (a, b)]
    return _trimmed([v + sign * w for v, w in zip(*padded, strict=True)])


def times(a: Coefficients, b: Coefficients) -> Coefficients:
    """The product."""
    found = [Fraction(0)] * max(len(a) + len(b) - 1, 0)
    for i, v in enumerate(a):
        for j, w in enumerate(b):
            found[i + j] += v * w
    if len(found) > HIGHEST + 1:
        raise NotPiecewise("its degree is too high")
    return _trimmed(found)


def _trimmed(coefficients: Sequence[Fraction]) -> Coefficients:
    kept = list(coefficients)
    while kept and not kept[-1]:
        kept.pop()
    return tuple(kept)


def between(breaks: Sequence[Fraction], share: Fraction = Fraction(1, 2)) -> list[Fraction]:
    """A number between each two breaks, before the first and after the last, by its share of the way."""
    if not breaks:
        return [share]
    return [breaks[0] - share, *(a + (b - a) * share for a, b in pairwise(breaks)), breaks[-1] + share]


def _bends_up(part: Coefficients, low: Fraction | None, high: Fraction | None) -> bool:
    """Whether a polynomial is convex between two breaks: by the signs of coefficients, which prove it."""
    bend = derivative(derivative(part))
    if len(bend) <= 1:
        return not bend or bend[0] >= 0
    if low is not None and high is not None:
        return False  # none of those that occur is of higher degree between two breaks
    if low is None and high is None:
        return all(c >= 0 for c in bend[::2]) and not any(bend[1::2])
    way = 1 if low is not None else -1
    return all(c * way**k >= 0 for k, c in enumerate(about(bend, low if low is not None else high or Fraction(0))))


def applied(operation: int, operands: Sequence[PiecewisePolynomial]) -> PiecewisePolynomial:
    """An operation by CasADi's code; NotPiecewise where it leaves the kind."""
    if operation not in RULES:
        raise NotPiecewise("an operation that makes no polynomial")
    return RULES[operation](*operands).simplified()


def _product(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    return a.combined(b, times)


def _sum(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    return a.combined(b, total)


def _less(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    return a.combined(b, lambda v, w: total(v, w, -1))


def _quotient(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    if not b.is_constant or not b.parts[0]:
        raise NotPiecewise("a quotient by what is no number")
    return _product(a, PiecewisePolynomial((), ((1 / b.parts[0][0],),)))


def _power(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    number = b.parts[0][0] if b.is_constant and b.parts[0] else Fraction(-1)
    if number.denominator != 1 or not 1 <= number <= HIGHEST:
        raise NotPiecewise("a power that is no whole number")
    found = a
    for _ in range(int(number) - 1):
        found = _product(found, a)
    return found


def _positive_part(a: PiecewisePolynomial) -> PiecewisePolynomial:
    return _product(a, a.steps())


def _greater(a: PiecewisePolynomial, b: PiecewisePolynomial) -> PiecewisePolynomial:
    return _sum(b, _positive_part(_less(a, b)))


ONE, TWO = PiecewisePolynomial.constant(1.0), PiecewisePolynomial.constant(2.0)
RULES: dict[int, Callable[..., PiecewisePolynomial]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_NEG: lambda a: _less(PiecewisePolynomial.constant(0.0), a),
    ca.OP_TWICE: lambda a: _product(a, TWO),
    ca.OP_ADD: _sum,
    ca.OP_SUB: _less,
    ca.OP_MUL: _product,
    ca.OP_DIV: _quotient,
    ca.OP_SQ: lambda a: _product(a, a),
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_FABS: lambda a: _greater(a, _less(PiecewisePolynomial.constant(0.0), a)),
    ca.OP_FMAX: _greater,
    ca.OP_FMIN: lambda a, b: _less(_sum(a, b), _greater(a, b)),
    ca.OP_SIGN: lambda a: _less(_product(a.steps(), TWO), ONE),
    ca.OP_LT: lambda a, b: _less(b, a).steps(),
    ca.OP_LE: lambda a, b: _less(b, a).steps(),
    ca.OP_NOT: lambda a: _less(ONE, a),
    ca.OP_AND: _product,
    ca.OP_OR: lambda a, b: _less(_sum(a, b), _product(a, b)),
    ca.OP_IF_ELSE_ZERO: _product,
}
"""The operations. What a comparison is where both sides are equal does not matter to what is continuous there."""
