"""The Morse index from Jacobi's equation: focal points, and what the ends leave free.

With the end fixed the index is the number of points focal to the start inside
the interval; with the start fixed, that of points focal to the end; otherwise
the negative eigenvalues of a quadratic form in the Jacobi fields' end values
are added (Morse's index theorem with general ends: Milnor, "Morse Theory",
sect. 15; Bliss, "Lectures on the Calculus of Variations", sect. 29-34).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from varcalc.methods.answer import rises_throughout
from varcalc.solution import Finding
from varcalc.verify.accessory import Accessory
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.concavity import SYMMETRIC, concavity
from varcalc.verify.ends import EndPlane, NotSeparate, end_planes
from varcalc.verify.jacobi import Canonical, CarriedPlane, Unresolved, balanced, canonical
from varcalc.verify.legendre import LegendreCondition
from varcalc.verify.singular_ends import singular_ends_along
from varcalc.verify.verification import NULL, Index, signs

SINGULAR_FIELDS = 1e-9
"""Reciprocal condition of the Jacobi fields at an end below which they are no coordinates there."""


@dataclass(frozen=True)
class JacobiIndex(Index):
    """:class:`Index` with the focal points of the start (abscissae of the form) and how the index comes about."""

    points: np.ndarray
    account: str


@dataclass(frozen=True)
class JacobiEquation(Check[JacobiIndex]):
    """The index from points conjugate or focal to the start."""

    name = "Jacobi"

    def measure(self, candidate: Candidate) -> JacobiIndex:
        """The index, and the points in the user's abscissa."""
        along = candidate.along_best
        if along is None:
            return _closed(candidate.reason)
        if not candidate.measured(LegendreCondition()).strengthened:
            return _closed("Jacobi's equation is singular where Legendre's condition does not hold strictly")
        if ends := [end for end in singular_ends_along(along) if end.euler or abs(end.power) >= 1]:
            place = along.abscissa(np.array([ends[0].place]))
            return _closed(f"Jacobi's equation is singular at {candidate.problem.abscissa.at(place, 6)}")
        found = index_by_jacobi(along)
        return replace(found, points=along.abscissa(found.points)) if len(found.points) else found

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """The index by this route, or why it is closed."""
        measured = candidate.measured(self)
        if candidate.measured(LegendreCondition()).leaves_open:
            sentence = f"Jacobi's equation gives the index {measured.index}: {measured.account}"
            yield measured.finding("Jacobi's equation", sentence)


def index_by_jacobi(along: AlongCurve) -> JacobiIndex:
    """The index from focal points, with the points themselves; None with the reason where that route is closed."""
    try:
        if along.form.broken_at_switches:
            return _closed("the curve is broken where the problem has kinks or jumps")
        return _pieces(along) if along.form.conditions.waypoints else _whole(along)
    except (NotSeparate, Unresolved) as reason:
        return _closed(str(reason))
    except np.linalg.LinAlgError:
        return _closed("the Legendre condition holds only weakly, so Jacobi's equation is singular")


def _closed(reason: str) -> JacobiIndex:
    return JacobiIndex(None, 0, reason, np.zeros(0), "")


def _vertical(accessory: Accessory) -> np.ndarray:
    return np.vstack([np.zeros((accessory.N, accessory.N)), np.eye(accessory.N)])


def _pieces(along: AlongCurve) -> JacobiIndex:
    """Waypoints hold the whole curve, so that what lies between them varies for itself."""
    accessory = Accessory(along)
    if accessory.functions < accessory.N or along.order != 1:
        return _closed("waypoints are held together by unknown numbers, prescribed integrals or a second order")
    start, end = end_planes(accessory)
    if not end.fixed:
        return _closed("there are waypoints, and the end is not fixed")
    points, nullity = [], 0
    for k, span in enumerate(along.parts()):
        system = canonical(accessory, span=span)
        carried = _carried(system, balanced(accessory, start.plane if k == 0 else _vertical(accessory)))
        points.append(carried.points)
        nullity += len(carried.at_end)
    found = np.concatenate(points)
    return JacobiIndex(len(found), nullity, "", found, f"{len(found)} conjugate points between ends and waypoints")


