"""The discretised functional of one curve on one element, on memory of its own: what a single value is solved with.

The same arithmetic as :mod:`varcalc.methods.ritz.batch`, of which a batch of one value has the calls of many
without their work.
"""

from __future__ import annotations

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.ritz.batch import SEVERAL, Basis, prepare
from varcalc.methods.ritz.integrands import pointwise
from varcalc.numerics.mesh import gauss
from varcalc.symbolic.buffered import BufferedCall


class Level:
    """Polynomials of one degree; :meth:`place` tells where the curve runs, :meth:`evaluate` at which unknowns.

    ``variables`` (2, Q, n) holds (y, y') at the Gauss points, ``out`` (Q, 1 + k + k²) what is evaluated there: value,
    gradient and Hessian in the k = 2 n variables. ``flat`` (Q k, N) takes the unknowns to the variables point by
    point, ``weighted`` (N, Q k) is its transpose times the weights.
    """

    def __init__(self, form: Form, degree: int) -> None:
        prepare(form)
        self.form, self.basis, self.n = form, Basis.of(form, degree), form.n
        n, count = form.n, self.basis.count
        self.span, self.nodes_and_weights = (np.nan, np.nan), gauss(count)
        self.variables = np.zeros((2, count, n))
        self.x, self.parameters = np.zeros((count, 1)), np.zeros((count, form.problem.parameter_values.size))
        self.out = np.zeros((count, 1 + 2 * n + 4 * n * n))
        blank = np.zeros((count, 0))
        inputs = [self.x, self.variables[0], self.variables[1], blank, self.parameters, blank]
        self._call = BufferedCall(pointwise(form).map(count), inputs, self.out)
        self._values = self.out[:, 0]
        self._gradients = self.out[:, 1 : 1 + 2 * n]
        self.hessians = self.out[:, 1 + 2 * n :].reshape(count, 2 * n, 2 * n)

    def place(self, span: np.ndarray, fixed: np.ndarray, parameters: np.ndarray) -> None:
        """The curve over ``span`` (2,) in s, with what is ``fixed`` at both ends (2 n,), at parameter values."""
        if tuple(span) != self.span:
            self._stretch(span)
        self.parameters[:] = parameters
        self.fixed = fixed[self.basis.held_ends]
        self.offset = self._known @ self.fixed

    def _stretch(self, span: np.ndarray) -> None:
        """Tables for an interval, kept until another one is asked for."""
        self.span = tuple(span)
        self.length = float(span[1] - span[0])
        half, n, count = 0.5 * self.length, self.n, self.basis.count
        nodes, weights = self.nodes_and_weights
        self.x[:, 0], self.weights = span[0] + half * (1 + nodes), half * weights
        scale = np.repeat([1.0, 1.0 / half], n)
        self._second = self.weights[:, None, None] * np.outer(scale, scale)
        self.matrix = self.basis.matrix * scale[:, None]
        self.flat = self.matrix.reshape(count * 2 * n, -1)
        self.weighted = np.ascontiguousarray((self.flat * np.repeat(self.weights, 2 * n)[:, None]).T)
        known = self.basis.known.T.reshape(count, 2 * n, -1) * scale[:, None]
        self._columns, self._known = (
            np.ascontiguousarray(table.reshape(count, 2, n, -1).swapaxes(0, 1).reshape(2 * count * n, -1))
            for table in (self.matrix, known)
        )

    def moved(self, z: np.ndarray) -> np.ndarray:
        """What unknowns add to the variables: (2, Q, n)."""
        return (self._columns @ z).reshape(self.variables.shape)

    def evaluate(self, z: np.ndarray) -> float:
        """The functional, and what derivatives are made of; inf outside the guarded domain."""
        np.dot(self._columns, z, out=self.variables.reshape(-1))
        self.variables.reshape(-1)[:] += self.offset
        self._call()
        if self.form.one_sided and (self.variables[0][:, self.form.one_sided] < 0).any():
            return np.inf
        return float(self.weights @ self._values)

    @property
    def scale(self) -> float:
        """The sum of the absolute contributions to the functional."""
        return float(self.weights @ np.abs(self._values))

    def gradient(self) -> np.ndarray:
        """By the unknowns; (N,)."""
        return self.weighted @ self._gradients.ravel()

    def assembled(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix (N, N) of pointwise quadratic forms (Q, k, k)."""
        if self.n > SEVERAL:
            return self.basis.assembled((blocks * self._second)[None])[0]
        return self.weighted @ (blocks @ self.matrix).reshape(self.flat.shape)

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """All coefficients, those of the ends included."""
        out = np.empty(self.basis.size)
        out[self.basis.free], out[self.basis.held] = z, self.fixed
        return out

    def legendre(self) -> bool:
        """Whether L_y'y' is positive at all points."""
        top = self.hessians[:, self.n :, self.n :]
        if self.n == 1:
            return bool(top.min() > 0.0)
        if self.n == 2:
            a, b, d = top[:, 0, 0], top[:, 0, 1], top[:, 1, 1]
            return bool(a.min() > 0.0 and (a * d - b * b).min() > 0.0)
        try:
            np.linalg.cholesky(top)
        except np.linalg.LinAlgError:
            return False
        return True
