"""Look-up tables in expressions: CasADi's interpolants, which have values between their knots alone.

CasADi makes a spline 0 beyond its last knots, even where round-off alone has led there, and continues lines for ever.
Neither is what was measured, so that a person's tables are called by functions that are no numbers there.

CasADi does not hand out knots, but writes them down where a function is serialized for debugging, each field after its
name, and so it does for what an interpolant's derivatives are called as.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import Call, Expression, interpret, operate

LINEAR = "LinearInterpolant"
INTERPOLANTS = {LINEAR, "BSplineInterpolant"}
"""CasADi's names of the kinds of tables."""
WITHIN = "_within_knots"
"""The end of the name of what a table is called by, and of its derivatives."""
ON_A_KNOT = 1e-12
"""How far beyond its outermost knots, relative to the distance between them, a table is what it is there."""
KEPT_TABLES = 64
GRID, OFFSET = b"Interpolant::grid", b"Interpolant::offset"
"""The fields that hold the knots of all arguments, one after the other, and where those of each begin."""
WITHIN_CELL = 16
"""Places in a cell at which a table is sampled."""
CUBIC_CHECKS, SAME_VALUE = 6, 1e-13
"""Parts of a cell on whose edges a table must be a cubic, or a line, and how well, relative to its largest value."""
FEW_BENDS, SAME_SLOPE = 32, 1e-13
"""Knots at most at which a table of lines bends that is written as a sum of absolute values, and slopes that differ so
little, relative to the largest, are one.
"""
SAME_DEPTH = 8
"""To which depth expressions are compared."""
CUBIC = 5
"""Constants of a cubic in a cell: a knot and four coefficients."""
NUMBER, WHOLE = b"d", b"J"
"""What comes before a number, and before a whole number, of eight bytes each."""


def within_knots(expression: ca.SX) -> ca.SX:
    """The expression with the tables in it made no numbers beyond their knots."""
    return _rewritten(expression, _operate)


def _rewritten(expression: ca.SX, applied: Callable[[Any, Sequence[ca.SX]], ca.SX]) -> ca.SX:
    """The expression with operations as they are ``applied``; as it is where it calls no function."""
    variables = ca.vertcat(*ca.symvar(expression))
    function = ca.Function("read", [variables], [expression])
    if ca.OP_CALL not in map(function.instruction_id, range(function.n_instructions())):
        return expression
    ((result,),) = interpret(function, [variables.elements()], ca.SX, applied)
    return result


def _operate(operation: int, operands: Sequence[ca.SX]) -> ca.SX:
    if not isinstance(operation, Call) or operation.function.name().endswith(WITHIN):
        return operate(operation, operands)
    return operate(Call.of(_bounded(operation.function), operation.result), operands)


@lru_cache(maxsize=KEPT_TABLES)
def _bounded(function: ca.Function) -> ca.Function:
    """What is called in the place of a function: of a table one that is no number beyond its knots."""
    if function.class_name() not in INTERPOLANTS:
        return function
    edges = _written(function)
    return _table(function, edges) if len(edges) == function.nnz_in(0) else function


def _table(function: ca.Function, edges: Sequence[np.ndarray]) -> ca.Function:
    place = ca.SX.sym("x", len(edges))
    lowest, highest = (ca.DM([e[end] for e in edges]) for end in (0, -1))
    beyond = ON_A_KNOT * (highest - lowest)
    inside = ca.mmin(ca.fmin(place - lowest, highest - place) + beyond) >= 0
    # a factor, so that derivatives are no numbers either
    value = function(ca.fmin(ca.fmax(place, lowest), highest)) * ca.if_else(inside, 1.0, math.nan)
    return ca.Function(function.name() + WITHIN, [place], [value], {"never_inline": True})


def as_sums(expression: ca.SX, watched: Expression) -> ca.SX:
    """The expression with tables of few lines as sums a + b u + c_k |u - k|, where u moves with any of the ``watched``.

    All that is there for kinks that are written as such treats those. What is added to the sum is zero, and no number
    beyond the knots.
    """

    def applied(operation: int, operands: Sequence[ca.SX]) -> ca.SX:
        """The operation, or the sum of lines in the place of a table."""
        lines = _lines(operation.function) if isinstance(operation, Call) else None
        if lines is None or not ca.depends_on(operands[0], watched):
            return operate(operation, operands)
        (u,), (ends, level, slope, places, bends) = operands, lines
        bent = sum(c * ca.fabs(u - k) for k, c in zip(places.tolist(), bends.tolist(), strict=True))
        return level + slope * u + bent + Call.of(_zero(*ends), 0)([u], ca.SX)

    return _rewritten(expression, applied)


