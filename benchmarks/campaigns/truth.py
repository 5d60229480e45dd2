"""What is known of a problem beforehand, and what an answer is worth beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import varcalc as vc

FLOOR = 1e-9
"""Distance from a true value, relative to max(1, its size), that is never held against an answer."""
MARGIN = 10.0
"""How many times its claimed error an answer may lie from a true value: an estimate, not a bound."""


class Outcome(Enum):
    """What became of one solve; the value is what a legend says."""

    RIGHT = "right answer"
    OTHER = "another true extremal"
    REFUSED = "refused, rightly"
    MISREASONED = "refused, wrong reason"
    MISSED = "refused, though there is an answer"
    SLOW = "too slow, or crashed"
    INAPPLICABLE = "does not apply"
    FALSE = "wrong answer called right"


@dataclass(frozen=True)
class Extremal:
    """The value of a true stationary curve, and whether it is a minimum (a local one counts)."""

    value: float
    minimum: bool


@dataclass(frozen=True)
class Truth:
    """All stationary values of a problem, and every verdict that may be stated of it truthfully."""

    extremals: tuple[Extremal, ...]
    verdicts: frozenset[vc.Verdict] = frozenset()

    @property
    def has_minimum(self) -> bool:
        """True when one of the extremals is a minimum."""
        return any(extremal.minimum for extremal in self.extremals)


@dataclass(frozen=True)
class Answer:
    """What a route said: ``value`` and ``claim`` where ``ok``, else the ``verdict`` and whether it applies at all."""

    ok: bool
    value: float = math.nan
    claim: float = math.inf
    verdict: vc.Verdict | None = None
    applies: bool = True
    message: str = ""
    status: str = ""


def judged(answer: Answer, truth: Truth, minimises: bool) -> tuple[Outcome, float]:
    """The outcome, and the distance from the nearest true value that would do (NaN without one).

    A route that minimises has to end at a minimum: a saddle, however exact, is a
    wrong answer of it. Of one that finds stationary curves, a minimum is the
    right answer where there is one, any other extremal is another true one.
    """
    if not answer.ok:
        return refused(answer, truth.has_minimum if minimises else bool(truth.extremals), truth.verdicts), math.nan
    near = sorted((abs(answer.value - e.value), e.minimum) for e in truth.extremals)
    # where a claim covers both, or neither, the nearer extremal is the one that was found
    claimed = [(error, minimum) for error, minimum in near if error <= MARGIN * answer.claim]
    minima = [pair for pair in claimed if pair[1]] or (claimed or near)[:1]
    if not minima or not met(answer, minima[0][0]) or (minimises and not minima[0][1]):
        return Outcome.FALSE, near[0][0] if near else math.nan
    error, minimum = minima[0]
    return (Outcome.RIGHT if minimum or not truth.has_minimum else Outcome.OTHER), error


def met(answer: Answer, error: float) -> bool:
    """True when an error is as small as the claim demands."""
    return error <= max(MARGIN * answer.claim, FLOOR * max(1.0, abs(answer.value)))


def refused(answer: Answer, exists: bool, verdicts: frozenset[vc.Verdict]) -> Outcome:
    """The outcome of a refusal, when an answer of the kind asked for ``exists`` or not."""
    if not answer.applies:
        return Outcome.INAPPLICABLE
    if answer.verdict is not None and answer.verdict not in verdicts:
        return Outcome.MISREASONED
    return Outcome.MISSED if exists else Outcome.REFUSED
