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
    """A CasADi function of columns, evaluated at any number of points, ``chunk`` at a time."""

    def __init__(self, function: ca.Function, chunk: int = CHUNK) -> None:
        self._chunk = chunk
        self._inputs = [np.zeros((chunk, function.numel_in(i))) for i in range(function.n_in())]
        self._output = np.zeros((chunk, function.numel_out(0)))
        self._call = BufferedCall(function.map(chunk), self._inputs, self._output)

    def __call__(self, count: int, *arguments: np.ndarray) -> np.ndarray:
        """The results, shape (count, rows); each argument has ``count`` rows, or one row for all points."""
        results = np.empty((count, self._output.shape[1]))
        for first in range(0, count, self._chunk):
            size = min(self._chunk, count - first)
            for own, given in zip(self._inputs, arguments, strict=True):
                if own.shape[1]:
                    own[:size] = given[first : first + size] if len(given) == count else given
            self._call()
            results[first : first + size] = self._output[:size]
        return results