class _Lines(NamedTuple):
    """A table between its ``ends``: ``level`` + ``slope`` u + the sum of ``bends`` times |u - ``places``|."""

    ends: tuple[float, float]
    level: float
    slope: float
    places: np.ndarray
    bends: np.ndarray


@lru_cache(maxsize=KEPT_TABLES)
def _lines(function: ca.Function) -> _Lines | None:
    """A table of one argument that bends at few knots, straight between them; None for any other."""
    if not _of_one_number(function) or not straight(function) or vanishes(function):
        return None
    (edges,) = knots(function)
    values = np.asarray(function.map(len(edges))(edges[None])).ravel()
    slopes = np.diff(values) / np.diff(edges)
    bends = 0.5 * np.diff(slopes)
    bent = np.abs(bends) > SAME_SLOPE * np.abs(slopes).max()
    if np.count_nonzero(bent) > FEW_BENDS:
        return None
    places, bends, slope = edges[1:-1][bent], bends[bent], float(slopes[0] + slopes[-1]) / 2
    level = float(values[0] - slope * edges[0] - bends @ (places - edges[0]))
    return _Lines((float(edges[0]), float(edges[-1])), level, slope, places, bends)


@lru_cache(maxsize=KEPT_TABLES)
def vanishes(function: ca.Function) -> bool:
    """Whether a table that is called is a line that is zero, and no number beyond its ends."""
    if not _of_one_number(function) or len(knots(function)[0]) > 2 or not straight(function):
        return False
    return not np.asarray(function.map(2)(knots(function)[0][None])).any()


def _of_one_number(function: ca.Function) -> bool:
    """Whether what is called is a table of one argument."""
    return function.n_in() == function.n_out() == function.nnz_in(0) == function.nnz_out(0) == len(knots(function)) == 1


@lru_cache(maxsize=KEPT_TABLES)
def _zero(first: float, last: float) -> ca.Function:
    """The table that is zero between two places."""
    ends = [float(first), float(last)]
    return _table(ca.interpolant("zero", "linear", [ends], [0.0, 0.0]), [np.array(ends)])


def knots(function: ca.Function) -> tuple[np.ndarray, ...]:
    """The knots along each argument of what a table, or a derivative of one, is called by; none of another function."""
    return _written(function) if function.name().endswith(WITHIN) else ()


@lru_cache(maxsize=KEPT_TABLES)
def straight(function: ca.Function) -> bool:
    """Whether a table that is called is straight between its knots, so that it has a kink at each."""
    return LINEAR.encode() in serialized(function)


@lru_cache(maxsize=KEPT_TABLES)
def _written(function: ca.Function) -> tuple[np.ndarray, ...]:
    stream = serialized(function)
    grid, offsets = (next(vectors(stream, *field), None) for field in ((GRID, NUMBER), (OFFSET, WHOLE)))
    if grid is None or offsets is None or not len(offsets) or offsets[-1] != len(grid):
        return ()
    places = offsets.astype(int)
    return tuple(grid[a:b] for a, b in pairwise(places))


