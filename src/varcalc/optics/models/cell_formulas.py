"""The formulas of g in the cells of tables and between switches, compiled once for those that are alike."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from varcalc.optics.media.medium import Expression
from varcalc.optics.models.jumps import CellsBetween, SwitchedFormula
from varcalc.symbolic.differences import carry, displaced, fixed
from varcalc.symbolic.evaluation import Columns, PointEvaluator
from varcalc.symbolic.shapes import shape

NO_CONSTANTS = ca.SX(0, 1)


@dataclass(frozen=True)
class ProfilePart:
    """One formula of g: g, its slope and n at places, and the changes of the first two from one place to another.

    Both take so many ``constants`` of a cell last.
    """

    index: Columns
    changes: Columns
    constants: int

    @classmethod
    def of(
        cls, piece: SwitchedFormula, u: Expression, constants: Expression = NO_CONSTANTS, probes: Sequence[float] = ()
    ) -> Self:
        """Compiled of g and n at ``u``; ``probes`` are the constants at the probe of the piece."""
        base, x = ca.SX.sym("base"), ca.SX.sym("x")
        g, index = piece.expression.elements()
        slope = ca.densify(ca.gradient(g, u))
        same = [fixed(symbol, probe) for symbol, probe in zip(constants.elements(), probes, strict=True)]
        values = ca.Function("g", [u, *constants.elements()], [g, slope])
        changes = [one.change for one in carry(values, [displaced(base, x, piece.probe), *same])]
        there = ca.Function("index", [u, constants], [g, slope, index])
        between = ca.Function("changes", [base, x, constants], changes)
        return cls(PointEvaluator(there).columns, PointEvaluator(between).columns, constants.numel())


@dataclass(frozen=True)
class CellFormulas:
    """The formulas of g in cells, of which those that differ by numbers alone are one.

    ``part`` (cells,) says which of the ``parts`` holds in a cell, ``constants`` (cells, c) what it takes there.
    """

    parts: Sequence[ProfilePart]
    part: np.ndarray
    constants: np.ndarray

    @classmethod
    def of_tables(cls, cells: CellsBetween, u: Expression, probe: float) -> Self:
        """Those between the knots of tables, in all of which one formula holds; at a ``probe`` there is an index."""
        probes = cells.constants[cells.of(np.array(probe))].tolist()
        formula = SwitchedFormula(cells.written.expression, probe)
        part = ProfilePart.of(formula, u, cells.written.constants, probes)
        return cls([part], np.zeros(len(cells.constants), dtype=int), cells.constants)

    @classmethod
    def of_pieces(cls, formulas: Sequence[SwitchedFormula], u: Expression) -> Self:
        """Those between switches."""
        parts, keys, number, rows = list[ProfilePart](), dict[Hashable, int](), list[int](), list[tuple[float, ...]]()
        for formula in formulas:
            alike = shape(formula.expression.elements(), u)
            key = len(number) if alike is None else alike.key
            if key not in keys:
                keys[key] = len(parts)
                if alike is None:
                    parts.append(ProfilePart.of(formula, u))
                else:
                    written = SwitchedFormula(ca.vertcat(*alike.expressions), formula.probe)
                    parts.append(ProfilePart.of(written, u, alike.numbers, alike.values))
            number.append(keys[key])
            rows.append(() if alike is None else alike.values)
        constants = np.zeros((len(rows), max(map(len, rows), default=0)))
        for row, values in zip(constants, rows, strict=True):
            row[: len(values)] = values
        return cls(parts, np.array(number), constants)

    def index(self, u: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, ...]:
        """g, its slope and n at u by the formulas of cells."""
        return self._each([one.index for one in self.parts], 3, [u], cell)

    def changes(self, base: np.ndarray, x: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, ...]:
        """The changes of g and its slope from ``base`` over ``x`` by the formulas of cells."""
        return self._each([one.changes for one in self.parts], 2, [base, x], cell)

    def _each(
        self, functions: Sequence[Columns], count: int, given: Sequence[np.ndarray], cell: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """What ``functions``, one of each part, say of what is ``given`` in cells: so many arrays."""
        size = np.broadcast_shapes(*map(np.shape, given), np.shape(cell))
        if len(self.parts) == 1:  # what is given is left as it is: formulas cost less where it is the same for many
            return tuple(_shaped(column, size) for column in functions[0](*given, self._taken(0, cell)))
        out = np.empty((count, *size))
        *given, cell = np.broadcast_arrays(*given, cell)
        part = self.part[cell]
        for number in np.unique(part):
            own = part == number
            columns = functions[number](*(g[own] for g in given), self._taken(number, cell[own]))
            for k, column in enumerate(columns):
                out[k][own] = column
        return tuple(out[k] for k in range(count))

    def _taken(self, part: int, cell: np.ndarray) -> list[np.ndarray]:
        """What a part takes in cells in which it holds."""
        return [self.constants[cell, k] for k in range(self.parts[part].constants)]


def _shaped(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """``values`` in ``shape``: what does not depend on the place comes as one number."""
    values = np.asarray(values, dtype=float)
    return values if values.shape == shape else np.broadcast_to(values, shape)
