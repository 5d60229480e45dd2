"""Inequalities along a curve: which are active, and the form without those that are not."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.methods.answer import Extremal, composite_gauss, sample
from varcalc.symbolic.derived import Cache
from varcalc.verify.setting import Setting

TOUCH = 1e-7
"""Relative distance from a bound within which it is touched."""
NEAR = 1e-3
"""The same where what matters is that the bound may be touched: between the nodes at which it is imposed."""


def touches(extremal: Extremal) -> bool:
    """Whether a Bound is active somewhere along the curve."""
    form = extremal.form
    bounds = [c for c in form.pathwise if not c.equality]
    if not bounds:
        return False
    s = composite_gauss(extremal.vertices, 16)[0]
    function = ca.Function("h", form.symbols.all, [ca.vertcat(*(c.expression for c in bounds))])
    values = np.asarray(function(*sample(extremal, s)))
    limits = np.array([[c.lower, c.upper] for c in bounds])
    room = TOUCH * np.maximum(1.0, np.abs(values))
    return bool(((values <= limits[:, :1] + room) | (values >= limits[:, 1:] - room)).any())


def touched(along: Setting, s: np.ndarray) -> np.ndarray:
    """Whether an inequality is active at s (m,)."""
    limits = [(k, c) for k, c in enumerate(along.limits) if not c.equality]
    if not along.paths or not limits:
        return np.zeros(len(s), dtype=bool)
    values = along.function(ca.vertcat(*(along.paths[k] for k, _ in limits)))(s)[0][:, :, 0]
    room = NEAR * np.maximum(1.0, np.abs(values))
    low, high = np.array([c.lower for _, c in limits]), np.array([c.upper for _, c in limits])
    return np.any((values <= low + room) | (values >= high - room), axis=1)


def without_inequalities(extremal: Extremal) -> Extremal:
    """The extremal of the same form with every inequality left out, or turned into an equality where it is active."""
    form = extremal.form
    if not form.has_inequalities:
        return extremal
    pathwise = tuple(c for c in form.pathwise if c.equality)
    kept, lambdas = [], []
    for condition, multiplier in zip(form.integrals, extremal.lambdas, strict=True):
        if condition.equality:
            kept.append(condition)
        elif abs(multiplier) > TOUCH:
            # with L + lambda g a positive multiplier pushes the integral down: it is at its upper level
            level = condition.upper if multiplier > 0 else condition.lower
            kept.append(replace(condition, lower=level, upper=level))
        else:
            continue
        lambdas.append(float(multiplier))
    # what is derived from the form holds for its own conditions only
    bare = replace(form, integrals=tuple(kept), pathwise=pathwise, cache=Cache())
    return replace(extremal, form=bare, lambdas=np.array(lambdas))
