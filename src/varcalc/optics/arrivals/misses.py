"""By how much the rays of a cell miss a point, as a function of the launching angle.

In a cell whose rays all go about the same way, a line across them through the
point B is met by each ray once. How far from B it is met, with its sign, is a
smooth function m of the angle, whose values and derivatives at the two rays
of the cell are known: a cubic. Rays to B are its zeros, and where B is close
to a caustic m is nearly zero where it is stationary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.numerics.hermite import cubic_at, quintic, quintic_at
from varcalc.numerics.roots import bracketed_newton, quadratic
from varcalc.optics.arrivals.cells import MOVED, TURNED, Cells, P, R

NEARLY_PARALLEL = np.cos(0.5)
"""Rays of one cell must not differ by more from their mean direction."""
WELL_FORETOLD = 0.02
"""Of the range of m in a cell: how well it must be known for the cell to be trusted."""
CLOSE_EXTREMUM = 0.05
"""Of the same: where m is stationary and no larger, the extremum itself has to be found."""
SIDE_MARGIN = 0.1
"""Of a cell: how far beyond its sides a zero is still taken, lest it fall between two cells."""
END_MARGIN = 0.6
"""Of a cell: how far a ray is foretold beyond its ends."""
STEPS_TO_LINE = 6
"""Newton's steps along a ray."""
ON_LINE = 1e-9
"""Of the length of a cell: how close to the line they are to lead."""
SEED_WITHIN = 1e-12
"""Of a cell: how closely the zero of a cubic is found, which is itself foretold only."""


@dataclass(frozen=True)
class Misses:
    """The cubic m (k, 4), by ascending powers of a in [0, 1] from ray to ray, for k pairs of a cell and a point.

    ``sigma`` (k, 2) is σ where the two rays meet the line, ``place`` (k, 2) the same as a share of the cell's
    length; ``range`` (k,) is that of m; ``trusted`` and ``outside`` (k,) tell whether the cubic may be believed,
    and whether the line is met outside the cell.
    """

    cubic: np.ndarray
    sigma: np.ndarray
    place: np.ndarray
    range: np.ndarray
    trusted: np.ndarray
    outside: np.ndarray


def misses(cells: Cells, targets: np.ndarray) -> Misses:
    """How the rays of ``cells`` (k) miss ``targets`` (k, 2), one target a cell."""
    heading = cells.state[..., P] / np.linalg.norm(cells.state[..., P], axis=3)[..., None]
    ahead = heading.sum(axis=(1, 2))
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    alike = np.einsum("kabd,kd->kab", heading, ahead).min(axis=(1, 2)) >= NEARLY_PARALLEL
    place, miss, rate, outside, straight = _met(cells, targets, ahead)
    slope = rate * (cells.angle[:, 1] - cells.angle[:, 0])[:, None]
    scale = np.maximum(np.abs(miss).max(axis=1), np.abs(slope).max(axis=1))
    known = straight & (cells.sideways <= WELL_FORETOLD * scale)
    inside = np.all((place >= -END_MARGIN) & (place <= 1 + END_MARGIN), axis=1)
    length = cells.sigma[:, :, 1] - cells.sigma[:, :, 0]
    rise = miss[:, 1] - miss[:, 0]
    cubic = [miss[:, 0], slope[:, 0], 3 * rise - 2 * slope[:, 0] - slope[:, 1], slope.sum(axis=1) - 2 * rise]
    return Misses(
        np.stack(cubic, axis=1),
        cells.sigma[:, :, 0] + place * length,
        place,
        scale,
        alike & known & inside & np.isfinite(scale),
        outside & alike & np.isfinite(cells.error),
    )


