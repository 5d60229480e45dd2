"""Least curves about the corners of walls: L jumps along x at an abscissa, and along y at the edge of what is there.

A polygon of a lattice goes round a wall through which the known curve goes. The curve through the corners in between is
least where they press it: the momentum changes there as it would if the curve were pulled into the wall.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import casadi as ca
import numpy as np

from varcalc.existence.above_kinks import as_held
from varcalc.existence.directions import polygonal
from varcalc.existence.polygons import Valley
from varcalc.formulation import formulate
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import breaks, switches_of
from varcalc.problem.conditions import Bound, Through
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

BESIDE_BREAK = 1e-8
"""Distance from a break, in units of the interval, at which its sides are looked at."""
BEHIND_BREAK, BESIDE_POLYGON, CLEAR_OF_WALL = 1e-6, 1e-4, 1e-9
"""How far behind a break, in units of the interval, and beside a polygon it is seen whether L jumps, and how far from
the edge of the wall the curve is kept, both in units of the ordinates."""
LEAST_SPREAD = 1e-6
"""How far ordinates are apart at least, relative to themselves, for a billionth of it to be more than round-off."""
OFF_KNOWN = 1e-3
"""Part of what the curve is off by for that to which it is known."""
JUMP_OF_WALL = 1e-3
"""Change of L, in units of the larger of the two, that is a jump."""
HALVINGS_TO_EDGE = 40
"""Times that the way from a vertex onto the wall is halved for the edge of that."""
ROUNDS_OF_CORNERS = 4
"""Times that corners are looked for, and that those which press nothing are left out."""


@dataclass(frozen=True)
class WallCorner:
    """A corner of a wall at (x, y), ``above`` (1) or below (-1) which a curve goes."""

    x: float
    y: float
    above: int


def about_corners_of_walls(problem: Problem, valley: Valley, known: CurveOrSlope, tol: float) -> Solution | None:
    """The least curve about the corners that lie between a polygon and the known curve; None where none is found."""
    plain = problem.n == problem.order == 1 and not problem.unknowns
    if not (plain and breaks(problem) and all(isinstance(c, Bound) for c in problem.constraints)):
        return None
    corners = _all_between(problem, valley, known)
    for _ in range(ROUNDS_OF_CORNERS):
        if not corners:
            return None
        through = [Through(c.x, c.y + c.above * CLEAR_OF_WALL * _unit(problem, valley)) for c in corners]
        with np.errstate(all="ignore"):
            found = Ritz(starts=1).solve(
                formulate(problem.restated(constraints=[*problem.constraints, *through])), tol=tol, guess=valley
            )
        if not found.status.ok or found.curve is None:
            return None
        changes = _changes(problem, found, corners)
        if (changes >= 0.0).all():
            return _on_corners(problem, found, CLEAR_OF_WALL * _unit(problem, valley) * float(changes.sum()))
        corners = [c for c, change in zip(corners, changes, strict=True) if change >= 0.0]
    return None


def _on_corners(problem: Problem, found: Solution, off: float) -> Solution | None:
    """The answer with what it is ``off`` by beside the corners, known to first order; None where it meets more."""
    multipliers, value = found.multipliers[: len(problem.constraints)], found.error.value + OFF_KNOWN * off
    beside = replace(
        found, problem=problem, extremal=None, multipliers=multipliers, sensitivities=_rates(problem, found)
    )
    beside = replace(beside, error=replace(found.error, value=value))
    return replace(beside, value=found.value - problem.sign * off) if as_held(problem, beside) else None


def _rates(problem: Problem, found: Solution) -> dict[str, float]:
    """The sensitivities, but of parameters that move what switches, and corners with it."""
    symbols = ca.vertsplit(problem.symbols.parameters)
    moved = [any(switch.depends_on(symbol) for switch in switches_of(problem)) for symbol in symbols]
    return {n: math.nan if m else rate for (n, rate), m in zip(found.sensitivities.items(), moved, strict=True)}


def _unit(problem: Problem, valley: Valley) -> float:
    """How far the ordinates of a polygon are apart; the interval where all are zero."""
    spread, largest = float(np.ptp(valley.y)), float(np.abs(valley.y).max())
    return max(spread, LEAST_SPREAD * largest) or problem.span[1] - problem.span[0]


def _all_between(problem: Problem, valley: Valley, known: CurveOrSlope) -> list[WallCorner]:
    """The corners next to a polygon, or between it and the known curve, or the polygon through those that are found."""
    corners: dict[float, WallCorner] = {}
    for _ in range(ROUNDS_OF_CORNERS):
        more = [c for c in _between(problem, valley, known) if c.x not in corners]
        if not more:
            break
        corners |= {c.x: c for c in more}
        ends = [(x, float(valley(np.array([x]))[0, 0])) for x in problem.span]
        x, y = np.array(sorted([*ends, *((c.x, c.y) for c in corners.values())])).T
        known = polygonal(x, y[None])
    return [corners[x] for x in sorted(corners)]


def _between(problem: Problem, valley: Valley, known: CurveOrSlope) -> list[WallCorner]:
    """The corners of walls next to a polygon, or between it and the known curve, at each break of L along x."""
    a, b = problem.span
    beside, found = BESIDE_POLYGON * _unit(problem, valley), list[WallCorner]()
    for at in breaks(problem):
        y, through = float(valley(np.array([at]))[0, 0]), float(known(np.array([at]), 0)[0, 0])
        away = float(np.sign(y - through))
        ways = [(y + beside, y - beside), (y - beside, y + beside), (y + away * beside, through)]
        for x, (free, onto) in product((at - BEHIND_BREAK * (b - a), at + BEHIND_BREAK * (b - a)), ways):
            L = _along_line(problem, x)
            low, high = L(free), L(onto)
            if high - low > JUMP_OF_WALL * max(abs(high), abs(low)):
                found.append(WallCorner(at, _edge(L, free, onto, low, high), int(np.sign(free - onto))))
                break
    return found


def _along_line(problem: Problem, x: float) -> Callable[[float], float]:
    """L at rest on a vertical line, as it is minimised."""
    none = np.zeros(1)
    return lambda y: problem.sign * float(problem.integrand_values(np.array([x]), np.array([[y]]), none[None])[0])


def _edge(L: Callable[[float], float], y: float, beyond: float, free: float, onto: float) -> float:
    """Where L comes to be nearer to what it is ``onto`` the wall."""
    for _ in range(HALVINGS_TO_EDGE):
        middle = 0.5 * (y + beyond)
        y, beyond = (middle, beyond) if L(middle) - free < 0.5 * (onto - free) else (y, middle)
    return y


def _changes(problem: Problem, found: Solution, corners: Sequence[WallCorner]) -> np.ndarray:
    """By how much the momentum changes at each corner (corners,), as it is pressed; less than 0 where it is not."""
    assert found.curve is not None
    room = BESIDE_BREAK * (problem.span[1] - problem.span[0])
    x = np.array([corner.x + side * room for corner in corners for side in (-1, 1)])
    momenta = problem.integrand_derivatives(x, found.curve(x, 0), found.curve(x, 1)).gradient[:, -1]
    return problem.sign * np.array([corner.above for corner in corners]) * (momenta[::2] - momenta[1::2])
