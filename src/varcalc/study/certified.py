"""What is proved of a problem, in one line."""

from __future__ import annotations

from varcalc.certificates import certify
from varcalc.problem.functional import Functional
from varcalc.solution import Solution, VariationalError
from varcalc.solve.ladder import solve


def proved_digits(problem: Functional) -> str:
    """Solve and certify; the digits of the value proved and for which curves, or why there is no proof."""
    try:
        solution = solve(problem)
    except VariationalError as error:
        return f"not solved: {error}"
    return certified_line(solution)


def certified_line(solution: Solution) -> str:
    """The digits of a solution's value that are proved, and for which curves; or why there is no proof."""
    try:
        certificate = certify(solution)
    except (VariationalError, ImportError) as reason:
        return str(reason)
    return f"{certificate.digits} digits proved, over {certificate.scope.value}"
