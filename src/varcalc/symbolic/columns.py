"""CasADi functions at many points, carried out by NumPy on columns of them.

CasADi's interpreter goes through all instructions for every point, and takes
its sines and cosines from the C library; an operation of NumPy on a column of
points costs a few times less for each, once there are hundreds of them. What comes
out may hold derivatives, which :class:`Derivatives` tells apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from varcalc.symbolic.buffered import CHUNK, Pointwise
from varcalc.symbolic.instructions import BINARY, UNARY, instructions

ROWS = 1024
"""Points in a column: with it the columns at work stay in the cache."""
MANY, SOME = 1000, 200
"""Points from which on it pays to read the instructions, and to follow them once they have been read."""


class Columns:
    """An SX function with one result, evaluated on columns of points like :class:`varcalc.symbolic.buffered.Pointwise`.

    Raises ValueError where the function holds an operation that NumPy has no form of, TypeError where it is no SX
    function.
    """

    def __init__(self, function: ca.Function) -> None:
        if function.is_a("SXFunction"):
            symbols = function.sx_in()
            function = ca.Function(function.name(), symbols, [ca.cse(function(*symbols))])
        self._rows = function.numel_out(0)
        self._work = np.empty((max(1, function.sz_w()), ROWS))
        self._steps = [self._step(i.operation, i.target, i.sources, i) for i in instructions(function)]

    def _step(self, operation: int, target: int, sources: Sequence[int], i: Any) -> tuple[Any, ...]:
        """The kind of a step, a ufunc or other function for it, and where it takes and puts its numbers."""
        if operation == ca.OP_INPUT:
            return "input", None, target, sources
        if operation == ca.OP_OUTPUT:
            return "output", None, i.place[1], sources
        if operation == ca.OP_CONST:
            return "constant", i.constant, target, sources
        if operation in UNARY:
            return "operation", _into(UNARY[operation]), target, sources[:1]
        if operation in BINARY:
            return "operation", _into(BINARY[operation]), target, sources
        raise ValueError(f"operation {operation} of CasADi has no form in NumPy")

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """The results, shape (count, rows); each argument has ``count`` rows, or one row for all points."""
        results = np.zeros((count, self._rows))
        with np.errstate(all="ignore"):
            for first in range(0, count, ROWS):
                part = slice(first, min(first + ROWS, count))
                self._carry_out([a[part] if len(a) == count else a for a in arguments], results[part])
        return results

    def _carry_out(self, arguments: list[np.ndarray], results: np.ndarray) -> None:
        columns = [row[: len(results)] for row in self._work]
        # constants and inputs stand for themselves; what is computed goes into columns of its own
        work: list[Any] = list(columns)
        for kind, what, target, sources in self._steps:
            if kind == "operation":
                work[target] = what(*[work[s] for s in sources], out=columns[target])
            elif kind == "input":
                work[target] = arguments[sources[0]][:, sources[1]]
            elif kind == "constant":
                work[target] = what
            else:
                results[:, target] = work[sources[0]]


def _into(operation: Callable[..., Any]) -> Callable[..., Any]:
    """An operation that puts its result where a ufunc would."""
    if isinstance(operation, np.ufunc):
        return operation

    def carried_out(*numbers: Any, out: np.ndarray) -> np.ndarray:
        out[:] = operation(*numbers)
        return out

    return carried_out


class FewOrMany:
    """A function at a few points by CasADi, at many on columns of them; called like :class:`Pointwise`."""

    def __init__(self, function: ca.Function, chunk: int = CHUNK) -> None:
        self._function = function
        self._few = Pointwise(function, chunk)
        self._many: Callable[..., np.ndarray] | None = None

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """The results, shape (count, rows); each argument has ``count`` rows, or one row for all points."""
        if self._many is None and count >= MANY:
            self._many = self._columns()
        chosen = self._few if self._many is None or count < SOME else self._many
        return chosen(count, *arguments)

    def _columns(self) -> Callable[..., np.ndarray]:
        try:
            return Columns(self._function)
        except (TypeError, ValueError):
            return self._few


class Derivatives:
    """A function with its first and second derivatives in ``k`` variables at ``m`` points.

    ``rows`` (m, 1 + k + k^2) are the value, the gradient and the columns of the Hessian.
    """

    def __init__(self, rows: np.ndarray) -> None:
        self.rows = rows
        self.k = math.isqrt(rows.shape[1] - 1)
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
