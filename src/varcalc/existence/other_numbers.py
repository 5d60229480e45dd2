"""Other values of numbers that are optimised with a curve: along the known curve each is changed over a wide range.

What is summed there is no less than the least for that number, so that what is lower is known to be; where it has
another minimum the direct method begins there.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import integrals
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.end_cost import costs_of_ends
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.evaluation import in_columns

FAR_NUMBERS = 2.0 ** np.arange(3.0, 40.0)
NEAR_NUMBERS = np.linspace(-8.0, 8.0, 513)
NUMBERS_TRIED = np.concatenate([-FAR_NUMBERS[:0:-1], NEAR_NUMBERS, FAR_NUMBERS[1:]])
"""Values that are tried, in units of the known one, of the guess, or of 1, and about the known one."""
PANELS_OF_CURVE, POINTS_OF_PANEL = 16, 8
"""Panels of the rule along the curve, and Gauss points on each."""
MOST_FOLLOWED, FROM_AFAR = 4, (-3.0, -1.5, 1.5, 3.0)
"""Minima that are followed, and how far from the known value, in its unit, it is begun besides."""
WORTH_BEGINNING = 0.5
"""How far above the known value a minimum may lie to be followed, in units of what is summed."""


class OtherNumber(NamedTuple):
    """A value of one of the numbers, with what is minimised along the known curve with it, ``surely`` reached."""

    name: str
    number: float
    value: float
    surely: bool
    problem: Functional


def other_numbers(best: Solution) -> Iterator[OtherNumber]:
    """The values at which what is minimised along the known curve has other minima, the lowest first, and some more.

    The curve may go along with a number, by which there are other valleys than this shows: it is begun afar as well.
    """
    problem, curve = best.problem, best.curve
    if not problem.unknowns or curve is None or not isinstance(problem, Problem) or problem.order > 1:
        return
    known = np.array([best.unknowns[name] for name in problem.unknowns])
    free = not problem.constraints and not any(problem.slides)
    found, afar = list[OtherNumber](), list[tuple[int, float]]()
    for place, name in enumerate(problem.unknowns):
        units = (1.0, abs(float(known[place])), abs(float(problem.unknown_guesses[place])))
        about = [centre + unit * NUMBERS_TRIED for unit in units if unit for centre in (0.0, known[place])]
        tried = np.unique(np.concatenate([known[[place]], *about]))
        numbers = np.tile(known, (len(tried), 1))
        numbers[:, place] = tried
        sums, size = _summed(best, numbers)
        own = int(np.flatnonzero(tried == known[place])[0])
        low = np.concatenate([[np.inf], sums, [np.inf]])
        least = (low[1:-1] < low[:-2]) & (low[1:-1] <= low[2:]) & (sums < sums[own] + WORTH_BEGINNING * size)
        least[max(own - 1, 0) : own + 2] = False
        found += [
            OtherNumber(name, float(tried[k]), float(sums[k]), free, _begun_at(problem, numbers[k]))
            for k in np.flatnonzero(least).tolist()
        ]
        afar += [(place, known[place] + max(units) * away) for away in FROM_AFAR]
    yield from sorted(found, key=lambda other: other.value)[:MOST_FOLLOWED]
    for place, number in afar:
        numbers = known.copy()
        numbers[place] = number
        yield OtherNumber(list(problem.unknowns)[place], float(number), np.inf, False, _begun_at(problem, numbers))


def _begun_at(problem: Problem, numbers: np.ndarray) -> Problem:
    """The problem with other guesses of its numbers (number of them,)."""
    other = copy.copy(problem)
    other.cache = Cache()  # forms begin at the guesses they were made with
    other.unknowns = dict(zip(problem.unknowns, numbers.tolist(), strict=True))
    return other


def _summed(best: Solution, numbers: np.ndarray) -> tuple[np.ndarray, float]:
    """What is minimised along the known curve for numbers (k, number of them), (k,), and the size of it for its own.

    Levels have their multipliers for prices.
    """
    problem, curve = best.problem, best.curve
    assert isinstance(problem, Problem)
    assert curve is not None
    x, weights = composite_gauss(np.linspace(*best.interval, PANELS_OF_CURVE + 1), POINTS_OF_PANEL)
    y, dy = curve(x, 0), curve(x, 1)
    start, end = ((at, curve(at, 0)) for at in np.array(best.interval)[:, None])
    levels = [m for c, m in zip(problem.constraints, best.multipliers, strict=True) if isinstance(c, Isoperimetric)]
    prices = problem.sign * np.array([1.0, *(-float(m or 0.0) for m in levels)])
    count, points = len(numbers), len(x)
    rows = [np.tile(row, (1, count)) for row in (x[None], y, dy)]
    parameters, _ = in_columns(count * points, problem.parameter_values, problem.unknown_guesses)
    given = [*rows, np.zeros((0, count * points)), parameters, np.repeat(numbers.T, points, axis=1)]
    with np.errstate(all="ignore"):
        terms = np.vstack([np.asarray(term) for term in integrals(problem).call(given)])
        values = (prices @ terms).reshape(count, points)
        sums = values @ weights + costs_of_ends(problem, start, end, numbers)
    own = np.abs(values[int(np.argmin(np.abs(numbers - best.unknown_values).sum(1)))])
    return np.where(np.isfinite(sums), sums, np.inf), float(own @ weights)
