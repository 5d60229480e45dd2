"""Focal and conjugate points: where a plane of Jacobi fields, carried along, ceases to be transversal.

The Jacobi fields that satisfy the conditions at one end form a Lagrangian
plane (X, pi), and a point is focal to that end (conjugate, when the end is
fixed) where some of them vanish: X is singular. The eigenvalues of

    W = (pi + i X) (pi - i X)^-1

lie on the unit circle, do not depend on the basis of the plane, and, as the
Legendre condition holds, pass 1 in one direction only. Counting their passages
misses no focal point, whatever its multiplicity, where the sign of det X would
miss those that come in pairs (Arnold, "Sturm theorems and symplectic
geometry", 1985; Bott; Morse index theorem: Milnor, "Morse Theory", sect. 15).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.numerics.mesh import antiderivative, gauss
from varcalc.verify.accessory import Accessory

FIELD_DEGREE = 16
"""Degree of the polynomials that stand for Jacobi fields on a panel."""
RESOLVED_TAIL = 1e-13
"""Relative size of the last Legendre coefficients of a resolved panel."""
LARGEST_NOISE, STALLED = 1e-8, 0.5
"""Tails up to which those that a bisection hardly lowers are noise of the curve, and the share that it leaves."""
PANEL_BISECTIONS = 12
SAMPLES_PER_PANEL = 6
"""Points a panel at which passages are first counted."""
LARGEST_TURN = 1.0
"""Largest turn, in radians, of an eigenvalue between neighbours."""
BRACKET_TURN = 0.05
"""The same across a bracket in which focal points are located."""
DEEPEST_BRACKET = 40
FOCAL_AT_END = 1e-6
"""Relative distance from an end within which a focal point is said to be at it."""
ZERO_ANGLE = 1e-9
"""Angle at the start of a plane that is zero but for round-off."""


class Unresolved(Exception):
    """The accessory equation could not be carried along, and why."""


@dataclass(frozen=True)
class Canonical:
    """A linear canonical system (X, pi)' = K(s) (X, pi) on an interval; N is the dimension of X.

    ``matrix(s)`` is K (m, 2 N, 2 N) in units in which X and pi are of like
    size. ``allowed(s)`` are bases of the X that pathwise conditions leave.
    """

    span: tuple[float, float]
    vertices: np.ndarray
    N: int
    matrix: Callable[[np.ndarray], np.ndarray]
    allowed: Callable[[np.ndarray], np.ndarray | None]

    @cached_property
    def panels(self) -> list[LegendreSeries]:
        """The fundamental matrix of each panel, the panels bisected until they resolve it."""
        done: list[LegendreSeries] = []
        waiting = np.stack([self.vertices[:-1], self.vertices[1:]], axis=1)
        before = np.full(len(waiting), np.inf)
        for depth in range(PANEL_BISECTIONS + 1):
            fields = self._fundamental(waiting)
            size = np.abs(fields).max((1, 2, 3))
            tail = np.abs(fields[:, -2:]).max((1, 2, 3)) / size
            if not np.isfinite(fields).all():
                raise Unresolved("the accessory equation is not a number somewhere along the curve")
            noise = (tail <= LARGEST_NOISE) & (tail > STALLED * before)
            good = (tail <= RESOLVED_TAIL) | noise | (depth == PANEL_BISECTIONS)
            done += [LegendreSeries(a, b, c) for (a, b), c, ok in zip(waiting, fields, good, strict=True) if ok]
            waiting, before = waiting[~good], np.tile(tail[~good], 2)
            if not len(waiting):
                break
            middle = waiting.mean(1)
            waiting = np.concatenate([np.stack([waiting[:, 0], middle], 1), np.stack([middle, waiting[:, 1]], 1)])
        return sorted(done, key=lambda panel: panel.left)

    def _fundamental(self, intervals: np.ndarray) -> np.ndarray:
        """Legendre coefficients (E, FIELD_DEGREE + 1, 2 N, 2 N) of the fundamental matrices, by Gauss collocation."""
        nodes, integral = gauss(FIELD_DEGREE)[0], antiderivative(FIELD_DEGREE)
        at_nodes = np.polynomial.legendre.legvander(nodes, FIELD_DEGREE) @ integral
        count, size = len(nodes), 2 * self.N
        half = 0.5 * np.diff(intervals, axis=1)
        s = intervals.mean(1)[:, None] + half * nodes
        K = self.matrix(s.ravel()).reshape(len(intervals), count, size, size)
        # slopes G_i = K_i (1 + h sum_j a_ij G_j)
        system = -np.einsum("ij,eiab->eiajb", at_nodes, K * half[:, :, None, None])
        system = system.reshape(len(intervals), count * size, count * size) + np.eye(count * size)
        slopes = np.linalg.solve(system, K.reshape(len(intervals), count * size, size))
        slopes = slopes.reshape(len(intervals), count, size, size)
        fields = np.einsum("ki,eiab->ekab", integral, slopes) * half[:, :, None, None]
        fields[:, 0] += np.eye(size)
        return fields


@dataclass(frozen=True)
class LegendreSeries:
    """A matrix function on [left, right] by its Legendre coefficients (FIELD_DEGREE + 1, rows, columns)."""

    left: float
    right: float
    coefficients: np.ndarray

    def __call__(self, s: float) -> np.ndarray:
        """The matrix at s, which may lie a little outside."""
        local = (2.0 * s - self.left - self.right) / (self.right - self.left)
        row = np.polynomial.legendre.legvander(np.array([local]), FIELD_DEGREE)[0]
        return np.tensordot(row, self.coefficients, 1)


def canonical(accessory: Accessory, backward: bool = False, span: tuple[float, float] | None = None) -> Canonical:
    """The accessory system in balanced units, from either end, on part of the interval.

    A Curve's speed and its momentum change roles: it is free on every part of the curve.
    """
    vertices = accessory.along.vertices
    a, b = span or accessory.along.span
    cut = np.concatenate([[a], vertices[(vertices > a) & (vertices < b)], [b]])
    unit = np.concatenate([accessory.scale, 1.0 / accessory.scale])
    swap = swapped(accessory)

    def matrix(s: np.ndarray) -> np.ndarray:
        """The matrices (m, 2N, 2N) at s (m,)."""
        K = swap @ (accessory.canonical(a + b - s if backward else s) * (unit / unit[:, None])) @ swap.T
        if backward:
            N = accessory.N
            K[:, :N, :N], K[:, N:, N:] = -K[:, :N, :N], -K[:, N:, N:]
        return K

    def allowed(s: np.ndarray) -> np.ndarray | None:
        return accessory.allowed(a + b - s if backward else s)

    return Canonical((a, b), np.sort(a + b - cut) if backward else cut, accessory.N, matrix, allowed)


def swapped(accessory: Accessory) -> np.ndarray:
    """The canonical change (X, pi) -> (pi, -X) of the gauge's pair; the identity where there is none."""
    out, N, k = np.eye(2 * accessory.N), accessory.N, accessory.gauge
    if k is not None:
        out[[k, N + k]] = 0.0
        out[k, N + k], out[N + k, k] = 1.0, -1.0
    return out


