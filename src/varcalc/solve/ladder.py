"""solve: one problem, the best answer that can be vouched for, or the reason why not."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import casadi as ca
import numpy as np

from varcalc.existence.above_kinks import above_kinks
from varcalc.existence.approach import outdone
from varcalc.existence.closer_meshes import CLOSER_MESHES, agree, on_closer_meshes
from varcalc.existence.constant_speed import at_constant_speed
from varcalc.existence.fading import attained
from varcalc.existence.feasibility import explained, sure_contradiction
from varcalc.existence.global_look import FINE, IN_NARROW, Polish, has_lattice, looked_around
from varcalc.existence.held_throughout import resting
from varcalc.existence.polygons import Polygon
from varcalc.existence.refraction import meets_switches, refracted, smooth_or_refused, with_what_switches
from varcalc.existence.upright import beyond_graphs, not_attained, upright
from varcalc.formulation import Form, Sampled, formulate
from varcalc.formulation.height import flat
from varcalc.formulation.singular import Forms, Infinite, forms
from varcalc.formulation.singular.detection import singular_ends
from varcalc.methods.answer import in_coordinates_of, unsettled
from varcalc.methods.arguments import Guess, KnownCurve, Start, check_arguments, check_guess, sampled_guess
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.resampled import polynomials
from varcalc.problem.breaks import breakable, kinks_at_ends, on_curve, switches_of
from varcalc.problem.conditions import Bound, Isoperimetric, truth
from varcalc.problem.convexity import proved_jointly_convex, proved_least, proved_quadratic
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.progress import Interrupted, Progress, telling
from varcalc.solution import (
    WORTHLESS_ERROR,
    InfeasibleError,
    Solution,
    Status,
    VariationalError,
    Verdict,
    no_answer,
    refusal,
    refused,
)
from varcalc.solve.warm_start import resolved
from varcalc.spelling import spelled
from varcalc.symbolic.derived import answered
from varcalc.verify.between import Unseen, as_stated, balanced, of_powers_alone, unseen
from varcalc.verify.singular_ends import oscillation, without_bound
from varcalc.verify.slopes import vouched

FINER_DEGREE = 8
"""Degree at most with which a finer mesh is begun."""
FEW_UNKNOWNS = 400
"""Unknowns up to which it is begun with the degree of the known curve, which is one of its own then."""
FEW_STARTS = 2
"""Curves from which an answer is looked for first where it is not known that there is one."""
CONCLUSIVE = {Verdict.NOT_ATTAINED, Verdict.DEGENERATE, Verdict.INFEASIBLE}
"""What no other starting curve would change."""
FINER_STARTS = 2
"""Curves at most from which it is begun: the known one is what it is for."""
NO_LENGTH = "the functional is not the length of a metric that it is taken for"
MOST_ELEMENTS = 1000
"""Elements on which an extremal is held: one that needs more is singular somewhere."""
LARGE_MESH = 100_000
"""Unknowns from which on a mesh that led to no answer is made no finer."""
LOOSEST_TOLD = 1e-4
"""The loosest tolerance: by what coarser meshes differ their errors are not told."""
WORTH = 0.1
"""Share of the tolerance that what lies between the points of an answer may come to, all together."""
MOST_MARKS = 10_000
"""Elements for which no problem is solved anew: what asks for so many varies everywhere."""


Told = Callable[[str], Any]
"""Who is told what comes next."""


class Method(Protocol):
    """What every method offers: a solve of one form."""

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """A Solution, with a status that says why when there is none."""
        ...


@spelled
def solve(
    problem: Functional,
    method: Method | None = None,
    *,
    tol: float = 1e-10,
    throw: bool = True,
    guess: Guess = None,
    progress: Progress = None,
) -> Solution:
    """The extremal that makes the functional least (greatest with ``maximise``).

    ``tol`` bounds the error of the value relative to max(1, abs(value)); nothing looser than 1e-4 is asked for, as
    errors that large are not told from a curve that was not seen.
    ``guess`` is a function of x (of t for a Curve) or an earlier Solution.
    Without ``method`` the cheapest route that meets the tolerance is taken.
    ``progress`` is as :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which holds
    the curve that was being examined, or a Solution that says that there was none yet.

    Raises VariationalError, with the status, the verdict and what was found,
    when there is no answer that stands; with ``throw=False`` the Solution is
    returned with that status instead. Raises TypeError or ValueError for
    unusable arguments.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> line = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, 4))
    >>> round(solve(line).value, 12)
    5.0
    """
    check_arguments(problem, method, tol)
    truth("throw", throw)
    tol = min(tol, LOOSEST_TOLD)
    known = resolved(problem, method, tol, guess)
    if known is not None:
        return known
    check_guess(problem, guess)
    with telling(progress, problem.name) as told:
        try:
            solution = _found(problem, method, tol, guess, partial(told, 0, None))
        except Interrupted:
            raise
        except KeyboardInterrupt as stop:
            nothing = no_answer(problem, method or LADDER[0], Status.NOT_CONVERGED, "stopped before a curve was found")
            raise Interrupted(nothing) from stop
    if throw and not solution.status.ok:
        raise (InfeasibleError if solution.verdict is Verdict.INFEASIBLE else VariationalError)(solution)
    return solution


def _found(problem: Functional, method: Method | None, tol: float, guess: Guess, told: Told) -> Solution:
    """The answer of a method or of the ladder, examined; a status that says why where there is none."""
    told("whether there is an answer")
    if isinstance(problem, Curve) and on_curve(problem) and isinstance(method or LADDER[0], Ritz):
        from varcalc.existence.by_energy import by_energy  # few curves meet what switches

        def solved(given: Problem, start: Sampled | None = None) -> Solution:
            return _found(given, method, tol, guess if start is None else start, told)

        known = by_energy(problem, solved, guided=guess is not None)
        if known is not None:
            return known
    solution = _hopeless(problem, method or LADDER[0]) or _without_room(problem, method or LADDER[0])
    if solution is not None and solution.verdict is Verdict.INFEASIBLE:
        return solution
    solution = solution or _with_ends_given(problem, method, tol, guess, told)
    if solution is None and guess is None and breakable(problem):
        told("curves with corners")
        solution = _with_corners(problem, method or LADDER[0], tol)
        if solution is None and method is None:
            solution = _clear_of_switches(problem, tol)
    if solution is None and breakable(problem):
        told("curves that break at what switches")
        solution = _broken(problem, method or LADDER[0], tol, guess)
    smooth = solution is None
    if solution is None:
        solution = _climbed(problem, tol, guess, told) if method is None else _attempt(problem, method, tol, guess)
    try:
        return _examined(problem, method, tol, guess, solution, smooth, told)
    except KeyboardInterrupt as stop:
        raise Interrupted(solution) from stop


def _with_ends_given(
    problem: Functional, method: Method | None, tol: float, guess: Guess, told: Told
) -> Solution | None:
    """The answer by problems whose free or sliding ends are given, where kinks or bounds hold them; None for none."""

    def solved(given: Problem) -> Solution:
        return _found(given, method, tol, None, told)

    solution = None
    if kinks_at_ends(problem):
        from varcalc.existence.held_ends import held_at_an_end  # few problems have kinks there

        solution = held_at_an_end(problem, solved)
    if solution is not None or guess is not None or not isinstance(method or LADDER[0], Ritz):
        return solution
    if breakable(problem) and any(problem.of_type(Bound)):
        from varcalc.existence.held_ends import held_by_a_bound  # few problems switch under bounds

        return held_by_a_bound(problem, solved)
    if any(problem.slides) and on_curve(problem):
        from varcalc.existence.sliding_ends import at_best_place  # few ends slide beside what switches

        return at_best_place(problem, solved)
    return None


def _without_room(problem: Functional, method: Method) -> Solution | None:
    """The refusal where conditions contradict each other, asked before anything is tried that takes long; or None."""
    if not problem.constraints:
        return None
    found = None
    if any(problem.of_type(Bound)):
        from varcalc.existence.no_room import no_room  # few problems have bounds

        found = no_room(problem)
    # what switches leads to many curves, each of which would be held to levels that none can have
    levels = found is None and breakable(problem) and any(problem.of_type(Isoperimetric))
    if levels and (contradicted := sure_contradiction(problem)) is not None:
        found = contradicted.finding
    return None if found is None else refusal(problem, method, found)


def _with_corners(problem: Functional, method: Method, tol: float) -> Solution | None:
    """The minimum with corners where L switches and is not convex in the slope, or that none is attained; or None.

    Between what switches no smooth curve is least there, and those that are tried for it take long.
    """
    if not isinstance(method, Ritz):
        return None
    from varcalc.existence.second_look import about_corners  # few solves need all that it imports

    solution = about_corners(problem, tol, no_answer(problem, method, Status.NOT_CONVERGED, ""))
    return solution if solution.status.ok or solution.verdict is not None else None


def _examined(
    problem: Functional, method: Method | None, tol: float, guess: Guess, solution: Solution, smooth: bool, told: Told
) -> Solution:
    """What a route came to, looked at again: whether it stands, why there is no answer, where others may be."""
    if method is not None and not solution.status.ok:
        solution = _once_more(solution, method, tol)
    if method is None and not solution.status.ok:
        from varcalc.existence.second_look import second_look  # few solves need all that it imports

        told("why there is no answer")
        solution = _nothing_between(_made_out(second_look(problem, tol, solution, smooth=smooth)))
    elif method is not None and smooth:  # what is broken, or rests, was held to what it meets
        solution = with_what_switches(_made_out(solution))
    if not solution.status.ok:
        return beyond_graphs(solution)
    told("other valleys")
    # whoever gives a guess asks for the valley it lies in
    followed = (method is None or isinstance(method, Ritz)) and guess is None
    return looked_around(solution, partial(_beside, tol), tol, followed=followed)


LADDER: tuple[Ritz, ...] = (Ritz(), Ritz(elements=24, starts=1))
"""The route taken first: the direct method is the cheapest for most single solves, and it alone ends at a
minimum by construction (see docs/methods.md for the figures). What one element does not lead to, such as a kink on a
long way, many may."""


def _beside(tol: float, known: Solution) -> Polish:
    """The way to answers next to curves that depart from a known one: ends that slide begin where its own are."""
    problem = known.problem
    if isinstance(problem, Problem) and any(problem.slides):
        start, end = (
            replace(end, x=at) if end.slides else None
            for end, at in zip((problem.start, problem.end), known.interval, strict=True)
        )
        problem = problem.restated(start=start, end=end)
    return partial(_polished, problem, tol)


def _polished(problem: Functional, tol: float, method: Ritz, start: Sampled, marks: tuple[float, ...] = ()) -> Solution:
    """The answer of the direct method next to a curve, on a mesh with the ``marks``; next to a polygon it is kept."""
    if isinstance(start, Polygon):
        return replace(_next_to_polygon(problem, tol, method, start), problem=problem)
    return _next_to(problem, tol, method, start, marks)


@answered
def _next_to_polygon(problem: Functional, tol: float, method: Ritz, polygon: Polygon) -> Solution:
    return _next_to(problem, tol, method, polygon)


def _next_to(problem: Functional, tol: float, method: Ritz, start: Sampled, marks: tuple[float, ...] = ()) -> Solution:
    known = _broken(problem, method, tol, KnownCurve(start), marks, LADDER[0])
    if known is not None:
        return known
    if marks:
        return _on_mesh(problem, method, tol, start, marks)
    return _made_out(_first_answer(problem, method, tol, KnownCurve(start)))


def reconsidered(solution: Solution, method: Method | None, tol: float) -> Solution:
    """The answer that was begun from a neighbour's curve, or that of a solve from no guess where it is lower or local.

    Where no lattice shows other valleys, the problem is solved afresh.
    """
    problem = solution.problem
    if proved_least(problem):
        return solution
    if has_lattice(problem):
        followed = method is None or isinstance(method, Ritz)
        fresh = looked_around(solution, partial(_beside, tol), tol, followed=followed)
    else:
        fresh = solve(problem, method, tol=tol, throw=False)
    if not fresh.status.ok:
        return solution
    margin = solution.error.value + fresh.error.value
    lower = problem.sign * fresh.value < problem.sign * solution.value - margin
    return fresh if lower or (fresh.local and not solution.local) else solution


def _quadrature() -> Method:
    """The route by quadrature, imported by the few solves that need it."""
    from varcalc.methods.first_integral.method import FirstIntegral

    return FirstIntegral()


def _collocation() -> Method:
    from varcalc.methods.collocation.method import Collocation

    return Collocation()


def _reduces(method: Method) -> bool:
    """Whether a method is a reduction to quadrature, which goes its own way at singular ends."""
    from varcalc.methods.first_integral.method import FirstIntegral

    return isinstance(method, FirstIntegral)


def _hopeless(problem: Functional, method: Method) -> Solution | None:
    """A refusal where L alone shows that nothing fixes a curve, or that nothing bounds the functional."""
    if (linear := _linear(problem, method)) is not None:
        return linear
    found = without_bound(problem) if proved_quadratic(problem) and any(singular_ends(problem)) else None
    return None if found is None else refusal(problem, method, found)


def _linear(problem: Functional, method: Method) -> Solution | None:
    """A refusal when a first-order Lagrangian is linear in the slope, in which case nothing in it fixes a curve.

    One without the slope that is convex does: by where it is least at each abscissa.
    """
    if not isinstance(problem, Problem) or problem.order != 1 or problem.constraints or not problem.linear:
        return None
    depends = ca.depends_on(problem.integrand, problem.symbols.dy)
    if not depends and proved_jointly_convex(problem):
        return None
    message = f"the Lagrangian {'is linear in' if depends else 'does not contain'} the slope: "
    message += "nothing in it fixes a curve between these ends"
    return no_answer(problem, method, Status.REFUSED, message, Verdict.SINGULAR)


def _climbed(problem: Functional, tol: float, guess: Guess, told: Told) -> Solution:
    """The ladder: each route in turn, and extremals of the indirect ones as starts for the direct one.

    An extremal that an indirect method finds may be a saddle. It is an answer
    only when minimising from there stays at it.
    """
    failures: list[Solution] = []
    # where there is a first integral, it costs far less than more starting curves do, and sees walls however narrow
    for method, guide in zip(LADDER, (_quadrature, None), strict=True):
        told(type(method).__name__)
        solution = _made_out(_attempt(problem, method, tol, guess))
        if not failures and not solution.status.ok:
            from varcalc.existence.second_look import about_corners  # few solves need all that it imports

            # where L is not convex in the slope more curves lead to no more
            solution = _made_out(about_corners(problem, tol, solution))
        # whoever gives a guess asks for the valley it lies in
        unguided = not failures and guess is None and not solution.status.ok and solution.verdict is None
        if unguided and not _without_x(problem):
            solution = _from_polygons(problem, tol, told) or solution
        if not failures and not solution.status.ok:
            solution = _kinked(problem, method, tol) or solution
        if not solution.status.ok:
            solution = _once_more(solution, method, tol)
        # what is all but free to move along itself may stand where round-off holds it: quadrature says where it lies,
        # except where L is quadratic, and all such curves are worth the same
        degenerate = solution.verdict is Verdict.DEGENERATE and not proved_quadratic(problem)
        if solution.status.ok or (solution.verdict is not None and not degenerate):
            return solution
        failures.append(solution)
        found = None if guide is None else _guided(problem, guide(), tol, guess, told)
        if unguided and found is None and _without_x(problem):
            found = _from_polygons(problem, tol, told)
        if found is not None and found.status.ok:
            return found
        if degenerate:
            return solution
    found = _guided(problem, _collocation(), tol, guess, told)
    return found or _short_of_tolerance(failures, tol) or failures[0]


def _short_of_tolerance(failures: Sequence[Solution], tol: float) -> Solution | None:
    """What the direct method knows best under inequalities, to fewer digits than were asked for; None for nothing.

    How nearly a curve is known whose contacts are not placed ends with the digits of IPOPT's multipliers: what it
    claims is honest, but no refinement leads further. Where it does not stand for another reason, that is told.
    """
    nearest = min(failures, key=lambda s: s.error.value)
    extremal, curve = nearest.extremal, nearest.curve
    if extremal is None or curve is None or nearest.verdict is not None or not extremal.form.has_inequalities:
        return None
    size = max(float(np.abs(curve(nearest.x, 0)).max()), flat(extremal.form))
    known = nearest.error.value <= WORTHLESS_ERROR * max(1.0, abs(nearest.value))
    if not known or nearest.error.curve > unsettled(tol) * size:
        return None
    solution = _nothing_between(replace(nearest, status=Status.ROUND_OFF, message=""))
    solution = _standing(LADDER[0], extremal.form, solution, tol)
    return (
        _made_out(_vouched(solution, None, extremal.form, forms(nearest.problem))) if solution.status.ok else solution
    )


def _without_x(problem: Functional) -> bool:
    """Whether L holds no x, so that there is a first integral."""
    return not ca.depends_on(problem.integrand, problem.symbols.x)


def _from_polygons(problem: Functional, tol: float, told: Told) -> Solution | None:
    """The answer in the valley of a least polygon; None where none was found."""
    if proved_jointly_convex(problem) or breakable(problem):  # what switches was begun from them before
        return None
    from varcalc.existence.least_polygons import in_the_middle, least_polygons  # few solves need them

    told("polygons")
    polygons = least_polygons(problem)
    ways = [(IN_NARROW, p, p.marks) for p in polygons] + [(FINE, in_the_middle(problem, p), ()) for p in polygons]
    for method, polygon, marks in ways:
        solution = _polished(problem, tol, method, polygon, marks)
        if solution.status.ok:
            return solution
    return None


def _clear_of_switches(problem: Functional, tol: float) -> Solution | None:
    """The answer beside bounds in the valley of the least polygon, if that meets nothing that switches; None for none.

    What switches on the way there from the line and bounds together keep an interior-point method busy.
    """
    if not (isinstance(problem, Problem) and breakable(problem) and any(problem.of_type(Bound))):
        return None
    from varcalc.existence.least_polygons import least_polygons  # few solves need them

    for polygon in least_polygons(problem)[:1]:
        if not meets_switches(problem, polygon):
            solution = _on_mesh(problem, IN_NARROW, tol, polygon, polygon.marks)
            return solution if solution.status.ok else None
    return None


def _kinked(problem: Functional, method: Ritz, tol: float) -> Solution | None:
    """The minimum of a problem with convex kinks at which no broken curve was found; None for any other."""
    kinks = isinstance(problem, Problem) and problem.order == 1 and not problem.start.periodic
    if not kinks or all(switch.smooth for switch in on_curve(problem)):
        return None

    def solved(marked: Functional) -> Solution | None:
        form = formulate(marked)
        return above_kinks(form, method, tol, form.start.curve)

    return on_closer_meshes(problem, solved)


def _guided(problem: Functional, guide: Method, tol: float, guess: Guess, told: Told) -> Solution | None:
    """The minimum at the extremal of a ``guide``, an indirect route; None where there is none.

    Where L is convex the extremal is the minimum. Else it is minimised from there, on a mesh that holds it, or on one
    that is refined from the start.
    """
    if formulate(problem).has_bounds:  # which no indirect route treats
        return None
    told(type(guide).__name__)
    extremal = _made_out(_attempt(problem, guide, tol, guess))
    if not extremal.status.ok or proved_least(problem):
        return extremal if extremal.status.ok else None
    solution = _on_its_mesh(problem, tol, extremal)
    if solution is None or not solution.status.ok:
        solution = _made_out(_attempt(problem, replace(LADDER[0], starts=1), tol, extremal))
    return solution if solution.status.ok or solution.verdict is Verdict.DEGENERATE else None


def _on_its_mesh(problem: Functional, tol: float, extremal: Solution) -> Solution | None:
    """The answer of the direct method on elements on which polynomials hold an extremal; None where none do."""
    curve = extremal.curve
    if curve is None or not isinstance(problem, Problem):
        return None
    vertices = polynomials(lambda x: curve(x, 1), np.unique(extremal.x)).edges[1:-1]
    if len(vertices) > MOST_ELEMENTS:
        return None
    way = replace(LADDER[0], starts=1, degree=FINER_DEGREE)
    return _on_mesh(problem, way, tol, lambda x: curve(x, 0), vertices.tolist())


def _on_mesh(problem: Functional, method: Ritz, tol: float, start: Sampled, vertices: Sequence[float]) -> Solution:
    """The answer of the direct method from a curve, on elements between ``vertices``."""
    form = formulate(problem)
    if form.stated.is_lifted and isinstance(problem, Problem):  # the abscissae of curves with ends that slide
        vertices = np.interp(vertices, problem.span, form.span).tolist()
    form = form.on_mesh(vertices)
    solution = _in_form(method, form, tol, form.coordinates.pull(start))
    return _made_out(_vouched(replace(solution, method=LADDER[0]), None, form, forms(problem)))


def _broken(
    problem: Functional,
    method: Method,
    tol: float,
    guess: Start,
    marks: Sequence[float] = (),
    refining: Ritz | None = None,
) -> Solution | None:
    """The answer of the direct method in pieces, or a refusal, where its curve meets what switches; None elsewhere.

    A mesh that is not of the person's own is refined as ``refining`` does.
    """
    if not (isinstance(method, Ritz) and breakable(problem)):
        return None
    held = on_closer_meshes(problem, lambda marked: resting(marked, method))
    if held is not None:
        return held
    start = _sampled(problem, formulate(problem), guess)
    found = at_constant_speed(problem, refining or method, tol, start)
    if found is not None and unseen(found) is None and as_stated(found):
        return found
    return on_closer_meshes(problem, lambda marked: refracted(marked, method, tol, start, marks))


def _attempt(problem: Functional, method: Method, tol: float, guess: Guess) -> Solution:
    """The first answer of a method that stands, over all forms; else the failure that got furthest, explained.

    Where there is a choice of forms each is tried from the first starting curves before any is tried from all, and
    bounds that no curve meets are told of before many are spent on them.
    """
    several, bounds = _count(problem) > 1, any(problem.of_type(Bound))
    if bounds and (none := not_attained(problem, method)) is not None:  # under bounds it takes long to see
        return none
    if not (isinstance(method, Ritz) and method.starts > FEW_STARTS and (several or bounds)):
        return _explained(problem, _first_answer(problem, method, tol, guess))
    few = replace(method, starts=FEW_STARTS)
    found = replace(_explained(problem, _first_answer(problem, few, tol, guess)), method=method)
    # what one form came to is where others begin; of one alone more curves are asked only where some were left
    if found.status.ok or found.verdict in CONCLUSIVE or not (several or found.stats.more_starts):
        return found
    return _first_answer(problem, method, tol, guess, found if several else None)


def _count(problem: Functional) -> int:
    """How many forms a problem is tried in; none where it is infinite."""
    try:
        return len(forms(problem))
    except Infinite:
        return 0


def _explained(problem: Functional, found: Solution) -> Solution:
    """An answer, or a failure with the conditions that no curve meets, or with the infimum that none attains."""
    if found.status.ok or found.verdict in CONCLUSIVE:
        return found
    if found.verdict is None and (none := not_attained(problem, found.method)) is not None:
        return none
    if not problem.constraints and not any(problem.slides):
        return found
    hopeless = all(form is not None and form.refused for form in forms(problem))
    return found if hopeless else explained(problem, found)


def _first_answer(
    problem: Functional, method: Method, tol: float, guess: Start, failure: Solution | None = None
) -> Solution:
    """The first answer of a method that stands, over all forms; else the failure that got furthest.

    A ``failure`` that is known is where the first form begins.
    """
    try:
        candidates = forms(problem)
    except Infinite as reason:
        return no_answer(problem, method, Status.REFUSED, str(reason), Verdict.INFEASIBLE)
    for form in candidates:
        if form is None or (form.coordinates.weak_only and not isinstance(method, Ritz)):
            continue
        if form.refused and not _reduces(method):
            failure = failure or no_answer(problem, method, Status.REFUSED, form.refused)
            continue
        start = guess if guess is not None or failure is None or failure.curve is None else failure
        solution = _in_form(method, form, tol, _sampled(problem, form, start))
        if solution.status.ok and not form.coordinates.energetic and upright(solution) is not None:
            return _unless_upright(method, candidates, tol, solution, form)
        if solution.status.ok:
            return _vouched(solution, failure, form, candidates)
        if solution.verdict in {Verdict.NOT_ATTAINED, Verdict.DEGENERATE}:
            return solution
        if failure is None or (math.isnan(failure.value) and not math.isnan(solution.value)) or solution.verdict:
            failure = solution
    assert failure is not None
    return failure


def _in_form(way: Method, form: Form, tol: float, start: Sampled | None) -> Solution:
    """What a method comes to in one form, on a mesh that sees what lies between its points."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        solution = _worth_something(way.solve(form, tol=tol, guess=start))
    if solution.status.ok:
        solution = _seen_between(way, form, solution, tol)
    if solution.status.ok and not as_stated(solution):
        solution = replace(solution, status=Status.NOT_CONVERGED, message=NO_LENGTH)
    return _standing(way, form, solution, tol)


