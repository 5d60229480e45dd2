"""The functional on the solution's own curve, a bound of the extreme value, if the curve keeps its levels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.methods.answer import functional_value, sample
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import Isoperimetric
from varcalc.solution import Finding
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check

FINE_RULE = 64
"""Gauss points an element: a finer rule than any method's."""
LEVEL_MISSED = 1e-6
"""Relative distance from a prescribed integral's level that is worth a word."""


@dataclass(frozen=True)
class ValueBound:
    """The functional on a curve, and by how much that misses each prescribed integral, relative to max(1, level).

    ``misses`` go by the number of the constraint.
    """

    value: float
    misses: dict[int, float]


@dataclass(frozen=True)
class Value(Check[ValueBound]):
    """The functional on the curve, by a finer rule than that of any method."""

    name = "functional"

    def measure(self, candidate: Candidate) -> ValueBound:
        """The value as reported where the curve is in singular coordinates."""
        own, reported = candidate.own, candidate.solution.value
        if own is None:
            return ValueBound(reported, {})
        value = functional_value(own, FINE_RULE)
        return ValueBound(value if math.isfinite(value) else reported, _misses(candidate))

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """The bound, and every level that is missed."""
        measured = candidate.measured(self)
        problem = candidate.problem
        side, kind = ("a lower", "maximum") if problem.maximise else ("an upper", "minimum")
        sentence = f"the functional is {measured.value:.15g} on this curve, {side} bound of the {kind}"
        yield Finding(None, sentence, {"bound": measured.value})
        for number, miss in measured.misses.items():
            if miss > LEVEL_MISSED and isinstance(problem.constraints[number], Isoperimetric):
                sentence = f"constraints[{number}] is missed by {miss:.2g} of its level, so the bound is none"
                yield Finding(None, sentence, {"miss": miss})


def _misses(candidate: Candidate) -> dict[int, float]:
    own = candidate.own
    if own is None or not own.form.conditions.integrals:
        return {}
    s, weights = composite_gauss(own.vertices, FINE_RULE)
    function = ca.Function(
        "g", own.form.symbols.all, [ca.vertcat(*(c.expression for c in own.form.conditions.integrals))]
    )
    integrals = np.asarray(function(*sample(own, s))) @ weights
    out = {}
    for condition, integral in zip(own.form.conditions.integrals, integrals, strict=True):
        beyond = max(condition.lower - integral, integral - condition.upper, 0.0)
        out[condition.index] = float(beyond) / max(1.0, abs(integral))
    return out
