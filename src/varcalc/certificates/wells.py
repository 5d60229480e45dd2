"""Terms of one slope that are not convex: polynomials, and functions that are everywhere one of several of these.

What phi(v) = f(x, v) - s v is less elsewhere than at the curve's slope v0 needs no convexity where f is a polynomial
in v: with v = v0 + c + t it is e_0 + e_1 t + t^2 q(t), at least e_0 - e_1^2 / 4 beta where q >= beta > 0. Such are the
neighbourhoods of its least places, at which it may be as low as along the curve: there a curve may be broken, which is
Weierstrass's and Erdmann's condition (Gelfand and Fomin, "Calculus of Variations", sect. 15). Between them it is higher
on one small interval after another, and it rises for ever where no derivative points down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.degree import KEEPING
from varcalc.certificates.statement import Statement
from varcalc.certificates.taylor import Values
from varcalc.symbolic.instructions import POWERS, SUMS, Program, operate
from varcalc.symbolic.tracing import Expression, as_written

HIGHEST_DEGREE, MOST_BRANCHES = 16, 8
SAME_PLACE = 1e-6
"""Distance of a least place from the curve's slope, relative to the size of slopes, within which it is taken for it."""
NEIGHBOURHOODS = 40
"""Of the neighbourhood of a least place, and doublings of the distance from which on all rises."""
EVENLY_BENT = 0.25
"""Share of what it bends at a least place that it bends in all of the neighbourhood."""
CELL_HALVINGS = 14
"""How often an interval between least places is halved."""

Coefficients: TypeAlias = list[Expression]
"""Of the powers of the slope, from the constant on; they hang on no state."""


class NotPolynomial(ValueError):
    """A term is no polynomial in its slope, nor one of a few."""


def branches(stated: Statement, place: int) -> list[Coefficients]:
    """Polynomials one of which the Lagrangian is wherever it is looked at, in the control of number ``place``.

    Raises NotPolynomial where there are none.
    """
    variable = stated.variables.nonzeros()[place]
    arguments = [*stated.along.symbols.all, *stated.along.multiplier_symbols]

    def given(e: Expression) -> list[Coefficients]:
        return [[ca.SX(0), ca.SX(1)] if ca.is_equal(e, variable) else [e]]

    entries = [[given(e) for e in a.nonzeros()] if a.numel() else [] for a in arguments]
    with as_written():
        return Program(stated.function).run(entries, lambda c: [[ca.SX(c)]], _applied)[0][0]


def _applied(operation: int, operands: Sequence[list[Coefficients]]) -> list[Coefficients]:
    if all(len(o) == 1 and len(o[0]) == 1 for o in operands):
        return [[operate(operation, [o[0][0] for o in operands])]]
    rule = _RULES.get(operation)
    if rule is None:
        raise NotPolynomial(operation)
    found = rule(operation, *operands)
    if len(found) > MOST_BRANCHES or max(map(len, found)) > HIGHEST_DEGREE + 1:
        raise NotPolynomial(operation)
    return found


def _kept(operation: int, a: list[Coefficients]) -> list[Coefficients]:
    return [[operate(operation, [c]) for c in one] for one in a]


def _added(operation: int, a: list[Coefficients], b: list[Coefficients]) -> list[Coefficients]:
    found = []
    for one, other in product(a, b):
        size = max(len(one), len(other))
        rows = ([*row, *[ca.SX(0)] * (size - len(row))] for row in (one, other))
        found.append([operate(operation, pair) for pair in zip(*rows, strict=True)])
    return found


def _times(one: Coefficients, other: Coefficients) -> Coefficients:
    found = [ca.SX(0)] * (len(one) + len(other) - 1)
    for (i, a), (j, b) in product(enumerate(one), enumerate(other)):
        found[i + j] = found[i + j] + a * b
    return found


def _multiplied(_operation: int, a: list[Coefficients], b: list[Coefficients]) -> list[Coefficients]:
    return [_times(one, other) for one, other in product(a, b)]


def _squared(_operation: int, a: list[Coefficients]) -> list[Coefficients]:
    return [_times(one, one) for one in a]


def _divided(operation: int, a: list[Coefficients], b: list[Coefficients]) -> list[Coefficients]:
    if any(len(other) > 1 for other in b):
        raise NotPolynomial(operation)
    return [[operate(operation, [c, other[0]]) for c in one] for one, other in product(a, b)]


def _powered(operation: int, a: list[Coefficients], b: list[Coefficients]) -> list[Coefficients]:
    exponent = b[0][0]
    if len(b) > 1 or len(b[0]) > 1 or not exponent.is_constant():
        raise NotPolynomial(operation)
    power = float(exponent)
    if power != round(power) or not 1 <= power <= HIGHEST_DEGREE:
        raise NotPolynomial(operation)
    found = a
    for _ in range(int(power) - 1):
        found = [_times(one, base) for one, base in zip(found, a, strict=True)]
    return found


