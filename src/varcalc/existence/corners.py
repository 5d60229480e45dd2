"""Minima with corners, placed by the solver, and infima that no curve attains.

Where L is not convex in the slope, the relaxed problem
(:mod:`varcalc.existence.relaxation`) shows which slopes a minimiser uses and where it
changes from one to another; the corners found there become unknowns of the
direct method. The relaxed value bounds every curve from below: a curve with
corners that comes down to it is a minimum, and when none does the infimum is
not attained.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.existence.closer_meshes import on_closer_meshes
from varcalc.existence.directions import polygonal
from varcalc.existence.levelled_polygons import Alternating
from varcalc.existence.relaxation import MIXED, Relaxed, applies, relaxed
from varcalc.existence.slope_sectors import slope_sectors
from varcalc.formulation import broken_form, formulate
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.method import Ritz
from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict, local_only, refused
from varcalc.symbolic.derived import answered, derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.verify.slopes import concave_beside, jumps_of_slope, places, vouched

RELAXED_PIECES = (32, 64)
"""Polygons on which the relaxed problem is solved; the difference tells their error."""
ALTERNATING = 3
"""Pieces side by side from which on they are more than a corner."""
MOST_CORNERS = 8
CHORD_SHARES = np.array([0.25, 0.5, 0.75])
"""Shares at which the Lagrangian is compared with the chord between two slopes."""
ABOVE_CHORD = 1e-6
"""Relative height above the chord that makes two slopes belong to a corner."""
SLOPES_LOOKED_AT = np.concatenate([-(2.0 ** np.arange(6, -13, -0.5)), [0.0], 2.0 ** np.arange(-12, 6.5, 0.5)])
"""Slopes at which convexity is looked at: in units of 1 and of the chord's slope, about 0 and about the latter."""
VALUE_ROUND_OFF = 1e-13
"""Of a value of L, relatively."""
EVENED = 0.25, 0.5, 0.25
"""Weights by which what is rough is evened out: a lattice has few slopes, and neighbouring pieces the most unlike."""
NEXT_TO_JUMP = 0.05
"""Difference from a slope at which L jumps, in units of all slopes, that is made by rounding the jump off."""
PLACES_FOR_SLOPES = 129
"""Places of a curve at which it is seen whether it keeps a slope at which L jumps."""
BESIDE_LEVEL = 5e-12
"""Distance from a slope at which L jumps, in units of the sectors, at which a curve keeps it."""
SURE = 10.0
"""Factor of the relaxed value's own error by which a curve must miss it for the infimum not to be attained."""


def with_corners(problem: Functional, tol: float, failure: Solution) -> Solution:
    """A minimum with corners where there is one; else the failure, told apart when the infimum is not attained."""
    if not (isinstance(problem, Problem) and bent(problem, failure)):
        return failure
    coarse, fine, best = _cornered(problem, tol)
    if coarse is None or fine is None:
        return failure
    sign, doubt = problem.sign, SURE * abs(coarse.value - fine.value) + (tol * max(1.0, abs(fine.value)))
    reached = best is not None and sign * (best.value - fine.value) <= doubt
    if reached and best is not None:
        return best if (slope := _not_taken(best)) is None else refused(best, _beside_slope(best, slope))
    # a piece or two that are mixed between others that are not hold a corner, which no finer polygon makes more of
    alternating = any(last - first >= ALTERNATING and fine.mixed[first] for first, last in _runs(fine))
    if not alternating or _lowest_known(failure, best) * sign <= sign * fine.value + doubt:
        return failure
    if _on_jumps(problem, fine):
        held = "L jumps as the slope changes, and of curves that keep the slope of a jump none was found to be least"
        known = filter(None, [failure.message.removesuffix(held).removesuffix("; "), held])
        return replace(failure, message="; ".join(known))
    message = (
        f"the infimum is not attained: finer and finer corners, alternating between two slopes on "
        f"{fine.mixed.mean():.0%} of the interval, bring the functional to {fine.value:.6g}, and no curve reaches it"
    )
    return refused(failure, Finding(Verdict.NOT_ATTAINED, message))


