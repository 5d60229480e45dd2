"""The planes of Jacobi fields that the conditions at either end leave.

An extremal meets its ends with the covector (-H, p) = +-grad(M + nu . phi) + a
normal of what is fixed (transversality; Gelfand and Fomin, "Calculus of
Variations", sect. 14). Neighbouring extremals that do the same form a
Lagrangian plane: the variation of that equation, with the second derivatives
of the end cost M and the curvature of the curve phi = 0 the end slides on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.methods.answer import Extremal
from varcalc.verify.accessory import Accessory
from varcalc.verify.along_curve import along_curve, sliding_ends

COUPLED = 1e-12
"""Relative size of the mixed derivatives of an end cost by both ends that is zero but for round-off."""


class NotSeparate(Exception):
    """Conditions at the ends that are no two planes, and why."""


@dataclass(frozen=True)
class EndPlane:
    """``plane`` (2 N, N) of the (X, pi) an end leaves; ``fixed`` when these are all those with X = 0."""

    plane: np.ndarray
    fixed: bool


@dataclass(frozen=True)
class _EndTerms:
    """Derivatives of cost + nu . equations in (y0, y1, unknowns): Hessian, and the equations' Jacobian."""

    hessian: np.ndarray
    equations: np.ndarray


def end_planes(accessory: Accessory) -> tuple[EndPlane, EndPlane]:
    """The planes at the start and at the end; NotSeparate when the ends' conditions do not part."""
    along = accessory.along
    extremal, form = along.extremal, along.extremal.form
    terms = _end_terms(extremal)
    slides = sliding_ends(form) if along.slides else (None, None)
    if along.order == 2 and terms is not None and (len(terms.equations) or any(k is not None for k in slides)):
        raise NotSeparate("the ends of a functional of second order slide")
    places = [_places(accessory, k, slides[k]) for k in (0, 1)]
    if terms is not None:
        shared = {p for p in places[0] if p is not None} & {p for p in places[1] if p is not None}
        only = [[p for p in side if p is not None and p not in shared] for side in places]
        mixed = np.abs(terms.hessian[np.ix_(*only)]).max(initial=0.0)
        if mixed > COUPLED * np.abs(terms.hessian).max():
            raise NotSeparate("the cost of the ends couples them")
    return _end_plane(accessory, 0, terms, places[0], slides[0]), _end_plane(accessory, 1, terms, places[1], slides[1])


def _places(accessory: Accessory, side: int, sliding: int | None) -> list[int | None]:
    """Where (abscissa, X) are found among (y0, y1, unknowns of the form); None for what the end terms do not hold."""
    n, N = accessory.along.n, accessory.N
    places: list[int | None] = [None] * (1 + N)
    if sliding is not None:
        places[0] = 2 * n + sliding
    for a in range(n):
        places[1 + a] = side * n + a
    for j, k in enumerate(range(accessory.numbers.start, accessory.numbers.stop)):
        places[1 + k] = 2 * n + j
    return places


def _end_terms(extremal: Extremal) -> _EndTerms | None:
    """The second derivatives of the end terms, their multipliers being those that meet the first variation."""
    form = extremal.form
    if form.ends.joint is None:
        return None
    e, u = form.ends.joint, form.symbols.unknowns
    variables = ca.vertcat(e.start, e.end, u)
    nu = form.symbols.kind.sym("nu", e.equations.numel())
    total = e.cost + (ca.dot(nu, e.equations) if nu.numel() else 0)
    outputs = [ca.gradient(e.cost, variables), ca.jacobian(e.equations, variables), ca.hessian(total, variables)[0]]
    function = ca.Function(
        "end_terms", [e.start, e.end, u, form.symbols.parameters, nu], [ca.densify(o) for o in outputs]
    )

    def at(multipliers: np.ndarray) -> list[np.ndarray]:
        out: Any = function(*extremal.at_ends, extremal.unknowns, form.problem.parameter_values, multipliers)
        return [np.asarray(v) for v in out]

    gradient, equations, hessian = at(np.zeros(nu.numel()))
    if nu.numel():
        wanted, free = _first_variation(extremal)
        rows = equations[:, free].T
        multipliers = np.linalg.lstsq(rows, (wanted - gradient.ravel())[free], rcond=None)[0]
        hessian = at(multipliers)[2]
    return _EndTerms(hessian, equations)


