"""A map of where the rays of a source go in space, in cells: four rays each, a stretch of σ long.

As in the plane (:mod:`varcalc.optics.arrivals.cells`) a cell knows the place of a ray and its derivatives by the
launching direction and by σ at its corners. Across the rays it is a bicubic with Adini's twists (Barnhill, Brown and
Klucewicz, Comput. Graph. Image Process. 8 (1978) 78), along them a cubic, and it lies in the hull of its control
points. A point is met by those rays of a cell which meet a screen through it in the point: two equations for two
coordinates of the direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.numerics.hermite import cubic_at, quintic, quintic_at
from varcalc.optics.arrivals.cells import SLOPE_SHARE
from varcalc.optics.arrivals.directions import STEP
from varcalc.optics.rays.beam import Rows, frames

R, P, PATH, CROSSED = slice(0, 3), slice(3, 6), 6, 19
MOVED, TURNED = (slice(7, 10), slice(13, 16)), (slice(10, 13), slice(16, 19))
"""Columns of a state in space with two neighbours, as :func:`varcalc.optics.rays.beam.packed` has them, those of the
two coordinates of the direction; and last which jumps of the index the ray has come through."""
COLUMNS = 20
"""Their number."""
NEARLY_PARALLEL = 0.5
"""Rays of one cell must not differ by a larger angle from their mean direction."""
HALVES = np.array([[1.0, 0.0, 0.0, 0.0], [0.125, 0.375, 0.375, 0.125], [0.0, 0.0, 0.0, 1.0]])
"""From the control points of a cubic to its values at both ends and in the middle."""
SLOPES = np.array([[-3.0, 3.0, 0.0, 0.0], [-0.75, -0.75, 0.75, 0.75], [0.0, 0.0, -3.0, 3.0]])
"""The same for its derivative."""
FAR_OFF = 4.0
"""Sizes of a cell: farther off nothing is in it."""
UNSEEN_MARGIN = 1.0
"""Of the extent of a cell that nobody has looked into: how far beyond its box a point may yet be in it."""
LITTLE = 0.25
"""Of its size: how much farther, whatever its extent; no more than twice what its rays turn."""
STEPS_TO_SCREEN = 6
"""Newton's steps along a ray."""
ON_SCREEN = 1e-9
"""Of the length of a cell: how close to the screen they are to lead."""
BEYOND_ENDS = 0.6
"""Of a cell: how far a ray is foretold beyond its ends."""
BEYOND_SIDES = 0.02
"""Of what the misses of a cell range over: how far from its zeros they still count as zeros, lest one fall between."""
ONE_ZERO = 0.9
"""How far the derivative may be from a constant one in a cell that has one zero at most, by rows."""
WELL_FORETOLD = 0.05
"""Of a cell's width: how well its zero must be foretold."""


