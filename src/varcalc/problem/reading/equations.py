"""Equations as short as algebra makes them: without denominators, and without factors that cannot vanish."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import reduce
from typing import Any

from varcalc.problem.reading.sums import (
    LARGEST_DENOMINATOR,
    SAME_NUMBER,
    ZERO,
    Atom,
    Monomial,
    Sum,
    add,
    atom,
    expanded,
    monomial,
    multiply,
    number,
    times,
)

MOST_TERMS = 150
"""An equation that expands to more terms than this is left as it is."""
MOST_MULTIPLICATIONS = 50


def _whole_bracket(a: Atom, exponent: Fraction) -> bool:
    return a.bracket is not None and exponent.denominator == 1 and exponent > 0


def _bracket_powers(total: Sum) -> Sum:
    """Whole positive powers of parentheses carried out."""
    out = ZERO
    for m, c in total.terms:
        product = number(c)
        for a, e in m:
            inner = a.bracket
            factors = [inner] * int(e) if inner is not None and _whole_bracket(a, e) else [atom(a, e)]
            product = reduce(expanded, factors, product)
        out = add(out, product)
    return out


def without_denominators(total: Sum) -> tuple[Sum, set[Atom]]:
    """The sum times what makes every power non-negative, and the atoms it was multiplied by."""
    used: set[Atom] = set()
    for _ in range(MOST_MULTIPLICATIONS):
        least: dict[Atom, Fraction] = {}
        for m, _c in total.terms:
            for a, e in m:
                least[a] = min(least.get(a, Fraction(0)), e)
        shift = monomial({a: -e for a, e in least.items() if e < 0})
        if not shift and not any(_whole_bracket(a, e) for m, _c in total.terms for a, e in m):
            break
        used |= {a for a, _ in shift}
        total = _bracket_powers(Sum.of({times(m, shift): c for m, c in total.terms}))
        if len(total.terms) > MOST_TERMS:
            break
    return total, used


def divided(total: Sum, divisor: Sum) -> Sum | None:
    """total / divisor when the division leaves no remainder (multivariate long division); None otherwise."""

    def leading(s: Sum) -> tuple[Monomial, float]:
        return max(s.terms, key=lambda t: tuple(sorted(((a.key, e) for a, e in t[0]), reverse=True)))

    if len(divisor.terms) < 2 or not total.terms:
        return None
    head, scale = leading(divisor)
    quotient = ZERO
    for _ in range(MOST_TERMS):
        m, c = leading(total)
        ratio = times(m, tuple((a, -e) for a, e in head))
        if any(e < 0 for _, e in ratio):
            return None
        step = Sum.of({ratio: c / scale})
        quotient = add(quotient, step)
        total = add(total, expanded(step, divisor), -1.0)
        if not total.terms:
            return quotient
    return None


def simplified(total: Sum, abscissa: str = "x") -> Sum:
    """The left side of ``total = 0``, up to a factor that is not zero where the equation makes sense.

    ``abscissa`` is the name of what the unknown functions depend on.
    """
    cleared, used = without_denominators(total)
    if not cleared.terms or len(cleared.terms) > MOST_TERMS:
        return total
    for a in sorted(used, key=lambda a: a.key):
        while (inner := a.bracket) is not None and (quotient := divided(cleared, inner)) is not None:
            cleared = quotient
    # a factor in the abscissa alone vanishes at isolated abscissae only
    nonzero = used | {a for m, _ in cleared.terms for a, _e in m if a.positive or a.symbols == {abscissa}}
    common = {a: min(dict(m).get(a, Fraction(0)) for m, _ in cleared.terms) for a in nonzero}
    lowered = monomial({a: -e for a, e in common.items() if e > 0})
    cleared = Sum.of({times(m, lowered): c for m, c in cleared.terms})
    return _normalised(cleared)


def _order(m: Monomial) -> tuple[Any, ...]:
    """Highest derivative first, then higher degree, then by name."""
    primes = max((a.name.count("'") for a, _ in m), default=-1)
    return (-primes, -sum((e for _, e in m), Fraction(0)), [a.key for a, _ in m])


def _normalised(total: Sum) -> Sum:
    """Terms in order, the first coefficient positive, all of them whole where they have a common measure."""
    terms = sorted(total.terms, key=lambda t: _order(t[0]))
    smallest = min(abs(c) for _, c in terms)
    if not all(math.isfinite(c / smallest) for _, c in terms):  # infinite, or too far apart
        return Sum(tuple(terms))
    ratios = [Fraction(c / smallest).limit_denominator(LARGEST_DENOMINATOR) for _, c in terms]
    scale = 1.0 / terms[0][1]
    if all(abs(float(r) * smallest - c) <= SAME_NUMBER * abs(c) for r, (_, c) in zip(ratios, terms, strict=True)):
        common = math.lcm(*(r.denominator for r in ratios))
        whole = [int(r * common) for r in ratios]
        measure = math.gcd(*whole)
        scale = (1 if whole[0] > 0 else -1) * common / smallest / measure
        return Sum(tuple((m, float(round(c * scale))) for m, c in terms))
    return Sum(tuple((m, c * scale) for m, c in terms))


def collected(total: Sum) -> Sum:
    """The sum as one fraction."""
    cleared, used = without_denominators(total)
    if not cleared.terms or len(cleared.terms) > MOST_TERMS:
        return total
    least = {a: min(Fraction(0), *(dict(m).get(a, Fraction(0)) for m, _ in total.terms)) for a in used}
    denominator = Sum.of({monomial(least): 1.0})
    for a in sorted(used, key=lambda a: a.key):
        while (inner := a.bracket) is not None and (quotient := divided(cleared, inner)) is not None:
            cleared, denominator = quotient, expanded(denominator, atom(a))
    return multiply(cleared, denominator)
