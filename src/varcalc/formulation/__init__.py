"""The form in which a problem is solved: coordinates, gauge, ends and side conditions.

Methods never look at a :class:`Problem` directly. They are given a
:class:`Form`: an integrand on a fixed interval of a reference variable s, a
number of unknown functions and of unknown numbers, and conditions on them. An
abscissa that slides, a curve that is no graph, a maximum, a singular end are
all turned into that one shape here (and in :mod:`varcalc.formulation.singular`), so that no
method knows of them.
"""

from __future__ import annotations

from varcalc.formulation.broken import Contact, broken_form
from varcalc.formulation.curve import curve_form
from varcalc.formulation.form import (
    Elsewhere,
    EndConditions,
    Form,
    Sampled,
    SideCondition,
    Stated,
    StatedLater,
    arched,
    end_conditions,
    extended,
    rewriter,
    side_conditions,
    straight,
    through,
)
from varcalc.formulation.graph import graph_form, on_curve, sliding_form
from varcalc.formulation.numbers import AtPoints, Numbers, Reported
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem

__all__ = [
    "AtPoints",
    "Contact",
    "Elsewhere",
    "EndConditions",
    "Form",
    "Numbers",
    "Reported",
    "Sampled",
    "SideCondition",
    "Stated",
    "StatedLater",
    "arched",
    "broken_form",
    "end_conditions",
    "extended",
    "formulate",
    "on_curve",
    "rewriter",
    "side_conditions",
    "straight",
    "through",
]


def formulate(problem: Functional) -> Form:
    """The direct form of a problem, without regard to singular ends."""
    if isinstance(problem, Curve):
        return curve_form(problem)
    if not isinstance(problem, Problem):
        raise TypeError(f"problem must be a Problem or a Curve, not {problem!r}")
    if any(problem.slides):
        return sliding_form(problem)
    return graph_form(problem)
