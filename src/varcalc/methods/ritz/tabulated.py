"""Integrands with look-up tables: a cubic in the place of each, whose coefficients are found for all points at once.

CasADi goes through a table point by point, and through each derivative of it by a function of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.problem.functional import Symbols
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.look_up import InCells, in_cells
from varcalc.symbolic.tracing import Expression

Make = Callable[[Symbols, Sequence[Expression]], ca.Function]
"""A function of ``symbols.all`` from expressions in them."""


def in_place_of_tables(symbols: Symbols, rows: Sequence[Expression], make: Make) -> CellEvaluator | None:
    """What ``make`` makes of expressions that call functions, at any number of points; None where no table is one."""
    cells = in_cells(ca.vertcat(*rows), ca.vertcat(*symbols.all))
    return CellEvaluator(symbols, cells, make) if cells.tables else None


class CellEvaluator:
    """What ``make`` makes of expressions ``in_cells``: called as a :class:`.PointEvaluator` of ``symbols.all`` is."""

    def __init__(self, symbols: Symbols, cells: InCells, make: Make) -> None:
        arguments = ca.vertcat(*(table.argument for table in cells.tables))
        self._tables = cells.tables
        self._arguments = PointEvaluator(ca.Function("arguments", symbols.all, [ca.densify(arguments)]))
        longer = replace(symbols, parameters=ca.vertcat(symbols.parameters, cells.constants))
        self._function = PointEvaluator(make(longer, ca.vertsplit(cells.expression)))

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """See :meth:`.PointEvaluator.__call__`."""
        x, y, dy, ddy, parameters, unknowns = arguments
        places = self._arguments(count, *arguments)
        constants = [table.at(column) for table, column in zip(self._tables, places.T, strict=True)]
        given = np.broadcast_to(parameters, (count, parameters.shape[1]))
        return self._function(count, x, y, dy, ddy, np.hstack([given, *constants]), unknowns)
