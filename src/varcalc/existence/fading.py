"""Functionals that fall towards a limit which nothing attains, as an unknown number or a free curve grows for ever.

What is left to gain falls on the way, so that an iteration ends somewhere and finds its answer settled. Farther out
the functional is lower, and nowhere in between has it risen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict, refused

FACTORS = np.array([0.5, 0.99, 1.0, 1.01, 1.1, 1.5, 2.0, 4.0, 8.0, 16.0, 32.0])
"""By which what may grow is multiplied: about a minimum the functional rises on one side at least."""
NEIGHBOURING = 3
"""Steps about the answer itself, along which it has to fall."""
GAUSS_POINTS = 8
FELT = 1e-14
"""Fall from one factor to the next, relative to what is summed, that is no round-off."""


def attained(solution: Solution) -> Solution:
    """The solution, refused where an unknown number or the curve was on its way to infinity."""
    problem = solution.problem
    if not (solution.status.ok and isinstance(problem, Problem)) or solution.curve is None:
        return solution
    if problem.constraints or any(problem.slides) or problem.end_cost is not None or problem.order > 1:
        return solution  # what grows alone would not keep to these
    for growing in _growing(problem, solution):
        values, sizes = _values(problem, solution, growing)
        falls = np.diff(values) < -FELT * sizes[:-1]
        if falls[:NEIGHBOURING].all() and np.all(falls | (sizes[:-1] == 0.0)):  # from nothing it falls no more
            sentence = (
                f"the infimum is not attained: {growing.name} goes on for ever, the functional being "
                f"{problem.sign * values[2]:.6g} at {growing.name} = {growing.size:.6g} and "
                f"{problem.sign * values[-1]:.6g} at {FACTORS[-1]:g} times that"
            )
            return refused(solution, Finding(Verdict.NOT_ATTAINED, sentence, {growing.name: growing.size}))
    return solution


@dataclass(frozen=True)
class _Growing:
    """What may grow: the unknown number, or the function, of an index; its name, and how large it is."""

    name: str
    size: float
    number: int | None = None
    function: int | None = None


def _growing(problem: Problem, solution: Solution) -> Iterator[_Growing]:
    """The unknown numbers, and the functions of which any multiple meets the ends."""
    for k, (name, number) in enumerate(solution.unknowns.items()):
        yield _Growing(name, float(number), number=k)
    assert solution.curve is not None
    ends = np.array([end.values(problem.n) for end in (problem.start, problem.end)])
    largest = np.abs(solution.curve(solution.x, 0)).max(axis=1)
    for i in np.flatnonzero(np.isnan(ends).any(axis=0) & (np.nan_to_num(ends) == 0.0).all(axis=0)):
        yield _Growing(problem.ordinates[i].name, float(largest[i]), function=int(i))


def _values(problem: Problem, solution: Solution, growing: _Growing) -> tuple[np.ndarray, np.ndarray]:
    """The functional, to be made least, and the integral of |L|, with what grows times each of the factors."""
    assert solution.curve is not None
    x, weights = composite_gauss(solution.x, GAUSS_POINTS)
    y, dy = (np.repeat(solution.curve(x, k)[:, None], len(FACTORS), axis=1) for k in (0, 1))
    numbers = np.tile(solution.unknown_values, (len(FACTORS), 1))
    if growing.number is not None:
        numbers[:, growing.number] *= FACTORS
    else:
        for along in (y, dy):
            along[growing.function] *= FACTORS[:, None]
    places, unknowns = np.tile(x, len(FACTORS)), np.repeat(numbers, len(x), axis=0)
    with np.errstate(all="ignore"):
        rows = problem.integrand_values(
            places, y.reshape(problem.n, -1), dy.reshape(problem.n, -1), unknowns=unknowns
        ).reshape(len(FACTORS), -1)
    return problem.sign * rows @ weights, np.abs(rows) @ weights