def _whole(along: AlongCurve) -> JacobiIndex:
    accessory = Accessory(along)
    if along.form.ends.periodic:
        return _periodic(accessory)
    start, end = end_planes(accessory)
    forward = _carried(canonical(accessory), balanced(accessory, start.plane))
    points = forward.points
    name = "conjugate" if start.fixed else "focal"
    if start.fixed and end.fixed and rises_throughout(along.form, along.evaluate):
        # round-off of fields that grow by more than all digits may show points where there are none
        return JacobiIndex(0, 0, "", np.zeros(0), "the slope of the curve is a Jacobi field without a zero")
    if end.fixed:
        return JacobiIndex(len(points), len(forward.at_end), "", points, f"{len(points)} {name} points inside")
    if start.fixed:
        backward = _carried(canonical(accessory, backward=True), balanced(accessory, end.plane, backward=True))
        count = len(backward.points)
        return JacobiIndex(count, len(backward.at_end), "", points, f"{count} focal points of the end inside")
    negative, null = _end_form(forward, end, accessory)
    account = f"{len(points)} {name} points inside and {negative} negative directions of the ends"
    return JacobiIndex(len(points) + negative, null, "", points, account)


def _carried(system: Canonical, plane: np.ndarray) -> CarriedPlane:
    return CarriedPlane(system, _reduced(system, plane, system.span[0]))


def _reduced(system: Canonical, plane: np.ndarray, s: float) -> np.ndarray:
    """The part of a plane that pathwise conditions allow, without the momenta that only they feel."""
    allowed = system.allowed(np.array([s]))
    if allowed is None:
        return plane
    basis, N = allowed[0], system.N
    forbidden = plane[:N] - basis @ (basis.T @ plane[:N])
    _, sizes, right = np.linalg.svd(forbidden)
    rank = int((sizes > 1e-9 * max(1.0, sizes.max(initial=0.0))).sum())
    kept = plane @ right[rank:].T
    seen = np.vstack([basis.T @ kept[:N], basis.T @ kept[N:]])
    _, sizes, right = np.linalg.svd(seen)
    return kept @ right[: basis.shape[1]].T


def _end_form(forward: CarriedPlane, end: EndPlane, accessory: Accessory) -> tuple[int, int]:
    """Negative and zero eigenvalues of the second variation on the Jacobi fields that the end leaves free."""
    system = forward.system
    N, b = system.N, system.span[1]
    frame, plane = forward.last, _reduced(system, balanced(accessory, end.plane), b)
    halves = [frame[:N], frame[N:], plane[:N], plane[N:]]
    allowed = system.allowed(np.array([b]))
    if allowed is not None:
        halves = [allowed[0].T @ half for half in halves]
    X, pi, X_end, pi_end = halves
    if np.linalg.cond(X) > 1.0 / SINGULAR_FIELDS:
        raise NotSeparate("the end is focal to the start, and free")
    form = X_end.T @ (pi @ np.linalg.solve(X, X_end) - pi_end)
    form = 0.5 * (form + form.T)
    free = np.linalg.svd(X_end)[2][: np.linalg.matrix_rank(X_end, 1e-9)].T
    negative, null = signs(free.T @ form @ free)
    return negative, max(0, null - _translations(form, X_end, accessory, allowed))


def _translations(form: np.ndarray, X_end: np.ndarray, accessory: Accessory, allowed: np.ndarray | None) -> int:
    """How many null directions of the ends move the curve along a coordinate that the Lagrangian does not hold."""
    count = 0
    for i in accessory.along.whole.ignorable:
        moved = np.eye(accessory.N)[i] / accessory.scale
        moved = moved if allowed is None else allowed[0].T @ moved
        chosen = np.linalg.lstsq(X_end, moved, rcond=None)[0]
        missed = np.linalg.norm(X_end @ chosen - moved)
        size = NULL * max(1.0, float(np.abs(form).max())) * np.linalg.norm(chosen)
        count += bool(missed <= SYMMETRIC * np.linalg.norm(moved) and np.linalg.norm(form @ chosen) <= size)
    return count


def _periodic(accessory: Accessory) -> JacobiIndex:
    """Conjugate points with both ends held, and the concavity form on what periodicity leaves free."""
    if accessory.along.form.ends.joint is not None:
        raise NotSeparate("periodic ends carry a cost")
    system, N = canonical(accessory), accessory.N
    plane = np.zeros((2 * N, N))
    plane[N:] = np.eye(N)
    for k in range(accessory.numbers.start, accessory.numbers.stop):
        if k != accessory.gauge:
            plane[[k, N + k], k] = (1.0, 0.0)  # an unknown number is free, its momentum zero at the start
    carried = CarriedPlane(system, _reduced(system, plane, system.span[0]))
    negative, null = concavity(system, accessory)
    account = f"{len(carried.points)} conjugate points inside and {negative} negative directions of the concavity form"
    return JacobiIndex(len(carried.points) + negative, null, "", carried.points, account)
