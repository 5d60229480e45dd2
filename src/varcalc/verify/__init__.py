"""verify: what kind of stationary curve a solution is, and the evidence behind the verdict."""

from __future__ import annotations

import numpy as np

from varcalc.problem.problem import Curve
from varcalc.solution import Solution
from varcalc.verify.verification import Finding, Verification

__all__ = ["Finding", "Verification", "verify"]


def verify(solution: Solution) -> Verification:
    """Tell a minimum from a saddle: every classical condition, checked along a solution's curve.

    Checked are the Euler-Lagrange equation, Legendre's, Weierstrass's and
    Jacobi's conditions, those of Weierstrass and Erdmann at corners, and the
    first integrals. The index is found by two routes, from conjugate points
    and from the Hessian of the discretised functional, which must agree. With
    ``maximise`` everything is judged for -L, and the verdict for a good
    answer is MAXIMUM.

    Raises TypeError for anything but a Solution, ValueError for one that holds no curve.

    >>> import varcalc as vc
    >>> swing = vc.Problem(lambda x, y, dy: (dy**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1))
    >>> check = verify(vc.solve(swing, vc.Collocation()))
    >>> check.verdict, check.index, check.conjugate_points
    (<Verdict.SADDLE: 'stationary, but neither a minimum nor a maximum'>, 1, array([3.14159265]))
    """
    # every check has a module of its own: they are imported by the first verification
    from varcalc.verify.checks import evidence_of
    from varcalc.verify.verdict import judged

    if not isinstance(solution, Solution):
        raise TypeError(f"verify takes a Solution, as solve gives, not {solution!r}")
    if solution.curve is None:
        raise ValueError(f"the solution holds no curve to verify: {solution.message or solution.status.value}")
    with np.errstate(all="ignore"):  # what is no number at a singular end is left out where it arises
        evidence = evidence_of(solution)
    verdict, findings = judged(evidence)
    return Verification(
        name=solution.problem.name,
        verdict=verdict,
        index=evidence.index,
        conjugate_points=evidence.points,
        residual=evidence.residual,
        legendre=evidence.legendre.least,
        weierstrass=evidence.excess,
        invariants=evidence.invariants,
        bound=evidence.bound,
        routes={"Jacobi": evidence.jacobi.index, "Ritz": evidence.ritz.index},
        findings=findings,
        maximise=solution.problem.maximise,
        abscissa="t" if isinstance(solution.problem, Curve) else "x",
    )
