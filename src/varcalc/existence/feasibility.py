"""Why a problem with conditions has no answer: levels out of reach, and conditions that contradict each other."""

from __future__ import annotations

import math
from dataclasses import replace

from varcalc.formulation.singular import forms
from varcalc.methods.ritz.method import Ritz
from varcalc.problem.conditions import Bound, Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution, Status, Verdict

EQUAL = 1e-9
"""Relative distance from an extreme level at which only the extreme curve itself is left."""


def explained(problem: Functional, failure: Solution) -> Solution:
    """The failure, with verdict and sentence when no curve meets the conditions.

    For a level the least and greatest value of the constraint's own functional between
    the same ends decide: beyond them no curve exists; at them only the extreme
    curve does, and the multiplier rule is abnormal there. Bounds, and levels each of which can be
    reached, may still contradict each other.
    """
    for index, constraint in enumerate(problem.constraints):
        if not isinstance(constraint, Isoperimetric):
            continue
        lower, upper = constraint.interval
        least, greatest = _extreme(problem, constraint, False), _extreme(problem, constraint, True)
        size = max(1.0, abs(upper if math.isfinite(upper) else lower))
        label = f"constraints[{index}] (Isoperimetric)"
        if upper < least - EQUAL * size or lower > greatest + EQUAL * size:
            wanted = f"{lower:.12g}" if constraint.equality else f"between {lower:.12g} and {upper:.12g}"
            return replace(
                failure, status=Status.REFUSED, verdict=Verdict.INFEASIBLE,
                message=f"{label} asks for {wanted}, but between these ends its integral lies between "
                f"{least:.12g} and {greatest:.12g}; change the level or the ends",
            )  # fmt: skip
        for extreme in (least, greatest):
            if constraint.equality and abs(lower - extreme) <= EQUAL * size:
                return replace(
                    failure, status=Status.REFUSED, verdict=Verdict.DEGENERATE,
                    message=f"{label} asks for {lower:.12g}, the extreme value of its integral between these ends: "
                    "only the extreme curve is admissible, and no multiplier exists there",
                )  # fmt: skip
    if _can_contradict(problem) and not failure.status.ok:
        from varcalc.existence.contradiction import contradiction  # few solves come here

        found = contradiction(problem)
        if found is not None:
            return replace(failure, status=Status.REFUSED, verdict=Verdict.INFEASIBLE, message=found.sentence)
    return failure


def _can_contradict(problem: Functional) -> bool:
    """Whether there are bounds, or several levels."""
    return any(problem.of_type(Bound)) or len(list(problem.of_type(Isoperimetric))) > 1


def _extreme(problem: Functional, constraint: Isoperimetric, greatest: bool) -> float:
    """The least (greatest) value of the constraint's integral; infinite where none is found."""
    bare: Functional
    if isinstance(problem, Problem):
        bare = Problem(
            constraint.g, problem.start, problem.end, parameters=problem.parameters, unknowns=problem.unknowns,
            order=problem.order, maximise=greatest, breakpoints=problem.breakpoints,
        )  # fmt: skip
    else:
        bare = Curve(
            constraint.g, problem.start, problem.end, parameters=problem.parameters, unknowns=problem.unknowns,
            maximise=greatest,
        )  # fmt: skip
    for form in filter(None, forms(bare)):
        solution = Ritz(starts=3).solve(form, tol=1e-10, guess=None)
        if solution.status.ok:
            return solution.value
    return math.inf if greatest else -math.inf
