"""Curves that rest again and again: on kinks of the slope, as where friction holds, on kinks of the place, at bounds.

Along a rest the slope is known, and the functional hardly says where the rest ends: an end that is moved changes it by
the third power of the way. That the curve sets out smoothly says it, so that the ends are roots
(:mod:`varcalc.methods.ritz.steepest`), and so are the places where a kink is gone through. In between L is smooth, on
the sides on which the curve moves. That it is an extremal is seen at last (Euler and Lagrange's inclusion; Clarke,
"Optimization and Nonsmooth Analysis", 1983, sect. 4.4).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import casadi as ca
import numpy as np

from varcalc.existence.held_throughout import HeldMomentum, held_momentum
from varcalc.existence.in_pieces import NEAR_ENDS, STEPS_ALONG_KINKS
from varcalc.formulation import Contact, Form, Stated, formulate
from varcalc.formulation.form import SideCondition
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.methods.ritz.steepest import ordinate_at
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import Bound
from varcalc.problem.end_cost import natural_momenta
from varcalc.problem.functional import arguments_along, arguments_at
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.switches import held
from varcalc.symbolic.tracing import Expression

PLACES_OF_WAY = 65
"""Places of a way on which a curve moves that are looked at."""
PLACES_FOR_BOUNDS = 513
"""Places of a curve at which it is seen whether it is at a bound."""
ALONG_JUMP, ASIDE_OF_JUMP, SHORTEST_RUN = 2e-2, 1e-11, 24
"""How near to a jump a curve runs along it, and is held there, in units of the largest argument; how long."""
LONGEST_POINT = 6
"""How many of them beside a free end are the end alone, if that is at a bound."""
AT_BOUND = 1e-3, 1e-2
"""How near it is then, in units of the range along the curve: to one of the place, of the slope."""
STRAYING = 1e-6
"""Part of the largest argument on a way by which it may lie on the other side of a kink, or beyond a bound."""
ROUNDS_OF_RESTS = 6
"""Times that it is begun anew where rests have vanished, or where others are seen."""
MOST_CONTACTS = 24
"""Contacts of one curve that are treated: of one that waves across a jump by round-off there are ever more."""
SETS_OUT = 0.1
"""Part of the time for which a kink of the slope holds it within which a curve goes through that as it sets out."""
PLACES_OF_REST = 1001
"""Places of a rest between which the momentum is followed."""
INWARDS = 1e-9
"""Distance from the ends of a rest, in units of its length, of the first and the last place of it."""
ASIDE = 1e-7
"""Slope, in units of 1 and the curve's, at which the momenta on the sides of a kink are taken."""
STEPS_ONTO_SURFACE = 8
"""Of Newton's method, to the ordinates of a surface along a contact."""
SAME_SLOPE = 1e-9
"""By how much slopes that are the same differ by round-off."""
WAYS_SUMMED, POINTS_OF_REST = 8, 12
"""Pieces of a rest, and Gauss points on each, by which it is summed what presses it."""
SAME_END = 1e-7
"""Difference of two ordinates of an end, relative to the curve's, that is none."""
OFF_KNOWN = 1e-2
"""Part of what a curve is off by for running beside a jump and not on it to which that is known."""
_OfWay = TypeVar("_OfWay")
Beside = tuple[Expression | None, Expression | None]
"""L on the ways before a contact and after it; None for an end of the interval."""
Way = tuple[float, float]
"""Between which abscissae a curve moves."""


def with_rests(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: Sequence[Crossing]
) -> Solution | None:
    """The minimum that rests and crosses as a ``curve`` does, nearly; None where none counts."""
    if not treated(problem):
        return None
    surfaces = Surfaces(problem)
    return at_contacts(surfaces, method, tol, curve, surfaces.contacts(curve, found))


