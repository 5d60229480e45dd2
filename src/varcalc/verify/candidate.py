"""The curve under test, in coordinates in which it is regular, and the extremal it stands for, to round-off.

The value of a functional is stationary, so a solution whose value has twelve
digits may have six in the curve, and no more would be had of its conjugate
points. So the curve is polished: Newton's iteration for the Euler-Lagrange
equation, begun at the curve, on meshes ever finer.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from varcalc.formulation import Form, Sampled, conditions_of
from varcalc.formulation.singular import forms
from varcalc.methods.answer import Extremal, lifted, person_curve
from varcalc.methods.collocation.error import Assessment, Root
from varcalc.methods.collocation.newton import Sizes, start_multipliers
from varcalc.methods.collocation.refinement import Refinement
from varcalc.methods.collocation.starting_curves import function_sizes, resolving_vertices
from varcalc.methods.collocation.system import CollocationSystem, collocation_space
from varcalc.methods.crossings import met_by, stretches_beside_jumps
from varcalc.methods.ritz.method import Ritz
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import Functional
from varcalc.solution import Solution
from varcalc.verify.along_curve import AlongCurve, along_curve, touches, without_inequalities
from varcalc.verify.given_curve import distinct, ordinates_of, stated

if TYPE_CHECKING:
    from varcalc.verify.check import Check

T = TypeVar("T")
HELD_TO = 1e-6
"""Argument of a kink, in its own units, along which a curve that an interior-point method found is held by it."""
POLISH_REACH = 1e-3
"""Relative distance a curve may move while it is polished, when its own error claims less."""
COMPARED_POINTS = 65
"""Points at which two curves are compared."""
FIRST_POLISHED_DEGREE = 16
"""Degree at which a curve is polished first."""
HIGHEST_POLISHED_DEGREE = 40
POLISHED_ERROR = 1e-14
"""Relative error of a polished curve."""
POLISHING_ROUNDS = 8
MOST_POLISHED_UNKNOWNS = 4000
MOST_VERTICES = 65
"""Vertices of a given curve's mesh beyond which it is not taken over."""
ENDS_KNOWN = 1e-6
"""How nearly the ends of a stretch along which a curve is held are known, in units of its length."""
NEGLIGIBLE_VARIATION = 1e-12
"""Variation of a function, in units of its size, that is round-off."""


@dataclass(frozen=True)
class Candidate:
    """A solution's curve: ``own`` as it was found, ``best`` the extremal it stands for.

    ``own`` is None when the method gave the curve in the user's coordinates
    alone and these are singular. ``best`` is in regular coordinates, without
    inequalities; None where there are no such coordinates, or where the curve
    touches a bound. ``reason`` says what stood in the way of polishing.
    """

    solution: Solution
    own: Extremal | None
    best: Extremal | None
    reason: str
    touched: bool = False
    held: tuple[tuple[float, float], ...] = ()
    """Stretches along which a kink or a jump of L holds the curve: there L_y is none of either side's."""
    _measured: dict[Check[Any], Any] = field(default_factory=dict, repr=False)

    def measured(self, check: Check[T]) -> T:
        """What a check finds along the curve, measured when it is first asked for."""
        if check not in self._measured:
            self._measured[check] = check.measure(self)
        return self._measured[check]

    @property
    def problem(self) -> Functional:
        """The problem the solution is of."""
        return self.solution.problem

    @cached_property
    def along(self) -> AlongCurve:
        """The Lagrangian function along the solution's curve, in the user's coordinates; no energy, no gauge."""
        return _in_user_coordinates(self)

    @cached_property
    def along_own(self) -> AlongCurve | None:
        """The same along ``own``, as it was solved."""
        return None if self.own is None else along_curve(self.own)

    @cached_property
    def along_best(self) -> AlongCurve | None:
        """The same along ``best``, the extremal."""
        return None if self.best is None else along_curve(self.best)


