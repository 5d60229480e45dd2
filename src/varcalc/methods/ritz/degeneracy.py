"""Whether a minimum stands alone: zero modes of the second variation, and which of them are mere symmetries.

A direction in which neither the functional nor its gradient changes is a
Jacobi field that meets the end conditions: the ends are conjugate (or focal),
and the extremal is one of a continuum or on the point of being no minimum
(Gelfand and Fomin, "Calculus of Variations", sect. 26 and 29). A problem may
also leave its curve to be moved as a whole: shifted, turned, or a closed curve
begun at another point. Such a family is one minimum written down in many places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from varcalc.methods.answer import rises_throughout
from varcalc.methods.ritz.elements import DENSE, Elements, round_off, softest
from varcalc.methods.ritz.error import SOFT_MODE
from varcalc.methods.ritz.newton import NullSpace, Step, newton_step
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.numerics.stacked import applied, positive
from varcalc.problem.functional import arguments_at
from varcalc.solution import Verdict

if TYPE_CHECKING:
    from varcalc.methods.ritz.method import Rungs

ZERO = 1e-9
"""Eigenvalues of the second variation, in units of its leading term, that are none."""
LOOSEST = 1e-6
"""The same where the curve is known poorly."""
END_PLACES = 401
AT_AN_END = 1e-3
"""Shares of a direction and of its slope that are next to nothing at an end, seen at so many places."""
PLACED = 1e-10
"""Change of the functional, relative to what is summed, that a curve in its place may still make by being moved."""
EIGENVALUE_KEPT = 0.9
"""Share of an eigenvalue that a richer space leaves when it is resolved."""
IN_SPAN = 1e-3
"""Part of a zero mode, in the norm of the leading term, that rigid motions may leave over."""
UNMOVED = 1e-8
"""Relative change of the functional by a motion under which it is invariant."""
CANCELLED = 1e-12
"""The same in units of the terms of a functional that vanishes by cancellation."""
TURN = 0.5
"""Size of the motion tried: an angle, or a shift in units of the curve's size."""


Doubt = tuple[Verdict | None, str]
"""What a minimum is instead, where that is known, and a sentence."""


def degenerate(rungs: Rungs, system: RitzSystem, z: np.ndarray, step: Step, curve: float) -> Doubt | None:
    """Why the minimum at ``z`` does not stand alone, or where it belongs; None when it does, up to rigid motions.

    ``step`` is the Newton step from there, ``curve`` the relative error of the
    curve, which the second variation feels squared. Richer spaces are asked for as
    long as they lower a soft eigenvalue.
    """
    threshold = min(max(ZERO, curve**2), LOOSEST)
    previous, z = math.inf, z + step.change
    following: Step | None = step
    while following is not None:
        eigenvalues, modes, noise = _soft_modes(system, z, following.multipliers)
        if noise > LOOSEST:
            return None, f"round-off leaves {noise:.1g} of the second variation, and whether it vanishes is not known"
        threshold = max(threshold, noise)
        lowest = eigenvalues.min(initial=math.inf)
        if lowest < -threshold:
            return Verdict.SADDLE, f"no minimum: in a richer space the second variation is negative ({lowest:.2g})"
        if lowest <= threshold:
            zero = modes[:, eigenvalues <= threshold]
            if rises_throughout(system.form, system.space.curve(system.coefficients(z))):
                return _unplaced(system, z)
            if _hardly_reaches_ends(system, zero):
                return None, _hardly_held(lowest)
            return None if _are_rigid_motions(system, z, zero) else _sentence(zero.shape[1], lowest)
        if not lowest < EIGENVALUE_KEPT * previous:
            break
        previous = lowest
        system, z = rungs.prolonged(system, z)
        following = newton_step(system, system.evaluate(z), following.multipliers)
        z = z if following is None else z + following.change
    return None


def _unplaced(system: RitzSystem, z: np.ndarray) -> Doubt | None:
    """Why a curve that is hardly held is not where it belongs; None where it is.

    To move it along s changes the functional by the difference of the first integral y' H_y' - H at the two ends.
    """
    form, curve = system.form, system.space.curve(system.coefficients(z))
    ends = np.array(form.span)
    place = arguments_at(form.problem, ends, curve(ends, 0), curve(ends, 1), unknowns=system.unknowns(z))
    s = form.symbols
    integral = ca.dot(ca.gradient(form.integrand, s.dy), s.dy) - form.integrand
    first, last = np.asarray(ca.Function("first", s.all, [integral])(*place)).ravel()
    missed = abs(float(last - first)) * (ends[1] - ends[0])
    if missed <= PLACED * system.evaluate(z).scale:
        return None
    return None, (
        f"the curve is hardly held along the interval, and its place is not found: moved along it the functional may "
        f"change by {missed:.2g}"
    )


