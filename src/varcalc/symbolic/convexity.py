"""Proofs that an expression is convex, by the rules of composition.

Every operation is carried out on shapes: what is known of how an expression bends, of its range and of its structure,
for all values of the watched entries in its domain. A sum of convex functions is convex, a convex function that
increases takes a convex argument, and so on (Grant, Boyd and Ye, "Disciplined convex programming", in Global
Optimization: From Theory to Implementation, Springer 2006; Boyd and Vandenberghe, "Convex Optimization", ch. 3). What
is of degree two is added up as such and its matrix is looked at, so that cross terms are no obstacle.

An expression is taken to be infinite where it is no number: log(y) + y'^2 has the domain y > 0. The rules keep every
such domain convex. What no rule covers has no known shape, which is never a statement that it is not convex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import Call, interpret
from varcalc.symbolic.look_up import vanishes
from varcalc.symbolic.quadratics import (
    AlongX,
    Coefficient,
    Polynomial,
    added,
    coefficient,
    defined,
    greatest,
    least,
    multiplied,
    rounded_down,
    rounded_up,
)

LONGEST = 300
"""Instructions beyond which a function is not looked into: bounds and signs are asked for down the whole of it."""
ZERO_POLYNOMIAL = Polynomial(0.0, {}, {})


def _never() -> bool:
    return False


def _always() -> bool:
    return True


def _unbounded_below() -> float:
    return -math.inf


def _unbounded_above() -> float:
    return math.inf


def _zero() -> float:
    return 0.0


@dataclass(slots=True, eq=False)
class Shape:
    """What is proved of an expression: a polynomial ``part`` of degree two, and the rest of it unless it is ``bare``.

    ``part_convex`` and ``part_concave`` are what the rules say of the part; its matrix may say more. ``total`` tells
    that the expression is a number everywhere, ``rooted`` that it is nowhere negative and its root is convex, as of a
    sum of squares, and ``log_convex`` that its logarithm is convex. ``low`` and ``high`` are bounds; they and what
    hangs on the sign of a coefficient are found when they are called.

    The expression is ``scale`` times ``unscaled`` where that is a shape, and the power ``exponent`` of ``base``, a
    number where the base is not negative alone if ``sided``; it is the logarithm of ``inside``, the size of ``sized``.
    """

    part: Polynomial = ZERO_POLYNOMIAL
    part_convex: bool = True
    part_concave: bool = True
    rest_convex: bool = True
    rest_concave: bool = True
    bare: bool = False
    total: bool = False
    rooted: Callable[[], bool] = _never
    log_convex: Callable[[], bool] = _never
    low: Callable[[], float] = _unbounded_below
    high: Callable[[], float] = _unbounded_above
    scale: Coefficient = 1.0
    unscaled: Shape | None = None
    base: Shape | None = None
    exponent: float = 1.0
    sided: bool = False
    inside: Shape | None = None
    sized: Shape | None = None

    @property
    def convex(self) -> bool:
        """Whether the expression is proved convex."""
        return self.rest_convex and (self.part_convex or self.part.convex)

    @property
    def concave(self) -> bool:
        """Whether the expression is proved concave."""
        return self.rest_concave and (self.part_concave or self.part.concave)

    @property
    def affine(self) -> bool:
        """Whether the expression is proved to be of degree one at most."""
        return self.bare and self.part.affine

    @property
    def has_convex_root(self) -> bool:
        """Whether the expression is proved nowhere negative, with a root that is convex."""
        return self.rooted() or self.log_convex() or (self.bare and self.part.nonnegative)

    @property
    def nonnegative(self) -> bool:
        """Whether the expression is proved nowhere negative."""
        return self.low() >= 0 or self.has_convex_root

    @property
    def size_convex(self) -> bool:
        """Whether the absolute value of the expression is proved convex by the simplest rules."""
        return self.affine or (self.convex and self.nonnegative)


UNKNOWN = Shape(rest_convex=False, rest_concave=False)
"""Of this nothing is known."""

Element: TypeAlias = float | AlongX | Shape
"""What instructions work on: what does not depend on the watched entries stays a coefficient."""

Entry: TypeAlias = float | tuple[float, float] | AlongX | None
"""An argument's entry: a number, or the ends of the interval it ranges over; None for one that is watched.

