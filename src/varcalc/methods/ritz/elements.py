"""Several elements: from their unknowns to points and back, and Newton steps whose cost is linear in their number.

The coefficients are numbered along the mesh, so the Hessian is banded but for
a border: unknown numbers, side conditions, and coefficients that are coupled
across the mesh, at the ends or where a curve closes. It is factored by banded
Cholesky and the border eliminated (bordered systems: Govaerts,
"Numerical Methods for Bifurcations of Dynamical Equilibria", sect. 3.4); by
Haynsworth's inertia formula the small Schur complement tells whether the
Hessian is positive on the conditions' null space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from varcalc.numerics.mesh import Space, basis_at_gauss
from varcalc.numerics.roots import EPSILON

if TYPE_CHECKING:
    from varcalc.methods.ritz.system import Evaluation, RitzSystem

Parts = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Matrices of the elements, the border of the unknown numbers, the corner."""
DENSE = 120
"""Unknowns up to which dense matrices are the faster ones."""
FIRST_ASKED, SOFTEST = 2, 6
"""Modes looked for in a mesh of many elements: a continuum of more directions is one of these as well."""
NEARLY_SINGULAR = 1e-9
"""Generalised eigenvalues below this are symmetries (zero modes), not curvature."""
COMPLIANT = 1e8
"""Compliance from which a positive matrix may be so by round-off alone, unless the leading term vanishes somewhere."""
DAMPING = 1e-6
"""Shift that keeps a step along a symmetry from being made of round-off."""
CUTS = (0, 1, 3, 7, 15, 31)
"""Vertices at which bands are cut, in turn."""
KEPT_PATTERNS = 8
FAINT_PIVOT = 1e-5
"""Share of its diagonal entry that tells of a piece between cuts that all but ends in its conjugate point."""
SHIFTS = (0.0, NEARLY_SINGULAR, 1e-8, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)
"""Multiples of the metric added until the model is convex."""


@lru_cache(maxsize=64)
def _products(smoothness: int, degree: int, count: int, order: int) -> np.ndarray:
    """Products of all pairs of local functions and derivatives at the Gauss points.

    Shape (count (order + 1)^2, P^2), the factor of a local matrix:
    entry ((q D + d) D + e, i P + j) is B_d[q, i] B_e[q, j].
    """
    table = basis_at_gauss(smoothness, degree, count, order)
    pairs = np.einsum("dqi,eqj->qdeij", table, table)
    return np.ascontiguousarray(pairs.reshape(-1, (degree + 1) ** 2))


class Elements:
    """The same as :class:`varcalc.methods.ritz.system.OneElement`, element by element."""

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
        """Sums of derivatives at the points as derivatives by the unknowns."""
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
        shaped = own.reshape(E, Q, D, n, D, n).transpose(0, 3, 5, 1, 2, 4).reshape(E * n * n, Q * D * D)
        local = shaped @ _products(self.space.smoothness, self.space.degree, Q, self.order)
        local = local.reshape(E, n, n, P, P).transpose(0, 3, 1, 4, 2)
        if self.space.smoothness > 1:  # else no function is a slope at a vertex, and all scales are one
            local = local * scale[:, :, None, None, None] * scale[:, None, None, :, None]
        local = local.reshape(E, P * n, P * n)
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


# banded steps


@lru_cache(maxsize=64)
def generic_load(count: int) -> tuple[np.ndarray, float]:
    """A vector with a part in every direction, and its length.

    Its entries are the fractional parts of multiples of the golden ratio, about zero.
    """
    parts = np.arange(1, count + 1) * (0.5 * (1 + math.sqrt(5))) % 1.0 - 0.5
    return parts, max(float(np.linalg.norm(parts)), 1e-300)


