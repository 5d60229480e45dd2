"""Where the Lagrangian and the constraints of a problem stop being smooth, as its expressions say.

What switches on x alone switches at abscissae that can be found beforehand; what switches on the curve does so where
the curve comes by.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Bound, Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.joins import joined
from varcalc.symbolic.places import FINEST, places
from varcalc.symbolic.switches import SWITCHING, Switch, switches, tables
from varcalc.symbolic.tracing import Expression
from varcalc.symbolic.variation import gentle_across

BREAK_OFFSETS, GROWN = (1e-4, 1e-8), 1.5
"""Distances from a break, in units of the interval, and the ratio of what is found at both that is no limit."""
ABSCISSA = 0
"""The argument of L that is the abscissa."""


@derived
def whole(problem: Functional) -> ca.Function:
    """The Lagrangian and, after it, what the constraints are stated with, of all symbols: what is read."""
    return ca.Function("all", problem.symbols.all, _expressions(problem))


@derived
def integrals(problem: Functional) -> ca.Function:
    """What is integrated: the Lagrangian, and what is prescribed an integral."""
    if not problem.constraints:
        return whole(problem)
    levels = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    return ca.Function("integrals", problem.symbols.all, [problem.integrand, *levels])


@derived
def bounds(problem: Functional) -> ca.Function:
    """What is bounded all along the curve, one below the other."""
    held = [t.expression for t in problem.traced if isinstance(t.constraint, Bound)]
    return ca.Function("bounds", problem.symbols.all, [ca.densify(ca.vertcat(*held))])


def _expressions(problem: Functional) -> list[Expression]:
    return [problem.integrand, *(t.expression for t in problem.traced)]


@derived
def switches_of(problem: Functional) -> tuple[Switch, ...]:
    """All switches of the Lagrangian and the constraints."""
    if problem.symbols.kind is not ca.SX:
        return ()
    function = whole(problem)
    if SWITCHING.isdisjoint(map(function.instruction_id, range(function.n_instructions()))):
        return ()  # as in most problems, of which no more is read
    return switches(_expressions(problem), problem.symbols.all)


@derived
def kinked_table(problem: Functional) -> Switch | None:
    """A table that is straight between its knots, and is looked up where the curve goes; None where there is none."""
    if problem.symbols.kind is not ca.SX:
        return None
    stated, symbols = ca.vertcat(*(ca.vec(e) for e in _expressions(problem))), ca.vertcat(*problem.symbols.all)
    return next((t for t in tables(stated, symbols) if not t.smooth and not along_x(problem, t)), None)


def along_x(problem: Functional, switch: Switch) -> bool:
    """Whether a switch is a matter of the abscissa alone (of the parameter, for a Curve)."""
    s = problem.symbols
    return not switch.depends_on(ca.vertcat(s.y, s.dy, s.ddy, s.unknowns))


@derived
def on_curve(problem: Functional) -> tuple[Switch, ...]:
    """The switches that are a matter of where the curve goes; with an end that slides all are."""
    here = [s for s in switches_of(problem) if any(problem.slides) or not along_x(problem, s)]
    return joined(_expressions(problem), problem.symbols.all, here) if here else ()


@derived
def kinks_at_ends(problem: Functional) -> tuple[Switch, ...]:
    """The kinks and jumps of the cost of the ends."""
    if problem.end_cost_expression is None or problem.symbols.kind is not ca.SX:
        return ()
    ends, cost = problem.end_cost_expression
    symbols = [*ends, problem.symbols.parameters, problem.symbols.unknowns]
    found = joined([cost], symbols, switches([cost], symbols))
    return tuple(switch for switch in found if not switch.smooth)


def breakable(problem: Functional) -> bool:
    """Whether a problem has switches on the curve, and is a graph whose curves can be broken there."""
    return bool(on_curve(problem)) and isinstance(problem, Problem) and not any(problem.slides)


def breaks(problem: Functional) -> tuple[float, ...]:
    """The abscissae inside the interval where something switches, whatever the curve: those given, and those read.

    Where there are too many of them to be placed (:func:`crowded`), or an end slides, those that are read are left out.
    """
    known = _placed(problem)
    return known if isinstance(known, tuple) else problem.breakpoints


@derived
def uneven(problem: Problem) -> bool:
    """Whether L of a graph of one function may be narrow, or jump, along x where a curve need not go."""
    s = problem.symbols
    if problem.n > 1 or problem.order > 1 or s.kind is not ca.SX or problem.unknowns:
        return False
    if not (ca.depends_on(problem.integrand, s.x) and ca.depends_on(problem.integrand, s.y)):
        return False
    return bool(problem.breakpoints or switches_of(problem)) or not gentle_across(integrals(problem), ABSCISSA)


@derived
def moving_breaks(problem: Functional) -> bool:
    """Whether a parameter moves an abscissa at which something switches, whatever the curve."""
    return any(along_x(problem, s) and s.depends_on(problem.symbols.parameters) for s in switches_of(problem))


def singular_inside(problem: Problem) -> float | None:
    """A break at which what L feels of the slope of one function tends to zero or infinity; None where there is none.

    No polynomial on either side of it resolves a curve there.
    """
    places = np.array(breaks(problem))
    if problem.n > 1 or problem.order > 1 or not len(places):
        return None
    width = problem.span[1] - problem.span[0]
    sides = np.concatenate([places + side * near * width for near in BREAK_OFFSETS for side in (-1.0, 1.0)])
    y = np.interp(sides, problem.span, np.nan_to_num([e.values(1)[0] for e in (problem.start, problem.end)]))
    slopes = np.array([-1.0, 0.0, 1.0])
    values = problem.integrand_values(
        np.repeat(sides, 3), np.repeat(y, 3)[None], np.tile(slopes, len(sides))[None]
    ).reshape(-1, 3)
    with np.errstate(all="ignore"):
        bend = np.abs(values @ np.array([1.0, -2.0, 1.0])).reshape(2, 2, -1)
        grown = bend[1] / bend[0]
    bad = (~((grown < GROWN) & (grown > 1 / GROWN))).any(0) & (bend[0] > 0).any(0)
    return float(places[np.argmax(bad)]) if bad.any() else None


def crowded(problem: Functional) -> Switch | None:
    """A switch along x that switches too often for a mesh to be broken at each place; None where there is none."""
    known = _placed(problem)
    return known if isinstance(known, Switch) else None


def _placed(problem: Functional) -> tuple[float, ...] | Switch | None:
    """All abscissae, or the switch that has too many; None where nothing is read along x."""
    read = [s for s in switches_of(problem) if along_x(problem, s)]
    if not read or any(problem.slides):
        return None
    return _placed_at(problem, problem.span, tuple(problem.parameters.values()))


@derived
def _placed_at(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> tuple[float, ...] | Switch:
    found = list(problem.breakpoints)
    for switch in switches_of(problem):
        if along_x(problem, switch):
            here = places(switch, problem.symbols.x, span, found, problem.symbols.parameters, values)
            if here is None:
                return switch
            found += [x for x in here if not any(abs(x - y) <= FINEST * (span[1] - span[0]) for y in found)]
    return tuple(sorted(x for x in found if span[0] < x < span[1]))
