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
from varcalc.methods.collocation.error import Assessment, Level, assess
from varcalc.methods.collocation.newton import Scales, start_multipliers, stationary
from varcalc.methods.collocation.starting_curves import function_sizes, resolving_vertices
from varcalc.methods.collocation.system import CollocationSystem, State, collocation_space

FIRST_DEGREE = 16
"""Degree at which a curve is polished first."""
HIGHEST_DEGREE = 40
WANTED = 1e-14
"""Relative error of a polished curve."""
ROUNDS = 8
SHARE = 0.02
"""Elements with more than this share of the largest contribution to the error are bisected."""
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
    degree = max(FIRST_DEGREE, form.least_degree)

    def ordinates(s: np.ndarray) -> np.ndarray:
        return start.evaluate(s, 0)

    sizes = function_sizes(form)
    given = start.vertices
    if len(given) > MOST_VERTICES:  # a method of low order needs many where this one needs few
        given = np.array([form.span[0], *form.knots, form.span[1]])
    vertices = resolving_vertices(ordinates, given, degree, NEGLIGIBLE * sizes)
    scales = Scales(sizes, np.abs(form.unknown_guess))
    system = CollocationSystem(form, collocation_space(form, vertices, degree))
    if system.size > MOST_UNKNOWNS:
        return f"{system.size} unknowns would be needed to polish it"
    z = system.pack(system.fitted(ordinates, start.unknowns))
    residual = system.evaluate(z)
    if not residual.finite:
        return "the Euler-Lagrange equation is not a number along the curve"
    level = _root(system, start_multipliers(system, z, residual), scales)
    if isinstance(level, str):
        return level
    refined = _refined(level, scales)
    if isinstance(refined, str):
        return refined
    return _extremal(refined.system, refined.system.unpack(refined.z))


def _inapplicable(form: Form) -> str:
    if form.weak_only:
        return "at the singular end only regularity decides"
    if any(not c.equality for c in (*form.integrals, *form.pathwise)):
        return "inequalities are active"
    return ""


def _root(system: CollocationSystem, z: np.ndarray, scales: Scales) -> Level | str:
    outcome = stationary(system, z, scales)
    return Level(system, outcome.z, outcome.residual) if outcome.converged else outcome.reason


def _refined(level: Level, scales: Scales) -> Assessment | str:
    """Climb the degree, then bisect, until the curve is at round-off or stops getting better."""
    best: Assessment | None = None
    for _ in range(ROUNDS):
        assessment = assess(level, scales)
        # the assessment's own curve is corrected once more, so better than the step that led to it
        if assessment is None or (best is not None and assessment.curve_error > 0.5 * best.curve_error):
            break
        best = assessment
        if best.curve_error <= WANTED * (float(scales.functions.max(initial=0.0)) or 1.0):
            break
        system, z = assessment.system, assessment.z
        if system.space.degree > HIGHEST_DEGREE:
            space = level.system.space
            marked = assessment.indicators >= SHARE * assessment.indicators.max()
            middles = 0.5 * (space.vertices[1:] + space.vertices[:-1])
            vertices = np.sort(np.concatenate([space.vertices, middles[marked]]))
            system = CollocationSystem(level.system.form, collocation_space(level.system.form, vertices, space.degree))
            z = system.pack(level.system.transferred(level.state, system))
        if system.size > MOST_UNKNOWNS:
            break
        following = _root(system, z, scales)
        if isinstance(following, str):
            break
        level = following
    return best if best is not None else "the linearised Euler-Lagrange equation is singular"


def _extremal(system: CollocationSystem, state: State) -> Extremal:
    space, form = system.space, system.form
    return Extremal(
        form=form,
        evaluate=lambda s, k: space.evaluate(state.coefficients, s, k),
        unknowns=state.unknowns.copy(),
        vertices=space.vertices,
        lambdas=state.levels.copy(),
        path={c.index: system.force(state, k) for k, c in enumerate(form.pathwise)},
    )
