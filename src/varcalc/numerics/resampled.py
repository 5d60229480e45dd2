"""Functions of one variable held as polynomials on pieces, so that they can go where the function itself cannot.

On each piece the function is interpolated at Chebyshev points and evaluated by the barycentric formula (Berrut and
Trefethen, "Barycentric Lagrange interpolation", SIAM Review 46, 2004). Pieces are halved until the interpolant meets
the function between its points, which SciPy's interpolants leave to whoever chooses the points; next to a place where
it is infinite or has a kink they become as small as rounding allows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.numerics.mesh import CurveOrSlope

PIECE_DEGREE = 20
"""Of the polynomial on a piece."""
ROUNDED_ALIKE = 4e-15
"""Distance between function and polynomial, relative to the function, that is rounding."""
COARSER = 1.3
"""Factor by which a distance is allowed for each time a piece was halved: a function that is no better known than that
gains nothing by smaller pieces, and next to an infinite slope nothing else is left."""
SMOOTHER, MOST_NOISE = 0.2, 1e-5
"""Of what a piece misses, one half misses less unless it is noise; and noise is no more than that, in its units."""
MOST_HALVED_PIECES = 256
"""Pieces at one time that are halved no further: there the function is noise."""
SMALLEST = 1e-14
"""Width of a piece that is not halved, relative to the whole."""
INSIDE = 8 * float(np.finfo(float).eps)
"""Distance from an edge, relative to where the edges lie, at which the function is that of the piece within."""

_NODES = -np.cos(np.pi * np.arange(PIECE_DEGREE + 1) / PIECE_DEGREE)
_WEIGHTS = (-1.0) ** np.arange(PIECE_DEGREE + 1) * np.where(
    np.isin(np.arange(PIECE_DEGREE + 1), (0, PIECE_DEGREE)), 0.5, 1.0
)
_BETWEEN = 0.5 * (_NODES[:-1] + _NODES[1:])[:: PIECE_DEGREE // 5]
"""Where the interpolant is held against the function."""


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Polynomials on the pieces between ``edges`` (p + 1,) by their ``values`` (p, n, m) at Chebyshev points.

    ``ends`` (n, 2) is what is found at the first and the last edge itself, infinite slopes among them.
    """

    edges: np.ndarray
    values: np.ndarray
    ends: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The function at x (m,), shape (n, m)."""
        piece = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.edges) - 2)
        left, right = self.edges[piece], self.edges[piece + 1]
        out = _interpolated(self.values[piece], 2 * (x - left) / (right - left) - 1)
        for end, edge in enumerate((self.edges[0], self.edges[-1])):
            out[:, x == edge] = self.ends[:, end : end + 1]
        return out


@dataclass(frozen=True, eq=False)
class Resampled:
    """A curve and its derivatives, called as one: ``curve(x, k)`` is the k-th derivative at x (m,), shape (n, m)."""

    derivatives: tuple[Polynomials, ...]

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The derivative at x (m,), shape (n, m)."""
        return self.derivatives[derivative](np.asarray(x, dtype=float))


class SentResampled(ABC):
    """A curve that goes to another process as polynomials, by value and as many derivatives as there are."""

    @property
    def order(self) -> int:
        """How often it may be differentiated."""
        return 1

    @property
    @abstractmethod
    def nodes(self) -> np.ndarray:
        """Abscissae at which it may be less smooth, its ends among them."""

    @abstractmethod
    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The curve (derivative 0) or its slope (1) at x (m,), shape (n, m)."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Resampled, (resampled(self, self.nodes, 1 + self.order).derivatives,)


def resampled(curve: CurveOrSlope, edges: Iterable[float], count: int) -> Resampled:
    """``curve(x, k)`` for k below ``count``, between the first and the last of ``edges``, where it may have kinks."""
    marks = np.unique(np.array([*edges], dtype=float))
    marks = np.append(marks[:-1][np.diff(marks) > SMALLEST * (marks[-1] - marks[0])], marks[-1])
    return Resampled(tuple(polynomials(lambda x, k=k: curve(x, k), marks) for k in range(count)))


def polynomials(function: Callable[[np.ndarray], np.ndarray], edges: np.ndarray) -> Polynomials:
    """A function of x (m,) with values (n, m) between ``edges``, which ascend."""
    known: list[tuple[np.ndarray, np.ndarray]] = []
    left, right, size = edges[:-1], edges[1:], 0.0
    room, inner = INSIDE * np.abs(edges).max(), edges[1:-1]
    halving, before = 0, np.full(len(left), np.inf)
    while len(left):
        places = np.concatenate([_NODES, _BETWEEN])
        x = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * places
        least, most = left + room * np.isin(left, inner), right - room * np.isin(right, inner)
        found = np.asarray(function(np.clip(x, least[:, None], most[:, None]).ravel()), dtype=float)
        sampled = found.reshape(len(found), *x.shape).swapaxes(0, 1)
        values, between = sampled[:, :, : PIECE_DEGREE + 1], sampled[:, :, PIECE_DEGREE + 1 :]
        finite = np.abs(values[np.isfinite(values)])
        size = max(size, float(np.median(finite)) if finite.size else 0.0)
        guessed = np.stack([_interpolated(values, np.full(len(values), t)).T for t in _BETWEEN], axis=2)
        with np.errstate(invalid="ignore"):
            alike = ROUNDED_ALIKE * COARSER**halving * np.maximum(size, np.abs(values).max(2, keepdims=True))
            apart = np.abs(guessed - between)
            missed = apart.max((1, 2))
            halves = missed.reshape(2, -1) if halving else missed[None]
            noisy = np.tile(halves.min(0), len(halves)) > SMOOTHER * before
            noisy &= missed <= MOST_NOISE * size
            good = (np.all(apart <= alike, axis=(1, 2)) | noisy) & np.isfinite(values).all((1, 2))
        good |= (len(left) > MOST_HALVED_PIECES) | (right - left <= SMALLEST * (edges[-1] - edges[0]))
        known += [(a, v) for a, v in zip(left[good], values[good], strict=True)]
        before = np.tile(missed[~good], 2)
        middle = 0.5 * (left + right)[~good]
        left, right = np.concatenate([left[~good], middle]), np.concatenate([middle, right[~good]])
        halving += 1
    known.sort(key=lambda piece: piece[0])
    values = np.array([v for _, v in known])
    ends = np.asarray(function(edges[[0, -1]]), dtype=float)
    return Polynomials(np.array([*(a for a, _ in known), edges[-1]]), _without_infinities(values), ends)


def _without_infinities(values: np.ndarray) -> np.ndarray:
    """Values that are no numbers replaced by the nearest of their piece that is one: on the smallest pieces only."""
    for piece, row in zip(*np.nonzero(~np.isfinite(values).all(2)), strict=True):
        good = np.flatnonzero(np.isfinite(values[piece, row]))
        if len(good):
            nearest = good[np.abs(np.subtract.outer(np.arange(PIECE_DEGREE + 1), good)).argmin(1)]
            values[piece, row] = values[piece, row][nearest]
    return values


def _interpolated(values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Polynomials by their ``values`` (m, n, nodes), each at its own t (m,) in [-1, 1]; shape (n, m)."""
    apart = t[:, None] - _NODES
    hit = apart == 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(hit.any(1, keepdims=True), hit, _WEIGHTS / np.where(hit, 1.0, apart))
        share = share / share.sum(1, keepdims=True)
        return np.einsum("mnk,mk->nm", values, share)
