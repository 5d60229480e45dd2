"""Curves whose free end a kink of its cost holds, or leaves to one side, or a bound: |y(b) - c| may keep the end at c.

With the end given there the rest is a problem of its own. The end stays where it costs more on either side: where the
momentum is between the rates of the cost on both (the transversality condition as an inclusion; Clarke, "Optimization
and Nonsmooth Analysis", 1983, sect. 4.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.existence.rounded import rounded
from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.problem.breaks import kinks_at_ends
from varcalc.problem.conditions import Bound, Fixed
from varcalc.problem.end_cost import cost_along
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.switches import held
from varcalc.symbolic.tracing import Expression, TracedFunction

ASIDE = 1e-7
"""Distance from a kink, in units of the end's ordinates, at which it is seen that an end costs more there: so little
that a minimum within it differs by round-off.
"""
PLACES_TRIED = (0.0, 1.0, -1.0)
"""Ordinates, in the same units, from which a place where the cost switches is looked for."""
NEWTON_STEPS_TO_SWITCH, ON_SWITCH = 20, 1e-13
"""Steps of Newton's method, and the last one, in those units, with which it is found."""


def held_at_an_end(problem: Functional, solved: Callable[[Problem], Solution]) -> Solution | None:
    """The least curve whose free end a kink of its cost holds, or turns away; None where none of those has an answer.

    The problems with that end given, or with one branch of its cost, are to be ``solved``.

    One function of first order is looked at, with its abscissae given.
    """
    if not (isinstance(problem, Problem) and _may_be_given(problem)) or problem.end_cost_expression is None:
        return None
    ordinates = problem.end_cost_expression[0][1::2]
    found: list[Solution] = []
    for switch in kinks_at_ends(problem):
        moving = [k for k, y in enumerate(ordinates) if switch.depends_on(y)]
        if len(moving) != 1 or (problem.start, problem.end)[moving[0]].fixed:
            continue
        for place, unit in _places(problem, _to_switch(problem, switch.argument, moving[0]), moving[0]):
            found += _at_kink(problem, moving[0], place, ASIDE * unit, solved, switch.argument)
    return min(found, key=lambda s: problem.sign * s.value, default=None)


def held_by_a_bound(problem: Functional, solved: Callable[[Problem], Solution]) -> Solution | None:
    """The least curve of which a bound of the place holds a free end that would go beyond it; None for none.

    It is seen on a rough curve without that bound. The problems with that end given are to be ``solved``.
    """
    if not (isinstance(problem, Problem) and _may_be_given(problem)):
        return None
    free = [end for end, given in enumerate((problem.start, problem.end)) if not given.fixed]
    if not free or not (bounds := list(_of_place(problem))):
        return None
    kept = [c for c in problem.constraints if not any(c is bound for _, bound in bounds)]
    about = rounded(problem.restated(constraints=kept), None)
    if about is None or not about.stands:
        return None
    for end in free:
        reached = float(about.curve(np.array([problem.span[end]]), 0)[0, 0])
        if admitted(problem, end, reached):
            continue
        for of, level in ((of, level) for of, bound in bounds for level in bound.interval if np.isfinite(level)):
            for place, unit in _places(problem, _to_bound(problem, of, level, end), end):
                sides = [place + way * ASIDE * unit for way in (-1.0, 1.0)]
                inside = [y for y in sides if admitted(problem, end, y)]
                if len(inside) != 1:  # another bound is in the way
                    continue
                resting = solved(_pinned(problem, end, place))
                if resting.status.ok and _worse(solved(_pinned(problem, end, inside[0])), resting):
                    return _held_there(problem, resting, of)
    return None


def _held_there(problem: Problem, resting: Solution, surface: Expression) -> Solution:
    """The answer whose end is held on a surface; how it changes with what moves that is not known."""
    symbols = ca.vertsplit(problem.symbols.parameters)
    moved = {n: bool(ca.depends_on(surface, symbol)) for n, symbol in zip(problem.parameters, symbols, strict=True)}
    rates = {n: math.nan if moved[n] else rate for n, rate in resting.sensitivities.items()}
    return replace(resting, problem=problem, extremal=None, sensitivities=rates)


def _may_be_given(problem: Problem) -> bool:
    """Whether the ends of one function of first order are free at given abscissae, or given."""
    return problem.n == problem.order == 1 and not any(problem.slides) and not problem.start.periodic


def _of_place(problem: Problem) -> Iterator[tuple[Expression, Bound]]:
    """The bounds on the curve itself, and what they are of."""
    for traced in problem.traced:
        bound = traced.constraint
        moving = [ca.depends_on(traced.expression, v) for v in (problem.symbols.y, problem.symbols.dy)]
        if isinstance(bound, Bound) and bound.interval[0] < bound.interval[1] and moving == [True, False]:
            yield traced.expression, bound