def at_contacts(
    surfaces: Surfaces, method: Ritz, tol: float, curve: CurveOrSlope, found: Sequence[Contact]
) -> Solution | None:
    """The minimum with contacts like those ``found`` along a ``curve``, nearly; None where none counts."""
    problem, guess, way = surfaces.problem, curve, method
    form = formulate(problem)
    if method.optimiser is None:
        way = replace(method, optimiser=Ipopt(iterations=STEPS_ALONG_KINKS))
    contacts = _apart(surfaces, found)
    for _ in range(ROUNDS_OF_RESTS):
        ways = None if contacts is None else _ways(problem, contacts)
        if contacts is None or not ways or len(contacts) > MOST_CONTACTS:
            return None
        # a curve that strays across a kink does not say on which side it should be
        places = [surfaces.clearest(guess, way) for way in ways]
        sides = [np.sign(surfaces.values(guess, np.array([x]))[:, 0]) for x in places]
        pieces = [surfaces.held(guess, x) for x in places]
        contacts = [surfaces.seen(c, *_beside(problem, contacts, c, sides)) for c in contacts]
        led = way.at_contacts(partial(_moving, form, surfaces, pieces), contacts, curve, tol)
        if led is None or led[0].curve is None:
            return None
        solution, kept = led
        curve, same = led[0].curve, len(kept) == len(contacts) and len(_ways(problem, kept)) == len(ways)
        following = list(surfaces.following(curve, kept, sides)) if same else kept
        if same and following == kept:
            seam = surfaces.at_seam(curve, kept, pieces)
            held = all(surfaces.holds(curve, c, _beside(problem, kept, c, pieces), seam) for c in kept)
            if not (held and meets_ends(problem, curve) and surfaces.within_bounds(curve, solution.x)):
                return None
            own = resampled(curve, solution.x, 2)
            off = [surfaces.off_by(curve, c, _beside(problem, kept, c, pieces), seam) for c in kept]
            error = replace(solution.error, value=solution.error.value + OFF_KNOWN * sum(map(abs, off)))
            solution = replace(solution, value=solution.value - sum(off), error=error)
            rates = surfaces.rates_known(solution.sensitivities, kept)
            return replace(solution, method=method, curve=own, extremal=None, sensitivities=rates)
        contacts = _apart(surfaces, following)
    return None


def along_jumps(problem: Problem, curve: CurveOrSlope) -> bool:
    """Whether a curve runs along a jump of its place, as along a wall."""
    return treated(problem) and Surfaces(problem).runs_along_jumps(curve)


def meets_ends(problem: Problem, curve: CurveOrSlope) -> bool:
    """Whether a curve has the ordinates that its ends prescribe: a contact may not lead to another place."""
    ends, x = (problem.start, problem.end), np.array(problem.span)
    y = curve(x, 0)
    known = np.array([end.values(problem.n) for end in ends]).T
    size = max(
        float(np.ptp(curve(np.linspace(*problem.span, PLACES_OF_WAY), 0))), float(np.nanmax(np.abs(known), initial=0.0))
    )
    return not bool((np.abs(y - known) > SAME_END * size).any())


def treated(problem: Problem) -> bool:
    """Whether a graph of one function is under nothing but bounds."""
    if not (problem.n == problem.order == 1) or problem.unknowns or formulate(problem).stated.is_lifted:
        return False
    if problem.start.periodic and problem.end_cost is not None:  # the momentum changes there by what that says
        return False
    return all(isinstance(c, Bound) and c.interval[0] < c.interval[1] for c in problem.constraints)


def _ways(problem: Problem, contacts: Sequence[Contact]) -> list[Way]:
    """The ways before, between and after contacts, those at the ends where there are any."""
    edges = [problem.span[0], *(e for c in contacts for e in (c.start, c.end)), problem.span[1]]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if a < b]


