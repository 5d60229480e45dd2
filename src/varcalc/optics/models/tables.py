"""g of an index that is given at some heights: cubics between them, which are stops of every integral."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.reduction import RayPotential

JUST_OUTSIDE = 8 * float(np.finfo(float).eps)
"""Of the table's height: who is so little outside it is at its end."""


@dataclass(frozen=True)
class TableProfile(RayPotential):
    """g = n² of a table, as a function of the height."""

    medium: Tabulated

    @property
    def stops(self) -> np.ndarray:
        """The heights of the table, its ends among them."""
        return self._heights

    @cached_property
    def _heights(self) -> np.ndarray:
        return np.array(self.medium.heights)

    @property
    def about_centre(self) -> bool:
        """A table has layers."""
        return False

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """dg/du at the lower and at the upper end of each layer."""
        layers = np.arange(self.medium.layers)
        thick = np.diff(self.stops)
        return self.medium.slope(layers, 0 * thick), self.medium.slope(layers, thick)

    @cached_property
    def _cubics(self) -> np.ndarray:
        """Shape (4, layers)."""
        return np.ascontiguousarray(self.medium.coefficients.T)

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        layer, above = self._place(np.asarray(u, dtype=float))
        a, b, c, d = self._cubics[:, layer]
        return a + above * (b + above * (c + above * d)), b + above * (2 * c + above * 3 * d)

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`: through the heights of the table that lie between, cubic by cubic."""
        first, above = np.broadcast_arrays(*self._place(base), x)[:2]
        last, there = self._place(base + x)
        gain, bend = self._within(first, above, x)
        crossing = np.nonzero(first != last)
        gain[crossing], bend[crossing] = self._through(*(a[crossing] for a in (first, last, above, x)))
        known = np.isfinite(above) & np.isfinite(there)
        return np.where(known, gain, np.nan), np.where(known, bend, np.nan)

    def _through(
        self, first: np.ndarray, last: np.ndarray, above: np.ndarray, x: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The changes from ``above`` the lower height of the layer ``first`` over ``x`` into the layer ``last``."""
        knots, up = self.stops, x > 0
        leave, enter = np.where(up, first + 1, first), np.where(up, last, last + 1)
        to_leave = (knots[leave] - knots[first]) - above
        out = self._within(first, above, to_leave)
        # what is left of x is told from x, which may be far smaller than the place
        rest = (x - to_leave) - (knots[enter] - knots[leave])
        back = self._within(last, knots[enter] - knots[last], rest)
        low, high = self._slopes
        squared = np.square(self.medium.n)
        turned = np.where(up, low[last] - high[first], high[last] - low[first])
        return out[0] + (squared[enter] - squared[leave]) + back[0], out[1] + turned + back[1]

    def _place(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The layers of heights, and how far above their lower ends they are; not numbers outside the table."""
        knots = self.stops
        room = JUST_OUTSIDE * float(np.max(np.abs(knots)))
        layer = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, self.medium.layers - 1)
        return layer, np.where((u >= knots[0] - room) & (u <= knots[-1] + room), u - knots[layer], np.nan)

    def _within(self, layer: np.ndarray, above: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changes of g and its slope over ``x`` from ``above`` the lower height of a layer, by its cubic."""
        _, _, c, d = self._cubics[:, layer]
        return self._gain(layer, above, x), x * (2 * c + 3 * d * (2 * above + x))

    def _gain(self, layer: np.ndarray, above: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The change of g alone."""
        _, b, c, d = self._cubics[:, layer]
        return x * (b + c * (2 * above + x) + d * (3 * above * (above + x) + x * x))

    def within(self, place: np.ndarray, base: np.ndarray, x: np.ndarray) -> np.ndarray:
        """See :meth:`RayPotential.within`."""
        layer = np.clip(np.searchsorted(self.stops, place, side="right") - 1, 0, self.medium.layers - 1)
        return self._gain(layer, base - self.stops[layer], x)

    def sound(self, u: np.ndarray) -> np.ndarray:
        """True in the table."""
        return (u >= self.stops[0]) & (u <= self.stops[-1])
