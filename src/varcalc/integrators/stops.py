"""Stopping functions of a swarm: their values and their rates along the solutions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import check_system
from varcalc.symbolic.instructions import Vectorised


@dataclass(frozen=True)
class Stops:
    """Stopping functions g(Y, constants) of a system, with dg/ds = g_Y f, on arrays of states.

    Parameters
    ----------
    system, stops : ca.Function
        As :meth:`varcalc.integrators.protocol.Engine.compile_swarm` takes them.
    """

    system: ca.Function
    stops: ca.Function
    _call: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = check_system(self.system)
        s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", size), ca.SX.sym("c", self.system.numel_in(2))
        rate = ca.densify(ca.SX(self.system(s, state, constants)))
        level = ca.densify(ca.SX(self.stops(s, state, constants)))
        if ca.depends_on(ca.vertcat(rate, level), s):
            raise ValueError("the system of a swarm and its stopping functions must not depend on s")
        slope = ca.jtimes(level, state, rate)
        results = [level, ca.densify(slope), rate]
        object.__setattr__(self, "_call", Vectorised(ca.Function("stops", [state, constants], results)))

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.stops.numel_out(0))

    def __call__(self, states: np.ndarray, constants: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g (m, k), dg/ds (m, k) and dY/ds (m, N) at states (m, N), constants (m, c)."""
        table, k = self._table(states, constants), self.count
        return table[:, :k], table[:, k : 2 * k], table[:, 2 * k :]

    def _table(self, states: np.ndarray, constants: np.ndarray) -> np.ndarray:
        columns = self._call(list(states.T), list(constants.T))
        table = np.empty((len(states), len(columns)))
        for k, column in enumerate(columns):
            table[:, k] = column
        return table

    def polished(
        self, states: np.ndarray, constants: np.ndarray, stopped_by: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (m, N) moved along their rates onto the stops they are at, and by how much in s (m,)."""
        level, slope, rate = self(states, constants)
        rows = np.arange(len(states))
        with np.errstate(all="ignore"):
            shift = -level[rows, stopped_by] / slope[rows, stopped_by]
        shift = np.where(np.isfinite(shift), shift, 0.0)  # a graze: the rate is zero, and so is the level
        return states + shift[:, None] * rate, shift
