"""What a Lagrangian says by differentiation: momenta, energy, and the accelerations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.symbolic.names import with_names
from varcalc.symbolic.switches import switches
from varcalc.symbolic.tracing import LAST, Expression, called, check_arity, column, trace

PLACES = 12
"""Random places at which it is asked whether a matrix has full rank, or an identity holds."""
NO_INERTIA = 1e-11
"""Of the largest singular value of L_vv: one that is less belongs to a direction in which L has no inertia."""


@dataclass(frozen=True)
class StateSymbols:
    """Time, n coordinates, their rates and the parameters, as columns of CasADi symbols."""

    t: Expression
    q: Expression
    v: Expression
    p: Expression
    names: tuple[str, ...]

    @classmethod
    def of(cls, coordinates: int, parameters: Sequence[str]) -> StateSymbols:
        """For so many coordinates, and parameters of these names."""
        q, v = ca.SX.sym("q", coordinates), ca.SX.sym("v", coordinates)
        return cls(ca.SX.sym("t"), q, v, ca.SX.sym("p", len(parameters)), tuple(parameters))

    @property
    def all(self) -> list[Expression]:
        """As functions of the state take them."""
        return [self.t, self.q, self.v, self.p]

    def arguments(self, *columns: Expression) -> list[Expression]:
        """``columns`` and, where there are parameters, what a person's functions call p."""
        return with_names(columns, self.names, self.p)

    def traced(self, name: str, function: Callable[..., Any], *columns: Expression) -> Expression:
        """The scalar that a person's ``function`` makes of the columns, and p."""
        order = ("t", "q", "v")[: len(columns)] if len(columns) == 3 else ()
        return trace(name, function, self.arguments(*columns), ca.SX, "" if order else LAST, order)

    def function(self, value: Expression, *columns: Expression) -> Callable[..., Expression]:
        """A ``value`` as a person would write it: a function of the ``columns``, and p where there are parameters."""
        inner = ca.Function("value", [*columns, self.p], [value])

        def outer(*arguments: Any) -> Expression:
            """The value of the columns, and of p, the last, where there are parameters."""
            if not self.names:
                return inner(*arguments, ca.SX(0, 1))
            return inner(*arguments[:-1], ca.vertcat(*(getattr(arguments[-1], name) for name in self.names)))

        return outer

    def column(self, name: str, function: Callable[..., Any], size: int, *columns: Expression) -> Expression:
        """The column of ``size`` numbers that a person's ``function`` makes of the columns, and p."""
        arguments = self.arguments(*columns)
        check_arity(name, function, len(arguments), LAST)
        return column(name, called(name, function, arguments, ca.SX), size, "one for each coordinate")


@dataclass(frozen=True)
class Lagrange:
    """A Lagrangian ``value`` and what follows (Goldstein, Poole and Safko, "Classical Mechanics", ch. 1, 2)."""

    symbols: StateSymbols
    value: Expression
    forces: Expression

    @cached_property
    def momenta(self) -> Expression:
        """L_v (n,)."""
        return ca.densify(ca.gradient(self.value, self.symbols.v))

    @cached_property
    def mass(self) -> Expression:
        """L_vv (n, n)."""
        return ca.densify(ca.jacobian(self.momenta, self.symbols.v))

    @cached_property
    def energy(self) -> Expression:
        """v·L_v - L, Jacobi's integral; of an L of second degree in v without what is of first, which cancels.

        What switches with v is of no degree, though L_vv may be constant on either side.
        """
        v = self.symbols.v
        if ca.depends_on(self.mass, v) or any(s.depends_on(v) for s in switches([self.value], self.symbols.all)):
            return ca.dot(v, self.momenta) - self.value
        return ca.bilin(self.mass, v, v) / 2 - ca.substitute(self.value, v, ca.SX.zeros(v.numel()))

    @cached_property
    def pull(self) -> Expression:
        """L_q - L_vq v - L_vt and the forces (n,): what L_vv times the accelerations are, without constraints."""
        s = self.symbols
        rate = ca.jtimes(self.momenta, s.q, s.v) + ca.jacobian(self.momenta, s.t)
        return ca.densify(ca.gradient(self.value, s.q) - rate + self.forces)

    def solved(self, right: Expression) -> Expression:
        """L_vv⁻¹ times columns (n, k), by LDLᵀ: never by an inverse."""
        diagonal, upper, order = ca.ldl(self.mass, False)
        return ca.ldl_solve(right, diagonal, upper, order)

    def places(self, parameters: Mapping[str, float]) -> list[list[np.ndarray]]:
        """Random times, coordinates, rates, and the parameters, at which identities are put to the test."""
        rng, n = np.random.default_rng(1788), self.symbols.q.numel()
        numbers = np.array(list(parameters.values()), dtype=float)
        return [[rng.uniform(0, 1, 1), rng.uniform(0.2, 1, n), rng.uniform(-1, 1, n), numbers] for _ in range(PLACES)]

    def without_inertia(self, parameters: Mapping[str, float]) -> np.ndarray | None:
        """A direction (n,) in which L_vv has nothing at any of the places; None where it is regular."""
        mass = ca.Function("mass", self.symbols.all, [self.mass])
        worst: np.ndarray | None = None
        for place in self.places(parameters):
            matrix = np.array(mass(*place))
            if not np.all(np.isfinite(matrix)):
                continue
            _, sizes, rows = np.linalg.svd(matrix)
            if sizes[-1] > NO_INERTIA * max(sizes[0], 1e-300):
                return None
            worst = rows[-1] * np.sign(rows[-1][np.argmax(np.abs(rows[-1]))])
        return worst
