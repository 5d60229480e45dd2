"""Lagrangians in ball arithmetic, with their first and second derivatives.

A jet is a value with its gradient and Hessian in chosen variables; its entries are series of balls in x. The
derivatives of the very expression are enclosed: those that CasADi states are rounded where constants are put
together, of x^0.3 for one, and are of no use in a proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Series, flint
from varcalc.certificates.smooth import (
    SMOOTH,
    Undecided,
    arctangent,
    exponential,
    head,
    inverse,
    logarithm,
    power,
    root,
)
from varcalc.certificates.splines import cell_of, horner, smooth_at, spline
from varcalc.symbolic.instructions import NAMES, Call, Program, instructions
from varcalc.symbolic.look_up import WITHIN

Switch: TypeAlias = int | tuple[int, ...] | None
"""A sign, the number of a stair or those that it may be, or None where that is not known."""


class Crossed(Undecided):
    """What numbers switch on has either sign, or one of two ``choices``; ``signs`` are all before it."""

    def __init__(self, signs: Sequence[Switch], choices: Sequence[int] = (1, -1)) -> None:
        super().__init__("what is switched on is crossed")
        self.signs, self.choices = list(signs), choices


class Jet:
    """``value``, derivatives ``first[i]`` and ``second[i, j]``, i <= j; those that vanish are absent."""

    __slots__ = ("first", "second", "value")

    def __init__(
        self, value: Series, first: dict[int, Series] | None = None, second: dict[tuple[int, int], Series] | None = None
    ) -> None:
        self.value, self.first, self.second = value, first or {}, second or {}


class Algebra:
    """Arithmetic with jets of ``order`` 0, 1 or 2.

    ``switches`` are signs known beforehand of what operations switch on, in the order in which these come, None where
    they are to be found; ``signs`` are all that came. With ``between`` a sign may vanish at the ends of the interval.

    With ``crossing`` numbers, which are no series, may have either sign where that hangs on the abscissa alone or the
    function goes on smoothly: :class:`Crossed` tells of it.
    """

    def __init__(
        self, order: int, switches: Sequence[Switch] = (), *, between: bool = False, crossing: bool = False
    ) -> None:
        self.order, self.switches, self.between, self.crossing = order, switches, between, crossing
        self.signs: list[Switch] = []

    def sign(self, jet: Jet, name: str, *, smooth: bool = False) -> int:
        """-1 or 1 where a jet keeps its sign; Undecided where it does not, ``smooth`` as the function may go on."""
        # after the first that is not known the way through the operations may be another
        known = self.switches[len(self.signs)] if len(self.signs) < len(self.switches) else None
        sign = known if isinstance(known, int) else _sign(jet)
        if self.between:
            # after one that is not known whatever was taken for it may be what the next ones hang on
            sign = None if any(not isinstance(s, int) for s in self.signs) else sign_between(jet)
        if sign is None and self.crossing and (smooth or not jet.first) and isinstance(jet.value, flint().arb):
            raise Crossed(self.signs)
        self.signs.append(sign)
        if sign is None:
            if self.between:
                return 1  # whatever: what follows is thrown away
            raise Undecided(f"{name}, which switches there")
        return sign

    def stair(self, jet: Jet, name: str, cell: Callable[[int], tuple[int, int]]) -> int:
        """The number of the stair on which a jet lies throughout, by what ``cell`` says each is of; Undecided if none.

        It is kept as signs are; between abscissae where it is one of several, these are.
        """
        known = self.switches[len(self.signs)] if len(self.signs) < len(self.switches) else None
        if self.between:
            found = None if any(not isinstance(s, int) for s in self.signs) else _stairs_between(jet, cell)
            self.signs.append(found)
            return found if isinstance(found, int) else 0  # whatever: what follows is thrown away
        stairs: Sequence[int] = [known] if isinstance(known, int) else self._stairs(jet, name, cell, known)
        if len(stairs) != 1:
            if stairs and self.crossing and not jet.first and isinstance(jet.value, flint().arb):
                raise Crossed(self.signs, stairs)
            raise Undecided(f"{name}, which jumps there")
        self.signs.append(stairs[0])
        return stairs[0]

    def _stairs(
        self, jet: Jet, name: str, cell: Callable[[int], tuple[int, int]], known: Sequence[int] | None
    ) -> Sequence[int]:
        """Those on which a jet may lie, two at most, of the ``known`` ones; none where there are more."""
        value = head(jet.value)
        if not value.is_finite():
            raise Undecided(f"{name} of what is no number")
        first, last = math.floor(float(value.lower())) - 1, math.ceil(float(value.upper())) + 1
        if last - first > MOST_STAIRS:
            return []
        met = [n for n in range(first, last + 1) if not (value < cell(n)[0] or value > cell(n)[1])]
        kept = met if known is None else [n for n in met if n in known]
        return kept if len(kept) <= 2 else []

    def constant(self, value: float) -> Jet:
        """A number as a jet."""
        return Jet(flint().arb(value))

    def variable(self, value: Series, index: int) -> Jet:
        """The variable of that number."""
        return Jet(value, {index: flint().arb(1)} if self.order else None)

    def apply(self, operation: int, operands: Sequence[Jet]) -> Jet:
        """An operation by CasADi's code; Undecided where it has no smooth value."""
        rule = LINEAR.get(operation) or SELECTED.get(operation)
        if rule is not None:
            return rule(self, *operands)
        smooth = SMOOTH.get(operation)
        if smooth is not None:
            return self.chained(operands[0], *smooth(operands[0].value, self.order))
        if isinstance(operation, Call):
            return self._looked_up(operation, operands[0])
        raise Undecided(f"{NAMES[operation]} has no enclosure")

    def _looked_up(self, call: Call, a: Jet) -> Jet:
        """A table in the cell that its argument lies in throughout."""
        read = spline(call.function)
        if read is None:
            raise Undecided(f"{call.function.name()} has no enclosure")
        places = np.unique(read.knots).tolist()
        name = f"the table {call.function.name().removesuffix(WITHIN)}"
        above = [self.sum(a, self.constant(places[0]), -1), self.sum(a, self.constant(places[-1]), -1)]
        if self.sign(above[0], name) < 0 or self.sign(above[1], name) > 0:
            raise Undecided(f"{name} has no values there")
        first, last = 0, len(places) - 1
        while last - first > 1:
            middle = (first + last) // 2
            smooth = self.crossing and smooth_at(call.function, places[middle])
            if self.sign(self.sum(a, self.constant(places[middle]), -1), name, smooth=smooth) > 0:
                first = middle
            else:
                last = middle
        low = self.sum(a, self.constant(places[first]), -1)
        return self.chained(low, *horner(cell_of(call.function, places[first]), low.value, self.order))

    def sum(self, a: Jet, b: Jet, sign: int = 1) -> Jet:
        """The sum, or difference."""
        first, second = dict(a.first), dict(a.second)
        for mine, other in ((first, b.first), (second, b.second)):
            for key, term in other.items():
                signed = term if sign > 0 else -term
                mine[key] = mine[key] + signed if key in mine else signed  # pyright: ignore[reportArgumentType]
        return Jet(a.value + b.value if sign > 0 else a.value - b.value, first, second)

    def scaled(self, a: Jet, c: Series) -> Jet:
        """A multiple by what depends on no variable."""
        if not a.first:
            return Jet(a.value * c)
        second = {k: v * c for k, v in a.second.items()} if a.second else None
        return Jet(a.value * c, {k: v * c for k, v in a.first.items()}, second)

    def product(self, a: Jet, b: Jet) -> Jet:
        """The product, by Leibniz's rule."""
        if not b.first:
            return self.scaled(a, b.value)
        if not a.first:
            return self.scaled(b, a.value)
        rest = self.sum(
            self.scaled(Jet(0, a.first, a.second), b.value), self.scaled(Jet(0, b.first, b.second), a.value)
        )
        if self.order == 2:
            rest = self.sum(rest, Jet(0, None, _crossed(a.first, b.first)))
        return Jet(a.value * b.value, rest.first, rest.second)

    def chained(self, a: Jet, value: Series, slope: Series = None, bend: Series = None) -> Jet:
        """f(a) from f, f', f'' at the value of a, by the chain rule."""
        if not a.first:
            return Jet(value)
        moved = self.scaled(Jet(0, a.first, a.second), slope)
        if self.order == 2:
            keys = sorted(a.first)
            for n, i in enumerate(keys):
                left = bend * a.first[i]
                for j in keys[n:]:
                    term = left * a.first[j]
                    moved.second[i, j] = moved.second[i, j] + term if (i, j) in moved.second else term
        return Jet(value, moved.first, moved.second)

    def quotient(self, a: Jet, b: Jet) -> Jet:
        """The quotient."""
        return self.product(a, self.chained(b, *inverse(b.value, self.order)))

    def power(self, a: Jet, b: Jet) -> Jet:
        """a^b: by multiplication where b is whole, else for a > 0."""
        exponent = _number(b)
        if exponent is None:
            raised = self.product(b, self.chained(a, *logarithm(a.value, self.order)))
            return self.chained(raised, *exponential(raised.value, self.order))
        return self.chained(a, *power(a.value, exponent, self.order))


