"""The ends a curve has to join, and the answers a reduction gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from varcalc.numerics.roots import EPSILON

ROUND_OFF = 4 * EPSILON
"""Round-off of a sum, relative to the sizes of its terms."""


class Evaluate(Protocol):
    """A curve: (abscissae (m,), derivative 0 or 1) to values (1, m)."""

    @property
    def nodes(self) -> np.ndarray:
        """Abscissae of the panels' edges."""
        ...

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """y or y' at abscissae x."""
        ...


class Unsuitable(Exception):
    """A problem this method cannot take, and why."""


class NotFound(Exception):
    """No extremal of the kind looked for, and what was searched."""


@dataclass(frozen=True)
class EndValues:
    """The two ends of a graph; an ordinate is None where it is free."""

    x0: float
    y0: float | None
    x1: float
    y1: float | None

    @property
    def width(self) -> float:
        """The interval's length."""
        return self.x1 - self.x0

    @property
    def mean_slope(self) -> float:
        """A slope typical of the problem: that of the chord, or 1 (level or free ends tell none)."""
        if self.y0 is None or self.y1 is None or self.y0 == self.y1:
            return 1.0
        return abs(self.y1 - self.y0) / self.width


@dataclass(frozen=True)
class Reduced:
    """An extremal found by quadrature: ``value`` with its error, the curve with its own, and what follows.

    ``multipliers`` are those of L + sum of lambda_j g_j; ``partials`` the
    derivatives of the value by the parameters. ``doubt`` says, in words, where
    something of the integrands may hide between the points of the quadrature.
    """

    value: float
    value_error: float
    curve: Evaluate
    curve_error: float
    nodes: np.ndarray
    multipliers: np.ndarray
    partials: np.ndarray
    points: int
    doubt: str = ""


@dataclass(frozen=True)
class ConstantCurve:
    """The curve y = const."""

    height: float
    ends: EndValues

    @property
    def nodes(self) -> np.ndarray:
        """The two ends."""
        return np.array([self.ends.x0, self.ends.x1])

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The height (derivative 0) or 0, at abscissae x (m,); shape (1, m)."""
        return np.full((1, len(x)), 0.0 if derivative else self.height)
