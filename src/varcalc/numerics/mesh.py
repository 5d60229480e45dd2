"""Meshes and bases: Gauss rules, piecewise polynomials of any degree and smoothness.

The basis on an element is hierarchical: Hermite polynomials of degree
2 m - 1 that carry the value and the first m - 1 derivatives at the two
vertices, and m-fold integrals of Legendre polynomials, which vanish there to
order m ("bubbles"). Raising the degree only appends bubbles, so that a solution
prolongs to a richer space by padding with zeros, and the m-th derivatives of
the bubbles are orthonormal, so that the matrices stay well conditioned at any
degree (Szabo and Babuska, "Finite Element Analysis", sect. 3.1, for m = 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre

GAUSS_SHARES = 0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)
"""Where on an element its two Gauss points lie."""
LEAST_NEW, MOST_LEFT_OUT = 4, 4.0
"""New degrees of one element by which it is told what lies beyond them, as a curve may be even or odd, and the most
that it may come to."""
FEW_POINTS = 16
"""Points of Gauss's rule up to which the weights of NumPy are as good as any."""
NEAREST_VERTICES = 64.0 * np.finfo(float).eps
"""Distance, in units of the abscissae, within which two vertices are one: elements between them hold round-off only."""
FEW = 2000
"""Points at which a curve is evaluated at a time, the coefficients laid out for each of them."""

CurveOrSlope = Callable[[np.ndarray, int], np.ndarray]
"""A curve (n, m) at x (m,), or its derivative of the order that is given."""


@lru_cache(maxsize=256)
def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre points and weights on [-1, 1], to round-off also next to the ends.

    A weight 2 / ((1 - x^2) P'(x)^2) (Abramowitz and Stegun, 25.4.29) feels the round-off of its node through
    1 - x^2: NumPy's are right to 1e-14 for few points, and off by 1e-12 at the ends of 60, where boundary layers lie.
    So beyond ``FEW_POINTS`` one Newton step and the weights are taken in extended precision, where the machine has it.
    """
    if count <= FEW_POINTS:
        return _unwritable(*legendre.leggauss(count))
    nodes: np.ndarray = legendre.leggauss(count)[0].astype(np.longdouble)
    rates = np.zeros(0)
    for _ in range(2):
        before: np.ndarray = np.ones_like(nodes)
        here: np.ndarray = nodes
        for k in range(1, count):
            before, here = here, ((2 * k + 1) * nodes * here - k * before) / (k + 1)
        slope: np.ndarray = count * (before - nodes * here) / (1 - nodes**2)
        rates = 2 / ((1 - nodes**2) * slope**2)
        nodes = nodes - here / slope
    # exactly symmetric, so that what is symmetric stays so
    return _unwritable(((nodes - nodes[::-1]) / 2).astype(float), ((rates + rates[::-1]) / 2).astype(float))


def _unwritable(points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The arrays of a rule, which many share."""
    points.setflags(write=False)
    weights.setflags(write=False)
    return points, weights


@lru_cache(maxsize=32)
def antiderivative(count: int) -> np.ndarray:
    """From values at ``count`` Gauss points to Legendre coefficients of the integral from -1; (count + 1, count)."""
    nodes = gauss(count)[0]
    to_series = np.linalg.inv(legendre.legvander(nodes, count - 1))
    return np.array([legendre.legint(row, lbnd=-1) for row in np.eye(count)]).T @ to_series


@lru_cache(maxsize=64)
def lobatto(degree: int) -> np.ndarray:
    """The ``degree + 1`` Gauss-Lobatto nodes on [-1, 1], ascending."""
    inner = legendre.legroots(legendre.legder([0.0] * degree + [1.0])) if degree > 1 else []
    return np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]])


@lru_cache(maxsize=64)
def inner_nodes(count: int, given: int) -> tuple[np.ndarray, np.ndarray]:
    """``count`` nodes inside [-1, 1] and weights of the Gauss rule that has ``given`` derivatives at both ends as well.

    From none on: with one, the value, it is Gauss and Lobatto's (Davis and Rabinowitz, "Methods of Numerical
    Integration", 1984, sect. 2.7).
    """
    from scipy.special import roots_jacobi  # few solves come here

    if not count:
        return np.zeros(0), np.zeros(0)
    nodes, weights = roots_jacobi(count, given, given)
    return nodes, weights / (1.0 - nodes**2) ** given


