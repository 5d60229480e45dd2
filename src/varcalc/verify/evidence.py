"""Every check carried out on one solution."""

from __future__ import annotations

import math

import numpy as np

from varcalc.solution import Solution
from varcalc.verify.bounds import bound, misses
from varcalc.verify.corners import Corner, corners
from varcalc.verify.index import Index
from varcalc.verify.invariants import invariants
from varcalc.verify.legendre import legendre
from varcalc.verify.morse import JacobiIndex, index_by_jacobi
from varcalc.verify.personal import personal
from varcalc.verify.residual import residual
from varcalc.verify.ritz_hessian import index_by_ritz
from varcalc.verify.setting import setting
from varcalc.verify.trial import Trial, trial
from varcalc.verify.verdict import Evidence
from varcalc.verify.weierstrass import least_excess


def evidence_of(solution: Solution) -> Evidence:
    """What every check finds of a solution that holds a curve."""
    on_trial = trial(solution)
    own, best = on_trial.own, on_trial.best
    person = personal(on_trial)
    legendre_condition = legendre(person)
    strict = legendre_condition.strengthened
    jacobi, ritz, points = _second_variation(on_trial, strict)
    polished = best is not None and not on_trial.reason
    # third derivatives are to be had of the polished curve only
    smooth = setting(best) if solution.problem.order == 2 and best is not None and polished else person
    measured = solution.problem.order == 1 or polished
    return Evidence(
        solution=solution,
        residual=residual(person, True) if own is None else residual(setting(own)),
        legendre=legendre_condition,
        excess=least_excess(person, solution),
        jacobi=jacobi,
        ritz=ritz,
        points=points,
        corners=[] if on_trial.touched else _broken(corners(person), polished),
        invariants=invariants(smooth, own) if measured and not on_trial.touched else {},
        bound=bound(on_trial),
        misses=misses(on_trial),
        unpolished=on_trial.reason,
        touched=on_trial.touched,
    )


def _broken(found: list[Corner], polished: bool) -> list[Corner]:
    """The corners that are the extremal's own: a kink that polishing has smoothed was the error of the curve."""
    return [c for c in found if not polished or c.held or math.isnan(c.energy)]


def _second_variation(on_trial: Trial, strict: bool) -> tuple[JacobiIndex, Index, np.ndarray]:
    """The index by both routes, and the conjugate points in the person's abscissa."""
    best = on_trial.best
    nothing = np.zeros(0)
    if best is None:
        jacobi = JacobiIndex(None, 0, on_trial.reason, nothing, "")
    elif not strict:
        reason = "Jacobi's equation is singular where Legendre's condition does not hold strictly"
        jacobi = JacobiIndex(None, 0, reason, nothing, "")
    else:
        jacobi = index_by_jacobi(setting(best))
    own = on_trial.own
    # where regularity alone decides at a singular end, the coordinates made for that are the better ones for Ritz
    curve = own if own is not None and own.form.weak_only else best or own
    ritz = Index(None, 0, on_trial.reason) if curve is None else index_by_ritz(curve)
    points = setting(best).abscissa(jacobi.points) if best is not None and len(jacobi.points) else nothing
    return jacobi, ritz, points
