"""Minima that meet kinks and jumps of the Lagrangian: broken into pieces where it is smooth.

A coarse solve, in which everything that switches is rounded off, shows where the curve meets what; the abscissae of
these places then become unknowns, with Weierstrass and Erdmann's conditions of refraction there (Gelfand and Fomin,
"Calculus of Variations", sect. 15), and the curve follows a kink where that held it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from varcalc.existence.above_kinks import above_kinks, as_held
from varcalc.existence.directions import polygonal
from varcalc.existence.held_throughout import Curve, held_throughout
from varcalc.existence.rests import with_rests
from varcalc.existence.rounded import Rounded, ordinates_of, points_along, rounded, sizes_at
from varcalc.formulation import Refraction, Ride, Sampled, broken_form, formulate
from varcalc.formulation.broken import LENGTH_KEPT
from varcalc.formulation.height import height
from varcalc.methods.answer import lifted, runs_forwards
from varcalc.methods.crossings import (
    ARGUMENT_ROUND_OFF,
    Crossing,
    arguments_along,
    crossings,
    met_by,
    on_curve,
    sentence,
    unmet,
)
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import breakable, crowded, integrals, singular_inside
from varcalc.problem.conditions import Bound, Constraint
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.problem.reading import names, text
from varcalc.solution import Solution, Status, no_answer

FOLLOWED = (4.0, 40.0, 400.0)
"""What is as small as so many widths is followed rather than crossed, where that leads to a curve that stands."""
STILL, MOST_OF_POLYGON = (1e-2, 3e-3), 8
"""What is as small along a least polygon is followed, in the same units, and crossings of one that tell of anything.

One that would rest on a jump waves across it.
"""
HALF_WAY, BESIDE_VALLEY = 3.0, 1e-9
"""How much more, in the same units, what is followed may be along a narrow valley than in the middle, and at least."""
STEPS_ALONG_KINKS = 60
"""Iterations in which a curve that follows kinks is found where it does: a few."""
ROUGH_DEGREE = 6
"""Degree at which it is seen which stretches along a kink are left."""
FOLLOWED_TO = 1e-6
"""Size of what is zero along a stretch, in its own units, to which an interior-point method holds it."""
NEAR_ENDS = 1e-3
"""Share of the interval within which what is followed is followed from an end, or to it."""
VANISHED = 1.5
"""Of the least length that a piece may have: one that is no longer has vanished."""
ROUNDS = 6
"""Times that pieces are put together anew."""
BESIDE_KINK = 1e-3
"""Change of the highest derivative, in units of 1 and of its own, over which it is seen which way a kink points."""
BESIDE_JUMP, FURTHER_ASIDE = 1e-3, 10.0
"""Distance from a jump, in units of what counts as on it, at which a curve runs that would run along it; and by what
factor it grows where the curve strays across all the same."""
ARCH = Polynomial([0.0, 0.0, 16.0, -32.0, 16.0])
"""A bump on [0, 1] that is level at its ends."""
BUMPS, BUMP_ROUND_OFF = (1e-4, 1e-6), 1e-13
"""Heights of bumps, in units of the curve's, by which it is seen that a kink holds a curve; what sums are off by."""
BUMP_ELEMENTS, BUMP_POINTS = 8, 12
NODES = 49
"""Abscissae between which a rounded curve is looked at."""
PLACES_OF_PIECE = 33
"""Places of a piece at which it is seen whether it runs along a jump."""
SAME_PLACE = 1e-9
"""Share of the interval by which two crossings at one place may differ."""
MOST = 40
"""Crossings of one curve that are treated."""


def refracted(
    problem: Functional, method: Ritz, tol: float, guess: Sampled | None, marks: Sequence[float] = ()
) -> Solution | None:
    """The minimum with its crossings made out, or the refusal that says what was met; None where no switch is met.

    A guess with ``marks`` is a polygon that meets what the minimum does.
    """
    if not (isinstance(problem, Problem) and breakable(problem)):
        return None
    if marks and guess is not None:
        solution, met = _as_polygon(problem, method, tol, guess, marks)
        return solution if solution is not None or not met else _none_stands(problem, method, met)
    if (solution := _clear_of_bounds(problem, method, tol, guess)) is not None:
        return solution
    about = rounded(problem, guess)
    if about is None:  # rounding off the greater of two convex branches may leave nothing convex
        form = formulate(problem)
        return above_kinks(form, method, tol, guess or form.start.curve)
    solution, met = _broken_near(problem, method, tol, guess, about)
    met = [c for c in met if not c.switch.smooth]  # there the equations of a smooth problem hold
    if solution is not None or not met:
        return solution
    found_above = above_kinks(formulate(problem), method, tol, ordinates_of(about.curve))
    return found_above or _none_stands(problem, method, met)


