"""Every check carried out on one solution."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.methods.answer import composite_gauss, functional_value, sample
from varcalc.solution import Solution
from varcalc.verify.along_curve import along_curve
from varcalc.verify.candidate import Candidate, candidate, user_coordinates
from varcalc.verify.corners import Corner, corners
from varcalc.verify.invariants import invariants
from varcalc.verify.legendre import legendre
from varcalc.verify.morse import JacobiIndex, index_by_jacobi
from varcalc.verify.residual import residual
from varcalc.verify.ritz_hessian import index_by_ritz
from varcalc.verify.verdict import Evidence
from varcalc.verify.verification import Index
from varcalc.verify.weierstrass import least_excess


def evidence_of(solution: Solution) -> Evidence:
    """What every check finds of a solution that holds a curve."""
    under_test = candidate(solution)
    own, best = under_test.own, under_test.best
    along = user_coordinates(under_test)
    legendre_condition = legendre(along)
    strict = legendre_condition.strengthened
    jacobi, ritz, points = _second_variation(under_test, strict)
    polished = best is not None and not under_test.reason
    # third derivatives are to be had of the polished curve only
    smooth = along_curve(best) if solution.problem.order == 2 and best is not None and polished else along
    measured = solution.problem.order == 1 or polished
    return Evidence(
        solution=solution,
        residual=residual(along, True) if own is None else residual(along_curve(own)),
        legendre=legendre_condition,
        excess=least_excess(along, solution),
        jacobi=jacobi,
        ritz=ritz,
        points=points,
        corners=[] if under_test.touched else _broken(corners(along), polished),
        invariants=invariants(smooth, own) if measured and not under_test.touched else {},
        bound=bound(under_test),
        misses=misses(under_test),
        unpolished=under_test.reason,
        touched=under_test.touched,
    )


def _broken(found: list[Corner], polished: bool) -> list[Corner]:
    """The corners that are the extremal's own: a kink that polishing has smoothed was the error of the curve."""
    return [c for c in found if not polished or c.held or math.isnan(c.energy)]


def _second_variation(under_test: Candidate, strict: bool) -> tuple[JacobiIndex, Index, np.ndarray]:
    """The index by both routes, and the conjugate points in the user's abscissa."""
    best = under_test.best
    nothing = np.zeros(0)
    if best is None:
        jacobi = JacobiIndex(None, 0, under_test.reason, nothing, "")
    elif not strict:
        reason = "Jacobi's equation is singular where Legendre's condition does not hold strictly"
        jacobi = JacobiIndex(None, 0, reason, nothing, "")
    else:
        jacobi = index_by_jacobi(along_curve(best))
    own = under_test.own
    # where regularity alone decides at a singular end, the coordinates made for that are the better ones for Ritz
    curve = own if own is not None and own.form.coordinates.weak_only else best or own
    ritz = Index(None, 0, under_test.reason) if curve is None else index_by_ritz(curve)
    points = along_curve(best).abscissa(jacobi.points) if best is not None and len(jacobi.points) else nothing
    return jacobi, ritz, points


POINTS = 64
"""Gauss points an element: a finer rule than any method's."""


def bound(under_test: Candidate) -> float:
    """The functional on the solution's own curve; its value as reported where that curve is in singular coordinates."""
    if under_test.own is None:
        return under_test.solution.value
    value = functional_value(under_test.own, POINTS)
    return value if math.isfinite(value) else under_test.solution.value


def misses(under_test: Candidate) -> dict[int, float]:
    """By how much the curve misses each prescribed integral, relative to max(1, level), by number of constraint."""
    own = under_test.own
    if own is None or not own.form.conditions.integrals:
        return {}
    s, weights = composite_gauss(own.vertices, POINTS)
    function = ca.Function(
        "g", own.form.symbols.all, [ca.vertcat(*(c.expression for c in own.form.conditions.integrals))]
    )
    integrals = np.asarray(function(*sample(own, s))) @ weights
    out = {}
    for condition, integral in zip(own.form.conditions.integrals, integrals, strict=True):
        beyond = max(condition.lower - integral, integral - condition.upper, 0.0)
        out[condition.index] = float(beyond) / max(1.0, abs(integral))
    return out
