"""What lattices of polygons lie over: functionals of curves that one function describes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from varcalc.existence.features import Features
from varcalc.formulation import Sampled
from varcalc.problem.functional import Functional

ValuesAt = Callable[[slice, np.ndarray, np.ndarray], np.ndarray]
"""L at some of K abscissae, by a slice of them, at ordinates and slopes (G, k, I, J)."""


class Landscape(Protocol):
    """A functional of first order of curves that one function describes, as it is minimised.

    ``span`` is the interval, ``sign`` -1 where it is maximised, ``held`` tells which ends are fixed, ``closed`` that
    they are one, ``approximate`` that the values are not the functional's own: they show valleys, no more. At the
    ``waypoints`` a curve is where the known one is.
    """

    span: tuple[float, float]
    sign: float
    held: tuple[bool, bool]
    closed: bool
    approximate: bool
    waypoints: tuple[float, ...]

    def values(self, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """L on arrays that broadcast."""
        ...

    def own_values(self, x: np.ndarray, weights: np.ndarray, y: np.ndarray, v: np.ndarray) -> bool:
        """Whether the values along one curve, at x (m,) with the weights of a rule, are the functional's own."""
        ...

    def at_end(self, side: int, y: np.ndarray) -> np.ndarray:
        """What ordinates at the start (0) or the end (1) add."""
        ...

    def along(self, valley: Sampled) -> Sampled:
        """The curve of the problem that a function of x, which gives (1, m), stands for."""
        ...


class LandscapeWithUnit(Landscape, Protocol):
    """A landscape that has a unit of its own."""

    @property
    def problem(self) -> Functional:
        """What is asked of the curves."""
        ...

    def extent(self, y: np.ndarray) -> float:
        """The unit in which departures from a curve with ordinates y (m,) are measured."""
        ...

    def at(self, x: np.ndarray) -> ValuesAt:
        """L as it is minimised at abscissae x (G, K), where the curve is told once."""
        ...

    def beside_jumps(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """Ordinates (m,) just beside those at which L jumps, from y (m,) at x (m,)."""
        ...

    @property
    def narrow(self) -> Features:
        """Where L is too narrow for evenly spaced rows."""
        ...

    def placed(self, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """The functions' values (m, j) at x (m,) that lead to ordinates (j,)."""
        ...
