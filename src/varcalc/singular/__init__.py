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

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from varcalc.conditions import Fixed, Free, OnCurve
from varcalc.formulation import Form, formulate
from varcalc.functional import Functional
from varcalc.problem import Curve, Problem
from varcalc.singular.detection import Infinite, Metric, riemannian, singular_ends
from varcalc.singular.energy import energy_forms
from varcalc.singular.powers import power_form

__all__ = ["Forms", "Infinite", "forms"]


class Forms(Sequence[Form]):
    """The forms in which a problem is to be tried, the most promising first, each made when it is asked for."""

    def __init__(self, makers: Sequence[Callable[[], Form]], problem: Functional, made: dict[int, Form]) -> None:
        self._makers, self._problem, self._made = makers, problem, made

    def __len__(self) -> int:
        return len(self._makers)

    def __getitem__(self, index: Any) -> Any:
        if index not in range(len(self._makers)):
            raise IndexError(index)
        if index not in self._made:
            self._made[index] = self._makers[index]()
        form = self._made[index]
        return form if form.problem is self._problem else replace(form, problem=self._problem)


def forms(problem: Functional) -> Forms:
    """The forms in which a problem is to be tried, the most promising first.

    Raises :class:`Infinite` when a singular end makes the functional infinite.
    """
    if "forms" not in problem.built:
        problem.built["forms"] = (_makers(problem), {})
    makers, made = problem.built["forms"]
    return Forms(makers, problem, made)


def _makers(problem: Functional) -> list[Callable[[], Form]]:
    direct = partial(formulate, problem)
    if isinstance(problem, Curve):
        plain = problem.n == 2 and not problem.constraints and problem.end_cost is None and not problem.maximise
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
    return [partial(power_form, problem, singular), direct] if one and both_fixed else [direct]


def _simple(problem: Problem) -> bool:
    """Whether other coordinates than the person's are available: one function, one end fixed at least."""
    ends = (problem.start, problem.end)
    some_fixed = any(isinstance(e, Fixed) for e in ends) and all(isinstance(e, Fixed | Free | OnCurve) for e in ends)
    bare = not (problem.constraints or problem.end_cost or problem.breakpoints or problem.maximise)
    return problem.n == 1 and problem.order == 1 and some_fixed and bare
