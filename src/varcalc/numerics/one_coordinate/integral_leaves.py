"""Series for integrals along motions that turn back on the same slopes, on a panel of the logarithm of C.

On some motions the integrals are Chebyshev series in the share of the parameter, on panels that are halved until these
are resolved; their coefficients are Chebyshev series in the logarithm. Motions between tell what they are off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev

from varcalc.numerics.chebyshev import roots, to_series
from varcalc.numerics.one_coordinate.motions import CoordinateMotion, seen
from varcalc.numerics.one_coordinate.slopes import SameSlopes

LEAF_DEGREE = 15
"""Of the series in either direction."""
COLUMNS = 2
"""Integrals that are tabled: τ and the first weight's."""
MOST_OPEN = 24
"""Panels along motions that are not resolved: with more integrands have too few digits."""
SHARE_HALVINGS = 20
"""Of panels along motions."""
TOLD = 1e-13
"""Of a panel's largest integrand: the last coefficients of a series along motions."""
LEAF_NOISE = 1e-10
"""What these may be that get no less."""
LESS = 8.0
"""By how many times those get less when a panel is halved, at least, unless they are round-off."""
ENDS_MET = 0.3
"""How well the ends of motions are to be met, in units of how well integrals are."""
DIGITS = 1e-15
"""Of an integral: what round-off makes of it."""
CHECKED = np.array([-1.0, -0.613, 0.287, 1.0])
"""Where other motions are looked at, in a panel from -1 to 1."""
PANELS_TOGETHER = 64
"""Panels integrated over together; bounds the memory."""

_POINTS, _TO_SERIES = roots(LEAF_DEGREE + 1), to_series(LEAF_DEGREE + 1)
_INTEGRATED = np.array([chebyshev.chebint(row, lbnd=-1.0) for row in np.eye(LEAF_DEGREE + 1)]).T
_DERIVED = np.pad(chebyshev.chebder(np.eye(LEAF_DEGREE + 2), axis=1), ((0, 0), (0, 1))).T
"""From Chebyshev polynomials to their derivatives."""
_AT_COLUMNS = np.append(_POINTS, CHECKED)
_ASCENDING = np.argsort(_AT_COLUMNS)
_IN_PANEL = np.concatenate([[1.0], _POINTS, [-1.0]])
"""Where integrands are looked at, and at the ends what they are integrated over."""
_AT_CHECKED = chebyshev.chebvander(CHECKED, LEAF_DEGREE)
COUNT = len(_AT_COLUMNS)
"""Motions of a leaf."""


@dataclass(frozen=True)
class Leaf:
    """A panel of the logarithm from ``low`` to ``high``: ``edges`` (n + 1,) of the shares, and series on n panels.

    ``series`` (n, LEAF_DEGREE + 1, COLUMNS * (LEAF_DEGREE + 2)) are those in the logarithm of those in the share of the
    integrals from about the reference, ``off`` (n, COLUMNS) what these may be off. ``ends`` (LEAF_DEGREE + 1, 2) are
    series of the ends from the reference, ``most`` (LEAF_DEGREE + 1,) that of the largest parameter.
    """

    low: float
    high: float
    edges: np.ndarray
    series: np.ndarray
    ends: np.ndarray
    most: np.ndarray
    off: np.ndarray

    @cached_property
    def to_ends(self) -> np.ndarray:
        """Series (LEAF_DEGREE + 1, 2 * COLUMNS) in the logarithm of the integrals up to both ends."""
        first, last = (part.reshape(LEAF_DEGREE + 1, COLUMNS, LEAF_DEGREE + 2) for part in self.series[[0, -1]])
        signs = (-1.0) ** np.arange(LEAF_DEGREE + 2)
        return np.stack([first @ signs, last.sum(axis=2)], axis=1).reshape(LEAF_DEGREE + 1, -1)


