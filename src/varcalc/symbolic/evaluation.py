"""CasADi functions at points: one way to call them, whatever the number of points.

A call of CasADi with NumPy arrays converts each of them, which costs far more than a small function does. A few
points are therefore handed over in memory that CasADi keeps, and its interpreter goes through all instructions for
each of them. An operation of NumPy on a column of points costs a few times less for each, once there are hundreds,
but the instructions have to be read first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from threading import Lock
from typing import Any, Literal

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import BINARY, NAMES, UNARY, Call, instructions

POINTS_TOGETHER = 64
"""Points that CasADi evaluates in one go, at most."""
FREE = 4000
"""Instructions, times points, that take less time than what comes with every call."""
A_CALL = 200
"""Instructions that take as long as a call of a table, or of a derivative of one."""
POINTS_FOR_NUMPY = 128
"""Points from which on NumPy is faster than CasADi, whatever the function."""
POINTS_AN_INSTRUCTION, MOST_POINTS = 20, 3000
"""After so many points it has paid to read an instruction; and to read a function, however long it is."""
COLUMN = 4096
"""Points in a column: with it the columns at work stay in the cache."""
PART = 2 * COLUMN
"""Entries of the parts into which larger arrays are cut, for the same reason: of more axes some entries are shared."""
MANY = -2
"""In the place of a second operand: the first holds as many as there are."""

Columns = Callable[..., list[Any]]
"""A function of columns: see :attr:`PointEvaluator.columns`."""


class PointEvaluator:
    """A CasADi function of columns, at any number of points.

    It goes by CasADi or by NumPy, whichever is faster for so many points and a function of that length; the number of
    points decides, not the clock. Several threads may call it at once. ``usual`` is how many points are evaluated at
    the least, for they take no longer than one.
    """

    def __init__(self, function: ca.Function) -> None:
        self.function: ca.Function = function
        self.width: int = 0
        self._places: list[slice | np.ndarray] = []
        full = True
        for i in range(function.n_out()):
            size = function.numel_out(i)
            places: slice | np.ndarray = slice(self.width, self.width + size)
            if function.nnz_out(i) < size:
                places, full = self.width + np.array(function.sparsity_out(i).find(), dtype=int), False
            self._places.append(places)
            self.width += size
        self._blank = np.empty if full else np.zeros
        self._rooms: dict[int, _Room] = {}
        self._busy = Lock()
        self.usual: int = 1
        self._before_reading = math.inf
        if function.is_a("SXFunction"):
            length = max(1, function.n_instructions())
            calls = 0
            if function.find_functions():
                calls = [function.instruction_id(k) for k in range(length)].count(ca.OP_CALL)
            self.usual = min(POINTS_TOGETHER, max(1, FREE // (length + A_CALL * calls)))
            self._before_reading = min(POINTS_AN_INSTRUCTION * length, MOST_POINTS)

    def __reduce__(self) -> tuple[Any, ...]:
        return PointEvaluator, (self.function,)

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """The results, shape (count, entries); each argument has ``count`` rows, or one row for all points.

        Of several results the entries stand side by side, each result by its columns.
        """
        results = self._blank((count, self.width))
        if count == 0:
            return results
        if count >= POINTS_FOR_NUMPY and self._read(count):
            self._by_columns(arguments, results)
            return results
        with self._busy:
            first = 0
            while first < count:
                room = self._room(count - first)
                part = slice(first, min(first + room.size, count))
                whole = part.stop - first == count
                given = arguments if whole else [a if len(a) == 1 else a[part] for a in arguments]
                room.evaluate(part.stop - first, given, results[part])
                first = part.stop
        return results

    def bound(self, inputs: Sequence[np.ndarray], output: np.ndarray) -> Callable[[], None]:
        """A call that reads ``inputs`` and writes ``output``, the one result, in place: microseconds a call.

        The arrays hold one point a row, are contiguous, in the order of :meth:`order`, and must not be replaced while
        the call is in use. It is taken to be called often, so that for many points NumPy's form is read at once.

        Raises ValueError for an array of another shape than (points, entries): what is read in place would be taken
        for something else in silence.
        """
        for i, array in enumerate(inputs):
            if array.shape != (expected := (len(output), self.function.numel_in(i))):
                raise ValueError(f"inputs[{i}] has the shape {array.shape}, and must have {expected}: a point each row")
        if not len(output):
            return lambda: None
        if self.order(len(output)) == "F":
            return _InColumns(self.columns, np.flatnonzero(self.occupied), inputs, output)
        return _InPlace(self.function.map(len(output)), inputs, [output])

    def order(self, count: int) -> Literal["C", "F"]:
        """How arrays of so many points lie in memory for :meth:`bound`: by columns for NumPy, by points for CasADi."""
        return "F" if count >= POINTS_FOR_NUMPY and self._read(MOST_POINTS) else "C"

    @cached_property
    def occupied(self) -> np.ndarray:
        """True (entries,) for those that are not zero for every argument, as far as the expressions show."""
        occupied = np.zeros(self.width, dtype=bool)
        for places in self._places:
            occupied[places] = True
        return occupied

    @cached_property
    def columns(self) -> Columns:
        """The function of columns that NumPy broadcasts, to a list of them: one for each nonzero of the results.

        It takes one argument for each input: a scalar or array for a scalar input, a sequence of them for a vector.
        Raises TypeError for a function that is not an SXFunction, ValueError where NumPy has no form of an operation.
        """
        return _Instructions(self.function)

    @property
    def vectorised(self) -> bool:
        """Whether NumPy has a form of all of it, so that there are :attr:`columns`."""
        try:
            return self.columns is not None
        except (TypeError, ValueError):
            return False

    def _read(self, count: int) -> bool:
        """Whether the instructions have been read, or are now, since so many points are asked for."""
        self._before_reading -= count
        if self._before_reading > 0:
            return False
        if not self.vectorised:
            self._before_reading = math.inf
            return False
        return True

    def _by_columns(self, arguments: Sequence[np.ndarray], results: np.ndarray) -> None:
        columns, nonzeros = self.columns, np.flatnonzero(self.occupied)
        for first in range(0, len(results), COLUMN):
            part = slice(first, min(first + COLUMN, len(results)))
            rows, given = results[part], [list(a[0] if len(a) == 1 else a[part].T) for a in arguments]
            for place, column in zip(nonzeros, columns(*given), strict=True):
                rows[:, place] = column

    def _room(self, count: int) -> _Room:
        """Memory for so many points or fewer, all of which are wanted; for a few more where that costs nothing."""
        size = max(self.usual, 1 << min(count, POINTS_TOGETHER).bit_length() - 1)
        if size not in self._rooms:
            self._rooms[size] = _Room(self.function, size, self._places)
        return self._rooms[size]


class _InColumns:
    """The same by NumPy's form of the function, whose columns are found in the arrays once."""

    def __init__(
        self, columns: Columns, nonzeros: np.ndarray, inputs: Sequence[np.ndarray], output: np.ndarray
    ) -> None:
        parts = [slice(first, first + COLUMN) for first in range(0, len(output), COLUMN)]
        self._columns = columns
        self._parts = [([list(a[part].T) for a in inputs], [output[part, k] for k in nonzeros]) for part in parts]

    def __call__(self) -> None:
        for given, places in self._parts:
            for place, column in zip(places, self._columns(*given), strict=True):
                place[:] = column


