"""The Morse index, by the two routes to it, which must agree, and what the second variation decides."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from varcalc.solution import Finding, Verdict
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.convexity import Convexity
from varcalc.verify.legendre import LegendreCondition
from varcalc.verify.morse import JacobiEquation
from varcalc.verify.ritz_hessian import RitzHessian
from varcalc.verify.singular_ends import SingularEnds


@dataclass(frozen=True)
class MorseIndex:
    """The ``index``: infinite when Legendre's condition fails or variations oscillate, NaN where no route tells.

    ``nullity`` counts the directions in which the second variation vanishes, by the first route that tells.
    """

    index: float
    nullity: int


@dataclass(frozen=True)
class SecondVariation(Check[MorseIndex]):
    """Whether the second variation is positive, as both routes to the index tell."""

    name = "second variation"

    def measure(self, candidate: Candidate) -> MorseIndex:
        """The index by the first route that tells."""
        jacobi, ritz = candidate.measured(JacobiEquation()), candidate.measured(RitzHessian())
        nullity = jacobi.nullity if jacobi.index is not None else ritz.nullity
        oscillates = any(end.oscillates for end in candidate.measured(SingularEnds()))
        if oscillates or not candidate.measured(LegendreCondition()).holds:
            return MorseIndex(math.inf, nullity)
        if candidate.measured(Convexity()):
            return MorseIndex(0, nullity)
        found = [route.index for route in (jacobi, ritz) if route.index is not None]
        return MorseIndex(found[0] if found else math.nan, nullity)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """A saddle, a conjugate end, or that the routes tell nothing or disagree."""
        measured = candidate.measured(self)
        if not candidate.measured(LegendreCondition()).leaves_open:
            return
        if candidate.measured(Convexity()):
            if measured.nullity:
                yield _vanishing(measured.nullity, False)
            return
        jacobi, ritz, index = candidate.measured(JacobiEquation()), candidate.measured(RitzHessian()), measured.index
        if jacobi.index is not None and ritz.index is not None and jacobi.index != ritz.index:
            sentence = (
                f"the two routes to the index disagree, {jacobi.index} against {ritz.index}: neither can be relied on"
            )
            numbers = {"jacobi": float(jacobi.index), "ritz": float(ritz.index)}
            yield Finding(Verdict.DEGENERATE, sentence, numbers)
        if measured.nullity:
            beyond = len(jacobi.points) > 0 and not jacobi.reason
            yield _vanishing(measured.nullity, beyond)
        if math.isinf(index):
            return  # told by what makes it so
        if index > 0:
            better = "raise" if candidate.problem.maximise else "lower"
            count = "one variation" if index == 1 else f"{index:.0f} independent variations"
            sentence = f"{count} of the curve {better}{'s' if index == 1 else ''} the functional: a saddle"
            yield Finding(Verdict.SADDLE, sentence, {"index": float(index)})
        elif math.isnan(index):
            sentence = f"the index could not be found: {jacobi.reason}; {ritz.reason}"
            yield Finding(Verdict.DEGENERATE, sentence)


def _vanishing(nullity: int, beyond: bool) -> Finding:
    """That the second variation vanishes in some directions, ``beyond`` the points that Jacobi's equation lists."""
    if beyond:
        place = f"beyond the points listed, {nullity} more at the end itself"
    else:
        place = f"the second variation vanishes in {nullity} direction{'s' if nullity > 1 else ''}"
    sentence = (
        f"{place}: the end is conjugate, or the curve is one of a continuum, and the second order does not decide"
    )
    return Finding(Verdict.DEGENERATE, sentence, {"nullity": float(nullity)})
