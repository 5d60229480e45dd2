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
from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from varcalc.certificates.balls import nodes, transform
from varcalc.certificates.curve import CURVE_DEGREE, Samples
from varcalc.certificates.statement import Statement

GAINED, HYPERBOLIC = 1e-9, 1e-6
"""What Q gains over a period, relative to it: that it gains none is not proved where numbers are rounded. What a
solution grows by at least from one period to the next, relative to those that do not grow."""
STAGES = 6
"""Of Gauss's collocation between nodes."""


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
    last = np.abs(np.einsum("ij,pjab->piab", transform(CURVE_DEGREE)[-3:], Q)).max(axis=(1, 2, 3))
    return np.flatnonzero(last > share * np.abs(Q).max(axis=(1, 2, 3))).tolist()


def parted(statement: Statement, samples: Sequence[Samples]) -> list[int]:
    """The numbers of the pieces that begin where all states are held, so that Q may jump."""
    if statement.states != statement.n:
        return []
    waypoints = statement.waypoints
    places = ((k, waypoints.get(s.start)) for k, s in enumerate(samples) if k)
    return [k for k, given in places if given is not None and not np.isnan(given).any()]


def _around(statement: Statement, samples: Sequence[Samples], lowered: np.ndarray) -> np.ndarray | None:
    """Q of the family that grows from one period to the next, and so repeats itself but for a little that it gains.

    None where as many solutions grow as do not (Yakubovich and Starzhinskii, "Linear Differential Equations with
    Periodic Coefficients", 1975, ch. III).
    """
    m = statement.states
    with np.errstate(all="ignore"):
        maps = _maps(statement, samples, lowered)
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
    share = (np.arange(len(rows))[:, None] + 0.5 * (1.0 + nodes(CURVE_DEGREE))) / len(rows)
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
        maps = _maps(statement, samples, lowered)
        if not np.isfinite(maps).all():
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


def jacobi(statement: Statement, samples: Sequence[Samples], lowered: np.ndarray) -> np.ndarray:
    """The matrices G (pieces, N + 1, 2m, 2m) of Jacobi's equation (z, pi)' = G (z, pi) at the nodes."""
    m, shape = statement.states, (len(samples), CURVE_DEGREE + 1)
    parts = [turned_dynamics(statement, s) for s in samples]
    A, B = (np.array([part[k] for part in parts]) for k in (0, 1))
    H = np.array([s.hessian for s in samples]) - np.diag(lowered)
    zz, zu, uu = H[..., :m, :m], H[..., :m, m:], H[..., m:, m:]
    by_z, by_pi = -np.linalg.solve(uu, zu.swapaxes(2, 3)), np.linalg.solve(uu, B.swapaxes(2, 3))
    G = np.empty((*shape, 2 * m, 2 * m))
    G[..., :m, :m], G[..., :m, m:] = A + B @ by_z, B @ by_pi
    G[..., m:, :m], G[..., m:, m:] = zz + zu @ by_z, zu @ by_pi - A.swapaxes(2, 3)
    return G


def _maps(statement: Statement, samples: Sequence[Samples], lowered: np.ndarray) -> np.ndarray:
    return propagated(jacobi(statement, samples, lowered), np.array([s.half for s in samples]))


def propagated(G: np.ndarray, halves: np.ndarray) -> np.ndarray:
    """The solutions (pieces, N + 1, k, k) at the nodes of Y' = G Y that are the identity at the first of each piece.

    ``halves`` (pieces,) are half their lengths. From node to node by Gauss's collocation, all at once (Hairer, Norsett
    and Wanner, "Solving Ordinary Differential Equations I", 1993, sect. II.7).
    """
    interpolation, steps, A, b = _gauss()
    pieces, count, size, stages = len(G), CURVE_DEGREE, G.shape[-1], len(b)
    h = halves[:, None] * steps
    inside = (interpolation @ G.reshape(pieces, count + 1, -1)).reshape(pieces, count, stages, size, size)
    weighted = A[:, None, :, None] * inside[:, :, :, :, None, :] * h[:, :, None, None, None, None]
    system = np.eye(stages * size) - weighted.reshape(pieces, count, stages * size, stages * size)
    slopes = np.linalg.solve(system, inside.reshape(pieces, count, stages * size, size))
    slopes = slopes.reshape(pieces, count, stages, size, size)
    across = np.eye(size) + np.einsum("s,pcsij->pcij", b, slopes) * h[:, :, None, None]
    found = np.empty((pieces, count + 1, size, size))
    found[:, 0] = np.eye(size)
    for j in range(count):
        found[:, j + 1] = across[:, j] @ found[:, j]
    return found


@lru_cache(maxsize=1)
def _gauss() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """From values at the nodes to those at Gauss's points between each two, the steps, and the method's A and b."""
    points, weights = np.polynomial.legendre.leggauss(STAGES)
    c = 0.5 * (1.0 + points)
    powers = np.arange(1, STAGES + 1)
    A = np.linalg.solve((c[:, None] ** (powers - 1)).T, (c[:, None] ** powers / powers).T).T
    x = nodes(CURVE_DEGREE)
    steps = np.diff(x)
    places = (x[:-1, None] + steps[:, None] * c).ravel()
    chebyshev = np.polynomial.chebyshev.chebvander(places, CURVE_DEGREE)
    return chebyshev @ transform(CURVE_DEGREE), steps, A, 0.5 * weights


def boundary(statement: Statement, bends: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows (m, 2m) that vanish on families of the start, and of the end: z = 0, and pi = -+ M_zz z where z is free."""
    m = statement.states
    rows = []
    for held, bend, sign in zip(statement.held, bends, (-1.0, 1.0), strict=True):
        given = np.ones(m, dtype=bool) if statement.periodic else held
        free = np.diag(1.0 * ~given)
        rows.append(np.hstack([np.diag(1.0 * given) + sign * free @ bend @ free, free]))
    return rows[0], rows[1]


def _family(maps: np.ndarray, condition: np.ndarray, m: int, *, at_end: bool) -> list[np.ndarray] | None:
    """The solutions (2m, m) where pieces meet that satisfy a condition at one end and have z = 1 at the other.

    ``at_end`` tells that z = 1 is asked at the end.
    """
    unit = np.hstack([np.eye(m), np.zeros((m, m))])
    right = np.zeros((2 * m * (len(maps) + 1), m))
    right[-m if at_end else 0 :][:m] = np.eye(m)
    first, last = (condition, unit) if at_end else (unit, condition)
    try:
        found = solve_banded((3 * m - 1, 2 * m - 1), _staircase(maps[:, -1], first, last), right, check_finite=False)
    except np.linalg.LinAlgError:
        return None
    return list(found.reshape(len(maps) + 1, 2 * m, m)) if np.isfinite(found).all() else None


def _staircase(across: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """The equations of (z, pi) where pieces meet, by diagonals: m at the first, what pieces map, m at the last."""
    m, size = len(first), 2 * len(first)
    bands = np.zeros((5 * m - 1, size * (len(across) + 1)))

    def put(rows: np.ndarray, columns: np.ndarray, values: Any) -> None:
        bands[size - 1 + rows - columns, columns] = values

    own, down = np.arange(size), np.arange(m)[:, None]
    starts = size * np.arange(len(across))[:, None]
    put(down, own, first)
    put((m + starts + own)[:, :, None], (starts + own)[:, None, :], across)
    put(m + starts + own, size + starts + own, -1.0)
    put(bands.shape[1] - m + down, bands.shape[1] - size + own, last)
    return bands