def _on_jumps(problem: Problem, found: Relaxed) -> bool:
    """Whether slopes of a relaxed polygon lie next to one at which L jumps, and is as low as on either side of it."""
    jumps = jumps_of_slope(problem)
    if not jumps:
        return False
    x, y = 0.5 * (found.x[1:] + found.x[:-1]), 0.5 * (found.y[1:] + found.y[:-1])
    unit = NEXT_TO_JUMP * np.maximum(1.0, np.ptp(found.slopes))
    for slopes in found.slopes:
        for jump in jumps:
            near = jump.near(problem, x, y[None], slopes[None], 0, problem.unknown_guesses[None])
            for at, *sides in zip(near[::3], near[1::3], near[2::3], strict=True):
                own, *others = (problem.sign * problem.integrand_values(x, y[None], v[None]) for v in (at, *sides))
                room = ABOVE_CHORD * np.abs(own)
                if ((np.abs(at - slopes) <= unit) & (own <= np.minimum(*others) + room) & found.mixed).any():
                    return True
    return False


def lower_with_corners(best: Solution, tol: float, near: Relaxed | None = None) -> Solution | None:
    """A lower minimum with corners, or the known one marked for what finer and finer ones come to; None for neither.

    They are sought ``near`` a polygon of two slopes a piece where one is given.
    """
    if not (isinstance(best.problem, Problem) and applies(best.problem)):
        return None
    lower = None if near is None else _lower_of(best, tol, _sought(best.problem, tol, near))
    # from a polygon that alternates here and there it may not be seen that all of the way had better
    return lower or _lower_of(best, tol, _cornered(best.problem, tol))


def _lower_of(
    best: Solution, tol: float, sought: tuple[Relaxed | None, Relaxed | None, Solution | None]
) -> Solution | None:
    """The minimum with corners where that is lower, or the known one marked for finer and finer ones; or None."""
    coarse, fine, found = sought
    if coarse is None or fine is None:
        return None
    sign = best.problem.sign
    known = sign * best.value - best.error.value
    if found is not None and sign * found.value < known - found.error.value - tol * max(1.0, abs(found.value)):
        if (slope := _not_taken(found)) is None:
            return found
        return local_only(best, _beside_slope(found, slope).sentence)
    if not sign * fine.value < known - SURE * abs(coarse.value - fine.value) - tol * max(1.0, abs(fine.value)):
        return None
    return local_only(best, f"finer and finer corners bring the functional to {fine.value:.6g}")


def _not_taken(found: Solution) -> float | None:
    """The slope that a curve keeps just beside which L is lower than at it; None where it keeps none."""
    problem, curve = found.problem, found.curve
    assert isinstance(problem, Problem)
    assert curve is not None
    sectors = slope_sectors(problem)
    if not sectors.levels:
        return None
    x = places(found, PLACES_FOR_SLOPES)
    for at, y, slope in zip(x.tolist(), curve(x, 0)[0].tolist(), curve(x, 1)[0].tolist(), strict=True):
        level = sectors.at(slope)
        if level is not None and sectors.open_at(problem, level, at, y):
            return level.slope
    return None


def _beside_slope(found: Solution, slope: float) -> Finding:
    """That an infimum is come near to by slopes alone that come near to one."""
    sentence = (
        f"the infimum is not attained: L jumps at the slope {slope:.6g} and is lower just beside it than at it, and "
        f"curves whose slopes come to that bring the functional to {found.value:.6g}, which none of them has"
    )
    return Finding(Verdict.NOT_ATTAINED, sentence, {"limit": found.value, "slope": slope})


def bent(problem: Functional, failure: Solution) -> bool:
    """Whether L of a problem whose curves may have corners is not convex in the slope, or not less what is levelled."""
    if not (isinstance(problem, Problem) and applies(problem)):
        return False
    # that may have been told by Weierstrass's excess
    return failure.verdict is Verdict.WEAK_MINIMUM or not convex(problem) or _bent_by_levels(problem, failure)


def _bent_by_levels(problem: Problem, failure: Solution) -> bool:
    """Whether L, less levels of the slope by the multipliers of what was tried, is concave in the slope beside that."""
    on_slope = (t for t in problem.traced if isinstance(t.constraint, Isoperimetric))
    levels = any(ca.depends_on(t.expression, problem.symbols.highest) for t in on_slope)
    return levels and failure.curve is not None and concave_beside(failure)


