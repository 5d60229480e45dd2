"""What collocation on a space needs whatever the problem: the unknowns among its coefficients, and its tables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.collocation.stationarity import REMEMBERED
from varcalc.numerics.mesh import Space, basis_at_gauss
from varcalc.symbolic.derived import derived


@dataclass(frozen=True)
class Numbering:
    """The unknowns among the coefficients of a space: which are ``free``, and the ``column`` of each, -1 where fixed.

    ``functions`` are the numbers of the functions that the free ones belong to, ``plain`` the places of the Jacobian
    of the interior's equations: row, column, and which of all entries belong to free coefficients.
    """

    free: np.ndarray
    column: np.ndarray
    functions: np.ndarray
    plain: tuple[np.ndarray, np.ndarray, np.ndarray]

    @cached_property
    def local(self) -> np.ndarray:
        """On one element: the places, among its coefficients, of the free ones in their order."""
        rows, columns, kept = self.plain
        return kept[rows == 0][np.argsort(columns[rows == 0])]

    @cached_property
    def band(self) -> tuple[int, int, np.ndarray]:
        """Diagonals below and above that of the Jacobian, and where each of its rows begins among the entries."""
        rows, columns, _ = self.plain
        apart = rows - columns
        return int(apart.max()), int(-apart.min()), np.flatnonzero(np.diff(rows, prepend=-1))


@lru_cache(maxsize=64)
def one_element(degree: int, n: int, smoothness: int, fixed: bytes) -> Numbering:
    """:func:`numbered` on one element."""
    numbers = Space(np.array([0.0, 1.0]), degree, n, smoothness).numbers
    return numbered(numbers, np.frombuffer(fixed, dtype=bool), degree + 1 - smoothness)


def numbered(numbers: np.ndarray, fixed: np.ndarray, points: int) -> Numbering:
    """The unknowns among coefficients with these ``numbers``, those apart that are ``fixed``, by points an element."""
    E, P, n = numbers.shape
    free = np.flatnonzero(~fixed)
    column = np.full(len(fixed), -1)
    column[free] = np.arange(len(free))
    functions = np.zeros(len(fixed), dtype=int)
    functions[numbers] = np.arange(n)
    rows = np.arange(E * points * n).reshape(E, points, n, 1, 1)
    shape = (E, points, n, P, n)
    columns = np.broadcast_to(column[numbers][:, None, None], shape).ravel()
    kept = np.flatnonzero(columns >= 0)
    plain = np.broadcast_to(rows, shape).ravel()[kept], columns[kept], kept
    return Numbering(free, column, functions[free], plain)


@dataclass(frozen=True)
class Scheme:
    """A space with what a collocation on it needs whatever the problem.

    ``derive`` takes the coefficients of an element to derivatives, (elements, points, derivatives, degree + 1).
    """

    space: Space
    x: np.ndarray
    weights: np.ndarray
    derive: np.ndarray

    @classmethod
    def of(cls, space: Space) -> Scheme:
        """The scheme with as many Gauss points an element as make the system square."""
        m = space.smoothness
        points = space.degree + 1 - m
        x, weights = space.quadrature(points)
        table = basis_at_gauss(m, space.degree, points, m).transpose(1, 0, 2)
        slope = (2.0 / space.widths)[:, None] ** np.arange(m + 1)
        derive = table * (slope[:, None, :, None] * space.local_scale[:, None, None, :])
        return cls(space, x.reshape(-1, 1), weights, derive)


def scheme_on(form: Form, space: Space) -> Scheme:
    """The scheme on a space, kept with the form for other parameter values and later solves."""
    kept = _schemes(form)
    key = (space.degree, space.vertices.tobytes())
    if key not in kept:
        while len(kept) >= REMEMBERED:
            del kept[next(iter(kept))]
        kept[key] = Scheme.of(space)
    return kept[key]


@derived
def _schemes(form: Form) -> dict[tuple[int, bytes], Scheme]:
    return {}