def _broken_near(
    problem: Problem, method: Ritz, tol: float, guess: Sampled | None, about: Rounded
) -> tuple[Solution | None, list[Crossing]]:
    """The least curve that meets switches as a rounded one does, or None; and the switches that one meets."""
    nodes = np.linspace(*problem.span, NODES)
    met: list[Crossing] = []
    ridden = False
    last: list[Crossing] | None = None
    polygons = guess is None
    if polygons and not about.stands:
        polygons = False
        if (solution := _by_polygons(problem, method, tol)) is not None:
            return solution, []
    for followed in FOLLOWED if about.stands else FOLLOWED[:1]:
        small = max(followed * about.width, ARGUMENT_ROUND_OFF)
        found = _met(problem, about.curve, nodes, small, about.sizes)
        if last is not None and _alike(problem, found, last):  # what they led to is known
            continue
        rides = any(c.until is not None for c in found)
        solution = _least(problem, method, tol, about.curve, found, riding=rides and not ridden)
        if solution is None and polygons:
            polygons = False
            solution = _by_polygons(problem, method, tol)
        if solution is not None:
            return solution, found
        last = found
        ridden = ridden or rides  # that side's problem is the same whatever counts as near
        # what is only near a switch, in units of the rounding, is for the smooth problem to decide
        met = found if followed == FOLLOWED[0] else met
    return None, met


def _met(problem: Problem, curve: Curve, nodes: np.ndarray, small: float, sizes: np.ndarray) -> list[Crossing]:
    """The switches that a curve meets, or follows where they are less than ``small`` in their ``sizes``."""
    found = crossings(problem, curve, nodes, problem.unknown_guesses, small, sizes)
    found = _one_at_once(problem, curve, found)
    return [c for c in _breaking(problem, found) if not _repels(problem, curve, c)]


def _by_polygons(problem: Problem, method: Ritz, tol: float) -> Solution | None:
    """The minimum that meets switches as the least polygon does, which rests where it should; None for none.

    Narrow valleys come first, of which that one shows nothing. Under bounds nothing is tried that was tried without
    them.
    """
    if proved_jointly_convex(problem) or any(problem.of_type(Bound)):
        return None
    from varcalc.existence.least_polygons import from_line, least_polygons  # few curves come to this
    from varcalc.existence.narrow_valleys import narrow_about

    with np.errstate(all="ignore"):
        narrow = narrow_about(from_line(formulate(problem)))
        valleys = [] if narrow is None else narrow.distinct()
    for valley in valleys:
        assert narrow is not None
        polygon = narrow.landscape.along(valley)
        if (found := _as_polygon(problem, method, tol, polygon, valley.marks)[0]) is not None:
            return found
    for valley in least_polygons(problem)[:1]:
        return _as_polygon(problem, method, tol, valley, valley.x.tolist(), STILL)[0]
    return None


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
    for small in still or _small_half_way(problem, curve, sizes):
        # the least curve need not go through what is smooth because the polygon did
        found = [c for c in _met(problem, curve, nodes, small, sizes) if not c.switch.smooth]
        if len(found) > MOST_OF_POLYGON:
            continue
        riding = any(c.until is not None for c in found)
        if (solution := _least(problem, method, tol, curve, found, riding=riding)) is not None:
            return solution, found
    return None, found


def _small_half_way(problem: Problem, curve: Curve, sizes: np.ndarray) -> list[float]:
    """What kinks may be followed by: round-off, and what each is but for a factor in the middle of a narrow valley."""
    middle = np.array([0.5 * sum(problem.span)])
    at = np.abs(arguments_along(problem, curve, middle, problem.unknown_guesses)[:, 0]) / sizes
    kinks = [not (switch.jumps or switch.smooth) for switch in on_curve(problem)]
    near = np.maximum(HALF_WAY * at[kinks], BESIDE_VALLEY)
    return [ARGUMENT_ROUND_OFF, *np.unique(near[near < STILL[0]]).tolist()]