def _crossed(a: dict[int, Series], b: dict[int, Series]) -> dict[tuple[int, int], Series]:
    second: dict[tuple[int, int], Series] = {}
    for i, p in a.items():
        for j, q in b.items():
            key, term = (min(i, j), max(i, j)), p * q
            term = term + term if i == j else term
            second[key] = second[key] + term if key in second else term
    return second


def _number(jet: Jet) -> Any:
    """The one number a jet stands for; None where it is none."""
    value = jet.value
    if jet.first or isinstance(value, flint().arb_series) or not value.is_exact():
        return None
    return value


def _sign(jet: Jet) -> int | None:
    value = head(jet.value)
    return 1 if value > 0 else -1 if value < 0 else None


ABSCISSA = -1
"""The number of the abscissa where it is a variable as well."""
MOST_STAIRS = 12
"""Of which a piece of a curve may meet several."""
MOST_SIDES = 16
"""Of what is crossed at once."""


def sign_between(jet: Jet) -> int | None:
    """The sign for -1 < t < 1 of what is of first degree in x and in nothing else; it may vanish at the ends."""
    value = jet.value
    if jet.second or set(jet.first) - {ABSCISSA} or not isinstance(value, flint().arb_series):
        return None
    first, last = value[0] - value[1], value[0] + value[1]
    if value[1].is_zero():
        return _sign(jet)
    return 1 if first >= 0 and last >= 0 else -1 if first <= 0 and last <= 0 else None


