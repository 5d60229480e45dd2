"""Curves that a kink of L in the ordinate holds: dead cores, as contacts with a bound.

Where L rises to both sides of a level, as c abs(y) does of y = 0, a curve may rest on it. On one side of the level L
is smooth, and the level is a bound of that side's problem; what rests there is a contact, with ends that the direct
method places (Kinderlehrer and Stampacchia, "An Introduction to Variational Inequalities", 1980, ch. 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.existence.held_throughout import Curve, on_level
from varcalc.formulation import formulate
from varcalc.formulation.height import FLAT, flat, height
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import along_x, switches_of
from varcalc.problem.conditions import AnyEnd, Bound, Fixed
from varcalc.problem.problem import Problem
from varcalc.solution import ErrorEstimate, Solution, Status
from varcalc.symbolic.switches import Switch, held
from varcalc.symbolic.tracing import Expression

BUMPS = (1e-2, 1e-4)
"""Heights of the bumps, in units of the curve's extent, by which it is seen that a level holds a curve."""
GAUSS_POINTS = 24
SAMPLES = 101
BESIDE_LEVEL = 1e-6
"""Distance, in units of the height that the functional feels, at which a side of the level is looked at."""
ON_LEVEL = 1e-12
"""Departure from the level, in units of the largest, that is round-off."""


def resting(problem: Problem, method: Ritz, tol: float, curve: Curve, found: list[Crossing]) -> Solution | None:
    """The least curve that rests where ``curve`` follows a kink; None for another.

    Between places where it rests it stays on one side: the parts are solved each by itself.
    """
    switch = _level(problem, found)
    if switch is None:
        return None
    found = [c for c in found if c.switch is switch]
    parts = [_part(problem, switch, method, tol, curve, span) for span in _spans(problem, switch, curve, found)]
    if not all(part is not None and part.status.ok and part.curve is not None for part in parts):
        return None
    solution = _united(problem, method, [part for part in parts if part is not None])
    assert solution.curve is not None
    return solution if _holds(problem, solution.curve, solution, found) else None


def _spans(problem: Problem, switch: Switch, curve: Curve, found: list[Crossing]) -> list[tuple[float, float]]:
    """The interval cut where the curve rests between two sides of the level."""
    cuts = [problem.span[0], *(0.5 * (c.x + c.until) for c in found if c.until is not None), problem.span[1]]
    kept = [cuts[0]]
    for before, cut, after in zip(cuts, cuts[1:], cuts[2:], strict=False):
        if _side(problem, switch, curve, (before, cut)) != _side(problem, switch, curve, (cut, after)):
            kept.append(cut)
    return list(pairwise([*kept, cuts[-1]]))


def _part(
    problem: Problem, switch: Switch, method: Ritz, tol: float, curve: Curve, span: tuple[float, float]
) -> Solution | None:
    """The least curve of one part that stays on one side of the level; on it at ends that are not the problem's."""
    side = _side(problem, switch, curve, span)
    level = on_level(problem, switch, curve)
    ends = [
        end if at == whole else Fixed(at, float(level(np.array([at]), 0)[0, 0]))
        for end, at, whole in zip((problem.start, problem.end), span, problem.span, strict=True)
    ]
    first, last = (end.values(1)[0] for end in ends)
    departures = _argument(problem, switch, np.array(span), np.array([[first, last]]))
    if np.nan_to_num(side * departures).min() < -ON_LEVEL * np.nan_to_num(np.abs(departures)).max():
        return None
    inner = _one_sided(problem, switch, side, curve, (ends[0], ends[1]), span)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return replace(method, starts=1).solve(formulate(inner), tol=tol, guess=lambda x: curve(x, 0))


def _united(problem: Problem, method: Ritz, parts: list[Solution]) -> Solution:
    """The answer of all parts."""
    curves = [part.curve for part in parts if part.curve is not None]
    starts = np.array([part.x[0] for part in parts[1:]])

    def joined(x: np.ndarray, derivative: int) -> np.ndarray:
        number = np.searchsorted(starts, x, side="right")
        return np.select([number == k for k in range(len(curves))], [curve(x, derivative) for curve in curves])

    nodes = np.unique(np.concatenate([part.x for part in parts]))
    lasting = resampled(joined, nodes.tolist(), 1 + problem.order)
    error = ErrorEstimate(sum(part.error.value for part in parts), max(part.error.curve for part in parts))
    worst = next((part for part in parts if part.status is not Status.SOLVED), parts[0])
    # where the parts meet the level holds the curve, whose momentum is that of either
    sensitivities = {name: sum(part.sensitivities[name] for part in parts) for name in problem.parameters}
    return replace(
        worst, problem=problem, method=method, multipliers=(), curve=lasting, extremal=None, x=nodes, error=error,
        value=sum(part.value for part in parts), sensitivities=sensitivities,
    )  # fmt: skip


