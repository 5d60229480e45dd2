"""Sums of products of powers: the algebra expressions are read in.

They flatten, merge and cancel as they are built.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

SAME_NUMBER = 1e-12
"""Relative distance within which numbers are the same."""
LARGEST_DENOMINATOR = 720
"""Of fractions that numbers are read as."""

Monomial = tuple[tuple["Atom", Fraction], ...]


@dataclass(frozen=True)
class Atom:
    """A symbol, a function of sums, or a sum in parentheses (``name`` is empty), whatever powers are taken of."""

    name: str
    arguments: tuple[Sum, ...] = ()
    key: str = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "key", f"{self.name}({','.join(a.key for a in self.arguments)})")

    @property
    def positive(self) -> bool:
        """True when it is known to be positive: an exponential, or a sum of even powers and a positive number."""
        if self.name == "exp":
            return True
        return not self.name and bool(self.arguments) and self.arguments[0].positive

    @property
    def symbols(self) -> set[str]:
        """The names of the symbols in it."""
        if self.name and not self.arguments:
            return {self.name}
        return {s for total in self.arguments for m, _ in total.terms for a, _e in m for s in a.symbols}

    @property
    def bracket(self) -> Sum | None:
        """The sum in parentheses."""
        return self.arguments[0] if not self.name else None


@dataclass(frozen=True)
class Sum:
    """Coefficients by monomial, in the order in which they came."""

    terms: tuple[tuple[Monomial, float], ...]

    @classmethod
    def of(cls, terms: Mapping[Monomial, float]) -> Sum:
        """The sum of the terms whose coefficients are not zero."""
        return cls(tuple((m, c) for m, c in terms.items() if c != 0))

    @property
    def key(self) -> str:
        """The same string for the same sum in any order."""
        return "+".join(sorted(f"{c!r}*" + "*".join(f"{a.key}^{e}" for a, e in m) for m, c in self.terms))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sum) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def number(self) -> float | None:
        """Its value when it is a number."""
        if not self.terms:
            return 0.0
        return self.terms[0][1] if len(self.terms) == 1 and not self.terms[0][0] else None

    @property
    def positive(self) -> bool:
        """True when every term is known to be non-negative and one is a positive number."""
        even = all(a.positive or (e.denominator == 1 and e % 2 == 0) for m, _ in self.terms for a, e in m)
        return even and all(c > 0 for _, c in self.terms) and any(not m for m, _ in self.terms)


ZERO = Sum(())


def number(value: float) -> Sum:
    """A number as a sum."""
    return Sum.of({(): float(value)})


def atom(one: Atom, exponent: Fraction = Fraction(1)) -> Sum:
    """A power of an atom as a sum."""
    return Sum((((((one, exponent),)), 1.0),))


def symbol(name: str) -> Sum:
    """A symbol as a sum."""
    return atom(Atom(name))


def monomial(powers: Mapping[Atom, Fraction]) -> Monomial:
    """A product of powers in its one order, powers of zero left out."""
    return tuple(sorted(((a, e) for a, e in powers.items() if e != 0), key=lambda p: p[0].key))


def times(m: Monomial, n: Monomial) -> Monomial:
    """The product of two monomials."""
    powers = dict(m)
    for a, e in n:
        powers[a] = powers.get(a, Fraction(0)) + e
    return monomial(powers)


def add(a: Sum, b: Sum, sign: float = 1.0) -> Sum:
    """a + sign * b."""
    terms = dict(a.terms)
    for m, c in b.terms:
        before = terms.get(m, 0.0)
        total = before + sign * c
        # what is left of two equal coefficients is rounding
        terms[m] = 0.0 if abs(total) <= SAME_NUMBER * abs(before) else total
    return Sum.of(terms)


def expanded(a: Sum, b: Sum) -> Sum:
    """a * b, every product carried out."""
    total = ZERO
    for m, c in a.terms:
        total = add(total, Sum.of({times(m, n): c * d for n, d in b.terms}))
    return total


def _factor(a: Sum) -> tuple[float, Monomial]:
    """A sum as coefficient and one monomial, in parentheses where it has several terms."""
    if len(a.terms) == 1:
        return a.terms[0][1], a.terms[0][0]
    return 1.0, ((Atom("", (a,)), Fraction(1)),)


def multiply(a: Sum, b: Sum) -> Sum:
    """a * b, sums kept in parentheses unless the other factor is a number."""
    for plain, other in ((a, b), (b, a)):
        value = plain.number
        if value is not None and (abs(value) in (0.0, 1.0) or len(other.terms) == 1):
            return Sum.of({m: value * c for m, c in other.terms})
    (c, m), (d, n) = _factor(a), _factor(b)
    return Sum.of({times(m, n): c * d})


def _number_to(value: float, exponent: Fraction) -> float:
    """A number to a power, infinite where it is too large for a float: Python raises there."""
    try:
        return value ** (int(exponent) if exponent.denominator == 1 else float(exponent))
    except OverflowError:
        return -math.inf if value < 0 and exponent % 2 else math.inf


def power(a: Sum, exponent: Fraction) -> Sum:
    """a ** exponent; a root is taken of each factor only where at most one of them may be negative."""
    value = a.number
    if value is not None and (value > 0 or (exponent.denominator == 1 and (value or exponent > 0))):
        return number(_number_to(value, exponent))
    if exponent == 1:
        return a
    c, m = _factor(a)
    if exponent.denominator == 1:
        return Sum.of({monomial({x: e * exponent for x, e in m}): _number_to(c, exponent)})
    safe = {x: e * exponent for x, e in m if x.positive}
    rest = [(x, e) for x, e in m if not x.positive]
    if c > 0 and len(rest) == 1 and (rest[0][1].denominator != 1 or rest[0][1] % 2):
        safe[rest[0][0]] = rest[0][1] * exponent
        rest, c, outer = [], 1.0, _number_to(c, exponent)
    elif c > 0:
        c, outer = 1.0, _number_to(c, exponent)
    else:
        outer = 1.0
    if rest or c != 1.0:
        # 1 / sqrt(g y) rather than sqrt(1 / (g y))
        turn = -1 if rest and c == 1.0 and all(e < 0 for _, e in rest) else 1
        inside = Sum.of({monomial({x: turn * e for x, e in rest}): c})
        safe[Atom("", (inside,))] = turn * exponent
    return Sum.of({monomial(safe): outer})