def leaves(slopes: SameSlopes, low: np.ndarray, high: np.ndarray) -> list[tuple[Leaf, float] | None]:
    """The panels of the logarithm from ``low`` to ``high`` (l,), and what each is off, of the whole.

    None where integrals are not resolved.
    """
    out: list[tuple[Leaf, float] | None] = [None] * len(low)
    logarithm = (low + high)[:, None] / 2 + (high - low)[:, None] / 2 * _AT_COLUMNS
    with np.errstate(all="ignore"):
        found = slopes.motions(logarithm.ravel())
        if found is None:
            return out
        rows, way, most, ends = found
        count = np.bincount(rows // COUNT, minlength=len(low))
        whole = np.flatnonzero(count[rows // COUNT] == COUNT)
        if len(whole) == 0:
            return out
        way, most, ends = way.take(whole), most[whole], ends[whole]
        numbers = rows[whole][::COUNT] // COUNT
        sums = _along(way, most, slopes.rounded(low[numbers]))
    for k, (number, own) in enumerate(zip(numbers, sums, strict=True)):
        part = slice(k * COUNT, (k + 1) * COUNT)
        if own is not None:
            start = way.start[part][LEAF_DEGREE // 2] / most[part][LEAF_DEGREE // 2]
            leaf, off = _leaf((float(low[number]), float(high[number])), own, most[part], ends[part], start)
            turns = (slopes.reference + ends[part][_ASCENDING]).T
            out[number] = leaf, off if np.all(seen(way.gentle, turns)) else np.inf
    return out


def _leaf(
    panel: tuple[float, float], along: AlongMotions, most: np.ndarray, ends: np.ndarray, start: float
) -> tuple[Leaf, float]:
    """The series of COUNT motions, and what they are off, of the whole; ``start`` is the share of the reference."""
    edges, values, off = along.edges, along.series, along.off
    whole = values.sum(axis=(1, 2))
    zero = np.clip(np.searchsorted(edges, start) - 1, 0, len(edges) - 2)
    before, gone = np.cumsum(values.sum(axis=2), axis=1), np.cumsum(off, axis=0)
    off = off + np.abs(gone - gone[zero])
    values[:, 1:, 0] += before[:, :-1]
    values[:, :, 0] -= before[:, zero][:, None]
    known = np.where(np.isfinite(ends).all(axis=0), ends, 0.0)
    told = LEAF_DEGREE + 1
    apart, ends_apart, most_apart = (
        np.abs(np.tensordot(_AT_CHECKED @ _TO_SERIES, column[:told], 1) - column[told:])
        for column in (values, known, most)
    )
    off = off + apart.sum(axis=2).max(axis=0)
    span = np.where(np.isfinite(ends).all(), known[:, 1] - known[:, 0], np.abs(known).sum(axis=1)).max()
    worst = max((off / whole.min(axis=0)).max(), ends_apart.max() / (ENDS_MET * span), (most_apart / most[told:]).max())
    series = np.tensordot(_TO_SERIES, values[:told], 1).transpose(1, 0, 3, 2).reshape(len(edges) - 1, told, -1)
    return Leaf(*panel, edges, series, _TO_SERIES @ known[:told], _TO_SERIES @ most[:told], off), float(worst)


def read(leaf: Leaf, local: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The integrals (COLUMNS, m) up to shares (m,) where logarithms are ``local`` (m,), and what they may be off."""
    values, panel, _ = _summed(leaf, local, share, None)
    return values, leaf.off.T[:, panel] + DIGITS * np.abs(values)


def read_ends(leaf: Leaf, in_logarithm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The integrals (2, COLUMNS, m) up to both ends of motions, and what they may be off."""
    values = (leaf.to_ends.T @ in_logarithm).reshape(2, COLUMNS, -1)
    return values, leaf.off[[0, -1], :, None] + DIGITS * np.abs(values)


def rates(leaf: Leaf, local: np.ndarray, share: np.ndarray) -> np.ndarray:
    """The derivatives (COLUMNS, m) of the integrals by the shares (m,)."""
    values, _, width = _summed(leaf, local, share, _DERIVED.T)
    return values * (2 / width)


def _summed(
    leaf: Leaf, local: np.ndarray, share: np.ndarray, derived: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The series (COLUMNS, m) in the polynomials of the share, or those that are ``derived`` of these.

    Besides, the panels in which the shares (m,) are, and how wide these are.
    """
    panel = np.clip(np.searchsorted(leaf.edges, share, side="right") - 1, 0, len(leaf.edges) - 2)
    left, width = leaf.edges[panel], np.diff(leaf.edges)[panel]
    order, parts = in_groups(panel)
    in_logarithm = polynomials(local[order], LEAF_DEGREE)
    in_share = polynomials((2 * (share - left) / width - 1)[order], LEAF_DEGREE + 1)
    in_share = in_share if derived is None else derived @ in_share
    summed, values = np.empty((2, COLUMNS, len(share)))
    for number, part in parts:
        series = (leaf.series[number].T @ in_logarithm[:, part]).reshape(COLUMNS, LEAF_DEGREE + 2, -1)
        np.einsum("jm,fjm->fm", in_share[:, part], series, out=summed[:, part])
    values[:, order] = summed
    return values, panel, width


def polynomials(x: np.ndarray, degree: int) -> np.ndarray:
    """Chebyshev polynomials (degree + 1, m) at ``x`` (m,): with m last what is done with them takes half the time."""
    out = np.empty((degree + 1, len(x)))
    out[0], out[1] = 1.0, x
    twice = 2 * x
    for k in range(2, degree + 1):
        np.multiply(twice, out[k - 1], out=out[k])
        out[k] -= out[k - 2]
    return out


@dataclass(frozen=True)
class AlongMotions:
    """Series (COUNT, n, LEAF_DEGREE + 2, COLUMNS) of integrals along motions from the ``edges`` (n + 1,) of shares on.

    ``off`` (n, COLUMNS) is what they are off at the ends of the panels.
    """

    edges: np.ndarray
    series: np.ndarray
    off: np.ndarray


def _along(way: CoordinateMotion, most: np.ndarray, agreed: np.ndarray) -> list[AlongMotions | None]:
    """The integrals along l times COUNT motions, those of each leaf on panels of its own; None where not resolved.

    What is round-off of integrands may be as much as ``agreed`` (l,).
    """
    leaf, left, width = np.repeat(np.arange(len(agreed)), 4), np.tile(np.arange(4) / 4, len(agreed)), 0.25
    before = np.full(len(leaf), np.inf)
    lost = np.zeros(len(agreed), dtype=bool)
    done: list[list[tuple[float, np.ndarray, np.ndarray]]] = [[] for _ in agreed]
    for _ in range(SHARE_HALVINGS):
        values, told = _integrands(way, most, leaf, left, width)
        own = np.tensordot(values, _TO_SERIES, (3, 1))  # (COLUMNS, n, COUNT, LEAF_DEGREE + 1)
        tail = np.abs(own[..., -2:]).max(axis=3)
        left_over = (tail / np.abs(values).max(axis=3)).max(axis=(0, 2))
        # what does not get less is round-off
        noise = (left_over <= np.maximum(agreed[leaf], LEAF_NOISE)) & (left_over > before / LESS)
        fine = ((left_over <= TOLD) | noise) & told
        step = width / 2 * most.reshape(-1, COUNT)[leaf]
        sums = np.moveaxis((own * step[..., None]) @ _INTEGRATED.T, 0, -1)
        off = (tail * step).max(axis=2).T / LEAF_DEGREE**2
        for k in np.flatnonzero(fine):
            done[leaf[k]].append((float(left[k]), sums[k], off[k]))
        lost[leaf[~np.all(np.isfinite(values), axis=(0, 2, 3))]] = True
        lost |= np.bincount(leaf[~fine], minlength=len(lost)) > MOST_OPEN
        again, width = np.flatnonzero(~fine & ~lost[leaf]), width / 2
        if len(again) == 0:
            break
        leaf, left, before = (
            np.tile(leaf[again], 2), np.append(left[again], left[again] + width), np.tile(left_over[again], 2)
        )  # fmt: skip
    else:
        lost[leaf] = True
    return [None if gone else _joined(own) for gone, own in zip(lost, done, strict=True)]


def _joined(panels: list[tuple[float, np.ndarray, np.ndarray]]) -> AlongMotions:
    left, series, off = zip(*sorted(panels, key=lambda panel: panel[0]), strict=True)
    return AlongMotions(np.append(left, 1.0), np.stack(series, axis=1), np.stack(off))


def _integrands(
    way: CoordinateMotion, most: np.ndarray, leaf: np.ndarray, left: np.ndarray, width: float
) -> tuple[np.ndarray, np.ndarray]:
    """What is integrated on panels (n,) of leaves, (COLUMNS, n, COUNT, LEAF_DEGREE + 1).

    Besides it, whether points tell all (n,).
    """
    parts, told = [], []
    share = left[:, None] + width * (1 + _IN_PANEL) / 2
    for first in range(0, len(leaf), PANELS_TOGETHER):
        some = slice(first, first + PANELS_TOGETHER)
        rows = (leaf[some, None] * COUNT + np.arange(COUNT)).ravel()
        places, values = way.take(rows).integrands(most[rows, None] * np.repeat(share[some], COUNT, axis=0))
        parts.append(values[:COLUMNS, :, 1:-1].reshape(COLUMNS, -1, COUNT, LEAF_DEGREE + 1))
        told.append(seen(way.gentle, places).reshape(-1, COUNT).all(axis=1))
    return np.concatenate(parts, axis=1), np.concatenate(told)


def in_groups(numbers: np.ndarray) -> tuple[np.ndarray, list[tuple[int, slice]]]:
    """The order (m,) in which ``numbers`` (m,), small ones, ascend, and each of them with its part of that."""
    if len(numbers) == 0:
        return np.empty(0, dtype=int), []
    numbers = numbers.astype(np.int16)  # of which the order is told in one pass
    order = np.argsort(numbers, kind="stable")
    ascending = numbers[order]
    first = np.flatnonzero(np.diff(ascending, prepend=ascending[0] - 1))
    ends = [*first[1:].tolist(), len(order)]
    return order, [(int(ascending[k]), slice(k, end)) for k, end in zip(first.tolist(), ends, strict=True)]