@dataclass(frozen=True)
class Bordered:
    """A matrix in the unknowns: lower ``bands`` of those ``inside``, their columns ``beside``, ``corner`` of the rest.

    The rest, the ``border``, are few: unknown numbers, coefficients that are coupled across the mesh, and vertices
    that cut it. Both are places among the unknowns.
    """

    inside: np.ndarray
    border: np.ndarray
    bands: np.ndarray
    beside: np.ndarray
    corner: np.ndarray

    def of_sizes(self, sizes: np.ndarray) -> float:
        """The quadratic form of the sizes of the entries, at unknowns of such ``sizes`` (N,)."""
        inside, border = sizes[self.inside], sizes[self.border]
        along = [
            (1 + (k > 0)) * float(np.abs(band[: len(inside) - k]) @ (inside[k:] * inside[: len(inside) - k]))
            for k, band in enumerate(self.bands)
        ]
        return sum(along) + float((2 * inside @ np.abs(self.beside) + border @ np.abs(self.corner)) @ border)


def bordered(system: RitzSystem, parts: Parts, cuts: int = 0) -> Bordered:
    """The matrix of element matrices, border and corner, with the coefficients at ``cuts`` vertices in the border."""
    local, sides, corner = parts
    pattern, own = _pattern(system, cuts), system.space.numbers.reshape(system.space.elements, -1)
    across = np.zeros((system.space.size, len(pattern.beyond)))
    for e in pattern.beside:
        marked = pattern.marked[own[e]]
        np.add.at(across, (own[e][:, None], marked[marked >= 0]), local[e][:, marked >= 0])
    whole = np.hstack([across, sides])
    corner = np.vstack([whole[pattern.beyond], np.hstack([sides[pattern.beyond].T, corner])])
    bands = np.bincount(pattern.entries, local.ravel()[pattern.kept], pattern.width * len(pattern.inside))
    shaped = bands.reshape(pattern.width, len(pattern.inside))
    return Bordered(pattern.places, pattern.border, shaped, whole[pattern.inside], corner)


class _Pattern(NamedTuple):
    """Where element matrices go: the same for every matrix of a system.

    Coefficients ``inside`` the bands and ``beyond`` them, ``marked`` (size,) with their number or -1, the elements
    ``beside`` these; the ``places`` of both among the unknowns, the second with the unknown numbers as the ``border``;
    the entries of all element matrices that are ``kept`` and the ``entries`` of the bands, ``width`` rows, they go to.
    """

    inside: np.ndarray
    beyond: np.ndarray
    marked: np.ndarray
    beside: np.ndarray
    places: np.ndarray
    border: np.ndarray
    kept: np.ndarray
    entries: np.ndarray
    width: int


@lru_cache(maxsize=KEPT_PATTERNS)
def _pattern(system: RitzSystem, cuts: int) -> _Pattern:
    apart = np.isin(system.free, np.concatenate([system.coupled, _at_cuts(system.space, cuts)]))
    inside, beyond = system.free[~apart], system.free[apart]
    size, own = system.space.size, system.space.numbers.reshape(system.space.elements, -1)
    place, marked = np.full(size, -1), np.full(size, -1)
    place[inside], marked[beyond] = np.arange(len(inside)), np.arange(len(beyond))
    places = place[own]
    rows, columns = np.broadcast_arrays(places[:, :, None], places[:, None, :])
    kept = np.flatnonzero((rows >= columns) & (columns >= 0))
    below, across = (rows - columns).ravel()[kept], columns.ravel()[kept]
    border = np.concatenate([np.flatnonzero(apart), np.arange(len(system.free), system.size)])
    return _Pattern(
        inside, beyond, marked, np.flatnonzero((marked[own] >= 0).any(1)), np.flatnonzero(~apart), border,
        kept, below * len(inside) + across, int(below.max()) + 1,
    )  # fmt: skip


def _at_cuts(space: Space, cuts: int) -> np.ndarray:
    """The coefficients at vertices, or just before them, that cut a mesh into parts alike."""
    before = np.arange(1, cuts + 1) * space.elements // (cuts + 1)
    m = space.smoothness
    return np.concatenate([space.numbers[before - 1, m : 2 * m].ravel(), space.numbers[before, :m].ravel()])