def _apart(surfaces: Surfaces, contacts: Sequence[Contact]) -> list[Contact] | None:
    """The contacts, those that overlap as one; None where they cannot be.

    What is at rest where it meets a surface of the place is at rest on that, if it has the slope of it. What is held at
    another slope, or as steep as it may be, comes to rest by and by.
    """
    (a, b), merged = surfaces.problem.span, list[Contact]()
    near = NEAR_ENDS * (b - a)
    for contact in sorted(contacts, key=lambda c: (c.start, c.end)):
        begun, ended = contact.start - a < near, b - contact.end < near
        start = a if begun and surfaces.may_reach(contact, 0) else contact.start
        end = b if ended and surfaces.may_reach(contact, 1) else contact.end
        here = replace(contact, start=start, end=end)
        if start == end and start in (a, b) and not surfaces.ends_at(contact):
            continue
        last = merged[-1] if merged else None
        if last is not None and surfaces.through_it(last, here) and start - last.end <= near:
            # the curve comes to what it runs along through it, or leaves it so
            run, crossing = (here, last.start) if last.start == last.end else (last, start)
            late = crossing > 0.5 * (run.start + run.end)
            merged[-1] = replace(run, end=crossing) if late else replace(run, start=crossing)
            continue
        if last is None or last.end < start:
            merged.append(here)
            continue
        steep = [surfaces.steep(c) for c in (last, here)]
        whole = last.start, max(last.end, end)
        if last.index == here.index and last.level == here.level and last.start < last.end and start < end:
            merged[-1] = replace(last, end=whole[1])
        elif steep[0] != steep[1] and surfaces.alike(*((last, here) if steep[0] else (here, last))):
            merged[-1] = replace(here if steep[0] else last, start=whole[0], end=whole[1])
        elif any(steep) and last.end - near > last.start and start + near < end and last.end < end:
            merged[-1] = replace(last, end=start - near)
            merged.append(replace(here, start=last.end + near))
        elif steep[0] == steep[1]:
            return None
        elif last.end < end:
            merged[-1] = here
    return merged if all(c.end < d.start for c, d in pairwise(merged)) else None


def _beside(
    problem: Problem, contacts: Sequence[Contact], contact: Contact, of_ways: Sequence[_OfWay]
) -> tuple[_OfWay | None, _OfWay | None]:
    """What is known of the ways before a contact and after it; None for an end of the interval."""
    ways = _ways(problem, contacts)
    before = next((p for way, p in zip(ways, of_ways, strict=True) if way[1] == contact.start), None)
    after = next((p for way, p in zip(ways, of_ways, strict=True) if way[0] == contact.end), None)
    return before, after


def _moving(form: Form, surfaces: Surfaces, pieces: Sequence[Expression], contacts: Sequence[Contact]) -> Form | None:
    """The form with L on each way one of ``pieces``, which changes half way along contacts, and the surfaces.

    Along a contact to which the curve comes through it, or which it leaves so, L is that of the contact's own side.
    None where there are not as many ways.
    """
    if len(_ways(surfaces.problem, contacts)) != len(pieces):
        return None
    problem, s = surfaces.problem, surfaces.problem.symbols
    changes: list[tuple[float, Expression]] = []  # from where on L is what
    for c in contacts:
        after = _beside(problem, contacts, c, pieces)[1]
        if any(c.through):
            changes.append((c.start, surfaces.held_along(c)))
        if after is not None and (any(c.through) or c.start > problem.span[0]):
            before = _beside(problem, contacts, c, pieces)[0]
            changes.append((c.end if any(c.through) else surfaces.changing(c, before, after), after))
    integrand = pieces[0]
    for place, piece in changes:
        integrand = ca.if_else(s.x < place, integrand, piece)
    integrand = problem.sign * integrand
    coordinates = replace(form.coordinates, stated=Stated(s, integrand, integrand), numbers=None)
    # at rest no more is asked of the middle than of any other place
    along = [c for c in contacts if not surfaces.steep(c)]
    within = [place for c in along for place, _ in changes if c.start < place < c.end]
    knots = {*form.conditions.knots, *within}
    conditions = replace(form.conditions, pathwise=surfaces.conditions, knots=tuple(sorted(knots)))
    return replace(form, coordinates=coordinates, conditions=conditions, cache=Cache(), elsewhere=None)


