"""The action of a system, as a problem of the calculus of variations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from varcalc.axes import Axis
from varcalc.mechanics.lagrange import Lagrange
from varcalc.problem.conditions import Fixed, Free, Holonomic, Periodic
from varcalc.problem.problem import Problem
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class Action:
    """The integral over time of a Lagrangian, ``given`` by a person and as ``lagrange``, under constraints ``held``."""

    given: Callable[..., Any]
    lagrange: Lagrange
    held: tuple[Holonomic, ...]
    parameters: Mapping[str, float]
    name: str
    axes: tuple[Axis, ...]

    def problem(self, start: Fixed | Free | Periodic, end: Fixed | Free | Periodic) -> Problem:
        """Its stationary points between two ends."""
        return Problem(
            self.given, start, end, self.held, parameters=dict(self.parameters) or None, name=self.name,
            names=[axis.name for axis in self.axes], units=[axis.unit for axis in self.axes],
        )  # fmt: skip

    def placed(
        self, start: Fixed | Free | Periodic, end: Fixed | Free | Periodic,
        place: Callable[[Expression, Expression], Expression], duration: str | None,
    ) -> Problem:  # fmt: skip
        """The same in other coordinates z, where q = ``place(s, z)`` at the abscissa s.

        s is the time, or the share of it in a ``duration`` that is a parameter.
        """
        symbols = self.lagrange.symbols
        s, z, w = ca.SX.sym("s"), ca.SX.sym("z", symbols.q.numel()), ca.SX.sym("w", symbols.q.numel())
        time = symbols.p[symbols.names.index(duration)] if duration else ca.SX(1)
        q = place(s, z)
        v = ca.jtimes(q, ca.vertcat(s, z), ca.vertcat(1, w)) / time

        def moved(value: Expression) -> Expression:
            return ca.Function("moved", symbols.all, [value])(time * s, q, v, symbols.p)

        lagrangian = symbols.function(time * moved(self.lagrange.value), s, z, w)
        held = [
            Holonomic(symbols.function(moved(symbols.traced("phi", c.phi, symbols.t, symbols.q)), s, z))
            for c in self.held
        ]
        return Problem(lagrangian, start, end, held, parameters=dict(self.parameters) or None, name=self.name)