@answered
def _cornered(problem: Problem, tol: float) -> tuple[Relaxed | None, Relaxed | None, Solution | None]:
    """The relaxed problem on coarse and on fine polygons, and the least minimum with the corners that it shows."""
    return _sought(problem, tol, None)


def alternating_about(best: Solution, near: Alternating) -> Relaxed:
    """The polygon of two slopes a piece that departs from a curve so."""
    assert best.curve is not None
    away, spreads = near.y.copy(), np.pad(near.spreads, 1, mode="edge")
    away[1:-1] = np.convolve(near.y, EVENED, mode="valid")
    spreads = np.convolve(spreads, EVENED, mode="valid")
    y = best.curve(near.x, 0)[0] + away
    mean = np.diff(y) / np.diff(near.x)
    halves = np.full((2, len(mean)), 0.5)
    return Relaxed(
        near.value, near.x, y, np.array([mean - spreads, mean + spreads]), halves, np.zeros(0), np.zeros(len(mean))
    )


def _sought(
    problem: Problem, tol: float, near: Relaxed | None
) -> tuple[Relaxed | None, Relaxed | None, Solution | None]:
    """The same, from a polygon that is ``near`` where one is known."""
    coarse = relaxed(problem, RELAXED_PIECES[0], near)
    fine = None if coarse is None else relaxed(problem, RELAXED_PIECES[1], coarse)
    if coarse is None or fine is None:
        return coarse, fine, None
    found = (_solved(problem, teeth, tol, fine) for teeth in _sketches(problem, fine))
    best = min((f for f in found if f is not None and f.status.ok), key=lambda s: problem.sign * s.value, default=None)
    return coarse, fine, best


def convex(problem: Problem) -> bool:
    """Whether L is convex in the slope wherever it was looked at, on and about the chord."""
    a, b = problem.span
    line = formulate(problem).start.curve
    first, last = line(np.array([a, b]))[0]
    chord = float(last - first) / (b - a)
    x = a + (b - a) * np.array([0.21, 0.5, 0.83])
    own = max(abs(chord), float(np.abs(line(x)).max()) / (b - a))
    scales = [SLOPES_LOOKED_AT, own * SLOPES_LOOKED_AT, chord + own * SLOPES_LOOKED_AT]
    y, slopes = line(x)[0], np.unique(np.concatenate(scales))
    count = len(slopes)
    values = problem.integrand_values(np.repeat(x, count), np.repeat(y, count)[None], np.tile(slopes, len(x))[None])
    rows = problem.sign * values.reshape(len(x), count)
    rows = rows[np.isfinite(rows).all(1)]  # the chord may go through a pole
    steps = np.diff(slopes)
    rates = np.diff(rows, axis=1) / steps
    noise = VALUE_ROUND_OFF * (np.abs(rows[:, 1:]) + np.abs(rows[:, :-1])) / steps
    return not bool((np.diff(rates, axis=1) < -(noise[:, 1:] + noise[:, :-1])).any())


@dataclass(frozen=True)
class _Teeth:
    """A polygon: its vertices' abscissae and the slope of each side."""

    x: np.ndarray
    slopes: np.ndarray


def _sketches(problem: Problem, found: Relaxed) -> list[_Teeth]:
    """The relaxed polygon with each run of mixed pieces as one tooth, either of its two slopes first.

    A tooth narrower than a piece, unlike what is beside it, may be what is left of a corner there: one goes without.
    """
    runs = _runs(found)
    sketches = []
    for swapped in (False, True):
        x, slopes = [float(found.x[0])], []
        for first, last in runs:
            share, steep = found.shares[:, first:last].mean(1), found.slopes[:, first:last].mean(1)
            width = float(found.x[last] - found.x[first])
            order = _order(found, first, last, steep)
            order = order[::-1] if swapped and last - first > 1 else order
            for k in order if found.mixed[first] else [int(np.argmax(share))]:
                slopes.append(float(steep[k]))
                x.append(x[-1] + width * (float(share[k]) if found.mixed[first] else 1.0))
        sketches.append(_Teeth(np.array(x), np.array(slopes)))
    if np.array_equal(sketches[0].slopes, sketches[1].slopes):  # no run has two slopes
        sketches.pop()
    sketches += [t for t in map(partial(_without_slivers, found), sketches[:1]) if len(t.x) < len(sketches[0].x)]
    return [teeth for teeth in sketches if len(_jumps(problem, found, teeth)) <= MOST_CORNERS]


