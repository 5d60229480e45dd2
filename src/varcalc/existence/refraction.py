"""Minima that meet kinks and jumps of the Lagrangian: broken into pieces where it is smooth.

A coarse solve, in which everything that switches is rounded off, shows where the curve meets what; the abscissae of
these places then become unknowns, with Weierstrass and Erdmann's conditions of refraction there (Gelfand and Fomin,
"Calculus of Variations", sect. 15), and the curve follows a kink where that held it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from varcalc.existence.above_kinks import above_kinks, as_held
from varcalc.existence.directions import polygonal
from varcalc.existence.held_throughout import held_throughout, let_go
from varcalc.existence.in_pieces import FOLLOWED_TO, alike, breaking, corners, settled, summed_along
from varcalc.existence.pointed import points_up
from varcalc.existence.polygons import Valley
from varcalc.existence.rests import along_jumps, with_rests
from varcalc.existence.rounded import Rounded, ordinates_of, points_along, rounded, sizes_at
from varcalc.existence.upright import not_attained
from varcalc.formulation import Sampled, formulate
from varcalc.methods.crossings import (
    ARGUMENT_ROUND_OFF,
    Crossing,
    crossings,
    described,
    met_by,
    on_curve,
    sentence,
    switch_arguments,
    unmet,
)
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import breakable, crowded, singular_inside
from varcalc.problem.conditions import Bound
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.problem.reading import names, text
from varcalc.solution import Solution, Status, Verdict, no_answer
from varcalc.verify.between import keeps_bounds

NOT_SMOOTH_THERE = "where the equations of a smooth problem do not hold"
"""What is wrong with a curve that meets a switch of which its mesh knows nothing."""

FOLLOWED = (4.0, 40.0, 400.0)
"""What is as small as so many widths is followed rather than crossed, where that leads to a curve that stands."""
STILL, MOST_OF_POLYGON = (1e-2, 3e-3), 8
"""What is as small along a least polygon is followed, in the same units, and crossings of one that tell of anything.

