"""Whether another valley of a functional is lower: the polygons of a whole lattice at once.

Over a lattice of abscissae and departures from a known curve, the least polygon through each node is found by dynamic
programming (Bellman, "Dynamic Programming", 1957, ch. 9), forward and backward in a few operations on arrays. Where
the least polygons through the nodes of one abscissa have more than one minimum there is more than one valley. Each is
followed to its bottom by the direct method, and what that ends in counts by its own value, not by the lattice's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import islice

import casadi as ca
import numpy as np

from varcalc.existence.broken_curve import with_rival
from varcalc.existence.polygons import FAR, NEAR, PIECES, Lattice, PolygonLattice, Valley, across_the_landscape
from varcalc.formulation import Sampled
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import PROVED, Solution

FAR_LOWER = 0.5
"""How far below the chord a polygon lies that is worth starting from, in units of what the chord sums."""
FOLLOWED, FOLLOWED_ACROSS = 3, 4
"""Valleys that are followed from one curve, and across a landscape."""
DESCENTS = 4
"""Times that a lower curve is looked around in its turn."""
LOWER = 1e-9
"""Relative difference of two values that is one."""
SURELY_LOWER = 1e-3
"""The same for a polygon's value, of which no error is known."""
POLYGON_RULES, RULES_APART = (16, 24), 10.0
"""Gauss points a piece of two rules by which a polygon's value is told, and how often their difference is its error."""

ROUGH, EXACT = Ritz(elements=8, degree=3, refine=False, starts=1), Ritz(starts=1)
"""The direct method, to see whether a valley may be lower, and to its bottom."""
STEP_PIECES, AT_REST = 4, 0.2
"""Pieces on which a curve makes its step, and the share of its rises that it makes on all others, at rest there."""
FINE = Ritz(elements=64, starts=1)
"""The same from a curve that is steep in one place."""
ACROSS = Ritz(elements=24, degree=3, refine=False, starts=1), Ritz(elements=24, starts=1)
"""The two ways from a polygon of a landscape, which has as many pieces."""
ROUGHLY = 0.05
"""How far above the known value a rough one may be, in units of what is summed, for the valley to be lower."""

Polish = Callable[[Ritz, Sampled], Solution]
"""The answer of the direct method from a curve to start from."""


def _ordinates(solution: Solution, x: np.ndarray) -> np.ndarray:
    """The curve at x (m,), straight between the points its method had, where x(s) would have to be inverted."""
    assert solution.curve is not None
    extremal = solution.extremal
    known = None if extremal is None else extremal.samples
    if extremal is None or known is None or not extremal.form.stated.is_lifted:
        return solution.curve(x, 0)[0]
    ends = [end.values(1)[0] for end in (solution.problem.start, solution.problem.end)]
    y = np.interp(x, known.x, known.y[0])
    for k, end in zip((0, -1), ends, strict=True):
        y[k] = y[k] if np.isnan(end) else end
    return y


def looked_around(solution: Solution, polish: Polish, *, followed: bool) -> Solution:
    """The solution, or a lower one; marked local where something lower is known of that is no solution.

    Where lower valleys are ``followed``, what ``polish`` finds in one is the answer; else it is only told of.
    """
    problem = solution.problem
    reason = _not_looked(problem)
    if reason:
        return replace(solution, searched=f"other valleys were not looked for: {reason}")
    if proved_jointly_convex(problem):
        return replace(solution, searched=f"{PROVED} in the curve and its slope: there is no other valley")
    assert isinstance(problem, Problem)
    best, number, reach, across, walled = solution, 0, 0.0, False, False
    for _ in range(DESCENTS):
        with np.errstate(all="ignore"):
            lattice: Lattice | None = PolygonLattice(problem, partial(_ordinates, best))
            worth = partial(_worth_following, best, lattice)
            valleys = list(islice(filter(worth, lattice.valleys()), FOLLOWED))
            walled = walled or bool(lattice.walls.any())
        reach = lattice.reach
        lower = _lower(best, lattice, valleys, (ROUGH, EXACT), polish)
        number += len(valleys)
        if lower is None:
            with np.errstate(all="ignore"):
                lattice = across_the_landscape(problem, partial(_ordinates, best))
                valleys = [] if lattice is None else lattice.distinct()[:FOLLOWED_ACROSS]
            across = lattice is not None
            number += len(valleys)
            lower = None if lattice is None else _followed(best, lattice, valleys, ACROSS, polish)
        if lower is None or not lower.status.ok or lower.local or not followed:
            return _told(best, lower, _looked(reach, number, across, walled))
        best = replace(lower, method=solution.method)
    return _told(best, None, _looked(reach, number, across, walled))


