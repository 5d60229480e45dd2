"""Problems that are convex as a whole: an extremal of one is a least curve among all that are admissible.

The functional is convex where its Lagrangian is jointly convex in the curve and its slopes (Troutman, "Variational
Calculus and Optimal Control", ch. 3), and the curves that are admissible are a convex set where the constraints that
hold are affine and those that bound are convex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi as ca

from varcalc.problem.breaks import whole
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric
from varcalc.problem.end_cost import end_cost
from varcalc.problem.functional import Functional, Traced
from varcalc.problem.problem import Curve, Problem
from varcalc.symbolic.convexity import Entry, Shape, log_convex_where_positive, shapes
from varcalc.symbolic.derived import derived
from varcalc.symbolic.separation import separates

SURELY_HELD = 1e-8
"""Multiplier of a level that surely has its sign."""
IN_ANOTHER_ORDINATE = "in the ordinate z = ∫ f(y) dy and its slope, with L = f(y) h(y')"
"""In what :func:`proved_in_another_ordinate` proves L convex."""


def proved_jointly_convex(problem: Functional) -> bool:
    """Whether a problem is proved convex at its parameters' values: its functional, and what it is made least over.

    It is meant for all curves at once, and for the unknowns with them; concave, for a functional to be made greatest.
    False says that there is no proof, not that there is no convexity.
    """
    if any(problem.slides) or problem.symbols.kind is not ca.SX:
        return False
    return _proved(problem, problem.span, tuple(problem.parameters.values()))


def proved_least(problem: Functional) -> bool:
    """Whether an extremal is proved least of all curves, or greatest: L is convex in y, or in another ordinate."""
    return proved_jointly_convex(problem) or proved_in_another_ordinate(problem)


def end_cost_proved_convex(problem: Functional) -> bool:
    """Whether what the ends cost is proved convex in where the curve meets them, or concave, as the functional is made.

    Ends that cost nothing are.
    """
    shape = _shape_of_end_cost(problem, problem.span, [[*problem.parameters.values()], [None] * len(problem.unknowns)])
    return shape is None or (shape.concave if problem.maximise else shape.convex)


def proved_with_levels(problem: Functional, multipliers: Sequence[Any]) -> bool:
    """Whether an extremal is least because L, less each level times its one of the ``multipliers``, is proved convex.

    One multiplier a constraint is that of the extremal. What keeps the levels then sums no less than the extremal, as
    it would without them (weak duality: Luenberger, "Optimization by Vector Space Methods", ch. 8).
    """
    if any(problem.slides) or problem.symbols.kind is not ca.SX or problem.end_cost_expression is not None:
        return False
    held = dict(zip(map(id, problem.constraints), multipliers, strict=False))  # waypoints have none, and are not traced
    levels = [(t, held.get(id(t.constraint))) for t in problem.traced if _is_level(t)]
    if not levels or len(levels) < len(problem.traced):
        return False
    sure = [(t, m) for t, m in levels if isinstance(m, float | int) and abs(m) >= SURELY_HELD]
    if len(sure) < len(levels):
        return False
    s = problem.symbols
    summed = problem.integrand - sum(m * t.expression for t, m in sure)
    curve: list[list[Entry]] = [[None] * symbol.numel() for symbol in (s.y, s.dy, s.ddy)]
    entries = [[problem.span], *curve, [*problem.parameters.values()], [None] * s.unknowns.numel()]
    ((shape,),) = shapes(ca.Function("L", s.all, [summed]), [list(row) for row in entries])
    return shape.concave if problem.maximise else shape.convex


def proved_in_another_ordinate(problem: Functional) -> bool:
    """Whether L = f(y) h(y'), h² = c + k y'² with c and k not negative, is proved convex in z = ∫ f dy and its slope.

    There L² = c f² + k z'², and f is convex in z where its logarithm is convex in y, since f_zz = (ln f)_yy/f. So an
    extremal is least of all curves: the brachistochrone, f = 1/√y (Troutman, "Variational Calculus and Optimal
    Control", sect. 3.4), and rays in an index that is exponential in the height. Ends, waypoints and bounds that are
    given by y are given by z. Where f grows beyond all bounds, as 1/y does, no curve gets past: it has no integral.
    """
    plain = isinstance(problem, Problem) and problem.n == problem.order == 1 and problem.symbols.kind is ca.SX
    if not plain or problem.maximise or any(problem.slides) or problem.end_cost_expression is not None:
        return False
    if problem.symbols.unknowns.numel() or not all(_is_bound_of_place(problem, t) for t in problem.traced):
        return False
    return _proved_in_another_ordinate(problem, problem.span, tuple(problem.parameters.values()))


@derived
def _proved_in_another_ordinate(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> bool:
    """See :func:`proved_in_another_ordinate`."""
    (at_rest,), *_ = shapes(whole(problem), [[span], [None], [0.0], [], [*values], []])
    if not log_convex_where_positive(at_rest) or not separates(whole(problem), values):
        return False
    _, bounds, _ = shapes_of(problem, span, values)
    return all((low == -math.inf or b.concave) and (high == math.inf or b.convex) for (low, high), b in bounds)


def _is_bound_of_place(problem: Functional, traced: Traced) -> bool:
    return isinstance(traced.constraint, Bound) and not ca.depends_on(traced.expression, problem.symbols.dy)


def _is_level(traced: Traced) -> bool:
    low, high = traced.constraint.interval if isinstance(traced.constraint, Isoperimetric) else (0.0, 1.0)
    return low == high


def proved_quadratic(problem: Functional) -> bool:
    """Whether a functional is proved to be of second degree, and what it is made least over a plane of curves.

    A minimum among the curves near it is then one among all of them: along any line the functional is a parabola.
    """
    if any(problem.slides) or problem.symbols.kind is not ca.SX:
        return False
    integrand, constraints, cost = shapes_of(problem, problem.span, tuple(problem.parameters.values()))
    levels = all(low == high and s.bare and s.part.affine for (low, high), s in constraints)
    return integrand.bare and levels and (cost is None or cost.bare)


@derived
def _proved(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> bool:
    if isinstance(problem, Curve) and any(_on_speed(problem, t) for t in problem.traced):
        return False
    integrand, constraints, cost = shapes_of(problem, span, values)
    aims = [integrand] if cost is None else [integrand, cost]
    return all(s.concave if problem.maximise else s.convex for s in aims) and all(
        (low == -math.inf or s.concave) and (high == math.inf or s.convex) for (low, high), s in constraints
    )


@derived
def shapes_of(
    problem: Functional, span: tuple[float, float], values: tuple[float, ...]
) -> tuple[Shape, list[tuple[tuple[float, float], Shape]], Shape | None]:
    """The shapes of L, of each constraint, with what it lies between, and of the cost of the ends, if there is one."""
    s = problem.symbols
    curve: list[list[Entry]] = [[None] * symbol.numel() for symbol in (s.y, s.dy, s.ddy)]
    numbers: list[list[Entry]] = [[*values], [None] * s.unknowns.numel()]
    (integrand,), *constraints = shapes(whole(problem), [[span], *curve, *numbers])
    bounds = [(0.0, 0.0) if isinstance(t.constraint, Holonomic) else t.constraint.interval for t in problem.traced]
    admitted = [(interval, shape) for interval, (shape,) in zip(bounds, constraints, strict=True)]
    return integrand, admitted, _shape_of_end_cost(problem, span, numbers)


def _on_speed(problem: Functional, traced: Traced) -> bool:
    """Whether a bound asks for the speed along a Curve, which is not one of all that run through the same points."""
    return isinstance(traced.constraint, Bound) and ca.depends_on(traced.expression, problem.symbols.dy)


def _shape_of_end_cost(
    problem: Functional, span: tuple[float, float], numbers: Sequence[Sequence[Entry]]
) -> Shape | None:
    """The shape of what the ends cost, in where the curve meets them; None where they cost nothing."""
    if problem.end_cost is None or (function := end_cost(problem)) is None:
        return None
    known = (entries for x in span for entries in ([x], [None] * problem.n))
    return shapes(function, [*known, *numbers])[0][0]