def _clear_of_bounds(problem: Problem, method: Ritz, tol: float, guess: Sampled | None) -> Solution | None:
    """The minimum that would be one without bounds, where it keeps them; None where it does not."""
    others = [c for c in problem.constraints if not isinstance(c, Bound) or c.interval[0] == c.interval[1]]
    if len(others) == len(problem.constraints):
        return None
    bare = _under(problem, others)
    about = rounded(bare, guess)
    free = None if about is None else _broken_near(bare, method, tol, guess, about)[0]
    if free is None or free.curve is None or not free.status.ok:
        return None
    met = _breaking(problem, met_by(replace(free, problem=problem), FOLLOWED_TO))
    return _settled(problem, method, tol, free.curve, met) if met else None


def _under(problem: Problem, constraints: Sequence[Constraint]) -> Problem:
    """The problem under other conditions."""
    return Problem(
        problem.lagrangian, problem.start, problem.end, constraints, parameters=problem.parameters,
        unknowns=problem.unknowns, end_cost=problem.end_cost, maximise=problem.maximise,
        breakpoints=problem.breakpoints, order=problem.order,
    )  # fmt: skip


def _none_stands(problem: Problem, method: Ritz, met: list[Crossing]) -> Solution:
    """The refusal that says what was met."""
    told = "; ".join(sentence(problem, c) for c in met[:2])
    message = f"{told}; curves that are broken there were tried, and none stands"
    return no_answer(problem, method, Status.NOT_CONVERGED, message)


def _least(
    problem: Problem, method: Ritz, tol: float, curve: Curve, found: list[Crossing], *, riding: bool
) -> Solution | None:
    """The least curve that meets switches as ``curve`` does, the ones it is ``riding`` on among them; None for none.

    What a kink holds throughout comes first: a broken curve that all but is a minimum is solved at length.
    """
    if riding:
        with np.errstate(all="ignore"):  # what is no number is no level, and holds nothing
            held = held_throughout(problem, method, curve, found)
        if held is not None and as_held(problem, held):
            return held
        resting = with_rests(problem, method, tol, curve, found)
        if resting is not None and as_held(problem, resting):
            return resting
    if found and (solution := _settled(problem, method, tol, curve, found)) is not None:
        return solution
    return None


def _breaking(problem: Problem, found: list[Crossing]) -> list[Crossing]:
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


def _alike(problem: Problem, found: list[Crossing], others: list[Crossing]) -> bool:
    """Whether crossings are those of others but for round-off."""
    apart = SAME_PLACE * (problem.span[1] - problem.span[0])
    return len(found) == len(others) and all(
        a.switch is b.switch and a.level == b.level and (a.until is None) == (b.until is None)
        and abs(a.x - b.x) <= apart and abs((a.until or 0.0) - (b.until or 0.0)) <= apart
        for a, b in zip(found, others, strict=True)
    )  # fmt: skip


def _settled(problem: Problem, method: Ritz, tol: float, curve: Curve, found: list[Crossing]) -> Solution | None:
    """The least curve broken where ``curve`` meets switches, or where that one does, until it meets no others."""
    on_jump: float | None = None  # the value along a curve on a jump itself
    for _ in range(ROUNDS):
        solution = None if len(found) > MOST else _broken_at(problem, method, tol, curve, found)
        if solution is None or solution.curve is None:
            return None
        if len(lasting := _lasting(solution, found)) < len(found):
            found = lasting
            continue
        if len(_vanished(solution)):  # it is kept from being least
            return None
        rides = any(c.until is not None for c in found)
        seen = _breaking(problem, met_by(solution, FOLLOWED_TO if rides else ARGUMENT_ROUND_OFF))
        if not as_held(problem, solution):
            aside = _aside(problem, curve, found, solution)
            if not _alike(problem, aside, found):
                on_jump = solution.value if on_jump is None else on_jump
                found = aside
                continue
            if not unmet(problem, seen, _corners(solution)):
                return None
        elif not unmet(problem, seen, _corners(solution)):
            return _off_by(solution, on_jump) if _held_there(problem, solution, seen) else None
        curve, found, on_jump = solution.curve, seen, None
    return None


def _off_by(solution: Solution, on_jump: float | None) -> Solution:
    """The solution with what it is off by for running beside a jump and not on it, as its value there tells."""
    if on_jump is None:
        return solution
    return replace(solution, error=replace(solution.error, value=solution.error.value + abs(solution.value - on_jump)))


