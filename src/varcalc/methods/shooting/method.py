"""The indirect method: the Euler-Lagrange equation integrated as an initial-value problem.

The interval is cut into segments, each with an initial state of its own; a
damped Newton iteration makes the segments match each other and the ends, with
exact sensitivities from the variational equations. Where errors would grow by
more than e^10 across a segment it is cut in two. One segment is simple
shooting (Ascher, Mattheij, Russell, "Numerical Solution of Boundary Value
Problems for Ordinary Differential Equations", chapter 4).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.integrators import CannotLower, Engine, compiled, default
from varcalc.methods.answer import answer
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.methods.shooting.regular_arc import Work
from varcalc.methods.shooting.search import NoneFound, Search, describe
from varcalc.methods.shooting.shot_extremal import Finished, finish
from varcalc.methods.shooting.shots import Failure
from varcalc.problem.conditions import whole
from varcalc.showing import Brief
from varcalc.solution import Solution, Stats, Status, no_answer
from varcalc.spelling import spelled

END_SLOPES = (0.1, -0.1, 1.0, -1.0, 10.0, -10.0)
"""Slopes with which the integrand is looked at in an end."""
MOST_STEPS_OF_SHOT = 1000
"""Steps after which a segment is too long, or runs into a singularity: it is cut."""
COSTLY = 4.0
"""Digits lost in a segment that are worth a word about the number of segments."""
BEST_POSSIBLE = 1e-12
"""Relative error of the value that counts as the best double precision allows."""
ROUND_OFF_PER_CONDITION = 1e-14
"""The same for an ill-conditioned extremal, for each unit of its condition number ..."""
ILL_POSED = 1e-6
"""... up to this."""


@spelled
@dataclass(frozen=True, repr=False)
class Shooting(Brief):
    """Multiple shooting with ``segments`` (by default as many as the growth of errors demands).

    ``Shooting(segments=1)`` is simple shooting. ``engine`` integrates:
    :class:`varcalc.integrators.Taylor` or :class:`varcalc.integrators.Dop853`, by
    default what is installed (:class:`varcalc.integrators.OnDemand`).

    It finds stationary curves, and of several it has come upon the one of the
    lowest value; that it is a minimum is not shown here.

    Raises TypeError or ValueError for ``segments`` that are no positive whole number, and an ``engine`` that is none.
    """

    segments: int | None = None
    engine: Engine | None = None

    def __post_init__(self) -> None:
        if self.segments is not None:
            whole("Shooting.segments", self.segments)
        if isinstance(self.engine, type) or not (self.engine is None or hasattr(self.engine, "compile")):
            hint = f"{self.engine.__name__}()" if isinstance(self.engine, type) else "Taylor() or Dop853()"
            raise TypeError(f"Shooting.engine must be an engine, not {self.engine!r}; write varcalc.integrators.{hint}")

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """The extremal of a form; REFUSED or NOT_CONVERGED, with the reason, where there is none."""
        problem = form.problem
        begun = time.perf_counter()
        reason = _inapplicable(form)
        if reason:
            return no_answer(problem, self, Status.REFUSED, reason)
        equations = EulerLagrangeFlow(form)
        try:
            engine = self.engine or default(most_steps=MOST_STEPS_OF_SHOT)
            flow = compiled(problem, engine, equations.system.system)
        except CannotLower as refusal:
            return no_answer(problem, self, Status.REFUSED, str(refusal))
        built = time.perf_counter()
        found = Search(equations, flow, Work(), self.segments).best(guess)
        if isinstance(found, NoneFound):
            stats = Stats(built - begun, time.perf_counter() - built, found.iterations)
            return no_answer(problem, self, Status.NOT_CONVERGED, found.message, stats=stats)
        finished = finish(found.segments, found.x, found.floor)
        if isinstance(finished, Failure):
            return no_answer(problem, self, Status.NOT_CONVERGED, describe(finished))
        seconds = time.perf_counter() - built
        stats = Stats(built - begun, seconds, found.iterations, found.segments.size, found.segments.count)
        return self._answer(finished, tol, stats)

    def _answer(self, finished: Finished, tol: float, stats: Stats) -> Solution:
        """The Solution, with the status that the claimed error earns."""
        form, error = finished.extremal.form, finished.error
        relative = error.value / max(1.0, abs(finished.value))
        status, message = Status.SOLVED, ""
        if not relative <= tol:
            costly = self.segments is not None and finished.growth > 10**COSTLY
            limit = (
                BEST_POSSIBLE
                if costly
                else max(BEST_POSSIBLE, min(ROUND_OFF_PER_CONDITION * finished.condition, ILL_POSED))
            )
            status = Status.ROUND_OFF if relative <= limit else Status.NOT_CONVERGED
            message = _imprecise(finished, relative, tol, self.segments)
        if not math.isfinite(finished.value) or not math.isfinite(relative):
            status = Status.NOT_CONVERGED
        value = form.sign * finished.value
        return answer(finished.extremal, self, value, error, finished.extremal.vertices, stats, status, message)


def _inapplicable(form: Form) -> str:
    """Why shooting does not apply to a form; empty when it does."""
    if form.conditions.pathwise:
        return (
            "shooting integrates the Euler-Lagrange equation, which does not hold along an obstacle or a "
            "pathwise constraint; use Ritz() for Bound and Holonomic"
        )
    if any(not c.equality for c in form.conditions.integrals):
        return "shooting needs isoperimetric levels that are prescribed exactly; use Ritz() for lower= and upper="
    if form.coordinates.weak_only or _infinite_end(form):
        return (
            "the integrand is infinite or undefined at an end, where an initial-value problem cannot start, in "
            f"coordinates that do not fix the end there ({form.coordinates.note or 'graph form'}); "
            "use Ritz() or FirstIntegral()"
        )
    slope = form.symbols.ddy if form.order == 2 else form.symbols.dy
    if ca.hessian(form.integrand, slope)[0].nnz() == 0 and not form.conditions.integrals:
        return (
            "the integrand is at most linear in the highest slope, so its Euler-Lagrange equation is no differential "
            "equation that could be integrated, and nothing in it fixes a curve"
        )
    return ""


def _infinite_end(form: Form) -> bool:
    """True when an end is singular and no regular arc leads there.

    Regular arcs lead to ends that are known to be singular and whose ordinates
    are all fixed. Other fixed ends are singular when the integrand is not a
    number there, whatever the slope.
    """
    integrand = ca.Function("integrand", form.symbols.all, [form.integrand])
    for s, fixed, singular in zip(form.span, (form.ends.start, form.ends.end), form.coordinates.singular, strict=True):
        if singular or np.isnan(fixed[0]).any():
            if singular and np.isnan(fixed[0]).any():
                return True
            continue
        slopes = [np.nan_to_num(fixed[1]) if form.order == 2 else np.zeros(form.n) for _ in END_SLOPES]
        values = [
            float(integrand(s, fixed[0], slope + v, np.zeros(form.symbols.ddy.numel()) + v,
                            form.problem.parameter_values, form.start.unknowns))
            for slope, v in zip(slopes, END_SLOPES, strict=True)
        ]  # fmt: skip
        if not np.isfinite(values).any():
            return True
    return False


def _imprecise(finished: Finished, relative: float, tol: float, segments: int | None) -> str:
    """Why the tolerance was not met, and what to do."""
    digits = math.log10(max(finished.growth, 1.0))
    if not math.isfinite(relative):
        return "the segments all but match, but nowhere near do they match: next to a fold there may be no extremal"
    says = f"the error of the value is {relative:.1e} of its size, more than tol = {tol:.1e}"
    if segments is not None and digits > COSTLY:
        return (
            f"{says}: errors grow by 1e{digits:.1f} across a segment, which costs {digits:.1f} of the 16 digits; "
            "use Shooting() with segments chosen by the growth, or Collocation()"
        )
    if relative <= BEST_POSSIBLE:
        return f"{says}; double precision allows no better"
    return (
        f"{says}; the extremal is ill-conditioned (condition number {finished.condition:.1e}): "
        "its ends may be nearly conjugate to each other"
    )
