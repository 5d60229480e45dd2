"""A field of extremals around the curve: solutions of Jacobi's equation, in numbers that need not be exact.

Q = M U^-1 of a solution (U, M) of the Hamiltonian form of Jacobi's equation solves Riccati's equation. With the second
derivatives of H lowered a little, such a Q gives Hilbert's invariant integral room to spare (Gelfand and Fomin,
"Calculus of Variations", sect. 26 and 29; Reid, "Riccati Differential Equations", 1972, ch. II).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from varcalc.certificates.balls import differentiation, nodes, transform
from varcalc.certificates.curve import DEGREE, Samples
from varcalc.certificates.statement import Statement

GAINED, HYPERBOLIC = 1e-9, 1e-6
"""What Q gains over a period, relative to it: that it gains none is not proved where numbers are rounded. What a
solution grows by at least from one period to the next, relative to those that do not grow."""


@dataclass(frozen=True)
class JacobiFields:
    """U and M at the nodes of each piece: (pieces, N + 1, m, m); shared where pieces meet.

    ``evenness`` is the least singular value of U over the greatest anywhere: small where a conjugate point is near.
    """

    U: np.ndarray
    M: np.ndarray
    evenness: float


@lru_cache(maxsize=64)
def dynamics(n: int, order: int, states: int) -> tuple[np.ndarray, np.ndarray]:
    """A and B of z' = A z + B u."""
    A, B = np.zeros((states, states)), np.zeros((states, n))
    B[(order - 1) * n : order * n] = np.eye(n)
    if order == 2:
        A[:n, n : 2 * n] = np.eye(n)
    A.setflags(write=False)
    B.setflags(write=False)
    return A, B


def turned_dynamics(statement: Statement, samples: Samples) -> tuple[np.ndarray, np.ndarray]:
    """A (N + 1, m, m) and B (N + 1, m, n) at the nodes, with the rows of the levels, which hang on the curve."""
    count, bare = len(samples.x), statement.bare
    A, B = (np.repeat(v[None], count, axis=0) for v in dynamics(statement.n, statement.order, statement.states))
    A[:, bare:, :bare], B[:, bare:] = samples.turning[:, :, :bare], samples.turning[:, :, bare:]
    return A, B


def field(
    statement: Statement, samples: Sequence[Samples], lowered: np.ndarray, bends: tuple[np.ndarray, np.ndarray]
) -> JacobiFields | None:
    """A field of Jacobi's equation with the diagonal ``lowered`` (m + n,); None where there is none to be seen.

    ``bends`` (m, m) are the second derivatives of what the start and the end cost.
    """
    # in a unit of H in which U and M are of one size: equations of 1 and 1e-18 would be solved to few digits
    stiffness = max(float(np.abs(s.hessian[:, -statement.n :, -statement.n :]).max()) for s in samples)
    unit = 2.0 ** round(math.log2(stiffness)) if 0.0 < stiffness < math.inf else 1.0
    samples = [replace(s, hessian=s.hessian / unit) for s in samples]
    lowered = lowered / unit
    if statement.periodic and statement.states == statement.n * statement.order > 1:
        ring = _around(statement, samples, lowered)
        if ring is not None:
            return JacobiFields(np.broadcast_to(np.eye(statement.states), ring.shape), unit * ring, 1.0)
    start, end = boundary(statement, (bends[0] / unit, bends[1] / unit))
    held = np.hstack([np.eye(statement.states), np.zeros((statement.states, statement.states))])
    cuts = [0, *parted(statement, samples), len(samples)]
    parts = []
    for a, b in pairwise(cuts):
        conditions = held if a else start, held if b < len(samples) else end
        part = _on_pieces(statement, samples[a:b], lowered, conditions)
        if part is None:
            return None
        parts.append(part)
    U, M = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    singular = np.linalg.svd(U, compute_uv=False)
    return JacobiFields(U, unit * M, float(singular.min() / singular.max()))


