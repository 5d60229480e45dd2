"""What the search asks of a family of curves, and what it gives back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from varcalc.methods.first_integral.lines import CurveBatch, CurveIntegrals, Lines
from varcalc.numerics.one_coordinate.panels import Panels


class CurveFamily(Protocol):
    """Curves of one shape with one parameter."""

    @property
    def lines(self) -> Lines[Any]:
        """What integrates the curves."""
        ...

    @property
    def unit(self) -> float:
        """The size of a change of the parameter that matters."""
        ...

    def batch(self, parameter: np.ndarray, multipliers: np.ndarray) -> CurveBatch:
        """The curves for parameters (curves,) and multipliers (constraints, curves)."""
        ...

    def ruled(self, panels: tuple[Panels, ...]) -> Self:
        """The same family with the given rules."""
        ...

    def looked_at(self) -> Self:
        """The same family with coarse rules."""
        ...


@dataclass(frozen=True)
class Aim:
    """What a curve must cover (None: whatever it does), the size that round-off is measured by, and the levels."""

    target: float | None
    size: float
    levels: np.ndarray


@dataclass(frozen=True)
class Joined:
    """A curve of a family that meets its aim, and what it integrates to."""

    family: CurveFamily
    parameter: float
    multipliers: np.ndarray
    measured: CurveIntegrals

    @classmethod
    def of(cls, family: CurveFamily, parameter: float, multipliers: np.ndarray) -> Joined:
        """The curve of one parameter, measured."""
        measured = family.lines.measure(family.batch(np.array([parameter]), multipliers[:, None]))
        return cls(family, parameter, multipliers, measured)

    @property
    def batch(self) -> CurveBatch:
        """The curve as a batch of one."""
        return self.family.batch(np.array([self.parameter]), self.multipliers[:, None])

    def ruled(self, panels: Sequence[Panels]) -> Joined:
        """The same curve by other rules."""
        return Joined.of(self.family.ruled(tuple(panels)), self.parameter, self.multipliers)
