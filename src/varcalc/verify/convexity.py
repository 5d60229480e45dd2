"""Whether a problem is convex as a whole: then an extremal is a least curve, and no second variation is needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from varcalc.problem.convexity import (
    IN_ANOTHER_ORDINATE,
    proved_in_another_ordinate,
    proved_least,
    proved_with_levels,
)
from varcalc.solution import Finding
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check


@dataclass(frozen=True)
class Convexity(Check[bool]):
    """Whether the functional, and what is admissible, is proved convex (concave, for one to be made greatest)."""

    name = "convexity"

    def measure(self, candidate: Candidate) -> bool:
        """Whether there is a proof, with the multipliers of the solution where levels are prescribed."""
        problem, multipliers = candidate.problem, candidate.solution.multipliers
        return proved_least(problem) or proved_with_levels(problem, multipliers)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """The proof, where there is one."""
        if candidate.measured(self):
            shape, best = ("concave", "greatest") if candidate.problem.maximise else ("convex", "least")
            where = (
                IN_ANOTHER_ORDINATE if proved_in_another_ordinate(candidate.problem) else "in the curve and its slope"
            )
            yield Finding(None, f"L is proved {shape} {where}, so that an extremal is the {best} of all curves")
