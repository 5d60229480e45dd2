"""What the routes of the ladder had no answer to, looked at again."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.existence.approach import approached, gap
from varcalc.existence.broken_curve import broken_curve
from varcalc.existence.corners import bent, with_corners
from varcalc.existence.falling import falling
from varcalc.formulation import formulate
from varcalc.formulation.singular.detection import GROWN, PROBE
from varcalc.formulation.singular.indicial import powers_at_ends
from varcalc.problem.attained import proved_attained
from varcalc.problem.breaks import kinked_table, kinks_at_ends
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.problem.reading import names, text
from varcalc.search import Extremals, by_slope_alone
from varcalc.solution import Finding, Solution, Verdict, refused, sought
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import Switch

OPEN = None, Verdict.WEAK_MINIMUM, Verdict.SADDLE
"""Verdicts of failures that leave room for a minimum, or for a better reason."""
CHORD_PLACES = 1001
"""Abscissae at which Legendre's condition is looked at; odd, so that the middle is one of them."""
VANISHING_SHARE = 1e-5
"""Share of its median below which L_y'y' is taken to vanish."""


def second_look(problem: Functional, tol: float, failure: Solution, *, smooth: bool) -> Solution:
    """A minimum with corners, or the failure with the verdict that says why there is no minimum at all.

    Where the curves that were tried are not ``smooth``, nothing is asked that takes the problem to be so.
    """
    table = kinked_table(problem)
    failure = replace(failure, message="; ".join(filter(None, [failure.message, *_kinks(problem, table)])))
    if failure.verdict in OPEN and (fall := falling(problem)) is not None:
        return refused(failure, fall.finding)
    failure = about_corners(problem, tol, failure)
    if failure.status.ok or failure.verdict is not None or table is not None or not smooth:
        return failure
    approach = approached(problem)
    # a convex functional has no gap, and where a search finds no extremal of one it was the search that failed
    convex = proved_jointly_convex(problem)
    if not convex and approach is not None and (between := gap(problem, approach)) is not None:
        return refused(failure, between.finding(approach.limit))
    found = by_slope_alone(problem, tol) if regular(problem) and not convex else None
    if found is not None and len(found):
        return _judged(failure, found)
    if found is not None and found.complete:
        return _unfound(problem, failure, found)
    if approach is not None and approach.concentrates and not _steep_at_an_end(problem):
        failure = refused(failure, approach.finding)
    return failure


def about_corners(problem: Functional, tol: float, failure: Solution) -> Solution:
    """A minimum with corners where L is not convex in the slope, or the failure, with what there is instead of one."""
    if failure.verdict not in OPEN or not bent(problem, failure):
        return failure
    if (fall := falling(problem)) is not None:  # asked first: it takes a hundredth of the time of what follows
        return refused(failure, fall.finding)
    return with_corners(problem, tol, failure)


def _kinks(problem: Functional, table: Switch | None) -> list[str]:
    """On which kinks the least curve may rest, which no method here holds."""
    told: list[str] = []
    for kink in kinks_at_ends(problem)[:1]:
        held = f"end_cost has a kink ({kink.word}), and an end may rest on it, which no method here holds"
        told.append(f"{held}: fix the end there, and compare")
    if table is not None:
        place = text(table.argument, names(problem))
        told.append(
            f"a linear table of {place} has a kink at each knot, and the least curve may rest on one: try 'bspline'"
        )
    return told


def _steep_at_an_end(problem: Functional) -> bool:
    """Whether L leaves an end with a power of x that makes the slope of an extremal infinite there.

    Polygons grow steeper there on every mesh, though the infimum is attained.
    """
    if not (isinstance(problem, Problem) and problem.n == problem.order == 1):
        return False
    if not (problem.start.fixed and problem.end.fixed):
        return False
    with np.errstate(all="ignore"):
        return any(end.steep for end in powers_at_ends(problem))


