"""Why a problem with conditions has no answer: levels out of reach, and conditions that contradict each other.

Every level and bound may be missed by the same multiple of its own size, and
the least such multiple is sought: where it is not zero, the conditions contradict
each other or the ends (the elastic form of a feasibility problem; Nocedal and
Wright, "Numerical Optimization", sect. 15.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.formulation.singular import forms
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric, Through
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.functional import Functional, arguments_at, unused_names
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Finding, Solution, Verdict, refused
from varcalc.symbolic.convexity import Entry, shapes
from varcalc.symbolic.derived import answered
from varcalc.verify.slopes import vouched

EQUAL = 1e-9
"""Relative distance from an extreme level at which only the extreme curve itself is left."""
SLOPE_WEIGHTS = (1e-6, 1e-9)
"""Weights of the slope beside the squared miss: what depends on them is the price of steepness, no contradiction."""
REAL_MISS = 1e-3
"""A miss, relative to the sizes of the conditions, that smoothness alone does not explain."""
MISS_KEPT = 0.9
"""Share of the miss that is left when steepness costs a thousandth."""
WAVES, WAVE_SIZES = (1, 2, 7), np.array([-1e3, -10.0, -1.0, -0.1, -1e-2, 1e-2, 0.1, 1.0, 10.0, 1e3])
"""Waves on the way, and their sizes in units of the interval and the curve, that may beat what is taken for extreme."""
WAVE_PIECES, WAVE_POINTS = 32, 4
"""Pieces and Gauss points on each by which it is told what waves sum."""
BEATEN = 1e-6
"""Relative difference of two sums that is one."""
CHORD_POINTS = 33
SLIDE_STARTS = 6
"""Places from which |phi| is made least."""
MISS_TOLERANCE = 1e-3
MISS_KNOWN_TO = 1e-9
"""IPOPT's own tolerance: far below a miss that counts, and far above what round-off leaves of the least weight."""


def explained(problem: Functional, failure: Solution) -> Solution:
    """The failure, with verdict and sentence when no curve meets the conditions.

    For a level the least and greatest value of the constraint's own functional between
    the same ends decide: beyond them no curve exists; at them only the extreme
    curve does, and the multiplier rule is abnormal there. Bounds, and levels each of which can be
    reached, may still contradict each other.
    """
    for label in ("start", "end"):
        nowhere = _nowhere(problem, label) if not failure.status.ok else None
        if nowhere is not None:
            return refused(failure, Finding(Verdict.INFEASIBLE, nowhere))
    for index, constraint in enumerate(problem.constraints):
        if not isinstance(constraint, Isoperimetric):
            continue
        lower, upper = constraint.interval
        low, high = _between(problem, constraint)
        least, greatest = max(low, _extreme(problem, constraint, False)), min(high, _extreme(problem, constraint, True))
        size = max(1.0, abs(upper if math.isfinite(upper) else lower))
        label = f"constraints[{index}] (Isoperimetric)"
        if upper < least - EQUAL * size or lower > greatest + EQUAL * size:
            wanted = f"{lower:.12g}" if constraint.equality else f"between {lower:.12g} and {upper:.12g}"
            message = (
                f"{label} asks for {wanted}, but between these ends its integral lies between "
                f"{least:.12g} and {greatest:.12g}; change the level or the ends"
            )
            return refused(failure, Finding(Verdict.INFEASIBLE, message))
        for extreme in (least, greatest):
            if constraint.equality and abs(lower - extreme) <= EQUAL * size:
                message = (
                    f"{label} asks for {lower:.12g}, the extreme value of its integral between these ends: "
                    "only the extreme curve is admissible, and no multiplier exists there"
                )
                return refused(failure, Finding(Verdict.DEGENERATE, message))
    found = contradiction(problem) if _can_contradict(problem) and not failure.status.ok else None
    if found is None:
        return failure
    return replace(failure, message=found.unmet) if _by_corners(problem) else refused(failure, found.finding)


