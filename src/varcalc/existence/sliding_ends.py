"""Curves that meet what switches, with an end that slides: it is given, and its place on phi = 0 is made the best.

With the end given the rest is a problem of its own, which all ways of breaking a curve treat. Its value changes with
the place by dJ = p dy - (p y' - L) dx (Gelfand and Fomin, "Calculus of Variations", sect. 13), which is zero at the
best one (transversality). Where a kink of the slope, or a bound of it, holds the curve up to its end, the momentum p is
the one with which it came there, and what has pressed it since.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.existence.held_ends import admitted
from varcalc.formulation import formulate
from varcalc.formulation.epigraph import epigraph_form
from varcalc.methods.crossings import crossings
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import AnyEnd, Bound, Fixed, Free, Isoperimetric, Through, parameters_of
from varcalc.problem.functional import Functional, arguments_along
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.tracing import Expression

FIRST_CURVE = Ritz(elements=24, degree=3, refine=False, starts=1, optimiser=Ipopt(iterations=120))
FIRST_CURVE_TOLERANCE, MET_BY_FIRST = 1e-6, 1e-4
"""To which a first curve is found, and size of what switches, in its own units, at which that is met by it."""
STEPS_ONTO_CURVE, ON_END_CURVE = 40, 1e-14
"""Steps of Newton's method to a point of phi = 0, and the last one, in units of the interval and the ordinates."""
STEP_ASIDE, SECANT_FOLLOWED, STEPS_TO_SIDE = 1e-3, 1.5, 8
"""First step along it, in units of the interval, how far secants are followed, and steps past the best one."""
PLACE_FOUND, MOST_PLACES_TRIED = 1e-7, 12
"""Distance, in units of the interval, to which the best place is found, and places that are tried between two."""
AS_A_PARABOLA = (0.25, 0.75)
"""Between which parts of a rate times the way the value changes on the way to where the rate is zero."""
SLOPE_HELD_TO, PLACES_UP_TO_END, HALVINGS_TO_REST = 1e-7, 257, 40
"""How nearly a slope is held, in units of slopes, places where that is seen, and times that what is between halves."""
SLOPE_NEARLY_HELD_TO = 1e-2
"""The same where a curve is known to rest only nearly.

A slope that is free so near to a kink obeys the same equation as one that is held there.
"""
PIECES_UP_TO_END, POINTS_UP_TO_END = 16, 12
"""Pieces of a stretch on which it is, and Gauss points on each, by which it is summed what presses it."""


def at_best_place(problem: Functional, solved: Callable[[Problem], Solution]) -> Solution | None:
    """The least curve with an end that slides, where it meets what switches; None where none is found.

    The problems with that end given are to be ``solved``. One function of first order is looked at, with one end that
    slides and costs nothing.
    """
    if not (isinstance(problem, Problem) and problem.n == problem.order == 1 and sum(problem.slides) == 1):
        return None
    plain = problem.end_cost is None and not (problem.unknowns or problem.breakpoints or any(problem.of_type(Through)))
    if not plain or all(switch.smooth for switch in on_curve(problem)):
        return None
    rough = _rough(problem)
    if rough is None or not _meets(problem, rough):
        return None
    return _Places(problem, solved).best(rough)


def _rough(problem: Problem) -> Solution | None:
    """A coarse minimum, every kink a function of its own; None where there are others than convex ones."""
    form = formulate(problem)
    lifted = epigraph_form(form, form.start.curve)
    if lifted is None:
        return None
    with np.errstate(all="ignore"):
        solution = FIRST_CURVE.solve(lifted, tol=FIRST_CURVE_TOLERANCE, guess=lifted.start.curve)
    return None if solution.curve is None or not np.isfinite(solution.value) else solution


def _meets(problem: Problem, rough: Solution) -> bool:
    """Whether a curve comes to what switches, and is not smooth there."""
    curve = rough.curve
    assert curve is not None

    def own(x: np.ndarray, derivative: int) -> np.ndarray:
        return curve(x, derivative)[: problem.n]

    return any(not c.switch.smooth for c in crossings(problem, own, rough.x, problem.unknown_guesses, MET_BY_FIRST))


@dataclass
class _Place:
    """A point of phi = 0, the answer with the end there, and how fast what is minimised grows along a direction."""

    point: np.ndarray
    solution: Solution
    rates: np.ndarray