def unresolved(field: JacobiFields, share: float) -> list[int]:
    """The pieces on which the last coefficients of Q, in Chebyshev polynomials, are more than a ``share`` of it.

    There are none where Q is one number: then U and M are polynomials, and the two are enough.
    """
    if field.U.shape[-1] == 1:
        return []
    Q = np.linalg.solve(field.U.swapaxes(2, 3), field.M.swapaxes(2, 3)).swapaxes(2, 3)
    last = np.abs(np.einsum("ij,pjab->piab", transform(DEGREE)[-3:], Q)).max(axis=(1, 2, 3))
    return np.flatnonzero(last > share * np.abs(Q).max(axis=(1, 2, 3))).tolist()


def parted(statement: Statement, samples: Sequence[Samples]) -> list[int]:
    """The numbers of the pieces that begin where all states are held, so that Q may jump."""
    if statement.states != statement.n:
        return []
    waypoints = statement.waypoints
    places = ((k, waypoints.get(float(s.x[0]))) for k, s in enumerate(samples) if k)
    return [k for k, given in places if given is not None and not np.isnan(given).any()]


def _around(statement: Statement, samples: Sequence[Samples], lowered: np.ndarray) -> np.ndarray | None:
    """Q of the family that grows from one period to the next, and so repeats itself but for a little that it gains.

    None where as many solutions grow as do not (Yakubovich and Starzhinskii, "Linear Differential Equations with
    Periodic Coefficients", 1975, ch. III).
    """
    m, maps = statement.states, []
    with np.errstate(all="ignore"):
        maps = [propagator(statement, s, lowered)[1] for s in samples]
        period = np.eye(2 * m)
        for f in maps:
            period = f[-1] @ period
        if not np.isfinite(period).all():
            return None
        values, vectors = np.linalg.eig(period)
        order, sizes = np.argsort(-np.abs(values)), np.sort(np.abs(values))[::-1]
        if not sizes[m - 1] > (1.0 + HYPERBOLIC) * sizes[m]:
            return None
        grown = vectors[:, order[:m]]
        left = np.linalg.svd(np.hstack([np.real(grown), np.imag(grown)]))[0][:, :m]
        Q = _symmetric(left[m:] @ np.linalg.inv(left[:m]))
        rows = []
        for f in maps:
            found = f @ np.vstack([np.eye(m), Q])
            if not (np.linalg.det(found[:, :m]) > 0).all():
                return None
            rows.append(_symmetric(found[:, m:] @ np.linalg.inv(found[:, :m])))
            Q = rows[-1][-1]
    rows[-1][-1] = rows[0][0]
    share = (np.arange(len(rows))[:, None] + 0.5 * (1.0 + nodes(DEGREE))) / len(rows)
    gained = np.diag(GAINED * np.abs(np.array(rows)).max(axis=(0, 1)).diagonal())
    return np.array(rows) + share[:, :, None, None] * gained


def _symmetric(matrices: np.ndarray) -> np.ndarray:
    return 0.5 * (matrices + matrices.swapaxes(-1, -2))