def _held_there(problem: Problem, solution: Solution, seen: list[Crossing]) -> bool:
    """Whether small bumps either way, where a curve rests on a kink of its place, make the functional worse.

    On a crest of L a curve is in balance, too.
    """
    assert solution.curve is not None
    extent = max(float(np.abs(solution.curve(solution.x, 0)).max()), height(formulate(problem)))
    bumps = np.concatenate([np.eye(problem.n), -np.eye(problem.n)])[:, :, None]
    for stretch in ((c.x, c.until) for c in seen if c.until is not None):
        value = partial(_bumped, problem, solution, stretch)
        own = value(0.0 * bumps[0])
        if any(value(share * extent * bump) < own - BUMP_ROUND_OFF * abs(own) for share in BUMPS for bump in bumps):
            return False
    return True


def _bumped(problem: Problem, solution: Solution, stretch: tuple[float, float], bump: np.ndarray) -> float:
    """What is minimised, levels and their multipliers included, over a stretch of a curve with a ``bump`` (n, 1)."""
    assert solution.curve is not None
    first, last = stretch
    x, weights = composite_gauss(np.linspace(first, last, 1 + BUMP_ELEMENTS), BUMP_POINTS)
    part, width = (x - first) / (last - first), last - first
    bent = [
        solution.curve(x, k) + bump * (ARCH.deriv(k) if k else ARCH)(part) / width**k for k in range(1 + problem.order)
    ]
    bend = [] if problem.order == 2 else [np.zeros((0, len(x)))]
    unknowns = np.array([solution.unknowns[name] for name in problem.unknowns])
    columns = [np.tile(v[:, None], (1, len(x))) for v in (problem.parameter_values, unknowns)]
    terms = integrals(problem).call([x[None], *bent, *bend, *columns])
    weighed = np.array([1.0, *(-m for m in solution.multipliers if isinstance(m, float))])
    return problem.sign * float(weighed @ np.vstack([np.asarray(term) for term in terms]) @ weights)


def _vanished(solution: Solution) -> np.ndarray:
    """The middles, as the pieces were begun, of those that an interior-point method would have made shorter still."""
    extremal = solution.extremal
    if extremal is None or not extremal.form.coordinates.corners:
        return np.zeros(0)
    begun = np.sort([*extremal.form.conditions.knots, *solution.problem.span])
    share = np.diff(np.sort(_corners(solution))) / np.diff(begun)
    return 0.5 * (begun[1:] + begun[:-1])[share <= VANISHED * LENGTH_KEPT]


def _lasting(solution: Solution, found: list[Crossing]) -> list[Crossing]:
    """The crossings but those along which no stretch is left: the pieces would be shorter if they could."""
    middles = _vanished(solution)
    return [c for c in found if c.until is None or not np.any((middles > c.x) & (middles < c.until))]


def _aside(problem: Problem, curve: Curve, found: list[Crossing], solution: Solution) -> list[Crossing]:
    """The crossings, those of a jump along which the solution runs moved to the side on which ``curve`` runs.

    On the jump itself round-off decides which side's L a curve is held against.
    """
    assert solution.curve is not None
    edges, began = np.sort(_corners(solution)), np.array([problem.span[0], *(c.x for c in found), problem.span[1]])
    if len(edges) != len(began):
        return found
    switches, numbers = [switch.argument for switch in on_curve(problem)], problem.unknown_guesses
    ways = [np.linspace(a, b, PLACES_OF_PIECE) for a, b in pairwise(edges)]
    along = [arguments_along(problem, solution.curve, way, numbers) for way in ways]
    middles = arguments_along(problem, curve, 0.5 * (began[1:] + began[:-1]), numbers)
    moved = list(found)
    for k, c in enumerate(found):
        number = next(i for i, argument in enumerate(switches) if argument is c.switch.argument)
        small = ARGUMENT_ROUND_OFF * max(float(np.abs(piece[number]).max()) for piece in along)
        for piece in (k, k + 1):
            if c.switch.jumps and np.abs(along[piece][number] - c.level).max() <= small:
                jump = round(c.level)
                away = max(BESIDE_JUMP * small, FURTHER_ASIDE * abs(c.level - jump))
                moved[k] = replace(c, level=jump + away * float(np.sign(middles[number, piece] - jump)))
    return moved