@lru_cache(maxsize=512)
def _recurrence(order: int, highest: int) -> list[tuple[float, float, float]]:
    """Coefficients c1, c2 and c0 of P_j = (c1 s P_(j-1) - c2 P_(j-2)) / c0, for j = 2 .. highest."""
    a, found = order, []
    for j in range(2, highest + 1):
        c0 = 2 * j * (j + 2 * a) * (2 * j + 2 * a - 2)
        c1 = (2 * j + 2 * a - 1) * (2 * j + 2 * a) * (2 * j + 2 * a - 2)
        c2 = 2 * (j + a - 1) ** 2 * (2 * j + 2 * a)
        found.append((float(c1), float(c2), float(c0)))
    return found


def _jacobi(order: int, highest: int, points: np.ndarray) -> np.ndarray:
    """Jacobi polynomials P_j^(order, order) for j = 0 .. highest; shape (highest + 1, points)."""
    rows = np.empty((highest + 1, len(points)))
    rows[0] = 1.0
    if highest > 0:
        rows[1] = (order + 1) * points
    before, last, less = rows[0], rows[min(highest, 1)], np.empty(len(points))
    for row, (c1, c2, c0) in zip(rows[2:], _recurrence(order, highest), strict=True):
        # in place: of few points what is made anew takes as long as what is computed
        np.multiply(points, c1, out=row)
        np.multiply(row, last, out=row)
        np.multiply(before, c2, out=less)
        np.subtract(row, less, out=row)
        np.divide(row, c0, out=row)
        before, last = last, row
    return rows


@lru_cache(maxsize=512)
def _factors(fold: int, smoothness: int, highest: int) -> np.ndarray:
    """What the products of :func:`_integrated` have in common at all points, one a row."""
    k = np.arange(smoothness, highest + 1)
    factor = np.ones(len(k))
    for j in range(fold):
        factor *= -0.5 / (k - j)
    return (factor * np.sqrt(k + 0.5))[:, None]


def _integrated(fold: int, smoothness: int, highest: int, points: np.ndarray) -> np.ndarray:
    """``fold``-fold integrals of the normalised Legendre polynomials of index smoothness .. highest.

    From Rodrigues' formula the fold-fold integral of P_k that vanishes at both
    ends is (-1)^fold (k - fold)! / (2^fold k!) (1 - s^2)^fold P_(k-fold)^(fold, fold),
    a product, so it keeps its relative accuracy close to the ends.
    """
    rows = _jacobi(fold, highest - fold, points)[smoothness - fold :]
    factors = _factors(fold, smoothness, highest)
    return factors * rows if fold == 0 else factors * ((1 - points) * (1 + points)) ** fold * rows


@lru_cache(maxsize=8)
def _hermite(smoothness: int) -> np.ndarray:
    """Coefficients (ascending powers) of the 2 m Hermite polynomials, in the order left, right."""
    m = smoothness
    powers = np.arange(2 * m)
    rows = []
    for end in (-1.0, 1.0):
        for d in range(m):
            falling = np.array([math.perm(k, d) for k in powers], dtype=float)
            rows.append(falling * np.where(powers >= d, end ** np.maximum(powers - d, 0), 0.0))
    return np.linalg.solve(np.array(rows), np.eye(2 * m)).T


@lru_cache(maxsize=16)
def _vertex_polynomials(smoothness: int, derivative: int) -> np.ndarray:
    """Coefficients (ascending powers) of a derivative of the Hermite polynomials, one a column."""
    return np.polynomial.polynomial.polyder(_hermite(smoothness).T, derivative)


def _powers(points: np.ndarray, count: int) -> np.ndarray:
    """The first so many powers of points (m,), one a column; they are slow, and none is needed of the first two."""
    if count > 2:
        return points[:, None] ** np.arange(count)
    powers = np.ones((len(points), count))
    powers[:, 1:] = points[:, None]
    return powers


def basis(smoothness: int, degree: int, points: np.ndarray, derivatives: int, first: int = 0) -> np.ndarray:
    """Derivatives ``first`` to ``derivatives`` of the element basis on [-1, 1]; each (points, degree + 1).

    Local order: the ``smoothness`` derivatives at the left vertex, those at
    the right one, then the bubbles by degree. Needs degree >= 2 smoothness - 1
    and derivatives <= smoothness.
    """
    m = smoothness
    table = np.empty((derivatives + 1 - first, len(points), degree + 1))
    for rows, d in zip(table, range(first, derivatives + 1), strict=True):
        vertex = _vertex_polynomials(m, d)
        rows[:, : 2 * m] = _powers(points, len(vertex)) @ vertex
        if degree >= 2 * m:
            rows[:, 2 * m :] = _integrated(m - d, m, degree - m, points).T
    return table


