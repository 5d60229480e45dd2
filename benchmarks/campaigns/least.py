"""The least value of a functional, and what an answer is worth beside it.

A route that minimises (the ladder, Ritz) has to come to the least value, or say that its answer is a local one
(``Solution.local``). One that finds stationary curves may come to any of them: it is wrong when no curve has the value
it gives, which is known where the value lies below the least one, and where the least curve is the only stationary one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from campaigns.truth import FLOOR, MARGIN, Answer, Outcome, refused
from varcalc.solution import Verdict


@dataclass(frozen=True)
class Least:
    """The greatest lower bound of a functional (-inf where there is none), and whether a curve attains it.

    ``sole`` where no curve is stationary but one of the least value; ``within`` is the error of ``value``, and
    ``verdicts`` is every verdict that may be stated truthfully. Where a functional has no bound but the local minimum
    is what is asked for, as of a soap film, that is the value, with what else is true among the verdicts.
    """

    value: float
    attained: bool = True
    sole: bool = False
    within: float = 0.0
    verdicts: frozenset[Verdict] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", float(self.value))

    def times(self, factor: float) -> Least:
        """Of the functional multiplied by a positive factor."""
        return replace(self, value=factor * self.value, within=factor * self.within)


UNBOUNDED = Least(-math.inf, attained=False, verdicts=frozenset({Verdict.UNBOUNDED, Verdict.SADDLE}))
"""Of a functional that falls without bound; a saddle on the way down may be called one."""


def judged_by_least(answer: Answer, local: bool, least: Least, minimises: bool) -> tuple[Outcome, float]:
    """The outcome, and by how much the answer lies above the least value (NaN for a refusal).

    What the direct route does not take up counts as refused: for an indirect one there is another to take.
    """
    if not answer.ok:
        heard = replace(answer, applies=answer.applies or minimises)
        return refused(heard, least.attained, least.verdicts), math.nan
    above = answer.value - least.value
    allowed = max(MARGIN * answer.claim, FLOOR * max(1.0, abs(least.value)), least.within)
    if least.attained and abs(above) <= allowed:
        return Outcome.RIGHT, above
    excused = local if minimises else not least.sole
    # nothing lies below the least value, and an answer that is no number lies nowhere
    return (Outcome.OTHER if excused and above > -allowed else Outcome.FALSE), above