def _broken_at(problem: Problem, method: Ritz, tol: float, curve: Curve, found: list[Crossing]) -> Solution | None:
    """The least curve that is broken near where ``curve`` meets switches; None where none is found."""
    if any(_throughout(problem, c) or _chattering(problem, c) for c in found):
        return None
    # what is met at an end itself leaves nothing to be broken
    pieces = [_piece(problem, c) for c in found if c.until is not None or c.x not in problem.span]
    drawn = any(isinstance(piece, Ride) and piece.drawn(problem) for piece in pieces)
    kept = drawn or formulate(problem).conditions.pathwise
    plainly = replace(method, starts=1)
    if method.optimiser is None and any(isinstance(piece, Ride) for piece in pieces):
        plainly = replace(plainly, optimiser=Ipopt(iterations=STEPS_ALONG_KINKS))
    ways = [(False, plainly)] if kept else [(False, plainly), (True, plainly)]  # some of every piece is kept anyway
    if not kept and any(isinstance(piece, Ride) for piece in pieces):
        ways.insert(1, (True, replace(plainly, degree=ROUGH_DEGREE, refine=False)))
    for keeping, way in ways:
        form = broken_form(problem, [], ordinates_of(curve), None, pieces, keeping=keeping)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            solution = way.solve(form, tol=tol, guess=None)
        extremal = solution.extremal
        whole = extremal is None or not extremal.form.coordinates.corners or runs_forwards(extremal)
        if way.refine < method.refine and not len(_vanished(solution)):
            continue  # it was asked for no more than which stretches are left
        if solution.status.ok and whole and np.all(np.diff(solution.x) > 0):
            return replace(solution, method=method)
    return None


def _throughout(problem: Problem, crossing: Crossing) -> bool:
    """Whether a curve follows a switch from end to end."""
    if crossing.until is None:
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


def _one_at_once(problem: Problem, curve: Curve, found: list[Crossing]) -> list[Crossing]:
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


def _distance(problem: Problem, curve: Curve, crossing: Crossing, x: float) -> float:
    """How far a curve is from a switch at one abscissa."""
    number = next(i for i, switch in enumerate(on_curve(problem)) if switch is crossing.switch)
    along = arguments_along(problem, curve, np.array([x]), problem.unknown_guesses)
    return abs(float(along[number, 0]) - crossing.level)


def _repels(problem: Problem, curve: Curve, crossing: Crossing) -> bool:
    """Whether L has a maximum, of the kink that a curve follows, in the highest derivative: no minimum stays there."""
    s = problem.symbols
    if crossing.until is None or not crossing.switch.depends_on(s.highest):
        return False
    x = np.array([0.5 * (crossing.x + crossing.until)])
    derivatives = [curve(x, k)[:, 0] for k in range(1 + problem.order)]
    lower, highest = derivatives[:-1], derivatives[-1]
    switch = crossing.switch.argument - crossing.level
    function = ca.Function("switch", s.all, [switch, ca.jacobian(switch, s.highest)])
    bends = highest if problem.order == 2 else np.zeros(0)
    at, rate = function(x, *derivatives[:2], bends, problem.parameter_values, problem.unknown_guesses)
    rates = np.asarray(rate)[0]
    size = float(rates @ rates)
    if not size > 0.0:
        return False
    onto, along = highest - float(at) * rates / size, rates / np.sqrt(size)
    step = BESIDE_KINK * max(1.0, float(np.abs(highest).max()))
    beside = (onto + step * np.array([[-1.0], [0.0], [1.0]]) * along).T
    points = [np.repeat(v[:, None], 3, axis=1) for v in lower] + [beside]
    bent = points[2] if problem.order == 2 else None
    left, here, right = problem.sign * problem.integrand_values(np.repeat(x, 3), points[0], points[1], ddy=bent)
    return bool(left + right - 2 * here < 0.0)


def _corners(solution: Solution) -> np.ndarray:
    """The abscissae of corners that were among the unknowns."""
    extremal = solution.extremal
    if extremal is None or not extremal.form.coordinates.corners:
        return np.zeros(0)
    return np.array([*lifted(extremal, np.array(extremal.form.conditions.knots))[0], *solution.problem.span])


def _piece(problem: Problem, crossing: Crossing) -> Refraction | Ride:
    switch, s = crossing.switch, problem.symbols
    surface = switch.argument - crossing.level
    if crossing.until is not None:
        first, last = problem.span
        near = NEAR_ENDS * (last - first)
        start = first if crossing.x - first < near else crossing.x
        return Ride(start, last if last - crossing.until < near else crossing.until, surface)
    return Refraction(crossing.x, None if switch.depends_on(s.highest) else surface)


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
    missed = unmet(problem, met_by(solution), _corners(solution))
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
    message = f"{sentence(problem, missed[0])}, where the equations of a smooth problem do not hold"
    return replace(solution, status=Status.NOT_CONVERGED, message=message)
