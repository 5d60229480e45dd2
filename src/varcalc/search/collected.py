"""Stationary curves of a form by collocation: one for a curve to start from, or all that deflation finds."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.collocation.error import Root
from varcalc.methods.collocation.method import Collocation, first_unknowns, first_vertices
from varcalc.methods.collocation.newton import Sizes
from varcalc.methods.collocation.refinement import Refinement
from varcalc.methods.collocation.starting_curves import StartingCurve, function_sizes, starting_curves
from varcalc.methods.collocation.system import CollocationSystem, collocation_space
from varcalc.numerics.mesh import Space
from varcalc.search.deflation import deflated_newton, is_singular
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, Verdict

ROOT_MESHES = {1: ((1, 20), (4, 10)), 2: ((1, 24), (4, 12))}
"""Elements and degree of the meshes on which roots are sought, by the order of the functional.

One polynomial has few roots that stand for nothing; the other mesh is for where it finds none."""
FINER_SHARE = 1e-4
"""Part of the tolerance of the value to which an extremal is refined ..."""
FINEST_TOLERANCE = 1e-14
"""... but no less than this."""
CLIMBS = 3
"""Richer spaces in which a root is looked for."""
FALLING_CORRECTION = 0.3
"""Factor by which the correction from one to the next must fall at least."""
MOST_ROOTS = 16
"""Roots sought on one mesh."""


def scales_of(form: Form) -> Sizes:
    """The sizes in which corrections of a form's curves are measured."""
    return Sizes(function_sizes(form), np.abs(form.start.unknowns))


def finer(tol: float) -> float:
    """The tolerance extremals are refined to: the curve's error is the root of the value's, and is to be small too."""
    return max(FINER_SHARE * tol, FINEST_TOLERANCE)


def as_asked(solution: Solution, tol: float) -> Solution:
    """A solution refined to :func:`finer` than ``tol``, with the status that ``tol`` itself gives it."""
    met = solution.error.value <= tol * max(1.0, abs(solution.value))
    if solution.status is Status.ROUND_OFF and met:
        return replace(solution, status=Status.SOLVED, message="")
    return solution


def refined(level: Root, tol: float) -> tuple[Solution, Space] | None:
    """The Solution that a root stands for and the mesh it took; None when no extremal is near the root."""
    started = time.perf_counter()
    refinement = Refinement(scales_of(level.system.form), adaptive=True)
    improved = refinement.improve(level, finer(tol)) if persists(level) else None
    if improved is None:
        return None
    final, seconds = improved.level.system, time.perf_counter() - started
    stats = Stats(0.0, seconds, refinement.iterations, final.size, final.space.elements, final.space.degree)
    return as_asked(improved.solution(Collocation(), stats), tol), final.space


def persists(level: Root) -> bool:
    """True when a root has a counterpart in richer spaces that there is evidence of an extremal near.

    A coarse mesh has roots that are accidents of its own, and refining one for a long time costs far more than
    finding it.
    """
    if is_singular(level.system, level.z):
        return True  # along the direction left open a correction may be anything
    before, climbed = math.inf, 0
    refinement = Refinement(scales_of(level.system.form), adaptive=True)
    for _, assessment in refinement.levels(level, lambda *_: True, CLIMBS, level.system.size):
        if assessment.trusted:
            return True
        if assessment.correction.length > FALLING_CORRECTION * before:
            return False
        before, climbed = assessment.correction.length, climbed + 1
    return climbed == CLIMBS


def starts(form: Form) -> Iterator[StartingCurve]:
    """Starting curves, each with its gentle version as another."""
    for start in starting_curves(form):
        yield start
        if start.gentle is not None:
            yield StartingCurve(start.gentle)


def deflated(form: Form, tol: float) -> list[Solution]:
    """Every extremal that deflated Newton iterations reach on a coarse mesh, refined.

    The form is one that collocation applies to. Where the conditions leave a
    direction open, one DEGENERATE extremal stands for the continuum.
    """
    found: list[Solution] = []
    for elements, degree in ROOT_MESHES[form.order]:
        at_least = max(degree, form.coordinates.least_degree)
        system = CollocationSystem(form, collocation_space(form, first_vertices(form, elements), at_least))
        for z in roots(system, scales_of(form)):
            found_again = refined(Root(system, z, system.evaluate(z)), tol)
            if found_again is None or not found_again[0].status.ok:
                continue
            solution = found_again[0]
            if is_singular(system, z):
                return [*found, degenerate(solution)]
            found.append(solution)
        if found:
            break
    return found


def degenerate(solution: Solution) -> Solution:
    """A solution that a direction left open makes uncertain by the root of what its conditions are met to."""
    assert solution.curve is not None
    size = float(np.abs(solution.curve(solution.x, 0)).max())
    error = ErrorEstimate(solution.error.value, solution.error.curve + math.sqrt(np.finfo(float).eps) * size)
    return replace(solution, verdict=Verdict.DEGENERATE, error=error)


def roots(system: CollocationSystem, scales: Sizes) -> list[np.ndarray]:
    """Roots of one system from every starting curve, the known ones deflated until nothing new comes."""
    known: list[np.ndarray] = []
    for start in starts(system.form):
        first = first_unknowns(system, start.curve)
        if not system.evaluate(first).finite:
            continue
        scales.grow(system, first)
        while len(known) < MOST_ROOTS:
            z = deflated_newton(system, first, known, scales)
            if z is None:
                break
            known.append(z)
            if is_singular(system, z):
                return known
    return known