def _first_variation(extremal: Extremal) -> tuple[np.ndarray, np.ndarray]:
    """What the gradient of the end terms must be, by (y0, y1, unknowns), and which of these are free (first order)."""
    form, n = extremal.form, extremal.form.n
    along = along_curve(extremal)
    H, s = along.whole, along.symbols
    momentum = H.partial(1)
    function = along.function(momentum, H.expression - ca.dot(s.dy, momentum))
    wanted = np.zeros(2 * n + len(extremal.unknowns))
    free = np.zeros(len(wanted), dtype=bool)
    slides = sliding_ends(form) if along.slides else (None, None)
    for side, (at, fixed) in enumerate(zip(along.span, (form.ends.start, form.ends.end), strict=True)):
        sign = 1.0 if side == 0 else -1.0
        p, minus_h = (v[0] for v in function(np.array([at])))
        wanted[side * n : (side + 1) * n] = sign * p[:, 0]
        free[side * n : (side + 1) * n] = np.isnan(fixed[0])
        number = slides[side]
        if number is not None:
            wanted[2 * n + number] = sign * float(minus_h.item())
            free[2 * n + number] = True
    return wanted, free


def _end_plane(
    accessory: Accessory, side: int, terms: _EndTerms | None, places: list[int | None], sliding: int | None
) -> EndPlane:
    """(dX, dpi) of the extremals that meet one end's conditions, taken at the extremal's own abscissa there."""
    along, N = accessory.along, accessory.N
    rows, G = _end_rows(accessory, side, terms, places)
    if sliding is None:
        tangent, normal = _split(rows[:, 1:])
        covector = np.hstack([(-G[1:, 1:] if side else G[1:, 1:]) @ tangent, normal])
        position = np.hstack([tangent, np.zeros_like(normal)])
    else:
        tangent, normal = _split(rows)
        covector = np.hstack([(-G if side else G) @ tangent, normal])
        position = np.hstack([tangent, np.zeros_like(normal)])
        state, momentum, by_s = accessory.rates(along.span[side])
        # d(-H) = H_s ds + p' . dX - X' . dp holds along extremals, -H being a function of s, X and p
        miss = covector[0] - by_s * position[0] - momentum @ position[1:] + state @ covector[1:]
        kept = _split(miss[None, :])[0]
        position, covector = position @ kept, covector @ kept
        moved = position[0]
        position, covector = position[1:] - np.outer(state, moved), covector[1:] - np.outer(momentum, moved)
    free = np.delete(position, accessory.gauge, axis=0) if accessory.gauge is not None else position
    return EndPlane(np.vstack([position, covector]).reshape(2 * N, -1), not np.abs(free).max(initial=0.0) > 0.0)


def _end_rows(
    accessory: Accessory, side: int, terms: _EndTerms | None, places: list[int | None]
) -> tuple[np.ndarray, np.ndarray]:
    """What one end forbids of the variations of (abscissa, X), as rows, and the second derivatives of its terms."""
    along, N, n = accessory.along, accessory.N, accessory.along.n
    unit = np.eye(1 + N)
    fixed = along.form.ends.end if side else along.form.ends.start
    rows = [unit[1 + k * n + a] for k in range(along.order) for a in range(n) if not np.isnan(fixed[k, a])]
    rows += list(unit[1 + accessory.levels.start : 1 + accessory.levels.stop])
    G = np.zeros((1 + N, 1 + N))
    if terms is not None:
        known = [i for i, p in enumerate(places) if p is not None]
        where = [p for p in places if p is not None]
        G[np.ix_(known, known)] = terms.hessian[np.ix_(where, where)]
        if side == 0:  # what depends on the numbers alone is counted once, at the end
            numbers = slice(1 + accessory.numbers.start, 1 + accessory.numbers.stop)
            G[numbers, numbers] = 0.0
        for equation in terms.equations:
            row = np.zeros(1 + N)
            row[known] = equation[where]
            if row.any():
                rows.append(row)
    return np.array(rows).reshape(-1, 1 + N), G


def _split(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal bases of the null space and of the row space."""
    if not len(rows):
        return np.eye(rows.shape[1]), np.zeros((rows.shape[1], 0))
    _, sizes, right = np.linalg.svd(rows)
    rank = int((sizes > 1e-12 * sizes.max()).sum())
    return right[rank:].T, right[:rank].T
