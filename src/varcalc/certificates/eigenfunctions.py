"""Eigenfunctions of Rayleigh's quotient by Ritz's method in spectral elements: estimates that proofs begin with.

Functions are continuous and polynomials of high degree on each element (Canuto, Hussaini, Quarteroni and Zang,
"Spectral Methods: Fundamentals in Single Domains", Springer 2006, sect. 4.4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.optimize import brentq

from varcalc.certificates.balls import differentiation, transform
from varcalc.certificates.curve import CURVE_DEGREE, through
from varcalc.certificates.integrals import Unproved
from varcalc.numerics.mesh import CurveOrSlope

MODE_RESOLVED = 1e-13
"""Last coefficients of an eigenfunction on an element, relative to its size, below which it is resolved."""
MOST_ELEMENTS = 48
QUADRATURE_POINTS = CURVE_DEGREE + 8
"""Gauss points of an element."""
SEEN = 33
"""Points of an element between which signs of an eigenfunction are looked at."""

Coefficients = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Second derivatives of L and of what is prescribed by (y, y'), (m, 2, 2), at abscissae (m,)."""


@dataclass(frozen=True)
class Eigenfunctions:
    """The lowest eigenvalues, and their functions at Chebyshev's points.

    The ``values`` have the shape (count, elements, CURVE_DEGREE + 1).
    """

    edges: np.ndarray
    eigenvalues: np.ndarray
    values: np.ndarray

    def evaluate(self, number: int) -> CurveOrSlope:
        """An eigenfunction and its derivatives at x (m,), as (1, m)."""
        return through([(a, b, row[None]) for (a, b), row in zip(self._elements, self.values[number], strict=True)])

    @property
    def _elements(self) -> list[tuple[float, float]]:
        return list(pairwise(self.edges.tolist()))

    def zeros(self, number: int) -> list[float]:
        """Where an eigenfunction changes its sign between the ends."""
        function = self.evaluate(number)
        x = np.concatenate([np.linspace(a, b, SEEN)[:-1] for a, b in self._elements])
        y, found = function(x[1:], 0)[0], []
        for k in np.flatnonzero(y[1:] * y[:-1] < 0):
            root: Any = brentq(lambda s: float(function(np.array([s]), 0)[0, 0]), x[k + 1], x[k + 2])
            found.append(root)
        return found


def eigenfunctions(
    coefficients: Coefficients, edges: np.ndarray, held: tuple[bool, bool], count: int
) -> Eigenfunctions:
    """The lowest ``count`` eigenfunctions of one function that is zero at the ends that are ``held``."""
    while len(edges) <= MOST_ELEMENTS + 1:
        found = _on_elements(coefficients, edges, held, count)
        rough = np.zeros(len(edges) - 1, dtype=bool)
        if found is None:
            rough[:] = True
        else:
            last = np.abs(found.values @ transform(CURVE_DEGREE)[-3:].T).max(axis=2)
            rough = (last > MODE_RESOLVED * np.abs(found.values).max(axis=(1, 2))[:, None]).any(axis=0)
            if not rough.any():
                return found
        edges = np.sort(np.r_[edges, 0.5 * (edges[1:] + edges[:-1])[rough]])
    raise Unproved("the eigenfunctions are not resolved on a mesh as fine as is tried")


def _on_elements(
    coefficients: Coefficients, edges: np.ndarray, held: tuple[bool, bool], count: int
) -> Eigenfunctions | None:
    """The eigenfunctions on given elements; None where these are too few."""
    elements, total = len(edges) - 1, (len(edges) - 1) * CURVE_DEGREE + 1
    xi, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    shapes = np.polynomial.chebyshev.chebvander(xi, CURVE_DEGREE) @ transform(CURVE_DEGREE)
    energy, norm = np.zeros((2, total, total))
    for k in range(elements):
        half = 0.5 * float(edges[k + 1] - edges[k])
        rows = np.stack([shapes, shapes @ differentiation(CURVE_DEGREE) / half])
        own = slice(k * CURVE_DEGREE, (k + 1) * CURVE_DEGREE + 1)
        for matrix, bent in zip((energy, norm), coefficients(edges[k] + half * (xi + 1)), strict=True):
            matrix[own, own] += np.einsum("aqi,qab,bqj,q->ij", rows, bent, rows, half * weights)
    free = slice(int(held[0]), total - int(held[1]))
    size = len(energy[free, free])
    if count > size // 2:
        return None
    try:
        values, vectors = eigh(energy[free, free], norm[free, free], subset_by_index=(0, count - 1))
    except (LinAlgError, ValueError):
        raise Unproved("what is prescribed an integral is not positive, or not a number") from None
    whole = np.zeros((count, total))
    whole[:, free] = vectors.T
    places = np.arange(elements)[:, None] * CURVE_DEGREE + np.arange(CURVE_DEGREE + 1)
    return Eigenfunctions(edges, values, whole[:, places])
