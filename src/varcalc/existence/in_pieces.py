"""Curves that are broken where they meet kinks and jumps: solved in pieces until they meet no others.

The abscissae at which a curve is broken are unknowns, with Weierstrass and Erdmann's conditions of refraction there
(Gelfand and Fomin, "Calculus of Variations", sect. 15), and the curve follows a kink where that held it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.existence.above_kinks import as_held
from varcalc.existence.beside_jumps import (
    SAME_PLACE,
    aside,
    bent_anew,
    go_through,
    keeping_slopes,
    number_of,
    pieces_of,
)
from varcalc.existence.rounded import ordinates_of
from varcalc.formulation import Refraction, Ride, broken_form, formulate
from varcalc.formulation.broken import LENGTH_KEPT
from varcalc.methods.answer import lifted, runs_forwards
from varcalc.methods.crossings import (
    ARGUMENT_ROUND_OFF,
    Crossing,
    met_by,
    on_curve,
    switch_arguments,
    unmet,
)
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.verify.along_curve import touches
from varcalc.verify.held_by_kinks import Release, released

STEPS_ALONG_KINKS = 60
"""Iterations in which a curve that follows kinks is found where it does: a few."""
ROUGH_DEGREE = 6
"""Degree at which it is seen which stretches along a kink are left."""
COARSE_DEGREE, LEFT_VALLEY = 4, 1e-2
"""Degree at which what is begun from leads to the nearest curve; how much higher one lies, relatively, that is not."""
PIECES_SUMMED, POINTS_SUMMED = 48, 12
"""Pieces and Gauss points on each by which it is seen what a curve sums."""
FOLLOWED_TO = 1e-6
"""Size of what is zero along a stretch, in its own units, to which an interior-point method holds it."""
NEAR_ENDS = 1e-3
"""Share of the interval within which what is followed is followed from an end, or to it."""
SHARE_OF_WAY = 0.2
"""Share of a stretch along a kink in which a curve comes to it from an end beside it at most, to begin with."""
VANISHED = 1.5
"""Of the least length that a piece may have: one that is no longer has vanished."""
TIMES_PUT_TOGETHER = 6
"""Times that pieces are put together anew."""
MOST = 40
"""Crossings of one curve that are treated."""


def settled(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: list[Crossing], bent: Sequence[float] = ()
) -> Solution | None:
    """The least curve broken where ``curve`` meets switches, or where that one does, until it meets no others.

    It has corners near the abscissae at which it is ``bent`` as well.
    """
    on_jump: float | None = None  # the value along a curve on a jump itself
    for _ in range(TIMES_PUT_TOGETHER):
        solution = None if len(found) > MOST else _broken_in_valley(problem, method, tol, curve, found, bent)
        if solution is None or solution.curve is None:
            return None
        if len(lasting := _lasting(solution, found)) < len(found):
            found = lasting
            continue
        if len(_vanished(solution)):  # it is kept from being least
            return None
        rides = any(c.until is not None for c in found)
        seen = breaking(problem, met_by(solution, FOLLOWED_TO if rides else ARGUMENT_ROUND_OFF))
        pieces = pieces_of(problem, found, bent, np.sort(corners(solution)))
        through = go_through(problem, pieces, seen)
        if not through and not as_held(problem, solution):
            moved = aside(problem, curve, found, solution, pieces)
            if not alike(problem, moved, found):
                on_jump = solution.value if on_jump is None else on_jump
                found = moved
                continue
            if not unmet(problem, seen, corners(solution)):
                return None
        elif not through and not unmet(problem, seen, corners(solution)):
            freed = _let_go(solution, seen)
            if freed is None:
                return _off_by(solution, on_jump)
            (curve, found), on_jump = freed, None
            continue
        seen = keeping_slopes(problem, curve, solution, pieces, seen)
        bent = bent_anew(problem, bent, pieces, seen)
        curve, found, on_jump = solution.curve, seen, None
    return None


def breaking(problem: Problem, found: list[Crossing]) -> list[Crossing]:
    """The crossings but those of a slope at which L is smooth after all: the equations hold there, unbroken.

    What is crossed at the end of a stretch along which it is followed is none either: round-off is.
    """
    near = NEAR_ENDS * (problem.span[1] - problem.span[0])
    rides = [c for c in found if c.until is not None]
    followed = [c for c in found if c.until is None and any(_beside(c, ride, near) for ride in rides)]
    smooth = [c for c in found if c.switch.smooth and c.switch.depends_on(problem.symbols.highest)]
    return [c for c in found if not any(c is other for other in (*followed, *smooth))]


def _beside(crossing: Crossing, ride: Crossing, near: float) -> bool:
    """Whether a crossing lies on a stretch along which the same switch is followed, or by less than ``near`` off it."""
    assert ride.until is not None
    same = crossing.switch is ride.switch and crossing.level == ride.level
    return same and ride.x - near <= crossing.x <= ride.until + near


def alike(problem: Problem, found: list[Crossing], others: list[Crossing]) -> bool:
    """Whether crossings are those of others but for round-off."""
    apart = SAME_PLACE * (problem.span[1] - problem.span[0])
    return len(found) == len(others) and all(
        a.switch is b.switch and a.level == b.level and (a.until is None) == (b.until is None)
        and abs(a.x - b.x) <= apart and abs((a.until or 0.0) - (b.until or 0.0)) <= apart
        for a, b in zip(found, others, strict=True)
    )  # fmt: skip


def corners(solution: Solution) -> np.ndarray:
    """The abscissae of corners that were among the unknowns."""
    extremal = solution.extremal
    if extremal is None or not extremal.form.coordinates.corners:
        return np.zeros(0)
    return np.array([*lifted(extremal, np.array(extremal.form.conditions.knots))[0], *solution.problem.span])


def _off_by(solution: Solution, on_jump: float | None) -> Solution:
    """The solution with what it is off by for running beside a jump and not on it, as its value there tells."""
    if on_jump is None:
        return solution
    return replace(solution, error=replace(solution.error, value=solution.error.value + abs(solution.value - on_jump)))


def _let_go(solution: Solution, seen: list[Crossing]) -> tuple[CurveOrSlope, list[Crossing]] | None:
    """A curve that leaves a kink where that does not hold the solution, and its crossings; None where all hold it."""
    curve = solution.curve
    assert curve is not None
    for k, ride in enumerate(seen):
        # a jump holds whatever comes to it from the lower side
        release = None if ride.switch.jumps else released(solution, ride)
        if release is None:
            continue

        def bent(x: np.ndarray, derivative: int, release: Release = release) -> np.ndarray:
            return curve(x, derivative) + release.bump(x, derivative)

        return bent, [*seen[:k], *_parted(solution.problem, bent, ride, release), *seen[k + 1 :]]
    return None


def _parted(problem: Functional, bent: CurveOrSlope, ride: Crossing, release: Release) -> Iterator[Crossing]:
    """What is left of a ride before and after it is let go; crossings where no more is, to another side."""
    assert ride.until is not None
    least = NEAR_ENDS * (problem.span[1] - problem.span[0])
    number = number_of(problem, ride)
    between, *beside = (
        float(switch_arguments(problem, bent, np.array([x]), problem.unknown_guesses)[number, 0]) - ride.level
        for x in (0.5 * (release.start + release.end), ride.x - least, ride.until + least)
    )
    for (first, last), outside in zip(((ride.x, release.start), (release.end, ride.until)), beside, strict=True):
        if last - first > least:
            yield replace(ride, x=first, until=last)
        elif outside * between < 0:
            yield replace(ride, x=0.5 * (first + last), until=None)


def _vanished(solution: Solution) -> np.ndarray:
    """The middles, as the pieces were begun, of those that an interior-point method would have made shorter still."""
    extremal = solution.extremal
    if extremal is None or not extremal.form.coordinates.corners:
        return np.zeros(0)
    begun = np.sort([*extremal.form.conditions.knots, *solution.problem.span])
    share = np.diff(np.sort(corners(solution))) / np.diff(begun)
    return 0.5 * (begun[1:] + begun[:-1])[share <= VANISHED * LENGTH_KEPT]


def _lasting(solution: Solution, found: list[Crossing]) -> list[Crossing]:
    """The crossings but those along which no stretch is left: the pieces would be shorter if they could."""
    middles = _vanished(solution)
    return [c for c in found if c.until is None or not np.any((middles > c.x) & (middles < c.until))]


def _broken_in_valley(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: list[Crossing], bent: Sequence[float]
) -> Solution | None:
    """The same near ``curve``: IPOPT may leave it beside a level, whose multiplier it does not know."""
    solution = _broken_at(problem, method, tol, curve, found, bent)
    if solution is None or solution.curve is None or not (method.refine and any(problem.of_type(Isoperimetric))):
        return solution
    begun, ended = (summed_along(problem, c) for c in (curve, solution.curve))
    if not ended > begun + LEFT_VALLEY * max(abs(begun), abs(ended)):
        return solution
    rough = _broken_at(problem, replace(method, degree=COARSE_DEGREE, refine=False), tol, curve, found, bent)
    if rough is None or rough.curve is None or not summed_along(problem, rough.curve) < ended:
        return solution
    again = _broken_at(problem, method, tol, rough.curve, breaking(problem, met_by(rough, FOLLOWED_TO)), bent)
    return solution if again is None or problem.sign * (again.value - solution.value) > 0 else again


def summed_along(problem: Problem, curve: CurveOrSlope) -> float:
    """What is minimised, but for what ends cost, along a curve, with everything that switches."""
    x, weights = composite_gauss(np.linspace(*problem.span, PIECES_SUMMED + 1), POINTS_SUMMED)
    bent = curve(x, 2) if problem.order == 2 else None
    return problem.sign * float(problem.integrand_values(x, curve(x, 0), curve(x, 1), ddy=bent) @ weights)


def _broken_at(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: list[Crossing], bent: Sequence[float] = ()
) -> Solution | None:
    """The least curve that is broken near where ``curve`` meets switches, or is ``bent``; None where none is found."""
    if any(_throughout(problem, c) or _chattering(problem, c) for c in found):
        return None
    # what is met at an end itself leaves nothing to be broken
    pieces = [_piece(problem, c, bent) for c in found if c.until is not None or c.x not in problem.span]
    if _at_knots(problem, pieces):
        return None
    drawn = any(isinstance(piece, Ride) and piece.drawn(problem) for piece in pieces)
    kept = drawn or formulate(problem).conditions.pathwise
    plainly = replace(method, starts=1)
    if method.optimiser is None and any(isinstance(piece, Ride) for piece in pieces):
        plainly = replace(plainly, optimiser=Ipopt(iterations=STEPS_ALONG_KINKS))
    ways = [(False, plainly)] if kept else [(False, plainly), (True, plainly)]  # some of every piece is kept anyway
    if not kept and any(isinstance(piece, Ride) for piece in pieces):
        ways.insert(1, (True, replace(plainly, degree=ROUGH_DEGREE, refine=False)))
    # the equations hold where L stays smooth
    loose = [s.argument for s in on_curve(problem) if s.smooth and not any(c.switch is s for c in found)]
    for keeping, way in ways:
        form = broken_form(problem, bent, ordinates_of(curve), None, pieces, loose=loose, keeping=keeping)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # the first way found none without the lengths that are kept
            solve = way.bound if keeping and way is plainly else way.solve
            solution = solve(form, tol=tol, guess=None)
        extremal = solution.extremal
        whole = extremal is None or not extremal.form.coordinates.corners or runs_forwards(extremal)
        if way.refine < method.refine and not len(_vanished(solution)):
            continue  # it was asked for no more than which stretches are left
        if solution.status.ok and whole and np.all(np.diff(solution.x) > 0):
            return replace(solution, method=method, sensitivities=_rates_known(solution))
    return None


def _rates_known(solution: Solution) -> dict[str, float]:
    """The sensitivities, but of parameters that move a bound that is touched.

    Momenta jump where a kink holds the curve at a bound; multipliers at the points of a mesh tell only roughly of it.
    """
    extremal = solution.extremal
    if extremal is None or not touches(extremal):
        return dict(solution.sensitivities)
    bounds = [c.expression for c in extremal.form.conditions.pathwise if not c.equality]
    symbols = ca.vertsplit(extremal.form.symbols.parameters)
    moved = [bool(ca.depends_on(ca.vertcat(*bounds), symbol)) for symbol in symbols]
    return {n: math.nan if m else rate for (n, rate), m in zip(solution.sensitivities.items(), moved, strict=True)}


def _at_knots(problem: Problem, pieces: list[Refraction | Ride]) -> bool:
    """Whether a piece would begin where every mesh has a vertex: then one of the two would have no length."""
    room, knots = SAME_PLACE * (problem.span[1] - problem.span[0]), np.array(formulate(problem).conditions.knots)
    ends = [e for p in pieces for e in ((p.x,) if isinstance(p, Refraction) else (p.start, p.end))]
    return any(bool((np.abs(knots - e) <= room).any()) for e in ends if e not in problem.span)


def _throughout(problem: Problem, crossing: Crossing) -> bool:
    """Whether a curve follows a switch from end to end, but for a slope at which L jumps, which is as good as any."""
    if crossing.until is None or (crossing.switch.jumps and crossing.switch.depends_on(problem.symbols.highest)):
        return False
    first, last = problem.span
    return crossing.until - crossing.x >= (1 - NEAR_ENDS) * (last - first)


def _chattering(problem: Problem, crossing: Crossing) -> bool:
    """Whether a curve of second order follows a kink of its ordinate, to which it comes by crossings without end.

    One that came to it from one side would come with a momentum that none has that rests there (Fuller's phenomenon;
    Zelikin and Borisov, "Theory of Chattering Control", 1994, ch. 1).
    """
    slopes = ca.vertcat(*problem.symbols.slopes)
    return problem.order > 1 and crossing.until is not None and not crossing.switch.depends_on(slopes)


def _piece(problem: Problem, crossing: Crossing, bent: Sequence[float]) -> Refraction | Ride:
    switch, s = crossing.switch, problem.symbols
    surface = switch.argument - crossing.level
    if crossing.until is not None:
        first, last = problem.span
        start, end, near = crossing.x, crossing.until, NEAR_ENDS * (last - first)
        if start - first < near:
            start = first + _way_to_kink(problem, crossing, 0)
        if last - end < near:
            end = last - _way_to_kink(problem, crossing, 1)
        return Ride(start, end, surface, (start in bent, end in bent))
    return Refraction(crossing.x, None if switch.depends_on(s.highest) else surface)


def _way_to_kink(problem: Problem, crossing: Crossing, side: int) -> float:
    """How long the curve takes from the start (0), or to the end (1), that is given beside what is followed; 0 on it.

    Beside a kink it is a parabola that comes to rest there: L_v'v' h'' = L_y.
    """
    s, end = problem.symbols, (problem.start, problem.end)[side]
    assert crossing.until is not None
    if problem.n > 1 or problem.order > 1 or not end.fixed or crossing.switch.depends_on(ca.vertcat(s.dy, s.unknowns)):
        return 0.0
    x, y = problem.span[side], float(end.values(1)[0])
    rows = ca.vertcat(crossing.switch.argument, ca.gradient(crossing.switch.argument, s.y))
    function = ca.Function("argument", [s.x, s.y, s.parameters], [ca.densify(rows)])
    value, rate = np.asarray(function(x, y, problem.parameter_values)).ravel().tolist()
    away = (value - crossing.level) / rate if rate else 0.0
    if not abs(away) > ARGUMENT_ROUND_OFF * max(1.0, abs(x), abs(y)):
        return 0.0
    bend, pull = ca.hessian(problem.integrand, s.dy)[0], ca.gradient(problem.integrand, s.y)
    felt = ca.Function("felt", s.all, [ca.densify(ca.vertcat(bend, pull))])
    given = [x, y, 0.0, np.zeros(0), problem.parameter_values, problem.unknown_guesses]
    curvature, force = np.abs(np.asarray(felt(*given)).ravel())
    length, most = math.sqrt(2 * abs(away) * curvature / force) if force else math.inf, crossing.until - crossing.x
    return min(length, SHARE_OF_WAY * most) if length > 0 else SHARE_OF_WAY * most