def _without_slivers(found: Relaxed, teeth: _Teeth) -> _Teeth:
    """The polygon without sides that are shorter than a piece, and unlike both beside them."""
    near = MIXED * np.abs(teeth.slopes).max()
    apart = np.abs(np.diff(teeth.slopes)) > near
    short = np.diff(teeth.x) < (1 - MIXED) * np.diff(found.x).min()
    sliver = short & np.append(False, apart) & np.append(apart, False)
    middles = 0.5 * (teeth.x[1:] + teeth.x[:-1])
    starts = np.append(teeth.x[0], np.where(sliver[:-1], middles[:-1], teeth.x[1:-1]))
    return _Teeth(np.append(starts[~sliver], teeth.x[-1]), teeth.slopes[~sliver])


def _runs(found: Relaxed) -> list[tuple[int, int]]:
    """Pure pieces one by one, and mixed ones by the run: (first, past the last)."""
    joined = found.mixed[1:] & found.mixed[:-1]
    return list(pairwise([0, *(1 + np.flatnonzero(~joined)).tolist(), len(found.mixed)]))


def _order(found: Relaxed, first: int, last: int, steep: np.ndarray) -> list[int]:
    """Which of the two slopes of a run comes first: the one that goes on from the left, or leads on to the right."""
    if first > 0:
        before = found.slopes[int(np.argmax(found.shares[:, first - 1])), first - 1]
        return [0, 1] if abs(steep[0] - before) <= abs(steep[1] - before) else [1, 0]
    if last < len(found.mixed):
        after = found.slopes[int(np.argmax(found.shares[:, last])), last]
        return [0, 1] if abs(steep[1] - after) <= abs(steep[0] - after) else [1, 0]
    return [0, 1]


def _jumps(problem: Problem, found: Relaxed, teeth: _Teeth) -> list[int]:
    """Vertices of a polygon at which the slope crosses a range where L, with levels at their prices, is not convex."""
    inner = teeth.x[1:-1]
    y = np.interp(inner, found.x, found.y)
    left, right = teeth.slopes[:-1], teeth.slopes[1:]
    tried = np.array([0.0, *CHORD_SHARES, 1.0])
    slopes = left[:, None] + (right - left)[:, None] * tried
    shape = slopes.shape
    count, numbers = slopes.size, (problem.parameter_values[None], problem.unknown_guesses[None])
    x, y = np.repeat(inner, shape[1])[:, None], np.repeat(y, shape[1])[:, None]
    parts = _integrands(problem)(count, x, y, slopes.reshape(-1, 1), np.zeros((1, 0)), *numbers)
    values = (problem.sign * parts[:, 0] + parts[:, 1:] @ found.prices).reshape(shape)
    chord = values[:, :1] * (1 - tried) + values[:, -1:] * tried
    size = np.abs(values).max(1) + np.abs(values[:, -1] - values[:, 0])
    return [int(k) + 1 for k in np.flatnonzero((values - chord).max(1) > ABOVE_CHORD * size)]


@derived
def _integrands(problem: Problem) -> PointEvaluator:
    """L and what is levelled."""
    levels = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    return PointEvaluator(ca.Function("L", problem.symbols.all, [ca.densify(ca.vertcat(problem.integrand, *levels))]))


def _solved(problem: Problem, teeth: _Teeth, tol: float, found: Relaxed) -> Solution | None:
    """The direct method from a polygon whose corners may move, if the answer stands; it may have none in a far well."""
    return on_closer_meshes(problem, lambda marked: _from_teeth(marked, teeth, tol, found))


