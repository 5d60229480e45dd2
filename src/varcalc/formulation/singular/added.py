"""A Lagrangian less the derivative of a function of x and y that is added to it.

L + d phi(x, y(x)) / dx has the extremals of L between the same two points (Giaquinta and Hildebrandt, "Calculus of
Variations I", 1996, ch. 1, sect. 4, on null Lagrangians), but it is no longer the length of a metric, and beside a
singular end it has other powers of the distance. Coordinates are therefore chosen for L alone, and the derivative is
added to what is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca

from varcalc.formulation import Form, Stated
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.tracing import Expression

ONE_BY_ONE = frozenset({ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE})
"""Operations of one argument that are carried out on every term of a sum."""
PRODUCTS = frozenset({ca.OP_MUL, ca.OP_DIV})
"""Those of two that are, where the second does not hold the slope."""


@dataclass(frozen=True)
class AddedDerivative:
    """The derivative ``along`` + ``across`` y' of a function of x and y, and the ``rest`` of the Lagrangian."""

    along: Expression
    across: Expression
    rest: Expression


@derived
def added_derivative(problem: Problem) -> AddedDerivative | None:
    """The derivative of a function of x and y that is added to L, as it is written; None where there is none.

    It is that of the terms that are linear in the slope y', whose factor hangs on y alone or on x alone: g(y) y' or
    f(x) y' + f'(x) y.
    """
    s = problem.symbols
    if not isinstance(problem.integrand, ca.SX):
        return None
    x, y, _, *rest = [[_Terms(e, None) for e in ca.vertsplit(a)] if a.numel() else [] for a in s.all]
    places = [x, y, [_Terms(None, ca.SX(1))], *rest]
    function = ca.Function("L", s.all, [ca.densify(problem.integrand)])
    terms = interpret(function, places, lambda number: _Terms(ca.SX(number), None), partial(_applied, s.dy))[0][0]
    across = terms.factor
    if across is None or across.is_zero():
        return None
    change = ca.gradient(across, s.x)
    if not change.is_zero() and ca.depends_on(across, s.y):
        return None
    along = change * s.y
    return AddedDerivative(along, across, (0 if terms.rest is None else terms.rest) - along)


@dataclass(frozen=True)
class _Terms:
    """``rest`` + ``factor`` y'; None where a part is zero."""

    rest: Expression | None
    factor: Expression | None

    def each(self, change: Callable[[Expression], Expression]) -> _Terms:
        """The same ``change`` of both parts."""
        parts = (None if part is None else change(part) for part in (self.rest, self.factor))
        return _Terms(*parts)

    def plus(self, other: _Terms) -> _Terms:
        """The sum of two."""
        pairs = ((self.rest, other.rest), (self.factor, other.factor))
        parts = (b if a is None else a if b is None else a + b for a, b in pairs)
        return _Terms(*parts)

    def whole(self, slope: Expression) -> Expression:
        """Both parts together."""
        linear = ca.SX(0) if self.factor is None else self.factor * slope
        return linear if self.rest is None else self.rest if self.factor is None else self.rest + linear

    def held(self, slope: Expression) -> bool:
        """Whether the slope is nowhere in them."""
        return self.factor is None and (self.rest is None or not ca.depends_on(self.rest, slope))


def _applied(slope: Expression, operation: int, operands: Sequence[_Terms]) -> _Terms:
    first, last = operands[0], operands[-1]
    if operation in ONE_BY_ONE:
        return first.each(lambda e: operate(operation, [e]))
    if operation == ca.OP_ADD:
        return first.plus(last)
    if operation == ca.OP_SUB:
        return first.plus(last.each(lambda e: -e))
    if operation in PRODUCTS and last.held(slope):
        other = last.whole(slope)
        return first.each(lambda e: operate(operation, [e, other]))
    if operation == ca.OP_MUL and first.held(slope):
        other = first.whole(slope)
        return last.each(lambda e: other * e)
    return _Terms(operate(operation, [o.whole(slope) for o in operands]), None)


def without(problem: Problem, added: AddedDerivative) -> Problem:
    """The problem without the derivative in its Lagrangian."""
    return problem.with_integrand(added.rest)


def added_to(problem: Problem, added: AddedDerivative, make: Callable[[], Form | None]) -> Form | None:
    """The form that ``make`` states of the problem :func:`without` the derivative, as a form of the problem itself."""
    form = make()
    if form is None:
        return None
    s, own = problem.symbols, form.symbols
    x, y, dx, dy = form.lifted or (own.x, own.y, own.kind(1), own.dy)
    old, new = [s.x, s.y, s.unknowns], [x, y, own.unknowns[: len(problem.unknowns), :]]
    along, across = ca.substitute([added.along, added.across], old, new)
    functional = form.functional + problem.sign * (along * dx + across * dy)
    coordinates = replace(
        form.coordinates, stated=Stated(own, form.integrand, functional, (x, y, dx, dy)), numbers=None
    )
    return replace(form, problem=problem, coordinates=coordinates, elsewhere=None)
