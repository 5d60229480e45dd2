"""The Euler-Lagrange equation of a form as an explicit first-order system, and the conditions on its ends.

Everything is scaled: t in [0, 1] for the form's interval, ordinates by
their size, so that an integrator's tolerance means the same for metres as for
1e7 of them. The state holds y, y' (and y'', y''' at second order) and the
running integrals of the functional, of the isoperimetric integrands and of the
derivatives of the Lagrangian function by the unknown numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.integrators import Variational, variational
from varcalc.problem.lagrangian import Lagrangian
from varcalc.symbolic.evaluation import PointEvaluator, in_columns
from varcalc.symbolic.tracing import Expression

INSIDE = 16 * float(np.finfo(float).eps)
"""Distance, relative to the abscissae, at which an integrand is taken to be on one side of a knot."""


@dataclass(frozen=True)
class Scales:
    """Units: of the ordinates (n,), and of the running integrals (q,)."""

    ordinates: np.ndarray
    integrals: np.ndarray

    @property
    def all(self) -> np.ndarray:
        """Both, one after the other."""
        return np.concatenate([self.ordinates, self.integrals])


@dataclass(frozen=True)
class EulerLagrangeFlow:
    """The system of a form in CasADi's terms.

    The Lagrangian function is integrand + sum of lambda_j g_j over the
    isoperimetric conditions. ``dimension`` D is the number of states that
    are not integrals.
    """

    form: Form
    lambdas: Expression = field(init=False)
    lagrangian: Lagrangian = field(init=False)

    def __post_init__(self) -> None:
        kind = self.form.symbols.kind
        lambdas = kind.sym("lambda", len(self.form.conditions.integrals))
        expression = self.form.integrand
        for j, condition in enumerate(self.form.conditions.integrals):
            expression = expression + lambdas[j] * condition.expression
        object.__setattr__(self, "lambdas", lambdas)
        object.__setattr__(self, "lagrangian", Lagrangian(self.form.symbols, expression))

    @cached_property
    def dimension(self) -> int:
        """Number of states D = 2 order n."""
        return 2 * self.form.order * self.form.n

    @cached_property
    def unknowns(self) -> int:
        """Number of unknown numbers of the form."""
        return int(self.form.symbols.unknowns.numel())

    @cached_property
    def integrals(self) -> int:
        """Number of running integrals: the functional, the isoperimetric ones, one for each unknown number."""
        return 1 + len(self.form.conditions.integrals) + self.unknowns

    @property
    def numbers(self) -> list[Expression]:
        """Symbols of what is constant along the curve: parameters, unknowns, lambdas."""
        return [self.form.symbols.parameters, self.form.symbols.unknowns, self.lambdas]

    @cached_property
    def tower(self) -> list[Expression]:
        """Symbols y, y', ... up to one below the highest derivative in the equation."""
        return self.lagrangian.derivatives_of_y[:-1]

    def line(self, left: float, right: float, apart: tuple[bool, bool]) -> np.ndarray:
        """Origin and stretch of s = origin + stretch t on a segment between ``left`` and ``right`` (in t).

        At an end that is to be kept ``apart`` (a knot, where the integrand may
        jump) s is squeezed into the segment by :attr:`inset`.
        """
        a, width = self.form.span[0], self.form.span[1] - self.form.span[0]
        first, last = a + width * left + self.inset * apart[0], a + width * right - self.inset * apart[1]
        stretch = (last - first) / (right - left) if any(apart) else width
        return np.array([first - stretch * left if any(apart) else a, stretch])

    @cached_property
    def inset(self) -> float:
        """How far from a knot or an end the integrand is evaluated, in units of s."""
        a, b = self.form.span
        return INSIDE * max(abs(a), abs(b), b - a)

    def function(self, name: str, outputs: list[Expression]) -> ca.Function:
        """A function (s, y, y', ..., parameters, unknowns, lambdas) -> outputs."""
        arguments = [self.form.symbols.x, *self.tower, *self.numbers]
        return ca.Function(name, arguments, [ca.densify(o) for o in outputs])

    @cached_property
    def highest(self) -> ca.Function:
        """y'' (order 1) or y'''' (order 2) on extremals."""
        return self.function("highest", [self.lagrangian.highest_derivative()])

    @cached_property
    def linear(self) -> bool:
        """True when the equation is affine in the state and nothing else is unknown, so that one step solves it."""
        if self.form.conditions.integrals or self.form.ends.joint is not None or self.unknowns:
            return False
        state = ca.vertcat(*self.tower)
        joined = self.form.symbols.kind.sym("state", state.numel())
        top = ca.substitute([self.lagrangian.highest_derivative()], self.tower, ca.vertsplit(joined, self.form.n))[0]
        return not any(ca.which_depends(top, joined, 2, True))

    @cached_property
    def momenta(self) -> ca.Function:
        """The momenta, one column after the other: L_y' (order 1), or L_y' - d/dx L_y'' and L_y''."""
        return self.function("momenta", [ca.vertcat(*self.lagrangian.momenta)])

    @cached_property
    def densities(self) -> ca.Function:
        """What is integrated along the curve."""
        terms = [self.form.functional, *(c.expression for c in self.form.conditions.integrals)]
        by_unknowns = ca.gradient(self.lagrangian.expression, self.form.symbols.unknowns)
        return self.function("densities", [ca.vertcat(*terms, by_unknowns)])

    def densities_roughly(self, s: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """What is integrated, at s (m,), by the form's first numbers and straight on as far as derivatives go."""
        form = self.form
        numbers = [form.problem.parameter_values, form.start.unknowns, np.zeros(len(form.conditions.integrals))]
        higher = [np.zeros_like(slopes)] * (2 * form.order - 2)
        return np.asarray(self.densities(s[None, :], y, slopes, *higher, *in_columns(len(s), *numbers)))

    @cached_property
    def residual(self) -> ca.Function:
        """The Euler-Lagrange expression of (s, y, ..., highest derivative, parameters, unknowns, lambdas)."""
        arguments = [self.form.symbols.x, *self.lagrangian.derivatives_of_y, *self.numbers]
        return ca.Function("residual", arguments, [ca.densify(self.lagrangian.euler_lagrange)])

    # scaled -------------------------------------------------------------------------------------------------

    def _scaled(self) -> tuple[Expression, Expression, Expression, list[Expression]]:
        """Symbols of the scaled system: t, the state, the units, and the constants of :attr:`numbers`."""
        kind, n = self.form.symbols.kind, self.form.n
        units = kind.sym("units", n + self.integrals)
        return kind.sym("t"), kind.sym("Y", self.dimension + self.integrals), units, [
            kind.sym("constant", e.numel()) for e in self.numbers
        ]  # fmt: skip

    def derivatives(self, state: Expression, ordinates: Expression) -> list[Expression]:
        """y, y', ... in the form's units from a scaled state, symbols or numbers alike; each (n,) or (n, m)."""
        n, width = self.form.n, self.form.span[1] - self.form.span[0]
        return [state[k * n : (k + 1) * n] * ordinates / width**k for k in range(2 * self.form.order)]

    @cached_property
    def scaled(self) -> ca.Function:
        """The scaled system (t, Y (D + integrals,), constants) -> dY/dt.

        The constants are origin and stretch, units, parameters, unknowns,
        lambdas; the integrand is evaluated at s = origin + stretch t.
        """
        form, n = self.form, self.form.n
        width = form.span[1] - form.span[0]
        t, state, units, numbers = self._scaled()
        line = form.symbols.kind.sym("line", 2)
        arguments = [line[0] + line[1] * t, *self.derivatives(state, units[:n]), *numbers]
        top = self.highest(*arguments) * width ** (2 * form.order) / units[:n]
        rates = self.densities(*arguments) * width / units[n:]
        slope = ca.vertcat(state[n : self.dimension], top, rates)
        return ca.Function("extremal", [t, state, ca.vertcat(line, units, *numbers)], [ca.densify(slope)])

    @cached_property
    def system(self) -> Variational:
        """The scaled system with its variational equations by the states, the unknowns and the lambdas."""
        constants = self.scaled.numel_in(2)
        free = range(constants - self.unknowns - len(self.form.conditions.integrals), constants)
        return variational(self.scaled, range(self.dimension), list(free))

    @cached_property
    def _linearised(self) -> PointEvaluator:
        """The scaled system (t, Y, constants) -> dY/dt, its derivatives by the D states, by unknowns and lambdas."""
        t, state, units, numbers = self._scaled()
        constants = [self.form.symbols.kind.sym("line", 2), units, *numbers]
        slope = self.scaled(t, state, ca.vertcat(*constants))
        by_state = ca.jacobian(slope, state)[:, : self.dimension]
        by_numbers = ca.jacobian(slope, ca.vertcat(*numbers[1:]))
        outputs = [ca.densify(v) for v in (slope, by_state, by_numbers)]
        return PointEvaluator(ca.Function("linearised", [t, state, ca.vertcat(*constants)], outputs))

    def linearised(
        self, t: np.ndarray, states: np.ndarray, constants: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """dY/dt (m, N) at t (m,) and states (m, N), its derivatives (m, N, D) by the states, (m, N, p) by the rest."""
        m, size = states.shape
        table = self._linearised(m, t[:, None], states, constants[None, :])
        by_state, by_numbers = (
            part.reshape(m, -1, size).swapaxes(1, 2)
            for part in np.split(table[:, size:], [size * self.dimension], axis=1)
        )
        return table[:, :size], by_state, by_numbers

    def _with_jacobian(self, name: str, known: list[Expression], varied: list[Expression], residual: Expression) -> Any:
        columns = ca.vertcat(*varied)
        return ca.Function(name, [*known, *varied], [ca.densify(residual), ca.jacobian(residual, columns)])

    def _momenta_at(self, s: Any, state: Expression, units: Expression, numbers: list[Expression]) -> list[Expression]:
        n = self.form.n
        column = self.momenta(s, *self.derivatives(state, units[:n]), *numbers)
        return [column[k * n : (k + 1) * n] for k in range(self.form.order)]

    @cached_property
    def end_equations(self) -> int:
        """Number of equations between the ends, each with its multiplier."""
        return self.form.ends.equations

    @cached_property
    def conditions(self) -> ca.Function:
        """All that ties the ends, the integrals and the unknown numbers together.

        (units, parameters, state at start, state at end, totals, unknowns,
        lambdas, nus) -> residual (D + end equations + unknowns + lambdas,)
        and its Jacobian by everything after the parameters. Free components
        have natural conditions, with the cost and equations of the ends.
        """
        form, n, kind = self.form, self.form.n, self.form.symbols.kind
        _, _, units, numbers = self._scaled()
        first, last = kind.sym("first", self.dimension), kind.sym("last", self.dimension)
        totals, nus = kind.sym("totals", self.integrals), kind.sym("nu", self.end_equations)
        towers = [self.derivatives(z, units[:n]) for z in (first, last)]
        cost, equations = self._end_terms(towers, numbers, nus)
        rows = self._boundary_rows(first, last, towers, units, numbers, cost)
        rows.append(equations)
        real = totals * units[n:]
        rows.append(real[1 + len(form.conditions.integrals) :, :] + cost[2])
        rows += [real[1 + j] - c.lower for j, c in enumerate(form.conditions.integrals)]
        return self._with_jacobian(
            "conditions", [units, numbers[0]], [first, last, totals, numbers[1], numbers[2], nus], ca.vertcat(*rows)
        )

    @cached_property
    def _conditions(self) -> PointEvaluator:
        return PointEvaluator(self.conditions)

    def closed(self, *arguments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual (R,) of :attr:`conditions` and its Jacobian (R, ..), the arguments being flat."""
        row = self._conditions(1, *arguments)[0]
        count = self.conditions.numel_out(0)
        return row[:count], row[count:].reshape(-1, count).T

    def _end_terms(
        self, towers: list[list[Expression]], numbers: list[Expression], nus: Expression
    ) -> tuple[list[Expression], Expression]:
        """The gradients of cost + nu . equations by y(start), y(end) and unknowns, and the equations."""
        form, kind, n = self.form, self.form.symbols.kind, self.form.n
        if form.ends.joint is None:
            return [kind(n, 1), kind(n, 1), kind(self.unknowns, 1)], kind(0, 1)
        e = form.ends.joint
        symbols = [e.start, e.end, form.symbols.unknowns]
        total = e.cost + ca.dot(nus, e.equations) if self.end_equations else e.cost
        gradients = [ca.densify(ca.gradient(total, v)) for v in symbols]
        function = ca.Function("ends", [*symbols, form.symbols.parameters, nus], [*gradients, ca.densify(e.equations)])
        *out, equations = function.call([towers[0][0], towers[1][0], numbers[1], numbers[0], nus])
        return out, equations

    def _boundary_rows(
        self,
        first: Expression,
        last: Expression,
        towers: list[list[Expression]],
        units: Expression,
        numbers: list[Expression],
        cost: list[Expression],
    ) -> list[Expression]:
        form = self.form
        (a, b), order, inset = form.span, form.order, self.inset
        momenta = [self._momenta_at(s, z, units, numbers) for s, z in ((a + inset, first), (b - inset, last))]
        for k, (sign, end) in enumerate(((-1, 0), (1, 1))):
            momenta[end][0] = sign * momenta[end][0] + cost[k]
            if order == 2:
                momenta[end][1] = sign * momenta[end][1]
        if form.ends.periodic:
            equal = [(towers[1][k] - towers[0][k]) / units[: form.n] for k in range(order)]
            return equal + [momenta[0][k] + momenta[1][k] for k in range(order)]
        rows = []
        for tower, fixed, momentum in (
            (towers[0], form.ends.start, momenta[0]),
            (towers[1], form.ends.end, momenta[1]),
        ):
            for k in range(order):
                for i in range(form.n):
                    free = np.isnan(fixed[k, i])
                    rows.append(momentum[k][i] if free else (tower[k][i] - fixed[k, i]) / units[i])
        return rows

    def knot(self, s: float, demanded: tuple[float, ...] | None) -> ca.Function:
        """What ties the states on the two sides of a knot (Weierstrass and Erdmann's corner condition).

        (units, parameters, state left, state right, unknowns, lambdas) ->
        residual (D,) and its Jacobian by everything after the parameters.
        y, and y' at second order, are continuous, and so are the momenta;
        where a waypoint demands a value it takes the place of the momentum's
        continuity.
        """
        form, n, kind = self.form, self.form.n, self.form.symbols.kind
        _, _, units, numbers = self._scaled()
        left, right = kind.sym("left", self.dimension), kind.sym("right", self.dimension)
        sides = [
            self._momenta_at(s + shift, z, units, numbers) for shift, z in ((-self.inset, left), (self.inset, right))
        ]
        rows = [left[: form.order * n] - right[: form.order * n]]
        for k in range(form.order):
            for i in range(n):
                value = demanded[i] if demanded is not None and k == 0 else None
                rows.append(sides[0][k][i] - sides[1][k][i] if value is None else left[i] - value / units[i])
        return self._with_jacobian(
            "knot", [units, numbers[0]], [left, right, numbers[1], numbers[2]], ca.vertcat(*rows)
        )
