"""Whether an expression of a point depends on its distance from one centre, or one plane, alone; read from operations.

Polynomials up to the second degree are kept by their coefficients; what is made of them otherwise is a function of the
squared distance u from a centre if they are all a u + b with the same centre, and of a height u if they are polynomials
of u with the same direction upwards. Nothing is told from samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import Call, Expression, interpret, operate

SAME = 1e-14
"""Of the sizes of coefficients: differences that are round-off."""


@dataclass(frozen=True)
class PolynomialOfPoint:
    """A polynomial c + b·r + r·A r of a point r: ``constant``, ``linear`` (d,) and ``square`` (d, d)."""

    constant: float
    linear: np.ndarray
    square: np.ndarray

    @property
    def is_constant(self) -> bool:
        """Whether it is a number."""
        return not (np.any(self.linear) or np.any(self.square))

    def times(self, other: PolynomialOfPoint) -> PolynomialOfPoint | None:
        """The product; None where it is of a higher degree."""
        if (np.any(self.square) and not other.is_constant) or (np.any(other.square) and not self.is_constant):
            return None
        mixed = np.outer(self.linear, other.linear)
        return PolynomialOfPoint(
            self.constant * other.constant,
            self.constant * other.linear + other.constant * self.linear,
            self.constant * other.square + other.constant * self.square + (mixed + mixed.T) / 2,
        )

    def over(self, other: PolynomialOfPoint) -> PolynomialOfPoint | None:
        """The quotient by a number other than zero; None by anything else."""
        if not other.is_constant or other.constant == 0:
            return None
        return PolynomialOfPoint(
            self.constant / other.constant, self.linear / other.constant, self.square / other.constant
        )

    def plus(self, other: PolynomialOfPoint, factor: float = 1.0) -> PolynomialOfPoint:
        """The sum with so many times another."""
        return PolynomialOfPoint(
            self.constant + factor * other.constant,
            self.linear + factor * other.linear,
            self.square + factor * other.square,
        )


@dataclass(frozen=True)
class OfOneDistance:
    """An ``expression`` of the distance from what ``mark`` (d,) says, a centre or a direction; None of a number."""

    mark: np.ndarray | None
    expression: Expression


class NotOneDistanceError(Exception):
    """What was read depends on more than one distance."""


Told = Callable[[PolynomialOfPoint, Expression], OfOneDistance]
"""What tells a polynomial that is no number as a function of a distance; raises NotOneDistanceError of others."""


def about_centre(expression: Expression, position: Expression) -> tuple[np.ndarray, ca.Function] | None:
    """The centre (d,) about which an SX ``expression`` of a column ``position`` is the same all round, or None.

    And the expression as a function of the squared distance from there.
    """
    return _read(expression, position, _about)


def over_plane(expression: Expression, position: Expression) -> tuple[np.ndarray, ca.Function] | None:
    """The unit vector (d,) along which alone an SX ``expression`` of a column ``position`` changes, or None.

    And the expression as a function of the height along it, from the origin.
    """
    return _read(expression, position, _over)


def _read(expression: Expression, position: Expression, tell: Told) -> tuple[np.ndarray, ca.Function] | None:
    d = position.numel()
    function, u = ca.Function("read", [position], [expression]), ca.SX.sym("u")

    def fixed(value: float) -> PolynomialOfPoint:
        return PolynomialOfPoint(float(value), np.zeros(d), np.zeros((d, d)))

    def told(part: PolynomialOfPoint | OfOneDistance) -> OfOneDistance:
        """What an operand is as a function of the one distance."""
        if isinstance(part, OfOneDistance):
            return part
        return OfOneDistance(None, ca.SX(part.constant)) if part.is_constant else tell(part, u)

    def applied(
        operation: int, operands: Sequence[PolynomialOfPoint | OfOneDistance]
    ) -> PolynomialOfPoint | OfOneDistance:
        """The operation on polynomials where it gives one, or else on functions of the one distance."""
        polynomials = [o for o in operands if isinstance(o, PolynomialOfPoint)]
        if len(polynomials) == len(operands) and not isinstance(operation, Call):
            if operation in COMPARISONS:  # of two sides it is the difference that counts
                return _made(operation, [told(polynomials[0].plus(polynomials[1], -1.0)), told(fixed(0.0))])
            polynomial = _polynomial(operation, polynomials)
            if polynomial is not None:
                return polynomial
        return _made(operation, [told(o) for o in operands])

    given = [[PolynomialOfPoint(0.0, row, np.zeros((d, d))) for row in np.eye(d)]]
    try:
        ((result,),) = interpret(function, given, fixed, applied)
        found = told(result)
    except NotOneDistanceError:
        return None
    if found.mark is None:
        return None
    return found.mark, ca.Function("read", [u], [found.expression])


COMPARISONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE)
POLYNOMIALS: dict[int, Callable[[PolynomialOfPoint, PolynomialOfPoint], PolynomialOfPoint | None]] = {
    ca.OP_ASSIGN: lambda a, _: a,
    ca.OP_ADD: lambda a, b: a.plus(b),
    ca.OP_SUB: lambda a, b: a.plus(b, -1.0),
    ca.OP_NEG: lambda a, _: a.plus(a, -2.0),
    ca.OP_TWICE: lambda a, _: a.plus(a),
    ca.OP_MUL: PolynomialOfPoint.times,
    ca.OP_SQ: lambda a, _: a.times(a),
    ca.OP_DIV: lambda a, b: a.over(b),
}
"""What operations make of two polynomials, or of one; None where that is none up to the second degree."""


def _polynomial(operation: int, operands: Sequence[PolynomialOfPoint]) -> PolynomialOfPoint | None:
    """What an operation makes of polynomials, where that is one up to the second degree."""
    rule = POLYNOMIALS.get(operation)
    return rule(operands[0], operands[-1]) if rule else None


def _made(operation: int, operands: Sequence[OfOneDistance]) -> OfOneDistance:
    """What an operation makes of functions of one distance."""
    marks = [o.mark for o in operands if o.mark is not None]
    for other in marks[1:]:
        if np.abs(other - marks[0]).max() > SAME * max(np.abs(marks[0]).max(), np.abs(other).max()):
            raise NotOneDistanceError
    return OfOneDistance(marks[0] if marks else None, operate(operation, [o.expression for o in operands]))


def _about(part: PolynomialOfPoint, u: Expression) -> OfOneDistance:
    """A polynomial as a function of the squared distance u from a centre."""
    d, curved = len(part.linear), part.square[0, 0]
    if curved == 0 or np.abs(part.square - curved * np.eye(d)).max() > SAME * abs(curved):
        raise NotOneDistanceError
    centre = -part.linear / (2 * curved)
    return OfOneDistance(centre, curved * u + (part.constant - curved * float(centre @ centre)))


def _over(part: PolynomialOfPoint, u: Expression) -> OfOneDistance:
    """A polynomial as a function of a height u, upwards being where its first coordinate that counts grows."""
    row = part.square[np.argmax(np.abs(np.diag(part.square)))] if np.any(part.square) else part.linear
    up = row / np.linalg.norm(row)
    up = up * np.sign(up[np.argmax(np.abs(up) > SAME)])
    slope, bend = float(part.linear @ up), float(up @ part.square @ up)
    if np.abs(part.linear - slope * up).max() > SAME * np.abs(part.linear).max(initial=0.0):
        raise NotOneDistanceError
    if np.abs(part.square - bend * np.outer(up, up)).max() > SAME * np.abs(part.square).max():
        raise NotOneDistanceError
    return OfOneDistance(up, part.constant + slope * u + (bend * u**2 if bend else 0))
