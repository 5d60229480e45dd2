"""Curves of a Lagrangian without x, evaluable anywhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.methods.first_integral.energy import EnergyLines
from varcalc.methods.first_integral.lines import CurveBatch, Measured
from varcalc.numerics.one_coordinate.panels import Cumulative, distance
from varcalc.numerics.resampled import SentResampled


@dataclass(frozen=True)
class OrbitCurve(SentResampled):
    """y(x) where x(y) is known on monotone legs: inverted in the variable of each leg's rule."""

    lines: EnergyLines
    batch: CurveBatch
    measured: Measured
    start: float
    end: float

    @cached_property
    def _cumulative(self) -> Cumulative:
        return Cumulative([leg.panels for leg in self.batch.legs], [d[0] for d in self.measured.dx])

    @cached_property
    def _anchors(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Abscissa of each leg's anchor, sign of the way from it, and the abscissae between legs."""
        covered = self._cumulative.totals()
        between = self.start + np.concatenate([[0.0], np.cumsum(covered)])
        between[-1] = self.end
        away = np.array([leg.away for leg in self.batch.legs])
        return np.where(away, between[:-1], between[1:]), np.where(away, 1.0, -1.0), between

    @property
    def nodes(self) -> np.ndarray:
        """Abscissae of the panels' edges."""
        at, sign, _ = self._anchors
        edges = [np.array(leg.panels.edges) for leg in self.batch.legs]
        x = [at[k] + sign[k] * self._cumulative.at(np.full(len(e), k), e) for k, e in enumerate(edges)]
        return np.unique(np.clip(np.concatenate([[self.start], *x, [self.end]]), self.start, self.end))

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """y (derivative 0) or y' (1) at abscissae x (m,); shape (1, m)."""
        at, sign, between = self._anchors
        leg = np.clip(np.searchsorted(between, x, side="right") - 1, 0, len(at) - 1)
        t = self._cumulative.inverse(leg, np.maximum(sign[leg] * (x - at[leg]), 0.0))
        out = np.empty(len(x))
        for k in np.unique(leg):
            mask, this = leg == k, self.batch.legs[k]
            delta = this.length[0] * distance(this.panels.kind, t[mask])[0]
            out[mask] = self.lines.slope(this, delta, self.batch) if derivative else this.anchor[0] + delta
        return out[None, :]
