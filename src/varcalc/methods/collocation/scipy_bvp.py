"""A second opinion: SciPy's ``solve_bvp`` on the Euler-Lagrange equation.

SciPy's solver is a collocation code of fourth order with residual control
(Kierzenka and Shampine, "A BVP solver based on residual control and the MATLAB
PSE", ACM TOMS 27 (2001)). Its own claim of success is not trusted, as just
beyond a fold it claims success where there is no solution: every curve it
gives is assessed like one of :class:`varcalc.Collocation`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.collocation.error import Assessment, Root, assess
from varcalc.methods.collocation.newton import Sizes
from varcalc.methods.collocation.refinement import Improved
from varcalc.methods.collocation.starting_curves import function_sizes, starting_curves
from varcalc.methods.collocation.stationarity import Stationarity, stationarity
from varcalc.methods.collocation.system import CollocationSystem, State, collocation_space
from varcalc.problem.conditions import whole
from varcalc.problem.lagrangian import Lagrangian
from varcalc.showing import Brief
from varcalc.solution import Solution, Stats, Status, no_answer
from varcalc.spelling import spelled

FIRST_NODES = 17
RESIDUALS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Tolerances handed to SciPy, one after the other, until the value is good enough."""


@spelled
@dataclass(frozen=True, repr=False)
class SciPyBvp(Brief):
    """Solve the Euler-Lagrange equation by SciPy's ``solve_bvp`` with at most ``nodes`` nodes.

    For problems without corners, prescribed integrals, pathwise conditions,
    unknown numbers and sliding ends; others are refused. Raises ValueError for
    fewer than two nodes.
    """

    nodes: int = 1000

    def __post_init__(self) -> None:
        whole("SciPyBvp.nodes", self.nodes, least=2)

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """A stationary curve of ``form``, the first that SciPy finds and that holds; see :func:`varcalc.solve`."""
        problem = form.problem
        started = time.perf_counter()
        reason = inapplicable(form)
        if reason:
            return no_answer(problem, self, Status.REFUSED, reason)
        boundary = BoundaryValueProblem(form)
        built = time.perf_counter() - started
        curves = [start.curve for start in starting_curves(form)]
        last = "SciPy's solve_bvp found no solution"
        for curve in curves if guess is None else [guess, *curves]:
            found = self._refined(boundary, curve, tol)
            if isinstance(found, str):
                last = found
                continue
            level, assessment = found
            space = level.system.space
            stats = Stats(
                built, time.perf_counter() - started - built, boundary.calls, level.system.size,
                space.elements, space.degree,
            )  # fmt: skip
            return Improved(level, assessment, Status.SOLVED).solution(self, stats)
        stats = Stats(built, time.perf_counter() - started - built, boundary.calls)
        return no_answer(problem, self, Status.NOT_CONVERGED, last, stats=stats)

    def _refined(self, boundary: BoundaryValueProblem, curve: Sampled, tol: float) -> tuple[Root, Assessment] | str:
        """The curve for the loosest residual that meets ``tol``, or why there is none."""
        nodes = np.linspace(*boundary.form.span, FIRST_NODES)
        tower = boundary.first_tower(curve, nodes)
        if not np.isfinite(tower).all():
            return "the starting curves are not numbers everywhere"
        reason = "SciPy's solve_bvp found no solution"
        for residual in RESIDUALS:
            result = boundary.solve(nodes, tower, residual, self.nodes)
            if not (result.success and np.isfinite(result.y).all()):
                return f"SciPy's solve_bvp gave up: {result.message}"
            nodes, tower = result.x, result.y
            level = boundary.level(nodes, tower)
            assessment = assess(level, boundary.scales)
            if assessment is None or not assessment.trusted:
                reason = "SciPy's solve_bvp claims success, but no extremal is near its curve"
            elif assessment.value_error <= tol * max(1.0, abs(assessment.value)):
                return level, assessment
            else:
                reason = f"solve_bvp's curve has a value error of {assessment.value_error:.1e}, above the tolerance"
        return reason


def inapplicable(form: Form) -> str:
    """Why the method cannot treat a form; empty when it can."""
    if form.coordinates.weak_only or any(form.coordinates.singular):
        return "the equation is singular at an end, where solve_bvp evaluates it; use Collocation or Ritz"
    if form.conditions.integrals or form.conditions.pathwise:
        return "prescribed integrals and pathwise conditions are not treated; use Collocation or Ritz"
    if form.conditions.knots:
        return "breakpoints and waypoints are not treated; use Collocation or Ritz"
    if len(form.start.unknowns):
        return "unknown numbers (sliding ends, unknowns) are not treated; use Collocation or Ritz"
    return ""