def _by_corners(problem: Functional) -> bool:
    """Whether slopes that alternate may meet a bound of the slope between those that do not, as v^2 >= 1 is met."""
    highest = problem.symbols.highest
    bounds = (t.expression for t in problem.traced if isinstance(t.constraint, Bound))
    return any(ca.depends_on(e, highest) for e in bounds) and sure_contradiction(problem) is None


def _can_contradict(problem: Functional) -> bool:
    """Whether there are bounds, or several levels."""
    return any(problem.of_type(Bound)) or len(list(problem.of_type(Isoperimetric))) > 1


def _nowhere(problem: Functional, label: str) -> str | None:
    """That an end slides on nothing: where |phi| has a least value other than zero, from every start alike."""
    from scipy.optimize import minimize

    kind = problem.symbols.kind
    x, y = kind.sym("x"), kind.sym("y", problem.n)
    phi = problem.traced_slide(label, x, y, kind)
    if phi is None or not isinstance(problem, Problem):
        return None
    guess = float(getattr(problem, label).x)
    value = ca.Function("phi", [ca.vertcat(x, y)], [phi, ca.gradient(phi, ca.vertcat(x, y))])
    size = max(abs(guess), problem.span[1] - problem.span[0])

    def squared(place: np.ndarray) -> tuple[float, np.ndarray]:
        of, slope = (v.full().ravel() for v in value(place))
        return float(of[0] ** 2), 2 * of[0] * slope

    rng = np.random.default_rng(0)
    starts = np.array([guess, *np.zeros(problem.n)]) + size * rng.standard_normal((SLIDE_STARTS, 1 + problem.n))
    with np.errstate(all="ignore"):
        found = [minimize(squared, start, jac=True, method="BFGS") for start in starts]
    least = [f.fun**0.5 for f in found]
    apart = np.ptp([f.x for f in found], axis=0).max()
    if not (np.isfinite(least).all() and min(least) > 0 and np.ptp(least) <= REAL_MISS * min(least)):
        return None
    if apart > REAL_MISS * size:
        return None
    place = ", ".join(f"{v + 0.0:.3g}" for v in np.round(found[0].x / size, 3) * size)
    return (
        f"{label} = {getattr(problem, label)} slides on no curve: |phi| comes down to {min(least):.4g}, at ({place}), "
        "and not to 0; mend phi"
    )


def _between(problem: Functional, constraint: Isoperimetric) -> tuple[float, float]:
    """What its integrand lies between wherever a curve may run, times the length of the interval.

    A square may come as near to nothing as one likes where no curve makes the least of its integral.
    """
    if not isinstance(problem, Problem) or any(problem.slides) or problem.symbols.kind is not ca.SX:
        return -math.inf, math.inf
    expression = next(t.expression for t in problem.traced if t.constraint is constraint)
    s, (a, b) = problem.symbols, problem.span
    entries: list[Sequence[Entry]] = [[(a, b)], *([None] * symbol.numel() for symbol in (s.y, s.dy, s.ddy))]
    entries += [[*problem.parameters.values()], [None] * s.unknowns.numel()]
    ((shape,),) = shapes(ca.Function("level", s.all, [expression]), entries)
    return (b - a) * shape.low(), (b - a) * shape.high()


@answered
def _extreme(problem: Functional, constraint: Isoperimetric, greatest: bool) -> float:
    """The least (greatest) value of the constraint's integral; infinite where none is found."""
    bare: Functional
    if isinstance(problem, Problem):
        bare = Problem(
            constraint.g, problem.start, problem.end, parameters=problem.parameters, unknowns=problem.unknowns,
            order=problem.order, maximise=greatest, breakpoints=breaks(problem),
        )  # fmt: skip
    else:
        bare = Curve(
            constraint.g, problem.start, problem.end, parameters=problem.parameters, unknowns=problem.unknowns,
            maximise=greatest,
        )  # fmt: skip
    for form in filter(None, forms(bare)):
        solution = vouched(Ritz(starts=3).solve(form, tol=1e-10, guess=None), form)
        if solution.status.ok and not _beaten(solution):
            return solution.value
    return math.inf if greatest else -math.inf