@lru_cache(maxsize=64)
def interpolation(smoothness: int, degree: int) -> np.ndarray:
    """The element basis at the Lobatto nodes of its degree; (degree + 1, degree + 1)."""
    table = basis(smoothness, degree, lobatto(degree), 0)[0]
    table.setflags(write=False)
    return table


def apart(vertices: Iterable[float], standing: Sequence[float]) -> list[float]:
    """Those of some new vertices that are no nearer than round-off to one another, or to those that are standing.

    >>> apart([0.5, 1.0 - 1e-16, 0.5 + 1e-16], [0.0, 1.0])
    [0.5]
    """
    nearest = NEAREST_VERTICES * max(map(abs, standing), default=0.0)
    found: list[float] = []
    for vertex in vertices:
        if all(abs(vertex - other) > nearest for other in (*standing, *found)):
            found.append(vertex)
    return found


def subdivided(vertices: np.ndarray, parts: int) -> np.ndarray:
    """The vertices (parts K + 1,) of a mesh (K + 1,) each element of which is divided evenly into ``parts``."""
    inner = vertices[:-1, None] + np.diff(vertices)[:, None] * (np.arange(parts) / parts)
    return np.append(inner.ravel(), vertices[-1])


def composite_gauss(vertices: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of the composite Gauss rule on a mesh, each flat."""
    nodes, weights = gauss(count)
    half = 0.5 * np.diff(vertices)[:, None]
    return (vertices[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


@lru_cache(maxsize=256)
def basis_at_gauss(smoothness: int, degree: int, count: int, derivatives: int) -> np.ndarray:
    """:func:`basis` at the ``count`` Gauss points, kept for the life of the process."""
    table = basis(smoothness, degree, gauss(count)[0], derivatives)
    table.setflags(write=False)
    return table


@dataclass(frozen=True)
class Space:
    """Piecewise polynomials for ``n`` functions on the mesh ``vertices``.

    ``smoothness`` m makes them C^(m-1) at vertices. At the vertices listed in
    ``broken`` the derivatives from order ``break_order`` on may jump.
    For the first ``periodic`` functions the last vertex is the first.
    Coefficients are kept in one vector, ordered along the mesh (vertex, bubbles,
    vertex, ...), so that matrices are banded.
    """

    vertices: np.ndarray
    degree: int
    n: int = 1
    smoothness: int = 1
    periodic: int = 0
    broken: tuple[int, ...] = ()
    break_order: int = 1

    def __post_init__(self) -> None:
        if self.degree < 2 * self.smoothness - 1:
            raise ValueError(f"degree must be at least {2 * self.smoothness - 1} here, not {self.degree}")

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.vertices) - 1

    @cached_property
    def widths(self) -> np.ndarray:
        """Length of each element, shape (elements,)."""
        return np.diff(self.vertices)

    @cached_property
    def _numbering(self) -> tuple[np.ndarray, int]:
        """Global number of each local function of each element (elements, degree + 1, n), and their count."""
        m, E, n = self.smoothness, self.elements, self.n
        bubbles, k = self.degree + 1 - 2 * m, self.break_order
        broken = np.zeros(E + 1, dtype=bool)
        broken[list(self.broken)] = True
        # each element is followed by its right vertex, and that by the derivatives on the other side of a break
        after = np.cumsum((m + bubbles) * n + (m - k) * n * broken[1:])
        first = m * n + np.append(0, after[:-1])

        def run(start: np.ndarray, length: int) -> np.ndarray:
            return start[:, None, None] + np.arange(length * n).reshape(length, n)

        numbers = np.empty((E, self.degree + 1, n), dtype=int)
        numbers[:, 2 * m :] = run(first, bubbles)
        numbers[:, m : 2 * m] = run(first + bubbles * n, m)
        numbers[0, :m] = run(np.zeros(1, dtype=int), m)
        numbers[1:, :m] = numbers[:-1, m : 2 * m]
        behind = 1 + np.flatnonzero(broken[1:-1])
        numbers[behind, k:m] = run(first[behind] - (m - k) * n, m - k)
        if self.periodic:
            last, others = int(first[-1]) + bubbles * n, n - self.periodic
            numbers[-1, m : 2 * m, : self.periodic] = numbers[0, :m, : self.periodic]
            numbers[-1, m : 2 * m, self.periodic :] = last + np.arange(m * others).reshape(m, others)
            return numbers, last + m * others
        return numbers, m * n + int(after[-1])

    def left_out(self, change: np.ndarray, poorer: int, order: int) -> Any:
        """What lies beyond this space, in units of what the ``change`` of a curve of a ``poorer`` degree to it gains.

        The energies of the polynomials that are new in it fall from the first half of their degrees to the second, and
        on to those beyond: a geometric series. Where they do not fall neither space shows the curve. The change is told
        by its coefficients (.., size), and the functional is of such an ``order``.
        """
        modes = self.numbers[:, max(poorer + 1, 2 * self.smoothness) :]
        if modes.shape[1] < (LEAST_NEW if self.elements == 1 else 2):
            return 0.0
        energies = (2.0 / self.widths) ** (2 * order - 1) @ (change[..., modes] ** 2).sum(-1)
        half = energies.shape[-1] // 2
        first, then = energies[..., :-half].sum(-1), energies[..., -half:].sum(-1)
        falls = (first + then) * (first - then)
        told = then**2 < MOST_LEFT_OUT * falls
        return np.where(told, then**2 / np.where(told, falls, 1.0), MOST_LEFT_OUT * (then > 0))

    @property
    def numbers(self) -> np.ndarray:
        """Global number of local function i of component a on element e; shape (elements, degree + 1, n)."""
        return self._numbering[0]

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self._numbering[1]

    @cached_property
    def local_scale(self) -> np.ndarray:
        """Factor from a coefficient to its local function, shape (elements, degree + 1).

        Vertex coefficients are derivatives times the length of the interval to
        that power; the local Hermite functions want half the element's length.
        """
        m = self.smoothness
        scale = np.ones((self.elements, self.degree + 1))
        ratio = 0.5 * self.widths / (self.vertices[-1] - self.vertices[0])
        for k in range(1, m):
            scale[:, k] = scale[:, m + k] = ratio**k
        return scale

    def local(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients by element, scaled to the local basis; shape (.., elements, degree + 1, n)."""
        return coefficients[..., self.numbers] * self.local_scale[:, :, None]

    def quadrature(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Abscissae and weights of the composite Gauss rule, each of shape (elements, count)."""
        x, weights = composite_gauss(self.vertices, count)
        return x.reshape(-1, count), weights.reshape(-1, count)

    def at_quadrature(self, coefficients: np.ndarray, count: int, derivatives: int) -> list[np.ndarray]:
        """The functions and their derivatives at the Gauss points, each (.., elements, count, n)."""
        table = basis_at_gauss(self.smoothness, self.degree, count, derivatives)
        local = self.local(coefficients)
        return [(table[d] @ local) * (2.0 / self.widths[:, None, None]) ** d for d in range(derivatives + 1)]

    def curve(self, coefficients: np.ndarray) -> SpaceCurve:
        """The functions of these coefficients, to be called with abscissae and the order of a derivative."""
        return SpaceCurve(self, coefficients)

    def evaluate(self, coefficients: np.ndarray, x: np.ndarray, derivative: int = 0) -> np.ndarray:
        """A derivative of the functions at abscissae ``x`` of shape (m,); returns (n, m).

        Outside the interval the nearest element's polynomial is continued.
        """
        local = self.local(coefficients)
        if self.elements == 1:
            points = 2 * (x - self.vertices[0]) / self.widths[0] - 1
            table = basis(self.smoothness, self.degree, points, derivative, derivative)[0]
            return (table @ local[0]).T * (2.0 / self.widths[0]) ** derivative
        element = np.clip(np.searchsorted(self.vertices, x, side="right") - 1, 0, self.elements - 1)
        out = np.empty((self.n, len(x)))
        for first in range(0, len(x), FEW):
            part = slice(first, first + FEW)
            e = element[part]
            points = 2 * (x[part] - self.vertices[e]) / self.widths[e] - 1
            table = basis(self.smoothness, self.degree, points, derivative, derivative)[0]
            out[:, part] = np.einsum("mp,mpn->nm", table, local[e]) * (2.0 / self.widths[e]) ** derivative
        return out

    def vertex_number(self, vertex: int, derivative: int, component: int) -> int:
        """Number of the coefficient that carries a derivative at a vertex (its left side where broken)."""
        if vertex == 0:
            return int(self.numbers[0, derivative, component])
        return int(self.numbers[vertex - 1, self.smoothness + derivative, component])

    @property
    def vertex_scale(self) -> float:
        """Length that turns a derivative at a vertex into its coefficient: y^(k) scale^k."""
        return float(self.vertices[-1] - self.vertices[0])

    def fit(self, curve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Coefficients that interpolate ``curve``, a function from abscissae (m,) to ordinates (n, m).

        Each element interpolates at its Lobatto points; derivatives at shared
        vertices are averaged.
        """
        nodes = lobatto(self.degree)
        half = 0.5 * self.widths[:, None]
        at = self.vertices[:-1, None] + half * (1 + nodes)
        values = np.asarray(curve(at.ravel()), dtype=float).reshape(self.n, self.elements, -1)
        table = interpolation(self.smoothness, self.degree)
        local = np.linalg.solve(table, values.transpose(1, 2, 0)) / self.local_scale[:, :, None]
        flat = self.numbers.ravel()
        if self.elements == 1 and not self.periodic:
            out = np.empty(self.size)
            out[flat] = local.ravel()
            return out
        return np.bincount(flat, local.ravel(), self.size) / np.bincount(flat, minlength=self.size)

    def prolonged(self, coefficients: np.ndarray, richer: Space) -> np.ndarray:
        """The same functions in a space of higher degree on the same mesh; coefficients (.., size)."""
        out = np.zeros((*coefficients.shape[:-1], richer.size))
        out[..., richer.numbers[:, : self.degree + 1]] = coefficients[..., self.numbers]
        return out

    def split(self, coefficients: np.ndarray, marked: np.ndarray) -> tuple[Space, np.ndarray]:
        """Bisect the elements ``marked`` (elements,) of bool; the same functions on the new mesh."""
        vertices = [self.vertices[0]]
        for e in range(self.elements):
            if marked[e]:
                vertices.append(0.5 * (self.vertices[e] + self.vertices[e + 1]))
            vertices.append(self.vertices[e + 1])
        return self.remeshed(coefficients, np.array(vertices))

    def remeshed(self, coefficients: np.ndarray, vertices: np.ndarray) -> tuple[Space, np.ndarray]:
        """The same functions on a mesh that contains every vertex of this one."""
        shift = np.searchsorted(vertices, self.vertices)
        broken = tuple(int(shift[b]) for b in self.broken)
        finer = Space(vertices, self.degree, self.n, self.smoothness, self.periodic, broken, self.break_order)
        count = self.degree + 1
        nodes, weights = gauss(count)
        m = self.smoothness
        # vertex coefficients exactly, bubbles from the orthonormality of their m-th derivatives
        out = np.zeros(finer.size)
        middle = 0.5 * (vertices[1:] + vertices[:-1])
        half = 0.5 * np.diff(vertices)
        parent = np.searchsorted(self.vertices, middle) - 1
        local = self.local(coefficients)
        scale = finer.local_scale
        whole = (vertices[:-1] == self.vertices[parent]) & (vertices[1:] == self.vertices[parent + 1])
        out[finer.numbers[whole]] = coefficients[self.numbers[parent[whole]]]
        for e in np.flatnonzero(~whole):
            c, h, q = middle[e], half[e], parent[e]
            H = 0.5 * self.widths[q]
            inside = (c + h * np.concatenate([[-1.0, 1.0], nodes]) - self.vertices[q]) / H - 1
            table = basis(m, self.degree, inside, m)
            values = [(table[d] @ local[q]) * (h / H) ** d for d in range(m + 1)]
            for d in range(m):
                out[finer.numbers[e, d]] = values[d][0] / scale[e, d]
                out[finer.numbers[e, m + d]] = values[d][1] / scale[e, m + d]
            if self.degree >= 2 * m:
                legendre_rows = basis_at_gauss(m, self.degree, count, m)[m][:, 2 * m :]
                out[finer.numbers[e, 2 * m :]] = (legendre_rows * weights[:, None]).T @ values[m][2:]
        return finer, out


@lru_cache(maxsize=64)
def on_one_element(start: float, end: float, degree: int, n: int, smoothness: int = 1) -> Space:
    """The polynomials of a degree, kept for the life of the process with what is numbered in them."""
    return Space(np.array([start, end]), degree, n, smoothness)


@dataclass(frozen=True, eq=False)
class SpaceCurve:
    """Piecewise polynomials as a curve: ``curve(x, k)`` is the k-th derivative at x (m,), shape (n, m)."""

    space: Space
    coefficients: np.ndarray

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The derivative at x (m,), shape (n, m)."""
        return self.space.evaluate(self.coefficients, x, derivative)
