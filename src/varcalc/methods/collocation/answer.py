"""A curve on a collocation space, with its assessed errors, as a Solution."""

from __future__ import annotations

from typing import Any

from varcalc.formulation import Form, Sampled
from varcalc.methods.answer import Extremal, answer
from varcalc.methods.collocation.error import Assessment, Level
from varcalc.solution import ErrorEstimate, Solution, Stats, Status


def answered(
    form: Form, method: Any, level: Level, assessment: Assessment, status: Status, message: str, stats: Stats
) -> Solution:
    """The Solution for a curve of ``form``, in the person's coordinates and with the person's sign."""
    space, state, system = level.system.space, level.state, level.system
    # multipliers of an energy J^2 become those of J by the chain rule
    factor = 0.5 / abs(assessment.value) if form.energetic else 1.0
    extremal = Extremal(
        form=form,
        evaluate=lambda s, k: space.evaluate(state.coefficients, s, k),
        unknowns=state.unknowns.copy(),
        vertices=space.vertices,
        lambdas=state.levels.copy(),
        path={c.index: _times(factor, system.force(state, k)) for k, c in enumerate(form.pathwise)},
        coefficients=state.coefficients if space.elements == 1 else None,
    )
    errors = ErrorEstimate(assessment.value_error, assessment.curve_error)
    value, rule = form.sign * assessment.value, 2 * space.degree + 4
    return answer(extremal, method, value, errors, space.vertices, stats, status, message, rule)


def _times(factor: float, function: Sampled) -> Sampled:
    return lambda s: factor * function(s)
