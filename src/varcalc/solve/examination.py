"""The examination of a problem: every check, and what it finds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from varcalc.existence.approach import approached, gap
from varcalc.existence.broken_curve import broken_curve
from varcalc.existence.corners import RELAXED_PIECES, convex
from varcalc.existence.falling import falling
from varcalc.existence.relaxation import applies, relaxed
from varcalc.existence.second_look import none_found, regular
from varcalc.problem.attained import proved_attained
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.search import extremals
from varcalc.showing import counted
from varcalc.solution import Finding, Solution, Status, Verdict, sought
from varcalc.solve.ladder import solve

HOPELESS = {Verdict.INFEASIBLE, Verdict.SINGULAR}
"""Verdicts that leave nothing to search for."""
VERIFIED = 8
"""Extremals that are told one by one: a functional without a bound may have hundreds, each slow to verify."""


class ProblemExamination:
    """The checks of one problem, in an order in which the cheap ones may spare the others."""

    def __init__(self, problem: Functional) -> None:
        self.problem = problem
        self.evidence: dict[str, Any] = {}

    def findings(self) -> Iterator[Finding]:
        """Every statement that holds, as the checks come to it."""
        solution = solve(self.problem, throw=False, progress=False)
        self.evidence["solution"] = solution
        yield from _of_solution(solution)
        if solution.verdict in HOPELESS:
            return
        yield from self._unbounded(solution)
        yield from self._extremals(solution)
        yield from self._approach(solution)
        yield from self._relaxation()
        yield from self._broken(solution)

    def _unbounded(self, solution: Solution) -> Iterator[Finding]:
        fall = falling(self.problem)
        if fall is not None:
            self.evidence["fall"] = fall
            if solution.verdict is not Verdict.UNBOUNDED:
                yield fall.finding

    def _extremals(self, solution: Solution) -> Iterator[Finding]:
        found = extremals(self.problem, progress=False)
        self.evidence["extremals"] = found
        for number, extremal in enumerate(found[:VERIFIED], start=1):
            check = extremal.verification
            sentence = (
                f"extremal {number} of {len(found)}: value {extremal.value:.12g}, index {check.index:g}, "
                f"{check.verdict.value}"
            )
            alone = number == 1 and not solution.status.ok
            yield Finding(
                check.verdict if alone else None, sentence, {"value": extremal.value, "index": float(check.index)}
            )
        if len(found) > VERIFIED:
            more = counted(len(found) - VERIFIED, "further extremal")
            ends = f"{found[VERIFIED].value:.12g} to {found[-1].value:.12g}"
            yield Finding(None, f"{more}, with values from {ends}, not verified one by one")
        if len(found):
            yield Finding(None, f"searched: {found.searched}")
        elif solution.status.ok or solution.verdict is Verdict.NO_EXTREMAL:
            return
        elif found.complete and regular(self.problem) and not proved_attained(self.problem):
            yield none_found(self.problem, found)
        else:
            yield Finding(None, f"no extremal was found: {found.searched}")

    def _approach(self, solution: Solution) -> Iterator[Finding]:
        """How the infimum is approached, where no minimum was found."""
        if solution.status.ok or (approach := approached(self.problem)) is None:
            return
        self.evidence["polygons"] = approach
        between = gap(self.problem, approach)
        if between is not None and solution.verdict is not Verdict.GAP:
            yield between.finding(approach.limit)
        if approach.concentrates and solution.verdict is not Verdict.NOT_ATTAINED:
            yield approach.finding

    def _relaxation(self) -> Iterator[Finding]:
        problem = self.problem
        if not (isinstance(problem, Problem) and applies(problem)) or convex(problem):
            return
        found = relaxed(problem, RELAXED_PIECES[-1])
        if found is None:
            return
        self.evidence["relaxed"] = found
        sentence = f"L is not convex in the slope; its convex envelope has the least value {found.value:.9g}"
        if found.mixed.any():
            sentence += f", by alternating between two slopes on {found.mixed.mean():.0%} of the interval"
        yield Finding(None, sentence, {"relaxed": found.value, "mixed": float(found.mixed.mean())})

    def _broken(self, solution: Solution) -> Iterator[Finding]:
        rival = broken_curve(self.problem)
        if rival is None:
            return
        self.evidence["broken"] = rival
        sign = self.problem.sign
        if not solution.status.ok or sign * rival.value < sign * solution.value:
            yield Finding(None, rival.sentence, {"value": rival.value, "level": rival.level})


def _of_solution(solution: Solution) -> Iterator[Finding]:
    """What solving the problem says of it."""
    numbers = {"value": solution.value, "error": solution.error.value}
    if not solution.status.ok:
        yield Finding(solution.verdict, f"solve gives no answer: {solution.message}", numbers)
        return
    best = Verdict.MAXIMUM if solution.problem.maximise else Verdict.MINIMUM
    kind = sought(solution.problem)
    local = f", local only: {solution.lower:.12g} is reached elsewhere" if solution.local and solution.lower else ""
    yield Finding(best, f"a {kind}: {solution.value:.15g} with an error of {solution.error.value:.1e}{local}", numbers)
    if solution.status is Status.ROUND_OFF:
        yield Finding(None, "round-off is reached: the answer is the best that double precision allows", numbers)