def _hardly_reaches_ends(system: RitzSystem, modes: np.ndarray) -> bool:
    """Whether directions (M, m) are next to nothing at an end, with their slopes.

    A Jacobi field that meets the conditions of both ends is a solution of an equation of second order, and hardly ever
    so small there. What holds a kink in its place falls exponentially toward the ends, soon below all digits.
    """
    form = system.form
    if form.ends.periodic or form.order > 1 or system.extra:
        return False
    s = np.linspace(*form.span, END_PLACES)
    nowhere = system.coefficients(np.zeros(system.size))

    def reaches(direction: np.ndarray) -> bool:
        """Whether it is more than next to nothing, or its slope, at both ends."""
        curve = system.space.curve(system.coefficients(direction) - nowhere)
        sizes = [np.abs(curve(s, k)).max(axis=0) for k in (0, 1)]
        return all(any(size[k] > AT_AN_END * size.max() for size in sizes) for k in (0, -1))

    return not any(map(reaches, modes.T))


def _hardly_held(lowest: float) -> str:
    return (
        f"the curve is hardly held in a direction that is next to nothing at an end (second variation {lowest:.1g} of "
        "its leading term), and whether that vanishes is not known"
    )


def _sentence(count: int, lowest: float) -> Doubt:
    directions = f"{count} directions" if count > 1 else "a direction"
    return Verdict.DEGENERATE, (
        f"the second variation vanishes in {directions} (least eigenvalue {lowest:.1g} of its leading term): the ends "
        "are conjugate, and the extremal is one of a continuum or on the point of being no minimum"
    )


