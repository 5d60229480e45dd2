"""Media: the refractive index as a function of position.

Every medium answers with n² as a CasADi expression of the coordinates, which
is what Hamilton's ray equations need, and often a polynomial where n is none.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from varcalc import tracing
from varcalc.instructions import Vectorised
from varcalc.optics.values import point

Expression = Any
"""A CasADi SX expression."""


class Medium(ABC):
    """What fills a part of a scene. A new medium defines :meth:`index`."""

    @abstractmethod
    def index(self, position: Expression) -> Expression:
        """n at ``position``, a column of 2 or 3 CasADi symbols."""

    def squared_index(self, position: Expression) -> Expression:
        """n² at ``position``; simpler than n where that is a root."""
        return self.index(position) ** 2

    @property
    def dimension(self) -> int | None:
        """2 or 3 where the medium itself says so; None for a medium that fits both."""
        return None

    @property
    def is_uniform(self) -> bool:
        """True where rays are straight."""
        return False


@dataclass(frozen=True)
class Uniform(Medium):
    """The same index everywhere.

    Parameters
    ----------
    n : float
        The refractive index, positive.

    Raises
    ------
    ValueError
        Where ``n`` is not a positive number.
    """

    n: float

    def __post_init__(self) -> None:
        if not isinstance(self.n, int | float | np.number) or isinstance(self.n, bool):
            raise TypeError(f"n must be a number, not {self.n!r}; for an index that varies take Graded")
        if not 0 < self.n < np.inf:
            raise ValueError(f"n must be a positive index, not {self.n}; a mirror is a surface with mirror=True")

    def index(self, position: Expression) -> Expression:  # noqa: ARG002  the same everywhere
        """n, a constant."""
        return ca.SX(float(self.n))

    @property
    def is_uniform(self) -> bool:
        """True."""
        return True


@dataclass(frozen=True)
class Stratified(Medium):
    """An index that depends on the height, the last coordinate.

    Parameters
    ----------
    n : callable
        ``n(height)``, written with NumPy's or CasADi's functions; called once, with a symbol.
    """

    n: Callable[[Expression], Expression]

    def __post_init__(self) -> None:
        _traced("n", self.n, [ca.SX.sym("height")])

    def index(self, position: Expression) -> Expression:
        """n at the height of ``position``."""
        return _traced("n", self.n, [position[position.numel() - 1]])


@dataclass(frozen=True)
class Radial(Medium):
    """An index that depends on the distance from a centre.

    Parameters
    ----------
    n : callable
        ``n(radius)``, written with NumPy's or CasADi's functions; called once, with a symbol.
    center : sequence of float, optional
        2 or 3 coordinates; the origin when left out.
    """

    n: Callable[[Expression], Expression]
    center: Sequence[float] | None = None

    def __post_init__(self) -> None:
        if self.center is not None:
            object.__setattr__(self, "center", point("center", self.center))
        _traced("n", self.n, [ca.SX.sym("radius")])

    @property
    def dimension(self) -> int | None:
        """That of the centre, where it is given."""
        return None if self.center is None else len(self.center)

    def middle(self, dimension: int) -> np.ndarray:
        """The centre as an array."""
        return np.zeros(dimension) if self.center is None else np.asarray(self.center, dtype=float)

    def index(self, position: Expression) -> Expression:
        """n at the distance of ``position`` from the centre; even powers of it are written without a root."""
        offset = position - ca.DM(self.middle(position.numel()))
        return _traced("n", self.n, [ca.sqrt(ca.sumsqr(offset))])


@dataclass(frozen=True)
class Graded(Medium):
    """Any index.

    Parameters
    ----------
    n : callable
        ``n(x, y)`` in the plane, ``n(x, y, z)`` in space: as many arguments as points have coordinates;
        written with NumPy's or CasADi's functions, called once, with symbols.
    """

    n: Callable[..., Expression]

    def __post_init__(self) -> None:
        if not callable(self.n):
            raise TypeError(f"n must be a function of the coordinates, not {self.n!r}; for a number take Uniform")

    def index(self, position: Expression) -> Expression:
        """n at ``position``."""
        return _traced("n", self.n, [position[i] for i in range(position.numel())])


def _traced(name: str, n: Callable[..., Expression], arguments: list[Expression]) -> Expression:
    """n(*arguments), or an error that names the argument and says what is wrong with it."""
    hint = "it is called with as many coordinates as a point has"
    try:
        return tracing.trace(name, n, arguments, ca.SX, hint)
    except tracing.NotSymbolic as error:
        raise ValueError(
            f"{name} could not be evaluated with symbols: {error}; write comparisons with ca.if_else, "
            "and give measured profiles as Tabulated"
        ) from error


@dataclass(frozen=True)
class Field:
    """n² of a medium and its derivatives, evaluated on arrays of points.

    Parameters
    ----------
    medium : Medium
    dimension : int
        2 or 3.
    """

    medium: Medium
    dimension: int
    _call: Callable[..., list[Any]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        position = ca.SX.sym("r", self.dimension)
        squared = self.medium.squared_index(position)
        gradient = ca.gradient(squared, position)
        results = [squared, gradient, ca.jacobian(gradient, position), ca.SX(self.medium.index(position))]
        function = ca.Function("field", [position], [ca.densify(result) for result in results])
        object.__setattr__(self, "_call", Vectorised(function))

    def _table(self, points: np.ndarray) -> np.ndarray:
        columns = self._call(list(points.T))
        table = np.empty((len(points), len(columns)))
        for k, column in enumerate(columns):
            table[:, k] = column
        return table

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """n² (m,), its gradient (m, d) and its Hessian matrix (m, d, d) at points (m, d)."""
        table, d = self._table(points), self.dimension
        return table[:, 0], table[:, 1 : 1 + d], table[:, 1 + d : -1].reshape(-1, d, d)

    def index(self, points: np.ndarray) -> np.ndarray:
        """n (m,) at points (m, d); not a number where it is not real."""
        return self._table(points)[:, -1]
