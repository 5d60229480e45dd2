"""From the unknowns of a space to the variables at the Gauss points, and back from points to gradients and matrices.

Everything here is stated on elements that are mapped to [-1, 1], so that it is the same for every length of them. On
one element all of it is one matrix times the unknowns, and arrays may have any leading axes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from varcalc.numerics.mesh import Space, basis_at_gauss

SEVERAL = 4
"""Functions beyond which a matrix is assembled by pairs of them."""


class OneElement:
    """One polynomial a function: ``matrix`` (Q, k, N) takes N free unknowns to k variables at Q points of [-1, 1].

    The variables are the functions, their derivatives up to ``order``, and ``extra`` unknown numbers, which are the
    last of the unknowns. ``free`` and ``held`` number the coefficients that may move, and those that the ends fix.
    """

    def __init__(self, n: int, degree: int, order: int, count: int, held: np.ndarray, extra: int) -> None:
        space = Space(np.array([-1.0, 1.0]), degree, n, order)
        self.numbers, self.held, self.free = space.numbers[0], held, np.delete(np.arange(space.size), held)
        self.n, self.count, self.order, self.k = n, count, order, (order + 1) * n + extra
        table = basis_at_gauss(order, degree, count, order) * space.local_scale[0]
        columns = np.zeros((count, self.k - extra, space.size))
        for d in range(order + 1):
            for a in range(n):  # all else is zero: of many functions almost everything
                columns[:, d * n + a, self.numbers[:, a]] = table[d]
        self.matrix = np.zeros((count, self.k, len(self.free) + extra))
        self.matrix[:, : self.k - extra, : len(self.free)] = columns[:, :, self.free]
        self.matrix[:, self.k - extra :, len(self.free) :] = np.eye(extra)
        self.flat = self.matrix.reshape(count * self.k, -1)
        known = np.zeros((count, self.k, len(held)))
        known[:, : self.k - extra] = columns[:, :, held]
        self.known = known.reshape(count * self.k, -1)
        self._pairs = None
        if n > SEVERAL and not extra:
            self._pairs = np.einsum("dqi,eqj->ijqde", table, table).reshape((degree + 1) ** 2, -1)
            self._order = np.argsort(self.numbers.ravel())[self.free]

    def fixed(self, coefficients: np.ndarray) -> np.ndarray:
        """What the coefficients (..., size) that are held add to the variables, (..., Q, k)."""
        held = coefficients[..., self.held]
        return (held @ self.known.T).reshape(*held.shape[:-1], self.count, self.k)

    def variables(self, z: np.ndarray) -> np.ndarray:
        """What unknowns (..., N) add to the variables, (..., Q, k)."""
        return (z @ self.flat.T).reshape(*z.shape[:-1], self.count, self.k)

    def gradient(self, rows: np.ndarray) -> np.ndarray:
        """Sums over the points of derivatives by the variables (..., Q, k) as derivatives by the unknowns, (..., N)."""
        return rows.reshape(*rows.shape[:-2], -1) @ self.flat

    def matrices(self, blocks: np.ndarray) -> np.ndarray:
        """The same for second derivatives (..., Q, k, k), which are matrices (..., N, N) of the unknowns.

        Each function has the same polynomials, so that the entries of all pairs of many functions are one product of
        what two polynomials contribute at a point: quadratic in their number, not cubic.
        """
        lead = blocks.shape[:-3]
        if self._pairs is None:
            return self.flat.T @ (blocks @ self.matrix).reshape(*lead, *self.flat.shape)
        n, depth, size = self.n, self.order + 1, len(self.numbers)
        rows = blocks.reshape(*lead, self.count, depth, n, depth, n).swapaxes(-3, -2).reshape(*lead, -1, n * n)
        whole = (self._pairs @ rows).reshape(*lead, size, size, n, n).swapaxes(-3, -2)
        return whole.reshape(*lead, size * n, size * n)[..., self._order[:, None], self._order]


@lru_cache(maxsize=256)
def _one_element(n: int, degree: int, order: int, count: int, held: tuple[int, ...], extra: int) -> OneElement:
    return OneElement(n, degree, order, count, np.array(held, dtype=int), extra)


@lru_cache(maxsize=64)
def _products(smoothness: int, degree: int, count: int, order: int) -> np.ndarray:
    """Products of all pairs of local functions and derivatives at the Gauss points.

    Shape (P^2, (order + 1)^2 count), the factor of a local matrix:
    entry (i P + j, (d D + e) count + q) is B_d[q, i] B_e[q, j].
    """
    table = basis_at_gauss(smoothness, degree, count, order)
    pairs = np.einsum("dqi,eqj->ijdeq", table, table)
    return np.ascontiguousarray(pairs.reshape((degree + 1) ** 2, -1))


class Elements:
    """Several elements: the same as :class:`OneElement`, element by element."""

    def __init__(self, space: Space, order: int, count: int, free: np.ndarray, extra: int) -> None:
        self.space, self.order, self.count, self.free, self.extra = space, order, count, free, extra
        self.table = basis_at_gauss(space.smoothness, space.degree, count, order)
        self.numbers = space.numbers.reshape(space.elements, -1)

    def fixed(self, coefficients: np.ndarray) -> np.ndarray:
        """What coefficients (size,), zero where they are free, add to the variables, (points, k)."""
        known = coefficients.copy()
        known[self.free] = 0.0
        return self._variables(known, np.zeros(self.extra))

    def variables(self, z: np.ndarray) -> np.ndarray:
        """What unknowns (..., N) add to the variables, (..., points, k)."""
        coefficients = np.zeros((*z.shape[:-1], self.space.size))
        coefficients[..., self.free] = z[..., : len(self.free)]
        return self._variables(coefficients, z[..., len(self.free) :])

    def _variables(self, coefficients: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
        space, lead = self.space, coefficients.shape[:-1]
        local = coefficients[..., space.numbers] * space.local_scale[:, :, None]
        points = space.elements * self.count
        columns = [(rows @ local).reshape(*lead, points, space.n) for rows in self.table]
        columns.append(np.broadcast_to(unknowns[..., None, :], (*lead, points, self.extra)))
        return np.concatenate(columns, axis=-1)

    def gradient(self, rows: np.ndarray) -> np.ndarray:
        """See :meth:`OneElement.gradient`."""
        if rows.ndim > 2:
            return np.array([self.gradient(r) for r in rows])
        space, n = self.space, self.space.n
        total = np.zeros((space.elements, space.degree + 1, n))
        for d, table in enumerate(self.table):
            total += table.T @ rows[:, d * n : (d + 1) * n].reshape(space.elements, self.count, n)
        full = self._summed(total * space.local_scale[:, :, None])
        return np.concatenate([full[self.free], rows[:, (self.order + 1) * n :].sum(0)])

    def _summed(self, local: np.ndarray) -> np.ndarray:
        """What elements contribute to the coefficients, (elements, P, n), by coefficient."""
        return np.bincount(self.space.numbers.ravel(), local.ravel(), self.space.size)

    def parts(self, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Element matrices (E, P n, P n) of second derivatives (points, k, k), the border (size, extra), the corner."""
        E, Q, n, D, P = self.space.elements, self.count, self.space.n, self.order + 1, self.space.degree + 1
        own, scale = blocks[:, : D * n, : D * n], self.space.local_scale
        shaped = own.reshape(E, Q, D, n, D, n).transpose(0, 2, 4, 1, 3, 5).reshape(E, D * D * Q, n * n)
        local = _products(self.space.smoothness, self.space.degree, Q, self.order) @ shaped
        local = local.reshape(E, P, P, n, n).transpose(0, 1, 3, 2, 4)
        local = (local * scale[:, :, None, None, None] * scale[:, None, None, :, None]).reshape(E, P * n, P * n)
        border = np.zeros((self.space.size, self.extra))
        mixed = blocks[:, : D * n, D * n :].reshape(E, Q, D, n, self.extra)
        for j in range(self.extra):
            total = sum(table.T @ mixed[:, :, d, :, j] for d, table in enumerate(self.table))
            border[:, j] = self._summed(total * scale[:, :, None])
        return local, border, blocks[:, D * n :, D * n :].sum(0)

    def matrices(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix (N, N) of the unknowns for second derivatives (points, k, k)."""
        local, border, corner = self.parts(blocks)
        size = self.space.size
        flat = self.numbers[:, :, None] * size + self.numbers[:, None, :]
        full = np.bincount(flat.ravel(), local.ravel(), size * size).reshape(size, size)
        return np.block([[full[np.ix_(self.free, self.free)], border[self.free]], [border[self.free].T, corner]])


def assembly(space: Space, order: int, count: int, held: np.ndarray, extra: int) -> OneElement | Elements:
    """What takes the unknowns of a space to points and back, where the coefficients of the numbers ``held`` are."""
    if space.elements > 1 or space.periodic:
        return Elements(space, order, count, np.delete(np.arange(space.size), held), extra)
    return _one_element(space.n, space.degree, order, count, tuple(held.tolist()), extra)