class BoundaryValueProblem:
    """The Euler-Lagrange equation of a form as a first-order system in (y, y', ..), with its boundary conditions."""

    def __init__(self, form: Form) -> None:
        self.form = form
        self.conditions: Stationarity = stationarity(form)
        self.scales = Sizes(function_sizes(form), np.zeros(0))
        self.parameters = form.problem.parameter_values
        self.calls = 0
        lagrangian = Lagrangian(form.symbols, form.integrand)
        tower = lagrangian.derivatives_of_y[:-1]
        self.depth = len(tower)
        state = ca.vertcat(*tower)
        highest = lagrangian.highest_derivative()
        inputs = [form.symbols.x, *tower, form.symbols.parameters]
        rate = ca.vertcat(*tower[1:], highest)
        self._rate = ca.Function("rate", inputs, [ca.densify(rate), ca.densify(ca.jacobian(rate, state))])

    def _columns(self, s: np.ndarray, tower: np.ndarray) -> list[np.ndarray]:
        parts = tower.reshape(self.depth, self.form.n, -1)
        return [s[None, :], *parts, np.repeat(self.parameters[:, None], len(s), axis=1)]

    def rate(self, s: np.ndarray, tower: np.ndarray) -> np.ndarray:
        """d/ds of (y, y', ..), shape (depth n, m)."""
        self.calls += 1
        out: Any = self._rate(*self._columns(s, tower))
        return np.asarray(out[0])

    def jacobian(self, s: np.ndarray, tower: np.ndarray) -> np.ndarray:
        """Its derivative by (y, y', ..), shape (depth n, depth n, m)."""
        out: Any = self._rate(*self._columns(s, tower))
        size = self.depth * self.form.n
        return np.asarray(out[1]).reshape(size, len(s), size).transpose(0, 2, 1)

    def conditions_at(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """What vanishes at the ends: fixed values and natural or periodic conditions, shape (depth n,)."""
        form, n, m = self.form, self.form.n, self.form.order
        fixed = [np.concatenate([form.ends.start.ravel(), form.ends.end.ravel()])]
        given = np.concatenate([first[: m * n], last[: m * n]])
        if self.conditions.momentum is None:
            return given - fixed[0]
        momentum = np.array([-self._momenta(form.span[0], first), self._momenta(form.span[1], last)])
        if self.conditions.ends is not None:
            out: Any = self.conditions.ends(first[:n], last[:n], self.parameters, [], [])
            momentum[:, :n] += np.asarray(out[0]).reshape(2, n)
        if form.ends.periodic:
            return np.concatenate([first[: m * n] - last[: m * n], momentum.sum(0)])
        return np.where(np.isnan(fixed[0]), momentum.ravel(), given - fixed[0])

    def _momenta(self, s: float, tower: np.ndarray) -> np.ndarray:
        assert self.conditions.momentum is not None
        out: Any = self.conditions.momentum(s, *tower.reshape(self.depth, -1), self.parameters, [], [])
        return np.asarray(out).ravel()[: self.form.order * self.form.n]

    def first_tower(self, curve: Sampled, nodes: np.ndarray) -> np.ndarray:
        """A starting curve and its derivatives by differences, shape (depth n, m)."""
        rows = [curve(nodes)]
        for _ in range(self.depth - 1):
            rows.append(np.gradient(rows[-1], nodes, axis=1, edge_order=2))
        return np.vstack(rows)

    def solve(self, nodes: np.ndarray, tower: np.ndarray, residual: float, most: int) -> Any:
        """SciPy's result for one tolerance of its residual."""
        from scipy.integrate import solve_bvp

        with np.errstate(all="ignore"):
            return solve_bvp(
                self.rate, self.conditions_at, nodes, tower, fun_jac=self.jacobian, tol=residual, max_nodes=most
            )

    def level(self, nodes: np.ndarray, tower: np.ndarray) -> Root:
        """SciPy's piecewise polynomial as a state of a collocation system on its mesh, not a root of it."""
        space = collocation_space(self.form, nodes, 4 * self.form.order - 1)
        system = CollocationSystem(self.form, space)
        m = space.smoothness
        values = tower.reshape(m, self.form.n, -1) * space.vertex_scale ** np.arange(m)[:, None, None]
        coefficients = np.zeros(space.size)
        coefficients[space.numbers[:, :m]] = values[:, :, :-1].transpose(2, 0, 1)
        coefficients[space.numbers[:, m : 2 * m]] = values[:, :, 1:].transpose(2, 0, 1)
        nothing = np.zeros(0)
        z = system.pack(State(coefficients, nothing, nothing, nothing, nothing))
        return Root(system, z, system.evaluate(z))
