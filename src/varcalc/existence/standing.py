"""What minimisation ends at under pathwise conditions: a minimum, a saddle, or one of a continuum.

IPOPT looks for points where the conditions of first order hold. A start that
shares a symmetry of the problem leads to a saddle that shares it, as the long
arc of a great circle; so the second variation on the conditions' null space
decides, and a saddle is left by a displacement that has no symmetry.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.ritz.method import Ritz
from varcalc.solution import Finding, Solution, Verdict, refused
from varcalc.verify.candidate import undivided
from varcalc.verify.ritz_hessian import index_by_ritz
from varcalc.verify.verification import Index

ASIDE_OF_SADDLE = 0.2
"""Size of the displacement, in units of the curve's."""


def off_saddle(method: object, form: Form, solution: Solution, tol: float) -> Solution:
    """The solution of a direct method under holonomic conditions, or the one found from beside it if it was a saddle.

    Refused with SADDLE when that is one as well, with DEGENERATE where the
    second variation vanishes in a direction though both ends are fixed.
    """
    index = _index(method, form, solution)
    if index is not None and index.index:
        assert isinstance(method, Ritz)
        again = replace(method, starts=1).solve(form, tol=tol, guess=_beside(solution, form))
        if again.status.ok:
            solution, index = again, _index(method, form, again)
    if index is None or index.index is None:
        return solution
    if index.index:
        message = f"no minimum: {index.index} independent variations that keep the conditions lower the functional"
        return refused(solution, Finding(Verdict.SADDLE, message, {"index": float(index.index)}))
    if index.nullity and solution.problem.start.fixed and solution.problem.end.fixed:
        message = (
            "the second variation vanishes in a direction: the ends are conjugate, and the extremal is one of a "
            "continuum or on the point of being no minimum"
        )
        return refused(solution, Finding(Verdict.DEGENERATE, message))
    return solution


def _index(method: object, form: Form, solution: Solution) -> Index | None:
    """The index on the null space of the conditions; None where Newton's iteration has seen to it, or bounds act."""
    conditions = (*form.conditions.pathwise, *form.conditions.integrals)
    if not isinstance(method, Ritz) or not form.conditions.pathwise or not all(c.equality for c in conditions):
        return None
    return index_by_ritz(undivided(solution.extremal, solution.value))


def _beside(solution: Solution, form: Form) -> Sampled:
    """The curve displaced by one arch, by another amount in each function."""
    assert solution.extremal is not None
    evaluate = solution.extremal.evaluate
    a, b = form.span
    size = float(np.abs(evaluate(np.linspace(a, b, 33), 0)).max()) or 1.0
    amounts = ASIDE_OF_SADDLE * size / (1.0 + np.arange(form.n))[::-1, None]

    def displaced(s: np.ndarray) -> np.ndarray:
        return evaluate(s, 0) + amounts * np.sin(np.pi * (s - a) / (b - a))

    return displaced