def _stairs_between(jet: Jet, cell: Callable[[int], tuple[int, int]]) -> int | tuple[int, ...] | None:
    """The stair for -1 < t < 1 of what is of first degree in x and in nothing else, or those that it may be."""
    value = jet.value
    if jet.second or set(jet.first) - {ABSCISSA} or not isinstance(value, flint().arb_series):
        return None
    ends = value[0] - value[1], value[0] + value[1]
    low, high = ends if value[1] >= 0 else ends[::-1]
    if not (low.is_finite() and high.is_finite()):
        return None
    first, last = math.floor(float(low.mid())) - 2, math.ceil(float(high.mid())) + 2
    if last - first > MOST_STAIRS:
        return None
    met = tuple(n for n in range(first, last + 1) if not (cell(n)[1] <= low or cell(n)[0] >= high))
    return met[0] if len(met) == 1 else met


def _size(algebra: Algebra, a: Jet) -> Jet:
    return a if algebra.sign(a, "fabs") > 0 else algebra.scaled(a, -1)


def _greater(algebra: Algebra, a: Jet, b: Jet) -> Jet:
    return a if algebra.sign(algebra.sum(a, b, -1), "fmax") > 0 else b


def _lesser(algebra: Algebra, a: Jet, b: Jet) -> Jet:
    return b if algebra.sign(algebra.sum(a, b, -1), "fmin") > 0 else a