Where several range over intervals of their own they are given on the same boxes, by :meth:`AlongX.between`.
"""


def shapes(function: ca.Function, arguments: Sequence[Sequence[Entry]]) -> list[list[Shape]]:
    """The shapes of the nonzeros of each result of a ``function``, jointly in those entries that are watched.

    They hold for every value in the domain of each watched entry and for all of the interval of each that ranges over
    one. ``arguments`` are the entries of each argument. Of a function that is not an SXFunction, or is very long,
    nothing is known.

    >>> y, v = ca.SX.sym("y"), ca.SX.sym("v")
    >>> length, height = ca.sqrt(1 + v**2), ca.Function("height", [y, v], [y * ca.sqrt(1 + v**2)])
    >>> shapes(ca.Function("length", [y, v], [length]), [[None], [None]])[0][0].convex
    True
    >>> shapes(height, [[None], [None]])[0][0].convex
    False
    """
    if not function.is_a("SXFunction") or function.n_instructions() > LONGEST:
        return [[UNKNOWN] * function.nnz_out(i) for i in range(function.n_out())]
    watched = iter(range(sum(map(len, arguments))))
    given = [[_entry(e, watched.__next__) for e in argument] for argument in arguments]
    results = interpret(function, given, _constant, _applied)
    return [[_lifted(r) for r in result] for result in results]


def proved_convex(function: ca.Function, arguments: Sequence[Sequence[Entry]]) -> bool:
    """Whether every entry of every result is proved convex; arguments as in :func:`shapes`."""
    return all(shape.convex for result in shapes(function, arguments) for shape in result)


def _entry(entry: Entry, following: Callable[[], int]) -> Element:
    if entry is None:
        return Shape(Polynomial(0.0, {following(): 1.0}, {}), bare=True, total=True)
    if isinstance(entry, AlongX):
        return entry
    return AlongX.abscissa(*map(float, entry)) if isinstance(entry, tuple) else float(entry)


def _constant(value: float) -> Element:
    return float(value)


def _applied(operation: int, operands: Sequence[Element]) -> Element:
    if Shape not in map(type, operands):
        return coefficient(operation, *operands)  # pyright: ignore[reportArgumentType]  none of them is a shape
    if isinstance(operation, Call):
        zero = len(operands) == 1 and isinstance(operands[0], Shape) and operands[0].affine
        return Shape(Polynomial(0.0, {}, {}), bare=True) if zero and vanishes(operation.function) else UNKNOWN
    rule = RULES.get(operation)
    if rule is None or UNKNOWN in operands:
        return UNKNOWN
    return rule(*operands)


def _lifted(element: Element) -> Shape:
    """A coefficient as a shape that is the same for all values of the watched entries."""
    if isinstance(element, Shape):
        return element

    def positive() -> bool:
        return least(element) >= 0

    return Shape(
        Polynomial(element, {}, {}), bare=True, total=defined(element), rooted=positive, log_convex=positive,
        low=lambda: least(element), high=lambda: greatest(element),
    )  # fmt: skip


def _both(a: Callable[[], bool], b: Callable[[], bool]) -> Callable[[], bool]:
    if a is _never or b is _never:
        return _never
    return b if a is _always else a if b is _always else lambda: a() and b()


def _added(a: Element, b: Element) -> Shape:
    a, b = _lifted(a), _lifted(b)
    if not a.bare and (a.unscaled or a) is (b.unscaled or b):
        return _scaled(a.unscaled or a, added(a.scale, b.scale))
    bare, upward, downward = a.bare and b.bare, a.rest_convex and b.rest_convex, a.rest_concave and b.rest_concave
    if not (bare or upward or downward):
        return UNKNOWN
    return Shape(
        a.part.plus(b.part), a.part_convex and b.part_convex, a.part_concave and b.part_concave, upward, downward,
        bare, a.total and b.total, _both(a.rooted, b.rooted), _both(a.log_convex, b.log_convex),
        lambda: rounded_down(a.low() + b.low()), lambda: rounded_up(a.high() + b.high()),
    )  # fmt: skip


def _subtracted(a: Element, b: Element) -> Shape:
    return _added(a, _scaled(b, -1.0) if isinstance(b, Shape) else coefficient(ca.OP_NEG, b))


def _scaled(a: Shape, c: Coefficient) -> Shape:
    if c == 1.0 or a is UNKNOWN:
        return a
    affine = a.affine
    # what is affine stays so, whatever the sign of the coefficient
    up, down = (True, True) if affine else (least(c) >= 0, greatest(c) <= 0)
    upward = a.bare or (up and a.rest_convex) or (down and a.rest_concave)
    downward = a.bare or (up and a.rest_concave) or (down and a.rest_convex)
    unscaled = a.unscaled or a
    if not (upward or downward or unscaled.base):
        return UNKNOWN

    def low() -> float:
        return rounded_down(min(_corners(a, c)))

    def high() -> float:
        return rounded_up(max(_corners(a, c)))

    def positive() -> bool:
        return least(c) >= 0

    return Shape(
        a.part.times(c), (up and a.part_convex) or (down and a.part_concave),
        (up and a.part_concave) or (down and a.part_convex), upward, downward, a.bare,
        a.total and defined(c), _both(a.rooted, positive), _both(a.log_convex, positive), low, high,
        multiplied(a.scale, c), unscaled,
    )  # fmt: skip


def _corners(a: Shape, c: Coefficient) -> list[float]:
    """Products of the bounds of both, where zero times anything is zero."""
    return [p * q if p and q else 0.0 for p in (a.low(), a.high()) for q in (least(c), greatest(c))]


def _multiplied(a: Element, b: Element) -> Shape:
    if not isinstance(b, Shape):
        return _scaled(_lifted(a), b)
    if not isinstance(a, Shape):
        return _scaled(b, a)
    if a is b:
        return _powered(a, 2.0)
    p, q = a.unscaled or a, b.unscaled or b
    product = _one_power(p, q)
    if product is None and a.affine and b.affine:
        return Shape(a.part.product(b.part), False, False, bare=True, total=a.total and b.total)
    return _scaled(
        product or _over(p, q) or _over(q, p) or _logarithmic(p, q) or _logarithmic(q, p), multiplied(a.scale, b.scale)
    )


def _one_power(a: Shape, b: Shape) -> Shape | None:
    """The product of two powers of one base, whose exponents have one sign; of |u| and an even power of u too."""
    base, other = a.base or a, b.base or b
    if base is other and a.exponent * b.exponent > 0:
        return _raised(base, _exact(ca.OP_ADD, a.exponent, b.exponent), a.sided or b.sided)
    for size, power in ((a, b), (b, a)):
        if size.sized is not None and size.sized is power.base and power.exponent % 2 == 0 < power.exponent:
            return _raised(size, _exact(ca.OP_ADD, power.exponent, 1.0), False)
    return None


def _over(a: Shape, b: Shape) -> Shape | None:
    """A square over what is concave and nowhere negative, b being one over it: u^2 / s is convex in both.

    It grows with u >= 0 and falls as s grows, so u may be convex and s concave.
    """
    if b.base is None or b.exponent >= 0 or not a.has_convex_root:
        return None
    divisor = _raised(b.base, -b.exponent, b.sided)
    if not (divisor.concave and divisor.nonnegative):
        return None
    return Shape(rest_concave=False, low=_zero)


def _logarithmic(a: Shape, b: Shape) -> Shape:
    """Two functions whose logarithms are convex; u log(u)."""
    if a.log_convex() and b.log_convex():
        return Shape(rest_concave=False, total=a.total and b.total, rooted=_always, log_convex=_always, low=_zero)
    if b.inside is not None and a.affine and b.inside.affine and a.part == b.inside.part:
        return Shape(rest_concave=False)
    return UNKNOWN


def _divided(a: Element, b: Element) -> Shape:
    if isinstance(b, Shape):
        return _multiplied(a, _powered(b, -1.0))
    if b == 0.0:
        return UNKNOWN
    return _scaled(_lifted(a), coefficient(ca.OP_DIV, 1.0, b))


def _power(a: Element, exponent: Element) -> Shape:
    if not isinstance(exponent, float) or not isinstance(a, Shape) or exponent == 0.0:
        return UNKNOWN
    return a if exponent == 1.0 else _powered(a, exponent)


def _powered(a: Shape, exponent: float) -> Shape:
    """A power of a shape, brought back to a power of what that is a power of."""
    whole = exponent == round(exponent)
    unscaled, scale = _upright(a)
    if scale != 1.0 and not whole and not least(scale) >= 0:
        return _raised(a, exponent, False)
    squared = coefficient(ca.OP_SQ, scale) if exponent == 2.0 else None
    factor = squared or (coefficient(ca.OP_POW, scale, exponent) if scale != 1.0 else 1.0)
    base = unscaled.base
    if base is None:
        power = _raised(unscaled, exponent, False)
    elif whole or unscaled.sided or unscaled.exponent % 2 == 1:
        # an odd power is not negative where its base is not
        power = _raised(base, _exact(ca.OP_MUL, unscaled.exponent, exponent), unscaled.sided or not whole)
    else:
        power = _raised(unscaled, exponent, False)
    return _scaled(power, factor)


def _upright(a: Shape) -> tuple[Shape, Coefficient]:
    """What a shape is a multiple of, and how many times that: of -1/y it is 1/(-y), once."""
    unscaled, scale = a.unscaled or a, a.scale
    if unscaled.base is None or unscaled.exponent % 2 != 1 or not greatest(scale) < 0:
        return unscaled, scale
    turned = _raised(_scaled(unscaled.base, -1.0), unscaled.exponent, unscaled.sided)
    return turned, coefficient(ca.OP_NEG, scale)


def _exact(operation: int, a: float, b: float) -> float:
    """An operation on exponents; no number where it would round."""
    found = coefficient(operation, a, b)
    return found if isinstance(found, float) else math.nan


def _raised(base: Shape, exponent: float, sided: bool) -> Shape:
    """A power of a base, where that is not negative if ``sided``; unknown for an exponent that is no number."""
    if base is UNKNOWN or exponent == 0.0 or math.isnan(exponent):
        return UNKNOWN
    if exponent == 1.0:
        return Shape(rest_convex=base.convex, rest_concave=base.concave, low=_zero if sided else base.low)
    if exponent == 2.0 and not sided and base.affine:
        return _square(base)
    whole = exponent == round(exponent)
    raised = Shape(base=base, exponent=exponent, sided=sided or not whole)
    raised.rest_convex = raised.rest_concave = False
    if exponent < 0:
        _lowered(raised, base)
    elif exponent < 1:
        _flattened(raised, base, exponent)
    else:
        _steepened(raised, base, exponent)
    if exponent > 0 and base.log_convex():
        raised.rest_convex, raised.log_convex, raised.low, raised.total = True, _always, _zero, base.total
    return raised


def _square(base: Shape) -> Shape:
    def low() -> float:
        a, b = base.low(), base.high()
        return 0.0 if a <= 0 <= b else rounded_down(min(abs(a), abs(b)) ** 2)

    squared = base.part.product(base.part)
    return Shape(
        squared, True, False, bare=True, total=base.total, rooted=_always, low=low, base=base, exponent=2.0
    )  # fmt: skip


def _steepened(raised: Shape, base: Shape, exponent: float) -> None:
    """A power beyond 1: it increases and is convex where the base is not negative, an even one on both sides."""
    even, affine = exponent % 2 == 0 and not raised.sided, base.affine
    nonnegative = base.nonnegative
    raised.total = base.total and (nonnegative or not raised.sided)
    if (affine and (even or raised.sided)) or (nonnegative and base.convex):
        raised.rest_convex = True
        raised.rooted = _always if exponent >= 2 else _never
    if even or nonnegative or raised.sided:
        # u^p is at least u where u is at least 1
        raised.low = lambda: base.low() if base.low() >= 1 else 0.0


def _flattened(raised: Shape, base: Shape, exponent: float) -> None:
    """A power between 0 and 1: it increases and is concave; that of a square from 1/2 on is a power beyond 1."""
    raised.low = lambda: rounded_down(max(0.0, base.low()) ** exponent)
    raised.rest_concave = base.concave
    if base.has_convex_root:
        raised.total, raised.rest_convex = base.total, exponent >= 0.5


def _lowered(raised: Shape, base: Shape) -> None:
    """A negative power: it decreases and is convex where the base is positive, and so is its logarithm."""
    if base.concave and (raised.sided or base.nonnegative):
        raised.rest_convex, raised.log_convex, raised.low = True, _always, _zero
        raised.total = base.total and base.low() > 0


def _exponential(a: Shape) -> Shape:
    if not a.convex:
        return UNKNOWN
    return Shape(
        rest_concave=False, total=a.total, rooted=_always, log_convex=_always, low=lambda: rounded_down(_exp(a.low())),
        high=lambda: rounded_up(_exp(a.high())),
    )  # fmt: skip


def _exp(value: float) -> float:
    with np.errstate(all="ignore"):
        return float(np.exp(value))


def _logarithm(a: Shape) -> Shape:
    if a.concave:
        return Shape(rest_convex=False, inside=a)
    if a.log_convex():
        return Shape(rest_concave=False)
    unscaled, scale = _upright(a)
    if unscaled.base is None or not (unscaled.sided or unscaled.exponent % 2 == 1) or not least(scale) > 0:
        return UNKNOWN
    of_base = _scaled(_logarithm(unscaled.base), unscaled.exponent)  # but for a number
    return Shape(rest_convex=of_base.convex, rest_concave=of_base.concave)


def log_convex_where_positive(a: Shape) -> bool:
    """Whether the logarithm of what has a shape is proved convex where that is positive: 1/y is no number at 0."""
    return _logarithm(a).convex


def _logarithm_from_one(a: Shape) -> Shape:
    if a.log_convex():
        return Shape(rest_concave=False, total=a.total, low=_zero)
    return Shape(rest_convex=False) if a.concave else UNKNOWN


def _exponential_less_one(a: Shape) -> Shape:
    return Shape(rest_concave=False, total=a.total, low=lambda: -1.0) if a.convex else UNKNOWN


def _size(a: Shape) -> Shape:
    if a.affine and a.unscaled is not None:
        return _scaled(_size(a.unscaled), coefficient(ca.OP_FABS, a.scale))
    if a.affine:
        return Shape(rest_concave=False, total=a.total, low=_zero, sized=a)
    if a.nonnegative:
        return a
    return _scaled(a, -1.0) if a.high() <= 0 else UNKNOWN


def _hyperbolic_cosine(a: Shape) -> Shape:
    if not a.size_convex:
        return UNKNOWN
    return Shape(rest_concave=False, total=a.total, rooted=_always, log_convex=_always, low=lambda: 1.0)


def _hyperbolic_sine(a: Shape) -> Shape:
    if a.nonnegative and a.convex:
        return Shape(rest_concave=False, total=a.total, low=_zero)
    return Shape(rest_convex=False, total=a.total, high=_zero) if a.high() <= 0 and a.concave else UNKNOWN


def _levelling(a: Shape) -> Shape:
    """What increases through zero and is concave beyond it, convex before: tanh, atan, asinh, erf."""
    if a.nonnegative and a.concave:
        return Shape(rest_convex=False, total=a.total, low=_zero)
    return Shape(rest_concave=False, total=a.total, high=_zero) if a.high() <= 0 and a.convex else UNKNOWN


def _greater(a: Element, b: Element) -> Shape:
    a, b = _lifted(a), _lifted(b)
    # the greater of a number and of none is the number, which makes the domain another
    if not (a.total and b.total and a.convex and b.convex):
        return UNKNOWN
    return Shape(
        rest_concave=False, total=True, rooted=_both(a.rooted, b.rooted), log_convex=_both(a.log_convex, b.log_convex),
        low=lambda: max(a.low(), b.low()), high=lambda: max(a.high(), b.high()),
    )  # fmt: skip


def _lesser(a: Element, b: Element) -> Shape:
    a, b = _lifted(a), _lifted(b)
    if not (a.total and b.total and a.concave and b.concave):
        return UNKNOWN
    return Shape(
        rest_convex=False, total=True, low=lambda: min(a.low(), b.low()), high=lambda: min(a.high(), b.high())
    )  # fmt: skip


def _length(a: Element, b: Element) -> Shape:
    a, b = _lifted(a), _lifted(b)
    if not (a.total and b.total and a.size_convex and b.size_convex):
        return UNKNOWN
    return Shape(rest_concave=False, total=True, low=_zero)


def _where(condition: Element, value: Element) -> Shape:
    """The value where a condition is true, zero where it is not; the condition is a matter of x alone."""
    if isinstance(condition, Shape) or not isinstance(value, Shape):
        return UNKNOWN
    if not isinstance(condition, AlongX):
        return value if condition else _lifted(0.0)
    return replace(
        value, part=value.part.where(condition), total=value.total and condition.defined,
        low=lambda: min(0.0, value.low()), high=lambda: max(0.0, value.high()),
        scale=1.0, unscaled=None, base=None, exponent=1.0, sided=False, inside=None, sized=None,
    )  # fmt: skip


RULES: dict[int, Callable[..., Shape]] = {
    ca.OP_ASSIGN: lambda a: a, ca.OP_ADD: _added, ca.OP_SUB: _subtracted, ca.OP_MUL: _multiplied,
    ca.OP_DIV: _divided, ca.OP_NEG: lambda a: _scaled(a, -1.0), ca.OP_TWICE: lambda a: _scaled(a, 2.0),
    ca.OP_SQ: lambda a: _powered(a, 2.0), ca.OP_SQRT: lambda a: _powered(a, 0.5),
    ca.OP_INV: lambda a: _powered(a, -1.0), ca.OP_POW: _power, ca.OP_CONSTPOW: _power,
    ca.OP_EXP: _exponential, ca.OP_LOG: _logarithm, ca.OP_LOG1P: _logarithm_from_one,
    ca.OP_EXPM1: _exponential_less_one, ca.OP_FABS: _size,
    ca.OP_COSH: _hyperbolic_cosine, ca.OP_SINH: _hyperbolic_sine, ca.OP_TANH: _levelling, ca.OP_ATAN: _levelling,
    ca.OP_ASINH: _levelling, ca.OP_ERF: _levelling,
    ca.OP_ACOSH: lambda a: Shape(rest_convex=False, low=_zero) if a.concave else UNKNOWN,
    ca.OP_FMAX: _greater, ca.OP_FMIN: _lesser, ca.OP_HYPOT: _length, ca.OP_IF_ELSE_ZERO: _where,
}  # fmt: skip
"""Shapes of the operations, by CasADi's codes; operands are shapes, of two one may be a coefficient."""
