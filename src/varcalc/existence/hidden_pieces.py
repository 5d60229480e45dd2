"""Pieces of phi = 0 so small, or so thin, that the places of a grid do not part them.

Within such a piece phi has the other sign, and is least or greatest somewhere, where its gradient vanishes. Boxes are
halved in which enclosures admit both (Moore, Kearfott and Cloud, "Introduction to Interval Analysis", SIAM 2009,
ch. 5), until the middle of one lies within.
"""

from __future__ import annotations

from itertools import product

import casadi as ca
import numpy as np

from varcalc.symbolic.intervals import enclosures

MOST_OF_A_SIZE, BOX_HALVINGS = 8192, 12
"""Boxes of one size at most, and how often they are halved: where phi touches zero all along they are too many."""
STEPS_TO_POINT = 48
"""Halvings of the way from within a piece to the corner of a cell."""


def hidden_points(phi: ca.Function, axes: list[np.ndarray], levels: np.ndarray) -> np.ndarray:
    """Points (k, d) of pieces of phi = 0 within cells of a grid, at whose corners it has one sign.

    An SX ``phi`` gives it with its gradient. The grid has ``axes`` (k_i,), and ``levels`` (k_1, ..., k_d) of phi at its
    places.
    """
    dimension, signs = len(axes), np.sign(levels)
    uppers = np.array(list(product((0, 1), repeat=dimension)))
    parts = [[slice(up, len(axis) - 1 + up) for up, axis in zip(corner, axes, strict=True)] for corner in uppers]
    at_corners = np.stack([signs[tuple(part)] for part in parts])
    cells = np.argwhere(np.abs(at_corners.sum(0)) == len(uppers))
    low, high = (np.array([axis[of + up] for axis, of in zip(axes, cells.T, strict=True)]) for up in (0, 1))
    sign = at_corners[0][tuple(cells.T)]
    inner, cell = _within(phi, low, high, sign)
    if not len(cell):
        return np.zeros((0, dimension))
    corners = np.stack([np.where(up[:, None], high[:, cell], low[:, cell]) for up in uppers], axis=1)
    inside = np.repeat(inner[:, None], len(uppers), axis=1)
    for _ in range(STEPS_TO_POINT):
        middle = 0.5 * (inside + corners)
        same = np.asarray(phi(middle.reshape(dimension, -1))[0]).reshape(middle.shape[1:]) * sign[cell] > 0
        inside, corners = np.where(same, inside, middle), np.where(same, middle, corners)
    return inside.reshape(dimension, -1).T


def _within(phi: ca.Function, low: np.ndarray, high: np.ndarray, sign: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (d, k) between ``low`` (d, m) and ``high`` at which phi has not the ``sign`` (m,), and in which box, (k,).

    One at most of each box.
    """
    box, found, of = np.arange(len(sign)), [np.zeros((len(low), 0))], [np.zeros(0, dtype=int)]
    halves = [np.array(upper)[:, None] for upper in product((False, True), repeat=len(low))]
    for _ in range(BOX_HALVINGS):
        kept = _may_hold(phi, low, high, sign[box])
        low, high, box = low[:, kept], high[:, kept], box[kept]
        if not 0 < len(box) <= MOST_OF_A_SIZE:
            break
        middle = 0.5 * (low + high)
        inside = np.flatnonzero(np.asarray(phi(middle)[0]).ravel() * sign[box] < 0)
        one = inside[np.unique(box[inside], return_index=True)[1]]
        found.append(middle[:, one])
        of.append(box[one])
        left = ~np.isin(box, box[one])
        low, middle, high, box = low[:, left], middle[:, left], high[:, left], box[left]
        low, high = (
            np.hstack([np.where(upper, middle, low) for upper in halves]),
            np.hstack([np.where(upper, high, middle) for upper in halves]),
        )
        box = np.tile(box, len(halves))
    return np.hstack(found), np.concatenate(of)


def _may_hold(phi: ca.Function, low: np.ndarray, high: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Whether phi may have not the ``sign`` (m,), and a gradient that vanishes, between ``low`` (d, m) and ``high``."""
    (level,), slopes = enclosures(phi, [list(zip(low, high, strict=True))])
    other = np.where(sign > 0, level[0], -level[1]) <= 0
    for least, most in slopes:
        other = other & ~(np.asarray(least) > 0) & ~(np.asarray(most) < 0)
    return np.flatnonzero(np.broadcast_to(other, sign.shape))
