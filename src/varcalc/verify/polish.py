"""The extremal that a curve stands for, to round-off.

The value of a functional is stationary, so a solution whose value has twelve
digits may have six in the curve, and no more would be had of its conjugate
points. So the curve is polished: Newton's iteration for the Euler-Lagrange
equation, begun at the curve, on meshes ever finer.
"""

from __future__ import annotations

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import Extremal
from varcalc.methods.collocation.error import Assessment, Root
from varcalc.methods.collocation.newton import Sizes, start_multipliers
from varcalc.methods.collocation.refinement import Refinement
from varcalc.methods.collocation.starting_curves import function_sizes, resolving_vertices
from varcalc.methods.collocation.system import CollocationSystem, collocation_space

FIRST_DEGREE = 16
"""Degree at which a curve is polished first."""
HIGHEST_DEGREE = 40
WANTED = 1e-14
"""Relative error of a polished curve."""
ROUNDS = 8
MOST_UNKNOWNS = 4000
MOST_VERTICES = 65
"""Vertices of a given curve's mesh beyond which it is not taken over."""
NEGLIGIBLE = 1e-12
"""Variation of a function, in units of its size, that is round-off."""


def polished(start: Extremal) -> Extremal | str:
    """The extremal near a curve; the reason when there is none near."""
    form = start.form
    reason = _inapplicable(form)
    if reason:
        return reason
    degree = max(FIRST_DEGREE, form.coordinates.least_degree)

    def ordinates(s: np.ndarray) -> np.ndarray:
        return start.evaluate(s, 0)

    sizes = function_sizes(form)
    given = start.vertices
    if len(given) > MOST_VERTICES:  # a method of low order needs many where this one needs few
        given = np.array([form.span[0], *form.conditions.knots, form.span[1]])
    vertices = resolving_vertices(ordinates, given, degree, NEGLIGIBLE * sizes)
    scales = Sizes(sizes, np.abs(form.start.unknowns))
    system = CollocationSystem(form, collocation_space(form, vertices, degree))
    if system.size > MOST_UNKNOWNS:
        return f"{system.size} unknowns would be needed to polish it"
    z = system.pack(system.fitted(ordinates, start.unknowns))
    residual = system.evaluate(z)
    if not residual.finite:
        return "the Euler-Lagrange equation is not a number along the curve"
    refinement = Refinement(scales, adaptive=True)
    level = refinement.newton(system, start_multipliers(system, z, residual))
    if level is None:
        return refinement.reasons[-1]
    best = _refined(refinement, level)
    if best is None:
        return "the linearised Euler-Lagrange equation is singular"
    return best.system.extremal(best.system.unpack(best.z))


def _refined(refinement: Refinement, level: Root) -> Assessment | None:
    """Climb the degree, then bisect, until the curve is at round-off or stops getting better."""
    size = float(refinement.scales.functions.max(initial=0.0)) or 1.0
    best: Assessment | None = None
    for _, assessment in refinement.levels(level, _climbs, ROUNDS, MOST_UNKNOWNS):
        # the assessment's own curve is corrected once more, so better than the step that led to it
        if best is not None and assessment.curve_error > 0.5 * best.curve_error:
            break
        best = assessment
        if best.curve_error <= WANTED * size:
            break
    return best


def _inapplicable(form: Form) -> str:
    if form.coordinates.weak_only:
        return "at the singular end only regularity decides"
    if any(not c.equality for c in (*form.conditions.integrals, *form.conditions.pathwise)):
        return "inequalities are active"
    return ""


def _climbs(_: Root, assessment: Assessment) -> bool:
    """Whether the degree is raised once more."""
    return assessment.system.space.degree <= HIGHEST_DEGREE and assessment.system.size <= MOST_UNKNOWNS
