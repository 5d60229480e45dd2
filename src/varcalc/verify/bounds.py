"""The functional once more on the solution's own curve: an upper bound of a minimum.

Whatever the curve, if it meets the ends and the conditions, the least value is
not above that of the functional on it.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.methods.answer import composite_gauss, functional_value, sample
from varcalc.verify.trial import Trial

POINTS = 64
"""Gauss points an element: a finer rule than any method's."""


def bound(trial: Trial) -> float:
    """The functional on the solution's own curve; its value as reported where that curve is in singular coordinates."""
    if trial.own is None:
        return trial.solution.value
    value = functional_value(trial.own, POINTS)
    return value if math.isfinite(value) else trial.solution.value


def misses(trial: Trial) -> dict[int, float]:
    """By how much the curve misses each prescribed integral, relative to max(1, level), by number of constraint."""
    own = trial.own
    if own is None or not own.form.integrals:
        return {}
    s, weights = composite_gauss(own.vertices, POINTS)
    function = ca.Function("g", own.form.symbols.all, [ca.vertcat(*(c.expression for c in own.form.integrals))])
    integrals = np.asarray(function(*sample(own, s))) @ weights
    out = {}
    for condition, integral in zip(own.form.integrals, integrals, strict=True):
        beyond = max(condition.lower - integral, integral - condition.upper, 0.0)
        out[condition.index] = float(beyond) / max(1.0, abs(integral))
    return out
