"""Starting curves that have an isoperimetric level, with the multiplier that suits each best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.methods.first_integral.answers import EndValues, Unsuitable
from varcalc.methods.first_integral.integrands import ReducedIntegrands
from varcalc.numerics.roots import scanned_root

AMPLITUDES = np.logspace(-5, 4, 73)
"""Heights, in units of the problem's size, of the bumps tried to meet a level."""
STARTING_POINTS = 48


@dataclass(frozen=True)
class LevelStart:
    """A curve y(x) through the ends that has the isoperimetric level, and the multiplier that suits it best."""

    x: np.ndarray
    y: np.ndarray
    slope: np.ndarray
    multiplier: float
    convex: bool


def starts(integrands: ReducedIntegrands, ends: EndValues, row: int) -> list[LevelStart]:
    """Curves chord + A x (1 - x) that have the isoperimetric level, with the multiplier fitted to each.

    The first integral is linear in the constant and the multiplier: both follow by least squares along the curve.
    """
    if ends.y0 is None or ends.y1 is None:
        raise Unsuitable("FirstIntegral wants both ends fixed where there are isoperimetric levels; use Ritz")
    if len(integrands.levels) > 1:
        raise Unsuitable("FirstIntegral takes one isoperimetric level at most; use Ritz or Collocation")
    u, weights = np.polynomial.legendre.leggauss(STARTING_POINTS)
    u, weights = 0.5 * (1 + u), 0.5 * weights
    x = ends.x0 + ends.width * u
    y0, rise = ends.y0, ends.y1 - ends.y0
    size = max(abs(rise), ends.mean_slope * ends.width)

    def curve(height: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        return y0 + rise * u + 4 * height * u * (1 - u), (rise + 4 * height * (1 - 2 * u)) / ends.width

    def level(heights: np.ndarray) -> np.ndarray:
        """How far curves of some heights (k,) are from the level, (k,)."""
        y, slope = curve(heights[:, None])
        radius = np.hypot(1.0, slope / integrands.scale)
        parts = integrands.at(np.tile(x, len(heights)), y.ravel(), slope.ravel())[1, 0].reshape(y.shape)
        return (parts * radius) @ weights * ends.width - float(integrands.levels[0])

    found: list[LevelStart] = []
    for sign in (1.0, -1.0):
        heights = sign * size * np.concatenate([[0.0], AMPLITUDES])
        misses = level(heights)
        for k in np.flatnonzero(misses[1:] * misses[:-1] <= 0)[:1]:
            height = scanned_root(level, float(heights[k]), float(heights[k + 1]), 0.0)
            found += [] if height is None else [_fitted(integrands, x, *curve(height), weights, row)]
    return found


def _fitted(
    integrands: ReducedIntegrands, x: np.ndarray, y: np.ndarray, slope: np.ndarray, weights: np.ndarray, row: int
) -> LevelStart:
    parts = integrands.at(x, y, slope)
    root = np.sqrt(weights)
    matrix = np.column_stack([parts[1, row], -np.ones_like(x)]) * root[:, None]
    multiplier = float(np.linalg.lstsq(matrix, -parts[0, row] * root, rcond=None)[0][0])
    curvature = parts[0, 4] + multiplier * parts[1, 4]
    known = curvature[~np.isnan(curvature)]
    return LevelStart(x, y, slope, multiplier, known.size > 0 and bool(np.median(known) > 0))