def _beaten(solution: Solution) -> bool:
    """Whether waves on the way, small or large, show that a solution is not extreme among all graphs.

    Where all derivatives vanish at once, as those of y'^4 at rest, the equations tell of nothing.
    """
    problem, curve = solution.problem, solution.curve
    if not isinstance(problem, Problem) or curve is None or any(problem.slides):
        return False
    a, b = problem.span
    x, weights = composite_gauss(np.linspace(a, b, WAVE_PIECES + 1), WAVE_POINTS)
    own, sums = [curve(x, k) for k in range(problem.order + 1)], []
    sizes = WAVE_SIZES * max(b - a, float(np.abs(own[0]).max()))
    unknowns = np.tile(solution.unknown_values, (len(x), 1))
    with np.errstate(all="ignore"):
        for count in WAVES:
            turn, rate = 2 * np.pi * count * (x - a) / (b - a), 2 * np.pi * count / (b - a)
            wave = 1 - np.cos(turn), rate * np.sin(turn), rate**2 * np.cos(turn)  # at rest at both ends
            for axis in np.eye(problem.n)[:, :, None]:
                for size in sizes:
                    y, v, *bent = (known + size * axis * departs for known, departs in zip(own, wave, strict=False))
                    values = problem.integrand_values(x, y, v, None, unknowns, *bent)
                    sums.append(problem.sign * float(values @ weights))
    known = problem.sign * solution.value - BEATEN * max(1.0, abs(solution.value))
    return any(math.isfinite(value) and value < known for value in sums)


@dataclass(frozen=True)
class Contradiction:
    """The places of the conditions among the constraints, and by how much the nearest curve misses each."""

    problem: Problem
    misses: dict[int, float]

    @property
    def finding(self) -> Finding:
        """What contradicts what."""
        together = " cannot be met together" if len(self.misses) > 1 else " cannot be met"
        sentence = f"{self._names}{together} between these ends: the curve that comes nearest misses {self._by}"
        return Finding(Verdict.INFEASIBLE, f"{sentence}; change a level, a bound or the ends")

    @property
    def unmet(self) -> str:
        """What no curve that was tried meets, where others may."""
        return (
            f"no curve that meets {self._names} was found: of the smooth ones that were tried the nearest misses "
            f"{self._by}, and some with corners may not; give a guess"
        )

    @property
    def _names(self) -> str:
        return " and ".join(f"constraints[{i}] ({type(self.problem.constraints[i]).__name__})" for i in self.misses)

    @property
    def _by(self) -> str:
        misses = ", ".join(f"{miss:.4g}" for miss in self.misses.values())
        return f"{'them' if len(self.misses) > 1 else 'it'} by {misses}"


def sure_contradiction(problem: Functional) -> Contradiction | None:
    """The contradiction between conditions that are met by a convex set of curves, if any; None elsewhere.

    There the curve that misses them by least is the least of all; elsewhere it may be one of many, and proves nothing.
    """
    if not (isinstance(problem, Problem) and _can_contradict(problem)) or any(problem.slides):
        return None
    sure = proved_jointly_convex(_elastic(problem, _sizes(problem), SLOPE_WEIGHTS[0]))
    return contradiction(problem) if sure else None


