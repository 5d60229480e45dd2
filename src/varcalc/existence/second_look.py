"""What the routes of the ladder had no answer to, looked at again."""

from __future__ import annotations

from dataclasses import replace

from varcalc.existence.approach import approached, gap
from varcalc.existence.corners import with_corners
from varcalc.existence.falling import falling
from varcalc.functional import Functional
from varcalc.solution import Solution, Status, Verdict


def second_look(problem: Functional, tol: float, failure: Solution) -> Solution:
    """A minimum with corners, or the failure with the verdict that says why there is no minimum at all."""
    if failure.verdict in (None, Verdict.WEAK_MINIMUM):
        failure = with_corners(problem, tol, failure)
    if failure.status.ok or failure.verdict is not None:
        return failure
    if (fall := falling(problem)) is not None:
        return _refused(failure, Verdict.UNBOUNDED, fall.sentence)
    if (approach := approached(problem)) is not None:
        if (between := gap(problem, approach)) is not None:
            return _refused(failure, Verdict.GAP, between.sentence(approach.limit))
        if approach.concentrates:
            return _refused(failure, Verdict.NOT_ATTAINED, f"the infimum is not attained: {approach.sentence}")
    return failure


def _refused(failure: Solution, verdict: Verdict, message: str) -> Solution:
    return replace(failure, status=Status.REFUSED, verdict=verdict, message=message)
