"""What a certificate is about: a functional of states and controls, near one curve.

A Lagrangian of order one has the states z = y and the controls u = y', one of order two z = (y, y') and u = y''.
Unknown numbers are states that do not change. Always z' = A z + B u with constant A and B, so that one theorem serves
(Clarke, "Functional Analysis, Calculus of Variations and Optimal Control", Springer 2013, ch. 22 and 23).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, Series, flint
from varcalc.certificates.cost import Cost
from varcalc.certificates.degree import degrees
from varcalc.certificates.jets import ABSCISSA, Jet, Switch, jets, switches_between
from varcalc.certificates.splines import spline
from varcalc.symbolic.instructions import Call, Program
from varcalc.verify.along_curve import AlongCurve


@dataclass(frozen=True)
class Statement:
    """The Lagrangian function H along one curve, what its ends are held at, and its dimensions.

    ``along`` is the curve, in the minimising sense. ``held[e]`` and ``values[e]`` tell for the start (0) and the end
    (1) which of the m states are given, and their values (NaN where they are free). ``multipliers`` and
    ``weights`` are those of the equations between the ends, see :class:`Cost`. ``beside`` is an expression
    that is added to H.
    """

    along: AlongCurve
    held: tuple[np.ndarray, np.ndarray]
    values: tuple[np.ndarray, np.ndarray]
    multipliers: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    beside: Any = 0

    def of_another(self, along: AlongCurve) -> Statement:
        """The same of another curve, with its own numbers and multipliers of levels; expressions are kept."""
        found = replace(self, along=along, multipliers=(), weights=())
        kept = ("_written", "function", "derivatives", "program", "_level_function", "_level_program")
        found.__dict__.update({name: self.__dict__[name] for name in kept if name in self.__dict__})
        return found

    @cached_property
    def n(self) -> int:
        """Number of unknown functions, and of controls."""
        return self.along.n

    @cached_property
    def order(self) -> int:
        """Highest derivative in the Lagrangian."""
        return self.along.order

    @cached_property
    def levels(self) -> int:
        """Number of prescribed integrals: each, up to x, is a state too, the last of them."""
        return len(self.along.integrals)

    @cached_property
    def bare(self) -> int:
        """Number of states that H depends on."""
        return self.n * self.order + len(self.along.numbers)

    @cached_property
    def states(self) -> int:
        """Number m of states."""
        return self.bare + self.levels

    @property
    def periodic(self) -> bool:
        """Whether both ends are one."""
        return self.along.form.ends.periodic > 0

    @cached_property
    def cost(self) -> Cost | None:
        """What the ends cost, if anything, with the equations between them."""
        form = self.along.form
        return None if form.ends.joint is None else Cost(form, self.multipliers, self.weights)

    @property
    def waypoints(self) -> dict[float, np.ndarray]:
        """The functions' values demanded at abscissae, NaN where they are not."""
        return {at: np.asarray(values, dtype=float) for at, values in self.along.form.conditions.waypoints}

    @cached_property
    def _written(self) -> tuple[Fraction, Any]:
        """A factor, and H over it as an expression; for a length, the square of its integrand."""
        form = self.along.form
        energetic = form.coordinates.energetic
        factor, written = squared(form.functional) if energetic else (Fraction(1), self.along.whole.expression)
        return factor, written + self.beside

    @property
    def lagrangian(self) -> Any:
        """H as an expression, less a constant factor; of a length, of the square of its integrand."""
        return self._written[1]

    @property
    def factor(self) -> Ball:
        """The square of a length over the integral of :attr:`lagrangian`."""
        factor = self._written[0]
        return flint().arb(factor.numerator) / factor.denominator

    @cached_property
    def function(self) -> ca.Function:
        """H of all symbols, and of the multipliers."""
        along = self.along
        arguments = [*along.symbols.all, *along.multiplier_symbols]
        # what the Lagrangian and a level share is one: y sqrt(1 + v^2) + lambda sqrt(1 + v^2)
        return ca.Function("H", arguments, [ca.cse(ca.densify(self.lagrangian))])

    @cached_property
    def variables(self) -> Any:
        """The symbols of the states and the controls, in one column."""
        s = self.along.symbols
        return ca.vertcat(s.y, *s.slopes[:-1], s.unknowns, s.slopes[-1])

    @cached_property
    def hessian(self) -> Any:
        """The matrix of second derivatives of H by :attr:`variables`, as CasADi states it."""
        return ca.hessian(self.lagrangian, self.variables)[0]

    @cached_property
    def quadratic(self) -> bool:
        """Whether H is of second degree and all rates of first, so that what holds in a tube holds everywhere."""
        costs = self.cost is None or self.cost.quadratic
        return costs and self._degree(True, True) <= 2.0 and self.bent <= 1.0

    @cached_property
    def quadratic_in_controls(self) -> bool:
        """Whether H is of second degree in the controls, and what is integrated to levels of first in all."""
        return self._degree(False, True) <= 2.0 and self.bent <= 1.0

    @cached_property
    def of_second_degree(self) -> bool:
        """Whether H and what is integrated to levels are of second degree at most."""
        return self._degree(True, True) <= 2.0 and self.bent <= 2.0

    def _degree(self, states: bool, controls: bool) -> float:
        return degrees(self.function, self._watched(states, controls))[0][0]

    @cached_property
    def bent(self) -> float:
        """The degree of what is integrated to levels; 1 at most where that is linear."""
        if not self.levels:
            return 0.0
        return max(degrees(self._level_function, self._watched(True, True))[0])

    def _watched(self, states: bool, controls: bool) -> list[list[bool]]:
        """Which entries of the arguments of H are watched."""
        first, second = (states, controls) if self.order == 2 else (controls, False)
        s = self.along.symbols
        flags = [False, states, first, second, False, states, False, False]
        arguments = [*s.all, *self.along.multiplier_symbols]
        return [[flag] * int(a.numel()) for flag, a in zip(flags, arguments, strict=True)]

    @cached_property
    def _level_slopes(self) -> Any:
        """The gradients of what is integrated to levels, one below the other."""
        return ca.jacobian(ca.vertcat(*self.along.integrals), self.variables)

    @cached_property
    def derivatives(self) -> ca.Function:
        """H's gradient and Hessian by :attr:`variables`, and :attr:`_level_slopes`, for numbers that are not exact."""
        parts = [ca.gradient(self.lagrangian, self.variables), ca.vec(self.hessian), ca.vec(self._level_slopes.T)]
        arguments = [*self.along.symbols.all, *self.along.multiplier_symbols]
        return ca.Function("derivatives", arguments, list(map(ca.densify, parts)))

    def sampled(
        self, x: np.ndarray, states: np.ndarray, controls: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """At p points, states without levels (b, p) and controls (n, p): the gradient (p, b + n) of H, its Hessian.

        The Hessian (p, m + n, m + n) is by all states; last come the gradients (p, levels, b + n) of the levels.
        """
        n, m = self.n, self.bare
        gradient, hessian, slopes_of = (np.asarray(v).T for v in self._called(self.derivatives, x, states, controls))
        full = np.zeros((len(x), n + self.states, n + self.states))
        own = np.r_[0:m, self.states : self.states + n]
        full[:, own[:, None], own] = hessian.reshape(len(x), n + m, n + m)
        return gradient, full, slopes_of.reshape(len(x), self.levels, n + m)

    def _called(self, function: ca.Function, x: np.ndarray, states: np.ndarray, controls: np.ndarray) -> list[Any]:
        n = self.n
        slopes = [states[n : 2 * n], controls] if self.order == 2 else [controls, np.zeros((0, len(x)))]
        constant = [self.along.form.problem.parameter_values, self.along.lambdas]
        parameters, lambdas = (np.repeat(np.asarray(v, dtype=float)[:, None], len(x), axis=1) for v in constant)
        found: Any = function.call(
            [x[None], states[:n], *slopes, parameters, states[n * self.order :], lambdas, np.zeros((0, len(x)))]
        )
        return found

    @cached_property
    def knots(self) -> list[float]:
        """Knots between the ends of tables that are looked up at the abscissa itself."""
        abscissa, found, (a, b) = set[int](), set[float](), self.along.span
        for i in self.program.steps:
            if isinstance(i.operation, Call):
                read = spline(i.operation.function) if set(i.sources) <= abscissa else None
                found |= set() if read is None else set(read.knots.tolist())
            elif i.operation == ca.OP_INPUT and i.sources == (0, 0):
                abscissa.add(i.target)
                continue
            abscissa.discard(i.target)
        return sorted(k for k in found if a < k < b)

    def level_rates(self, x: np.ndarray, states: np.ndarray, controls: np.ndarray) -> np.ndarray:
        """What is integrated to levels at p points, (p, levels); states without levels, for numbers not exact."""
        return np.asarray(self._called(self._level_function, x, states, controls)[0]).T

    @cached_property
    def program(self) -> Program:
        """The instructions of H."""
        return Program(self.function)

    def switches(self, centre: Ball, half: Ball) -> list[Switch]:
        """Signs of what H switches on, where these hang on x alone, between two abscissae."""
        found = flint()
        # of any size, but marked as variables: what depends on them is told by its derivatives
        unknown = [Jet(found.arb_series([1], 4), {i: found.arb(1)}) for i in range(self.bare + self.n)]
        x = Jet(found.arb_series([centre, half], 4), {ABSCISSA: found.arb(1)})
        return switches_between(self.program, self.arguments(x, unknown[: self.bare], unknown[self.bare :]))

    def jet(
        self,
        x: Series,
        states: Sequence[Series],
        controls: Sequence[Series],
        order: int,
        switches: Sequence[Switch],
        *,
        crossing: bool = False,
    ) -> Jet:
        """H in balls; derivatives by the states are numbered from 0, those by the controls follow.

        ``crossing`` is that of :func:`jets`.
        """
        arguments = self._variables(x, states, controls, order)
        return jets(self.program, arguments, order, switches, crossing=crossing)[0][0]

    def level_jets(self, x: Series, states: Sequence[Series], controls: Sequence[Series], order: int) -> list[Jet]:
        """What is integrated to levels, in balls, numbered as in :meth:`jet`."""
        return jets(self._level_program, self._variables(x, states, controls, order), order)[0] if self.levels else []

    @cached_property
    def _level_program(self) -> Program:
        return Program(self._level_function)

    @cached_property
    def _level_function(self) -> ca.Function:
        arguments = [*self.along.symbols.all, *self.along.multiplier_symbols]
        return ca.Function("levels", arguments, [ca.densify(ca.vertcat(*self.along.integrals))])

    def _variables(
        self, x: Series, states: Sequence[Series], controls: Sequence[Series], order: int
    ) -> list[list[Jet]]:
        z = [Jet(value, {i: flint().arb(1)} if order else None) for i, value in enumerate(states)]
        u = [Jet(value, {self.bare + i: flint().arb(1)} if order else None) for i, value in enumerate(controls)]
        return self.arguments(Jet(x), z, u)

    @cached_property
    def _fixed(self) -> tuple[list[Jet], list[Jet]]:
        """The parameters and the multipliers."""
        values = self.along.form.problem.parameter_values, self.along.lambdas
        parameters, lambdas = ([Jet(flint().arb(float(v))) for v in row] for row in values)
        return parameters, lambdas

    def arguments(self, x: Jet, z: list[Jet], u: list[Jet]) -> list[list[Jet]]:
        """What H takes."""
        n = self.n
        y, slopes, numbers = z[:n], z[n : n * self.order], z[n * self.order :]
        parameters, lambdas = self._fixed
        first, second = (slopes, u) if self.order == 2 else (u, [])
        return [[x], y, first, second, parameters, numbers, lambdas, []]


def squared(expression: Any) -> tuple[Fraction, Any]:
    """The square of an SX expression, as an exact factor and the rest: of roots without the roots, factor by factor.

    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> squared(-3 * ca.sqrt(x) / y)
    (Fraction(9, 1), SX((x/sq(y))))
    """
    return _factored(expression, 2)


def _factored(expression: Any, power: int) -> tuple[Fraction, Any]:
    """A power 1 or 2 of an SX expression, as an exact factor and the rest."""
    e = expression
    if e.is_constant() and math.isfinite(float(e)):
        return Fraction(float(e)) ** power, ca.SX(1)
    if e.is_op(ca.OP_TWICE) or (power == 2 and e.is_op(ca.OP_NEG)):
        factor, rest = _factored(e.dep(0), power)
        return (2**power if e.is_op(ca.OP_TWICE) else 1) * factor, rest
    if e.is_op(ca.OP_MUL) or e.is_op(ca.OP_DIV):
        (a, left), (b, right) = (_factored(e.dep(k), power) for k in (0, 1))
        if e.is_op(ca.OP_MUL):
            return a * b, left * right
        if b:
            return a / b, left / right
    if (power == 1 and e.is_op(ca.OP_SQ)) or (power == 2 and e.is_op(ca.OP_SQRT)):
        return squared(e.dep(0)) if power == 1 else _factored(e.dep(0), 1)
    return Fraction(1), e if power == 1 else e**2


def statement(along: AlongCurve, beside: Any = 0) -> Statement:
    """The statement of a curve, with an expression added to H."""
    ends, free = along.form.ends, np.full(len(along.numbers), np.nan)
    start, end = (
        np.r_[np.asarray(given)[: along.order].ravel(), free, np.zeros(len(along.integrals))]
        for given in (ends.start, ends.end)
    )
    return Statement(along, (~np.isnan(start), ~np.isnan(end)), (start, end), beside=beside)