class _InPlace:
    """A CasADi function that reads ``inputs`` and writes ``outputs`` in place; empty ones are left out."""

    def __init__(self, function: ca.Function, inputs: Sequence[np.ndarray], outputs: Sequence[np.ndarray]) -> None:
        self._buffer, self.trigger = function.buffer()
        for i, array in enumerate(inputs):
            if array.size:
                self._buffer.set_arg(i, memoryview(array))
        for i, array in enumerate(outputs):
            if array.size:
                self._buffer.set_res(i, memoryview(array))

    def __call__(self) -> None:
        self.trigger()


class _Room:
    """Memory for ``size`` points of a function, and the call that works on it.

    The nonzeros of each result go to its ``places`` among all entries.
    """

    def __init__(self, function: ca.Function, size: int, places: Sequence[slice | np.ndarray]) -> None:
        self.size = size
        inputs = [np.zeros((size, function.numel_in(i))) for i in range(function.n_in())]
        outputs = [np.zeros((size, function.nnz_out(i))) for i in range(function.n_out())]
        self._given = [(i, own) for i, own in enumerate(inputs) if own.size]
        self._found = list(zip(places, outputs, strict=True))
        self._call = _InPlace(function.map(size), inputs, outputs)

    def evaluate(self, count: int, arguments: Sequence[np.ndarray], results: np.ndarray) -> None:
        """The function at ``count`` points."""
        for i, own in self._given:
            own[:count] = arguments[i]
        self._call.trigger()
        for places, own in self._found:
            results[:, places] = own[:count]