def _below(name: str) -> Callable[[Algebra, Jet, Jet], Jet]:
    return lambda algebra, a, b: algebra.constant(1.0 if algebra.sign(algebra.sum(a, b, -1), name) < 0 else 0.0)


def _apart(value: float, name: str) -> Callable[[Algebra, Jet, Jet], Jet]:
    """Equality and its contrary, decided where the two are apart."""

    def compared(algebra: Algebra, a: Jet, b: Jet) -> Jet:
        algebra.sign(algebra.sum(a, b, -1), name)
        return algebra.constant(value)

    return compared


def _true(jet: Jet) -> bool:
    """Whether a condition holds; Undecided where it may or may not."""
    value = head(jet.value)
    if value.is_zero() and not jet.first:
        return False
    if value.contains(0):
        raise Undecided("a condition, which switches there")
    return True


def _where(algebra: Algebra, condition: Jet, value: Jet) -> Jet:
    return value if _true(condition) else algebra.constant(0.0)


def _hypotenuse(algebra: Algebra, a: Jet, b: Jet) -> Jet:
    square = algebra.sum(algebra.product(a, a), algebra.product(b, b))
    return algebra.chained(square, *root(square.value, algebra.order))


def _angle(algebra: Algebra, y: Jet, x: Jet) -> Jet:
    """atan2(y, x), away from the line x = 0."""
    if algebra.sign(x, "atan2") > 0:
        ratio = algebra.quotient(y, x)
        return algebra.chained(ratio, *arctangent(ratio.value, algebra.order))
    ratio = algebra.quotient(x, y)
    turned = algebra.chained(ratio, *arctangent(ratio.value, algebra.order))
    right = flint().arb.pi() / 2 * algebra.sign(y, "atan2")
    return algebra.sum(Jet(right), turned, -1)


def _floor(algebra: Algebra, a: Jet) -> Jet:
    return algebra.constant(algebra.stair(a, "floor", lambda n: (n, n + 1)))


def _ceiling(algebra: Algebra, a: Jet) -> Jet:
    return algebra.constant(algebra.stair(a, "ceil", lambda n: (n - 1, n)))


def _remainder(algebra: Algebra, a: Jet, b: Jet) -> Jet:
    """a less the multiple of b next to it towards zero, as in C."""

    def cell(n: int) -> tuple[int, int]:
        return (n if n > 0 else n - 1), (n if n < 0 else n + 1)

    count = algebra.stair(algebra.quotient(a, b), "fmod", cell)
    return algebra.sum(a, algebra.scaled(b, count), -1)


LINEAR: dict[int, Callable[..., Jet]] = {
    ca.OP_ASSIGN: lambda _, a: a,
    ca.OP_ADD: Algebra.sum,
    ca.OP_SUB: lambda algebra, a, b: algebra.sum(a, b, -1),
    ca.OP_NEG: lambda algebra, a: algebra.scaled(a, -1),
    ca.OP_TWICE: lambda algebra, a: algebra.scaled(a, 2),
    ca.OP_MUL: Algebra.product,
    ca.OP_DIV: Algebra.quotient,
    ca.OP_POW: Algebra.power,
    ca.OP_CONSTPOW: Algebra.power,
}
"""Operations of arithmetic."""

