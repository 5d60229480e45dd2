"""Inequalities that bind nothing: the minimum without them is looked for first, and counts where it keeps them.

A minimum over more curves that is one of fewer is their minimum, and without inequalities Newton's iteration finds it,
which does not leave the valley that it begins in as an interior-point method may.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import Extremal, multipliers, sample
from varcalc.numerics.mesh import composite_gauss, subdivided
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache, derived

KEPT = 1e-9
"""Relative amount by which an inequality may be missed by a curve that is said to keep it."""
AN_ELEMENT = 64
"""Points an element at which bounds are asked, and of the rule that sums what has a level."""


def without_inequalities(form: Form) -> Form:
    """The form with its equations alone."""
    conditions = replace(
        form.conditions,
        integrals=tuple(c for c in form.conditions.integrals if c.equality),
        pathwise=tuple(c for c in form.conditions.pathwise if c.equality),
    )
    # what is derived from the form holds for its own conditions only
    return replace(form, conditions=conditions, cache=_of_equations(form))


@derived
def _of_equations(form: Form) -> Cache:
    """What is derived from the form without its inequalities, wherever it is solved."""
    return Cache()


def kept(form: Form, found: Solution) -> Solution | None:
    """An answer to :func:`without_inequalities` as one to ``form``; None where it misses an inequality."""
    free = found.extremal
    if free is None or not (within_bounds(form, free) and _within_levels(form, free)):
        return None
    equations = iter(free.lambdas)
    lambdas = np.array([next(equations) if c.equality else 0.0 for c in form.conditions.integrals])
    slack = {c.index: np.zeros_like for c in form.conditions.pathwise if not c.equality}
    extremal = replace(free, form=form, lambdas=lambdas, path={**free.path, **slack})
    return replace(found, extremal=extremal, multipliers=multipliers(extremal))


def within_bounds(form: Form, free: Extremal) -> bool:
    """Whether an extremal keeps the bounds of a form in whose coordinates it is."""
    bounds = [c for c in form.conditions.pathwise if not c.equality]
    if not bounds:
        return True
    s = subdivided(free.vertices, AN_ELEMENT)
    function = ca.Function("bounds", form.symbols.all, [ca.densify(ca.vertcat(*(c.expression for c in bounds)))])
    values = np.asarray(function(*sample(free, s)))
    for row, c in zip(values, bounds, strict=True):
        asked = row if c.where is None else row[(s >= c.where[0]) & (s <= c.where[1])]
        if not _between(asked, np.abs(row).max(), *c.bounds):
            return False
    return True


def _within_levels(form: Form, free: Extremal) -> bool:
    levels = [c for c in form.conditions.integrals if not c.equality]
    if not levels:
        return True
    s, weights = composite_gauss(free.vertices, AN_ELEMENT)
    function = ca.Function("levels", form.symbols.all, [ca.densify(ca.vertcat(*(c.expression for c in levels)))])
    values = np.asarray(function(*sample(free, s)))
    return all(_between(row @ weights, np.abs(row) @ weights, *c.bounds) for row, c in zip(values, levels, strict=True))


def _between(values: np.ndarray | float, size: float, lower: float, upper: float) -> bool:
    room = KEPT * size
    return bool(np.all((values >= lower - room) & (values <= upper + room)))
