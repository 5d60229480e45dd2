"""The form in which a problem is solved: coordinates, gauge, ends and side conditions.

Methods never look at a :class:`Problem` directly. They are given a
:class:`Form`: an integrand on a fixed interval of a reference variable s, a
number of unknown functions and of unknown numbers, and conditions on them. An
abscissa that slides, a curve that is no graph, a maximum, a singular end are
all turned into that one shape here (and in :mod:`varcalc.formulation.singular`), so that no
method knows of them.
"""

from __future__ import annotations

from varcalc.formulation.broken import Contact, Refraction, Ride, broken_form
from varcalc.formulation.curve import curve_form
from varcalc.formulation.form import (
    Conditions,
    Coordinates,
    Elsewhere,
    EndConditions,
    Ends,
    Form,
    Sampled,
    SideCondition,
    Start,
    Stated,
    StatedLater,
    Waypoints,
    arched,
    conditions_of,
    end_conditions,
    extended,
    rewriter,
    straight,
    through,
)
from varcalc.formulation.graph import graph_form, guessed_abscissae, on_curve, sliding_abscissae, sliding_form
from varcalc.formulation.numbers import AtPoints, Numbers, Reported
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem

__all__ = [
    "AtPoints",
    "Conditions",
    "Contact",
    "Coordinates",
    "Elsewhere",
    "EndConditions",
    "Ends",
    "Form",
    "Numbers",
    "Refraction",
    "Reported",
    "Ride",
    "Sampled",
    "SideCondition",
    "Start",
    "Stated",
    "StatedLater",
    "Waypoints",
    "arched",
    "broken_form",
    "conditions_of",
    "end_conditions",
    "extended",
    "formulate",
    "guessed_abscissae",
    "on_curve",
    "rewriter",
    "sliding_abscissae",
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
