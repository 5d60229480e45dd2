"""Roots in a parameter at which multipliers pass 1 or -1, or leave the unit circle elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Protocol

import numpy as np

from varcalc.mechanics.stability.surface import PiecewiseSeries
from varcalc.numerics.roots import EPSILON, bracketed_newton

CORRECTIONS = 6
"""Newton's steps by which a root is brought to the exact multipliers."""
SECTIONS = 48
"""Golden ones, by which the series is followed to where it is least."""
SLOPE_STEP = 1e-5
"""Of the range of the parameter: over what a slope is measured."""
SAFE = 16.0
"""By how many times round-off may be larger than it is taken for."""
MEETING_DISTANCE = 1e-4
"""How far from each other, and from the circle, multipliers are that meet there, by the root of what rounds them."""


class Passing(Protocol):
    """What vanishes where multipliers pass."""

    def distance(self, matrices: np.ndarray, logarithms: np.ndarray, /) -> np.ndarray:
        """A smooth function (...,) of matrices (..., N, N) and logarithms of their determinants (...,)."""
        ...

    def multipliers(self, matrices: np.ndarray) -> np.ndarray:
        """Those that pass at its zeros (m,), not numbers where none does."""
        ...


@dataclass(frozen=True)
class Real:
    """One multiplier passes a real one."""

    multiplier: float

    def distance(self, matrices: np.ndarray, logarithms: np.ndarray, /) -> np.ndarray:
        """det(Y - multiplier)."""
        if matrices.shape[-1] == 2:
            return 1 + np.exp(logarithms) - self.multiplier * np.trace(matrices, axis1=-2, axis2=-1)
        return np.linalg.det(matrices - self.multiplier * np.eye(matrices.shape[-1]))

    def multipliers(self, matrices: np.ndarray) -> np.ndarray:
        """It (m,)."""
        return np.full(len(matrices), complex(self.multiplier))


@dataclass(frozen=True)
class KreinCollision:
    """Two multipliers of a symplectic matrix meet on the unit circle, beside 1 and -1."""

    def distance(self, matrices: np.ndarray, _unused: np.ndarray, /) -> np.ndarray:
        """The discriminant of ρ = µ + 1/µ, of which there are N/2: the determinant of the sums of their powers."""
        n = matrices.shape[-1] // 2
        both = matrices + np.linalg.inv(matrices)
        power, sums = np.broadcast_to(np.eye(2 * n), both.shape), []
        for _ in range(2 * n - 1):
            sums.append(np.trace(power, axis1=-2, axis2=-1) / 2)
            power = power @ both
        rows = [np.stack(sums[k : k + n], axis=-1) for k in range(n)]
        return np.linalg.det(np.stack(rows, axis=-2))

    def multipliers(self, matrices: np.ndarray) -> np.ndarray:
        """Where the two nearest are on the circle, their mean (m,)."""
        values = np.linalg.eigvals(matrices)
        values = np.where(values.imag > MEETING_DISTANCE, values, np.nan)
        pairs = np.array(list(combinations(range(values.shape[1]), 2)))
        one, other = values[:, pairs[:, 0]], values[:, pairs[:, 1]]
        apart = np.nan_to_num(np.abs(one - other), nan=np.inf)
        rows, nearest = np.arange(len(values)), np.argmin(apart, axis=1)
        mean = ((one + other) / 2)[rows, nearest]
        met = (apart[rows, nearest] <= MEETING_DISTANCE) & (np.abs(np.abs(mean) - 1) <= MEETING_DISTANCE)
        return np.where(met, mean, np.nan)


@dataclass(frozen=True)
class Conjugate:
    """Two conjugate multipliers pass the unit circle."""

    def distance(self, matrices: np.ndarray, logarithms: np.ndarray, /) -> np.ndarray:
        """The product of all µ µ' - 1."""
        if matrices.shape[-1] == 2:
            return np.expm1(logarithms)
        values = np.linalg.eigvals(matrices)
        pairs = [values[..., i] * values[..., j] - 1 for i, j in combinations(range(values.shape[-1]), 2)]
        return np.real(np.prod(pairs, axis=0))

    def multipliers(self, matrices: np.ndarray) -> np.ndarray:
        """The one above the real axis and nearest to the circle (m,)."""
        values = np.linalg.eigvals(matrices)
        off = np.where(values.imag > MEETING_DISTANCE, np.abs(np.abs(values) - 1), np.inf)
        rows, nearest = np.arange(len(values)), np.argmin(off, axis=1)
        return np.where(off[rows, nearest] <= MEETING_DISTANCE, values[rows, nearest], np.nan)