def regular(problem: Functional) -> bool:
    """Whether L_y'y' keeps one sign along the chord, and its size toward both ends.

    Then the Euler-Lagrange equation has no singular place there.

    Only then does a search that finds no extremal say something. One function of first order is looked at.
    """
    if not (isinstance(problem, Problem) and problem.n == problem.order == 1) or problem.constraints:
        return False
    a, b = problem.span
    near = (b - a) * np.array(PROBE)
    x = np.concatenate([np.linspace(a, b, CHORD_PLACES)[1:-1], a + near, b - near])
    y = formulate(problem).start.curve(x)
    numbers = problem.parameter_values[None], problem.unknown_guesses[None]
    chord = np.linspace(a, b, CHORD_PLACES)
    slope = np.interp(x, chord, np.gradient(formulate(problem).start.curve(chord)[0], chord))
    values = _legendre(problem)(len(x), x[:, None], y.T, slope[:, None], np.zeros((1, 0)), *numbers)[:, 0]
    inner, sizes = values[:-4], np.abs(values)
    with np.errstate(divide="ignore", invalid="ignore"):  # of what is infinite, or vanishes, nothing is told
        growth = sizes[[-4, -2]] / sizes[[-3, -1]]
    if not (np.isfinite(growth).all() and (growth < GROWN).all() and (growth > 1 / GROWN).all()):
        return False
    sizes = sizes[:-4]
    return bool(
        np.isfinite(inner).all() and np.ptp(np.sign(inner)) == 0 and sizes.min() > VANISHING_SHARE * np.median(sizes)
    )


@derived
def _legendre(problem: Problem) -> PointEvaluator:
    second = ca.densify(ca.hessian(problem.integrand, problem.symbols.dy)[0])
    return PointEvaluator(ca.Function("legendre", problem.symbols.all, [second]))


def none_found(problem: Functional, found: Extremals) -> Finding:
    """That there is no extremal, what was searched, and what broken curve there is."""
    rival = broken_curve(problem)
    instead = "" if rival is None else f"; {rival.sentence}"
    sentence = f"there is no extremal between these ends, among {found.searched.split(';')[0]}{instead}"
    return Finding(Verdict.NO_EXTREMAL, sentence)


def _unfound(problem: Functional, failure: Solution, found: Extremals) -> Solution:
    """The failure with what a search says that found none: that there is none, unless there is a least curve."""
    if not proved_attained(problem):
        return refused(failure, none_found(problem, found))
    exists = "L grows with the square of the slope and is bounded below, so that there is a least curve: give a guess"
    return replace(failure, message="; ".join(filter(None, [failure.message, exists])))


def _judged(failure: Solution, found: Extremals) -> Solution:
    """The best extremal of a search where no minimisation arrived: what it is decides."""
    best = found[0]
    check = best.verification
    if check.verdict in (Verdict.MINIMUM, Verdict.MAXIMUM):
        number = f"the best of {len(found)} extremals" if len(found) > 1 else "the one extremal"
        way = f"{number} found by search, to which minimising did not lead"
        message = f"a local {sought(best.problem)} as far as is shown: {way}"
        return replace(best, verdict=None, local=True, message=message)
    rival = broken_curve(best.problem)
    if rival is not None and rival.jumps and best.problem.sign * (best.value - rival.value) > best.error.value:
        message = (
            f"the infimum is not attained: {rival.sentence}, graphs come as near to it as one likes, and of the "
            f"extremals found, among {found.searched.split(';')[0]}, none comes as low"
        )
        return refused(failure, Finding(Verdict.NOT_ATTAINED, message))
    others = f", one of {len(found)} extremals" if len(found) > 1 else ""
    message = (
        f"there is no minimum that could be vouched for; the best extremal{others} has the value {best.value:.12g} "
        f"and the index {check.index:g}: {check.verdict.value}"
    )
    return refused(failure, Finding(check.verdict, message))
