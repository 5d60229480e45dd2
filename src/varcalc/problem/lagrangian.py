"""The Lagrangian and what follows from it by differentiation.

Everything is an expression in the symbols the functional was traced with;
derivatives are CasADi's. First- and second-order Lagrangians and any number of
unknown functions are treated alike (Gelfand and Fomin, "Calculus of
Variations", sect. 4, 9 and 11; Brizard, "An Introduction to Lagrangian
Mechanics", sect. 1.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from varcalc.problem.functional import Functional, Symbols, check_functional
from varcalc.showing import Shown
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True, repr=False, eq=False)
class Lagrangian(Shown):
    """A scalar ``expression`` in ``symbols`` with its Euler-Lagrange equation and first integrals."""

    symbols: Symbols
    expression: Expression

    @classmethod
    def of(cls, problem: Functional) -> Lagrangian:
        """The Lagrangian of a problem as it was given (not negated when maximised)."""
        check_functional(problem)
        return cls(problem.symbols, problem.integrand)

    @property
    def n(self) -> int:
        """Number of unknown functions."""
        return int(self.symbols.y.numel())

    @property
    def order(self) -> int:
        """Highest derivative of y in the Lagrangian: 1 or 2."""
        return 2 if self.symbols.ddy.numel() else 1

    @cached_property
    def derivatives_of_y(self) -> list[Expression]:
        """y, y', y'', ... up to order 2 * ``order``: the symbols of L, then fresh ones."""
        s = self.symbols
        known = [s.y, s.dy, s.ddy] if self.order == 2 else [s.y, s.dy]
        names = ["y", "dy", "ddy", "dddy", "ddddy"]
        return known + [s.kind.sym(names[k], self.n) for k in range(len(known), 2 * self.order + 1)]

    def partial(self, derivative: int) -> Expression:
        """The gradient of L in the given derivative of y; shape (n, 1)."""
        return ca.gradient(self.expression, self.derivatives_of_y[derivative])

    def total_derivative(self, expression: Expression) -> Expression:
        """d/dx of an expression in x, y, y', ... along a curve."""
        tower = self.derivatives_of_y
        result = ca.jacobian(expression, self.symbols.x)
        for k in range(len(tower) - 1):
            result += ca.jtimes(expression, tower[k], tower[k + 1])
        return result

    @cached_property
    def momenta(self) -> list[Expression]:
        """Conjugate momenta: [L_y'] or, at second order, [L_y' - d/dx L_y'', L_y''].

        The boundary terms of the first variation are momenta[k] . delta y^(k).
        """
        if self.order == 1:
            return [self.partial(1)]
        return [self.partial(1) - self.total_derivative(self.partial(2)), self.partial(2)]

    @cached_property
    def euler_lagrange(self) -> Expression:
        """The Euler-Lagrange expression L_y - d/dx L_y' (+ d^2/dx^2 L_y''), shape (n, 1); zero on extremals."""
        return self.partial(0) - self.total_derivative(self.momenta[0])

    @cached_property
    def energy(self) -> Expression:
        """The first integral of a Lagrangian without x: the sum of y^(k+1) . momenta[k], less L.

        For order 1 this is y' L_y' - L, Beltrami's or Euler's second equation.
        """
        tower = self.derivatives_of_y
        products = [ca.dot(tower[k + 1], m) for k, m in enumerate(self.momenta)]
        return sum(products[1:], products[0]) - self.expression

    @cached_property
    def ignorable_abscissa(self) -> bool:
        """True when x does not occur in L, so that :attr:`energy` is constant on extremals."""
        return not ca.depends_on(self.expression, self.symbols.x)

    @cached_property
    def ignorable(self) -> tuple[int, ...]:
        """The unknown functions that do not occur in L themselves: their momentum is constant."""
        occurs = ca.which_depends(self.expression, self.symbols.y, 1, False)
        return tuple(i for i, used in enumerate(occurs) if not used)

    def highest_derivative(self) -> Expression:
        """y'' (order 1) or y'''' (order 2) solved from the Euler-Lagrange equation; shape (n, 1).

        Infinite or NaN where the Hessian in the highest slope is singular.
        """
        top = self.derivatives_of_y[-1]
        residual = self.euler_lagrange
        # the residual is affine in the highest derivative, though its expression may not show it (interpolated data)
        zero = ca.DM.zeros(*top.shape)
        matrix, rest = (ca.substitute(e, top, zero) for e in (ca.jacobian(residual, top), residual))
        if self.n == 1:
            return -rest / matrix
        return -ca.solve(matrix, rest)

    def pointwise(self, others: Sequence[Expression] = ()) -> ca.Function:
        """Values, gradients and Hessians of L and of ``others``, in one function of ``symbols.all``.

        The result has, for each expression, 1 + k + k^2 rows: value, gradient
        and Hessian by columns in the k variables (y, dy, ddy, unknowns).
        """
        s = self.symbols
        variables = ca.vertcat(s.y, *s.slopes, s.unknowns) if s.unknowns.numel() else ca.vertcat(s.y, *s.slopes)
        rows = []
        for expression in (self.expression, *others):
            hessian, gradient = ca.hessian(expression, variables)
            rows += [expression, gradient, ca.vec(ca.densify(hessian))]
        return ca.Function("pointwise", s.all, [ca.densify(ca.vertcat(*rows))])
