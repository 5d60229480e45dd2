"""Problems that are convex as a whole: an extremal of one is a least curve among all that are admissible.

The functional is convex where its Lagrangian is jointly convex in the curve and its slopes (Troutman, "Variational
Calculus and Optimal Control", ch. 3), and the curves that are admissible are a convex set where the constraints that
hold are affine and those that bound are convex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca

from varcalc.problem.breaks import whole
from varcalc.problem.conditions import Bound, Holonomic
from varcalc.problem.functional import Functional, Traced
from varcalc.problem.problem import Curve
from varcalc.symbolic.convexity import Entry, Shape, shapes
from varcalc.symbolic.derived import derived


def proved_jointly_convex(problem: Functional) -> bool:
    """Whether a problem is proved convex at its parameters' values: its functional, and what it is made least over.

    It is meant for all curves at once, and for the unknowns with them; concave, for a functional to be made greatest.
    False says that there is no proof, not that there is no convexity.
    """
    if any(problem.slides) or problem.symbols.kind is not ca.SX:
        return False
    return _proved(problem, problem.span, tuple(problem.parameters.values()))


@derived
def _proved(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> bool:
    if isinstance(problem, Curve) and any(_on_speed(problem, t) for t in problem.traced):
        return False
    s = problem.symbols
    curve: list[list[Entry]] = [[None] * symbol.numel() for symbol in (s.y, s.dy, s.ddy)]
    numbers: list[list[Entry]] = [[*values], [None] * s.unknowns.numel()]
    (integrand,), *constraints = shapes(whole(problem), [[span], *curve, *numbers])
    return (
        (integrand.concave if problem.maximise else integrand.convex)
        and all(_admits_convexly(t, shape) for t, (shape,) in zip(problem.traced, constraints, strict=True))
        and _ends_convexly(problem, span, numbers)
    )


def _on_speed(problem: Functional, traced: Traced) -> bool:
    """Whether a bound asks for the speed along a Curve, which is not one of all that run through the same points."""
    return isinstance(traced.constraint, Bound) and ca.depends_on(traced.expression, problem.symbols.dy)


def _admits_convexly(traced: Traced, shape: Shape) -> bool:
    """Whether what satisfies a constraint, of whose expression the ``shape`` is known, is a convex set."""
    constraint = traced.constraint
    low, high = (0.0, 0.0) if isinstance(constraint, Holonomic) else constraint.interval
    return (low == -math.inf or shape.concave) and (high == math.inf or shape.convex)


def _ends_convexly(problem: Functional, span: tuple[float, float], numbers: Sequence[Sequence[Entry]]) -> bool:
    """Whether what the ends cost is convex in where the curve meets them; concave, of a cost to be made greatest."""
    if problem.end_cost_expression is None:
        return True
    ends, cost = problem.end_cost_expression
    s = problem.symbols
    curve: list[list[Entry]] = [[None] * symbol.numel() for symbol in ends]
    if not isinstance(problem, Curve):
        curve[0], curve[2] = [span[0]], [span[1]]
    function = ca.Function("end_cost", [*ends, s.parameters, s.unknowns], [cost])
    shape = shapes(function, [*curve, *numbers])[0][0]
    return shape.concave if problem.maximise else shape.convex