def _met(cells: Cells, targets: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray, ...]:
    """Where in the cell, how far from the target and with what derivative by the angle (k, 2) both rays meet the line.

    Last, whether both meet it before the cell or behind (k,), and whether both go about straight through it.

    Along a ray the quintic is used which has its places, momenta and pulls at both ends.
    """
    side = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)[:, None]
    ahead = ahead[:, None]
    length = (cells.sigma[:, :, 1] - cells.sigma[:, :, 0])[..., None]
    ends = [(cells.state[:, :, k], cells.pull[:, :, k]) for k in (0, 1)]
    places, *others = quintic(*((ray[..., R], length * ray[..., P], length**2 * pull) for ray, pull in ends))
    terms = places - targets[:, None], *others

    def at(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The places and directions at shares u of the intervals, and how far ahead of the line the places are."""
        place, going = quintic_at(u, terms)
        return place, going, np.sum(place * ahead, axis=2)[..., None]

    short = [at(np.full((*length.shape[:2], 1), u))[2][..., 0] for u in (-SIDE_MARGIN, 1 + SIDE_MARGIN)]
    room = cells.error[:, None]  # which is how far other rays of the cell may be off
    outside = np.all(short[0] > room, axis=1) | np.all(short[1] < -room, axis=1)
    u = np.zeros((*length.shape[:2], 1))
    with np.errstate(all="ignore"):
        for _ in range(STEPS_TO_LINE):
            _, going, short = at(u)
            u = u - short / np.sum(going * ahead, axis=2)[..., None]
            u = np.clip(np.where(np.isfinite(u), u, 0.5), -1 - END_MARGIN, 2 + END_MARGIN)
        place, going, short = at(u)
        moved = cubic_at(u, *((ray[..., MOVED], length * ray[..., TURNED]) for ray, _ in ends))
        straight = np.sum(going * ahead, axis=2) >= NEARLY_PARALLEL * np.linalg.norm(going, axis=2)
        straight &= np.abs(short[..., 0]) <= ON_LINE * np.linalg.norm(going, axis=2)
        tilt = np.sum(going * side, axis=2) / np.sum(going * ahead, axis=2)
        across = np.sum(moved * side, axis=2) - tilt * np.sum(moved * ahead, axis=2)
    return u[..., 0], np.sum(place * side, axis=2), across, outside, np.all(straight, axis=1)


@dataclass(frozen=True)
class Seeds:
    """Where zeros and small extrema of the cubics may be: ``pair`` (s,) and the share ``a`` (s,) of the cell's width.

    ``fold`` (s,) marks extrema.
    """

    pair: np.ndarray
    a: np.ndarray
    fold: np.ndarray


def seeds(found: Misses, sideways: np.ndarray) -> tuple[Seeds, np.ndarray]:
    """What to begin Newton's iteration from, and True (k,) for pairs with two small extrema, which are to be parted."""
    c = found.cubic
    turning = np.sort(quadratic(c[:, 1], 2 * c[:, 2], 3 * c[:, 3]).T, axis=1)
    low, high = -SIDE_MARGIN, 1 + SIDE_MARGIN
    within = (turning > low) & (turning < high)
    stops = np.column_stack([np.full(len(c), low), np.where(within, turning, high), np.full(len(c), high)])
    stops.sort(axis=1)
    value = _cubic(c[:, :, None], stops)
    small = np.maximum(4 * sideways, CLOSE_EXTREMUM * found.range)
    extremum = np.where(within, turning, 0.0)
    fold = within & (np.abs(_cubic(c[:, :, None], extremum)) <= small[:, None])
    crossed = (value[:, 1:] * value[:, :-1] < 0) & (stops[:, 1:] > stops[:, :-1])
    # the zeros beside a small extremum come from it
    for k in (0, 1):
        beside = fold[:, [k]] & ((stops[:, :-1] == turning[:, [k]]) | (stops[:, 1:] == turning[:, [k]]))
        crossed &= ~beside
    pair, part = np.nonzero(crossed)
    zero = _zero(c[pair], stops[pair, part], stops[pair, part + 1])
    folded, which = np.nonzero(fold)
    both = Seeds(
        np.concatenate([pair, folded]),
        np.concatenate([zero, turning[folded, which]]),
        np.repeat([False, True], [len(pair), len(folded)]),
    )
    return both, np.all(fold, axis=1)


def _cubic(c: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The cubics with coefficients c (k, 4, ...) at a."""
    return c[:, 0] + a * (c[:, 1] + a * (c[:, 2] + a * c[:, 3]))


def _zero(c: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The zero (k,) of each cubic between ``low`` and ``high``, where its signs differ."""
    sign = np.where(_cubic(c, high) > 0, -1.0, 1.0)

    def before(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return sign * _cubic(c, a), sign * (c[:, 1] + a * (2 * c[:, 2] + 3 * a * c[:, 3]))

    return bracketed_newton(before, low, high, (low + high) / 2, absolute=SEED_WITHIN)[0]