class _Places:
    """The points on which the one end of a problem slides, each with the answer that ends there."""

    def __init__(self, problem: Problem, solved: Callable[[Problem], Solution]) -> None:
        self.problem, self._solved = problem, solved
        self.side = 0 if problem.start.slides else 1
        kind = problem.symbols.kind
        x, y = kind.sym("x"), kind.sym("y", 1)
        phi = problem.traced_slide(("start", "end")[self.side], x, y, kind)
        assert phi is not None
        self._phi = ca.Function("phi", [x, y], [ca.densify(e) for e in (phi, ca.gradient(phi, x), ca.gradient(phi, y))])

    def best(self, rough: Solution) -> Solution | None:
        """The answer with the end at the best place near the one of a rough curve; None where none is found."""
        assert rough.curve is not None
        at = rough.interval[self.side]
        first = self._at(np.array([at, float(rough.curve(np.array([at]), 0)[0, 0])]))
        around = None if first is None else self._around(first, float(np.ptp(rough.x)))
        return None if around is None else self._between(*around)

    def _around(self, here: _Place, size: float) -> tuple[_Place, _Place] | None:
        """Places on either side of the best one: down from one of them, by secants that are followed beyond."""
        way, step = self._tangent(here.point), STEP_ASIDE * size
        way = -way if here.rates @ way > 0 else way
        for _ in range(STEPS_TO_SIDE):
            there = self._at(here.point + step * way)
            if there is None:
                return None
            rate, following = self._rate(here, way), self._rate(there, way)
            if following >= 0:
                return here, there
            secant = following * step / (rate - following) if following > rate else np.inf
            way, step, here = there.point - here.point, min(SECANT_FOLLOWED * secant, size), there
            way = way / np.linalg.norm(way)
        return None

    def _between(self, low: _Place, high: _Place) -> Solution | None:
        """The answer with the end at the best place between two; None where the values on the way deny that it is."""
        chord, inner, outer = high.point - low.point, 0.0, 1.0
        tried = [(0.0, low, self._rate(low, chord)), (1.0, high, self._rate(high, chord))]
        tried.sort(key=lambda one: -abs(one[2]))
        for _ in range(MOST_PLACES_TRIED):
            (before, _, rate), (last, best, following) = tried[-2:]
            share = last - following * (last - before) / (following - rate) if following != rate else np.nan
            if (off := abs(share - last) * float(np.linalg.norm(chord))) <= PLACE_FOUND * float(
                np.ptp(best.solution.x)
            ):
                return self._told(best, off) if self._gained(best, (low, high)) else None
            if not inner < share < outer:
                share = 0.5 * (inner + outer)
            place = self._at(low.point + share * chord)
            if place is None:
                return None
            tried.append((share, place, self._rate(place, chord)))
            inner, outer = (share, outer) if tried[-1][2] < 0 else (inner, share)
        return None

    def _gained(self, best: _Place, ends: tuple[_Place, _Place]) -> bool:
        """Whether the values are those of the rates: along a parabola half of a rate is gained on the way."""
        for end in ends:
            way = end.point - best.point
            whole = self._rate(end, way) * float(np.linalg.norm(way))
            gained = self.problem.sign * (end.solution.value - best.solution.value)
            doubt = end.solution.error.value + best.solution.error.value
            least, most = (share * whole for share in AS_A_PARABOLA)
            if end is not best and not least - doubt <= gained <= most + doubt:
                return False
        return True

    def _told(self, best: _Place, off: float) -> Solution:
        """The answer of the problem itself, whose end may be ``off`` by so much."""
        error, rate = best.solution.error, self._rate(best, self._tangent(best.point))
        error = replace(error, value=error.value + abs(rate) * off, curve=error.curve + off)
        rates = self._sensitivities(best)
        return replace(best.solution, problem=self.problem, extremal=None, error=error, sensitivities=rates)

    def _rate(self, place: _Place, way: np.ndarray) -> float:
        """How fast what is minimised grows along phi = 0 at one place, toward where a ``way`` goes."""
        tangent = self._tangent(place.point)
        return float(place.rates @ tangent) * float(np.sign(tangent @ way))

    def _sensitivities(self, best: _Place) -> dict[str, float]:
        """What is known of them: not for parameters that move the other end."""
        moved = [name for template in self.problem.templates for name, *_ in parameters_of(template)]
        return dict(best.solution.sensitivities) | dict.fromkeys(moved, np.nan)

    def _at(self, point: np.ndarray) -> _Place | None:
        """The answer with the end at the point of phi = 0 next to one; None where none is there."""
        on = self._projected(point)
        if on is None:
            return None
        x, y = on.tolist()
        other = self.problem.span[1 - self.side]
        if not (x > other if self.side else x < other) or not admitted(self._ending(Free(x)), self.side, y):
            return None
        solution = self._solved(self._ending(Fixed(x, y)))
        if not solution.status.ok:
            return None
        rates = self._rates_at(solution, x)
        return _Place(on, solution, rates) if np.isfinite(rates).all() else None

    def _ending(self, end: AnyEnd) -> Problem:
        """The problem with the end that slides replaced."""
        return self.problem.restated(end=end) if self.side else self.problem.restated(start=end)

    def _projected(self, point: np.ndarray) -> np.ndarray | None:
        """The point of phi = 0 next to one, by Newton's method along the gradient."""
        at, size = point, np.ptp(self.problem.span) + np.abs(point).max()
        for _ in range(STEPS_ONTO_CURVE):
            value, *rates = (float(v) for v in self._phi(*at))
            square = rates[0] ** 2 + rates[1] ** 2
            if not (np.isfinite(value) and np.isfinite(square) and square > 0):
                return None
            step = value * np.array(rates) / square
            at = at - step
            if np.abs(step).max() <= ON_END_CURVE * size:
                return at
        return None

    def _tangent(self, point: np.ndarray) -> np.ndarray:
        """The unit tangent of phi = 0 at one of its points."""
        _, by_x, by_y = (float(v) for v in self._phi(*point))
        return np.array([-by_y, by_x]) / np.hypot(by_x, by_y)

    def _rates_at(self, solution: Solution, x: float) -> np.ndarray:
        """How fast what is minimised grows with the abscissa and the ordinate of the end at ``x``, (2,); NaN for none.

        What presses the curve where it is held up to its end is no part of the momentum there.
        """
        curve, whole = solution.curve, _Whole(solution)
        assert curve is not None
        came = whole.held_from(self.side)
        value, _, momentum = whole(np.array([x]))[:, 0]
        if came is not None:
            pieces, weights = composite_gauss(np.linspace(came, x, PIECES_UP_TO_END + 1), POINTS_UP_TO_END)
            momentum = whole(np.array([came]))[2, 0] + whole(pieces)[1] @ weights
        energy = value - momentum * float(curve(np.array([x]), 1)[0, 0])
        return self.problem.sign * (1.0 if self.side else -1.0) * np.array([energy, momentum])