def candidate(solution: Solution) -> Candidate:
    """The curve of a solution, and the extremal it stands for."""
    own = undivided(solution.extremal, solution.value) if solution.extremal is not None else _regular(solution)
    if own is not None and touches(own):
        return Candidate(solution, own, None, "the curve touches a bound", True)
    met = met_by(solution, HELD_TO) if on_curve(solution.problem) else []
    held = tuple((c.x, c.until) for c in met if c.until is not None)
    if on_curve(solution.problem):
        held += tuple(stretches_beside_jumps(solution, HELD_TO))
    if held and own is not None and not own.form.broken_at_switches:
        # the force of what is crossed elsewhere is none of either side's either
        held = tuple(sorted([*held, *((c.x, c.x) for c in met if c.until is None and not _within(c.x, held))]))
        return Candidate(solution, own, None, "a kink or a jump of L holds the curve", held=held)
    start = own if own is not None and not own.form.coordinates.weak_only else in_regular_form(solution)
    if start is None:
        reason = "no coordinates are at hand in which Jacobi's equation is regular"
        return Candidate(solution, own or _minimised(solution), None, reason)
    start = without_inequalities(start)
    with np.errstate(all="ignore"):  # what is no number is rejected
        outcome = polished(start)
        if not isinstance(outcome, str):
            outcome = _staying(solution, outcome)
    if isinstance(outcome, str) and own is None:
        return Candidate(solution, _minimised(solution), None, outcome)
    if isinstance(outcome, str):
        # a curve that is only sampled in the form's coordinates is no basis for derivatives
        return Candidate(solution, own, None if own is None or own.form.coordinates.weak_only else start, outcome)
    return Candidate(solution, own, outcome, "")


def _within(x: float, stretches: tuple[tuple[float, float], ...]) -> bool:
    """Whether an abscissa lies on one of some stretches, or at its ends as nearly as these are known."""
    return any(low - ENDS_KNOWN * (high - low) <= x <= high + ENDS_KNOWN * (high - low) for low, high in stretches)


def undivided(extremal: Extremal, value: float) -> Extremal:
    """The extremal with multipliers of what is minimised: those of an energy J^2 were divided by 2 J for the answer."""
    if not extremal.form.coordinates.energetic:
        return extremal
    factor = 2.0 * abs(value)
    path = {k: lambda s, mu=mu: factor * mu(s) for k, mu in extremal.path.items()}
    return replace(extremal, path=path)


def _regular(solution: Solution) -> Extremal | None:
    """The curve of a method that works in the user's own coordinates, where these are regular."""
    form = next(filter(None, forms(solution.problem)))
    if (
        any(form.coordinates.singular)
        or form.coordinates.weak_only
        or (form.coordinates.energetic and form.lift is not None)
    ):
        return None
    return stated(solution, form)


def in_regular_form(solution: Solution) -> Extremal | None:
    """The curve as it was found, in coordinates in which it is regular; None where none are at hand."""
    found = (form for form in forms(solution.problem) if form is not None and not form.coordinates.weak_only)
    form = next(found, None)
    return None if form is None else stated(solution, form)


def _minimised(solution: Solution) -> Extremal | None:
    """The curve in coordinates in which only minimisation finds it, if it is found there."""
    for form in forms(solution.problem):
        if form is None or not form.coordinates.weak_only:
            continue
        found = Ritz(starts=1).solve(form, tol=1e-10, guess=form.coordinates.pull(ordinates_of(solution)))
        if found.status.ok and found.extremal is not None and not isinstance(_staying(solution, found.extremal), str):
            return undivided(found.extremal, found.value)
    return None


def polished(start: Extremal) -> Extremal | str:
    """The extremal near a curve; the reason when there is none near."""
    form = start.form
    reason = _inapplicable(form)
    if reason:
        return reason
    degree = max(FIRST_POLISHED_DEGREE, form.coordinates.least_degree)

    def ordinates(s: np.ndarray) -> np.ndarray:
        return start.evaluate(s, 0)

    sizes = function_sizes(form)
    given = start.vertices
    if len(given) > MOST_VERTICES:  # a method of low order needs many where this one needs few
        given = np.array([form.span[0], *form.conditions.knots, form.span[1]])
    vertices = resolving_vertices(ordinates, given, degree, NEGLIGIBLE_VARIATION * sizes)
    scales = Sizes(sizes, np.abs(form.start.unknowns))
    system = CollocationSystem(form, collocation_space(form, vertices, degree))
    if system.size > MOST_POLISHED_UNKNOWNS:
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
    for _, assessment in refinement.levels(level, _climbs, POLISHING_ROUNDS, MOST_POLISHED_UNKNOWNS):
        # the assessment's own curve is corrected once more, so better than the step that led to it
        if best is not None and assessment.curve_error > 0.5 * best.curve_error:
            break
        best = assessment
        if best.curve_error <= POLISHED_ERROR * size:
            break
    return best


