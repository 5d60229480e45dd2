"""Answers in pieces on meshes that see what lies between the points of the first, however narrow it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from varcalc.numerics.mesh import apart
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution, Status
from varcalc.verify.between import unseen_where_broken

CLOSER_MESHES = 6
"""Times that a problem is solved anew on a mesh that sees what lay between the points of the one before."""


def on_closer_meshes(problem: Functional, solved: Callable[[Functional], Solution | None]) -> Solution | None:
    """What a way of solving in pieces comes to, on a mesh on which nothing lies between the points of its answer.

    It is refused where that way has no answer on such a mesh; None where it leads nowhere at all.
    """
    first = solution = solved(problem)
    missed = None if solution is None else unseen_where_broken(solution)
    known, beyond = list[float](), False
    for _ in range(CLOSER_MESHES):
        if missed is None or solution is None or not isinstance(problem, Problem):
            break
        new = apart(missed.marks.tolist(), [*problem.span, *problem.breakpoints])
        both, beyond = known + apart(new, [*problem.span, *problem.breakpoints, *known]), beyond or missed.beyond
        # where those of all meshes together lead nowhere, the last may: it is looked at like any other
        again = _solved_with(problem, solved, both)
        if (again is None or not again.status.ok) and known:
            both, again = new, _solved_with(problem, solved, new)
        known = both
        if again is None or not again.status.ok:
            why = "no curve that is broken where it should be was found" if again is None else again.message
            message = f"{missed.sentence}, and on a mesh that can there was no answer: {why}"
            return replace(solution, status=Status.NOT_CONVERGED, message=message)
        solution = replace(again, problem=problem)
        missed = unseen_where_broken(solution)
    if solution is not None and missed is not None:
        return replace(solution, status=Status.NOT_CONVERGED, message=missed.sentence)
    # where it was right the first mesh has more digits
    kept = first is not None and solution is not None and not beyond and agree(first, solution)
    return first if kept else solution


def _solved_with(
    problem: Problem, solved: Callable[[Functional], Solution | None], marks: list[float]
) -> Solution | None:
    """What a way of solving comes to with more breakpoints."""
    return solved(problem.restated(breakpoints=[*problem.breakpoints, *marks]))


def agree(first: Solution, second: Solution) -> bool:
    """Whether two answers are one within what they claim, and the first claims no more than the second."""
    error = first.error.value + second.error.value
    same = first.status.ok and second.status.ok and abs(first.value - second.value) <= error
    return same and first.error.value <= second.error.value
