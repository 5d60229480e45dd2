"""What the ends cost: a function of each end by itself, in balls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.degree import apart, degrees
from varcalc.certificates.jets import Jet, jets
from varcalc.formulation import Form
from varcalc.symbolic.instructions import Program


@dataclass(frozen=True)
class Cost:
    """The cost M of the ends of a form; derivatives are numbered by the functions at the start, at the end, numbers.

    A number that is optimised with the curve is counted at the end.
    """

    form: Form

    @cached_property
    def _arguments(self) -> list[Any]:
        joint, s = self.form.ends.joint, self.form.symbols
        assert joint is not None
        return [joint.start, joint.end, s.unknowns, s.parameters]

    @cached_property
    def function(self) -> ca.Function:
        """M of the functions at both ends, the numbers and the parameters."""
        joint = self.form.ends.joint
        assert joint is not None
        return ca.Function("M", self._arguments, [ca.densify(self.form.symbols.kind(joint.cost))])

    @cached_property
    def separate(self) -> bool:
        """Whether M is a sum of functions of one end each."""
        return apart(self.function, self._each(1, 2, 2))

    @cached_property
    def quadratic(self) -> bool:
        """Whether M is of second degree."""
        return degrees(self.function, self._each(True, True, True))[0][0] <= 2.0

    def _each(self, start: int, end: int, numbers: int) -> list[list[int]]:
        """One number for each entry of each argument, none of the parameters."""
        values = start, end, numbers, 0
        return [[value] * int(a.numel()) for value, a in zip(values, self._arguments, strict=True)]

    @cached_property
    def _program(self) -> Program:
        return Program(self.function)

    def jet(self, start: Sequence[Ball], end: Sequence[Ball], numbers: Sequence[Ball], order: int) -> Jet:
        """M in balls."""
        found = flint()
        parameters = [Jet(found.arb(float(v))) for v in self.form.problem.parameter_values]
        values = [*start, *end, *numbers]
        variables = [Jet(v, {i: found.arb(1)}) for i, v in enumerate(values)]
        n = self.form.n
        return jets(self._program, [variables[:n], variables[n : 2 * n], variables[2 * n :], parameters], order)[0][0]

    def index(self, end: int, state: int) -> int | None:
        """The number of the variable that a state is at the start (0) or the end (1); None where M has it not."""
        n, order = self.form.n, self.form.order
        if state >= n * order:
            return 2 * n + state - n * order if end else None
        return n * end + state if state < n else None
