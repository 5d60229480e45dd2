"""Convex terms that have kinks, or no second derivative: each lies above its lines of support, which are smooth.

c(x) phi(e), c >= 0 and phi convex, is at least c times phi(m) + phi'(m) (e - m) for any m(x), and where phi' jumps at
m = b any slope between the two will do (Ekeland and Temam, "Convex Analysis and Variational Problems", ch. III).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, flint, largest
from varcalc.certificates.piecewise import Coefficients, PiecewisePolynomial, about, total
from varcalc.symbolic.tracing import Expression

FOLLOWED = 1e-6
"""Distance of e from a break, relative to its largest size, within which a piece of the curve follows the break."""


@dataclass(frozen=True)
class ConvexTerm(ABC):
    """``factor`` times a convex function of ``argument``, expressions in the symbols of the problem.

    The ``side`` that a curve is on is a number: of the part of the function, or of the break that it follows.
    """

    factor: Expression
    argument: Expression

    @property
    @abstractmethod
    def breaks(self) -> Sequence[float]:
        """Values of the argument between which the function is smooth."""

    @abstractmethod
    def side(self, arguments: np.ndarray, size: float) -> int:
        """The side on which given arguments are, whose largest size along the curve is ``size``."""

    @abstractmethod
    def on(self, side: int) -> bool:
        """Whether it is a break that is followed."""

    @abstractmethod
    def follows(self, side: int) -> bool:
        """Whether, besides, any slope between two will do there."""

    @abstractmethod
    def between(self, side: int) -> tuple[Ball | None, Ball | None] | None:
        """Where the place m(x) of a line of support must lie; None where the function is a line on that side."""

    @abstractmethod
    def expression(self, side: int) -> Expression:
        """The term on a side; on a break the mean of the lines of support beside it."""

    @abstractmethod
    def turn(self, side: int) -> Expression:
        """What a subgradient sigma, between -1 and 1, adds its multiple of on a break that is followed."""

    @abstractmethod
    def below(self, side: int, given: Expression) -> Expression:
        """The line of support, by its place m or, on a break, by sigma."""

    def along(self, side: int, given: Expression) -> Expression:
        """The term on a side, on a break its line of support."""
        return self.below(side, given) if self.on(side) and self.follows(side) else self.expression(side)

    @abstractmethod
    def beyond(self, argument: Ball, side: int) -> Ball:
        """How far the function may be off what it is on a side, for arguments that are not proved to lie there."""

    @property
    def slack(self) -> float:
        """What the function may be more than the convex one that its lines of support are of."""
        return 0.0


@dataclass(frozen=True)
class Power(ConvexTerm):
    """A ``power`` p > 1 of M = |e| or, ``one_sided``, of M = fmax(e, 0)."""

    power: float = 2.0
    one_sided: bool = False

    @property
    def breaks(self) -> Sequence[float]:
        """Where the argument vanishes."""
        return (0.0,)

    def side(self, arguments: np.ndarray, size: float) -> int:
        """The sign of the argument, 0 where it all but vanishes."""
        at = arguments[np.abs(arguments).argmax()]
        return int(np.sign(at)) if abs(at) > FOLLOWED * size else 0

    def on(self, side: int) -> bool:
        """Whether the argument all but vanishes."""
        return side == 0

    def follows(self, side: int) -> bool:  # noqa: ARG002  none does
        """The slope does not jump."""
        return False

    def between(self, side: int) -> tuple[Ball | None, Ball | None] | None:
        """On the argument's side of zero."""
        zero = flint().arb(0)
        return ((zero, None) if side > 0 else (None, zero)) if self._rises(side) else None

    def _rises(self, side: int) -> bool:
        """Whether the power is not zero where the argument has a sign."""
        return side > 0 or (side < 0 and not self.one_sided)

    def _size(self, side: int, at: Expression) -> Expression:
        return at if side > 0 else -at

    def expression(self, side: int) -> Expression:
        """The power on a side."""
        return self.factor * self._size(side, self.argument) ** self.power if self._rises(side) else ca.SX(0)

    def turn(self, side: int) -> Expression:  # noqa: ARG002
        """Nothing."""
        return ca.SX(0)

    def below(self, side: int, given: Expression) -> Expression:
        """The tangent p m^(p-1) M - (p-1) m^p."""
        p = self.power
        if not self._rises(side):
            return ca.SX(0)
        at = self._size(side, given)
        # p = 2 and 3 as they are carried out exactly
        slope = at if p == 2.0 else at ** (p - 1.0)
        return self.factor * slope * (p * self._size(side, self.argument) - (p - 1.0) * at)

    def beyond(self, argument: Ball, side: int) -> Ball:
        """Twice M^p, or nothing."""
        if (side > 0 and argument >= 0) or (side < 0 and argument <= 0):
            return flint().arb(0)
        size = abs(argument).upper()
        return (2 * size**self.power).upper() if size > 0 else flint().arb(0)