def _size(_operation: int, a: list[Coefficients]) -> list[Coefficients]:
    return [*a, *_kept(ca.OP_NEG, a)]


def _either(_operation: int, a: list[Coefficients], b: list[Coefficients]) -> list[Coefficients]:
    return [*a, *b]


_RULES: dict[int, Callable[..., list[Coefficients]]] = {
    **dict.fromkeys(KEEPING, _kept),
    **dict.fromkeys(SUMS, _added),
    **dict.fromkeys(POWERS, _powered),
    ca.OP_MUL: _multiplied,
    ca.OP_SQ: _squared,
    ca.OP_DIV: _divided,
    ca.OP_FABS: _size,
    ca.OP_FMIN: _either,
    ca.OP_FMAX: _either,
}


def shifted(coefficients: Sequence[Any], by: Any, count: int | None = None) -> list[Any]:
    """The coefficients of powers of t - ``by``, of a polynomial of t; the first ``count`` of them."""
    powers, top = [flint().arb(1)], len(coefficients)
    for _ in coefficients[1:]:
        powers.append(by * powers[-1])
    return [
        sum((coefficients[j] * (powers[j - k] * math.comb(j, k)) for j in range(k + 1, top)), coefficients[k])
        for k in range(top if count is None else count)
    ]


@dataclass(frozen=True)
class LeastOfPolynomial:
    """How little a polynomial of t = v - v0 may be, of which the ``coefficients`` are functions of a box.

    ``size`` is that of slopes.
    """

    coefficients: Sequence[Values]
    size: float

    def less_than_nothing(self) -> Ball | None:
        """By how much it may be negative, at any t and any point of the box; None where that is not bounded."""
        rough = np.array([float(c.mid()) for c in self._balls])
        if len(rough) % 2 == 0 or len(rough) < 3 or not np.isfinite(rough).all() or not rough[-1] > 0:
            return None
        slopes = np.polynomial.Polynomial(rough).deriv()
        level = sorted(float(t.real) for t in slopes.roots() if abs(t.imag) <= SAME_PLACE * self.size)
        least = [0.0 if abs(t) <= SAME_PLACE * self.size else t for t in level if slopes.deriv()(t) > 0]
        far = self._far(2.0 * max([self.size, *map(abs, level)]))
        if not least or far is None:
            return None
        found, edges = [], [-far]
        for t in dict.fromkeys(least):
            near = self._near(t, min(abs(t - edges[-1]), abs(far - t)))
            if near is None:
                return None
            found.append(near[1])
            # rounded inward: what is between begins where a neighbourhood is sure to reach
            edges += [math.nextafter(t - near[0], t), math.nextafter(t + near[0], t)]
        edges.append(far)
        between = [self._between(a, b) for k, (a, b) in enumerate(pairwise(edges)) if k % 2 == 0 and a < b]
        if not all(between):
            return None
        less = flint().arb(0)
        for one in found:
            less = less.max(one)
        return less.upper()

    @cached_property
    def _balls(self) -> list[Ball]:
        return [c.ball for c in self.coefficients]

    def _far(self, distance: float) -> float | None:
        """A distance on both sides from which on it rises, and is not negative."""
        for _ in range(NEIGHBOURHOODS):
            sides = ([c * s**k for k, c in enumerate(shifted(self._balls, s * distance))] for s in (1, -1))
            if all(c >= 0 for side in sides for c in side):
                return distance
            distance *= 2.0
        return None

    def _near(self, at: float, most: float) -> tuple[float, Ball] | None:
        """The half-width of a neighbourhood in which it is above a parabola, and how low that is."""
        # what it is there hangs on x as its slope does: of the rest no more is asked than how it bends
        first, second = (c.ball for c in shifted(self.coefficients, flint().arb(at), 2))
        rest = shifted(self._balls, at)[2:]
        radius = most
        for _ in range(NEIGHBOURHOODS):
            bent = _sum(rest, flint().arb(0, radius))
            if bent > EVENLY_BENT * rest[0].upper():
                return radius, (second * second / (4 * bent.lower()) - first).upper()
            radius *= 0.5
        return None

    def _between(self, a: float, b: float, depth: int = 0) -> bool:
        """Whether it is nowhere negative from a to b."""
        middle = 0.5 * (a + b)
        radius = (flint().arb(b) - middle).max(flint().arb(middle) - a).upper()
        if _sum(shifted(self._balls, middle), flint().arb(0, 1) * radius) >= 0:
            return True
        return depth < CELL_HALVINGS and all(self._between(*ends, depth + 1) for ends in ((a, middle), (middle, b)))


def _sum(coefficients: Sequence[Ball], t: Ball) -> Ball:
    total = flint().arb(0)
    for c in reversed(coefficients):
        total = total * t + c
    return total