def _vouched(solution: Solution, other: Solution | None, form: Form, candidates: Forms) -> Solution:
    """The answer, refused where other slopes or steeper curves are better, local where the ``other`` curve is."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _beyond_doubt(vouched(_compared(solution, other), form), form, candidates)


def _unless_upright(way: Method, candidates: Forms, tol: float, solution: Solution, form: Form) -> Solution:
    """The answer in coordinates in which nothing stands upright; where there are none, this one unless it may."""
    for other in candidates:
        if other is None or not other.coordinates.energetic or _reduces(way):  # which has no coordinates of its own
            continue
        again = _in_form(way, other, tol, None)
        if again.status.ok:
            return _vouched(again, solution, other, candidates)
        if again.verdict is Verdict.NOT_ATTAINED:
            return again
    steep = upright(solution)
    if steep is not None and steep.doubtful:
        return replace(solution, status=Status.NOT_CONVERGED, message=steep.sentence(solution.value))
    return _vouched(solution, None, form, candidates)


def _made_out(solution: Solution) -> Solution:
    """The answer, refused where its curve meets a kink or a jump that its mesh does not know of."""
    return smooth_or_refused(solution) if switches_of(solution.problem) else solution


def _standing(method: Method, form: Form, solution: Solution, tol: float) -> Solution:
    """The answer of a method, refused where it is a saddle of the constrained problem, or its level an extreme one."""
    if solution.status.ok and form.conditions.pathwise:
        from varcalc.existence.standing import off_saddle  # with half of verify

        solution = off_saddle(method, form, solution, tol)
    # at an extreme level no multiplier exists, and digits are lost
    if solution.status is Status.ROUND_OFF and solution.problem.constraints:
        solution = explained(solution.problem, solution)
    problem = solution.problem
    free = problem.unknowns or np.isnan([end.values(problem.n) for end in (problem.start, problem.end)]).any()
    return attained(solution) if free else solution


def _seen_between(method: Method, form: Form, solution: Solution, tol: float) -> Solution:
    """The answer on a mesh fine enough to see what lies between its points, refused where there is none.

    What was not found is looked for again where it was a feature between the points that stood in the way.
    """
    worth = WORTH * tol * max(1.0, abs(solution.value))
    missed = unseen(solution, worth)
    for _ in range(CLOSER_MESHES):
        if missed is None:
            return solution
        # a quadrature has no mesh to be made finer
        if solution.extremal is None or len(missed.marks) > MOST_MARKS:
            break
        again = _on_finer_mesh(method, form, solution, missed, tol)
        if not again.status.ok and not isinstance(method, Ritz) and balanced(solution, missed):
            return solution
        lasting = all(as_stated(s, missed) for s in (solution, again) if s.status.ok)
        fails = lasting and again.extremal is None and solution.status.ok
        if fails and form.coordinates.energetic and of_powers_alone(solution):
            return solution  # coordinates made for what roots and reciprocals do beside an end see it themselves
        if not lasting or again.extremal is None:
            why = NO_LENGTH if not lasting else f"on a mesh that can there was no answer: {again.message}"
            return replace(solution, status=Status.NOT_CONVERGED, message=f"{missed.sentence}, and {why}")
        if not missed.beyond and (kept := _kept(solution, again, worth)) is not None:
            return kept
        solution, form = again, again.extremal.form
        hopeless = not solution.status.ok and solution.stats.unknowns > LARGE_MESH
        missed = None if solution.verdict is not None or hopeless else unseen(solution, worth)
    return _refused_for(missed, solution)


def _kept(solution: Solution, again: Solution, worth: float) -> Solution | None:
    """Which of two answers to keep where what the first did not see has moved nothing; None where it has."""
    if agree(solution, again):
        return solution  # the first mesh has more digits
    return again if again.status.ok and abs(again.value - solution.value) <= worth else None


def _on_finer_mesh(method: Method, form: Form, solution: Solution, missed: Unseen, tol: float) -> Solution:
    """The answer from a known curve on its own mesh with the marks of what that one missed."""
    # what the mesh has learnt is kept: its vertices, and its degree
    start, vertices = solution.extremal.evaluate, solution.extremal.vertices
    form = form.on_mesh([*vertices[1:-1].tolist(), *missed.marks.tolist()])
    finer = method
    if isinstance(method, Ritz):
        degree = solution.stats.degree
        if len(form.conditions.knots) * degree > FEW_UNKNOWNS:
            degree = min(degree, FINER_DEGREE)
        degree = degree if method.refine and method.degree is None else method.degree
        # where the curve is no answer others may lead to one
        starts = min(method.starts, FINER_STARTS) if solution.status.ok else method.starts
        finer = replace(method, degree=degree, starts=starts)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        again = finer.solve(form, tol=tol, guess=lambda s: start(s, 0))
    return replace(again, method=method)


def _once_more(failure: Solution, method: Method, tol: float) -> Solution:
    """The answer on a mesh that sees what lay between the points, where that stood in the way; else the failure."""
    if failure.verdict is not None or failure.extremal is None:
        return failure
    form = failure.extremal.form
    again = _seen_between(method, form, failure, tol)
    return vouched(again, form) if again.status.ok else failure


def _nothing_between(solution: Solution) -> Solution:
    """The answer, refused where something lies between its points."""
    return _refused_for(unseen(solution) if solution.status.ok else None, solution)


def _refused_for(missed: Unseen | None, solution: Solution) -> Solution:
    if missed is None or not solution.status.ok:
        return solution
    return replace(solution, status=Status.NOT_CONVERGED, message=missed.sentence)


def _beyond_doubt(solution: Solution, form: Form, candidates: Forms) -> Solution:
    """The solution, refused when L is singular at an end and a curve that is steeper there is far better.

    Or when variations oscillate next to that end.
    """
    if not solution.status.ok or form.coordinates.energetic:
        return solution
    # coordinates made for a singular end are there because the powers of the distance are real
    if not any(form.coordinates.singular) and any(singular_ends(solution.problem)):
        found = oscillation(solution)
        if found is not None:
            return refused(solution, found)
    # below the minimum of a convex functional there is no curve, and what seems lower is summed wrongly
    if not candidates.singular or proved_least(solution.problem) or (better := outdone(solution)) is None:
        return solution
    return refused(solution, better.finding(solution.value))


def _compared(solution: Solution, failure: Solution | None) -> Solution:
    """The solution, marked local when a curve met on the way has a better value."""
    if failure is None or failure.curve is None or not math.isfinite(failure.error.value):
        return solution
    sign = solution.problem.sign
    margin = failure.error.value + solution.error.value + 1e-12 * abs(solution.value)
    if sign * failure.value < sign * solution.value - margin:
        return replace(solution, local=True, lower=failure.value)
    return solution


def _worth_something(solution: Solution) -> Solution:
    """The solution, refused when round-off leaves it fewer digits than an answer needs, as at conjugate ends."""
    if solution.status is Status.ROUND_OFF and solution.error.value > WORTHLESS_ERROR * max(1.0, abs(solution.value)):
        message = f"round-off leaves an error of {solution.error.value:.2g}: the ends are conjugate, or nearly so"
        return replace(solution, status=Status.NOT_CONVERGED, message=message)
    return solution


def _sampled(problem: Functional, form: Form, guess: Start) -> Sampled | None:
    """What is started from in the coordinates of a form."""
    if guess is None:
        return None
    if isinstance(guess, Solution):
        curve = guess.curve
        carried = None if guess.extremal is None else in_coordinates_of(form, guess.extremal)
        return carried if carried is not None or curve is None else form.coordinates.pull(_spanning(problem, guess))
    return form.coordinates.pull(lambda x: sampled_guess(problem, guess, x))


def _spanning(problem: Functional, guess: Solution) -> Sampled:
    """The curve of a solution, stretched to the problem's interval where parameters have moved its ends."""
    curve, (a, b) = guess.curve, problem.span
    assert curve is not None
    if problem.span == guess.problem.span:
        return lambda x: curve(x, 0)
    first, last = guess.problem.span
    return lambda x: curve(first + (x - a) * ((last - first) / (b - a)), 0)