@dataclass(frozen=True)
class SpaceCells(Rows):
    """q cells; axes [first, second, end] are the smaller and larger coordinates of the direction, and σ.

    Attributes
    ----------
    face : ndarray of int, shape (q,)
        The face of the cube of directions.
    low : ndarray of int, shape (q, 2)
        The smaller coordinates on it.
    width : ndarray of int, shape (q,)
        How much larger the larger ones are.
    sigma : ndarray, shape (q, 2)
        σ at both ends, from the last surface on.
    state : ndarray, shape (q, 2, 2, 2, 20)
        The rays there; not a number where a ray does not come so far.
    pull : ndarray, shape (q, 2, 2, 2, 3)
        dp/dσ there.
    sideways, error : ndarray, shape (q,)
        How far the cell may be off across the rays, and in all: lengths; infinite where nobody has looked.
    depth : ndarray of int, shape (q,)
        How often the cell has been halved.
    """

    face: np.ndarray
    low: np.ndarray
    width: np.ndarray
    sigma: np.ndarray
    state: np.ndarray
    pull: np.ndarray
    sideways: np.ndarray
    error: np.ndarray
    depth: np.ndarray

    @classmethod
    def none(cls) -> SpaceCells:
        """No cells."""
        shapes = ((), (2,), (), (2,), (2, 2, 2, COLUMNS), (2, 2, 2, 3), (), (), ())
        kinds = (int, int, int, float, float, float, float, float, int)
        return cls(*(np.zeros((0, *shape), dtype=kind) for shape, kind in zip(shapes, kinds, strict=True)))

    @property
    def whole(self) -> np.ndarray:
        """True (q,) where all rays come as far as the far end, through the same jumps of the index."""
        known = np.all(np.isfinite(self.state), axis=(1, 2, 3, 4))
        return known & np.all(self.state[..., CROSSED] == self.state[:, :1, :1, :1, CROSSED], axis=(1, 2, 3))

    @property
    def angle(self) -> np.ndarray:
        """The widths (q,) in radians, about."""
        return self.width * STEP

    def control(self) -> np.ndarray:
        """The control points (q, 4, 4, 4, 3); those of a corner that is not known are not numbers."""
        width = self.width[:, None, None, None, None]
        length = (self.sigma[:, 1] - self.sigma[:, 0])[:, None, None, None, None]
        place, going = (
            patch(self.state[..., column], *(width * self.state[..., by] for by in neighbours))
            for column, neighbours in ((R, MOVED), (P, TURNED))
        )
        third = length / 3 * going
        inner = place[:, :, :, :1] + third[:, :, :, :1], place[:, :, :, 1:] - third[:, :, :, 1:]
        return np.concatenate([place[:, :, :, :1], *inner, place[:, :, :, 1:]], axis=3)

    def parted(self, state: np.ndarray, pull: np.ndarray) -> tuple[SpaceCells, np.ndarray]:
        """The eighths of the cells, and the cell that each is of; ``state`` (q, 3, 3, 3, 20) is that at half steps.

        Quarters, where it is known (q, 3, 3, 2, 20) at the ends only.
        """
        sideways, error = self._unforeseen(state)
        half = self.width // 2
        ends = np.linspace(self.sigma[:, 0], self.sigma[:, 1], state.shape[3], axis=1)
        parts = [
            SpaceCells(
                self.face, self.low + half[:, None] * np.array([a, b]), half, ends[:, t : t + 2],
                state[:, a : a + 2, b : b + 2, t : t + 2], pull[:, a : a + 2, b : b + 2, t : t + 2],
                sideways / 4, error / 4, self.depth + 1,
            )
            for a in (0, 1) for b in (0, 1) for t in range(state.shape[3] - 1)
        ]  # fmt: skip
        return SpaceCells.joined(parts), np.tile(np.arange(len(self)), len(parts))

    def _unforeseen(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far the cells are off (q,) at the places of half a lattice, across the rays and in all.

        In half the width a bicubic errs by a sixteenth of that; to divide by four leaves room for doubt. Slopes count
        as well: what is bent at once, a quarter of the way along, is in the middle where it is foretold.
        """
        control, ahead, along = self.control(), state[..., P], HALVES if state.shape[3] == 3 else HALVES[::2]
        foretold = _at(control, HALVES, HALVES, along)
        parts = [state[..., R] - foretold]
        for by, weights in zip(MOVED, ((SLOPES, HALVES), (HALVES, SLOPES)), strict=True):
            slope = _at(control, *weights, along)
            parts.append(SLOPE_SHARE * (self.width[:, None, None, None, None] * state[..., by] - slope))
        with np.errstate(invalid="ignore", divide="ignore"):
            ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
            across = [off - np.sum(off * ahead, axis=-1, keepdims=True) * ahead for off in parts]
            sizes = [np.linalg.norm(off, axis=-1) for off in (*across, *parts)]
            sizes = [np.sum(of, axis=0).max(axis=(1, 2, 3)) for of in (sizes[: len(parts)], sizes[len(parts) :])]
        sideways, error = (np.where(np.isfinite(size), size, np.inf) for size in sizes)
        return sideways, error

    def may_hold(self, target: np.ndarray, within: float = 0.0) -> np.ndarray:
        """True (q,) for cells whose boxes come ``within`` a distance of the ``target`` (3,).

        Give or take what is not known of them.

        Rays that have come through other jumps of the index are no neighbours: they have boxes of their own.
        """
        inside, whole = np.zeros(len(self), dtype=bool), self.whole
        rows = np.flatnonzero(whole)
        inside[rows] = self.take(rows)._in_box(target, within)  # noqa: SLF001  of this class
        parts = np.flatnonzero(~whole)
        course = self.state[parts, ..., CROSSED]
        for one in np.unique(course[np.isfinite(course)]):
            own = course == one
            some = np.flatnonzero(np.any(own, axis=(1, 2, 3)))
            cells = self.take(parts[some])
            cells = replace(cells, state=np.where(own[some][..., None], cells.state, np.nan))
            inside[parts[some]] |= cells._in_box(target, within)  # noqa: SLF001  of this class
        return inside

    def across(self, target: np.ndarray) -> np.ndarray:
        """How far (q,) the rays of cells are apart where they come by the ``target`` (3,), or all along the cells."""
        low, high, _ = self._box(target, self.axes())
        with np.errstate(invalid="ignore"):
            return np.linalg.norm((high - low)[:, 1:], axis=1)

    def _in_box(self, target: np.ndarray, within: float) -> np.ndarray:
        """The same for cells all of whose known rays are neighbours."""
        if len(self) == 0:
            return np.zeros(0, dtype=bool)
        axes = self.axes()
        low, high, screened = self._box(target, axes)
        with np.errstate(invalid="ignore"):
            extent = np.where(np.isfinite(high - low), high - low, 0.0)
        across = np.linalg.norm(extent[:, 1:], axis=1)
        extent[screened, 0] = across[screened]
        size = np.where(screened, across, np.linalg.norm(extent, axis=1))
        looked = np.isfinite(self.error) & self.whole
        little = np.minimum(LITTLE, 2 * self._turned(axes)) * size
        room = np.where(looked[:, None], self.error[:, None], UNSEEN_MARGIN * extent + little[:, None])
        return np.all(np.maximum(low, -high) <= room + within, axis=1)

    def _box(self, target: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The least and the largest coordinates (q, 3) of cells about the target, along their ``axes`` (q, 3, 3).

        Where all rays of a cell go about the same way, which is true (q,), they are across them those of where they
        meet the screen through the point, along its longest extent there, otherwise those of all control points.
        """
        with np.errstate(invalid="ignore"):
            control = (self.control().reshape(len(self), 64, 3) - target) @ axes.transpose(0, 2, 1)
            _, miss, rates, straight = _met(self, target, axes)
        low, high = _ranges(control)
        screened = straight & (self._turned(axes) <= NEARLY_PARALLEL) & np.any(np.isfinite(miss), axis=(1, 2, 3))
        points = _on_screen(miss[screened], *(rate[screened] for rate in rates))
        low[screened, 1:], high[screened, 1:] = _ranges(points)
        return low, high, screened

    def far_off(self, target: np.ndarray, reach: float) -> np.ndarray:
        """True (q,) for cells that are farther than ``reach`` from a point by several times their size."""
        corners = self.state.reshape(len(self), 8, -1)
        known = np.isfinite(corners[..., PATH])[..., None]
        place = np.where(known, corners[..., R], 0.0)
        middle = place.sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1)
        away = np.linalg.norm(middle[:, 0] - target, axis=1)
        moved = [self.width[:, None, None] * corners[..., by] for by in MOVED]
        size = sum(np.linalg.norm(np.where(known, v, 0.0), axis=2).max(axis=1) for v in (place - middle, *moved))
        return away > reach + FAR_OFF * size

    def _turned(self, axes: np.ndarray) -> np.ndarray:
        """How far (q,) rays go off the first of the ``axes``, as far as they are known: the largest angle, about."""
        with np.errstate(invalid="ignore"):
            off = np.linalg.norm(_unit(self.state[..., P]) - axes[:, None, None, None, 0], axis=-1)
        return np.where(np.isfinite(off), off, 0.0).max(axis=(1, 2, 3))

    def axes(self) -> np.ndarray:
        """Unit vectors along the mean ray of each cell and across it, (q, 3, 3)."""
        with np.errstate(invalid="ignore"):
            ahead = _unit(self.state[..., P])
        ahead = np.nansum(ahead, axis=(1, 2, 3))
        ahead[~np.any(ahead, axis=1)] = (0.0, 0.0, 1.0)
        ahead = _unit(ahead)
        return np.concatenate([ahead[:, None], frames(ahead)], axis=1)