class _Instructions:
    """See :attr:`PointEvaluator.columns`. Overflow and invalid operations give inf and NaN in silence."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self._widths = [function.nnz_in(i) for i in range(function.n_in())]
        inputs, results = ([0, *np.cumsum(sizes).tolist()] for sizes in (self._widths, _nonzeros(function)))
        self._count = int(results[-1])
        self._constants: list[float] = []
        self._steps: list[tuple[Callable[..., Any] | None, int, Any, int]] = []
        place: dict[int, int] = {}  # of CasADi's work entries: from 0 on what is computed, then inputs and constants
        first = function.sz_w()
        for i in instructions(function):
            left, right = (place.get(s, 0) for s in (i.sources[:1] + i.sources[-1:]) or (0, 0))
            if i.operation == ca.OP_INPUT:
                place[i.target] = first + inputs[i.sources[0]] + i.sources[1]
            elif i.operation == ca.OP_CONST:
                place[i.target] = first + inputs[-1] + len(self._constants)
                self._constants.append(i.constant)
            elif i.operation == ca.OP_OUTPUT:
                self._steps.append((None, results[i.place[0]] + i.place[1], left, -1))
            elif i.operation in UNARY or i.operation in BINARY:
                place[i.target] = i.target
                one = i.operation in UNARY
                operation = UNARY[i.operation] if one else BINARY[i.operation]
                self._steps.append((operation, i.target, left, -1 if one else right))
            elif isinstance(i.operation, Call):
                self._steps.append((i.operation.at, i.target, tuple(place[s] for s in i.sources), MANY))
                place[i.target] = i.target
            else:
                raise ValueError(f"{function.name()} uses `{NAMES.get(i.operation)}`, which NumPy has no form of")
        self._computed = first

    def __reduce__(self) -> tuple[Any, ...]:
        return _Instructions, (self.function,)

    def __call__(self, *arguments: Any) -> list[Any]:
        given: list[Any] = []
        for width, argument in zip(self._widths, arguments, strict=True):
            if width == 1 and not isinstance(argument, list | tuple):
                given.append(argument)
            else:
                given += argument
        largest = max((a.size for a in given if isinstance(a, np.ndarray)), default=1)
        return self._at(given) if largest <= 2 * PART else self._part_by_part(given)

    def _part_by_part(self, given: Sequence[Any]) -> list[np.ndarray]:
        """The results cut across their longest axis; they have the shape to which what is ``given`` broadcasts."""
        shape = np.broadcast_shapes(*map(np.shape, given))
        axis = int(np.argmax(shape)) - len(shape)
        results = [np.empty(shape) for _ in range(self._count)]
        step = max(1, PART * shape[axis] // math.prod(shape))
        for first in range(0, shape[axis], step):
            part = (..., slice(first, first + step), *[slice(None)] * (-1 - axis))
            varying = [np.ndim(a) >= -axis and np.shape(a)[axis] > 1 for a in given]
            found = self._at([a[part] if varies else a for a, varies in zip(given, varying, strict=True)])
            for result, column in zip(results, found, strict=True):
                result[part] = column
        return results

    def _at(self, given: Sequence[Any]) -> list[Any]:
        work: list[Any] = [None] * self._computed
        work += given
        work += self._constants
        results: list[Any] = [0.0] * self._count
        with np.errstate(all="ignore"):
            for operation, target, left, right in self._steps:
                if right >= 0:
                    work[target] = operation(work[left], work[right])  # pyright: ignore[reportOptionalCall]
                elif right == MANY:
                    work[target] = operation(*(work[k] for k in left))  # pyright: ignore[reportOptionalCall]
                elif operation is not None:
                    work[target] = operation(work[left])
                else:
                    results[target] = work[left]
        return results


def in_columns(count: int, *numbers: np.ndarray) -> list[np.ndarray]:
    """What is the same at ``count`` points, as CasADi's functions take it: arrays (k,) as (k, count)."""
    return [np.repeat(v[:, None], count, axis=1) for v in numbers]


def in_shape(columns: Iterable[Any], shape: tuple[int, ...]) -> list[np.ndarray]:
    """What :data:`Columns` give, in one ``shape``: what does not depend on the place comes as one number."""
    return [np.broadcast_to(np.asarray(c, dtype=float), shape) for c in columns]


def _nonzeros(function: ca.Function) -> list[int]:
    return [function.nnz_out(i) for i in range(function.n_out())]


class Derivatives:
    """A function with its first and second derivatives in ``k`` variables at ``m`` points.

    ``rows`` (m, 1 + k + k^2) are the value, the gradient and the columns of the Hessian.
    """

    def __init__(self, rows: np.ndarray) -> None:
        self.rows: np.ndarray = rows
        self.k: int = math.isqrt(rows.shape[1] - 1)
        if self.k * (self.k + 1) + 1 != rows.shape[1]:
            raise ValueError(f"{rows.shape[1]} entries are no value with a gradient and a Hessian")

    @property
    def value(self) -> np.ndarray:
        """The function itself, (m,)."""
        return self.rows[:, 0]

    @property
    def gradient(self) -> np.ndarray:
        """Shape (m, k)."""
        return self.rows[:, 1 : 1 + self.k]

    @property
    def hessian(self) -> np.ndarray:
        """Shape (m, k, k)."""
        return self.rows[:, 1 + self.k :].reshape(-1, self.k, self.k)