def _level(problem: Problem, found: list[Crossing]) -> Switch | None:
    """The kink that the curve follows, where all it follows are kinks in the ordinate; None for anything else."""
    s, followed = problem.symbols, [c.switch for c in found if c.until is not None]
    plain = problem.n == problem.order == 1 and not (problem.constraints or problem.unknowns)
    if not (plain and followed) or problem.end_cost is not None:
        return None
    moves = any(w.jumps or w.stepped or w.depends_on(s.dy) or not w.depends_on(s.y) for w in followed)
    return None if moves or any(along_x(problem, w) for w in switches_of(problem)) else followed[0]


def _argument(problem: Problem, switch: Switch, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    s = problem.symbols
    function = ca.Function("argument", [s.x, s.y, s.parameters], [switch.argument])
    numbers = np.tile(problem.parameter_values[:, None], (1, len(x)))
    return np.asarray(function(x[None], y, numbers)).ravel()


def _side(problem: Problem, switch: Switch, curve: Curve, span: tuple[float, float]) -> float:
    """The side of the level on which the curve is along a part of it: of the largest departure, either if none."""
    x = np.linspace(*span, SAMPLES)
    values = _argument(problem, switch, x, curve(x, 0))
    return float(np.sign(values[np.argmax(np.abs(values))])) or 1.0


def _beside(
    problem: Problem, switch: Switch, side: float, curve: Curve, span: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An abscissa, an ordinate and a slope on one side of the level: of the curve, or beside it where it has none."""
    x = np.linspace(*span, SAMPLES)
    y = curve(x, 0)
    departures = side * _argument(problem, switch, x, y)
    at = int(np.argmax(departures))
    form = formulate(problem)
    beside = BESIDE_LEVEL * height(form)
    if not departures[at] > FLAT * height(form):
        rising = np.diff(_argument(problem, switch, x[[at, at]], y[:, [at, at]] + np.array([0.0, beside])))
        y = y + side * np.sign(rising) * beside
    return x[at : at + 1], y[:, at], curve(x[at : at + 1], 1)[:, 0]


def _one_sided(
    problem: Problem, switch: Switch, side: float, curve: Curve, ends: tuple[AnyEnd, AnyEnd], span: tuple[float, float]
) -> Problem:
    """The problem of a part on one side of the level, which is a bound of it."""
    s = problem.symbols
    point = [*_beside(problem, switch, side, curve, span), np.zeros(s.ddy.numel())]
    numbers = [problem.parameter_values, problem.unknown_guesses]
    smooth = held([problem.integrand], s.all, [*point, *numbers])[0]
    names = tuple(problem.parameters)

    def stated(expression: Expression) -> Callable[..., Expression]:
        """An expression of the problem's symbols as a user states it, a function of (x, y, dy[, p])."""
        function = ca.Function("stated", s.all, [expression])

        def handed(x: Any, y: Any, dy: Any, p: Any = None) -> Expression:
            values = [getattr(p, name) for name in names]
            return function(x, y, dy, np.zeros(s.ddy.numel()), ca.vertcat(*values), np.zeros(s.unknowns.numel()))

        return handed

    bound = Bound(stated(side * switch.argument), lower=0.0)
    return Problem(
        stated(smooth), *ends, [bound], parameters=problem.parameters, maximise=problem.maximise,
        breakpoints=[x for x in problem.breakpoints if span[0] < x < span[1]], name=problem.name,
    )  # fmt: skip


def _holds(problem: Problem, curve: Curve, solution: Solution, found: list[Crossing]) -> bool:
    """Whether bumps either way, where the curve rests, make the problem's own functional worse."""
    x, weights = composite_gauss(np.linspace(*problem.span, 4 * SAMPLES), GAUSS_POINTS)
    y, slope = curve(x, 0), curve(x, 1)
    form = formulate(problem)
    extent = max(float(np.ptp(y)), float(np.abs(y).max()) * 1e-3)
    extent = extent if extent > flat(form) else height(form)

    def value(departure: np.ndarray, rise: np.ndarray) -> float:
        return problem.sign * float(problem.integrand_values(x, y + departure, slope + rise) @ weights)

    own = problem.sign * solution.value
    for ride in found:
        if ride.until is None:
            continue
        width = ride.until - ride.x
        part = (x - ride.x) / width
        inside = (part > 0) & (part < 1)
        arch = np.where(inside, part * (1 - part), 0.0)
        rise = np.where(inside, (1 - 2 * part) / width, 0.0)
        for share in BUMPS:
            for way in (share * extent, -share * extent):
                if value(way * arch, way * rise) < own - 1e-12 * abs(own):
                    return False
    return True
