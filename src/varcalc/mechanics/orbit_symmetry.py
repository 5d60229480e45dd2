"""Symmetries of closed orbits, and coordinates in which a part of the orbit has ends of its own.

An orbit that repeats itself, q(t + T/m) = A q(t), or goes back the way it came, q(-t) = B q(t), is known from a part
of its period. Where both hold, B and A B are reversals about the two ends of half a part, and the orbit sets out from
what B keeps and arrives at what A B keeps (A. Chenciner, R. Montgomery, Ann. Math. 152 (2000), 881). A frame that
turns at constant rates carries the one into the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Fixed, Free, Periodic, reals
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

SAME_ENTRIES = 1e-9
"""By how much entries of matrices that are the same may differ."""
MOST_ELEMENTS = 10_000
"""Of a group of symmetries."""


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Repeats(Brief):
    """The orbit is ``times`` times the same: q(t + T/times) = ``matrix`` q(t), with a matrix (n, n).

    Raises TypeError or ValueError unless ``times`` is a whole number from 2 on and that power of the matrix is one.
    """

    matrix: Any
    times: int

    def __post_init__(self) -> None:
        if isinstance(self.times, bool) or not isinstance(self.times, int) or self.times < 2:
            raise ValueError(f"Repeats.times must be a whole number from 2 on, not {self.times!r}")
        _check_power("Repeats", _square("Repeats", self.matrix), self.times)


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Returns(Brief):
    """The orbit goes back the way it came: q(-t) = ``matrix`` q(t), with a matrix (n, n) that is its own inverse.

    Raises TypeError or ValueError for another matrix.
    """

    matrix: Any

    def __post_init__(self) -> None:
        _check_power("Returns", _square("Returns", self.matrix), 2)


def _square(name: str, matrix: Any) -> np.ndarray:
    array = reals("matrix", matrix)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not np.all(np.isfinite(array)):
        raise ValueError(f"{name}.matrix must be a square matrix of finite numbers, not {matrix!r}")
    return array


def _check_power(name: str, matrix: np.ndarray, power: int) -> None:
    off = np.abs(np.linalg.matrix_power(matrix, power) - np.eye(len(matrix))).max()
    if off > SAME_ENTRIES:
        raise ValueError(f"{name}.matrix, {power} times, must be the identity; it misses it by {off:.2g}")


@dataclass(frozen=True)
class TurningFrame:
    """Coordinates z of q = M(t) z on the first ``part`` of a period, M(t) = ``axes`` turned at constant rates.

    ``planes`` are pairs of columns with the angle by which each pair turns over the part. ``free`` says of every
    column whether it is free at the start and at the end; None where the end is the start again, in z.
    """

    part: float
    axes: np.ndarray
    planes: tuple[tuple[int, int, float], ...]
    free: np.ndarray | None

    def matrix(self, share: Expression) -> Expression:
        """M (n, n) after a ``share`` of the part."""
        columns = [ca.SX(self.axes[:, k]) for k in range(len(self.axes))]
        for first, second, angle in self.planes:
            cos, sin = ca.cos(angle * share), ca.sin(angle * share)
            one, other = columns[first], columns[second]
            columns[first], columns[second] = cos * one + sin * other, cos * other - sin * one
        return ca.horzcat(*columns)

    def at(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """M (m, n, n) and its derivatives by the share, after shares (m,) of the part."""
        n = len(self.axes)
        columns = self._columns(len(share), np.reshape(share, (-1, 1)))
        values, slopes = (part.reshape(-1, n, n).swapaxes(1, 2) for part in np.split(columns, 2, axis=1))
        return values, slopes

    @cached_property
    def _columns(self) -> PointEvaluator:
        symbol = ca.SX.sym("share")
        columns = ca.densify(ca.vec(self.matrix(symbol)))
        return PointEvaluator(ca.Function("frame", [symbol], [columns, ca.densify(ca.jacobian(columns, symbol))]))

    def ends(self, length: float) -> tuple[Any, Any]:
        """The ends in z of a problem on [0, length]."""
        if self.free is None:
            closed = Periodic(0.0, length, len(self.axes))
            return closed, closed
        return _end(0.0, self.free[0]), _end(length, self.free[1])


def _end(x: float, free: np.ndarray) -> Fixed | Free:
    if np.all(free):
        return Free(x, len(free))
    return Fixed(x, [None if one else 0.0 for one in free])


def turning_frame(symmetry: Sequence[Repeats | Returns], n: int) -> TurningFrame:
    """The frame for orbits of n coordinates with at most one symmetry of each kind; ValueError where there is none."""
    repeats, returns = (_only(symmetry, kind) for kind in (Repeats, Returns))
    if len(symmetry) != sum(one is not None for one in (repeats, returns)):
        raise TypeError("symmetry must hold mechanics.Repeats and mechanics.Returns, one of each at most")
    for one in symmetry:
        if np.shape(one.matrix) != (n, n):
            raise ValueError(f"{type(one).__name__}.matrix must have the shape ({n}, {n}), not {np.shape(one.matrix)}")
    times = repeats.times if repeats is not None else 1
    turn = np.asarray(repeats.matrix, dtype=float) if repeats is not None else np.eye(n)
    if returns is None:
        root = _metric([turn])
        axes, planes = _turned(root @ turn @ np.linalg.inv(root))
        return TurningFrame(1 / times, np.linalg.inv(root) @ axes, planes, None)
    back = np.asarray(returns.matrix, dtype=float)
    _check_power("Repeats.matrix times Returns", turn @ back, 2)
    root = _metric([turn, back])
    start, end = (root @ one @ np.linalg.inv(root) for one in (back, turn @ back))
    axes, planes, free = _between_reflections(start, end)
    return TurningFrame(1 / (2 * times), np.linalg.inv(root) @ axes, planes, free)


def _only(symmetry: Sequence[Repeats | Returns], kind: type[Any]) -> Any:
    found = [one for one in symmetry if isinstance(one, kind)]
    return found[0] if found else None


def _metric(generators: Sequence[np.ndarray]) -> np.ndarray:
    """A matrix R in which all R g R⁻¹ are orthogonal: a root of the mean of gᵀg over the group."""
    group = [np.eye(len(generators[0]))]
    for one in group:
        for generator in generators:
            new = one @ generator
            if not any(np.abs(new - known).max() < SAME_ENTRIES for known in group):
                group.append(new)
        if len(group) > MOST_ELEMENTS:
            raise ValueError("the symmetries make no finite group")
    return np.linalg.cholesky(np.mean([one.T @ one for one in group], axis=0)).T


def _eigenspaces(symmetric: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """The eigenvalues of a symmetric matrix with bases (n, k) of their spaces, those that agree as one."""
    values, vectors = np.linalg.eigh((symmetric + symmetric.T) / 2)
    starts = np.flatnonzero(np.diff(values, prepend=-np.inf) > SAME_ENTRIES)
    return [(float(values[a]), vectors[:, a:b]) for a, b in zip(starts, [*starts[1:], len(values)], strict=True)]


def _turned(turn: np.ndarray) -> tuple[np.ndarray, tuple[tuple[int, int, float], ...]]:
    """Axes, and the planes in which an orthogonal ``turn`` is a rotation; ValueError where it reverses a line."""
    columns: list[np.ndarray] = []
    planes: list[tuple[int, int, float]] = []
    for value, basis in _eigenspaces(turn + turn.T):
        cosine = np.clip(value / 2, -1, 1)
        if 1 - cosine < SAME_ENTRIES:
            columns += list(basis.T)
            continue
        left = basis
        while left.shape[1] > 0:
            one = left[:, 0]
            across = turn @ one - cosine * one
            sine = np.linalg.norm(across)
            if sine < SAME_ENTRIES and left.shape[1] == 1:
                raise ValueError(
                    "Repeats.matrix reverses an odd number of directions, so that no frame turns into it; give its "
                    "square with half the times"
                )
            other, angle = (across / sine, np.arctan2(sine, cosine)) if sine >= SAME_ENTRIES else (left[:, 1], np.pi)
            planes.append((len(columns), len(columns) + 1, float(angle)))
            columns += [one, other]
            left = _without(left, np.column_stack([one, other]))
    return np.column_stack(columns), tuple(planes)


def _without(basis: np.ndarray, gone: np.ndarray) -> np.ndarray:
    """A basis of what is left of the space of a ``basis`` (n, k) at right angles to ``gone`` (n, l)."""
    rest = basis - gone @ (gone.T @ basis)
    left, sizes, _ = np.linalg.svd(rest, full_matrices=False)
    return left[:, sizes > 0.5]


def _between_reflections(
    start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, tuple[tuple[int, int, float], ...], np.ndarray]:
    """Axes, planes, and which columns are free (2, n), between what two symmetric reflections keep."""
    columns: list[np.ndarray] = []
    planes: list[tuple[int, int, float]] = []
    free: list[tuple[bool, bool]] = []
    for value, basis in _eigenspaces(start @ end + end @ start):
        cosine = np.clip(value / 2, -1, 1)  # of twice the angle between the spaces
        own = basis.T @ start @ basis
        for kept, vectors in _eigenspaces(own):
            inside = basis @ vectors
            if 1 - abs(cosine) < SAME_ENTRIES:  # kept or reversed by both, or by one
                columns += list(inside.T)
                free += [(kept > 0, (kept > 0) == (cosine > 0))] * inside.shape[1]
            elif kept > 0:
                for one in inside.T:
                    across = end @ one - cosine * one
                    columns_now = len(columns)
                    angle = np.arctan2(np.linalg.norm(across), cosine) / 2
                    planes.append((columns_now, columns_now + 1, float(angle)))
                    columns += [one, across / np.linalg.norm(across)]
                    free += [(True, True), (False, False)]
    return np.column_stack(columns), tuple(planes), np.array(free).T