def _on_pieces(
    statement: Statement, samples: Sequence[Samples], lowered: np.ndarray, ends: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """U and M on consecutive pieces, under conditions at both ends."""
    m = statement.states
    with np.errstate(all="ignore"):
        maps = [propagator(statement, s, lowered)[1] for s in samples]
        if not all(np.isfinite(f).all() for f in maps):
            return None
        minus = _family(maps, ends[0], m, at_end=True)
        plus = _family(maps, ends[1], m, at_end=False)
    if minus is None or plus is None or not (_below(ends[0], plus[0], -1) and _below(ends[1], minus[-1], 1)):
        return None
    # Wronski's matrix of the two families; its polar factor makes their sum a family of its own
    wronskian = minus[0][:m].T @ plus[0][m:] - minus[0][m:].T @ plus[0][:m]
    left, _, right = np.linalg.svd(-wronskian)
    joints = [a @ (left @ right) + b for a, b in zip(minus, plus, strict=True)]
    values = np.array([f @ joint for f, joint in zip(maps, joints[:-1], strict=True)])
    values[:, -1] = joints[1:]
    U = values[:, :, :m]
    determinants = np.linalg.det(U)
    if not (np.isfinite(values).all() and (determinants * determinants[0, 0] > 0).all()):
        return None
    return U, values[:, :, m:]


def _below(condition: np.ndarray, family: np.ndarray, sign: int) -> bool:
    """Whether the family of the other end, z = 1 here, leaves the term of what is free at this end positive."""
    m = len(condition)
    free = np.flatnonzero(np.diag(condition[:, m:]))
    Q, bend = family[m:], sign * condition[:, :m]
    matrix = (bend + sign * Q)[np.ix_(free, free)]
    return not len(free) or bool(np.linalg.eigvalsh(0.5 * (matrix + matrix.T)).min() > 0)


def propagator(statement: Statement, samples: Samples, lowered: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobi's equation on a piece: its matrix at all nodes but the first, and (N + 1, 2m, 2m) from those at the first.

    The latter are the solutions (z, pi) that are the identity there.
    """
    m, count = statement.states, len(samples.x) - 1
    A, B = turned_dynamics(statement, samples)
    H = samples.hessian - np.diag(lowered)
    zz, zu, uu = H[:, :m, :m], H[:, :m, m:], H[:, m:, m:]
    by_z, by_pi = (
        -np.linalg.solve(uu, zu.transpose(0, 2, 1)),
        np.linalg.solve(uu, B.transpose(0, 2, 1)),
    )
    G = np.empty((count + 1, 2 * m, 2 * m))
    G[:, :m, :m], G[:, :m, m:] = A + B @ by_z, B @ by_pi
    G[:, m:, :m], G[:, m:, m:] = zz + zu @ by_z, zu @ by_pi - A.transpose(0, 2, 1)
    D = differentiation(DEGREE) / samples.half
    size = 2 * m
    system = np.kron(D[1:, 1:], np.eye(size))
    for j in range(count):
        system[j * size : (j + 1) * size, j * size : (j + 1) * size] -= G[j + 1]
    inner = np.linalg.solve(system, -np.kron(D[1:, :1], np.eye(size)))
    return system, np.concatenate([np.eye(size)[None], inner.reshape(count, size, size)])


def boundary(statement: Statement, bends: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows (m, 2m) that vanish on families of the start, and of the end: z = 0, and pi = -+ M_zz z where z is free."""
    m = statement.states
    rows = []
    for held, bend, sign in zip(statement.held, bends, (-1.0, 1.0), strict=True):
        given = np.ones(m, dtype=bool) if statement.periodic else held
        free = np.diag(1.0 * ~given)
        rows.append(np.hstack([np.diag(1.0 * given) + sign * free @ bend @ free, free]))
    return rows[0], rows[1]


def _family(maps: Sequence[np.ndarray], condition: np.ndarray, m: int, *, at_end: bool) -> list[np.ndarray] | None:
    """The solutions (2m, m) where pieces meet that satisfy a condition at one end and have z = 1 at the other.

    ``at_end`` tells that z = 1 is asked at the end.
    """
    count, size = len(maps), 2 * m
    system = np.zeros((size * (count + 1), size * (count + 1)))
    right = np.zeros((size * (count + 1), m))
    unit = np.hstack([np.eye(m), np.zeros((m, m))])
    for k, f in enumerate(maps):
        rows = slice(size * k, size * (k + 1))
        system[rows, size * k : size * (k + 1)] = f[-1]
        system[rows, size * (k + 1) : size * (k + 2)] = -np.eye(size)
    system[-size:-m, :size] = condition if at_end else unit
    system[-m:, -size:] = unit if at_end else condition
    right[-m:] = np.eye(m) if at_end else 0.0
    if not at_end:
        right[-size:-m] = np.eye(m)
    try:
        found = np.linalg.solve(system, right)
    except np.linalg.LinAlgError:
        return None
    return list(found.reshape(count + 1, size, m)) if np.isfinite(found).all() else None