def balanced(accessory: Accessory, plane: np.ndarray, backward: bool = False) -> np.ndarray:
    """A plane (2 N, columns) in the coordinates of :func:`canonical`."""
    N = accessory.N
    out = plane / np.concatenate([accessory.scale, 1.0 / accessory.scale])[:, None]
    out = swapped(accessory) @ out
    if backward:
        out[N:] *= -1.0
    return out


@dataclass(frozen=True)
class Angle:
    """The unitary matrix W of a plane at s, the angles of its eigenvalues in [0, 2 pi), the basis it is written in."""

    s: float
    W: np.ndarray
    angles: np.ndarray
    basis: np.ndarray | None

    def turn(self, other: Angle) -> np.ndarray:
        """The angles by which the eigenvalues turn on the way to ``other``."""
        W = other.W
        if self.basis is not None and other.basis is not None:
            left, _, right = np.linalg.svd(self.basis.T @ other.basis)
            rotation = left @ right
            W = rotation @ W @ rotation.T
        return np.angle(np.linalg.eigvals(W @ self.W.conj().T))


class CarriedPlane:
    """A Lagrangian plane carried along: ``plane`` (2 N, columns) at the start of ``system``."""

    def __init__(self, system: Canonical, plane: np.ndarray) -> None:
        self.system = system
        self.frames: list[LegendreSeries] = []
        frame = np.linalg.qr(plane)[0]
        for panel in system.panels:
            self.frames.append(LegendreSeries(panel.left, panel.right, panel.coefficients @ frame))
            frame = np.linalg.qr(panel(panel.right) @ frame)[0]
        self.last = frame

    def angle(self, panel: LegendreSeries, s: float, starting: bool = False) -> Angle:
        """W at s on a panel; ``starting`` takes angles that round-off put just below 2 pi for zero."""
        N = self.system.N
        frame = panel(s)
        basis = self.system.allowed(np.array([np.clip(s, *self.system.span)]))
        X, pi = frame[:N], frame[N:]
        if basis is not None:
            basis = basis[0]
            X, pi = basis.T @ X, basis.T @ pi
        q = np.linalg.qr(np.vstack([X, pi]))[0]
        half = len(X)
        U = q[half:] + 1j * q[:half]
        W = U @ U.T  # unitary and symmetric, as the basis is orthonormal and the plane Lagrangian
        angles = np.sort(np.angle(np.linalg.eigvals(W)) % (2 * np.pi))
        if starting:
            angles = np.sort(np.where(angles > 2 * np.pi - ZERO_ANGLE, 0.0, angles))
        return Angle(s, W, angles, basis)

    @cached_property
    def points(self) -> np.ndarray:
        """The focal points inside, the start excluded, each as often as it counts, and short of the end."""
        a, b = self.system.span
        return np.array([s for s in self._passages() if s < b - FOCAL_AT_END * (b - a)])

    def _passages(self) -> list[float]:
        found: list[float] = []
        before: Angle | None = None
        leaving = True  # the start is left when every angle is: that of a level not before it is felt
        for k, panel in enumerate(self.frames):
            for s in np.linspace(panel.left, panel.right, SAMPLES_PER_PANEL + 1)[0 if k == 0 else 1 :]:
                at = self.angle(panel, float(s), leaving or k == 0)
                leaving = leaving and bool((at.angles < ZERO_ANGLE).any())
                if before is not None:
                    found += self._between(panel, before, at, 0)
                elif at.angles.size:
                    angles = np.where(at.angles < ZERO_ANGLE, 0.0, at.angles)
                    at = Angle(at.s, at.W, angles, at.basis)
                before = at
        return sorted(found)

    @cached_property
    def at_end(self) -> list[float]:
        """Focal points within FOCAL_AT_END of the end, before or behind it."""
        a, b = self.system.span
        panel, reach = self.frames[-1], FOCAL_AT_END * (b - a)
        return self._between(panel, self.angle(panel, b - reach), self.angle(panel, b + reach), 0)

    def _between(self, panel: LegendreSeries, left: Angle, right: Angle, depth: int) -> list[float]:
        turn = left.turn(right)
        if np.abs(turn).max(initial=0.0) > LARGEST_TURN:
            return self._halved(panel, left, right, depth)
        passages = (left.angles.sum() + turn.sum() - right.angles.sum()) / (2 * np.pi)
        count = round(float(passages))
        if count <= 0:
            return []
        if np.abs(turn).max() > BRACKET_TURN:
            return self._halved(panel, left, right, depth)
        return [self._located(panel, left, right, j) for j in range(1, count + 1)]

    def _halved(self, panel: LegendreSeries, left: Angle, right: Angle, depth: int) -> list[float]:
        if depth > DEEPEST_BRACKET:
            raise Unresolved(f"the Jacobi fields turn too fast near {left.s:.6g}")
        starting = panel is self.frames[0] or bool((left.angles < ZERO_ANGLE).any())
        middle = self.angle(panel, 0.5 * (left.s + right.s), starting)
        return self._between(panel, left, middle, depth + 1) + self._between(panel, middle, right, depth + 1)

    def _located(self, panel: LegendreSeries, left: Angle, right: Angle, j: int) -> float:
        """The j-th passage in a bracket across which no eigenvalue turns by more than BRACKET_TURN."""
        from scipy.optimize import brentq

        # the circle is cut in its widest gap, so that the sorted angles are continuous across the bracket
        around = np.concatenate([left.angles, [left.angles[0] + 2 * np.pi]])
        widest = int(np.argmax(np.diff(around)))
        cut = 0.5 * (around[widest] + around[widest + 1])
        target = (-cut) % (2 * np.pi)
        place = int(((left.angles - cut) % (2 * np.pi) < target).sum()) - j

        def miss(s: float) -> float:
            return float(np.sort((self.angle(panel, s).angles - cut) % (2 * np.pi))[place] - target)

        low, high = miss(left.s), miss(right.s)
        if not low < 0.0 <= high:
            return left.s if abs(low) < abs(high) else right.s
        width = self.system.span[1] - self.system.span[0]
        return float(brentq(miss, left.s, right.s, xtol=1e-16 * width, rtol=4 * np.finfo(float).eps))