def _from_teeth(problem: Functional, teeth: _Teeth, tol: float, found: Relaxed) -> Solution | None:
    """The same, whatever lies between its points."""
    if not isinstance(problem, Problem):
        return None
    marks = np.array([teeth.x[k] for k in _jumps(problem, found, teeth)])
    heights = found.y[0] + np.concatenate([[0.0], np.cumsum(teeth.slopes * np.diff(teeth.x))])
    way = Ritz(starts=1)
    solution = _through_switches(problem, way, tol, teeth, heights, marks) if on_curve(problem) else None
    if solution is None:

        def along(x: np.ndarray) -> np.ndarray:
            return np.interp(x, teeth.x, heights)[None]

        form = broken_form(problem, marks.tolist(), along) if len(marks) else formulate(problem)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            solution = way.solve(form, tol=tol, guess=None if len(marks) else along)
    if not solution.status.ok or solution.extremal is None:
        return None
    return solution if vouched(solution, solution.extremal.form).status.ok else None


def _through_switches(
    problem: Problem, method: Ritz, tol: float, teeth: _Teeth, heights: np.ndarray, marks: np.ndarray
) -> Solution | None:
    """The answer with corners near ``marks`` that is broken where the polygon meets what switches; None for none.

    Sides at a slope where L has a kink, or jumps, keep that slope.
    """
    from varcalc.existence.in_pieces import breaking, settled  # few curves come to this
    from varcalc.methods.crossings import crossings

    levels = [level.switch for level in slope_sectors(problem).levels]
    kept = _kept_slopes(problem, teeth, heights)
    polygon = polygonal(teeth.x, heights[None])
    nodes = np.union1d(marks, np.linspace(*problem.span, 1 + RELAXED_PIECES[-1]))
    met = breaking(problem, crossings(problem, polygon, nodes, problem.unknown_guesses))
    placed = [c for c in met if not c.switch.smooth and not any(c.switch is level for level in levels)]
    found = sorted([*placed, *kept], key=lambda c: c.x)
    return _off_levels(settled(problem, method, tol, polygon, found, marks.tolist())) if found else None


def _off_levels(found: Solution | None) -> Solution | None:
    """The answer with what it is off by for keeping slopes beside those of levels: the momentum for the difference."""
    if found is None or found.curve is None:
        return found
    problem, curve = found.problem, found.curve
    assert isinstance(problem, Problem)
    x, sectors = places(found, PLACES_FOR_SLOPES), slope_sectors(problem)
    y, slopes = curve(x, 0), curve(x, 1)
    levels = [sectors.at(slope) for slope in slopes[0].tolist()]
    off = max((abs(v - k.slope) for v, k in zip(slopes[0].tolist(), levels, strict=True) if k is not None), default=0.0)
    if not off:
        return found
    momenta = problem.integrand_derivatives(x, y, slopes).gradient[:, -1]
    most = 2 * off * float(np.abs(momenta).max()) * (problem.span[1] - problem.span[0])
    return replace(found, error=replace(found.error, value=found.error.value + most))


def _kept_slopes(problem: Problem, teeth: _Teeth, heights: np.ndarray) -> list[Crossing]:
    """The stretches along which a polygon keeps the slope of a level, just beside that where L is lower."""
    sectors, kept = slope_sectors(problem), []
    at = [sectors.at(slope) for slope in teeth.slopes.tolist()]
    starts = [k for k in range(len(at)) if k == 0 or at[k] is not at[k - 1]]
    for start, end in pairwise([*starts, len(at)]):
        if (level := at[start]) is not None:
            first, last = float(teeth.x[start]), float(teeth.x[end])
            middle = 0.5 * (first + last)
            side = sectors.lower_side(problem, level, middle, float(np.interp(middle, teeth.x, heights)))
            beside = level.slope + side * BESIDE_LEVEL * sectors.unit
            kept.append(Crossing(level.switch, first, level.argument(problem, beside), last))
    return kept


def _lowest_known(failure: Solution, best: Solution | None) -> float:
    """The best value of any curve met, infinitely bad when there is none."""
    sign = failure.problem.sign
    values = [sign * s.value for s in (failure, best) if s is not None and not math.isnan(s.value)]
    return sign * min(values, default=math.inf)
