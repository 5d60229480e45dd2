"""Jacobi's accessory equation in canonical form.

The second variation of the Lagrangian function is the integral of a quadratic
form 2 Omega(X, w) = w R w + 2 w S X + X P X, where X holds all that a
variation changes and w its highest derivative, with X' = A X + B w:

* the variations eta of the functions (at second order eta and eta'),
* for each prescribed integral its own first variation xi, xi' = g_y eta + g_y' eta',
  which vanishes at both ends (Bolza's and Hestenes' extra rows),
* the variations of the unknown numbers, constant along the curve.

Its Euler-Lagrange equation is the canonical system X' = A X + B w,
pi' = P X + S^T w - A^T pi with R w = B^T pi - S X (Gelfand and Fomin,
"Calculus of Variations", sect. 26-29; Hestenes, "Calculus of Variations and
Optimal Control Theory", ch. 3). Under pathwise conditions phi(s, y) = 0 the
slope w keeps phi_y eta = 0, by a multiplier of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.verify.along_curve import AlongCurve, inner_points

SCALE_POINTS = 7
"""Points an element at which typical sizes are taken."""


@dataclass(frozen=True)
class Coefficients:
    """The quadratic form and its side conditions at m points; see the module's text for the letters."""

    A: np.ndarray
    B: np.ndarray
    R: np.ndarray
    S: np.ndarray
    P: np.ndarray
    C: np.ndarray
    C_rate: np.ndarray