class Surfaces:
    """The kinks that a curve may meet, and the bounds it may touch, with the numbers that contacts have for them."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        s, bounds = problem.symbols, formulate(problem).conditions.pathwise
        self.switches = [switch for switch in on_curve(problem) if not switch.smooth]
        self._loose = [switch.argument for switch in on_curve(problem) if switch.smooth]
        first = len(problem.constraints)
        kinks = [
            SideCondition(switch.argument - switch.levels[0], -math.inf, math.inf, first + k)
            for k, switch in enumerate(self.switches)
        ]
        self.conditions: tuple[SideCondition, ...] = (*kinks, *bounds)
        arguments = ca.vertcat(*(c.expression for c in self.conditions))
        self.bounds = bounds
        self._values = ca.Function("surfaces", s.all, [ca.densify(arguments)])
        self.slopes = {c.index: bool(ca.depends_on(c.expression, s.dy)) for c in self.conditions}

    def steep(self, contact: Contact) -> bool:
        """Whether what is met feels the slope."""
        return self.slopes[contact.index]

    def alike(self, steep: Contact, place: Contact) -> bool:
        """Whether what is on a surface of the place has the slope at which another contact holds it."""
        problem, surface = self.problem, self.condition(place).expression
        s, x = problem.symbols, 0.5 * (max(steep.start, place.start) + min(steep.end, place.end))
        y = ordinate_at(formulate(problem), surface, replace(place, start=x))
        slope = -ca.gradient(surface, s.x) / ca.gradient(surface, s.y)
        asked = self.condition(steep).expression - steep.level
        along = ca.Function("along", s.all, [ca.densify(ca.substitute(asked, s.dy, slope))])
        return abs(float(along(x, y, 0.0, [], problem.parameter_values, []))) <= SAME_SLOPE

    def may_reach(self, contact: Contact, side: int) -> bool:
        """Whether the start (0) or the end (1) of the interval may lie on what a contact is with."""
        problem, x = self.problem, self.problem.span[side]
        y = (problem.start, problem.end)[side].values(1)
        if self.steep(contact) or np.isnan(y).any():
            return True
        along = partial(ordinate_at, formulate(problem), self.condition(contact).expression)
        return abs(along(replace(contact, start=x)) - float(y[0])) <= SAME_END * max(1.0, abs(float(y[0])))

    def through_it(self, contact: Contact, other: Contact) -> bool:
        """Whether one of two contacts goes through the jump that the other one runs along."""
        points = [c.start == c.end for c in (contact, other)]
        return contact.index == other.index and self.jumps(contact) and points[0] != points[1]

    def seen(self, contact: Contact, before: np.ndarray | None, after: np.ndarray | None) -> Contact:
        """The contact, with whether the curve comes to it through it, in view of the sides of the ways beside it."""
        number = contact.index - len(self.problem.constraints)
        along = self.jumps(contact) and contact.start < contact.end
        sides = (None if side is None else side[number] for side in (before, after)) if along else (None, None)
        first, last = (side is not None and bool(side * contact.level < 0) for side in sides)
        return replace(contact, through=(first, last))

    def changing(self, contact: Contact, before: Expression | None, after: Expression) -> float:
        """Where along a contact L changes from what it is before it to what it is after: where both are the same.

        Along a bound of the place a curve may go through a kink, as friction does on the tip of a spike.
        """
        problem, s, middle = self.problem, self.problem.symbols, 0.5 * (contact.start + contact.end)
        if before is None or self.steep(contact) or contact.start == contact.end:
            return middle
        surface = self.condition(contact).expression
        slope = -ca.gradient(surface, s.x) / ca.gradient(surface, s.y)
        apart = ca.Function("apart", s.all, [ca.substitute(before - after, s.dy, slope)])
        onto = ca.Function("onto", s.all, [s.y - (surface - contact.level) / ca.gradient(surface, s.y)])
        x = np.linspace(contact.start, contact.end, PLACES_OF_WAY)
        still = np.zeros((1, len(x)))
        y = still + ordinate_at(formulate(problem), surface, replace(contact, start=middle))
        for _ in range(STEPS_ONTO_SURFACE):
            y = np.asarray(onto(*arguments_at(problem, x, y, still)))
        differ = np.asarray(apart(*arguments_at(problem, x, y, still))).ravel()
        at = np.flatnonzero(differ[:-1] * differ[1:] <= 0)
        if not len(at) or not np.abs(differ).max() > 0:
            return middle
        k, (first, last) = at[0], differ[[at[0], at[0] + 1]]
        return float(x[k] + (x[k + 1] - x[k]) * (first / (first - last) if first != last else 0.5))

    def held_along(self, contact: Contact) -> Expression:
        """L on the side of each kink on which a curve is half way along a contact with a surface of the place."""
        problem, surface = self.problem, self.condition(contact).expression
        s, x = problem.symbols, 0.5 * (contact.start + contact.end)
        y = ordinate_at(formulate(problem), surface, replace(contact, start=x))
        slope = ca.Function("slope", s.all, [-ca.gradient(surface, s.x) / ca.gradient(surface, s.y)])
        none, parameters = np.zeros(0), problem.parameter_values
        pace = float(slope(x, y, 0.0, none, parameters, none))
        point = [np.array([v]) for v in (x, y, pace)]
        return held([problem.integrand], s.all, [*point, none, parameters, none], ca.vertcat(s.y, s.dy), self._loose)[0]

    def ends_at(self, contact: Contact) -> bool:
        """Whether a contact is that of a free end with a bound of the place."""
        problem, free = self.problem, [not end.fixed for end in (self.problem.start, self.problem.end)]
        at_free = any(f and contact.start == contact.end == x for f, x in zip(free, problem.span, strict=True))
        return at_free and contact.index < len(problem.constraints) and not self.steep(contact)

    def condition(self, contact: Contact) -> SideCondition:
        """What a contact is with."""
        return next(c for c in self.conditions if c.index == contact.index)

    def rates_known(self, rates: Mapping[str, float], contacts: Sequence[Contact]) -> dict[str, float]:
        """The sensitivities, but of parameters that move what is met: momenta that jump there would have to be told."""
        met = ca.vertcat(*(self.condition(c).expression for c in contacts))
        symbols = ca.vertsplit(self.problem.symbols.parameters)
        moves = [bool(ca.depends_on(met, symbol)) for symbol in symbols]
        return {n: math.nan if moved else rate for (n, rate), moved in zip(rates.items(), moves, strict=True)}

    def values(self, curve: CurveOrSlope, x: np.ndarray) -> np.ndarray:
        """What says on which side of each surface a curve is, at x (m,): (surfaces, m)."""
        return np.asarray(self._values(*self.points(curve, x)))

    def points(self, curve: CurveOrSlope, x: np.ndarray) -> list[np.ndarray]:
        """The arguments of the problem's expressions along a curve at x (m,), a column each."""
        return arguments_along(self.problem, curve, x)

    def point(self, curve: CurveOrSlope, x: float) -> list[np.ndarray]:
        """The arguments of the problem's expressions at one place of a curve."""
        return [row[:, 0] for row in arguments_along(self.problem, curve, np.array([x]))]

    def held(self, curve: CurveOrSlope, x: float) -> Expression:
        """L on the sides of the kinks on which a curve is at x; what switches at abscissae does so."""
        s = self.problem.symbols
        moving = ca.vertcat(s.y, s.dy)
        return held([self.problem.integrand], s.all, self.point(curve, x), moving, self._loose)[0]

    def clearest(self, curve: CurveOrSlope, way: Way) -> float:
        """The place of a way at which it is clearest on which side of each kink the curve is."""
        x = np.linspace(*way, PLACES_OF_WAY)[1:-1]
        values = np.abs(self.values(curve, x)[: len(self.switches)])
        clear = (values / np.maximum(values.max(1, keepdims=True), 1e-300)).min(0, initial=1.0)
        return float(x[np.argmax(clear)])

    def contacts(self, curve: CurveOrSlope, found: Sequence[Crossing]) -> list[Contact]:
        """The contacts where a curve meets kinks, as it was ``found`` to, and where it is at bounds.

        A kink of the slope that it goes through holds it for as long as the momentum takes; where that does not change
        at all a curve that seems to go through is at rest on both sides, or straight to round-off. Beside where it
        follows that kink it goes through as it sets out.
        """
        met, first = list[Contact](), len(self.problem.constraints)
        for c in found:
            number = next((k for k, switch in enumerate(self.switches) if switch is c.switch), None)
            if number is None:
                continue
            index = first + number
            held = c.until is None and self.slopes[index]
            half = 0.5 * self._time_across(curve, c.x) if held else 0.0
            stretches = [(o.x, o.until) for o in found if o.switch is c.switch and o.until is not None]
            if held and (half == 0 or any(a - SETS_OUT * half <= c.x <= b + SETS_OUT * half for a, b in stretches)):
                continue
            met.append(Contact(index, 0.0, c.x - half, c.x + half if c.until is None else c.until))
        x = np.linspace(*self.problem.span, PLACES_FOR_BOUNDS)
        values = self.values(curve, x)
        met += self._along_jumps(x, values)
        for condition, row in zip(self.conditions[len(self.switches) :], values[len(self.switches) :], strict=True):
            room = AT_BOUND[self.slopes[condition.index]] * max(float(np.ptp(row)), 1e-300)
            for level, excess in self._beyond(condition, row):
                for first, last in runs(excess >= -room):
                    ends = [x[k] for k in (0, len(x) - 1) if first <= k <= last < first + LONGEST_POINT]
                    at = [Contact(condition.index, level, float(end), float(end)) for end in ends]
                    if any(map(self.ends_at, at)):
                        met += filter(self.ends_at, at)
                    elif last > first + 1:
                        met.append(Contact(condition.index, level, float(x[first]), float(x[last])))
        return met

    def _along_jumps(self, x: np.ndarray, values: np.ndarray) -> Iterator[Contact]:
        """Contacts where a curve runs along a jump of its place, on the side on which it does: as at a bound."""
        for switch, condition, row in zip(self.switches, self.conditions, values, strict=False):
            if not switch.jumps or self.slopes[condition.index] or switch.stepped:
                continue
            size = float(np.abs(row[np.isfinite(row)]).max(initial=0.0))
            for first, last in runs(np.abs(row) <= ALONG_JUMP * size):
                if last - first + 1 > SHORTEST_RUN:
                    side = float(np.sign(np.median(row[first : last + 1])))
                    yield Contact(condition.index, side * ASIDE_OF_JUMP * size, float(x[first]), float(x[last]))

    def runs_along_jumps(self, curve: CurveOrSlope) -> bool:
        """Whether a curve runs along a jump of its place for a while."""
        x = np.linspace(*self.problem.span, PLACES_FOR_BOUNDS)
        return any(True for _ in self._along_jumps(x, self.values(curve, x)))

    def jumps(self, contact: Contact) -> bool:
        """Whether a contact is with a jump."""
        number = contact.index - len(self.problem.constraints)
        return number >= 0 and self.switches[number].jumps

    def _time_across(self, curve: CurveOrSlope, x: float) -> float:
        """How long it takes the momentum to go from that of one side of a kink of the slope to that of the other."""
        at, problem = np.array([x]), self.problem
        y, v = curve(at, 0), curve(at, 1)
        aside = ASIDE * max(1.0, abs(float(v[0, 0])))
        below, above = (problem.integrand_derivatives(at, y, v + way * aside).gradient[0, 1:] for way in (-1, 1))
        rate = 0.5 * abs(float(below[0] + above[0]))
        return abs(float(above[1] - below[1])) / rate if rate > 0 else 0.0

    def following(
        self, curve: CurveOrSlope, contacts: Sequence[Contact], sides: Sequence[np.ndarray]
    ) -> Iterator[Contact]:
        """The contacts, and others where a curve is on the other side of a kink on its way, or beyond a bound.

        A rest beside which it is across a kink of the place is one on that.
        """
        others = list[Contact]()
        for way, side in zip(_ways(self.problem, contacts), sides, strict=True):
            x = np.linspace(*way, PLACES_OF_WAY)
            values = self.values(curve, x)
            room = STRAYING * np.abs(values).max(1)
            for k, condition in enumerate(self.conditions):
                kink = k < len(self.switches)
                levels = [(0.0, -side[k] * values[k])] if kink else self._beyond(condition, values[k])
                for level, excess in levels:
                    for first, last in runs(excess > room[k]):
                        start, end = x[max(first - 1, 0)], x[min(last + 1, len(x) - 1)]
                        others.append(Contact(condition.index, level, float(start), float(end)))
        yield from self._with_others(contacts, others)

    def within_bounds(self, curve: CurveOrSlope, vertices: np.ndarray) -> bool:
        """Whether a curve keeps all bounds on the ways between ``vertices``, to a part of what they are along it."""
        low, high = vertices[:-1, None], vertices[1:, None]
        x = (low + (high - low) * np.linspace(0, 1, PLACES_OF_WAY)[1:-1]).ravel()
        values = self.values(curve, x)[len(self.switches) :]
        for condition, row in zip(self.conditions[len(self.switches) :], values, strict=True):
            room = STRAYING * float(np.abs(row).max())
            if any((excess > room).any() for _, excess in self._beyond(condition, row)):
                return False
        return True

    @staticmethod
    def _beyond(condition: SideCondition, values: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """How far values lie beyond each level of a bound."""
        ways = ((condition.lower, -1.0), (condition.upper, 1.0))
        return [(level, way * (values - level)) for level, way in ways if math.isfinite(level)]

    def _with_others(self, contacts: Sequence[Contact], others: Sequence[Contact]) -> Iterator[Contact]:
        """The contacts with those that were missed: what lies beside one makes it another, or nothing."""
        known, span = list(contacts), self.problem.span
        for other in others:
            # beyond a bound a free end comes to it alone, first
            at_end = [replace(other, start=x, end=x) for x in span if x in (other.start, other.end)]
            if (held := next(filter(self.ends_at, at_end), None)) is not None and held not in known:
                known.append(held)
                continue
            beside = [k for k, c in enumerate(known) if other.start == c.end or other.end == c.start]
            if not beside:
                crossing = not self.slopes[other.index] and other.index >= len(self.problem.constraints)
                ends = [(other.start,) * 2, (other.end,) * 2] if crossing else [(other.start, other.end)]
                known += [replace(other, start=a, end=b) for a, b in ends]
                continue
            for k in beside:  # a rest beside which the same is missed is longer
                if (self.steep(known[k]) and not self.steep(other)) or self.ends_at(known[k]):
                    one = known[k] if self.steep(known[k]) else other
                    known[k] = replace(other, start=one.start, end=one.end)
        yield from sorted(known, key=lambda c: c.start)

    def at_seam(self, curve: CurveOrSlope, contacts: Sequence[Contact], pieces: Sequence[Expression]) -> float | None:
        """The momentum with which a closed curve goes on from its end to its start, with L on its ways; else None.

        Where it moves at neither it is what the contact at the start leads on from.
        """
        (a, b), ways = self.problem.span, _ways(self.problem, contacts)
        if not self.problem.start.periodic:
            return None
        away = INWARDS * (b - a)
        if ways[0][0] == a:
            return self._momentum(pieces[0], curve, a + away)
        if ways[-1][1] == b:
            return self._momentum(pieces[-1], curve, b - away)
        first = contacts[0]
        left = self._momentum(pieces[0], curve, first.end + away)
        momentum = self._along(curve, first, (None, None if first.through[1] else left))
        return None if momentum is None else float(momentum.values[0])

    def holds(self, curve: CurveOrSlope, contact: Contact, beside: Beside, seam: float | None) -> bool:
        """Whether the momentum can go from that before a contact to that after it, with L on both sides of that.

        What goes through a jump gains there what it takes. At the ``seam`` of a closed curve it has that.
        """
        if contact.start == contact.end and not self.ends_at(contact):
            return True
        momenta = [
            self._natural(curve, end, seam) if piece is None else None if through else self._momentum(piece, curve, x)
            for end, piece, through, x in zip((0, 1), beside, contact.through, self._just_beside(contact), strict=True)
        ]
        if self.jumps(contact) and not self._lower_here(curve, contact):
            return False
        return self._along(curve, contact, momenta) is not None

    def _along(self, curve: CurveOrSlope, contact: Contact, momenta: Sequence[float | None]) -> HeldMomentum | None:
        """Momenta along a contact with those at its ends; None where there are none."""
        problem = self.problem
        inside = np.linspace(INWARDS, 1 - INWARDS, PLACES_OF_REST)  # at an end the curve has the slope beside it
        x = contact.start + (contact.end - contact.start) * inside
        pressed, jumps = np.zeros((2, 2)), self.jumps(contact)
        condition = self.condition(contact)
        if contact.index < len(problem.constraints) or jumps:
            felt = problem.symbols.dy if self.steep(contact) else problem.symbols.y
            rate = ca.Function("rate", problem.symbols.all, [ca.gradient(condition.expression, felt)])
            upwards = float(rate(*self.point(curve, 0.5 * (contact.start + contact.end)))) > 0
            below = contact.level < 0 if jumps else contact.level == condition.upper
            pressed[int(self.steep(contact)), int(upwards == below)] = math.inf
        with np.errstate(invalid="ignore"):  # what a bound holds has no middle
            return held_momentum(problem, curve, x, momenta, pressed, self._size(curve))

    def _just_beside(self, contact: Contact) -> Way:
        """Places just before a contact and just after it, where a curve has the slopes with which it moves."""
        away = INWARDS * (self.problem.span[1] - self.problem.span[0])
        return contact.start - away, contact.end + away

    def _size(self, curve: CurveOrSlope) -> float:
        """How large momenta are along a curve."""
        x = np.linspace(*self.problem.span, PLACES_FOR_BOUNDS)
        return float(np.abs(self.problem.integrand_derivatives(x, curve(x, 0), curve(x, 1)).gradient[:, 2]).max())

    def off_by(self, curve: CurveOrSlope, contact: Contact, beside: Beside, seam: float | None) -> float:
        """What the functional is more for a curve that runs beside a jump and not on it, with L on both sides of that.

        To first order in how far: what presses it there, and what it comes with and leaves with (Gelfand and Fomin,
        "Calculus of Variations", sect. 13).
        """
        if not self.jumps(contact) or contact.start == contact.end:
            return 0.0
        problem, s = self.problem, self.problem.symbols
        x, weights = composite_gauss(np.linspace(contact.start, contact.end, WAYS_SUMMED + 1), POINTS_OF_REST)
        surface = self.condition(contact).expression
        aside = 1 / ca.gradient(surface, s.y)
        turned = ca.gradient(aside, s.x) + ca.gradient(aside, s.y) * s.dy
        function = ca.Function("aside", s.all, [aside, turned])
        ends = np.array([contact.start, contact.end])
        (moved, turns), (at_ends, _) = (
            (np.ravel(np.asarray(v)) for v in function(*self.points(curve, places))) for places in (x, ends)
        )
        pull = problem.sign * problem.integrand_derivatives(x, curve(x, 0), curve(x, 1)).gradient[:, 1:]
        total = float((pull[:, 0] * moved + pull[:, 1] * turns) @ weights)
        for k, (piece, at) in enumerate(zip(beside, self._just_beside(contact), strict=True)):
            momentum = self._natural(curve, k, seam) if piece is None else self._momentum(piece, curve, at)
            total += (1 - 2 * k) * (momentum or 0.0) * float(at_ends[k])
        return problem.sign * contact.level * total

    def _lower_here(self, curve: CurveOrSlope, contact: Contact) -> bool:
        """Whether L is less along a jump on the side on which a curve runs than on the other."""
        x = contact.start + (contact.end - contact.start) * np.linspace(0, 1, PLACES_OF_WAY)[1:-1]
        y, v, problem = curve(x, 0), curve(x, 1), self.problem
        rate = ca.Function(
            "rate", problem.symbols.all, [ca.gradient(self.condition(contact).expression, problem.symbols.y)]
        )
        across = y - 2 * contact.level / np.asarray(rate(*self.points(curve, x)))
        here, there = (problem.sign * problem.integrand_values(x, ordinates, v) for ordinates in (y, across))
        return bool((there > here).all())

    def _momentum(self, piece: Expression, curve: CurveOrSlope, x: float) -> float:
        """The momentum of L that is ``piece`` at one place of a curve."""
        s = self.problem.symbols
        rate = ca.Function("momentum", s.all, [ca.gradient(piece, s.dy)])
        return self.problem.sign * float(rate(*self.point(curve, x)))

    def _natural(self, curve: CurveOrSlope, end: int, seam: float | None) -> float | None:
        """The momentum that an end of the interval asks for; None where the curve is given there."""
        return seam if self.problem.start.periodic else natural_momenta(self.problem, curve)[end]
