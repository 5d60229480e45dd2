"""A function of many columns of numbers, compiled where that is worth its time."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import lower

COLUMNS = 100_000
"""Columns by CasADi's interpreter that take as long as compiling: 2 to 3 nanoseconds an operation and column against
0.2 to 0.4 milliseconds an operation."""

_ONE_AT_A_TIME = Lock()
"""Threads that need the same function wait for the one that compiles it."""


@dataclass
class Columnwise:
    """A function of columns of numbers: interpreted by CasADi while it has little to do, then compiled by heyoka.

    The number of columns decides, not the clock, so results are reproducible.
    """

    function: ca.Function
    _left: int = field(default=COLUMNS, init=False)
    _compiled: Any = field(default=None, init=False, repr=False)

    def expects(self, columns: int) -> None:
        """Compile the function if so many columns, or those before them, are worth it."""
        if self._compiled is None and columns > self._left:
            with _ONE_AT_A_TIME:
                if self._compiled is None:
                    self._compiled = _compiled(self.function)

    def __call__(self, columns: np.ndarray, results: np.ndarray) -> None:
        """The function of each of the ``columns`` (n, m), written into ``results`` (k, m); both contiguous."""
        if self._compiled is not None:
            self._compiled(columns, outputs=results)
            return
        self._left -= columns.shape[1]
        results[:] = np.array(self.function(columns))


def _compiled(function: ca.Function) -> Any:
    """``function`` of one argument as a heyoka function of arrays."""
    import heyoka as hy

    column, nothing = ca.SX.sym("Y", function.numel_in(0)), ca.SX.sym("c", 0)
    system = ca.Function(function.name(), [ca.SX.sym("s"), column, nothing], [function(column)])
    names = [hy.expression(f"Y{i}") for i in range(function.numel_in(0))]
    return hy.cfunc(lower(system, [[hy.time], names, []]), names)
