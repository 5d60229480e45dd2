"""Bounds of the place that leave no room at some abscissa, however narrow: asked first, for it takes milliseconds."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Bound
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Verdict
from varcalc.symbolic.variation import gentle_boxes

PLACES_FOR_ROOM, MOST_PLACES = 257, 2000
"""Abscissae at which bounds are compared to begin with, and at most between which they vary gently."""
CLOSER_LOOKS, PLACES_A_LOOK_AT_ROOM = 6, 33
"""Times that it is looked closer where there is least room, and at how many places."""
CROSSED = 1e-9
"""By how much the least ordinate may be above the greatest by round-off, relative to their sizes."""


class _Wall(NamedTuple):
    """A limit of y at x: the constraint's number, whether it is the least that y may be, and a function of x."""

    constraint: int
    floor: bool
    at: ca.Function


def no_room(problem: Functional) -> Finding | None:
    """That two bounds of one function contradict each other at an abscissa; None where none are seen to."""
    walls = _walls(problem) if isinstance(problem, Problem) and problem.n == 1 and not any(problem.slides) else []
    if not (any(w.floor for w in walls) and any(not w.floor for w in walls)):
        return None
    span = problem.span
    every = ca.SX.sym("x")
    together = ca.Function("walls", [every], [ca.vertcat(*(w.at(every) for w in walls))])
    x = np.linspace(*span, PLACES_FOR_ROOM)
    x = np.union1d(np.union1d(x, gentle_boxes(together, x, MOST_PLACES)), breaks(problem))
    for _ in range(CLOSER_LOOKS):
        values = np.asarray(together(x[None]))
        floors = np.where([[w.floor] for w in walls], values, -np.inf)
        ceilings = np.where([[not w.floor] for w in walls], values, np.inf)
        room = ceilings.min(0) - floors.max(0)
        if not np.isfinite(room).any():  # of what is no number nothing is told
            return None
        k = int(np.nanargmin(room))
        least, greatest = floors[:, k].max(), ceilings[:, k].min()
        if least - greatest > CROSSED * max(1.0, abs(least), abs(greatest)):
            pair = sorted(
                {walls[int(np.argmax(floors[:, k]))].constraint, walls[int(np.argmin(ceilings[:, k]))].constraint}
            )
            names = " and ".join(f"constraints[{i}] (Bound)" for i in pair)
            sentence = (
                f"{names} cannot be met{' together' if len(pair) > 1 else ''}: at x = {x[k]:.6g} y would have to be at "
                f"least {least:.6g} and at most {greatest:.6g}; change a bound"
            )
            return Finding(Verdict.INFEASIBLE, sentence)
        x = np.linspace(x[max(k - 1, 0)], x[min(k + 1, len(x) - 1)], PLACES_A_LOOK_AT_ROOM)
    return None


def _walls(problem: Problem) -> list[_Wall]:
    """What bounds that are of first degree in y alone, by a factor of one sign that is known, say of it."""
    s, found = problem.symbols, list[_Wall]()
    others = ca.vertcat(s.dy, s.ddy, s.unknowns)
    for traced in problem.traced:
        bound = traced.constraint
        if not isinstance(bound, Bound) or s.kind is not ca.SX:
            continue
        rate = ca.densify(ca.jacobian(traced.expression, s.y))
        if not rate.is_constant() or float(rate) == 0.0:
            continue
        if others.numel() and ca.depends_on(traced.expression, others):
            continue
        offset = ca.substitute(ca.substitute(traced.expression, s.y, 0.0), s.parameters, problem.parameter_values)
        index = next(i for i, c in enumerate(problem.constraints) if c is bound)
        for level, floor in zip(bound.interval, (True, False), strict=True):
            if np.isfinite(level):
                at = ca.Function("wall", [s.x], [(level - offset) / rate])
                found.append(_Wall(index, floor == (float(rate) > 0), at))
    return found
