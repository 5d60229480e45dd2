"""Singular ends, found from what the Lagrangian does there, and the coordinates that remove them.

Two properties of L are detected numerically, never by its look: that L^2 is
a quadratic form in the slope (the length of a Riemannian metric; conformal
when L / sqrt(1 + y'^2) does not depend on y'), and that L is infinite at an
end. The length of a metric is minimised through its energy
(:mod:`varcalc.formulation.singular.energy`); for other Lagrangians abscissa and ordinate
become the powers that make the extremal analytic
(:mod:`varcalc.formulation.singular.powers`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Elsewhere, Form, formulate
from varcalc.formulation.singular.abscissa import abscissa_form, free_end_form
from varcalc.formulation.singular.added import added_derivative, added_to, without
from varcalc.formulation.singular.alike import alike, ends_at, energetic_at
from varcalc.formulation.singular.departure import departure
from varcalc.formulation.singular.detection import (
    Blowup,
    Infinite,
    Survey,
    almost_singular_ends,
    blowup,
    blowup_beyond,
    grows,
    homogeneous,
    singular_ends,
)
from varcalc.formulation.singular.edge import edge_form
from varcalc.formulation.singular.energy import Energy, energy_forms
from varcalc.formulation.singular.graph import applies, factored_graph
from varcalc.formulation.singular.indicial import infinite_at, momenta_beside_ends, regular, unfelt
from varcalc.formulation.singular.inside import inside_form
from varcalc.formulation.singular.powers import power_form
from varcalc.formulation.singular.units import in_unit, restated
from varcalc.problem.breaks import breaks, moving_breaks, singular_inside
from varcalc.problem.convexity import proved_quadratic
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.symbolic.derived import derived

__all__ = ["Forms", "Infinite", "forms", "of_constant_speed"]


Makers = Sequence[partial[Form] | partial[Form | None]]
"""Functions that make the forms of one problem."""
UNLIKE = 8.0
"""Ratio, either way, of the unit of y that is natural and that of x, from which a problem is stated in the former."""


class Forms(Sequence[Form | None]):
    """The forms in which a problem is to be tried, the most promising first, each made when it is asked for.

    An entry is None where a form turns out to be no different from the others.
    """

    def __init__(self, makers: Makers, problem: Functional, made: dict[int, Form | None]) -> None:
        self._makers, self._problem, self._made = makers, problem, made

    def __len__(self) -> int:
        return len(self._makers)

    @property
    def singular(self) -> bool:
        """Whether an end is singular in any of the forms; one that is told not to have any is not made for this."""
        for index, maker in enumerate(self._makers):
            energy = maker.args[0] if maker.args else None
            told = isinstance(energy, Energy) and not any(energy.singular)
            form = None if told else self[index]
            if form is not None and any(form.coordinates.singular):
                return True
        return False

    def __getitem__(self, index: Any) -> Any:
        if index not in range(len(self._makers)):
            raise IndexError(index)
        if index not in self._made:
            self._made[index] = self._makers[index]()
        form = self._made[index]
        return form if form is None or form.problem is self._problem else replace(form, problem=self._problem)


def forms(problem: Functional) -> Forms:
    """The forms in which a problem is to be tried, the most promising first.

    Raises :class:`Infinite` when a singular end makes the functional infinite.
    """
    # singular ends are found from numbers, so other parameter values may have other forms
    makers, made = _forms_at(problem, tuple(problem.parameters.values()))
    return Forms(makers, problem, made)


def of_constant_speed(problem: Problem) -> Form | None:
    """The energy of a metric in the person's own coordinates; None for a functional that is no metric's length."""
    metric = Survey(problem).metric if _simple(problem) and problem.start.fixed and problem.end.fixed else None
    return None if metric is None else energy_forms(problem, metric, (False, False), {})[0]()


def number_of(form: Form) -> int | None:
    """Which of the forms of its problem a form is; None for one that was made in the course of a solve."""
    among = enumerate(forms(form.problem))
    return next((k for k, f in among if f is not None and f.cache is form.cache and f.span == form.span), None)


@derived
def _forms_at(problem: Functional, values: tuple[float, ...]) -> tuple[Makers, dict[int, Form | None]]:
    """What makes the forms at the ``values`` of the parameters, and the forms made by now."""
    return _makers(problem), {}


def _direct(problem: Functional) -> Form:
    """The direct form, the same for all values of the parameters that move no end and no place where L switches."""
    moved = tuple(problem.parameters[name] for name in sorted(problem.end_parameters))
    return _direct_at(problem, moved, breaks(problem) if moving_breaks(problem) else ())


@derived
def _direct_at(problem: Functional, moved: tuple[float, ...], knots: tuple[float, ...]) -> Form:
    return _formulated(problem)


def _formulated(problem: Functional) -> Form:
    form = formulate(problem)
    if isinstance(problem, Curve):
        movable = form.coordinates.energetic and form.ends.joint is None
        places = Elsewhere(partial(_along_curve, problem), _formulated, partial(energetic_at, problem))
        return replace(form, elsewhere=places) if movable else form
    if not isinstance(problem, Problem) or form.stated.is_lifted or moving_breaks(problem):
        return form

    def placed(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        points = ends_at(problem, values)
        return points[:, :, 0], points[:, 0, 1:], points[:, 1, 1:]

    def regular(values: np.ndarray) -> np.ndarray:
        return alike(problem, values, {}, False)

    return replace(form, elsewhere=Elsewhere(placed, _formulated, regular))


def _along_curve(problem: Curve, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The span of the parameter and the ends of a Curve at ``values``; see :class:`Elsewhere`."""
    points = ends_at(problem, values)
    return np.tile(problem.span, (len(values), 1)), points[:, 0], points[:, 1]


