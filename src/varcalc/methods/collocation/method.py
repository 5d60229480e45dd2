"""The indirect method by collocation: a root of the Euler-Lagrange equation and its side conditions.

Newton's method from several starting curves finds a root on a coarse mesh.
The degree then climbs while convergence is geometric; where it is not, the
elements that carry the error are bisected, until the estimated error of the
value meets the tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.collocation.error import Root
from varcalc.methods.collocation.layers import LAYERED_DEGREE, layered_vertices
from varcalc.methods.collocation.newton import Sizes, index, start_multipliers
from varcalc.methods.collocation.refinement import Improved, Refinement
from varcalc.methods.collocation.starting_curves import (
    StartingCurve,
    function_sizes,
    resolving_vertices,
    starting_curves,
)
from varcalc.methods.collocation.system import CollocationSystem, Residual, collocation_space
from varcalc.problem.conditions import truth, whole
from varcalc.problem.functional import Functional
from varcalc.showing import Brief
from varcalc.solution import Solution, Stats, Status, no_answer
from varcalc.spelling import spelled

FIRST_DEGREES: dict[int, tuple[int, ...]] = {1: (10, 6, 16), 2: (10, 16)}
"""Degrees at which roots are sought, by the order of the functional."""
KEPT_DEGREE = {1: 10, 2: 12}
"""Degree of a mesh that is kept, when none is given."""
FIRST_MESHES = (4, 12)
"""Numbers of elements on which roots are sought when none is found on one polynomial."""
FIRST_DISTANCE = 0.1
"""Part of their distance at which a continuation in the ends begins."""


@spelled
@dataclass(frozen=True, repr=False)
class Collocation(Brief):
    """Solve the Euler-Lagrange equation by collocation with polynomials of ``degree`` on ``elements`` equal elements.

    With ``refine`` the mesh is the first one and is refined until the error
    estimate meets ``tol``; without it that mesh is kept and the value is
    returned with its error. Functionals of order m are collocated by functions
    of class C^(2 m - 1) at Gauss points (de Boor and Swartz 1973), so
    ``degree`` is at least 4 m - 1.

    A stationary curve is found, be it a minimum or not; inequalities are
    refused. Raises ValueError or TypeError for a mesh that cannot be.
    """

    elements: int = 1
    degree: int | None = None
    refine: bool = True

    def __post_init__(self) -> None:
        whole("Collocation.elements", self.elements)
        truth("Collocation.refine", self.refine)
        if self.degree is not None and whole("Collocation.degree", self.degree) < 3:
            raise ValueError(
                f"Collocation.degree must be at least 3 (7 for a functional of second order), not {self.degree}"
            )

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """A stationary curve of ``form``, the lowest of those found; see :func:`varcalc.solve`."""
        problem = form.problem
        started = time.perf_counter()
        reason = self.inapplicable(form)
        if reason:
            return no_answer(problem, self, Status.REFUSED, reason)
        scales = Sizes(function_sizes(form), np.abs(form.start.unknowns))
        search = _RootSearch(self, problem, form, tol, started, Refinement(scales, self.refine))
        with np.errstate(all="ignore"):  # trial curves leave the Lagrangian's domain; what is no number is rejected
            return search.run(guess)

    def inapplicable(self, form: Form) -> str:
        """Why collocation cannot treat a form; empty when it can."""
        if form.coordinates.weak_only:
            return "at the singular end only regularity decides, which gives collocation no equation; use Ritz"
        for condition in (*form.conditions.integrals, *form.conditions.pathwise):
            if not condition.equality:
                return f"constraints[{condition.index}] is an inequality, which collocation does not treat; use Ritz"
        least = 4 * form.order - 1
        if self.degree is not None and self.degree < least:
            return f"degree={self.degree} is too low for a functional of order {form.order}; give at least {least}"
        return ""


@dataclass
class _RootSearch:
    """One solve: from starting curves to roots, and from roots to an answer."""

    method: Collocation
    problem: Functional
    form: Form
    tol: float
    started: float
    refinement: Refinement
    built: float = field(default=0.0)
    baseline: tuple[CollocationSystem, np.ndarray, Residual] | None = None
    """Where the baseline was looked at already."""

    def run(self, guess: Sampled | None) -> Solution:
        """The first root that improves to an answer; the failure where none does."""
        for roots in self.attempts(guess):
            for level in roots:
                improved = self.refinement.improve(level, self.tol)
                if improved is not None:
                    return self.report(improved)
                if self.refinement.adrift:  # said of this root; no other is looked for, and no answer is claimed
                    return self.failure()
        return self.failure()

    def failure(self) -> Solution:
        """No answer, with the most frequent of the reasons."""
        reasons = self.refinement.reasons
        reason = max(set(reasons), key=reasons.count) if reasons else "no starting curve could be tried"
        message = (
            f"collocation found no stationary curve in {len(reasons)} attempts ({reason}); there may be none "
            "between these ends, or it lies far from every starting curve: give guess=, or try Ritz"
        )
        message = self.refinement.adrift or message
        stats = Stats(self.built, time.perf_counter() - self.started - self.built, self.refinement.iterations)
        return no_answer(self.problem, self.method, Status.NOT_CONVERGED, message, stats=stats)

    # roots

    def attempts(self, guess: Sampled | None) -> Iterator[list[Root]]:
        """Lists of roots, each the lowest value first, the cheapest attempts before the others."""
        for vertices, degree in self.meshes():
            system = CollocationSystem(self.form, collocation_space(self.form, vertices, degree))
            self.built = self.built or time.perf_counter() - self.started
            layered = self.layered(system) if degree == FIRST_DEGREES[self.form.order][0] else None
            if guess is not None:
                yield self.from_guess(system, guess) if layered is None else self.root_of(layered, guess)
            if layered is not None:
                yield self.roots(layered)
            yield self.roots(system)
        if self.method.refine:
            yield self.from_nearer_ends()

    def layered(self, system: CollocationSystem) -> CollocationSystem | None:
        """The system on a mesh for boundary layers, where the starting curve shows any and no mesh was asked for."""
        method = self.method
        if not method.refine or method.elements > 1 or method.degree is not None:
            return None
        z = first_unknowns(system, self.form.start.curve)
        residual = system.evaluate(z)
        self.baseline = system, z, residual
        vertices = layered_vertices(system, residual)
        if vertices is None:
            return None
        return CollocationSystem(self.form, collocation_space(self.form, vertices, LAYERED_DEGREE))

    def from_guess(self, system: CollocationSystem, guess: Sampled) -> list[Root]:
        """The root that a given curve leads to, on a mesh that resolves it."""
        if self.method.refine:
            space = system.space
            vertices = resolving_vertices(guess, space.vertices, space.degree)
            system = CollocationSystem(self.form, collocation_space(self.form, vertices, space.degree))
        return self.root_of(system, guess)

    def root_of(self, system: CollocationSystem, guess: Sampled) -> list[Root]:
        """The root that a given curve leads to, on the mesh of a system."""
        level = self.root(system, StartingCurve(guess))
        return [] if level is None else [level]

    def meshes(self) -> Iterator[tuple[np.ndarray, int]]:
        """Meshes on which roots are sought."""
        method, order = self.method, self.form.order
        vertices = first_vertices(self.form, method.elements)
        if not method.refine:
            yield vertices, method.degree or KEPT_DEGREE[order]
            return
        least = max(self.form.coordinates.least_degree, 4 * order - 1)
        degrees = [method.degree] if method.degree else [d for d in FIRST_DEGREES[order] if d >= least] or [least]
        for degree in degrees:
            yield vertices, degree
        for elements in FIRST_MESHES:
            if elements > method.elements:
                yield first_vertices(self.form, elements), degrees[0]

    def roots(self, system: CollocationSystem) -> list[Root]:
        """Roots on one mesh.

        The first one does when it is a minimum as far as a coarse mesh can
        tell; otherwise every starting curve is tried.
        """
        found = []
        for start in starting_curves(self.form):
            level = self.root(system, start)
            if level is None:
                continue
            if self.shifts() or index(level.system, level.z, level.residual) == 0:
                return [level]
            found.append(level)
        return sorted(found, key=lambda level: level.residual.value)

    def shifts(self) -> bool:
        """True for a closed curve that may be shifted along itself, whose index a coarse mesh does not tell."""
        return self.form.ends.periodic > 0 and not ca.depends_on(self.form.integrand, self.form.symbols.x)

    def root(self, system: CollocationSystem, start: StartingCurve) -> Root | None:
        """The root that one starting curve leads to, along with its prescribed integrals if need be."""
        known = self.baseline
        if known is not None and known[0] is system and start.curve is self.form.start.curve:
            level = self.refinement.newton(system, known[1], known[2])
        else:
            level = self.refinement.newton(system, first_unknowns(system, start.curve))
        if level is not None or start.gentle is None:
            return level
        z = first_unknowns(system, start.gentle)
        base = system.integrals(system.evaluate(z)) + system.levels
        if not np.isfinite(base).all():
            return None
        path = levels_path(self.form, base)
        return self.refinement.continued(self.refinement.newton(CollocationSystem(path(0.0), system.space), z), path)

    def from_nearer_ends(self) -> list[Root]:
        """The root reached by moving the ends apart from near their mean, where the extremal is all but straight."""
        form = self.form
        if form.conditions.waypoints or any(form.coordinates.singular) or not form.ends.separate:
            return []
        if not np.any(form.ends.start[0] != form.ends.end[0]):
            return []
        path = ends_path(form)
        near = path(FIRST_DISTANCE)
        space = collocation_space(near, first_vertices(form, self.method.elements), FIRST_DEGREES[form.order][1])
        system = CollocationSystem(near, space)
        start = self.refinement.newton(system, first_unknowns(system, near.start.curve))
        level = self.refinement.continued(start, lambda part: path(FIRST_DISTANCE + part * (1.0 - FIRST_DISTANCE)))
        return [] if level is None else [level]

    # reporting

    def report(self, improved: Improved) -> Solution:
        """The answer of an improved root, with its error and what it took."""
        level, assessment, status = improved.level, improved.assessment, improved.status
        message = ""
        if status is Status.SOLVED and assessment.value_error > self.tol * max(1.0, abs(assessment.value)):
            message = f"the mesh given was kept; its error exceeds the tolerance {self.tol:g}"
        stats = Stats(
            self.built, time.perf_counter() - self.started - self.built, self.refinement.iterations, level.system.size,
            level.system.space.elements, level.system.space.degree,
        )  # fmt: skip
        return improved.solution(self.method, stats, message)


def first_unknowns(system: CollocationSystem, curve: Sampled) -> np.ndarray:
    """The unknowns for a starting curve, with the multipliers that suit it best."""
    z = system.pack(system.fitted(curve, system.form.start.unknowns))
    if not len(system.linear):
        return z
    residual = system.evaluate(z)
    return start_multipliers(system, z, residual) if residual.finite else z


def first_vertices(form: Form, elements: int) -> np.ndarray:
    """An even mesh between the knots: about ``elements`` in all, at least one between neighbours."""
    a, b = form.span
    parts = []
    for left, right in pairwise([a, *form.conditions.knots, b]):
        count = max(1, round(elements * (right - left) / (b - a)))
        parts.append(np.linspace(left, right, count + 1)[:-1])
    return np.append(np.concatenate(parts), b)


def levels_path(form: Form, base: np.ndarray) -> Callable[[float], Form]:
    """Forms whose prescribed integrals go from ``base`` to their own levels as the argument goes from 0 to 1."""

    def at(part: float) -> Form:
        """The form with levels that part of the way from ``base`` to its own."""
        if part == 1.0:
            return form
        levels = [float(b + part * (c.lower - b)) for c, b in zip(form.conditions.integrals, base, strict=True)]
        integrals = [replace(c, lower=v, upper=v) for c, v in zip(form.conditions.integrals, levels, strict=True)]
        return replace(form, conditions=replace(form.conditions, integrals=tuple(integrals)))

    return at


def ends_path(form: Form) -> Callable[[float], Form]:
    """Forms whose fixed ends lie at the given part of their distance from their mean."""
    mean = 0.5 * (form.ends.start[0] + form.ends.end[0])
    centre = np.nan_to_num(mean)  # a component that is free at an end is only scaled

    def at(part: float) -> Form:
        """The form with its ends, and its start, at that part of their distance from the mean."""
        if part == 1.0:
            return form
        start, end = form.ends.start.copy(), form.ends.end.copy()
        start[0], end[0] = centre + part * (start[0] - centre), centre + part * (end[0] - centre)
        column = centre[:, None]
        nearer = replace(form.start, curve=lambda s: column + part * (form.start.curve(s) - column))
        return replace(form, ends=replace(form.ends, start=start, end=end), start=nearer)

    return at