@dataclass(frozen=True)
class BrokenTerm(ConvexTerm):
    """A convex ``function`` that is a polynomial between breaks: Huber's loss, a size, the greatest of some lines.

    ``branches`` are its parts as they are written, of the symbol ``variable``. Side 2 k is part k, 2 k + 1 the break
    after it. Parts that meet but for round-off are those of the function when they are ``lowered`` by no less.
    """

    function: PiecewisePolynomial
    branches: tuple[Expression, ...]
    variable: Expression
    lowered: float = 0.0

    @property
    def slack(self) -> float:
        """Twice what parts are lowered by."""
        return 2.0 * self.lowered

    @property
    def breaks(self) -> Sequence[float]:
        """Its breaks, rounded."""
        return tuple(map(float, self.function.breaks))

    def side(self, arguments: np.ndarray, size: float) -> int:
        """The break between two lines that all of the arguments are close to, or the part on which they are."""
        breaks = np.array(self.breaks)
        lines = [len(a) <= 2 and len(b) <= 2 for a, b in pairwise(self.function.parts)]
        apart = np.where(lines, np.abs(arguments[:, None] - breaks).max(axis=0), np.inf)
        if (apart <= FOLLOWED * size).any():
            return 2 * int(apart.argmin()) + 1
        return 2 * int(np.searchsorted(breaks, np.median(arguments)))

    def on(self, side: int) -> bool:
        """Whether it is the number of a break."""
        return side % 2 == 1

    def follows(self, side: int) -> bool:
        """On a break, whether the slope jumps or not."""
        return self.on(side)

    def _part(self, side: int) -> Coefficients:
        return self.function.parts[side // 2]

    def between(self, side: int) -> tuple[Ball | None, Ball | None] | None:
        """Between the breaks beside a part that is no line."""
        if self.on(side) or len(self._part(side)) <= 2:
            return None
        low, high = ([None, *self.function.breaks, None][side // 2 + k] for k in (0, 1))
        return None if low is None else _ball(low), None if high is None else _ball(high)

    def _branch(self, part: int, at: Expression) -> Expression:
        return ca.substitute([self.branches[part]], [self.variable], [at])[0]

    def _beside(self, side: int) -> tuple[Expression, Expression]:
        """The lines before and after a break, lowered."""
        return tuple(self._branch(side // 2 + k, self.argument) - self.lowered for k in (0, 1))

    def expression(self, side: int) -> Expression:
        """The part, or the mean of the lines beside a break."""
        if not self.on(side):
            return self.factor * self._branch(side // 2, self.argument)
        left, right = self._beside(side)
        return self.factor * (left + right) / 2

    def turn(self, side: int) -> Expression:
        """Half of what the lines beside a break are apart."""
        left, right = self._beside(side)
        return self.factor * (right - left) / 2

    def below(self, side: int, given: Expression) -> Expression:
        """The line of support."""
        if self.on(side):
            return self.expression(side) + given * self.turn(side)
        if self.between(side) is None:
            return self.expression(side) - self.factor * self.lowered
        rate = ca.gradient(self.branches[side // 2], self.variable)
        slope = ca.substitute([rate], [self.variable], [given])[0]
        return self.factor * (self._branch(side // 2, given) - self.lowered + slope * (self.argument - given))

    def beyond(self, argument: Ball, side: int) -> Ball:
        """What the parts on which the argument may lie are off that of the side, or off those beside a break."""
        breaks, parts = self.function.breaks, self.function.parts
        ends = [None, *breaks, None]
        if not self.on(side) and _within(argument, *ends[side // 2 : side // 2 + 2]):
            return flint().arb(0)
        taken = parts[side // 2 : side // 2 + 1 + self.on(side)]
        middle = Fraction(float(argument.mid()))
        nearest = min(breaks, key=lambda at: abs(at - middle))
        away = argument - _ball(nearest)
        met = [part for k, part in enumerate(parts) if not _outside(argument, *ends[k : k + 2])]
        return largest([_at(about(total(part, one, -1), nearest), away) for part in met for one in taken])


def _ball(number: Fraction) -> Ball:
    return flint().arb(number.numerator) / number.denominator


def _at(coefficients: Sequence[Fraction], at: Ball) -> Ball:
    found = flint().arb(0)
    for c in reversed(coefficients):
        found = found * at + _ball(c)
    return found


def _within(argument: Ball, low: Fraction | None, high: Fraction | None) -> bool:
    return (low is None or bool(argument >= _ball(low))) and (high is None or bool(argument <= _ball(high)))


def _outside(argument: Ball, low: Fraction | None, high: Fraction | None) -> bool:
    return (low is not None and bool(argument < _ball(low))) or (high is not None and bool(argument > _ball(high)))
