"""Calls of CasADi functions on memory of their own.

A call with NumPy arrays converts each of them, which costs far more than
evaluating a small Lagrangian; a call on memory handed over once costs
microseconds.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

CHUNK = 64
"""Points evaluated in one go by :class:`Pointwise`, unless it is told otherwise."""


class BufferedCall:
    """A CasADi function that reads ``inputs`` and writes ``output`` in place: microseconds a call.

    The arrays are contiguous, hold one point a row where ``function`` is a map
    over points, and must not be replaced while the call is in use.
    """

    def __init__(self, function: ca.Function, inputs: Sequence[np.ndarray], output: np.ndarray) -> None:
        self._buffer, self._trigger = function.buffer()
        for i, array in enumerate(inputs):
            self._buffer.set_arg(i, memoryview(array))
        self._buffer.set_res(0, memoryview(output))

    def __call__(self) -> None:
        """Read the inputs, write the output."""
        self._trigger()


class Pointwise:
    """A CasADi function of columns, evaluated at any number of points, ``chunk`` at a time.

    Of several results the entries stand side by side, each result by its columns; zeros that CasADi knows of are put
    in here, which is cheaper than telling it to.
    """

    def __init__(self, function: ca.Function, chunk: int = CHUNK) -> None:
        self._chunk = chunk
        self._buffer, self._trigger = function.map(chunk).buffer()
        self._inputs: list[tuple[int, np.ndarray]] = []
        for i in range(function.n_in()):
            if width := function.numel_in(i):
                own = np.zeros((chunk, width))
                self._inputs.append((i, own))
                self._buffer.set_arg(i, memoryview(own))
        self._outputs: list[tuple[slice | np.ndarray, np.ndarray]] = []
        self.width, known = 0, 0
        for i in range(function.n_out()):
            count, full = function.nnz_out(i), function.numel_out(i)
            own = np.zeros((chunk, count))
            self._buffer.set_res(i, memoryview(own))
            places: slice | np.ndarray = slice(self.width, self.width + full)
            if count < full:
                places = self.width + np.array(function.sparsity_out(i).find(), dtype=int)
            self._outputs.append((places, own))
            self.width, known = self.width + full, known + count
        self.occupied = np.ones(self.width, dtype=bool)
        """Entries that are not zero for every argument, as far as the expressions show."""
        if known < self.width:
            self.occupied[:] = False
            for places, _ in self._outputs:
                self.occupied[places] = True
        self._blank = np.empty if known == self.width else np.zeros

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """The results, shape (count, entries); each argument has ``count`` rows, or one row for all points."""
        results = self._blank((count, self.width))
        if count <= self._chunk:
            for i, own in self._inputs:
                own[:count] = arguments[i]
            self._trigger()
            for places, own in self._outputs:
                results[:, places] = own[:count]
            return results
        for first in range(0, count, self._chunk):
            size = min(self._chunk, count - first)
            for i, own in self._inputs:
                given = arguments[i]
                own[:size] = given[first : first + size] if len(given) == count else given
            self._trigger()
            for places, own in self._outputs:
                results[first : first + size, places] = own[:size]
        return results