def serialized(function: ca.Function) -> bytes:
    """What CasADi writes a function down as, each field after its name."""
    written = function.serialize({"debug": True}).encode()
    nibbles = np.frombuffer(written, np.uint8)[: len(written) // 2 * 2] - ord("a")
    return (nibbles[::2] | nibbles[1::2] << 4).tobytes()


def vectors(stream: bytes, name: bytes, kind: bytes) -> Iterator[np.ndarray]:
    """The vectors of a ``kind`` after fields of a name: those of a function, and of derivatives that are kept in it."""
    at = stream.find(name)
    while at >= 0:
        head = at + len(name)
        if stream[head : head + 2] == b"V" + WHOLE:
            (count,) = struct.unpack_from("<q", stream, head + 2)
            body = stream[head + 10 : head + 10 + 9 * count]
            if len(body) == 9 * count and body[::9] == kind * count:
                numbers = np.frombuffer(body, np.uint8).reshape(count, 9)[:, 1:].tobytes()
                yield np.frombuffer(numbers, "<f8" if kind == NUMBER else "<i8")
        at = stream.find(name, head)


def cells(function: ca.Function, argument: int, least: np.ndarray, greatest: np.ndarray) -> np.ndarray:
    """How many cells of a table lie between places of one of its arguments, parts of them counted as such.

    Beyond the knots there are cells of the sizes of the last ones, of which nothing is known.
    """
    edges = knots(function)[argument]
    counts = np.arange(float(len(edges)))
    before = np.maximum(edges[0] - least, 0.0) / (edges[1] - edges[0])
    after = np.maximum(greatest - edges[-1], 0.0) / (edges[-1] - edges[-2])
    return np.interp(greatest, edges, counts) - np.interp(least, edges, counts) + before + after


def enclosed(function: ca.Function, least: np.ndarray, greatest: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The least and greatest values of a table of one argument between places; None of any other function.

    It is told from samples, a line between neighbours and what the second derivative, which is linear in a cell of a
    cubic spline, can bend it away from there.
    """
    if not _of_one_number(function):
        return None
    samples = _samples(function)
    first_knot, last_knot = samples.places[0], samples.places[-1]
    outside = (greatest < first_knot) | (least > last_knot)
    least, greatest = (np.clip(v, first_knot, last_knot) for v in (least, greatest))
    first, last = np.searchsorted(samples.places, least), np.searchsorted(samples.places, greatest, "right")
    ends = [samples.at(place) for place in (least, greatest)]
    bend = samples.bends.within(first - 1, last + 1) * np.minimum((greatest - least) / samples.finest, 1.0) ** 2
    low = np.fmin(np.minimum(*ends) - bend, samples.least.within(first, last))
    high = np.fmax(np.maximum(*ends) + bend, samples.greatest.within(first, last))
    return np.where(outside, math.nan, low), np.where(outside, math.nan, high)


@dataclass(frozen=True)
class InCells:
    """An ``expression`` of ``symbols`` and of ``constants``, with a cubic in the place of each table of one argument.

    The constants say in which cell of each table that is: its lower knot, and the coefficients of the powers of what
    the argument is above it.
    """

    expression: Expression
    symbols: Expression
    constants: Expression
    tables: tuple[CubicTable, ...]

    def at(self, places: np.ndarray) -> np.ndarray:
        """The constants (m, k) of the cells around places (m, symbols); no numbers beyond the knots of a table."""
        if not self.tables:
            return np.zeros((len(places), 0))
        arguments = ca.Function("arguments", [self.symbols], [ca.vertcat(*(table.argument for table in self.tables))])
        found = np.asarray(arguments.map(len(places))(places.T))
        return np.hstack([table.at(argument) for table, argument in zip(self.tables, found, strict=True)])


@dataclass(frozen=True)
class CubicTable:
    """A table of one ``argument`` between ``edges`` (k,), its cubics with the coefficients ``powers`` (k - 1, 4)."""

    argument: Expression
    edges: np.ndarray
    powers: np.ndarray

    def at(self, argument: np.ndarray) -> np.ndarray:
        """Lower knots and coefficients (m, 5) around values of the argument (m,); no numbers beyond the knots."""
        cell = np.clip(np.searchsorted(self.edges, argument, "right") - 1, 0, len(self.powers) - 1)
        beyond = ON_A_KNOT * (self.edges[-1] - self.edges[0])
        inside = (argument >= self.edges[0] - beyond) & (argument <= self.edges[-1] + beyond)
        return np.where(inside[:, None], np.column_stack([self.edges[cell], self.powers[cell]]), math.nan)

    def same(self, other: CubicTable) -> bool:
        """Whether both have the same values."""
        arrays = ((self.edges, other.edges), (self.powers, other.powers))
        equal = all(np.array_equal(one, two) for one, two in arrays)
        return equal and bool(ca.is_equal(self.argument, other.argument, SAME_DEPTH))


def in_cells(expression: Expression, symbols: Expression) -> InCells:
    """An SX ``expression`` of a column of ``symbols`` in cells; tables that are no cubics stay what they are."""
    function = ca.Function("read", [symbols], [expression])
    tables: list[CubicTable] = []
    constants: list[Expression] = []

    def applied(operation: int, operands: Sequence[InOneCell]) -> InOneCell:
        """The operation as it is, and in a cell of its tables."""
        written = operate(operation, [o.written for o in operands])
        powers = _cubics(operation.function) if isinstance(operation, Call) else None
        if not isinstance(operation, Call) or powers is None:
            return InOneCell(written, operate(operation, [o.in_cell for o in operands]))
        table = CubicTable(operands[0].written, knots(operation.function)[0], powers)
        number = next((k for k, known in enumerate(tables) if known.same(table)), len(tables))
        if number == len(tables):
            tables.append(table)
            constants.append(ca.SX.sym(f"cell{number}", CUBIC))
        knot, a, b, c, d = constants[number].elements()
        above = operands[0].in_cell - knot
        return InOneCell(written, a + above * (b + above * (c + above * d)))

    given = [[InOneCell.plain(symbol) for symbol in symbols.elements()]]
    (results,) = interpret(function, given, lambda c: InOneCell.plain(ca.SX(c)), applied)
    return InCells(
        ca.vertcat(*(r.in_cell for r in results)), symbols, ca.vertcat(ca.SX(0, 1), *constants), tuple(tables)
    )


class InOneCell(NamedTuple):
    """An expression as it was written, and in one cell of every table."""

    written: Expression
    in_cell: Expression

    @classmethod
    def plain(cls, expression: Expression) -> Self:
        """One in which there is no table."""
        return cls(expression, expression)


@lru_cache(maxsize=KEPT_TABLES)
def _cubics(function: ca.Function) -> np.ndarray | None:
    """The coefficients (cells, 4) of a table of one argument, lines among them; None of what is no such table."""
    if not _of_one_number(function):
        return None
    (edges,) = knots(function)
    widths, shares = np.diff(edges), np.arange(CUBIC_CHECKS + 1) / CUBIC_CHECKS
    samples = np.asarray(function.map(len(widths) * len(shares))((edges[:-1, None] + widths[:, None] * shares).ravel()))
    values = samples.reshape(len(widths), len(shares))
    values[:-1, -1] = values[1:, 0]
    size = np.abs(values).max()
    line = values[:, :1] + (values[:, -1:] - values[:, :1]) * shares
    if np.abs(values - line).max() <= SAME_VALUE * size:
        return np.column_stack([values[:, 0], (values[:, -1] - values[:, 0]) / widths, *np.zeros((2, len(widths)))])
    third = CUBIC_CHECKS // 3
    powers = np.linalg.solve(np.vander(shares[::third], increasing=True), values[:, ::third].T)
    if not np.abs(values - (np.vander(shares, 4, increasing=True) @ powers).T).max() <= SAME_VALUE * size:
        return None
    return (powers / widths ** np.arange(4)[:, None]).T


class _Extreme:
    """The extremes of numbers from one place to another, both counted, by those of 2^k neighbours."""

    def __init__(self, values: np.ndarray, of: np.ufunc) -> None:
        self._of, rows = of, [values]
        while 2 ** len(rows) <= len(values):
            step, before = 2 ** (len(rows) - 1), rows[-1]
            rows.append(of(before, np.append(before[step:], np.full(step, before[-1]))))
        self._rows = np.array(rows)

    def within(self, first: np.ndarray, stop: np.ndarray) -> np.ndarray:
        """The extremes from ``first`` up to before ``stop``; not a number where there are none."""
        first, stop = np.maximum(first, 0), np.minimum(stop, self._rows.shape[1])
        level = np.maximum(np.frexp(np.maximum(stop - first, 1))[1] - 1, 0)
        start, end = np.minimum(first, self._rows.shape[1] - 1), np.maximum(stop - 2**level, 0)
        return np.where(stop > first, self._of(self._rows[level, start], self._rows[level, end]), math.nan)


class _Samples:
    """A table of one argument at ``places``, ``finest`` the least distance between them.

    ``least`` and ``greatest`` of the values, ``bends`` of how far it may leave the lines between them.
    """

    def __init__(self, function: ca.Function) -> None:
        (edges,) = knots(function)
        inner = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(WITHIN_CELL) / WITHIN_CELL)
        self.places, self._function = np.append(inner.ravel(), edges[-1]), function
        self.finest = float(np.diff(self.places).min())
        values = self.at(self.places)
        bend = _bend(values)
        self.bends = _Extreme(bend, np.maximum)
        self.least, self.greatest = _Extreme(values - bend, np.minimum), _Extreme(values + bend, np.maximum)

    def at(self, places: np.ndarray) -> np.ndarray:
        """The table at places of any shape."""
        flat = np.ravel(places)
        return np.asarray(self._function.map(len(flat))(flat[None])).reshape(np.shape(places))


def _bend(values: np.ndarray) -> np.ndarray:
    """By how much a cubic on each cell may leave the lines between its samples, at each of them."""
    within = np.column_stack([values[:-1].reshape(-1, WITHIN_CELL), values[WITHIN_CELL::WITHIN_CELL]])
    bent = np.abs(np.diff(within, 2)).max(1) * (WITHIN_CELL / (WITHIN_CELL - 2)) / 8
    around = np.repeat(bent, WITHIN_CELL)
    return np.maximum(np.append(around, around[-1]), np.append(around[0], around))


@lru_cache(maxsize=KEPT_TABLES)
def _samples(function: ca.Function) -> _Samples:
    return _Samples(function)