def _worth_following(best: Solution, lattice: Lattice, valley: Valley) -> bool:
    """Whether a ridge lies on the way to a valley, or its polygon, which is a curve as others are, is surely lower.

    A curve may rest on what is as narrow as a floor against division by zero: no ridge is seen about it.
    """
    if lattice.apart(valley):
        return True
    if not valley.value < best.problem.sign * best.value - SURELY_LOWER * lattice.summed:
        return False
    return _is_lower(_along(lattice.problem, valley), best, 0.0, SURELY_LOWER)


def least_polygons(problem: Functional) -> list[Valley]:
    """The least polygons about the chord, where they are far lower, to start from where the chord led nowhere."""
    if _not_looked(problem) or not (problem.start.fixed and problem.end.fixed):
        return []
    assert isinstance(problem, Problem)
    ends = [float(end.values(1)[0]) for end in (problem.start, problem.end)]
    levels = abs(ends[1] - ends[0]) / (PIECES * NEAR[1])  # so that polygons rest on the level of either end
    with np.errstate(all="ignore"):
        lattice = PolygonLattice(problem, lambda x: np.interp(x, problem.span, ends), levels)
        enough = float(lattice.own_costs.sum()) - FAR_LOWER * lattice.summed
        found = [valley for valley in lattice.valleys() if valley.value < enough][:FOLLOWED]
    return found if ca.depends_on(problem.integrand, problem.symbols.x) else list(map(_in_the_middle, found))


def _in_the_middle(valley: Valley) -> Valley:
    """The polygon with its pieces in an order in which what rises or falls most lies half way."""
    rises = np.diff(valley.y)
    size = np.abs(rises)
    if not size.any():
        return valley
    turned = np.roll(rises, round(0.5 * (len(rises) - 1) - float(size @ np.arange(len(rises)) / size.sum())))
    return replace(valley, y=valley.y[0] + np.concatenate([[0.0], np.cumsum(turned)]))


def _looked(reach: float, number: int, across: bool, walled: bool) -> str:
    """What was looked at: the lattices, as far as L is convex in the slope, and the ``number`` of other valleys."""
    nodes = 2 * (len(NEAR) + FAR) + 1
    looked = f"all polygons on a lattice of {PIECES} by {nodes} within {reach:.4g} of the curve"
    looked += ", and those across its hills and wells," if across else ""
    looked += f"{'' if across else ','} as far as L is convex in the slope," if walled else ""
    valleys = "1 other valley" if number == 1 else f"{number} other valleys"
    return f"{looked} were compared, and " + (f"{valleys} followed" if number else "showed no other valley")


def _told(best: Solution, lower: Solution | None, looked: str) -> Solution:
    """The solution with what was looked at, and marked local where something ``lower`` is known."""
    if lower is None:
        return replace(best, searched=looked)
    if lower.status.ok and not lower.local:  # another solution, which is told of
        kind = "maximum" if best.problem.maximise else "minimum"
        message = f"a local {kind} only: {lower.value:.12g} is reached in another valley"
        lower = replace(best, local=True, lower=lower.value, message=message)
    return replace(lower, searched=looked)


