"""A mesh of one element, where every derivative at every point is one matrix times the unknowns.

The assembly of a discretised functional then is two matrix products, an order
of magnitude cheaper than element by element.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from varcalc.numerics.mesh import Space, basis_at_gauss


@lru_cache(maxsize=64)
def _derivatives(smoothness: int, degree: int, n: int, count: int, order: int) -> np.ndarray:
    """Derivatives 0 .. order at the Gauss points of [-1, 1] of n functions; (count, order + 1, n, degree + 1, n)."""
    table = basis_at_gauss(smoothness, degree, count, order)
    full = np.einsum("dqi,ab->qdaib", table, np.eye(n))
    full.setflags(write=False)
    return full


class OneElement:
    """The variables (y, dy, ddy, unknowns) at the quadrature points: ``offset + matrix @ z``.

    ``matrix`` has shape (points, k, size) for the ``size`` free coefficients
    and unknown numbers z, ``offset`` (points, k) holds what is fixed.
    """

    def __init__(self, space: Space, count: int, order: int, free: np.ndarray, fixed: np.ndarray, extra: int) -> None:
        n, k = space.n, (order + 1) * space.n
        self.k, self.size = k + extra, len(free) + extra
        scale = (2.0 / space.widths[0]) ** np.arange(order + 1)
        table = _derivatives(space.smoothness, space.degree, n, count, order) * scale[:, None, None, None]
        table = (table * space.local_scale[0][:, None]).reshape(count, k, -1)
        columns = np.empty((count, k, space.size))
        columns[:, :, space.numbers[0].ravel()] = table
        self.matrix = np.zeros((count, self.k, self.size))
        self.matrix[:, :k, : len(free)] = columns[:, :, free]
        self.matrix[:, k:, len(free) :] = np.eye(extra)
        self.offset = np.zeros((count, self.k))
        self.offset[:, :k] = columns @ fixed
        self.flat = self.matrix.reshape(count * self.k, self.size)

    def values(self, z: np.ndarray) -> np.ndarray:
        """The variables at the points, shape (points, k)."""
        return self.offset + (self.flat @ z).reshape(self.offset.shape)

    def gradient(self, rows: np.ndarray) -> np.ndarray:
        """The sum over the points of (weighted) derivatives (points, k) by the variables: one by the unknowns."""
        return rows.ravel() @ self.flat

    def hessian(self, blocks: np.ndarray) -> np.ndarray:
        """The same for second derivatives (points, k, k): shape (size, size)."""
        return self.flat.T @ (blocks @ self.matrix).reshape(self.flat.shape)
