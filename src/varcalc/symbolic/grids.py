"""Tables in an expression: polynomials in the cells of a grid of their arguments.

Between knots a table is a polynomial of each of its arguments: of the first degree, or the third of a cubic spline.
Its coefficients are told from values inside of each cell, and checked at other places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import Call, Expression, interpret, operate
from varcalc.symbolic.look_up import KEPT_TABLES, SAME_DEPTH, SAME_VALUE, InOneCell, knots
from varcalc.symbolic.switches import tables

DEGREES = (1, 3)
"""Of tables: lines and cubic splines."""
CHECKED_SHARES = np.array([0.07, 0.41, 0.83])
"""Of a cell: where its polynomial must be the table."""
MOST_CELLS = 40_000
"""Of one table: with more their coefficients take too long to tell."""
SAME_EDGE = 1e-12
"""Of the extent of a grid: knots of several tables that are closer are one."""


@dataclass(frozen=True)
class GridTable:
    """A table of the arguments of numbers ``axes`` (D,), with knots at ``edges`` along each of them.

    In cells (k₁, ..., k_D) it is a polynomial, with coefficients ``powers`` (k₁, ..., k_D, n) of products of powers
    of what the arguments are above their lower knots.
    """

    axes: tuple[int, ...]
    edges: tuple[np.ndarray, ...]
    powers: np.ndarray

    def at(self, arguments: np.ndarray) -> np.ndarray:
        """The constants (m, D + n) of the cells around arguments (m, J): lower knots, and coefficients."""
        cell = [
            np.clip(np.searchsorted(edges, arguments[:, axis], "right") - 1, 0, len(edges) - 2)
            for edges, axis in zip(self.edges, self.axes, strict=True)
        ]
        lower = [edges[k] for edges, k in zip(self.edges, cell, strict=True)]
        return np.column_stack([*lower, self.powers[tuple(cell)]])


@dataclass(frozen=True)
class OnGrid:
    """An ``expression`` of a ``position`` and of the ``values`` (T,) of its ``tables``.

    These are polynomials (:attr:`told`) of their ``arguments`` (J,), expressions of the position, and of ``constants``,
    which say in which cells that is. The grid has ``edges`` along each of the arguments; beyond the outermost there is
    nothing.
    """

    expression: Expression
    values: Expression
    position: Expression
    constants: Expression
    arguments: Expression
    tables: tuple[GridTable, ...]
    edges: tuple[np.ndarray, ...]

    @cached_property
    def told(self) -> tuple[Expression, Expression, Expression]:
        """The tables' values (T,), their derivatives (T, J) by the arguments, and the second ones (T, J J), by rows."""
        count = self.arguments.numel()
        slopes, bends = ca.SX(len(self.tables), count), ca.SX(len(self.tables), count**2)
        values, first = [], 0
        for row, table in enumerate(self.tables):
            width = len(table.axes) + table.powers.shape[-1]
            own = _polynomial(self.constants[first : first + width], [self.arguments[k] for k in table.axes])
            first += width
            values.append(own(()))
            for place, axis in enumerate(table.axes):
                slopes[row, axis] += own((place,))
                for other, across in enumerate(table.axes):
                    bends[row, count * axis + across] += own((place, other))
        return ca.vertcat(*values), slopes, bends

    def numbers(self, cells: np.ndarray) -> np.ndarray:
        """The constants (m, k) in ``cells`` (m, J), numbers along each of the arguments."""
        middles = [(edges[c] + edges[c + 1]) / 2 for c, edges in zip(cells.T, self.edges, strict=True)]
        places = np.stack(middles, axis=1)
        return np.hstack([table.at(places) for table in self.tables])


def on_grid(expression: Expression, position: Expression) -> OnGrid | None:
    """An SX ``expression`` of a column ``position`` in the cells of its tables; None where these are no polynomials."""
    if not tables(expression, position):
        return None
    function = ca.Function("read", [position], [expression])
    found: list[GridTable] = []
    values: list[Expression] = []
    constants: list[Expression] = []
    arguments: list[Expression] = []
    strange: list[str] = []

    def applied(operation: int, operands: Sequence[InOneCell]) -> InOneCell:
        """The operation as it is, and in the cells of its tables."""
        written = operate(operation, [o.written for o in operands])
        if not isinstance(operation, Call):
            if all(o.written is o.in_cell for o in operands):
                return InOneCell.plain(written)
            return InOneCell(written, operate(operation, [o.in_cell for o in operands]))
        powers = _powers(operation.function) if _is_table(operation.function) else None
        if powers is None or any(o.written is not o.in_cell for o in operands):  # a table of what another gives
            strange.append(operation.function.name())
            return InOneCell.plain(written)
        axes = tuple(_number(arguments, o.written) for o in operands)
        found.append(GridTable(axes, knots(operation.function), powers))
        constants.append(ca.SX.sym(f"cell{len(found)}", len(axes) + powers.shape[-1]))
        values.append(ca.SX.sym(f"value{len(found)}"))
        return InOneCell(written, values[-1])

    given = [[InOneCell.plain(symbol) for symbol in position.elements()]]
    ((result,),) = interpret(function, given, lambda c: InOneCell.plain(ca.SX(c)), applied)
    if strange or not found:
        return None
    parts = [
        [e for t in found for axis, e in zip(t.axes, t.edges, strict=True) if axis == k] for k in range(len(arguments))
    ]
    edges = tuple(_together(own) for own in parts)
    if any(len(own) < 2 for own in edges):
        return None
    told, known, at = (ca.vertcat(*parts) for parts in (values, constants, arguments))
    return OnGrid(result.in_cell, told, position, known, at, tuple(found), edges)