def _soft_modes(system: RitzSystem, z: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Eigenvalues of the second variation below SOFT_MODE, their modes, of length one in the leading term, and noise.

    None are found where the leading term is not positive all along: then it measures nothing.
    """
    at = system.evaluate(z)
    nothing = np.zeros(0), np.zeros((system.size, 0)), 0.0
    if not np.isfinite(at.hessians).all() or at.legendre <= 0.0:
        return nothing
    if system.size > DENSE and isinstance(system.assembly, Elements):
        return softest(system, at, z, multipliers, SOFT_MODE)
    null = NullSpace(at.jacobian)
    hessian, leading = (null.reduced(m) for m in (system.hessian(at, multipliers), system.leading_term(at, z)))
    # elimination keeps the digits of meshes that are graded toward an end, which eigenvalues of all at once lose
    if not positive(leading[None])[0] or positive((hessian - SOFT_MODE * leading)[None])[0]:
        return nothing
    factor = np.linalg.cholesky(leading)
    half = np.linalg.solve(factor, hessian)
    eigenvalues, vectors = np.linalg.eigh(np.linalg.solve(factor, half.T))
    soft = eigenvalues < SOFT_MODE
    modes = np.linalg.solve(factor.T, vectors[:, soft])
    return eigenvalues[soft], null.basis @ modes if null.count else modes, round_off(hessian, modes)


# rigid motions


@dataclass(frozen=True)
class FreeMotion:
    """The velocity of a rigid motion: of the unknowns, as a matrix on (y, s, 1), and of the unknown numbers."""

    velocity: np.ndarray
    matrix: np.ndarray
    numbers: np.ndarray


def _are_rigid_motions(system: RitzSystem, z: np.ndarray, modes: np.ndarray) -> bool:
    """Whether every mode moves the curve as a whole, and the functional and its conditions stay as they are."""
    motions = _motions(system, z)
    if not motions:
        return False
    at = system.evaluate(z)
    span = np.column_stack([m.velocity for m in motions])
    values, vectors = np.linalg.eigh(system.leading_blocks(at, z))
    roots = np.sqrt(np.maximum(values, 0.0))[..., None] * vectors.swapaxes(-1, -2)

    def along(directions: np.ndarray) -> np.ndarray:
        """Directions (N, m) with as many rows as make the product of two that of the leading term."""
        return np.array([applied(roots, system.moved(v)).ravel() for v in directions.T]).T

    shares = np.linalg.lstsq(along(span), along(modes), rcond=1e-10)[0]
    left = np.linalg.norm(along(modes - span @ shares), axis=0)  # the modes are of length one
    return bool(np.all(left <= IN_SPAN)) and all(_invariant(system, z, at, motions, share) for share in shares.T)


def _motions(system: RitzSystem, z: np.ndarray) -> list[FreeMotion]:
    """The rigid motions that leave the ends as they are prescribed.

    Shifts of a function no value of which is fixed, for a second-order
    Lagrangian its tilts; rotations where nothing is fixed; a shift of the
    abscissa where both ends slide; for a closed curve another first point.
    """
    n, space = system.n, system.space
    fixed = np.setdiff1d(np.arange(space.size), system.free)
    coefficients = system.coefficients(z)
    entries: list[list[tuple[int, int, float]]] = []
    for a in range(n):
        if not np.isin(space.numbers[:, :, a], fixed).any():
            entries.append([(a, n + 1, 1.0)])
            if system.order == 2 and not space.periodic:
                entries.append([(a, n, 1.0)])
    if not len(fixed):
        entries += [[(a, b, 1.0), (b, a, -1.0)] for a in range(n) for b in range(a)]
    out: list[FreeMotion] = []
    still, nowhere = np.zeros(system.extra), np.zeros((n, n + 2))
    for places in entries:
        matrix = nowhere.copy()
        for row, column, entry in places:
            matrix[row, column] = entry
        out.append(FreeMotion(system.pack(_applied(system, coefficients, matrix), still), matrix, still))
    own = len(system.form.problem.unknowns)
    if system.extra - own - system.form.coordinates.gauged == 2:
        numbers = still.copy()
        numbers[own : own + 2] = 1.0
        out.append(FreeMotion(system.pack(np.zeros(space.size), numbers), nowhere, numbers))
    if space.periodic and not _depends_on_place(system):
        around = space.fit(lambda s: space.evaluate(coefficients, s, 1))
        out.append(FreeMotion(system.pack(around, still), nowhere, still))
    return [m for m in out if m.velocity.any()]


def _depends_on_place(system: RitzSystem) -> bool:
    """Whether the integrand or a level depends on the abscissa."""
    integrands = ca.vertcat(system.form.integrand, *(c.expression for c in system.equalities))
    return bool(ca.depends_on(integrands, system.form.symbols.x))


def _applied(system: RitzSystem, coefficients: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Coefficients of ``matrix`` (n, n + 2) applied to (y, s, 1)."""
    space, n = system.space, system.n
    out = np.zeros(space.size)
    out[space.numbers] = coefficients[space.numbers] @ matrix[:, :n].T
    return out + space.fit(lambda s: matrix[:, n:] @ np.array([s, np.ones_like(s)]))


def _invariant(system: RitzSystem, z: np.ndarray, at: Evaluation, motions: list[FreeMotion], share: np.ndarray) -> bool:
    """Whether the finite motion, not only the infinitesimal one, leaves the functional and its conditions alone."""
    n = system.n
    velocity = sum((c * m.matrix for c, m in zip(share, motions, strict=True)), np.zeros((n, n + 2)))
    numbers = sum((c * m.numbers for c, m in zip(share, motions, strict=True)), np.zeros(system.extra))
    size = float(np.abs(system.ordinates(z)).max()) or 1.0
    largest = max(np.abs(velocity[:, :n]).max(), np.abs(velocity[:, n:]).max() / size, np.abs(numbers).max(initial=0.0))
    if largest == 0.0:  # only the first point of a closed curve moves
        return True
    import scipy.linalg

    flow = np.zeros((n + 2, n + 2))
    flow[:n] = velocity * (TURN / largest)
    moved = _applied(system, system.coefficients(z), scipy.linalg.expm(flow)[:n])
    there = system.evaluate(system.pack(moved, system.unknowns(z) + numbers * (TURN / largest)))
    sizes = np.ones(len(at.conditions))
    sizes[: len(system.levels)] = np.maximum(np.abs(system.levels), 1e-300)
    same = abs(there.value - at.value) <= UNMOVED * at.scale + CANCELLED * system.quadratic_size(at)
    return bool(same and np.all(np.abs(there.conditions - at.conditions) <= UNMOVED * sizes))