def _makers(problem: Functional) -> Makers:
    direct = partial(_direct, problem)
    curve = isinstance(problem, Curve)
    if not (_plain(problem) if curve else isinstance(problem, Problem) and _simple(problem)):
        return _with_more(problem)
    seen = Survey(problem) if isinstance(problem, Problem) else None
    singular = singular_ends(problem) if seen is None else seen.singular
    beyond = almost_singular_ends(problem) if seen is None else seen.beyond
    both_fixed = problem.start.fixed and problem.end.fixed
    if isinstance(problem, Problem) and any(singular) and proved_quadratic(problem):
        _refuse_infinite(problem)
    if not (any(singular) or any(beyond) or both_fixed):
        return _beside_a_free_end(problem) if isinstance(problem, Problem) else [direct]
    if seen is not None and (inner := _of_restated(seen.problem, seen, both_fixed=both_fixed)) is not None:
        return inner
    metric = homogeneous(problem) if seen is None else seen.metric
    if metric is None:
        if not (isinstance(problem, Problem) and both_fixed):
            return _with_more(problem) if any(singular) else [direct]
        return _of_no_metric(problem, singular)
    blowups = _blowups(problem, singular, beyond)
    others = energy_forms(problem, metric, singular, blowups) if blowups or not curve else []
    return [*others, direct] if blowups else [direct, *others]


def _of_restated(problem: Problem, seen: Survey, *, both_fixed: bool) -> Makers | None:
    """The forms of the problem without what is added to its L, or in the unit of y that is natural; None elsewhere."""
    bare = seen.metric is not None or not both_fixed or not any(seen.singular + seen.beyond)
    added = None if bare else added_derivative(problem)
    if added is not None:
        inner, own = without(problem, added), partial(added_to, problem, added)
    elif seen.unit is not None and not 1 / UNLIKE < seen.unit < UNLIKE:
        unit = seen.unit * (Survey(restated(problem, seen.unit)).unit or 1.0)  # what rounding left of it in the first
        inner, own = restated(problem, unit), partial(in_unit, problem, unit)
    else:
        return None
    return [partial(_direct, problem) if maker.func is _direct else partial(own, maker) for maker in _makers(inner)]


