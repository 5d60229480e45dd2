"""A map of where the rays of a source go, in cells: two rays each, a stretch of σ long.

The ends of a cell nearly follow wavefronts, so that its rays go straight through it.
A ray's place r depends on its launching angle θ and on σ. The deviations that
are carried along are the derivatives of r and p by θ, Hamilton's equations
those by σ, so that at its four corners a cell knows r, r_θ, r_σ and r_θσ: all
that a bicubic needs. As a Bézier surface it lies in the hull of its sixteen
control points, which says where it cannot reach. (Wavefronts have been made
into such nets by Vinje, Iversen and Gjøystdal, Geophysics 58 (1993) 1157; here
the corners lie on exact rays.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.optics.rays.beam import Beam, Rows, packed, unpacked

R, P, PATH, MOVED, TURNED, CROSSED = slice(0, 2), slice(2, 4), 4, slice(5, 7), slice(7, 9), 9
"""Columns of a state in the plane with one neighbour, as :func:`varcalc.optics.rays.beam.packed` has them; and last
which jumps of the index the ray has come through."""


SLANTED = 0.6
"""A cell is slanted where a line across its rays rises by so many lengths of it from one to the other."""

SLOPE_SHARE = 0.15
"""Of a length: how far off is a cubic that is right at an end and in the middle, and has a slope that is off there."""


@dataclass(frozen=True)
class Cells(Rows):
    """q cells; axes [side, end] are the ray of the smaller and larger angle, the smaller and larger σ.

    Attributes
    ----------
    source : ndarray of int, shape (q,)
        The number of the source.
    angle : ndarray, shape (q, 2)
        The launching angles of the two rays.
    sigma : ndarray, shape (q, 2, 2)
        σ at the corners, from the last surface on.
    state : ndarray, shape (q, 2, 2, 10)
        The rays there: r, p, optical path, δr, δp, jumps come through; not a number where the ray does not come so far.
    pull : ndarray, shape (q, 2, 2, 2)
        dp/dσ there.
    delay : ndarray, shape (q, 2, 2)
        The derivative of σ by the angle along the end there.
    sideways, error : ndarray, shape (q,)
        How far the cubic from ray to ray may be off across the rays, and the bicubic in all: lengths; infinite where
        nobody has looked.
    depth : ndarray of int, shape (q,)
        How often the cell has been halved.
    """

    source: np.ndarray
    angle: np.ndarray
    sigma: np.ndarray
    state: np.ndarray
    pull: np.ndarray
    delay: np.ndarray
    sideways: np.ndarray
    error: np.ndarray
    depth: np.ndarray

    @classmethod
    def none(cls) -> Cells:
        """No cells."""
        shapes = ((), (2,), (2, 2), (2, 2, 10), (2, 2, 2), (2, 2), (), (), ())
        return cls(*(np.zeros((0, *shape), dtype=int if k in (0, 8) else float) for k, shape in enumerate(shapes)))

    @property
    def whole(self) -> np.ndarray:
        """True (q,) where both rays come as far as the far end."""
        return np.all(np.isfinite(self.state), axis=(1, 2, 3))

    @property
    def smooth(self) -> np.ndarray:
        """True (q,) where no jump of the index is inside, as far as the corners tell: all have come the same way."""
        return np.all(self.state[..., CROSSED] == self.state[:, :1, :1, CROSSED], axis=(1, 2))

    def derivatives(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The place and its derivatives by a, by u and by both, (q, 2, 2, 2) each, in the unit square (a, u).

        a goes from ray to ray along the ends, and u from end to end, in proportion to σ on each ray.
        """
        width = (self.angle[:, 1] - self.angle[:, 0])[:, None, None]
        slant = width * self.delay
        length = (self.sigma[:, :, 1] - self.sigma[:, :, 0])[:, :, None, None]
        skew = (slant[:, :, 1] - slant[:, :, 0])[:, :, None, None]
        p, moved, turned = self.state[..., P], self.state[..., MOVED], self.state[..., TURNED]
        width, slant = width[..., None], slant[..., None]
        return (
            self.state[..., R],
            width * moved + slant * p,
            length * p,
            length * (width * turned + slant * self.pull) + skew * p,
        )

    def slant(self) -> np.ndarray:
        """How many lengths of the cell a line across its rays rises from ray to ray (q,), at the worst corner."""
        _, across, ahead, _ = self.derivatives()
        with np.errstate(all="ignore"):
            slant = np.abs(np.sum(across * ahead, axis=3)) / np.sum(ahead**2, axis=3)
        return np.where(np.isfinite(slant), slant, 0.0).max(axis=(1, 2))

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest coordinates (q, 2) of the control points, of the corners there are."""
        place, across, ahead, both = self.derivatives()
        signs = np.array([1.0, -1.0]) / 3
        a, u = signs[None, :, None, None], signs[None, None, :, None]
        points = np.stack([place, place + a * across, place + u * ahead, place + a * across + u * ahead + a * u * both])
        low = np.where(np.isfinite(points), points, np.inf).min(axis=(0, 2, 3))
        high = np.where(np.isfinite(points), points, -np.inf).max(axis=(0, 2, 3))
        return low, high


def cell_states(beam: Beam) -> np.ndarray:
    """The states (m, N) of cells for the rays of ``beam``, in the plane or in space."""
    return np.column_stack([packed(beam), beam.crossed])


def beam_of(states: np.ndarray, dimension: int) -> Beam:
    """The rays of the states (m, N)."""
    return replace(unpacked(states[:, :-1], dimension), crossed=states[:, -1])


def between(width: np.ndarray, sigma: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """σ (q, ends) where a ray half way between two comes to the ends of a cell.

    ``sigma`` and ``delay`` (q, 2, ends) are those of the two rays, ``width`` (q,) apart.
    """
    bend = width[:, None] * (delay[:, 0] - delay[:, 1]) / 8
    return sigma.mean(axis=1) + np.where(np.isfinite(bend), bend, 0.0)


def parted(cells: Cells, sigma: np.ndarray, state: np.ndarray, pull: np.ndarray) -> tuple[Cells, np.ndarray]:
    """Quarters of each cell, or halves, with the number of the cell that each was in, ascending.

    σ (q, 3, 3), states and pulls are those at 3 x 3 places [ray, end]. A slanted cell is halved between its
    rays only.
    """
    angle = np.column_stack([cells.angle[:, 0], cells.angle.mean(axis=1), cells.angle[:, 1]])
    delay = _delays(cells)
    sideways, off, along = _unforeseen(angle[:, 2] - angle[:, 0], sigma, state, delay)
    slanted = cells.slant() > SLANTED
    parts, parents = [], []
    for number, ends in ((~slanted, (slice(0, 2), slice(1, 3))), (slanted, (slice(0, 3, 2),))):
        rows = np.flatnonzero(number)
        error = off[rows] / 4 + along[rows] / (4 if len(ends) == 2 else 1)
        for end in ends:
            for a in (0, 1):
                part = (rows, slice(a, a + 2), end)
                parts.append(
                    Cells(cells.source[rows], angle[rows, a : a + 2], sigma[part], state[part], pull[part],
                          delay[part], sideways[rows] / 4, error, cells.depth[rows] + 1)
                )  # fmt: skip
                parents.append(rows)
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    return Cells.joined(parts).take(order), parent[order]


def _delays(cells: Cells) -> np.ndarray:
    """The derivatives of σ by the angle (q, 3, 3) along the lines that part the cells: the parts fit together."""
    width = (cells.angle[:, 1] - cells.angle[:, 0])[:, None]
    rise = cells.sigma[:, 1] - cells.sigma[:, 0]
    middle = np.zeros_like(rise)  # where two angles are neighbours as numbers too
    np.divide(1.5 * rise, width, out=middle, where=width > 0)
    middle -= (cells.delay[:, 0] + cells.delay[:, 1]) / 4
    ends = np.stack([cells.delay[:, 0], middle, cells.delay[:, 1]], axis=1)
    return np.stack([ends[:, :, 0], ends.mean(axis=2), ends[:, :, 1]], axis=2)


def _unforeseen(width: np.ndarray, sigma: np.ndarray, state: np.ndarray, delay: np.ndarray) -> tuple[np.ndarray, ...]:
    """How far off the cubics from ray to ray are (q,), across the rays and in all, and those along the rays.

    In half the width a cubic errs by a sixteenth of that; to divide by four leaves room for doubt. Where a ray is bent
    at once, a quarter of the way along, the middle is where it is foretold, but not the direction there, which counts.
    """
    slope = width[:, None, None] * delay[:, ::2, ::2]
    slope = np.stack([slope[:, :, 0], slope.mean(axis=2), slope[:, :, 1]], axis=2)
    sides, ahead = state[:, ::2], state[:, 1, :, P]
    across = width[:, None, None, None] * sides[..., MOVED] + slope[..., None] * sides[..., P]
    late = sigma[:, ::2].mean(axis=1) + (slope[:, 0] - slope[:, 1]) / 8 - sigma[:, 1]
    actual = state[:, 1, :, R] + late[:, :, None] * ahead
    off = sides[..., R].mean(axis=1) + (across[:, 0] - across[:, 1]) / 8 - actual
    turned = _apart(off, ahead)
    inner = width[:, None, None] * (state[:, 1, :, MOVED] + delay[:, 1, :, None] * ahead)
    skew = 1.5 * (sides[:, 1, :, R] - sides[:, 0, :, R]) - (across[:, 0] + across[:, 1]) / 4 - inner
    length = (sigma[:, ::2, 2] - sigma[:, ::2, 0])[:, :, None]
    along = sides[:, :, ::2, R].mean(axis=2) + length * (sides[:, :, 0, P] - sides[:, :, 2, P]) / 8 - sides[:, :, 1, R]
    bend = 1.5 * (sides[:, :, 2, R] - sides[:, :, 0, R]) - length * (
        (sides[:, :, 0, P] + sides[:, :, 2, P]) / 4 + sides[:, :, 1, P]
    )
    with np.errstate(invalid="ignore"):
        sideways = (turned + SLOPE_SHARE * _apart(skew, ahead)).max(axis=1)
        over = (np.linalg.norm(off, axis=2) + SLOPE_SHARE * np.linalg.norm(skew, axis=2)).max(axis=1)
        lengthwise = (np.linalg.norm(along, axis=2) + SLOPE_SHARE * np.linalg.norm(bend, axis=2)).max(axis=1)
    return tuple(np.where(np.isfinite(error), error, np.inf) for error in (sideways, over, lengthwise))


def _apart(off: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """The part (q, 3) of ``off`` (q, 3, 2) across the rays, which go ``ahead``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs((off[..., 0] * ahead[..., 1] - off[..., 1] * ahead[..., 0]) / np.linalg.norm(ahead, axis=2))
