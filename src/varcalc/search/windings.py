"""Coordinates that are angles: the same end, a whole number of periods further on.

Where L does not change when a coordinate grows by its period, an end at y and
one at y + k periods are one point, and curves to the two are two curves
between the same points which wind differently.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators import flows
from varcalc.problem.conditions import At, Fixed, finite, is_vector
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve

TRIALS = 16
"""Points at which L is held against itself one period on."""
UNCHANGED = 1e-9
"""Relative change of L that counts as none."""
SEED = 20
"""The trial points are the same each time."""


def wound(problem: Functional, period: Any, windings: Any) -> Iterator[tuple[Any, Functional]]:
    """Problems with the end moved by up to ``windings`` periods either way, each with its number (or numbers).

    Raises TypeError or ValueError, naming the argument, for periods that L does not have.
    """
    if not (isinstance(windings, int) and windings >= 0):
        raise ValueError(f"windings must be a whole number, 0 or more, not {windings!r}")
    if period is None:
        yield 0, problem
        return
    periods = _periods(problem, period)
    turning = [i for i, length in enumerate(periods) if length]
    for turns in product(range(-windings, windings + 1), repeat=len(turning)):
        offset = np.zeros(problem.n)
        offset[turning] = np.array(turns) * [periods[i] for i in turning]
        number = turns[0] if len(turns) == 1 else turns
        yield number, _moved(problem, offset, turns) if any(turns) else problem


def _periods(problem: Functional, period: Any) -> list[float]:
    """The period of each unknown function, 0 for those that have none."""
    given = list(period) if is_vector(period) else [period]
    if len(given) != problem.n:
        raise ValueError(f"period must have {problem.n} entries, one for each unknown function, None for no period")
    periods = [0.0 if v is None else finite("period", v) for v in given]
    if min(periods) < 0 or not any(periods):
        raise ValueError(f"period must be positive where it is given, not {period!r}")
    values = problem.end.values(problem.n)
    for i, length in enumerate(periods):
        if length and np.isnan(values[i]):
            raise ValueError(f"period: component {i} is free at the end, where no winding is told from another")
        if length and not _periodic(problem, i, length):
            raise ValueError(f"period: the Lagrangian or a constraint changes when component {i} grows by {length:g}")
    return periods


def _periodic(problem: Functional, component: int, length: float) -> bool:
    """True when nothing in the problem changes as a component grows by ``length``, at a number of points."""
    expressions = [problem.integrand, *(t.expression for t in problem.traced)]
    function = ca.Function("all", problem.symbols.all, [ca.vertcat(*expressions)])
    rng = np.random.default_rng(SEED)
    place = np.nan_to_num(problem.end.values(problem.n))
    for _ in range(TRIALS):
        x = problem.span[0] + rng.random() * (problem.span[1] - problem.span[0])
        y, dy, ddy = (rng.normal(size=s.numel()) for s in (problem.symbols.y, problem.symbols.dy, problem.symbols.ddy))
        numbers = [problem.parameter_values, problem.unknown_guesses]
        step = np.eye(problem.n)[component] * length
        here, there = (np.asarray(function(x, at, dy, ddy, *numbers)) for at in (place + y, place + y + step))
        both = np.isfinite(here) & np.isfinite(there)
        if np.any(np.abs(here - there)[both] > UNCHANGED * (1.0 + np.abs(here[both]))):
            return False
    return True


def _moved(problem: Functional, offset: np.ndarray, turns: tuple[int, ...]) -> Functional:
    """The problem with its end moved by ``offset``, and a name that tells the winding."""
    values = [None if np.isnan(v) else float(v) for v in problem.end.values(problem.n) + offset]
    other = copy.copy(problem)
    if isinstance(problem, Curve):
        other.end = At(values)
    else:
        other.end = Fixed(problem.end.x, values[0] if problem.scalar else values, problem.end.dy)
    other.templates = (other.start, other.end)
    other.name = f"{problem.name}, winding {', '.join(f'{k:+d}' for k in turns)}"
    # compiled flows do not know the ends; all else that is kept does
    other.cache = problem.cache.only(flows)
    return other