SELECTED: dict[int, Callable[..., Jet]] = {
    ca.OP_FABS: _size, ca.OP_FMAX: _greater, ca.OP_FMIN: _lesser, ca.OP_LT: _below("lt"), ca.OP_LE: _below("le"),
    ca.OP_EQ: _apart(0.0, "eq"), ca.OP_NE: _apart(1.0, "ne"), ca.OP_IF_ELSE_ZERO: _where,
    ca.OP_SIGN: lambda algebra, a: algebra.constant(float(algebra.sign(a, "sign"))),
    ca.OP_NOT: lambda algebra, a: algebra.constant(0.0 if _true(a) else 1.0),
    ca.OP_AND: lambda algebra, a, b: algebra.constant(1.0 if _true(a) and _true(b) else 0.0),
    ca.OP_OR: lambda algebra, a, b: algebra.constant(1.0 if _true(a) or _true(b) else 0.0),
    ca.OP_FLOOR: _floor, ca.OP_CEIL: _ceiling, ca.OP_FMOD: _remainder, ca.OP_HYPOT: _hypotenuse, ca.OP_ATAN2: _angle,
}  # fmt: skip
"""Operations that are smooth between their switches."""


def without_enclosure(function: ca.Function) -> str:
    """The name of an operation of a function that no enclosure is known of; empty where there is none."""
    if not function.is_a("SXFunction"):
        return "a table or another function that is no formula"
    known = {ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, *LINEAR, *SMOOTH, *SELECTED}
    used = [i.operation for i in instructions(function)]
    tables = {o.function.name() for o in used if isinstance(o, Call) and spline(o.function) is None}
    strange = {o for o in used if not isinstance(o, Call)} - known
    return ", ".join(sorted([*(NAMES[s] for s in strange), *(f"the table or function {name}" for name in tables)]))


def jets(
    program: Program,
    arguments: Sequence[Sequence[Jet]],
    order: int,
    switches: Sequence[Switch] = (),
    *,
    crossing: bool = False,
) -> list[list[Jet]]:
    """The nonzeros of each result of an SX function, enclosed with their derivatives up to ``order``.

    With ``crossing`` numbers, which are no series, may cross what is switched on at abscissae, and knots at which a
    table and its slope go on: results hold what they are on either side.
    """
    waiting: list[Sequence[Switch]] = [switches]
    sides: list[list[list[Jet]]] = []
    while waiting:
        # at order 0 nothing tells what hangs on states
        algebra = Algebra(order, waiting.pop(), crossing=crossing and order > 0)
        try:
            sides.append(program.run(arguments, algebra.constant, algebra.apply))
        except Crossed as fork:
            waiting += [[*fork.signs, choice] for choice in fork.choices]
            if len(waiting) + len(sides) > MOST_SIDES:
                raise Undecided("too much is switched on there") from None
    if len(sides) == 1:
        return sides[0]
    return [[_joined(found) for found in zip(*rows, strict=True)] for rows in zip(*sides, strict=True)]


def _joined(sides: Sequence[Jet]) -> Jet:
    """What holds each of some jets of numbers."""

    def union(parts: Sequence[Any]) -> Any:
        """A ball that holds each of some numbers."""
        total = flint().arb(0) + parts[0]
        for part in parts[1:]:
            total = total.union(flint().arb(0) + part)
        return total

    first = {key for side in sides for key in side.first}
    second = {key for side in sides for key in side.second}
    return Jet(
        union([side.value for side in sides]),
        {key: union([side.first.get(key, 0) for side in sides]) for key in first},
        {key: union([side.second.get(key, 0) for side in sides]) for key in second},
    )


def switches_between(program: Program, arguments: Sequence[Sequence[Jet]]) -> list[Switch]:
    """Signs of what a function switches on, where they hang on x alone; series about the middle of an interval."""
    algebra = Algebra(2, between=True)
    try:
        program.run(arguments, algebra.constant, algebra.apply)
    except Undecided:
        return []
    return algebra.signs