def _inapplicable(form: Form) -> str:
    if form.coordinates.weak_only:
        return "at the singular end only regularity decides"
    if form.broken_at_switches:
        return "the curve is broken where the problem has kinks or jumps"
    if any(not c.equality for c in (*form.conditions.integrals, *form.conditions.pathwise)):
        return "inequalities are active"
    return ""


def _climbs(_: Root, assessment: Assessment) -> bool:
    """Whether the degree is raised once more."""
    return (
        assessment.system.space.degree <= HIGHEST_POLISHED_DEGREE and assessment.system.size <= MOST_POLISHED_UNKNOWNS
    )


def _staying(solution: Solution, best: Extremal) -> Extremal | str:
    """The polished curve, unless it has left the solution's; held against each other in the user's coordinates."""
    assert solution.curve is not None
    x = np.linspace(float(solution.x.min()), float(solution.x.max()), COMPARED_POINTS)
    given, found = solution.curve(x, 0), person_curve(best)(x, 0)
    moved = float(np.abs(found - given).max())
    if moved <= max(POLISH_REACH * float(np.abs(given).max()), 10.0 * solution.error.curve):
        return best
    return f"Newton's iteration for the Euler-Lagrange equation moves it by {moved:.2g}"


def _in_x(own: Extremal | None, s: tuple[float, ...]) -> tuple[float, ...]:
    """Abscissae of a form as the user's."""
    return s if own is None or own.form.lift is None or not s else tuple(lifted(own, np.array(s))[0].tolist())


def _in_user_coordinates(candidate: Candidate) -> AlongCurve:
    solution, own, along = candidate.solution, candidate.own, candidate.along_own
    if own is not None and along is not None and (own.form.lift is None or along.slides):
        if own.form.coordinates.energetic:
            factor = 0.5 / abs(solution.value)  # multipliers of J^2 become those of J by the chain rule
            forces = tuple(_times(factor, mu) for mu in along.forces)
            along = replace(along, forces=forces)
        return replace(along, integrand=own.form.functional) if not along.slides else along
    problem = solution.problem
    assert solution.curve is not None
    form = own.form if own is not None else next(filter(None, forms(problem)))
    sign = problem.sign
    nodes = distinct(solution.x)
    numbers = np.array([solution.unknowns[k] for k in problem.unknowns], dtype=float)
    conditions = conditions_of(problem, lambda expression, _: expression)
    integrals, paths = conditions.integrals, conditions.pathwise
    lambdas = -sign * np.array([float(solution.multipliers[c.index]) for c in integrals])
    forces = [solution.multipliers[c.index] if solution.multipliers else None for c in paths]
    return AlongCurve(
        extremal=Extremal(form, solution.curve, numbers, nodes, lambdas, {}),
        symbols=problem.symbols,
        order=problem.order,
        integrand=sign * problem.integrand,
        integrals=tuple(c.expression for c in integrals),
        paths=tuple(c.expression for c in paths),
        limits=paths,
        lambdas=lambdas,
        forces=tuple(np.zeros_like if mu is None else _times(sign, mu) for mu in forces),
        span=(float(nodes[0]), float(nodes[-1])),
        vertices=nodes,
        evaluate=solution.curve,
        numbers=numbers,
        slides=False,
        held=_in_x(own, form.held),
        rides=tuple((a, b) for a, b in (_in_x(own, ride) for ride in form.rides)),
    )


def _times(factor: float, mu: Sampled) -> Sampled:
    return lambda s: factor * mu(s)
