"""An index that was measured: heights and the index there."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import casadi as ca
import numpy as np

from varcalc.optics.media.medium import Expression, Medium
from varcalc.optics.validation import numbers
from varcalc.problem.conditions import truth
from varcalc.showing import Brief
from varcalc.spelling import spelled

CHECKED_PLACES = 33
"""Places in each layer at which n² is asked to be positive."""


class Layers(ABC):
    """n² in layers between ``heights`` that ascend, and where rays go on that come to one of these."""

    heights: Sequence[float]

    @abstractmethod
    def constants(self, layers: np.ndarray) -> np.ndarray:
        """What :meth:`written` needs to know of the ``layers`` (m,): lower and upper height, then others; (m, k)."""

    @abstractmethod
    def written(self, height: Expression, constants: Expression) -> Expression:
        """n² at a height in the layer of which there are the ``constants``."""

    @abstractmethod
    def slope(self, layers: np.ndarray, above: np.ndarray) -> np.ndarray:
        """dn²/dy (m,) in ``layers`` (m,), ``above`` their lower heights."""

    @property
    @abstractmethod
    def kinked(self) -> bool:
        """Whether n² has kinks at the heights."""

    @property
    def layers(self) -> int:
        """How many there are between the heights."""
        return len(self.heights) - 1

    def starts(self, heights: np.ndarray, climb: np.ndarray) -> tuple[np.ndarray, ...]:
        """Where rays at ``heights`` (m,) with vertical momenta ``climb`` (m,) start: arrays (m,).

        The layers; the numbers of the heights on which they start, or -1; True for rays along a kink to
        which both sides turn them back; True for those that leave the layers at once. A ray along a height
        goes to the side to which it is pulled.
        """
        knots = np.asarray(self.heights)
        above = self.layer_of(heights, np.ones(len(heights), dtype=bool))
        upwards = self.slope(above, heights - knots[above]) >= 0
        layer = self.layer_of(heights, (climb > 0) | ((climb == 0) & upwards))
        on = np.where(heights == knots[layer], layer, np.where(heights == knots[layer + 1], layer + 1, -1))
        pull = self.slope(layer, heights - knots[layer])
        away = ((on == layer + 1) & (pull > 0)) | ((on == layer) & (pull < 0))
        edge = (on == 0) | (on == self.layers)
        stuck = away & ~edge & (climb == 0) & self.kinked
        return layer, on, stuck, away & edge & (climb == 0)

    def crossed(
        self, layer: np.ndarray, knot: np.ndarray, climb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays (m,) that come to heights, ``knot`` (m,), from the layers ``layer`` (m,) go on.

        The layers that follow, those that only touch a height staying in theirs; True for rays that stay in
        them; and by how much the momentum of a neighbour upwards changes for each unit of length that it is
        above: n² may have a kink there, which it comes to at another σ than the ray.
        """
        knots = np.asarray(self.heights)
        following = np.where(climb > 0, knot, np.where(climb < 0, knot - 1, layer))
        inside = (following >= 0) & (following < self.layers)
        beyond = np.clip(following, 0, self.layers - 1)
        slopes = [self.slope(k, knots[knot] - knots[k]) for k in (layer, beyond)]
        kick = np.divide((slopes[1] - slopes[0]) / 2, climb, out=np.zeros(len(climb)), where=climb != 0)
        return following, inside, kick

    def layer_of(self, heights: np.ndarray, climbing: np.ndarray) -> np.ndarray:
        """The layers (m,) that rays at ``heights`` (m,) are in, or come into where they are between two."""
        knots = np.asarray(self.heights)
        above = np.searchsorted(knots, heights, side="right") - 1
        below = np.searchsorted(knots, heights, side="left") - 1
        return np.clip(np.where(climbing, above, below), 0, self.layers - 1)