def _lower(
    best: Solution, lattice: Lattice, valleys: list[Valley], ways: tuple[Ritz, Ritz], polish: Polish
) -> Solution | None:
    """A solution in a valley that is lower, the known one marked or refused for what is lower; None for neither."""
    rivalled = with_rival(best)  # a jump is no polygon, and its cost is known exactly
    if rivalled is not best:
        return rivalled
    sign = best.problem.sign
    with np.errstate(all="ignore"):
        fall = next(filter(None, map(lattice.fall, valleys)), None) or lattice.fall_far_out()
    if fall is not None:
        message = f"a local {'maximum' if sign < 0 else 'minimum'} only: {fall.finding.sentence}"
        return replace(best, local=True, lower=-sign * math.inf, message=message)
    if (found := _followed(best, lattice, valleys, ways, polish)) is not None:
        return found
    for start in _displaced(best, lattice):
        found = polish(FINE, start)
        if found.status.ok and _is_lower(found.value, best, found.error.value, 0.0):
            return found
    return None


def _followed(
    best: Solution, lattice: Lattice, valleys: list[Valley], ways: tuple[Ritz, Ritz], polish: Polish
) -> Solution | None:
    """The first solution in a valley that is lower, or the known one marked for a polygon that is; None for neither."""
    sign, (rough_way, exact_way) = best.problem.sign, ways
    for valley in valleys:
        rough = polish(rough_way, valley)
        # a coarse mesh may say of a steep curve no more than that it is far lower
        if sign * (rough.value - best.value) < ROUGHLY * lattice.summed:
            found = polish(exact_way, valley)
            if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
                return found
        value = _along(lattice.problem, valley)
        if _is_lower(value, best, 0.0, SURELY_LOWER):
            message = (
                f"a local {'maximum' if sign < 0 else 'minimum'} only: a polygon has the value {value:.6g}, and leads "
                "to no minimum that could be found"
            )
            return replace(best, local=True, message=message)  # its value says nothing of what is lowest there
    return None


def _displaced(best: Solution, lattice: Lattice) -> Iterable[Sampled]:
    """Lower curves with their step elsewhere, where most of the way the curve rests."""
    rises = np.sort(np.abs(np.diff(lattice.c)))
    if rises[:-STEP_PIECES].sum() > AT_REST * rises.sum():
        return ()
    from varcalc.existence.displaced import displaced  # few curves come to this

    return displaced(best)


def _is_lower(value: float, best: Solution, error: float, share: float) -> bool:
    sign = best.problem.sign
    margin = error + best.error.value + share * max(abs(best.value), abs(value))
    return sign * value < sign * best.value - margin


def _along(problem: Problem, valley: Valley) -> float:
    """The functional along a polygon, made worse by what two rules differ by."""
    sums = []
    for count in POLYGON_RULES:
        x, weights = composite_gauss(valley.x, count)
        slope = np.repeat(np.diff(valley.y) / np.diff(valley.x), count)
        sums.append(float(problem.integrand_values(x, valley(x), slope[None]) @ weights))
    return sums[1] + problem.sign * RULES_APART * abs(sums[1] - sums[0])


def has_lattice(problem: Functional) -> bool:
    """Whether other valleys of a problem can be looked for."""
    return not _not_looked(problem)


def _not_looked(problem: Functional) -> str:
    """Why there is no lattice for a problem; empty where there is one."""
    if not isinstance(problem, Problem):
        return "the curve is given by a parameter"
    reasons = {
        "a table is looked up": not problem.vectorised,
        f"there are {problem.n} unknown functions": problem.n > 1,
        "the functional is of second order": problem.order > 1,
        "there are constraints": bool(problem.constraints),
        "more than a curve is sought": bool(problem.unknowns),
        "the ends have a cost": problem.end_cost is not None,
        "an end is not at a given abscissa": any(e.slides or e.periodic for e in (problem.start, problem.end)),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