def passings(n: int, *, conserves: bool) -> list[Passing]:
    """All ways in which multipliers of n coordinates leave the circle; ``conserves``: the symplectic form is kept."""
    both: list[Passing] = [Real(1.0), Real(-1.0)]
    if not conserves:
        return [*both, Conjugate()]
    return [*both, KreinCollision()] if n > 1 else both


@dataclass(frozen=True)
class PassingRoots:
    """Roots of a ``passing`` in the first parameter: on a ``surface``, and of the exact ``values``."""

    passing: Passing
    surface: PiecewiseSeries
    values: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def distance(self, values: np.ndarray) -> np.ndarray:
        """That of entries of matrices and logarithms of determinants (..., N² + 1)."""
        size = int((values.shape[-1] - 1) ** 0.5)
        return self.passing.distance(values[..., :-1].reshape(*values.shape[:-1], size, size), values[..., -1])

    def _at(self, at: np.ndarray, second: np.ndarray) -> np.ndarray:
        return self.distance(self.surface.at(at, second))

    def on_series(self, values: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Roots on the series (b,), with the numbers of their second values, from ``values`` on a grid."""
        level = self.distance(values)
        low, row = np.nonzero(np.sign(level[:-1]) * np.sign(level[1:]) < 0)
        left, right, rows = first[low], first[low + 1], row
        on_grid, at_row = np.nonzero(level == 0)
        sizes, signs = np.abs(level), np.sign(level)
        turning, row = np.nonzero(
            (sizes[1:-1] <= sizes[2:]) & (sizes[1:-1] <= sizes[:-2])
            & (signs[:-2] == signs[2:]) & (signs[1:-1] == signs[2:]) & (signs[2:] != 0)
        )  # fmt: skip
        a, b = first[turning], first[turning + 2]
        lowest = self._dip(a, b, second[row], signs[turning + 1, row])
        through = self._at(lowest, second[row]) * signs[turning + 1, row] < 0
        a, b, lowest, row = a[through], b[through], lowest[through], row[through]
        left, right = np.concatenate([left, a, lowest]), np.concatenate([right, lowest, b])
        rows = np.concatenate([rows, row, row])
        found = self._between(left, right, second[rows])
        return np.concatenate([found, first[on_grid]]), np.concatenate([rows, at_row])

    def _dip(self, low: np.ndarray, high: np.ndarray, second: np.ndarray, sign: np.ndarray) -> np.ndarray:
        """Where the series is least, sign included, by golden sections."""
        share = (np.sqrt(5) - 1) / 2
        for _ in range(SECTIONS if len(low) else 0):
            left, right = high - share * (high - low), low + share * (high - low)
            falls = sign * self._at(left, second) > sign * self._at(right, second)
            low, high = np.where(falls, left, low), np.where(falls, high, right)
        return (low + high) / 2

    def _slope(self, at: np.ndarray, second: np.ndarray) -> np.ndarray:
        """The slope on the series, by the series' own slopes and a difference across the entries."""
        values, rates = self.surface.at(at, second), self.surface.slopes(at, second)
        step = SLOPE_STEP * (1 + np.abs(values).max(axis=1)) / np.maximum(np.abs(rates).max(axis=1), 1e-300)
        ahead, behind = (self.distance(values + sign * step[:, None] * rates) for sign in (1, -1))
        return (ahead - behind) / (2 * step)

    def _between(self, low: np.ndarray, high: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Roots of the series between places (b,) at which its signs differ."""
        if not len(low):
            return low
        falls = self._at(low, second) > 0
        positive, negative = np.where(falls, low, high), np.where(falls, high, low)
        return bracketed_newton(
            lambda at: (self._at(at, second), self._slope(at, second)),
            positive, negative, (low + high) / 2, relative=EPSILON,
        )[0]  # fmt: skip

    def exact(self, at: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The roots of the exact matrices next to those of the series (b,), what they may be off, the multipliers."""
        step = noise = np.full(len(at), np.inf)
        multipliers = np.full(len(at), np.nan, dtype=complex)
        for _ in range(CORRECTIONS if len(at) else 0):
            values = self.values(at, second)
            size = int((values.shape[1] - 1) ** 0.5)
            with np.errstate(all="ignore"):
                slope = self._slope(at, second)
                change = -self.distance(values) / slope
                entries = 1 + np.abs(values[:, :-1]).max(axis=1)
                rounding = SAFE * EPSILON * entries ** (size // 2) / np.abs(slope)
            multipliers = self.passing.multipliers(values[:, :-1].reshape(-1, size, size))
            better = np.abs(change) < np.abs(step)
            if not np.any(better):
                break
            at, step = np.where(better, at + change, at), np.where(better, change, step)
            noise = np.where(better, rounding, noise)
        return at, 2 * np.abs(step) + noise + 4 * EPSILON * np.abs(at), multipliers