def _number(arguments: list[Expression], argument: Expression) -> int:
    """The number of an argument among those that are known, to which it is added."""
    for k, known in enumerate(arguments):
        if ca.is_equal(known, argument, SAME_DEPTH):
            return k
    arguments.append(argument)
    return len(arguments) - 1


def _is_table(function: ca.Function) -> bool:
    return bool(knots(function)) and function.n_in() == function.n_out() == function.nnz_out(0) == 1


def _polynomial(constants: Expression, arguments: Sequence[Expression]) -> Callable[[Sequence[int]], Expression]:
    """What a table is in a cell: its derivatives by some of its arguments, given by their numbers.

    All are sums of the same few monomials, as a product is dear where series are made of it.
    """
    count = len(arguments)
    values = constants[count:].elements()
    degree = round(len(values) ** (1 / count)) - 1
    every = list(product(range(degree + 1), repeat=count))
    above, monomials = [x - constants[k] for k, x in enumerate(arguments)], {every[0]: ca.SX(1)}
    for powers in every[1:]:
        last = max(k for k in range(count) if powers[k])
        alone = not any(powers[:last])
        less = tuple(0 if k == last and not alone else power - (k == last) for k, power in enumerate(powers))
        factor = above[last] if alone else monomials[tuple(power * (k == last) for k, power in enumerate(powers))]
        monomials[powers] = monomials[less] * factor

    def derivative(by: Sequence[int]) -> Expression:
        """The derivative by arguments of these numbers, each as often as it is named."""
        total = ca.SX(0)
        for value, powers in zip(values, every, strict=True):
            left, factor = list(powers), 1
            for k in by:
                factor *= left[k]
                left[k] -= 1
            if factor:
                total += factor * value * monomials[tuple(left)]
        return total

    return derivative


@lru_cache(maxsize=KEPT_TABLES)
def _powers(function: ca.Function) -> np.ndarray | None:
    """The coefficients in each cell of a table; None where it is no polynomial there."""
    edges = knots(function)
    shape = tuple(len(own) - 1 for own in edges)
    if np.prod(shape) > MOST_CELLS:
        return None
    checks = _values(function, edges, CHECKED_SHARES)
    for degree in DEGREES:
        shares = (np.arange(degree + 1) + 0.5) / (degree + 1)
        powers = _values(function, edges, shares)
        inverse = np.linalg.inv(np.vander(shares, increasing=True))
        foretold = np.vander(CHECKED_SHARES, degree + 1, increasing=True)
        told = powers
        for k in range(len(edges)):
            axis = len(edges) + k
            powers = np.moveaxis(np.tensordot(inverse, powers, (1, axis)), 0, axis)
        told = powers
        for k in range(len(edges)):
            axis = len(edges) + k
            told = np.moveaxis(np.tensordot(foretold, told, (1, axis)), 0, axis)
        if np.abs(told - checks).max() <= SAME_VALUE * max(1, degree**2) * np.abs(checks).max():
            for k, own in enumerate(edges):  # powers of the arguments themselves, not of shares of a cell
                width = np.diff(own).reshape([-1 if j == k else 1 for j in range(len(edges))] + [1] * len(edges))
                order = np.arange(degree + 1).reshape([-1 if j == len(edges) + k else 1 for j in range(2 * len(edges))])
                powers = powers / width**order
            return powers.reshape(*shape, -1)
    return None


def _values(function: ca.Function, edges: Sequence[np.ndarray], shares: np.ndarray) -> np.ndarray:
    """Values (k₁, ..., k_D, s, ..., s) in all cells, at ``shares`` (s,) of them along each argument."""
    along = [(own[:-1, None] + np.diff(own)[:, None] * shares) for own in edges]
    places = np.array([np.ravel(v) for v in np.meshgrid(*(np.ravel(own) for own in along), indexing="ij")])
    flat = np.asarray(function.map(places.shape[1])(places)).reshape([n for own in along for n in own.shape])
    count = len(edges)
    return flat.transpose([*range(0, 2 * count, 2), *range(1, 2 * count, 2)])


def _together(parts: Sequence[np.ndarray]) -> np.ndarray:
    """The knots of all ``parts`` between the outermost ones that all have."""
    least, most = max(own[0] for own in parts), min(own[-1] for own in parts)
    every = np.unique(np.concatenate(parts))
    every = every[(every >= least) & (every <= most)]
    return every[np.append(True, np.diff(every) > SAME_EDGE * (most - least))] if len(every) else every