@spelled
@dataclass(frozen=True, repr=False)
class Tabulated(Brief, Medium, Layers):
    """An index given at some heights, the last coordinate; rays end where they leave the table.

    The index at each height is a parameter of the medium: ``n0``, ``n1``, ... in the order of the heights.

    Between the heights n² is a cubic: by default that of the smooth spline, with two continuous derivatives (de
    Boor, "A Practical Guide to Splines", ch. IV). No step of an integration goes over a height of the table.

    Raises ValueError for heights out of order, an index that is not positive, or too few of either.

    Parameters
    ----------
    heights : sequence of float
        In ascending order.
    n : sequence of float
        The index there, positive; c0/c for a speed c.
    smooth : bool
        With False n² is linear between the heights, exactly, and rays are pieces of parabolas. The kinks of such a
        profile focus: they make caustics that a smooth profile does not have.
    """

    heights: Sequence[float]
    n: Sequence[float]
    smooth: bool = True
    coefficients: np.ndarray = field(init=False, repr=False, compare=False)
    """Shape (layers, 4): n² = Σ a_k (y - y_0)^k above the lower height y_0 of each layer."""

    def __post_init__(self) -> None:
        heights, index = numbers("heights", self.heights), numbers("n", self.n)
        if heights.ndim != 1 or heights.shape != index.shape or len(heights) < 2:
            raise ValueError(
                f"heights and n must be as many numbers, two or more, not {heights.shape} and {index.shape}"
            )
        if not np.all(np.diff(heights) > 0):
            place = int(np.argmin(np.diff(heights) > 0))
            raise ValueError(
                f"heights must ascend, but {heights[place]:g} is followed by {heights[place + 1]:g}; "
                "sort the table and leave out what is there twice"
            )
        reach = float(heights[-1] - heights[0])
        if not math.isfinite(reach * reach):  # the cubics are made of squares of distances
            raise ValueError(
                f"heights reach from {heights[0]:g} to {heights[-1]:g}, which is too far; use larger units"
            )
        if not np.all(index > 0):
            raise ValueError(f"n must be positive, but it is {index.min():g} at height {heights[index.argmin()]:g}")
        truth("smooth", self.smooth)
        object.__setattr__(self, "heights", tuple(float(h) for h in heights))
        object.__setattr__(self, "n", tuple(float(v) for v in index))
        object.__setattr__(self, "coefficients", self._fitted(heights, index**2))
        self._check_between(heights)

    def _fitted(self, heights: np.ndarray, squared: np.ndarray) -> np.ndarray:
        """The cubics' coefficients (layers, 4) from n² (k,) at the heights; from columns (k, j) those of all j."""
        if self.smooth and len(heights) > 2:
            from scipy.interpolate import CubicSpline

            return np.ascontiguousarray(np.moveaxis(CubicSpline(heights, squared).c[::-1], 0, 1))
        slopes = (np.diff(squared, axis=0).T / np.diff(heights)).T
        return np.stack([squared[:-1], slopes, 0 * slopes, 0 * slopes], axis=1)

    def _check_between(self, heights: np.ndarray) -> None:
        above = np.diff(heights)[:, None] * np.linspace(0, 1, CHECKED_PLACES)
        squared = sum(self.coefficients[:, k, None] * above**k for k in range(4))
        if not np.min(squared) > 0:
            layer = int(np.argmin(np.min(squared, axis=1)))
            raise ValueError(
                f"the spline through the table is negative between heights {heights[layer]:g} and "
                f"{heights[layer + 1]:g}; give more heights there, or smooth=False"
            )

    @property
    def parameters(self) -> Mapping[str, float]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The index at each height, by the names n0, n1, ..."""
        return {f"n{k}": value for k, value in enumerate(self.n)}

    def _changed(self, parameters: Mapping[str, float]) -> Self:
        return replace(self, n=tuple(parameters.values()))

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:
        """n at ``position`` for other numbers at the heights; ValueError for symbols, which have no table."""
        return self.with_parameters(parameters).index(position)

    def parameter_rates(self, points: np.ndarray) -> np.ndarray:
        """∂(n²)/∂p / 2 (k, number of heights) at ``points`` (k, d), p the index at each height."""
        heights = points[:, -1]
        layer = self.layer_of(heights, np.ones(len(heights), dtype=bool))
        powers = (heights - np.asarray(self.heights)[layer])[:, None] ** np.arange(4)
        shares = self._fitted(np.array(self.heights), np.eye(len(self.heights)))  # of each n² in each coefficient
        return np.einsum("ka,kan->kn", powers, shares[layer]) * np.array(self.n)

    def index(self, position: Expression) -> Expression:
        """n at the height of ``position``; not a number outside the table."""
        height = position[position.numel() - 1]
        inside = ca.logic_and(height >= self.heights[0], height <= self.heights[-1])
        return ca.sqrt(ca.if_else(inside, self.squared_index(position), -1.0))

    def squared_index(self, position: Expression) -> Expression:
        """n² at the height of ``position``; the end layers go on outside the table."""
        height = position[position.numel() - 1]
        squared = self.written(height, ca.DM(self.constants(np.array([0]))[0]))
        for layer in range(1, self.layers):
            above = self.written(height, ca.DM(self.constants(np.array([layer]))[0]))
            squared = ca.if_else(height >= self.heights[layer], above, squared)
        return squared

    def written_in_parts(self, position: Expression) -> tuple[Expression, Expression, Expression]:
        """See :meth:`Medium.written_in_parts`: layers."""
        height, constants = position[position.numel() - 1], ca.SX.sym("layer", 6)
        squared = self.written(height, constants)
        inside = ca.logic_and(height >= self.heights[0], height <= self.heights[-1])
        return constants, squared, ca.sqrt(ca.if_else(inside, squared, -1.0))

    def numbers_of_parts(self, points: np.ndarray) -> np.ndarray:
        """See :meth:`constants`."""
        heights = points[:, -1]
        return self.constants(self.layer_of(heights, np.ones(len(heights), dtype=bool)))

    def constants(self, layers: np.ndarray) -> np.ndarray:
        """See :meth:`Layers.constants`: the heights, and the coefficients of the cubic; (m, 6)."""
        heights = np.asarray(self.heights)
        return np.column_stack([heights[layers], heights[layers + 1], self.coefficients[layers]])

    def written(self, height: Expression, constants: Expression) -> Expression:
        """See :meth:`Layers.written`."""
        above = height - constants[0]
        return constants[2] + above * (constants[3] + above * (constants[4] + above * constants[5]))

    @property
    def kinked(self) -> bool:
        """See :attr:`Layers.kinked`."""
        return not self.smooth

    def slope(self, layers: np.ndarray, above: np.ndarray) -> np.ndarray:
        """See :meth:`Layers.slope`."""
        _, first, second, third = self.coefficients[layers].T
        return first + above * (2 * second + 3 * above * third)
