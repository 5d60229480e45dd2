"""verify: what kind of stationary curve a solution is, and the evidence behind the verdict."""

from __future__ import annotations

from varcalc.solution import Finding, Solution, no_solution
from varcalc.spelling import spelled
from varcalc.verify.verification import Verification

__all__ = ["Finding", "Verification", "verify"]


@spelled
def verify(solution: Solution) -> Verification:
    """Tell a minimum from a saddle: every classical condition, checked along a solution's curve.

    Checked are the Euler-Lagrange equation, Legendre's, Weierstrass's and
    Jacobi's conditions, those of Weierstrass and Erdmann at corners, and the
    first integrals. The index is found by two routes, from conjugate points
    and from the Hessian of the discretised functional, which must agree. With
    ``maximise`` everything is judged for -L, and the verdict for a good
    answer is MAXIMUM. Checks of other packages (entry points of the group
    ``varcalc.checks``) follow these.

    Raises TypeError for anything but a Solution, ValueError for one that holds no curve;
    TypeError also for an entry point that names anything but a check.

    >>> import varcalc as vc
    >>> swing = vc.Problem(lambda x, y, dy: (dy**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1))
    >>> check = verify(vc.solve(swing, vc.Collocation()))
    >>> check.verdict, check.index, check.conjugate_points
    (<Verdict.SADDLE: 'stationary, but neither a minimum nor a maximum'>, 1, array([3.14159265]))
    """
    from varcalc.verify.verdict import (
        verified,  # every check has a module of its own: the first verification loads them
    )

    if not isinstance(solution, Solution):
        raise no_solution(solution, "verify")
    if solution.curve is None:
        raise ValueError(f"the solution holds no curve to verify: {solution.message or solution.status.value}")
    return verified(solution)
