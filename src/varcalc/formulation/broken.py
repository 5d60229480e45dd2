"""Forms of graphs with corners at abscissae that are themselves unknown.

The interval is cut into pieces, and each is mapped linearly onto a fixed one:
in the reference variable the corners stand still, and their abscissae are
unknown numbers. Stationarity in them is Erdmann's second corner condition
(continuity of y' L_y' - L), in the ordinates the first (continuity of L_y');
Gelfand and Fomin, "Calculus of Variations", sect. 15.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation.form import (
    Coordinates,
    Form,
    Sampled,
    SideCondition,
    Start,
    Stated,
    conditions_of,
    end_conditions,
    extended,
    rewriter,
)
from varcalc.formulation.graph import graph_form
from varcalc.problem.problem import Problem
from varcalc.symbolic.tracing import Expression

SHORTEST = 1e-2
"""Share of its first length that a piece must keep where IPOPT moves its ends."""


@dataclass(frozen=True)
class Contact:
    """A stretch along which a bound is touched: the constraint's number, its level, and guesses of the ends."""

    index: int
    level: float
    start: float
    end: float


def broken_form(
    problem: Problem, corners: Sequence[float], curve: Sampled, contacts: Sequence[Contact] | None = None
) -> Form:
    """The problem with corners near the given abscissae, where only they and ``curve`` are guesses.

    ``corners`` lie inside the interval, away from breakpoints and waypoints;
    the ends are fixed abscissae (:class:`varcalc.Fixed` or :class:`varcalc.Free`).
    With ``contacts``, whose ends are corners or ends of the interval, the
    bounds are kept as equations along them and not at all elsewhere, where it
    is for the caller to look whether they hold.
    """
    plain = graph_form(problem)
    symbols = extended(problem, problem.n, len(corners))
    marks = _marks(problem, plain, corners, symbols.unknowns[len(problem.unknowns) :])
    x, speed = _piecewise(symbols.x, marks)
    slopes = [symbols.dy / speed] + ([symbols.ddy / speed**2] if problem.order == 2 else [])
    rewrite = rewriter(problem, symbols, x, symbols.y, slopes, speed)
    integrand = plain.sign * rewrite(problem.integrand, True)
    conditions = replace(conditions_of(problem, rewrite), knots=tuple(s for s, _ in marks[1:-1]))
    pathwise = conditions.pathwise
    if contacts is not None:
        bounds = {c.index: c for c in pathwise}
        pathwise = tuple(
            replace(bounds[c.index], lower=c.level, upper=c.level, where=(c.start, c.end)) for c in contacts
        )
    elif pathwise:  # the interior-point method is kept from turning a piece inside out
        pathwise += (SideCondition(speed, SHORTEST, math.inf, -1),)
    stated = Stated(symbols, integrand, integrand, (x, symbols.y, speed, symbols.dy))
    joint = end_conditions(problem, symbols, lambda k, y: (problem.span[k], y))
    return Form(
        problem,
        Coordinates(stated, problem.span, corners=len(corners), note="corners at unknown abscissae"),
        replace(plain.ends, joint=joint),
        replace(conditions, pathwise=pathwise, waypoints=plain.conditions.waypoints),
        Start(curve, np.array([*problem.unknown_guesses, *sorted(corners)]), plain.start.bumps),
    )


def _marks(
    problem: Problem, plain: Form, corners: Sequence[float], unknowns: Expression
) -> list[tuple[float, Expression]]:
    """(s, x) at the ends, the knots that stand still and the corners, in order."""
    kind = problem.symbols.kind
    moving = [(float(c), unknowns[i]) for i, c in enumerate(sorted(corners))]
    standing = [(v, kind(v)) for v in (problem.span[0], *plain.conditions.knots, problem.span[1])]
    return sorted([*moving, *standing], key=lambda mark: mark[0])


def _piecewise(s: Expression, marks: list[tuple[float, Expression]]) -> tuple[Expression, Expression]:
    """x(s), linear between the marks, and dx/ds."""
    x: Expression = None
    speed: Expression = None
    for (s0, x0), (s1, x1) in pairwise(marks):
        rate = (x1 - x0) / (s1 - s0)
        piece = x0 + (s - s0) * rate
        x = piece if x is None else ca.if_else(s < s0, x, piece)
        speed = rate if speed is None else ca.if_else(s < s0, speed, rate)
    return x, speed
