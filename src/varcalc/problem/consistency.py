"""Whether the points a curve must pass through meet its pathwise constraints.

A fixed end off a holonomic surface, or inside an obstacle, leaves no curve at
all; that is cheaper said than found out by a search.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric
from varcalc.problem.functional import Functional, Traced
from varcalc.symbolic.derived import derived

OFF = 1e-9
"""Distance from a constraint that is no rounding, relative to how much the constraint varies over the problem."""

PROBED, PARALLEL = 7, 1e-13
"""Points at which integrands are compared, and the square of an angle that is none."""


@dataclass(frozen=True)
class Place:
    """A point that is given whole: what a person calls it, its abscissa and its coordinates (n,)."""

    label: str
    x: float
    y: np.ndarray


def check_places(problem: Functional, places: Sequence[Place]) -> None:
    """Raise ValueError for a place that misses a Holonomic, or a Bound on the position, and say by how much.

    What depends on slopes or on unknowns may still be met, and is not judged.
    """
    positional = _positional(problem)
    if not positional or not places:
        return
    size = max(float(np.abs(p.y).max()) for p in places) or problem.span[1] - problem.span[0]
    steps = np.vstack([np.zeros(problem.n), size * np.eye(problem.n), -size * np.eye(problem.n)])
    for place in places:
        points = (place.y + steps).T
        parameters = np.repeat(problem.parameter_values[:, None], len(steps), axis=1)
        values = np.asarray(_conditions(problem)(np.full((1, len(steps)), place.x), points, parameters))
        for traced, row in zip(positional, values, strict=True):
            for complaint in _complaints(traced, row):
                index = problem.constraints.index(traced.constraint)
                raise ValueError(
                    f"{place.label} violates constraints[{index}] ({type(traced.constraint).__name__}): {complaint}; "
                    "move one of the two, or free the component that is fixed there"
                )


def check_levels(problem: Functional) -> None:
    """Raise ValueError for an integral that is prescribed twice, be it in another unit: no multiplier is fixed then.

    Integrands are compared at points that mean nothing. Levels that contradict each other are left to the solver.
    """
    held = [
        (t.expression, t.constraint)
        for t in problem.traced
        if isinstance(t.constraint, Isoperimetric) and t.constraint.equality
    ]
    if len(held) < 2:
        return
    columns = problem.symbols.all
    function = ca.Function("levels", columns, [ca.densify(ca.vertcat(*(e for e, _ in held)))])
    rng = np.random.default_rng(0)
    values = np.asarray(function.map(PROBED)(*(rng.uniform(0.5, 1.5, (c.numel(), PROBED)) for c in columns)))
    rows = np.column_stack([values, [level.interval[0] for _, level in held]])
    units = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    for first, second in combinations(range(len(held)), 2):
        if abs(units[first] @ units[second]) >= 1 - PARALLEL:
            i, k = (problem.constraints.index(held[row][1]) for row in (first, second))
            raise ValueError(f"constraints[{k}] prescribes the integral that constraints[{i}] does; leave one out")


def _positional(problem: Functional) -> list[Traced]:
    """The pathwise constraints in which neither slopes nor unknowns occur."""
    s = problem.symbols
    others = [v for v in (s.dy, s.ddy, s.unknowns) if v.numel()]
    return [
        t
        for t in problem.traced
        if isinstance(t.constraint, Holonomic | Bound) and not any(ca.depends_on(t.expression, v) for v in others)
    ]


@derived
def _conditions(problem: Functional) -> ca.Function:
    s = problem.symbols
    expressions = [ca.densify(t.expression) for t in _positional(problem)]
    return ca.Function("positional", [s.x, s.y, s.parameters], [ca.vertcat(*expressions)])


def _complaints(traced: Traced, values: np.ndarray) -> Iterator[str]:
    """Why the first of ``values`` is not admitted; the others, a problem's size away, say what counts as zero."""
    value, constraint = float(values[0]), traced.constraint
    low, high = constraint.interval if isinstance(constraint, Bound) else (0.0, 0.0)
    allowed = OFF * max([abs(v) for v in (*values, low, high) if math.isfinite(v)], default=0.0)
    if isinstance(constraint, Holonomic):
        if abs(value) > allowed:
            yield f"phi is {value:.6g} there instead of 0"
    elif value < low - allowed:
        yield f"h is {value:.6g} there, {low - value:.3g} below lower = {low:.6g}"
    elif value > high + allowed:
        yield f"h is {value:.6g} there, {value - high:.3g} above upper = {high:.6g}"
