"""A problem's integrands in homogeneous form, ready for quadrature."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.methods.first_integral.homogeneous import homogeneous
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.problem import Problem
from varcalc.symbolic.evaluation import Columns, PointEvaluator
from varcalc.symbolic.tracing import Expression


@dataclass
class Stopwatch:
    """Adds up the ``seconds`` spent inside its ``with`` blocks, which must not be nested."""

    seconds: float = 0.0
    started: float = 0.0

    def __enter__(self) -> None:
        self.started = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self.started


@dataclass(frozen=True)
class ReducedIntegrands:
    """L and the isoperimetric integrands of a problem with one unknown function, its parameters put in.

    ``scale`` is a typical slope. ``forms`` are L and the g_j times dx for
    (dx, dy) = (c, scale * s), and ``partials`` the derivatives of each by the
    problem's parameters. The Lagrangian function is L + sum of lambda_j g_j.
    ``building`` takes the time of deriving functions, which is done as they are needed.
    """

    problem: Problem
    scale: float
    building: Stopwatch = field(default_factory=Stopwatch, compare=False)

    @cached_property
    def symbols(self) -> tuple[Expression, Expression, Expression]:
        """c, s and the column of multipliers."""
        return ca.SX.sym("c"), ca.SX.sym("s"), ca.SX.sym("lambda", len(self.levels))

    @cached_property
    def levels(self) -> np.ndarray:
        """The levels the isoperimetric integrals must have."""
        conditions = [t.constraint for t in self.problem.traced]
        return np.array([c.interval[0] for c in conditions if isinstance(c, Isoperimetric)])

    def _put_in(self, expressions: list[Expression]) -> list[Expression]:
        s = self.problem.symbols
        return ca.substitute(expressions, [s.parameters], [ca.SX(ca.DM(self.problem.parameter_values))])

    @cached_property
    def read(self) -> ca.Function:
        """(x, y, y') -> L and the isoperimetric integrands: what is read for what may hide between points."""
        s = self.problem.symbols
        given = [self.problem.integrand, *(t.expression for t in self.problem.traced)]
        return ca.Function("read", [s.x, s.y, s.dy], self._put_in(given))

    @cached_property
    def forms(self) -> list[Expression]:
        """The homogeneous forms of L, g_1, g_2, ..."""
        given = [self.problem.integrand, *(t.expression for t in self.problem.traced)]
        c, s, _ = self.symbols
        slope = self.problem.symbols.dy
        return [homogeneous(e, slope, c, s, self.scale) for e in self._put_in(given)]

    @cached_property
    def parts(self) -> Columns:
        """(x, y, c, s) -> of each form: itself, its derivatives by y, c and s, and a number of the sign of L_vv."""
        symbols = self.problem.symbols
        c, s, _ = self.symbols
        results = []
        with self.building:
            for form in self.forms:
                by_s = ca.gradient(form, s)
                mixed = -ca.jacobian(by_s, c) / (c * s)
                results += [form, ca.gradient(form, symbols.y), ca.gradient(form, c), by_s, mixed]
            inputs = [symbols.x, symbols.y, c, s]
            return PointEvaluator(ca.Function("parts", inputs, [ca.densify(r) for r in results])).columns

    def at(self, x: np.ndarray, y: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """The parts at points and slopes (m,), infinite ones included: shape (forms, 5, m)."""
        slope = np.asarray(slope, dtype=float) / self.scale
        radius = np.hypot(1.0, slope)
        with np.errstate(invalid="ignore"):
            sine = np.where(np.isinf(slope), np.sign(slope), slope / radius)
        values = self.parts(x, y, 1 / radius, sine)
        return np.array([np.broadcast_to(v, radius.shape) for v in values]).reshape(-1, 5, len(radius))

    @cached_property
    def partials(self) -> list[Expression]:
        """The derivatives of the homogeneous Lagrangian function by each parameter."""
        symbols = self.problem.symbols
        c, s, multipliers = self.symbols
        given = [self.problem.integrand, *(t.expression for t in self.problem.traced)]
        total = given[0] + sum((multipliers[j] * g for j, g in enumerate(given[1:])), ca.SX(0))
        if not self.problem.parameters:
            return []
        gradient = self._put_in(ca.vertsplit(ca.densify(ca.gradient(total, symbols.parameters))))
        return [homogeneous(e, symbols.dy, c, s, self.scale) for e in gradient]

    def partials_at(self, x: float, y: float) -> np.ndarray:
        """The derivatives of L by each parameter at a point, at slope zero."""
        symbols = self.problem.symbols
        c, s, multipliers = self.symbols
        column = ca.densify(ca.vertcat(*self.partials))
        function = ca.Function("partials", [symbols.x, symbols.y, c, s, multipliers], [column])
        return np.asarray(function(x, y, 1.0, 0.0, np.zeros(multipliers.numel()))).ravel()

    @cached_property
    def lagrangian(self) -> Expression:
        """The homogeneous form of L + sum of lambda_j g_j."""
        multipliers = self.symbols[2]
        return self.forms[0] + sum((multipliers[j] * g for j, g in enumerate(self.forms[1:])), ca.SX(0))
