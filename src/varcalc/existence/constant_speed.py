"""Shortest curves of metrics with kinks that graphs cannot be broken at: steep ones, with floors beside their ends.

Who writes sqrt((1 + y'^2)/fmax(y, 1e-9)), lest it be infinite at the start, has a metric with a kink within 1e-14 of
the abscissa's start. As a curve of constant speed, which minimises the energy (Jost, "Riemannian Geometry and Geometric
Analysis", sect. 1.4), the answer is smooth on either side of the kink. The mesh is cut where the curve meets kinks, and
cut anew where it does then, until they stay.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.singular import of_constant_speed
from varcalc.methods.answer import Extremal, lifted, sample
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.roots import scanned_root
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import ErrorEstimate, Solution
from varcalc.symbolic.derived import Cache

GRADING_HALVINGS = 26
"""Halvings toward either end by which the first mesh is graded: what is steep is so beside the ends."""
ROUGH_DEGREE, CUT_DEGREE = 4, 8
ROUGHLY = 1e-4
"""Error of the value with which the mesh is cut for the first time."""
MESHES_CUT = 12
"""Meshes that are cut."""
PLACES_AN_ELEMENT = 16
"""Places of an element at which it is seen on which side of a kink a curve is."""
CLOSE = 1e-3
"""Distance of a vertex from a cut, relative to that from the nearer end, within which it gives way."""
PLACES_FOR_MOVE = 400
SAFETY = 2.0
"""Of the last changes of value and curve, as the cuts find their places."""
SHRINKS = 0.7
"""Ratio of successive misses from which cuts are not taken to find their places."""


@dataclass(frozen=True)
class _Round:
    """A solution on a mesh with ``cuts``, and where its curve meets kinks."""

    solution: Solution
    cuts: np.ndarray
    met: np.ndarray

    @property
    def miss(self) -> np.ndarray:
        """How far the curve meets kinks from where the mesh was cut; not numbers where it meets more or fewer."""
        return self.met - self.cuts if len(self.met) == len(self.cuts) else np.full(len(self.met), np.nan)

    def moved(self, before: _Round) -> tuple[float, float]:
        """By how much value and curve differ from those of the round before; infinite after a curve met other kinks."""
        here, there = self.solution.extremal, before.solution.extremal
        if here is None or there is None or len(before.cuts) != len(self.cuts):
            return math.inf, math.inf
        first, last = here.form.span
        s = np.linspace(first, last, PLACES_FOR_MOVE)
        (x, y, dx, dy), (x0, y0, *_) = lifted(here, s), lifted(there, s)
        with np.errstate(all="ignore"):
            moved = np.where(dx > 0.0, np.abs(y - y0 - dy / dx * (x - x0)), 0.0)
        return abs(self.solution.value - before.solution.value), float(np.nanmax(moved, initial=0.0))

    def following(self, before: _Round) -> np.ndarray | None:
        """The next cuts: where the curve meets kinks, and from the second time on by the secant; None: no way on."""
        miss, known = self.miss, before.miss
        if np.isnan(miss).any() or np.isnan(known).any() or len(known) != len(miss):
            return self.met
        if np.any(np.abs(miss) > SHRINKS * np.abs(known)):
            return None
        return self.cuts - miss * (self.cuts - before.cuts) / np.where(miss == known, np.inf, miss - known)


def at_constant_speed(problem: Functional, method: Ritz, tol: float, guess: Sampled | None) -> Solution | None:
    """The minimum of a metric whose curve meets kinks in the place, each at a vertex; None where none is found.

    None too where a mesh of the person's own is to be kept. ``guess`` is a graph.
    """
    own = method.refine and method.degree is None
    form = of_constant_speed(problem) if isinstance(problem, Problem) and own and _kinks_in_place(problem) else None
    if form is None or not isinstance(problem, Problem):
        return None
    started = time.perf_counter()
    graded = 0.5 ** np.arange(1, GRADING_HALVINGS)
    first, last = form.span
    vertices = first + (last - first) * np.union1d(graded, 1 - graded)
    start = None if guess is None else form.coordinates.pull(guess)
    rough = _on_mesh(_of_degree(method, ROUGH_DEGREE), form, vertices, ROUGHLY, start)
    if rough.extremal is None or not len(met := _met(problem, rough.extremal)):
        return None
    before, cuts, spent = _Round(rough, np.zeros(0), met), met, rough.stats.iterations
    for _ in range(MESHES_CUT):
        solution = _on_cut_mesh(_of_degree(method, CUT_DEGREE), form, before, cuts, tol)
        if solution.extremal is None or not len(met := _met(problem, solution.extremal)):
            return None
        found = _Round(solution, cuts, met)
        value, curve = found.moved(before)
        spent += solution.stats.iterations
        error = ErrorEstimate(solution.error.value + SAFETY * value, solution.error.curve + SAFETY * curve)
        if solution.status.ok and error.value <= tol * max(1.0, abs(solution.value)):
            stats = replace(solution.stats, solve=time.perf_counter() - started, iterations=spent)
            return replace(solution, method=method, error=error, stats=stats)
        following = found.following(before)
        if following is None:
            return None
        before, cuts = found, following
    return None


def _of_degree(method: Ritz, degree: int) -> Ritz:
    return replace(method, elements=1, degree=degree, starts=1)


def _on_cut_mesh(method: Ritz, form: Form, before: _Round, cuts: np.ndarray, tol: float) -> Solution:
    """The answer on the mesh of a solution, with vertices at ``cuts`` instead of at those before."""
    start = before.solution.extremal
    assert start is not None
    kept = np.setdiff1d(start.vertices[1:-1], before.cuts)
    a, b = form.span
    apart = np.abs(kept[:, None] - cuts).min(1, initial=np.inf)
    kept = kept[apart > CLOSE * np.minimum(cuts - a, b - cuts).min()]
    return _on_mesh(method, form, np.union1d(kept, cuts), tol, lambda s: start.evaluate(s, 0))


def _on_mesh(method: Ritz, form: Form, vertices: np.ndarray, tol: float, guess: Sampled | None) -> Solution:
    conditions = replace(form.conditions, knots=tuple(vertices.tolist()))
    with np.errstate(all="ignore"):
        return method.solve(replace(form, conditions=conditions, cache=Cache()), tol=tol, guess=guess)


def _kinks_in_place(problem: Problem) -> bool:
    return bool(on_curve(problem)) and not any(
        s.jumps or s.stepped or s.depends_on(problem.symbols.dy) for s in on_curve(problem)
    )


def _met(problem: Problem, extremal: Extremal) -> np.ndarray:
    """The parameters at which a curve goes through kinks, ascending."""
    form, s = extremal.form, problem.symbols
    assert form.stated.lifted is not None
    x, y, *_ = form.stated.lifted
    arguments = ca.vertcat(*(k.argument for k in on_curve(problem)))
    inner = form.symbols
    function = ca.Function("kinks", inner.all, [ca.substitute([arguments], [s.x, s.y], [x, y])[0]])

    def values(at: np.ndarray) -> np.ndarray:
        return np.asarray(function(*sample(extremal, at)))

    vertices = extremal.vertices
    at = np.unique(vertices[:-1, None] + np.diff(vertices)[:, None] * np.linspace(0, 1, PLACES_AN_ELEMENT))
    found: list[float] = []
    for k, row in enumerate(values(at)):
        for i in np.flatnonzero(row[1:] * row[:-1] < 0.0):
            root = scanned_root(lambda p, k=k: values(p)[k], float(at[i]), float(at[i + 1]), 0.0)
            found += [] if root is None else [root]
    return np.unique(found)
