"""What the ends cost, in balls, with multipliers of the equations that hold between them.

Where an end slides on phi = 0 the cost phi^T nu + phi^T W phi/2 changes nothing on admissible curves, and the end is
as good as free (Bertsekas, "Constrained Optimization and Lagrange Multiplier Methods", 1982, sect. 2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.degree import degrees
from varcalc.certificates.jets import Jet, jets
from varcalc.formulation import Form
from varcalc.symbolic.instructions import Program


@dataclass(frozen=True)
class Cost:
    """The cost M of the ends of a form; derivatives are numbered by the functions at the start, at the end, numbers.

    A number that is optimised with the curve is counted at the end, unless the start alone hangs on it. ``multipliers``
    and ``weights`` are nu and the diagonal of W.
    """

    form: Form
    multipliers: tuple[float, ...]
    weights: tuple[float, ...]

    @cached_property
    def _arguments(self) -> list[Any]:
        joint, s = self.form.ends.joint, self.form.symbols
        assert joint is not None
        count = self.form.ends.equations
        tied = [s.kind.sym("nu", count), s.kind.sym("W", count)]
        return [joint.start, joint.end, s.unknowns, s.parameters, *tied]

    @cached_property
    def _equations(self) -> Any:
        joint = self.form.ends.joint
        assert joint is not None
        return joint.equations

    @cached_property
    def _expression(self) -> Any:
        joint = self.form.ends.joint
        assert joint is not None
        total, phi = self.form.symbols.kind(joint.cost), self._equations
        for k in range(self.form.ends.equations):
            total = total + self._arguments[4][k] * phi[k] + self._arguments[5][k] * phi[k] ** 2 / 2
        return total

    @cached_property
    def _program(self) -> Program:
        return Program(ca.Function("M", self._arguments, [ca.densify(self._expression)]))

    @cached_property
    def _tied(self) -> Program:
        return Program(ca.Function("phi", self._arguments, [ca.densify(self._equations)]))

    @cached_property
    def quadratic(self) -> bool:
        """Whether M is of second degree."""
        function = ca.Function("M", self._arguments, [ca.densify(self._expression)])
        watched = [[k < 3] * int(a.numel()) for k, a in enumerate(self._arguments)]
        return degrees(function, watched)[0][0] <= 2.0

    @cached_property
    def _at_start(self) -> list[bool]:
        """Which numbers the start alone hangs on."""
        start, end, numbers = self._arguments[:3]
        rows = ca.jacobian(ca.gradient(self._expression, start), numbers)
        others = ca.jacobian(ca.gradient(self._expression, end), numbers)
        return [bool(rows[:, k].nnz()) and not others[:, k].nnz() for k in range(int(numbers.numel()))]

    def jet(self, start: Sequence[Ball], end: Sequence[Ball], numbers: Sequence[Ball], order: int) -> Jet:
        """M in balls."""
        return self._jets(self._program, start, end, numbers, order)[0]

    def equations(self, start: Sequence[Ball], end: Sequence[Ball], numbers: Sequence[Ball]) -> list[Jet]:
        """What vanishes at the ends of admissible curves, in balls, with first derivatives."""
        return self._jets(self._tied, start, end, numbers, 1)

    def _jets(
        self, program: Program, start: Sequence[Ball], end: Sequence[Ball], numbers: Sequence[Ball], order: int
    ) -> list[Jet]:
        found = flint()
        rest = [
            [Jet(found.arb(float(v))) for v in values]
            for values in (self.form.problem.parameter_values, self.multipliers, self.weights)
        ]
        variables = [Jet(v, {i: found.arb(1)} if order else None) for i, v in enumerate([*start, *end, *numbers])]
        n = self.form.n
        return jets(program, [variables[:n], variables[n : 2 * n], variables[2 * n :], *rest], order)[0]

    def index(self, end: int, state: int) -> int | None:
        """The number of the variable that a state is at the start (0) or the end (1); None where M has it not."""
        n, order = self.form.n, self.form.order
        if state >= n * order:
            k = state - n * order
            return 2 * n + k if end != self._at_start[k] else None
        return n * end + state if state < n else None

    def gradients(self, values: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """The gradients of M without multipliers, and those of the equations (equations, variables), in numbers."""
        arguments = self._arguments
        variables = ca.vertcat(*arguments[:3])
        joint = self.form.ends.joint
        assert joint is not None
        parts = [ca.gradient(self.form.symbols.kind(joint.cost), variables), ca.jacobian(self._equations, variables)]
        function = ca.Function("gradients", arguments[:4], list(map(ca.densify, parts)))
        found: Any = function.call([*values, self.form.problem.parameter_values])
        return np.asarray(found[0], dtype=float).ravel(), np.asarray(found[1], dtype=float)
