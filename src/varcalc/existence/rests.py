"""Curves that rest on a kink of the slope, set out, and rest again, as where friction holds: when each rest ends.

Along a rest the slope is known, and the functional hardly says where the rest ends: an end that is moved changes it by
the third power of the way. That the curve sets out smoothly says it, so that the ends are roots
(:mod:`varcalc.methods.ritz.steepest`). In between L is smooth, on the side on which the curve moves. The momentum
stays between those of both sides (Euler and Lagrange's inclusion; Clarke, "Optimization and Nonsmooth Analysis", 1983,
sect. 4.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.existence.directions import CurveOrSlope
from varcalc.existence.in_pieces import NEAR_ENDS
from varcalc.formulation import Contact, Form, Stated, formulate
from varcalc.formulation.form import SideCondition
from varcalc.methods.crossings import Crossing, arguments_along
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import on_curve
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.switches import Switch, held

PLACES_OF_WAY = 33
"""Places of a way on which a curve moves, or of a rest, that are looked at."""
STRAYING = 1e-6
"""Part of the largest argument on a way by which it may lie on the other side of the kink."""
POINTS_OF_REST = 8
"""Gauss points between two of those of a rest."""
ASIDE = 1e-7
"""Slope, in units of 1 and the curve's, at which the momenta on the sides of a kink are taken."""
MOMENTUM_ROOM = 1e-6
"""Part of the largest momentum by which one may lie beyond those of both sides: what they are known to."""
RESTED = 0
"""The number of the condition that a rest asks for: of a problem that asks for no others."""
ROUNDS_OF_RESTS = 4
"""Times that it is begun anew where rests have vanished."""
Way = tuple[float, float]
"""Between which abscissae a curve moves."""


def with_rests(
    problem: Problem, method: Ritz, tol: float, curve: CurveOrSlope, found: Sequence[Crossing]
) -> Solution | None:
    """The minimum that rests, nearly, where a ``curve`` follows one kink of the slope; None where none counts."""
    if not _treated(problem, found):
        return None
    form, kink, guess = formulate(problem), _Kink(problem, found[0].switch), curve
    contacts = kink.contacts(guess, found)
    for _ in range(ROUNDS_OF_RESTS):
        ways = _ways(problem, contacts)
        if not ways or any(a.end >= b.start for a, b in pairwise(contacts)):
            return None
        # a curve that strays across the kink does not say on which side it should be
        sides = [kink.strongest(guess, way) for way in ways]
        led = method.at_contacts(_moving(form, kink, guess, contacts, sides), contacts, curve, tol)
        if led is None or (following := led[0].curve) is None:
            return None
        (solution, kept), curve = led, following
        missed = kink.missed(curve, kept, [side for _, side in sides]) if len(kept) == len(contacts) else []
        if len(kept) == len(contacts) and not missed:
            held_back = kink.holds(curve, kept, [side for _, side in sides])
            own = resampled(curve, solution.x, 2)
            return replace(solution, method=method, curve=own, extremal=None) if held_back else None
        contacts = sorted([*kept, *missed], key=lambda c: c.start)
    return None


def _treated(problem: Problem, found: Sequence[Crossing]) -> bool:
    """Whether a graph of one function meets nothing but one kink of its slope, under no condition."""
    plain = problem.n == problem.order == 1 and not (problem.constraints or problem.unknowns)
    if not (plain and found) or formulate(problem).stated.is_lifted:
        return False
    switch = found[0].switch
    return all(c.switch is switch for c in found) and switch.depends_on(problem.symbols.dy)


def _ways(problem: Problem, contacts: Sequence[Contact]) -> list[Way]:
    """The ways before, between and after rests, those at the ends where there are any."""
    edges = [problem.span[0], *(e for c in contacts for e in (c.start, c.end)), problem.span[1]]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if a < b]