One that would rest on a jump waves across it.
"""
AT_REST = 1e-2
"""How near a kink a polygon comes that may rest on it, in units of how far from it it goes."""
HALF_WAY, BESIDE_VALLEY = 3.0, 1e-9
"""How much more, in the same units, what is followed may be along a narrow valley than in the middle, and at least."""
NODES = 49
"""Abscissae between which a rounded curve is looked at."""


def refracted(
    problem: Functional, method: Ritz, tol: float, guess: Sampled | None, marks: Sequence[float] = ()
) -> Solution | None:
    """The minimum with its crossings made out, or the refusal that says what was met; None where no switch is met.

    A guess with ``marks`` is a polygon that meets what the minimum does.
    """
    if not (isinstance(problem, Problem) and breakable(problem)):
        return None
    from varcalc.existence.total_variation import least_by_lines  # few curves are of this kind

    # whatever is begun from, that finds the least of all, and sums it along its own curve
    if (least := least_by_lines(problem, method)) is not None:
        return least
    return _with_crossings(problem, method, tol, guess, marks)


def _with_crossings(
    problem: Problem, method: Ritz, tol: float, guess: Sampled | None, marks: Sequence[float]
) -> Solution | None:
    """The minimum that meets switches as a rounded one does, or a polygon; the same for what is no such L."""
    if marks and guess is not None:
        solution, met = _as_polygon(problem, method, tol, guess, marks)
        return solution if solution is not None or not met else _none_stands(problem, method, met)
    if not any(problem.of_type(Bound)):
        return _as_rounded(problem, method, tol, guess)
    from varcalc.existence.under_bounds import least_under_bounds  # few curves are of this kind

    known = least_under_bounds(problem, method, tol, guess)
    if known.solution is not None:
        return known.solution
    solution = _clear_of_bounds(problem, method, tol, guess) or _as_rounded(problem, method, tol, guess)
    return None if solution is None else known.judged(solution)


def _as_rounded(problem: Problem, method: Ritz, tol: float, guess: Sampled | None) -> Solution | None:
    """The minimum that meets switches as a rounded one does; the same for what is no such L."""
    about = rounded(problem, guess)
    if about is None:  # rounding off the greater of two convex branches may leave nothing convex
        form = formulate(problem)
        return above_kinks(form, method, tol, guess or form.start.curve)
    solution, met = _broken_near(problem, method, tol, guess, about)
    met = [c for c in met if not c.switch.smooth]  # there the equations of a smooth problem hold
    if solution is not None or not met:
        return solution
    return _held_above(problem, method, tol, about) or _none_stands(problem, method, met)


def _held_above(problem: Problem, method: Ritz, tol: float, about: Rounded) -> Solution | None:
    """The minimum by functions above the kinks; None for none, and where its curve is at rest but not held there.

    Bounds of these functions are kept at points alone, between which a curve at rest may be let go.
    """
    found = above_kinks(formulate(problem), method, tol, ordinates_of(about.curve))
    if found is None or found.curve is None:
        return None
    followed = crossings(problem, found.curve, found.x, problem.unknown_guesses, FOLLOWED_TO, about.sizes)
    return None if let_go(problem, found.curve, followed) else found


def _broken_near(
    problem: Problem, method: Ritz, tol: float, guess: Sampled | None, about: Rounded
) -> tuple[Solution | None, list[Crossing]]:
    """The least curve that meets switches as a rounded one does, or None; and the switches that one meets.

    The refusal where no curve attains the infimum, as a rounded one that is no minimum may tell.
    """
    if not about.stands and (none := not_attained(problem, method)) is not None:
        return none, []
    nodes = np.linspace(*problem.span, NODES)
    met: list[Crossing] = []
    ridden = False
    last: list[Crossing] | None = None
    # what is no minimum may be far above a polygon in a valley that its mesh does not hold
    narrow = [] if guess is not None or about.stands else _narrow_polygons(problem, summed_along(problem, about.curve))
    for polygon, marks in narrow:
        if (solution := _as_polygon(problem, method, tol, polygon, marks)[0]) is not None:
            return solution, []
    for followed in FOLLOWED[:1] if narrow else FOLLOWED:
        small = max(followed * about.width, ARGUMENT_ROUND_OFF)
        found = _met(problem, about.curve, nodes, small, about.sizes)
        if last is not None and alike(problem, found, last):  # what they led to is known
            continue
        rides = any(c.until is not None for c in found)
        solution = _least(problem, method, tol, about.curve, found, riding=rides and not ridden)
        if solution is None and last is None and guess is None:
            solution = _by_polygons(problem, method, tol, _narrow_polygons(problem) if about.stands else [])
        if solution is not None:
            return solution, found
        last = found
        ridden = ridden or rides  # that side's problem is the same whatever counts as near
        # what is only near a switch, in units of the rounding, is for the smooth problem to decide
        met = found if followed == FOLLOWED[0] else met
    return None, met


def _met(problem: Problem, curve: CurveOrSlope, nodes: np.ndarray, small: float, sizes: np.ndarray) -> list[Crossing]:
    """The switches that a curve meets, or follows where they are less than ``small`` in their ``sizes``."""
    found = crossings(problem, curve, nodes, problem.unknown_guesses, small, sizes)
    found = _one_at_once(problem, curve, found)
    # on what points up no minimum stays
    return [c for c in breaking(problem, found) if c.until is None or not points_up(problem, curve, c)]


def _by_polygons(
    problem: Problem, method: Ritz, tol: float, narrow: Sequence[tuple[Sampled, Sequence[float]]]
) -> Solution | None:
    """The minimum that meets switches as a polygon in a ``narrow`` valley does, or the least one; None for none.

    The least one rests where it should.
    """
    for polygon, marks in narrow:
        if (found := _as_polygon(problem, method, tol, polygon, marks)[0]) is not None:
            return found
    from varcalc.existence.least_polygons import least_polygons  # few curves come to this

    for valley in least_polygons(problem)[:1]:
        return _as_polygon(problem, method, tol, valley, valley.x.tolist(), STILL)[0]
    return None


def _narrow_polygons(problem: Problem, below: float = math.inf) -> list[tuple[Sampled, Sequence[float]]]:
    """Polygons from the line between the ends into narrow valleys, the lowest first, and the marks of their meshes.

    They are lower than ``below``, but for what ends cost.
    """
    if not _shown_by_polygons(problem):
        return []
    from varcalc.existence.least_polygons import from_line  # few curves come to this
    from varcalc.existence.narrow_valleys import narrow_about

    with np.errstate(all="ignore"):
        narrow = narrow_about(from_line(formulate(problem)))
        valleys = [] if narrow is None else narrow.distinct()
    return [(narrow.landscape.along(v), v.marks) for v in valleys if narrow is not None and v.value < below]


def _shown_by_polygons(problem: Problem) -> bool:
    """Whether polygons show more than other curves do; under bounds nothing is tried that was tried without them."""
    return not (proved_jointly_convex(problem) or any(problem.of_type(Bound)))


def _as_polygon(
    problem: Problem, method: Ritz, tol: float, polygon: Sampled, marks: Sequence[float], still: Sequence[float] = ()
) -> tuple[Solution | None, list[Crossing]]:
    """The minimum that meets switches as a ``polygon`` with ``marks`` does, or None; and the switches it meets.

    What is as small along it as one of ``still`` is followed; without them, what is as small half way as one of all.
    """
    nodes = np.union1d(marks, np.linspace(*problem.span, NODES))
    curve = polygonal(nodes, polygon(nodes))
    sizes = sizes_at(problem, points_along(problem, ordinates_of(curve)))
    found: list[Crossing] = []
    for tried, small in enumerate(still or _small_half_way(problem, curve, sizes)):
        last = found
        # the least curve need not go through what is smooth because the polygon did
        found = [c for c in _met(problem, curve, nodes, small, sizes) if not c.switch.smooth]
        if len(found) > MOST_OF_POLYGON or (tried and alike(problem, found, last)):  # what they led to is known
            continue
        riding = any(c.until is not None for c in found)
        if (solution := _least(problem, method, tol, curve, found, riding=riding)) is not None:
            return solution, found
    return None, found


def meets_switches(problem: Problem, polygon: Valley) -> bool:
    """Whether a polygon meets what is not smooth, or comes so near a kink that the least curve may rest on it."""
    curve = polygonal(polygon.x, polygon.y.T)
    found = crossings(problem, curve, polygon.x, problem.unknown_guesses)
    if any(not c.switch.smooth for c in found):
        return True
    kinks = [not (switch.jumps or switch.smooth) for switch in on_curve(problem)]
    middles = 0.5 * (polygon.x[1:] + polygon.x[:-1])
    # a polygon is moved by steps, and rests but for one of them
    away = np.abs(switch_arguments(problem, curve, middles, problem.unknown_guesses))[kinks]
    return bool((away.min(1) <= AT_REST * away.max(1)).any())


def _small_half_way(problem: Problem, curve: CurveOrSlope, sizes: np.ndarray) -> list[float]:
    """What kinks may be followed by: round-off, and what each is but for a factor in the middle of a narrow valley.

    A valley that a free end lies in may begin beyond the middle.
    """
    ends = [x for x, end in zip(problem.span, (problem.start, problem.end), strict=True) if not end.fixed]
    at = np.abs(switch_arguments(problem, curve, np.array([0.5 * sum(problem.span), *ends]), problem.unknown_guesses))
    at = at.min(axis=1) / sizes
    kinks = [not (switch.jumps or switch.smooth) for switch in on_curve(problem)]
    near = np.maximum(HALF_WAY * at[kinks], BESIDE_VALLEY)
    return [ARGUMENT_ROUND_OFF, *np.unique(near[near < STILL[0]]).tolist()]


def _clear_of_bounds(problem: Problem, method: Ritz, tol: float, guess: Sampled | None) -> Solution | None:
    """The minimum that would be one without bounds, where it keeps them, or the refusal that there is none; or None."""
    others = [c for c in problem.constraints if not isinstance(c, Bound) or c.interval[0] == c.interval[1]]
    if len(others) == len(problem.constraints):
        return None
    bare = problem.restated(constraints=others)
    about = rounded(bare, guess)
    free = None if about is None else _broken_near(bare, method, tol, guess, about)[0]
    if free is not None and free.verdict is Verdict.NOT_ATTAINED:
        return not_attained(problem, method)
    if free is None or free.curve is None or not free.status.ok:
        return None
    met = breaking(problem, met_by(replace(free, problem=problem), FOLLOWED_TO))
    solution = settled(problem, method, tol, free.curve, met) if met else None
    return _under_bounds(problem, free) if solution is None else solution


def _under_bounds(problem: Problem, free: Solution) -> Solution | None:
    """The minimum without bounds as the one with them; None where it does not keep them."""
    given = iter(free.multipliers)
    multipliers = tuple(
        np.zeros_like if isinstance(c, Bound) and c.interval[0] < c.interval[1] else next(given)
        for c in problem.constraints
    )
    solution = replace(free, problem=problem, multipliers=multipliers, extremal=None)
    return solution if keeps_bounds(solution) else None


def _none_stands(problem: Problem, method: Ritz, met: list[Crossing]) -> Solution:
    """The refusal that says what was met."""
    told = "; ".join(sentence(problem, c) for c in met[:2])
    message = f"{told}; curves that are broken there were tried, and none stands"
    return no_answer(problem, method, Status.NOT_CONVERGED, message)


def _least(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: list[Crossing], *, riding: bool
) -> Solution | None:
    """The least curve that meets switches as ``curve`` does, the ones it is ``riding`` on among them; None for none.

    What a kink holds throughout comes first: a broken curve that all but is a minimum is solved at length.
    """
    if riding:
        with np.errstate(all="ignore"):  # what is no number is no level, and holds nothing
            held = held_throughout(problem, method, curve, found)
        if held is not None and as_held(problem, held):
            return held
    # what turns where friction holds it comes to rest; kinks of the place alone are for corners that move
    kinks = [c for c in found if c.switch.depends_on(problem.symbols.highest) and not c.switch.jumps]
    turning = any(not points_up(problem, curve, c) for c in kinks)
    rests = turning or (found and any(problem.of_type(Bound))) or along_jumps(problem, curve)
    alone = riding and all(c.until is not None for c in found)
    ways = [with_rests, settled] if rests else [settled, with_rests] if alone else [settled] if found else []
    for way in ways:
        solution = way(problem, method, tol, curve, found)
        if solution is not None and (way is settled or as_held(problem, solution)):
            return solution
    return None


def _one_at_once(problem: Problem, curve: CurveOrSlope, found: list[Crossing]) -> list[Crossing]:
    """The crossings with one switch of its place that a function follows at once: the one it is nearest to.

    Kinks beside it are gone through on the way there, and back.
    """
    rides = [c for c in found if c.until is not None and not c.switch.depends_on(problem.symbols.highest)]
    beside: list[Crossing] = []
    for a, b in combinations(rides if problem.n == 1 else [], 2):
        first, last = max(a.x, b.x), min(a.until or a.x, b.until or b.x)
        if first < last:
            away = [_distance(problem, curve, c, 0.5 * (first + last)) for c in (a, b)]
            beside.append((a, b)[int(np.argmax(away))])
    if not beside:
        return found
    nodes = np.linspace(*problem.span, NODES)
    through = [c for c in crossings(problem, curve, nodes, problem.unknown_guesses) if c.until is None]
    passed = [c for c in through if any(c.switch is other.switch for other in beside)]
    kept = [c for c in found if not any(c is other for other in beside)]
    return sorted([*kept, *passed], key=lambda c: c.x)


def _distance(problem: Problem, curve: CurveOrSlope, crossing: Crossing, x: float) -> float:
    """How far a curve is from a switch at one abscissa."""
    number = next(i for i, switch in enumerate(on_curve(problem)) if switch is crossing.switch)
    along = switch_arguments(problem, curve, np.array([x]), problem.unknown_guesses)
    return abs(float(along[number, 0]) - crossing.level)


def with_what_switches(failure: Solution) -> Solution:
    """The failure of a method that solves smooth equations, which names what is not smooth in the problem."""
    problem = failure.problem
    switch = next((s for s in on_curve(problem) if not s.smooth), None)
    if (
        switch is None
        or failure.status.ok
        or isinstance(failure.method, Ritz)
        or failure.verdict is not None
        or NOT_SMOOTH_THERE in failure.message
    ):
        return failure
    name = type(failure.method).__name__
    message = f"the problem has {described(problem, switch)}, which {name} does not treat: try Ritz ({failure.message})"
    return replace(failure, message=message)


def smooth_or_refused(solution: Solution) -> Solution:
    """The solution, refused where its curve meets a switch that its mesh does not know of.

    A kink that the direct method's curve goes straight through is none of these: the integrand is continuous there, so
    what the mesh makes of it shows in the error.
    """
    problem = solution.problem
    if not solution.status.ok or solution.curve is None:
        return solution
    if (switch := crowded(problem)) is not None:
        told = text(switch.argument, names(problem))
        message = f"the problem switches ({switch.word} of {told}) at more abscissae than a mesh can be broken at"
        return replace(solution, status=Status.NOT_CONVERGED, message=message)
    missed = unmet(problem, met_by(solution), corners(solution))
    direct = isinstance(solution.method, Ritz)
    if not direct and isinstance(problem, Problem) and (inside := singular_inside(problem)) is not None:
        message = (
            f"L tends to zero or infinity at x = {inside:.6g}, inside the interval: no polynomial resolves a curve"
        )
        return replace(solution, status=Status.NOT_CONVERGED, message=f"{message} there; Ritz may")
    if direct:
        highest = problem.symbols.highest
        missed = [c for c in missed if c.switch.jumps or c.until is not None or c.switch.depends_on(highest)]
    missed = [c for c in missed if not c.switch.smooth]
    if not missed:
        return solution
    message = f"{sentence(problem, missed[0])}, {NOT_SMOOTH_THERE}"
    return replace(solution, status=Status.NOT_CONVERGED, message=message)
