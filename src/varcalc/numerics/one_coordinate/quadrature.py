"""Integrals along ways, and where they have reached given values.

Panels of Gauss's rule are halved until the halves agree with the whole; what
is looked for is bracketed and found by Newton's iteration, whose derivatives
are the integrands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from varcalc.numerics.mesh import gauss
from varcalc.numerics.one_coordinate.motions import CoordinateMotion, seen

NODES, WEIGHTS = gauss(16)
AGREED = 1e-13
"""Of an integral: how well a panel must agree with its halves, which are better still."""
PANEL_HALVINGS = 40
"""Of a panel; what is not resolved by then is no smooth index."""
FEW_HALVINGS = 8
"""The same, where a shorter step is the better answer."""
MOST_INTEGRAL_PANELS = 64
"""For each of the integrals, at one time."""
DOUBLINGS = 400
"""Of a step outwards, and halvings where it went too far."""
NEWTON = 60
"""Steps of Newton's iteration."""
TAU, BY_C = 0, -1
"""The columns of the integrals: τ first, then what :meth:`Potential.weighted` says, the derivative of τ by C last."""


class Integrable(Protocol):
    """What :func:`integrals` is taken along: m ways, each a curve in a parameter q on which nothing is singular."""

    @property
    def stops(self) -> np.ndarray:
        """Places (k,), ascending, over which no panel goes."""
        ...

    @property
    def gentle(self) -> np.ndarray:
        """Places (k,), ascending, between which the integrands vary gently."""
        ...

    def take(self, rows: np.ndarray) -> Self:
        """The ways of ``rows``."""
        ...

    def height(self, u: np.ndarray) -> np.ndarray:
        """The least parameter (m, k), not negative, at the places ``u`` (k,); not a number where a way passes none."""
        ...

    def integrands(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places (m, k) at parameters ``q`` (m, k), and what is integrated over them (columns, m, k).

        The last column is a derivative: as smooth as the others, it may add up to nothing but round-off.
        """
        ...


def _panels(
    way: Integrable, edges: Sequence[tuple[np.ndarray, np.ndarray]]
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Gauss's rule for the integrals (columns, m) from some ``edges`` to others (each (m,)), and for those of sizes.

    With them, whether its points tell all (m,). What is integrated is asked for once.
    """
    middles, halves = [(low + high) / 2 for low, high in edges], [(high - low) / 2 for low, high in edges]
    places, values = way.integrands(
        np.concatenate([m[:, None] + h[:, None] * NODES for m, h in zip(middles, halves, strict=True)], axis=1)
    )
    out = []
    for k, half in enumerate(halves):
        own = slice(k * len(NODES), (k + 1) * len(NODES))
        parts = values[..., own]
        out.append(
            (half * (parts @ WEIGHTS), np.abs(half) * (np.abs(parts) @ WEIGHTS), seen(way.gentle, places[:, own]))
        )
    return out


def integrals(
    way: Integrable, low: np.ndarray, high: np.ndarray, known: np.ndarray | float = 0.0, halvings: int = PANEL_HALVINGS,
    agreed: np.ndarray | float = AGREED,
) -> np.ndarray:  # fmt: skip
    """The integrals (m, columns) from ``low`` to ``high`` (m,); not numbers where they are not resolved.

    They are to be added to what is ``known`` (m, columns), to whose digits they are resolved, and to those of the
    integral of the size, where integrands change sign. Panels must agree with their halves to ``agreed`` (m,), where
    integrands have fewer digits than most.
    """
    with np.errstate(all="ignore"):
        rows, left, right = cut(way, low, high)
        agreed = np.broadcast_to(agreed, np.shape(low))
        middle = (left + right) / 2
        (whole, sizes, _), *halves = _panels(way.take(rows), [(left, right), (left, middle), (middle, right)])
        total = np.zeros((len(whole), len(low)))
        size = _by_row(rows, sizes, total) + np.abs(np.transpose(known)) + np.finfo(float).tiny
        for _ in range(halvings):
            (first, _, told), (second, _, told_too) = halves
            wrong = np.abs(first + second - whole)
            # the derivative by C may add up to nothing but round-off; it is as smooth as the rate itself
            fine = np.all((wrong <= agreed[rows] * size[:, rows])[:BY_C], axis=0) & told & told_too
            total = _by_row(rows[fine], (first + second)[:, fine], total)
            rest = ~fine & np.all(np.isfinite(first + second), axis=0)
            total[:, rows[~fine & ~rest]] = np.nan
            if not np.any(rest):
                return total.T
            if np.count_nonzero(rest) > MOST_INTEGRAL_PANELS * (len(low) + len(way.stops)):
                rows = rows[rest]
                break
            rows = np.tile(rows[rest], 2)
            left, right = np.append(left[rest], middle[rest]), np.append(middle[rest], right[rest])
            whole, middle = np.concatenate([first[:, rest], second[:, rest]], axis=1), (left + right) / 2
            halves = _panels(way.take(rows), [(left, middle), (middle, right)])
        total[:, rows] = np.nan
    return total.T


def _by_row(rows: np.ndarray, parts: np.ndarray, total: np.ndarray) -> np.ndarray:
    """``total`` (columns, m) with the ``parts`` (columns, k) of the ``rows`` (k,) added."""
    return total + np.stack([np.bincount(rows, part, minlength=total.shape[1]) for part in parts])


def cut(way: Integrable, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Panels from ``low`` to ``high`` (m,), cut where the motions pass stops: rows, left and right ends."""
    stops, every = way.stops, np.arange(len(low))
    if len(stops) == 0:
        return every, low, high
    there = way.height(stops)
    first, last = np.minimum(low, high)[:, None], np.maximum(low, high)[:, None]
    ways = np.concatenate([there, -there], axis=1)
    inside = np.where((ways > first) & (ways < last), ways, last)
    edges = np.sort(np.concatenate([first, inside, last], axis=1), axis=1)
    row, number = np.nonzero((np.diff(edges, axis=1) > 0) | (np.arange(edges.shape[1] - 1) == 0))
    left, right = edges[row, number], edges[row, number + 1]
    backward = (high < low)[row]
    return row, np.where(backward, right, left), np.where(backward, left, right)


@dataclass(frozen=True)
class Reached:
    """Where m motions have come: ``q`` (m,), and the integrals (m, columns) up to there.

    ``ended`` (m,) is True where the last parameter came before every target, ``resolved`` False where the way is
    not known so far.
    """

    q: np.ndarray
    integrals: np.ndarray
    ended: np.ndarray
    resolved: np.ndarray


def reached(way: CoordinateMotion, last: np.ndarray, targets: np.ndarray) -> Reached:
    """The first of: the parameter ``last`` (m,), τ and the integrals over it at the ``targets`` (m, columns - 1)."""
    m = len(last)
    before = _periods(way, targets)
    wanted = targets - before[:, :BY_C]
    low, sums = way.start.copy(), np.zeros((m, targets.shape[1] + 1))
    ended, resolved = np.zeros(m, bool), np.ones(m, bool)
    bracketed = np.any(wanted <= 0, axis=1)  # there already
    high, step = np.where(bracketed, low, last), _first_steps(way, last, wanted)
    for _ in range(DOUBLINGS):
        rows = np.flatnonzero(~bracketed & ~ended & resolved)
        if len(rows) == 0:
            break
        to = np.minimum(low[rows] + step[rows], last[rows])
        more = integrals(way.take(rows), low[rows], to, sums[rows], FEW_HALVINGS)
        known = np.all(np.isfinite(more), axis=1)
        beyond = known & np.any(sums[rows][:, :BY_C] + more[:, :BY_C] >= wanted[rows], axis=1)
        on = rows[known & ~beyond]
        low[on], step[on] = to[known & ~beyond], 2 * step[on]
        sums[on] += more[known & ~beyond]
        ended[on] = low[on] >= last[on]
        high[rows[beyond]], bracketed[rows[beyond]] = to[beyond], True
        step[rows[~known]] /= 4
        resolved[rows[~known]] = low[rows[~known]] + step[rows[~known]] > low[rows[~known]]
    rows = np.flatnonzero(bracketed & (high > low))
    low[rows], sums[rows] = _closed_in(way.take(rows), low[rows], high[rows], sums[rows], wanted[rows])
    resolved &= np.all(np.isfinite(sums[:, :BY_C]), axis=1)
    return Reached(low, sums + before, ended, resolved & (ended | bracketed))


def half_periods(way: CoordinateMotion) -> np.ndarray:
    """The integrals (m, columns) over half a period of motions that have one."""
    return integrals(way, np.zeros(len(way.start)), np.full(len(way.start), way.period / 2))


def _periods(way: CoordinateMotion, targets: np.ndarray) -> np.ndarray:
    """The integrals (m, columns) over the whole periods that come before the first target."""
    m = len(targets)
    if not np.isfinite(way.period) or m == 0:
        return np.zeros((m, targets.shape[1] + 1))
    half = half_periods(way)
    with np.errstate(all="ignore"):
        turns = np.floor(np.min(targets / (2 * half[:, :BY_C]), axis=1) * (1 - 1e-15))
    turns = np.where(np.isfinite(turns), np.maximum(turns, 0.0), 0.0)
    return np.where(turns[:, None] > 0, 2 * turns[:, None] * half, 0.0)


def _first_steps(way: CoordinateMotion, last: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """A first guess (m,) of how far in q the targets lie, and the whole way where there are none."""
    with np.errstate(all="ignore"):
        rates = way.integrands(way.start[:, None])[1][:BY_C, :, 0].T
        guess = np.min(wanted / rates, axis=1)
    whole = np.minimum(last - way.start, way.period)
    return np.where(np.isfinite(guess) & (guess > 0), np.minimum(guess, whole), np.minimum(whole, 1e300))


def _closed_in(
    way: CoordinateMotion, low: np.ndarray, high: np.ndarray, sums: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton's iteration between ``low``, where the integrals are ``sums``, and ``high``."""
    q, sums = low.copy(), sums.copy()
    going = np.arange(len(q))
    for _ in range(NEWTON):
        if len(going) == 0:
            break
        part, here = way.take(going), q[going]
        with np.errstate(all="ignore"):
            rates = part.integrands(here[:, None])[1][:BY_C, :, 0].T
            step = np.min((wanted[going] - sums[going, :BY_C]) / rates, axis=1)
        scale = 4 * np.finfo(float).eps * np.maximum(np.abs(here), np.abs(way.start[going]))
        new = here + step
        inside = (new >= low[going] - scale) & (new <= high[going] + scale)
        new = np.where(inside, np.clip(new, low[going], high[going]), (low[going] + high[going]) / 2)
        sums[going] += integrals(part, here, new, sums[going])
        over = np.any(sums[going, :BY_C] >= wanted[going], axis=1)
        high[going[over]], low[going[~over]] = new[over], new[~over]
        q[going] = new
        going = going[np.abs(new - here) > scale]
    return q, sums
