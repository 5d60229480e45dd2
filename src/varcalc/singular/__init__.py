"""Singular ends, found from what the Lagrangian does there, and the coordinates that remove them.

Two properties of L are detected numerically, never by its look: that L^2 is
a quadratic form in the slope (the length of a Riemannian metric; conformal
when L / sqrt(1 + y'^2) does not depend on y'), and that L is infinite at an
end. The length of a metric is minimised through its energy
(:mod:`varcalc.singular.energy`); for other Lagrangians abscissa and ordinate
become the powers that make the extremal analytic
(:mod:`varcalc.singular.powers`).
"""

from __future__ import annotations

from dataclasses import replace

from varcalc.conditions import Fixed, Free, OnCurve
from varcalc.formulation import Form, formulate
from varcalc.problem import Curve, Functional, Problem
from varcalc.singular.detection import Infinite, Metric, riemannian, singular_ends
from varcalc.singular.energy import energy_forms
from varcalc.singular.powers import power_form

__all__ = ["Infinite", "forms"]


def forms(problem: Functional) -> list[Form]:
    """The forms in which a problem is to be tried, the most promising first.

    Raises :class:`Infinite` when a singular end makes the functional infinite.
    """
    found = problem.built.get("forms")
    if found is None:
        found = problem.built["forms"] = _forms(problem)
    return [form if form.problem is problem else replace(form, problem=problem) for form in found]


def _forms(problem: Functional) -> list[Form]:
    direct = formulate(problem)
    if isinstance(problem, Curve):
        plain = problem.n == 2 and direct.energetic and direct.ends is None and not direct.pathwise
        singular = singular_ends(problem) if plain else (False, False)
        if not any(singular):
            return [direct]
        s = problem.symbols
        return [*energy_forms(problem, Metric(s.y, s.dy, problem.integrand**2), singular), direct]
    if not (isinstance(problem, Problem) and _simple(problem)):
        return [direct]
    singular = singular_ends(problem)
    both_fixed = isinstance(problem.start, Fixed) and isinstance(problem.end, Fixed)
    if not any(singular) and not both_fixed:
        return [direct]
    metric = riemannian(problem)
    if metric is not None:
        energies = energy_forms(problem, metric, singular)
        return [*energies, direct] if any(singular) else [direct, *energies]
    one = singular[0] != singular[1]
    return [power_form(problem, singular), direct] if one and both_fixed else [direct]


def _simple(problem: Problem) -> bool:
    """Whether other coordinates than the person's are available: one function, one end fixed at least."""
    ends = (problem.start, problem.end)
    some_fixed = any(isinstance(e, Fixed) for e in ends) and all(isinstance(e, Fixed | Free | OnCurve) for e in ends)
    bare = not (problem.constraints or problem.end_cost or problem.breakpoints or problem.maximise)
    return problem.n == 1 and problem.order == 1 and some_fixed and bare
