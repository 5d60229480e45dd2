"""Minima of what switches under bounds of the place, begun from polygons that show all contacts, however short.

Where contacts with convex kinks come one upon the other, every kink is a function of its own, on a mesh that holds the
polygon. Where L jumps, the least polygon is one of several valleys.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from varcalc.existence.above_kinks import above_kinks, as_held
from varcalc.existence.directions import polygonal
from varcalc.existence.jumps_under_bounds import least_beside_jumps
from varcalc.existence.polygons_under_bounds import PolygonsUnderBounds, PolygonUnderBounds
from varcalc.existence.rests import at_contacts, treated
from varcalc.formulation import Contact, Sampled, formulate
from varcalc.formulation.epigraph import epigraph_form
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.runs import runs
from varcalc.problem.problem import Problem
from varcalc.solution import Solution, Status, local_only, no_answer

DEGREE, TURNS, ALONG_BOUND = 4, 24, 12
"""Of elements, how many there are where a polygon turns, and on one stretch at a bound."""
GOOD = 1e-7
"""Error, relative to max(1, abs(value)), with which a minimum of such is one."""
NO_LOWER = 1e-3
"""Relative difference of a value and a polygon's that is none."""


class UnderBounds(NamedTuple):
    """The minimum that touches bounds, or the refusal; None where there is none. And what a polygon comes to.

    What lies above that is no minimum, or where L jumps in one of ``several`` valleys.
    """

    solution: Solution | None
    polygon: float
    several: bool = False

    def admits(self, solution: Solution) -> bool:
        """Whether an answer is not above the polygon, whose value is known to a part of itself."""
        value = solution.problem.sign * solution.value
        return value <= self.polygon + NO_LOWER * max(abs(value), abs(self.polygon))

    def judged(self, solution: Solution) -> Solution:
        """An answer that was found otherwise: refused, or said to be local, where it is above the polygon."""
        if not solution.status.ok or self.admits(solution):
            return solution
        problem = solution.problem
        if not self.several:
            message = "a polygon is lower than every broken curve that was found"
            return no_answer(problem, solution.method, Status.NOT_CONVERGED, message)
        lower = problem.sign * self.polygon
        return local_only(solution, f"a polygon has the value {lower:.6g}, and no curve near it stands", lower)


def least_under_bounds(problem: Problem, method: Ritz, tol: float, guess: Sampled | None) -> UnderBounds:
    """The minimum under bounds, where L is a sum of convex kinks or jumps, and what else may be one has to beat."""
    if guess is None and (beside := least_beside_jumps(problem)) is not None:
        known = UnderBounds(None, beside.value, several=True)
        solution = at_contacts(beside.surfaces, method, tol, beside.curve, beside.contacts)
        found = solution is not None and as_held(problem, solution) and known.admits(solution)
        return known._replace(solution=solution) if found else known
    form = formulate(problem)
    curve = guess or form.start.curve
    lifted = epigraph_form(form, curve) if _treated(problem) else None
    polygons = None if lifted is None else PolygonsUnderBounds(form, lifted)
    found = None if polygons is None else polygons.least(curve)
    if polygons is None or found is None:
        return UnderBounds(None, math.inf)
    contacts = polygons.contacts(found)
    known = UnderBounds(None, found.value)
    if not any(c.index < len(problem.constraints) for c in contacts):
        return known
    solution = at_contacts(polygons.surfaces, method, tol, polygonal(found.x, found.y[None]), contacts)
    if solution is not None and as_held(problem, solution) and known.admits(solution):
        return known._replace(solution=solution)
    # where contacts come one upon the other the kinks are functions of their own
    way = replace(method, elements=1, degree=DEGREE, refine=False)
    solution = above_kinks(form.on_mesh(_marks(found, contacts)), way, tol, found.ordinates)
    if solution is not None and solution.error.value <= GOOD * max(1.0, abs(solution.value)) and known.admits(solution):
        return known._replace(solution=replace(solution, problem=problem, method=method))
    message = f"a polygon that comes to {problem.sign * found.value:.6g} touches bounds, and no curve near it stands"
    return known._replace(solution=no_answer(problem, method, Status.NOT_CONVERGED, message))


def _treated(problem: Problem) -> bool:
    """Whether a graph of one function between two abscissae is under nothing but bounds, some of them of its place."""
    plain = not (any(problem.slides) or problem.start.periodic or problem.end_cost is not None)
    return (
        plain and treated(problem) and any(not ca.depends_on(t.expression, problem.symbols.dy) for t in problem.traced)
    )


def _marks(polygon: PolygonUnderBounds, contacts: list[Contact]) -> list[float]:
    """The vertices of a mesh that holds a polygon: beside the ends of contacts, along bounds, where it turns."""
    x, chosen = polygon.x, np.zeros(len(polygon.x), dtype=bool)
    for end in {e for c in contacts for e in (c.start, c.end)}:
        near = int(np.argmin(np.abs(x - end)))
        chosen[max(near - 1, 0) : near + 2] = True
    for first, last in runs(polygon.at_bounds):
        chosen[np.linspace(first, last, min(last - first + 1, ALONG_BOUND)).astype(int)] = True
    turns = np.sqrt(np.abs(np.diff(np.diff(polygon.y) / np.diff(x))))
    turns[polygon.at_bounds[1:-1]] = 0.0
    passed = np.cumsum(turns / (turns.sum() or 1.0) + 1.0 / len(turns))
    chosen[1 + np.searchsorted(passed, passed[-1] * np.arange(1, TURNS) / TURNS)] = True
    return x[1:-1][chosen[1:-1]].tolist()
