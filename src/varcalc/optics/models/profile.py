"""An index of one coordinate, as the motion along that coordinate sees it.

In layers the momentum p_h along them is constant (Snell's law; Brizard, "An
Introduction to Lagrangian Mechanics", eq. 1.33), and the height u obeys
(du/dτ)² = g(u) - C with g = n², C = p_h² and τ = σ. About a centre Bouguer's
c = |r × p| is constant (eq. 1.45). With u = ln(r/r₀), the logarithm being
conformal, the equation is the same with g = n² r², C = c² and dτ = dσ/r². In
both the optical path is ∫ g dτ, and √C τ is the distance along the layers or
the angle about the centre.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.numerics.one_coordinate.motions import MotionPoint
from varcalc.numerics.one_coordinate.potential import FAR, PLACES, Potential
from varcalc.optics.media.medium import Expression, Medium, Radial
from varcalc.symbolic.differences import carry, displaced
from varcalc.symbolic.evaluation import Columns, PointEvaluator

LOG_RADIUS_LIMIT = 330.0
"""Of |ln(r/r₀)|: beyond it r² is no number."""
PATH, SIGMA = 1, 2
"""The columns of the integrals, after τ, that hold the optical path and σ."""


@dataclass(frozen=True)
class Profile(Potential):
    """g of one medium, about ``unit``: the radius u is measured from, or any height in layers.

    Parameters
    ----------
    medium : Stratified or Radial
    unit : float
        A radius, for a centre; a length of the scene, for layers.
    probe : float
        A u at which there is an index.
    """

    medium: Medium
    unit: float
    probe: float
    _changes: Columns = field(init=False, repr=False, compare=False)
    _index: Columns = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        u, base, x = ca.SX.sym("u"), ca.SX.sym("base"), ca.SX.sym("x")
        g = self._squared(u)
        slope = ca.gradient(g, u)
        values = ca.Function("g", [u], [g, ca.densify(slope)])
        carried = carry(values, [displaced(base, x, self.probe)])
        results = [carried[0].change, carried[1].change]
        object.__setattr__(self, "_changes", PointEvaluator(ca.Function("changes", [base, x], results)).columns)
        index = self._plain.index(self._position(u))
        results = [g, ca.densify(slope), ca.SX(index)]
        object.__setattr__(self, "_index", PointEvaluator(ca.Function("index", [u], results)).columns)

    @property
    def about_centre(self) -> bool:
        """True for a centre, False for layers."""
        return isinstance(self.medium, Radial)

    def _position(self, u: Expression) -> Expression:
        return ca.vertcat(self.unit * ca.exp(u), 0) if self.about_centre else ca.vertcat(0, u)

    @property
    def _plain(self) -> Medium:
        """The medium, its centre at the origin."""
        return replace(self.medium, center=None) if isinstance(self.medium, Radial) else self.medium

    def _squared(self, u: Expression) -> Expression:
        squared = self._plain.squared_index(self._position(u))
        return squared * (self.unit * ca.exp(u)) ** 2 if self.about_centre else squared

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        g, slope, _ = self._table(u)
        return g, slope

    def _table(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, its slope and n at u; g is not a number where there is no index."""
        g, slope, n = (_shaped(c, np.shape(u)) for c in self._index(u))
        return g, slope, n

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`."""
        gain, bend = (_shaped(c, np.shape(x)) for c in self._changes(base, x))
        return gain, bend

    def sound(self, u: np.ndarray) -> np.ndarray:
        """True where g is a number and n not negative; where n² is negative rays turn before."""
        g, slope, n = self._table(u)
        return np.isfinite(g) & np.isfinite(slope) & ~(n < 0)

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        """The integrands of the optical path, g, and of σ: r² about a centre, 1 in layers."""
        return point.g, (self.unit * np.exp(point.u)) ** 2 if self.about_centre else np.ones_like(point.u)

    @property
    def reach(self) -> np.ndarray | None:
        """Multiples of one about a centre, where u is a logarithm."""
        reach = np.geomspace(1e-8, FAR, PLACES)
        return reach[reach < LOG_RADIUS_LIMIT] if self.about_centre else None


def _shaped(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """``values`` in ``shape``: what does not depend on the place comes as one number."""
    values = np.asarray(values, dtype=float)
    return values if values.shape == shape else np.broadcast_to(values, shape)
