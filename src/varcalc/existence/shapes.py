"""Low curves among sums of few shapes of the whole interval: where no lattice holds what curves have to keep.

Sizes of the shapes fill a cube evenly, more closely about its middle, and of the lowest sums each size is made larger
and smaller by ever less (a search by coordinates; Kolda, Lewis and Torczon, "Optimization by Direct Search", SIAM
Review 45, 2003).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SUMS = 729
"""Sums that are begun from."""
FIRST_MOVE = 0.15
"""By how much sizes are changed at first."""
KEPT_SUMS, SIZE_MOVES = (60, 40, 30, 20, 20), 6
"""Sums of which one size is made larger or smaller, by half as much each time, and how often."""


def closer_nearby(shares: np.ndarray) -> np.ndarray:
    """Numbers from -1 to 1 that lie closer to each other about 0, of even ones."""
    return shares * np.abs(shares)


def led_to(sums: Callable[[np.ndarray], np.ndarray], shapes: np.ndarray) -> np.ndarray:
    """The low curves (P, K + 1, k) that sums of ``shapes`` (m, K + 1, k) lead to, of sizes up to 1.

    What curves (P, K + 1, k) sum are ``sums`` (P,).
    """
    sizes = closer_nearby(2 * _spread(SUMS, len(shapes)) - 1)
    values, step = sums(np.tensordot(sizes, shapes, 1)), 2 * FIRST_MOVE
    moves = np.concatenate([np.zeros((1, len(shapes))), np.eye(len(shapes)), -np.eye(len(shapes))])
    for most in KEPT_SUMS:
        sizes, step = sizes[np.argsort(values, kind="stable")[:most]], step / 2
        for _ in range(SIZE_MOVES):
            tried = sizes[:, None] + step * moves
            values = sums(np.tensordot(tried.reshape(-1, len(shapes)), shapes, 1)).reshape(len(tried), -1)
            least = np.argmin(values, axis=1)[:, None]
            sizes = np.take_along_axis(tried, least[..., None], axis=1)[:, 0]
            values = np.take_along_axis(values, least, axis=1)[:, 0]
    return np.tensordot(sizes, shapes, 1)


def _spread(count: int, dimension: int) -> np.ndarray:
    """Points (count, dimension) that fill the unit cube evenly (Niederreiter, "Random Number Generation", 1992, ch. 3).

    The steps are powers of the root of r^(dimension + 1) = r + 1 (Roberts, "The Unreasonable Effectiveness of
    Quasirandom Sequences", 2018).
    """
    roots = np.roots([1.0, *[0.0] * (dimension - 1), -1.0, -1.0])
    root = float(roots.real[np.abs(roots.imag) < 1e-9].max())
    return (0.5 + np.outer(np.arange(count), root ** -np.arange(1.0, dimension + 1))) % 1.0
