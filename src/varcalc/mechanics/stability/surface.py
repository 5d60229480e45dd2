"""Functions of two parameters by Chebyshev series, on as many panels as it takes.

What is costly at a point and smooth is known everywhere from few points (Trefethen, "Approximation Theory and
Approximation Practice", ch. 8; Townsend and Trefethen, SIAM J. Sci. Comput. 35 (2013) C495).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from varcalc.numerics.chebyshev import roots, to_series
from varcalc.progress import Telling

SURFACE_DEGREE = 23
"""Of the series, in either parameter."""
TAIL = 4
"""Coefficients at the end of a series, in either parameter, that tell what it leaves out."""
SURFACE_RESOLVED = 1e-12
"""Of the largest value in a panel: what may be left out."""
MOST_SURFACE_PANELS = 400

Values = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From places (m,) in both parameters to functions (m, F)."""


@dataclass(frozen=True)
class SeriesPatch:
    """Series ``coefficients`` (N, M, F) between the corners ``low`` and ``high`` (2,), off by ``error`` (F,)."""

    low: np.ndarray
    high: np.ndarray
    coefficients: np.ndarray
    error: np.ndarray

    def basis(self, axis: int, at: np.ndarray) -> np.ndarray:
        """The polynomials (m, N) in one parameter at places (m,)."""
        count, width = self.coefficients.shape[axis], self.high[axis] - self.low[axis]
        if count == 1:
            return np.ones((len(at), 1))
        return chebyshev.chebvander((2 * at - self.low[axis] - self.high[axis]) / width, count - 1)


@dataclass(frozen=True)
class PiecewiseSeries:
    """Functions on a rectangle, by ``panels`` that cover it; ``resolved`` tells whether all series came to an end.

    ``stopped`` tells that Ctrl-C ended the search for them, and that parts are not covered.
    """

    panels: tuple[SeriesPatch, ...] = ()
    resolved: bool = False
    stopped: bool = False

    @classmethod
    def of(cls, values: Values, low: np.ndarray, high: np.ndarray, told: Telling | None = None) -> PiecewiseSeries:
        """That of functions between the corners ``low`` and ``high`` (2,); one side may be no longer than a point."""
        waiting, kept, resolved = [(low, high)], [], True
        while waiting:
            try:
                if told is not None:
                    told(len(kept), len(kept) + len(waiting), "panels")
                panel, tails = _panel(values, *waiting.pop())
            except KeyboardInterrupt:
                if not kept:
                    raise
                return cls(tuple(kept), resolved, stopped=True)
            size = np.abs(panel.coefficients).max(axis=(0, 1))
            rough = np.any(tails > SURFACE_RESOLVED * size, axis=1)
            if not np.any(rough) or not np.all(np.isfinite(tails)):
                kept.append(panel)
                resolved &= bool(np.all(np.isfinite(tails)))
            elif len(kept) + len(waiting) >= MOST_SURFACE_PANELS:
                kept.append(panel)
                resolved = False
            else:
                axis = int(np.argmax((tails / np.where(size > 0, size, 1)).max(axis=1)))
                middle, first, last = (panel.low + panel.high) / 2, panel.high.copy(), panel.low.copy()
                first[axis] = last[axis] = middle[axis]
                waiting += [(panel.low, first), (last, panel.high)]
        return cls(tuple(kept), resolved)

    def on_grid(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m, k, F) over a grid of ascending places (m,) and (k,), and what they may be off."""
        functions = self.panels[0].coefficients.shape[2]
        values, error = (np.full((len(first), len(second), functions), np.nan) for _ in range(2))
        for panel in self.panels:
            rows, columns = (
                slice(np.searchsorted(at, panel.low[axis], "left"), np.searchsorted(at, panel.high[axis], "right"))
                for axis, at in enumerate((first, second))
            )
            left, right = panel.basis(0, first[rows]), panel.basis(1, second[columns])
            values[rows, columns] = np.einsum("in,nmf,jm->ijf", left, panel.coefficients, right, optimize=True)
            error[rows, columns] = panel.error
        return values, error

    def at(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Values (m, F) at places (m,)."""
        return self._read(first, second, 0)

    def slopes(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Derivatives (m, F) by the first parameter at places (m,)."""
        return self._read(first, second, 1)

    def _read(self, first: np.ndarray, second: np.ndarray, derivative: int) -> np.ndarray:
        found = np.full((len(first), self.panels[0].coefficients.shape[2]), np.nan)
        for panel in self.panels:
            inside = (first >= panel.low[0]) & (first <= panel.high[0])
            inside &= (second >= panel.low[1]) & (second <= panel.high[1])
            scale = (2 / (panel.high[0] - panel.low[0])) ** derivative
            series = scale * chebyshev.chebder(panel.coefficients, derivative, axis=0)
            left = panel.basis(0, first[inside])[:, : len(series)]
            along = np.tensordot(left, series, (1, 0))
            found[inside] = np.einsum("jmf,jm->jf", along, panel.basis(1, second[inside]))
        return found


def _panel(values: Values, low: np.ndarray, high: np.ndarray) -> tuple[SeriesPatch, np.ndarray]:
    """The series between two corners, and the last coefficients in either parameter (2, F)."""
    counts = [SURFACE_DEGREE + 1 if b > a else 1 for a, b in zip(low, high, strict=True)]
    places = [(a + b) / 2 + (b - a) / 2 * roots(count) for a, b, count in zip(low, high, counts, strict=True)]
    grid = np.meshgrid(*places, indexing="ij")
    sampled = values(grid[0].ravel(), grid[1].ravel()).reshape(*counts, -1)
    series = [to_series(count) for count in counts]
    coefficients = np.einsum("ni,ijf,mj->nmf", series[0], sampled, series[1], optimize=True)
    ends = [
        np.abs(coefficients[-TAIL:]).max(axis=(0, 1)) if counts[0] > 1 else np.zeros(sampled.shape[2]),
        np.abs(coefficients[:, -TAIL:]).max(axis=(0, 1)) if counts[1] > 1 else np.zeros(sampled.shape[2]),
    ]
    tails = np.array(ends)
    floor = np.finfo(float).eps * np.abs(sampled).max(axis=(0, 1))
    return SeriesPatch(low, high, coefficients, TAIL * (tails.sum(axis=0) + floor)), tails
