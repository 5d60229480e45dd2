"""Whether an expression of a point depends on its distance from one centre alone, read from its operations.

Polynomials up to the second degree are kept by their coefficients; what is made of them otherwise is a function of the
squared distance u from a centre if they are all a u + b with the same centre. Nothing is told from samples.
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
class Centred:
    """An ``expression`` of the squared distance from a ``centre`` (d,), which is None of a number."""

    centre: np.ndarray | None
    expression: Expression


class NotCentredError(Exception):
    """What was read depends on more than one distance."""


def about_centre(expression: Expression, position: Expression) -> tuple[np.ndarray, ca.Function] | None:
    """The centre (d,) about which an SX ``expression`` of a column ``position`` is the same all round, or None.

    And the expression as a function of the squared distance from there.
    """
    d = position.numel()
    function, u = ca.Function("read", [position], [expression]), ca.SX.sym("u")

    def fixed(value: float) -> PolynomialOfPoint:
        return PolynomialOfPoint(float(value), np.zeros(d), np.zeros((d, d)))

    def applied(operation: int, operands: Sequence[PolynomialOfPoint | Centred]) -> PolynomialOfPoint | Centred:
        told = None
        if all(isinstance(o, PolynomialOfPoint) for o in operands) and not isinstance(operation, Call):
            told = _polynomial(operation, [o for o in operands if isinstance(o, PolynomialOfPoint)])
        return told or _centred(operation, [_told(o, u) for o in operands])

    given = [[PolynomialOfPoint(0.0, row, np.zeros((d, d))) for row in np.eye(d)]]
    try:
        ((result,),) = interpret(function, given, fixed, applied)
        found = _told(result, u)
    except NotCentredError:
        return None
    if found.centre is None:
        return None
    return found.centre, ca.Function("about", [u], [found.expression])


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


def _centred(operation: int, operands: Sequence[Centred]) -> Centred:
    """What an operation makes of functions of one distance."""
    centres = [o.centre for o in operands if o.centre is not None]
    for other in centres[1:]:
        if np.abs(other - centres[0]).max() > SAME * max(np.abs(centres[0]).max(), np.abs(other).max()):
            raise NotCentredError
    return Centred(centres[0] if centres else None, operate(operation, [o.expression for o in operands]))


def _told(part: PolynomialOfPoint | Centred, u: Expression) -> Centred:
    """A polynomial as a function of a distance."""
    if isinstance(part, Centred):
        return part
    d, curved = len(part.linear), part.square[0, 0]
    if part.is_constant:
        return Centred(None, ca.SX(part.constant))
    if curved == 0 or np.abs(part.square - curved * np.eye(d)).max() > SAME * abs(curved):
        raise NotCentredError
    centre = -part.linear / (2 * curved)
    return Centred(centre, curved * u + (part.constant - curved * float(centre @ centre)))