def _beside_a_free_end(problem: Problem) -> Makers:
    """Forms of a graph with one free end, beside which L may be singular in x."""
    direct = partial(_direct, problem)
    felt = not any(problem.slides) and ca.depends_on(problem.integrand, problem.symbols.x)
    return [partial(free_end_form, problem), direct] if felt else [direct]


def _refuse_infinite(problem: Problem) -> None:
    """Raises Infinite where L is of second degree and infinite beside the ordinate of an end, whatever the curve."""
    end = infinite_at(problem)
    if end is not None:
        raise Infinite(
            f"L has no finite integral beside the ordinate of the {end}, so the functional is infinite for every curve "
            "that ends there; leave that end free, or give it the ordinate at which L is finite"
        )


def _with_more(problem: Functional) -> Makers:
    """Forms where more is asked than a curve between two ends: powers of a parameter, which carry it all along.

    Powers of the distance from places inside where L is singular, too.
    """
    direct = partial(_direct, problem)
    known = singular_ends(problem)
    bad = tuple(here and grows(problem, at_start) for here, at_start in zip(known, (True, False), strict=True))
    if not any(bad):
        if isinstance(problem, Problem) and not any(problem.slides) and singular_inside(problem) is not None:
            return [partial(inside_form, problem), direct]
        return [direct]
    refused = partial(_refused, direct, "start" if bad[0] else "end")
    if not (isinstance(problem, Problem) and applies(problem)):
        return [refused]
    first, last = (
        departure(problem, at_start) if here else None for here, at_start in zip(bad, (True, False), strict=True)
    )
    if (bad[0] and first is None) or (bad[1] and last is None):
        return [refused]
    return [partial(factored_graph, problem, (first, last)), refused]


def _refused(direct: Callable[[], Form], end: str) -> Form:
    """The direct form, marked as one that nothing which samples L at the singular end can resolve."""
    return replace(
        direct(),
        refused=f"the Lagrangian is infinite at the {end}, and for what this problem asks no coordinates are known "
        f"that remove it; move the {end} off the place where it is infinite, or drop constraints",
    )


def _blowups(problem: Functional, singular: tuple[bool, bool], beyond: tuple[bool, bool]) -> dict[bool, Blowup | None]:
    """How the metric blows up at the start (True) and the end (False), as far as it does.

    Ends with a line just beyond them on which it is infinite are among them.
    """
    found: dict[bool, Blowup | None] = {}
    for at_start, here, outside in zip((True, False), singular, beyond, strict=True):
        line = blowup_beyond(problem, at_start) if outside else None
        if here or line is not None:
            found[at_start] = line or blowup(problem, at_start)
    return found


def _of_no_metric(problem: Problem, singular: tuple[bool, bool]) -> Makers:
    """Forms for a Lagrangian that is no metric: powers of the abscissa, of both coordinates, or beside an edge."""
    direct, in_x = partial(_direct, problem), partial(abscissa_form, problem)
    momenta = momenta_beside_ends(problem)
    if not any(singular) and regular(momenta):
        bare = (False, False) if ca.depends_on(problem.integrand, problem.symbols.x) else unfelt(momenta)
        return [partial(power_form, problem, bare), direct] if bare[0] != bare[1] else [direct]
    powers = [partial(power_form, problem, singular)] if singular[0] != singular[1] else []
    return [in_x, partial(edge_form, problem), *powers, direct]


def _plain(problem: Functional) -> bool:
    """Whether a Curve has nothing but its ends."""
    return problem.n == 2 and not (problem.constraints or problem.end_cost)


def _simple(problem: Problem) -> bool:
    """Whether other coordinates than the person's are available: one function, one end fixed at least."""
    ends = (problem.start, problem.end)
    some_fixed = any(e.fixed for e in ends) and not any(e.periodic for e in ends)
    bare = not (problem.constraints or problem.end_cost or breaks(problem))
    return problem.n == 1 and problem.order == 1 and some_fixed and bare