class Accessory:
    """The accessory system along one extremal; states (X, pi) have ``2 N`` entries."""

    def __init__(self, along: AlongCurve) -> None:
        self.along = along
        n, m, levels, numbers = along.n, along.order, len(along.integrals), len(along.numbers)
        self.functions = n * m
        self.levels = slice(n * m, n * m + levels)
        self.numbers = slice(self.levels.stop, self.levels.stop + numbers)
        self.N = self.numbers.stop
        s = along.symbols
        whole = along.whole
        variables = ca.vertcat(s.y, *s.slopes, s.unknowns)
        hessian, gradient = ca.hessian(whole.expression, variables)
        kind = s.kind
        integrands = ca.vertcat(kind(0, 1), *along.integrals)
        pathwise = ca.jacobian(ca.vertcat(kind(0, 1), *along.paths), s.y)
        self._evaluate = along.function(
            hessian,
            ca.jacobian(integrands, variables),
            pathwise,
            _total_rate(along, pathwise),
            gradient,
            ca.gradient(whole.expression, s.x),
            integrands,
        )

    @property
    def gauge(self) -> int | None:
        """The place of a Curve's speed among X: it says how the curve is run through, not where it goes."""
        return self.N - 1 if self.along.form.coordinates.gauged else None

    def coefficients(self, s: np.ndarray) -> Coefficients:
        """The accessory system's coefficients at s (m,)."""
        H, g, C, C_rate, *_ = self._evaluate(s)
        along, n, m = self.along, self.along.n, len(s)
        q, top, u = self.functions, slice(self.functions, self.functions + n), slice(self.functions + n, H.shape[1])
        A, B = np.zeros((m, self.N, self.N)), np.zeros((m, self.N, n))
        B[:, q - n : q] = np.eye(n)
        if along.order == 2:
            A[:, :n, n:q] = np.eye(n)
        A[:, self.levels, :q], A[:, self.levels, self.numbers] = g[:, :, :q], g[:, :, u]
        B[:, self.levels] = g[:, :, top]
        S, P = np.zeros((m, n, self.N)), np.zeros((m, self.N, self.N))
        S[:, :, :q], S[:, :, self.numbers] = H[:, top, :q], H[:, top, u]
        P[:, :q, :q], P[:, self.numbers, self.numbers] = H[:, :q, :q], H[:, u, u]
        P[:, :q, self.numbers], P[:, self.numbers, :q] = H[:, :q, u], H[:, u, :q]
        return Coefficients(A, B, H[:, top, top], S, P, C, C_rate)

    def rates(self, s: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Along the extremal itself: dX/ds (N,), dp/ds (N,) and the partial derivative of H by s (first order)."""
        *_, gradient, by_s, integrands = (v[0] for v in self._evaluate(np.array([s])))
        n = self.along.n
        state, momentum = np.zeros(self.N), np.zeros(self.N)
        state[:n] = self.along.evaluate(np.array([s]), 1)[:, 0]
        state[self.levels] = integrands.ravel()
        momentum[:n], momentum[self.numbers] = gradient[:n, 0], gradient[2 * n :, 0]
        return state, momentum, float(by_s.item())

    @cached_property
    def scale(self) -> np.ndarray:
        """The unit of each entry of X, such that X and pi (in the inverse units) are of like size; shape (N,)."""
        c = self.coefficients(inner_points(self.along, SCALE_POINTS))
        length, n = self.along.length, self.along.n
        stiffness = _typical(np.abs(np.einsum("maa->ma", c.R)).mean(0))
        unit = np.ones(self.N)
        for k in range(self.along.order):
            unit[k * n : (k + 1) * n] = length ** (2 * (self.along.order - k) - 1) / stiffness
        levels = np.abs(c.B[:, self.levels]).mean(0) + length * np.abs(c.A[:, self.levels, :n]).mean(0)
        unit[self.levels] = _typical((levels**2 / stiffness).max(1, initial=0.0) * length)
        mixed = (np.abs(c.S[:, :, self.numbers]).mean(0) ** 2 / stiffness[:, None]).max(0, initial=0.0)
        own = np.abs(np.einsum("maa->ma", c.P)).mean(0)[self.numbers]
        unit[self.numbers] = 1.0 / (length * _typical(mixed + own))
        return np.sqrt(unit)

    def canonical(self, s: np.ndarray) -> np.ndarray:
        """The matrix K(s) of (X, pi)' = K (X, pi), in the user's units; shape (m, 2 N, 2 N)."""
        c = self.coefficients(s)
        N, n, r, m = self.N, self.along.n, c.C.shape[1], len(s)
        kkt = np.zeros((m, n + r, n + r))
        kkt[:, :n, :n] = c.R
        kkt[:, :n, n:], kkt[:, n:, :n] = c.C.transpose(0, 2, 1), c.C
        right = np.zeros((m, n + r, 2 * N))
        right[:, :n, :N], right[:, :n, N:] = -c.S, c.B.transpose(0, 2, 1)
        right[:, n:, :n] = -c.C_rate
        solved = np.linalg.solve(kkt, right)
        w, nu = solved[:, :n], solved[:, n:]
        K = np.zeros((m, 2 * N, 2 * N))
        K[:, :N] = c.B @ w
        K[:, :N, :N] += c.A
        K[:, N:] = c.S.transpose(0, 2, 1) @ w
        K[:, N:, :N] += c.P
        K[:, N:, N:] -= c.A.transpose(0, 2, 1)
        K[:, N : N + n] += c.C_rate.transpose(0, 2, 1) @ nu
        return K

    def allowed(self, s: np.ndarray) -> np.ndarray | None:
        """Bases of the X that pathwise conditions allow at s (m,): (m, N, N - r), orthonormal; None without any."""
        if not self.along.paths:
            return None
        C = self.coefficients(s).C * self.scale[: self.along.n]
        r, n = C.shape[1:]
        out = np.zeros((len(s), self.N, self.N - r))
        out[:, :n, : n - r] = np.linalg.svd(C)[2][:, r:].transpose(0, 2, 1)
        out[:, n:, n - r :] = np.eye(self.N - n)
        return out


def _typical(sizes: np.ndarray) -> np.ndarray:
    """Sizes without zeros: the largest stands in, or 1 when all vanish."""
    largest = float(sizes.max(initial=0.0)) or 1.0
    return np.where(sizes > 1e-12 * largest, sizes, largest)


def _total_rate(along: AlongCurve, expression: ca.SX) -> ca.SX:
    """d/ds along the curve of a matrix that depends on s and y alone."""
    s = along.symbols
    column = ca.vec(ca.densify(expression))
    rate = ca.jacobian(column, s.x) + ca.jtimes(column, s.y, s.dy)
    return ca.reshape(ca.densify(rate), *expression.shape)