@answered
def contradiction(problem: Functional) -> Contradiction | None:
    """The contradiction between the conditions of a graph between fixed or free ends; None where none is found."""
    own = [i for i, c in enumerate(problem.constraints) if isinstance(c, Isoperimetric | Bound)]
    if not isinstance(problem, Problem) or not own:
        return None
    if any(end.slides or end.periodic for end in (problem.start, problem.end)):
        return None
    sizes, misses = _sizes(problem), []
    for weight in SLOPE_WEIGHTS:
        elastic = _elastic(problem, sizes, weight)
        solution = Ritz(starts=3, optimiser=Ipopt(tol=MISS_KNOWN_TO)).solve(
            formulate(elastic), tol=MISS_TOLERANCE, guess=None
        )
        if not solution.status.ok:
            return None
        *_, miss = elastic.unknowns
        misses.append(solution.unknowns[miss])
    if misses[-1] <= REAL_MISS or misses[-1] < MISS_KEPT * misses[0]:
        return None
    return Contradiction(problem, {i: misses[-1] * sizes[i] for i in own})


def _sizes(problem: Problem) -> dict[int, float]:
    """The size of each level and bound: its limits, or what the chord has where these are zero."""
    x = np.linspace(*problem.span, CHORD_POINTS)
    y = formulate(problem).start.curve(x)
    slope = np.gradient(y, x, axis=1)
    along = arguments_at(problem, x, y, slope)
    sizes = {}
    for traced in problem.traced:
        constraint = traced.constraint
        if isinstance(constraint, Holonomic):
            continue
        function = ca.Function("condition", problem.symbols.all, [traced.expression])
        values = np.asarray(function(*along)).ravel()
        own = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        width = problem.span[1] - problem.span[0] if isinstance(constraint, Isoperimetric) else 1.0
        limits = [abs(limit) for limit in constraint.interval if math.isfinite(limit)]
        place = next(i for i, c in enumerate(problem.constraints) if c is constraint)
        sizes[place] = max(*limits, own * width) or 1.0
    return sizes


def _elastic(problem: Problem, sizes: dict[int, float], weight: float) -> Problem:
    """The problem whose curve misses the conditions of ``problem`` least, and is smooth for the rest."""
    (miss,), named = unused_names(problem, ["miss"]), bool(problem.parameters or problem.unknowns)
    a, b = problem.span
    ends = [np.abs(v).max(initial=0.0) for v in formulate(problem).start.curve(np.array([a, b])).T]
    steepness = float(weight * (b - a) / (max(ends) or 1.0) ** 2)

    def cost(*arguments: Any) -> Any:
        *slopes, p = arguments[2:]
        return getattr(p, miss) ** 2 / (b - a) + steepness * ca.sumsqr(slopes[-1]) * (b - a) ** (2 * len(slopes) - 2)

    def shifted(function: Callable[..., Any], share: float) -> Callable[..., Any]:
        """``function`` with a share of the miss added."""
        return lambda *a: function(*(a if named else a[:-1])) + share * getattr(a[-1], miss)

    conditions: list[Any] = []
    for i, constraint in enumerate(problem.constraints):
        if isinstance(constraint, Through):
            conditions.append(constraint)
        elif isinstance(constraint, Holonomic):
            conditions.append(Holonomic(shifted(constraint.phi, 0.0)))
        elif isinstance(constraint, Isoperimetric):
            conditions += _loosened(Isoperimetric, constraint.g, constraint.interval, sizes[i] / (b - a), shifted)
        else:
            conditions += _loosened(Bound, constraint.h, constraint.interval, sizes[i], shifted)
    return Problem(
        cost, problem.start, problem.end, constraints=conditions, parameters=problem.parameters,
        unknowns={**problem.unknowns, miss: 1.0}, order=problem.order, breakpoints=breaks(problem),
    )  # fmt: skip


def _loosened(
    kind: type[Isoperimetric | Bound],
    function: Callable[..., Any],
    interval: tuple[float, float],
    share: float,
    shifted: Callable[[Callable[..., Any], float], Callable[..., Any]],
) -> list[Isoperimetric | Bound]:
    """The condition as up to two inequalities, each of which gives way by a share of the miss."""
    lower, upper = interval
    from_below = [kind(shifted(function, share), lower=lower)] if lower > -math.inf else []
    from_above = [kind(shifted(function, -share), upper=upper)] if upper < math.inf else []
    return from_below + from_above