def _at_kink(
    problem: Problem, end: int, place: float, aside: float, solved: Callable[[Problem], Solution], surface: Expression
) -> Iterator[Solution]:
    """The answer whose end is at a kink of its cost, where that holds it, or those that lie on better sides of it."""
    resting = solved(_pinned(problem, end, place)) if admitted(problem, end, place) else None
    if resting is None or not resting.status.ok:
        return
    holds = True
    for ordinate in (place - aside, place + aside):
        if not admitted(problem, end, ordinate):  # a bound holds it on that side
            continue
        other = solved(_pinned(problem, end, ordinate))
        holds = holds and _worse(other, resting)
        if _worse(resting, other) and (beside := _beside(problem, end, ordinate, solved)) is not None:
            yield beside
    if holds:
        yield _held_there(problem, resting, surface)


def _beside(problem: Problem, end: int, ordinate: float, solved: Callable[[Problem], Solution]) -> Solution | None:
    """The answer whose end is on one side of a kink of its cost, on which an ordinate is; None where it leaves that."""
    assert problem.end_cost_expression is not None
    (ends, cost), s = problem.end_cost_expression, problem.symbols
    symbols = [*ends, s.parameters, s.unknowns]
    point = _at_ends(problem, end, ordinate)
    numbers = [problem.parameter_values, problem.unknown_guesses]
    smooth = held([cost], symbols, [*(np.array([v]) for v in point), *numbers])[0]
    function = ca.Function("cost", symbols, [smooth])
    names = tuple(problem.parameters), tuple(problem.unknowns)
    solution = solved(problem.restated(end_cost=TracedFunction(function, names)))
    if not solution.status.ok or solution.curve is None:
        return None
    places = [v for x in problem.span for v in (x, float(solution.curve(np.array([x]), 0)[0, 0]))]
    numbers[1] = solution.unknown_values
    stated = problem.sign * cost_along(problem, solution.curve, problem.span, numbers[1])
    taken = float(function(*places, *numbers))
    if abs(stated - taken) > solution.error.value + ON_SWITCH * abs(stated):
        return None
    return replace(solution, problem=problem, extremal=None)


def _at_ends(problem: Problem, end: int, ordinate: float) -> list[float]:
    """Abscissae and ordinates of both ends, one of which is given."""
    others = [float(np.nan_to_num(side.values(1))[0]) for side in (problem.start, problem.end)]
    others[end] = ordinate
    return [problem.span[0], others[0], problem.span[1], others[1]]


def _worse(other: Solution, held: Solution) -> bool:
    """Whether an answer is worse than another by more than both may be off."""
    more = held.problem.sign * (other.value - held.value)
    return other.status.ok and more > other.error.value + held.error.value


def _to_switch(problem: Problem, argument: Expression, end: int) -> Callable[[float], float]:
    """Newton's step, from an ordinate of one end, to where an argument of the cost of both is zero."""
    assert problem.end_cost_expression is not None
    ends, s = problem.end_cost_expression[0], problem.symbols
    step = ca.Function("step", [*ends, s.parameters, s.unknowns], [argument / ca.gradient(argument, ends[1 + 2 * end])])

    def from_ordinate(y: float) -> float:
        return float(step(*_at_ends(problem, end, y), problem.parameter_values, problem.unknown_guesses))

    return from_ordinate


def _to_bound(problem: Problem, of: Expression, level: float, end: int) -> Callable[[float], float]:
    """The same to where what a bound is ``of`` is at a ``level``."""
    s = problem.symbols
    off = (of - level) / ca.gradient(of, s.y)
    step = ca.Function("step", [s.x, s.y, s.parameters, s.unknowns], [off])
    return lambda y: float(step(problem.span[end], y, problem.parameter_values, problem.unknown_guesses))


def _places(problem: Problem, step: Callable[[float], float], end: int) -> Iterator[tuple[float, float]]:
    """Ordinates of an end to which Newton's ``step`` leads, and a unit of them."""
    first = float(formulate(problem).start.curve(np.array([problem.span[end]]))[0, 0])
    unit = max(height(formulate(problem)), abs(first))
    known: list[float] = []
    for start in PLACES_TRIED:
        y, change = first + start * unit, np.inf
        for _ in range(NEWTON_STEPS_TO_SWITCH):
            change = step(y)
            if not np.isfinite(change) or abs(change) <= ON_SWITCH * max(unit, abs(y)):
                break
            y -= change
        if abs(change) <= ON_SWITCH * max(unit, abs(y)) and not any(abs(y - k) <= ASIDE * unit for k in known):
            known.append(y)
            yield y, max(unit, abs(y))


def admitted(problem: Problem, end: int, ordinate: float) -> bool:
    """Whether the bounds on the curve itself allow it to have an ordinate at one end."""
    s, at = problem.symbols, np.array([problem.span[end]])
    for traced in problem.traced:
        bound = traced.constraint
        if not isinstance(bound, Bound) or ca.depends_on(traced.expression, s.dy):
            continue
        known = at, np.array([ordinate]), problem.parameter_values, problem.unknown_guesses
        height = float(ca.Function("bound", [s.x, s.y, s.parameters, s.unknowns], [traced.expression])(*known))
        if not bound.interval[0] <= height <= bound.interval[1]:
            return False
    return True


def _pinned(problem: Problem, end: int, ordinate: float) -> Problem:
    """The problem with the ordinate of one end given."""
    given = Fixed(problem.span[end], ordinate)
    return problem.restated(start=given) if end == 0 else problem.restated(end=given)