class Eliminated(NamedTuple):
    """A ``matrix`` with conditions beside its border: what its bands were ``solved`` for, ``sides`` and complement.

    ``solved`` has a column for each of the ``loads`` (N, 2), the step's and a generic one, and those of the sides.
    """

    matrix: Bordered
    loads: np.ndarray
    solved: np.ndarray
    sides: np.ndarray
    schur: np.ndarray

    def answer(self, number: int, conditions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The change of the unknowns that answers a load and mends ``conditions``, and the multipliers."""
        inside, border = self.matrix.inside, self.matrix.border
        own, beside = self.solved[:, number], self.solved[:, 2:]
        below = np.concatenate([self.loads[border, number], -conditions]) - self.sides.T @ own
        tail = np.linalg.solve(self.schur, below) if len(below) else below
        change = np.zeros(len(inside) + len(border))
        change[inside], change[border] = own - beside @ tail, tail[: len(border)]
        return change, tail[len(border) :]

    def uncertain(self) -> bool:
        """Whether the matrix may be positive by round-off alone: along what a generic load moves it may be none."""
        stiffest, load = np.abs([*self.matrix.bands[0], *self.matrix.corner.diagonal()]).max(), self.loads[:, 1]
        moved, _ = self.answer(1, np.zeros(len(self.schur) - len(self.matrix.border)))
        if not np.linalg.norm(moved) * stiffest > COMPLIANT * np.linalg.norm(load):
            return False
        return float(moved @ load) <= EPSILON * self.matrix.of_sizes(np.abs(moved))


def banded_step(
    system: RitzSystem, at: Evaluation, multipliers: np.ndarray, *, shifting: bool = True
) -> tuple[np.ndarray, np.ndarray, float, float, float] | None:
    """What a ``Step`` holds: change, multipliers, decrement, shift and compliance; None when no shift makes it convex.

    Without ``shifting`` it is None as well where more than a zero mode would have to be shifted.

    The compliance is not told (0), but along a zero mode it is infinite; the step is held there, and needs no shift.
    """
    own = system.parts(system.combined(at, multipliers))

    @cache
    def metric() -> Parts:
        """What shifts the model: asked for where it is not convex, which is seldom."""
        return system.parts(system.metric_blocks(at))

    @cache
    def eliminated(shift: float) -> Eliminated | None:
        parts = own if not shift else (own[0] + shift * metric()[0], own[1], own[2] + shift * metric()[2])
        return _eliminated(system, parts, at, multipliers)

    shifts = SHIFTS if shifting else (0.0, NEARLY_SINGULAR)
    shift = next((s for s in shifts if eliminated(s) is not None), None)
    if shift is None:
        return None
    whole = eliminated(0.0)
    if whole is not None and at.legendre > 0.0 and whole.uncertain():
        shift = NEARLY_SINGULAR
    zero_mode = shift == NEARLY_SINGULAR and eliminated(DAMPING) is not None  # else round-off made it positive
    found = eliminated(DAMPING if zero_mode else shift)
    if found is None:
        return None
    change, new = found.answer(0, at.conditions)
    # half the squared length of the step in the Hessian, from the first row of the system
    slope = at.gradient + new @ at.jacobian if len(new) else at.gradient
    decrement = -0.5 * float(change @ slope)
    return (change, new, decrement, 0.0, math.inf) if zero_mode else (change, new, decrement, shift, 0.0)


def _eliminated(system: RitzSystem, parts: Parts, at: Evaluation, multipliers: np.ndarray) -> Eliminated | None:
    """The bands of a form, to which the ends add their own, solved for the step; None where it is not positive.

    It is positive on the null space of the conditions. Prescribed integrals may be what makes it so: the bands are cut
    at vertices then, between which they are positive if there are enough (Jacobi's condition holds on short pieces).
    """
    import scipy.linalg

    places, block = system.end_curvature(at, multipliers)
    enough = CUTS if len(system.levels) else CUTS[:1]
    for cuts in enough:
        matrix = bordered(system, parts, cuts)
        where = np.searchsorted(matrix.border, places)
        matrix.corner[np.ix_(where, where)] += block
        try:
            factor = scipy.linalg.cholesky_banded(matrix.bands, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
        if cuts < enough[-1] and (factor[0] ** 2 <= FAINT_PIVOT * matrix.bands[0]).any():
            continue  # what is left of the border would be made of round-off
        count, across = len(at.conditions), at.jacobian[:, matrix.border]
        small = np.block([[matrix.corner, across.T], [across, np.zeros((count, count))]])
        sides = np.column_stack([matrix.beside, at.jacobian[:, matrix.inside].T])
        loads = np.column_stack([-at.gradient, generic_load(system.size)[0]])
        right = np.hstack([loads[matrix.inside], sides])
        solved = scipy.linalg.cho_solve_banded((factor, True), right, check_finite=False)
        schur = small - sides.T @ solved[:, 2:]
        eigenvalues = np.linalg.eigvalsh(schur) if len(schur) else np.zeros(0)
        regular = np.linalg.slogdet(schur)[0] != 0  # by the factors that solve it: an eigenvalue of round-off is not 0
        positive = (eigenvalues < 0).sum() == count and regular and np.isfinite(solved).all()
        return Eliminated(matrix, loads, solved, sides, schur) if positive else None
    return None


def stiff(system: RitzSystem, at: Evaluation, z: np.ndarray, multipliers: np.ndarray, share: float) -> bool:
    """Whether no mode of the second variation costs less than a ``share`` of its leading term, in a banded system."""
    parts = system.parts(system.combined(at, multipliers) - share * system.leading_blocks(at, z))
    return _eliminated(system, parts, at, multipliers) is not None


def softest(
    system: RitzSystem, at: Evaluation, z: np.ndarray, multipliers: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """The eigenvalues of the second variation below a ``share`` of its leading term, at most ``SOFTEST``, and modes.

    The last is their round-off.

    By Lanczos' iteration on the inverse (Parlett, "The Symmetric Eigenvalue Problem", sect. 15.6), along the
    conditions: nothing but sparse factors is as large as the mesh.
    """
    from scipy import sparse
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh, splu

    leading = _sparse(system, system.parts(system.leading_blocks(at, z)))
    places, block = system.end_curvature(at, multipliers)
    rows, columns = (v.ravel() for v in np.meshgrid(places, places, indexing="ij"))
    ends = sparse.coo_array((block.ravel(), (rows, columns)), leading.shape)
    hessian = (_sparse(system, system.parts(system.combined(at, multipliers))) + ends).tocsc()
    conditions = sparse.csc_array(at.jacobian)
    whole = sparse.block_array([[hessian + share * leading, conditions.T], [conditions, None]], format="csc")
    factors, size = splu(whole), system.size

    def inverted(load: np.ndarray) -> np.ndarray:
        return factors.solve(np.concatenate([load.ravel(), np.zeros(len(at.conditions))]))[:size]

    inverse = LinearOperator((size, size), matvec=inverted, dtype=float)
    start = inverted(np.asarray(leading.sum(axis=1)).ravel())
    most = size - len(at.conditions) - 1
    # mostly one is soft: the others that are asked for lie close together, and take far longer
    for asked in (min(FIRST_ASKED, most), min(SOFTEST, most)):
        try:
            found = eigsh(hessian, asked, leading, -share, OPinv=inverse, v0=start)
        except ArpackNoConvergence as stopped:  # those that are soft come first
            found = stopped.eigenvalues, stopped.eigenvectors
        soft = found[0] < share
        if np.count_nonzero(soft) < asked:
            break
    return found[0][soft], found[1][:, soft], round_off(hessian, found[1][:, soft])


def round_off(hessian: Any, modes: np.ndarray) -> float:
    """What rounding the entries of a matrix may change its quadratic form by, on the ``modes`` (N, count)."""
    sizes = np.abs(modes)
    return EPSILON * float((sizes * (abs(hessian) @ sizes)).sum(0).max(initial=0.0))


def _sparse(system: RitzSystem, parts: Parts) -> Any:
    """Element matrices, border and corner as one sparse matrix in the unknowns."""
    from scipy import sparse

    local, border, corner = parts
    place = np.full(system.space.size, -1)
    place[system.free] = np.arange(len(system.free))
    numbers = place[system.space.numbers.reshape(system.space.elements, -1)]
    rows = np.broadcast_to(numbers[:, :, None], local.shape)
    columns = np.broadcast_to(numbers[:, None, :], local.shape)
    keep = (rows >= 0) & (columns >= 0)
    free = len(system.free)
    own = sparse.coo_array((local[keep], (rows[keep], columns[keep])), (free, free))
    if not system.extra:
        return own.tocsc()
    beside = border[system.free]
    return sparse.block_array([[own, beside], [beside.T, corner]], format="csc")
