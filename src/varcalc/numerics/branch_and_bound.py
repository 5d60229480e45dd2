"""The least value of a function over boxes, by halving those that may hold it.

A box is given up where an enclosure shows that nothing in it is low enough (Moore, Kearfott and Cloud, "Introduction
to Interval Analysis", SIAM 2009, ch. 5): no well is too narrow to be seen.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

MOST_HALVED, BOX_HALVINGS = 20_000, 60
"""Boxes of one size that are halved, the lowest where there are more, and how often."""

AtPoints = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Values (m,) at points (f, m), each of the function with its number (m,)."""
InBoxes = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Least values (m,) between corners (f, m) and (f, m), each of the function with its number (m,)."""


def boxes_about(edges: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """The corners, (f, m) each, of the boxes into which ``edges`` along all of f axes divide space."""
    low, high = (
        np.stack(np.meshgrid(*[side] * dimension, indexing="ij")).reshape(dimension, -1)
        for side in (edges[:-1], edges[1:])
    )
    return low, high


def least_points(
    low: np.ndarray, high: np.ndarray, number: np.ndarray, value: AtPoints, bound: InBoxes,
    enough: np.ndarray, near: float, share: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Where each of several functions is least, (f, k), and how low it is there, (k,).

    It is told to within ``near``, or to within a ``share`` of how much lower than ``enough`` (k,) it is where that is
    more. The boxes between ``low`` (f, m) and ``high`` are of the functions with the ``number`` (m,). What is not lower
    than ``enough`` is not looked for: its place is NaN.
    """
    best, least = np.full((len(low), len(enough)), np.nan), np.array(enough)
    halves = [np.array(which)[:, None] for which in product((False, True), repeat=len(low))]

    def hopeful(lowest: np.ndarray, number: np.ndarray) -> np.ndarray:
        told = np.where(np.isfinite(best[0]), np.maximum(near, share * (enough - least)), 0.0)
        return np.flatnonzero(lowest < (least - told)[number])

    for _ in range(BOX_HALVINGS):
        lowest = bound(low, high, number)
        kept = hopeful(lowest, number)
        low, high, number, lowest = low[:, kept], high[:, kept], number[kept], lowest[kept]
        if not len(number):
            break
        middle = 0.5 * (low + high)
        values = value(middle, number)
        order = np.argsort(-values, kind="stable")  # of several with one number the last one stays: the lowest
        order = order[values[order] < least[number[order]]]
        best[:, number[order]], least[number[order]] = middle[:, order], values[order]
        kept = hopeful(lowest, number)
        if len(kept) > MOST_HALVED:  # a well may be long: some of it is enough
            kept = kept[np.argsort(lowest[kept], kind="stable")[: MOST_HALVED // len(halves)]]
        low, middle, high, number = low[:, kept], middle[:, kept], high[:, kept], number[kept]
        if not len(number):
            break
        low, high = (
            np.hstack([np.where(upper, middle, low) for upper in halves]),
            np.hstack([np.where(upper, high, middle) for upper in halves]),
        )
        number = np.tile(number, len(halves))
    return best, least