def _at(control: np.ndarray, first: np.ndarray, second: np.ndarray, third: np.ndarray) -> np.ndarray:
    """Sums (q, i, j, k, 3) of control points (q, 4, 4, 4, 3), by weights (i, 4), (j, 4) and (k, 4) along the axes."""
    weights = np.kron(np.kron(first, second), third)
    return (weights @ control.reshape(len(control), -1, 3)).reshape(-1, len(first), len(second), len(third), 3)


def _on_screen(miss: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Points (q, 28, 2) that span where the rays of cells meet a screen, in its coordinates along their longest extent.

    Where corners are dark the rays between go on from the others as to a caustic, or to the edge of a surface: like a
    root, which comes from a place where its slope is known no farther than twice as far as that slope tells.
    """
    points = [patch(miss, first, second).reshape(len(miss), 16, 2)]
    inward = np.array([1.0, -1.0])
    a, b = inward[:, None, None] * first, inward[None, :, None] * second
    dark = np.isnan(miss[..., :1])
    for to, beside in ((a, dark[:, ::-1]), (b, dark[:, :, ::-1]), (a + b, dark[:, ::-1, ::-1])):
        points.append((miss + 2 * np.where(beside, to, 0.0)).reshape(len(miss), 4, 2))
    all_points = np.concatenate(points, axis=1)
    known = np.isfinite(all_points)
    count = np.maximum(known.sum(axis=1, keepdims=True), 1)
    off = np.where(known, all_points - np.where(known, all_points, 0.0).sum(axis=1, keepdims=True) / count, 0.0)
    spread = off.transpose(0, 2, 1) @ off
    turned = np.linalg.eigh(np.where(np.isfinite(spread), spread, 0.0))[1]
    return all_points @ turned


def _ranges(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest coordinates (q, k) of those of the points (q, n, k) that are known."""
    known = np.isfinite(points)
    return np.where(known, points, np.inf).min(axis=1), np.where(known, points, -np.inf).max(axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def patch(value: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The control points (q, 4, 4, ...) of bicubics from values and derivatives (q, 2, 2, ...) at the corners."""
    twist = np.diff(first, axis=2) + np.diff(second, axis=1) - np.diff(np.diff(value, axis=1), axis=2)
    sign = np.array([1.0, -1.0]) / 3
    a, b = (sign.reshape(shape + (1,) * (value.ndim - 3)) for shape in ((2, 1), (1, 2)))
    out = np.empty((len(value), 4, 4, *value.shape[3:]))
    outer, inner = slice(0, 4, 3), slice(1, 3)
    out[:, outer, outer] = value
    out[:, inner, outer] = value + a * first
    out[:, outer, inner] = value + b * second
    out[:, inner, inner] = value + a * first + b * second + a * b * np.where(np.isfinite(twist), twist, 0.0)
    return out


@dataclass(frozen=True)
class ScreenMisses:
    """By how much the rays of k cells miss a point on a screen through it, across the rays, each in its own unit.

    ``control`` (k, 4, 4, 2) are control points of the misses, multiplied by the inverse of their mean derivative: near
    the shares (a, b) of the cell, less those at which the point is met. ``off`` (k, 2) is how far they may be off.
    ``sigma`` (k, 2, 2) is where the corner rays meet the screen. ``over`` and ``one`` (k,) say that there is no ray to
    the point in the cell, or one at most.
    """

    control: np.ndarray
    off: np.ndarray
    sigma: np.ndarray
    over: np.ndarray
    one: np.ndarray

    def zeros(self, rows: np.ndarray) -> np.ndarray:
        """The shares (len(rows), 2) at which the misses of ``rows`` vanish, about: by Newton's iteration."""
        control, share = self.control[rows], np.full((len(rows), 2), 0.5)
        for _ in range(STEPS_TO_SCREEN):
            a, b = (bernstein(share[:, k]) for k in (0, 1))
            da, db = (_slopes(share[:, k]) for k in (0, 1))
            value = np.einsum("qa,qb,qabk->qk", a, b, control)
            rates = [np.einsum("qa,qb,qabk->qk", u, v, control) for u, v in ((da, b), (a, db))]
            step = np.linalg.solve(np.stack(rates, axis=2), value[:, :, None])[:, :, 0]
            share = np.clip(share - step, -0.5, 1.5)
        return share


def bernstein(t: np.ndarray) -> np.ndarray:
    """Bernstein's polynomials of the third degree (m, 4)."""
    s = 1 - t
    return np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)


def _slopes(t: np.ndarray) -> np.ndarray:
    """Their derivatives."""
    s = 1 - t
    return 3 * np.stack([-(s**2), s**2 - 2 * s * t, 2 * s * t - t**2, t**2], axis=1)


def screen_misses(cells: SpaceCells, target: np.ndarray) -> ScreenMisses:
    """How the rays of whole ``cells`` (k), which have been looked into, miss the ``target`` (3,)."""
    axes = cells.axes()
    share, miss, rates, straight = _met(cells, target, axes)
    raw = patch(miss, *rates)
    matrix = np.stack([rate.mean(axis=(1, 2)) for rate in rates], axis=2)
    determinant = np.linalg.det(matrix)
    inverse = np.zeros_like(matrix)
    regular = np.isfinite(determinant) & (np.abs(determinant) > 0)
    inverse[regular] = np.linalg.inv(matrix[regular])
    control = np.einsum("qkl,qabl->qabk", inverse, raw)
    off = np.linalg.norm(inverse, axis=2) * cells.sideways[:, None]
    with np.errstate(invalid="ignore"):
        over = _zero_outside(raw, cells.sideways[:, None]) | (regular & _zero_outside(control, off))
        first, second = 3 * np.diff(control, axis=1), 3 * np.diff(control, axis=2)
        apart = [np.abs(slope - np.eye(2)[k]).max(axis=(1, 2)) for k, slope in enumerate((first, second))]
        one = regular & (np.max(apart[0] + apart[1], axis=1) < ONE_ZERO) & (off.max(axis=1) < WELL_FORETOLD)
    within = np.all((share >= -BEYOND_ENDS) & (share <= 1 + BEYOND_ENDS), axis=(1, 2))
    trusted = (cells._turned(axes) <= NEARLY_PARALLEL) & straight & within  # noqa: SLF001  of this module
    length = (cells.sigma[:, 1] - cells.sigma[:, 0])[:, None, None]
    return ScreenMisses(
        control, off, cells.sigma[:, :1, None] + share * length, trusted & over, trusted & one & np.isfinite(off[:, 0])
    )


def _zero_outside(control: np.ndarray, off: np.ndarray) -> np.ndarray:
    """True (q,) where a component of the control points (q, 4, 4, 2), give or take ``off``, has one sign."""
    low, high = control.min(axis=(1, 2)), control.max(axis=(1, 2))
    off = off + BEYOND_SIDES * (high - low)
    return np.any((low > off) | (high < -off), axis=1)


def _met(
    cells: SpaceCells, target: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray], np.ndarray]:
    """Where the corner rays meet the screen through the target: shares (q, 2, 2), misses and rates (q, 2, 2, 2).

    Along a ray the quintic is used which has its places, momenta and pulls at both ends. Last comes whether all go
    about straight through the cell (q,).
    """
    ahead, screen = axes[:, None, None, 0], axes[:, 1:]
    length = (cells.sigma[:, 1] - cells.sigma[:, 0])[:, None, None, None]
    ends = [(cells.state[:, :, :, k], cells.pull[:, :, :, k]) for k in (0, 1)]
    places, *others = quintic(*((ray[..., R], length * ray[..., P], length**2 * pull) for ray, pull in ends))
    terms = places - target, *others

    def at(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The places and directions at shares u of the intervals, and both along ``ahead``."""
        place, going = quintic_at(u, terms)
        return place, going, *(np.sum(v * ahead, axis=3, keepdims=True) for v in (place, going))

    u, rates = np.full((*places.shape[:3], 1), 0.5), []
    with np.errstate(all="ignore"):
        for _ in range(STEPS_TO_SCREEN):
            _, _, short, slope = at(u)
            u = u - short / slope
            u = np.clip(np.where(np.isfinite(u), u, 0.5), -1 - BEYOND_ENDS, 2 + BEYOND_ENDS)
        place, going, short, slope = at(u)
        speed = np.linalg.norm(going, axis=3)
        astray = (slope[..., 0] < np.cos(NEARLY_PARALLEL) * speed) | (np.abs(short[..., 0]) > ON_SCREEN * speed)
        for by, on in zip(MOVED, TURNED, strict=True):
            moved = cubic_at(u, *((ray[..., by], length * ray[..., on]) for ray, _ in ends))
            across = moved - np.sum(moved * ahead, axis=3, keepdims=True) / slope * going
            rates.append(cells.width[:, None, None, None] * np.einsum("qkd,qabd->qabk", screen, across))
        miss = np.einsum("qkd,qabd->qabk", screen, place)
    return u[..., 0], miss, rates, ~np.any(astray, axis=(1, 2))