class _Whole:
    """L less its levels by their multipliers, along the curve of an answer between given ends."""

    def __init__(self, solution: Solution) -> None:
        problem, curve = solution.problem, solution.curve
        assert isinstance(problem, Problem)
        assert curve is not None
        self.problem, self.curve, s = problem, curve, problem.symbols
        whole = problem.integrand
        for traced, multiplier in zip(problem.traced, solution.multipliers, strict=False):
            if isinstance(traced.constraint, Isoperimetric):
                whole = whole - float(multiplier or 0.0) * traced.expression
        self._parts = ca.Function(
            "parts", s.all, [ca.vertcat(whole, ca.gradient(whole, s.y), ca.gradient(whole, s.dy))]
        )

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Its value, and its rates with the ordinate and the slope, at x (m,): (3, m)."""
        return self._along(self._parts, x)

    def held_from(self, side: int) -> float | None:
        """From where on a kink of the slope, or a bound of it, holds the curve up to the start (0) or the end (1).

        None where neither does, NaN where it is held all the way: there the momentum is not one.
        """
        first, last = self.problem.span
        x = np.linspace(first, last, PLACES_UP_TO_END)[1:-1]
        x = x if side else x[::-1]
        steepest = max(1.0, float(np.abs(self.curve(x, 1)).max()))
        nearly = self._last_free(x, SLOPE_NEARLY_HELD_TO * steepest)
        # where all slopes are so small, or none is, there is nothing to be told roughly
        rough = nearly is not None and not math.isnan(nearly)
        return nearly if rough else self._last_free(x, SLOPE_HELD_TO * steepest)

    def _last_free(self, x: np.ndarray, room: float) -> float | None:
        """Where a slope, followed along x (m,) to the end, was last off by more than ``room``; see above."""
        held = self._off(x) <= room
        if not held[:, -1].any():
            return None
        lefts = [np.flatnonzero(~row) for row in held if row[-1]]
        if any(len(left) == 0 for left in lefts):
            return math.nan
        kind = int(np.argmax(held[:, -1]))
        low, high = x[lefts[0][-1]], x[lefts[0][-1] + 1]
        for _ in range(HALVINGS_TO_REST):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._off(np.array([middle]))[kind, 0] <= room else (middle, high)
        return float(low)

    def _holding(self) -> list[Expression]:
        """What is zero where a kink of the slope, or a bound of it, holds a curve."""
        found = [w.argument - v for w in on_curve(self.problem) if not (w.smooth or w.stepped) for v in w.levels]
        for traced in self.problem.traced:
            if isinstance(traced.constraint, Bound):
                found += [traced.expression - v for v in traced.constraint.interval if np.isfinite(v)]
        return [e for e in found if ca.depends_on(e, self.problem.symbols.dy)] or [ca.SX(1)]

    def _off(self, x: np.ndarray) -> np.ndarray:
        """How far the curve is at x (m,) from being held by each of what may hold it: (holding, m)."""
        return np.abs(self._along(self._held, x))

    @cached_property
    def _held(self) -> ca.Function:
        return ca.Function("held", self.problem.symbols.all, [ca.densify(ca.vertcat(*self._holding()))])

    def _along(self, function: ca.Function, x: np.ndarray) -> np.ndarray:
        return np.asarray(function(*arguments_along(self.problem, self.curve, x))).reshape(-1, len(x))
