"""Bounds of the place that leave no room at some abscissa, however narrow, or where an end slides.

It is asked first, for it takes milliseconds.
"""

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
    """That bounds of one function contradict each other at an abscissa, or what an end slides on; None for none."""
    if not isinstance(problem, Problem) or problem.n > 1:
        return None
    if any(problem.slides):
        return next(filter(None, (_no_place(problem, side) for side in (0, 1) if problem.slides[side])), None)
    walls = _walls(problem)
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


def _no_place(problem: Problem, side: int) -> Finding | None:
    """That bounds leave no place of the line on which an end slides; None where they do, or one of them is no line."""
    label, s = ("start", "end")[side], problem.symbols
    place = ca.vertcat(s.x, s.y)
    phi = problem.traced_slide(label, s.x, s.y, s.kind)
    line = None if phi is None else _of_first_degree(problem, phi, place)
    if line is None or not np.any(line[1:]):
        return None
    at = -line[0] * line[1:] / (line[1:] @ line[1:])
    along = np.array([-line[2], line[1]]) / np.hypot(*line[1:])
    # how far along the line a place is lies between the greatest of the least and the least of the greatest
    limits: list[tuple[float, int, int]] = []
    for index, constraint in enumerate(problem.constraints):
        of = next((t.expression for t in problem.traced if t.constraint is constraint), None)
        known = None if of is None or not isinstance(constraint, Bound) else _of_first_degree(problem, of, place)
        if known is None or not isinstance(constraint, Bound):
            continue
        value, rate, size = known[0] + known[1:] @ at, float(known[1:] @ along), float(np.abs(known[1:]).max())
        for level, way in zip(constraint.interval, (-1, 1), strict=True):
            beyond = way * (value - level)
            if abs(rate) > CROSSED * size and np.isfinite(level):
                limits.append(((level - value) / rate, way if rate > 0 else -way, index))
            elif np.isfinite(level) and beyond > CROSSED * max(1.0, abs(value), abs(level)):
                return _told_of(problem, label, {index}, beyond)
    least = max((v for v in limits if v[1] < 0), default=(-np.inf, 0, 0))
    greatest = min((v for v in limits if v[1] > 0), default=(np.inf, 0, 0))
    if least[0] - greatest[0] > CROSSED * max(1.0, abs(least[0]), abs(greatest[0])):
        return _told_of(problem, label, {least[2], greatest[2]}, least[0] - greatest[0])
    return None


def _told_of(problem: Problem, label: str, indices: set[int], by: float) -> Finding:
    names = " and ".join(f"constraints[{i}] (Bound)" for i in sorted(indices))
    sentence = (
        f"{names} and {label} = {getattr(problem, label)} cannot be met together: the end would be {by:.4g} off it"
    )
    return Finding(Verdict.INFEASIBLE, f"{sentence}, wherever it slides; change a bound or phi")


def _of_first_degree(problem: Problem, expression: ca.SX, place: ca.SX) -> np.ndarray | None:
    """Value at 0, and rates with x and y, of what is of first degree in these and in nothing else; None for others."""
    s = problem.symbols
    if s.kind is not ca.SX or ca.depends_on(expression, ca.vertcat(s.dy, s.ddy, s.unknowns)):
        return None
    given = ca.substitute(expression, s.parameters, problem.parameter_values)
    rates = ca.densify(ca.jacobian(given, place))
    if not rates.is_constant():
        return None
    return np.array([float(ca.substitute(given, place, np.zeros(2))), *np.asarray(ca.DM(rates)).ravel()])