def _moving(
    form: Form, kink: _Kink, curve: CurveOrSlope, contacts: Sequence[Contact], sides: Sequence[tuple[float, float]]
) -> Form:
    """The form with L on each way as it is on its side, which changes half way along rests, and the kink to rest on."""
    problem = kink.problem
    s, (first, last) = problem.symbols, problem.span
    pieces = [held([problem.integrand], s.all, kink.point(curve, x))[0] for x, _ in sides]
    middles = [0.5 * (c.start + c.end) for c in contacts if c.start > first and c.end < last]
    integrand = pieces[0]
    for middle, piece in zip(middles, pieces[1:], strict=True):
        integrand = ca.if_else(s.x < middle, integrand, piece)
    integrand = problem.sign * integrand
    coordinates = replace(form.coordinates, stated=Stated(s, integrand, integrand), numbers=None)
    followed = SideCondition(kink.switch.argument, -math.inf, math.inf, RESTED)
    conditions = replace(form.conditions, pathwise=(followed,))
    return replace(form, coordinates=coordinates, conditions=conditions, cache=Cache(), elsewhere=None)


class _Kink:
    """A kink of the slope, on whose sides a curve moves and on which it rests."""

    def __init__(self, problem: Problem, switch: Switch) -> None:
        self.problem, self.switch = problem, switch
        s, argument = problem.symbols, switch.argument
        rate = ca.gradient(argument, s.dy)
        self._onto = ca.Function("onto", s.all, [ca.densify(s.dy - argument / rate), ca.densify(rate)])
        self._number = next(k for k, other in enumerate(on_curve(problem)) if other is switch)

    def arguments(self, curve: CurveOrSlope, x: np.ndarray) -> np.ndarray:
        """What switches at x (m,) of a curve."""
        return arguments_along(self.problem, curve, x, self.problem.unknown_guesses)[self._number]

    def contacts(self, curve: CurveOrSlope, found: Sequence[Crossing]) -> list[Contact]:
        """The rests where a curve follows the kink, or goes through it: then as long as the momentum takes to.

        What begins or ends beside an end of the interval does so there.
        """
        (a, b), (size, rests) = self.problem.span, (np.ptp(self.problem.span), list[Contact]())
        for c in found:
            half = 0.5 * self._time_across(curve, c.x) if c.until is None else 0.0
            start, end = c.x - half, c.x + half if c.until is None else c.until
            start = max(start, rests[-1].end + NEAR_ENDS * size if rests else a)
            start, end = a if start - a < NEAR_ENDS * size else start, b if b - end < NEAR_ENDS * size else end
            rests += [Contact(RESTED, c.level, float(start), float(end))] if start < end else []
        return rests

    def _time_across(self, curve: CurveOrSlope, x: float) -> float:
        """How long it takes the momentum to go from that of one side of the kink to that of the other."""
        momenta = [self._momentum(curve, x, side) for side in (-1.0, 1.0)]
        rate = abs(float(self._gradient(curve, np.array([x]), 0.0)[0, 0]))
        return abs(momenta[1] - momenta[0]) / rate if rate > 0 else 0.0

    def strongest(self, curve: CurveOrSlope, way: Way) -> tuple[float, float]:
        """The place of a way that is farthest from the kink, and the side on which it is."""
        x = np.linspace(*way, PLACES_OF_WAY)[1:-1]
        values = self.arguments(curve, x)
        k = int(np.argmax(np.abs(values)))
        return float(x[k]), float(np.sign(values[k]))

    def point(self, curve: CurveOrSlope, x: float) -> list[np.ndarray]:
        """The arguments of the problem's expressions at one place of a curve."""
        at, problem = np.array([x]), self.problem
        return [at, curve(at, 0)[:, 0], curve(at, 1)[:, 0], np.zeros(0), problem.parameter_values, np.zeros(0)]

    def missed(self, curve: CurveOrSlope, contacts: Sequence[Contact], sides: Sequence[float]) -> list[Contact]:
        """Rests where a curve is on the other side of the kink on its way."""
        found = []
        for (start, end), side in zip(_ways(self.problem, contacts), sides, strict=True):
            x = np.linspace(start, end, PLACES_OF_WAY)
            values = side * self.arguments(curve, x)
            strays = np.flatnonzero(values < -STRAYING * np.abs(values).max())
            for run in np.split(strays, 1 + np.flatnonzero(np.diff(strays) > 1)) if len(strays) else ():
                first, last = x[max(run[0] - 1, 0)], x[min(run[-1] + 1, len(x) - 1)]
                # beside a rest that rest is longer
                if not any(first == c.end or last == c.start for c in contacts):
                    found.append(Contact(RESTED, 0.0, float(first), float(last)))
        return found

    def holds(self, curve: CurveOrSlope, contacts: Sequence[Contact], sides: Sequence[float]) -> bool:
        """Whether a curve moves on its side of the kink on each way, and is held along each rest."""
        ways = _ways(self.problem, contacts)
        if len(ways) != len(sides):
            return False
        for way, side in zip(ways, sides, strict=True):
            values = side * self.arguments(curve, np.linspace(*way, PLACES_OF_WAY))
            if values.min() < -STRAYING * np.abs(values).max():
                return False
        return all(self._rests(curve, c, ways, sides) for c in contacts)

    def _rests(self, curve: CurveOrSlope, rest: Contact, ways: Sequence[Way], sides: Sequence[float]) -> bool:
        """Whether the momentum along a rest, from the way before it or after it, is between those of both sides."""
        x = np.linspace(rest.start, rest.end, PLACES_OF_WAY)
        least, greatest = (self._gradient(curve, x, up)[:, 1] for up in (-1.0, 1.0))
        nodes, weights = composite_gauss(x, POINTS_OF_REST)
        rates = self._gradient(curve, nodes, 0.0)[:, 0]
        gained = np.concatenate([[0.0], np.cumsum((rates * weights).reshape(len(x) - 1, -1).sum(1))])
        before = [side for way, side in zip(ways, sides, strict=True) if way[1] == rest.start]
        after = [side for way, side in zip(ways, sides, strict=True) if way[0] == rest.end]
        if before:
            momenta = self._momentum(curve, rest.start, before[0]) + gained
        else:
            momenta = self._momentum(curve, rest.end, after[0]) + gained - gained[-1]
        room = MOMENTUM_ROOM * max(float(np.abs(side).max()) for side in (least, greatest, momenta))
        return bool((momenta >= least - room).all() and (momenta <= greatest + room).all())

    def _momentum(self, curve: CurveOrSlope, x: float, side: float) -> float:
        """The momentum at one place on the kink, with L as it is on one side of that."""
        at = np.array([x])
        up = side * float(np.sign(self._on_kink(curve, at)[1][0, 0]))
        return float(self._gradient(curve, at, up)[0, 1])

    def _gradient(self, curve: CurveOrSlope, x: np.ndarray, up: float) -> np.ndarray:
        """The derivatives (m, 2) of what is minimised by the curve and its slope, a little more than on the kink."""
        slope = self._on_kink(curve, x)[0]
        aside = up * ASIDE * max(1.0, float(np.abs(slope).max()))
        found = self.problem.integrand_derivatives(x, curve(x, 0), slope + aside).gradient[:, 1:]
        return self.problem.sign * np.asarray(found)

    def _on_kink(self, curve: CurveOrSlope, x: np.ndarray) -> list[np.ndarray]:
        """The slopes (1, m) on the kink at x (m,) of a curve, and the rates (1, m) of its argument by the slope."""
        numbers, none = np.tile(self.problem.parameter_values[:, None], (1, len(x))), np.zeros((0, len(x)))
        return [np.asarray(v) for v in self._onto(x[None], curve(x, 0), curve(x, 1), none, numbers, none)]
