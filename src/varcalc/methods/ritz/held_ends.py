"""Free ends that a bound holds: given there, the end leaves a problem without that bound, or with less of it.

The end stays at the bound where letting it go on would lower the functional: where the momentum and the rate of what
the end costs press it outwards (the transversality condition as an inequality; Gelfand and Fomin, "Calculus of
Variations", sect. 14 and 16).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import casadi as ca
import numpy as np

from varcalc.formulation import Contact, Form, SideCondition
from varcalc.methods.ritz.steepest import ordinate_at
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.conditions import Bound
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache

BEYOND = 1e-6
"""Distance from a bound, in units of 1 and of what it bounds, at which an end may be at it."""


@dataclass(frozen=True)
class HeldEnds:
    """A ``form`` whose free ends of ``held`` are given where bounds hold them, by the end, 0 or 1, and the contact."""

    plain: Form
    held: dict[int, Contact]

    @property
    def form(self) -> Form:
        """The form with these ends given."""
        ends = [self.plain.ends.start.copy(), self.plain.ends.end.copy()]
        for end, contact in self.held.items():
            ends[end][0, 0] = ordinate_at(self.plain, self._bound(contact).expression, contact)
        return replace(self.plain, ends=replace(self.plain.ends, start=ends[0], end=ends[1]), cache=Cache())

    def counted(self, solution: Solution) -> Solution | None:
        """An answer with what its ends are held for; None where one of them would rather leave its bound."""
        rates = dict(solution.sensitivities)
        for end, contact in self.held.items():
            push, moved = self._push(solution, end, contact)
            if not push * (1.0 if contact.level == self._bound(contact).upper else -1.0) < 0:
                return None
            # an end that is held goes where the parameters move its bound
            for name, rate in zip(rates, moved, strict=True):
                rates[name] -= self.plain.sign * push * float(rate)
        return replace(solution, sensitivities=rates)

    def _bound(self, contact: Contact) -> SideCondition:
        return next(c for c in self.plain.conditions.pathwise if c.index == contact.index)

    def _push(self, solution: Solution, end: int, contact: Contact) -> tuple[float, np.ndarray]:
        """How fast what is minimised grows as an end goes with what its bound bounds; and that with the parameters."""
        form, bound, curve, extremal = self.plain, self._bound(contact).expression, solution.curve, solution.extremal
        assert curve is not None
        s, x = form.symbols, np.array([form.span[end]])
        levels = zip(form.conditions.integrals, extremal.lambdas, strict=True)
        whole = form.integrand + sum(float(factor) * level.expression for level, factor in levels)
        rates = [ca.gradient(whole, s.dy), ca.gradient(bound, s.y), ca.gradient(bound, s.parameters)]
        momentum, outwards, *moved = _at(form, rates, x, curve)
        rate = (momentum if end else -momentum) + _rate_of_cost(form, solution, end)
        return float(rate / outwards), np.array(moved)


def holds_free_ends(form: Form) -> bool:
    """Whether bounds of the place may hold free ends: of one function of first order, its abscissae given."""
    plain = isinstance(form.problem, Problem) and form.n == form.order == 1 and not form.stated.is_lifted
    if not plain or form.ends.equations or form.ends.periodic:
        return False
    free = np.isnan(form.ends.start[0, 0]) or np.isnan(form.ends.end[0, 0])
    return bool(free) and any(_may_hold(form, c) for c in form.conditions.pathwise)


def held_ends(form: Form, seen: Solution) -> list[HeldEnds]:
    """The ways in which bounds may hold free ends: those at or beyond which ``seen`` ends."""
    if not holds_free_ends(form) or seen.curve is None:
        return []
    reached = [[None, *_reached(form, seen, end)] for end in (0, 1)]
    ways = [{end: c for end, c in enumerate(way) if c is not None} for way in product(*reached)]
    return [HeldEnds(form, way) for way in reversed(ways) if way]


def _may_hold(form: Form, condition: SideCondition) -> bool:
    """Whether a condition is a bound of the place."""
    constraints, s = form.problem.constraints, form.symbols
    if condition.equality or not 0 <= condition.index < len(constraints):
        return False
    placed = ca.depends_on(condition.expression, s.y) and not ca.depends_on(condition.expression, s.dy)
    return bool(placed) and isinstance(constraints[condition.index], Bound)


def _reached(form: Form, seen: Solution, end: int) -> Iterator[Contact]:
    """The bounds of the place that a curve is at, or beyond, where it ends freely."""
    given, x, curve = (form.ends.start, form.ends.end)[end], form.span[end], seen.curve
    assert curve is not None
    if not np.isnan(given[0, 0]):
        return
    for c in form.conditions.pathwise:
        if not _may_hold(form, c):
            continue
        value = float(_at(form, [c.expression], np.array([x]), curve)[0])
        room = BEYOND * max(1.0, abs(value))
        for level, way in ((c.lower, -1.0), (c.upper, 1.0)):
            if np.isfinite(level) and way * (value - level) > -room:
                yield Contact(c.index, level, x, x)


def _at(form: Form, expressions: list[ca.SX], x: np.ndarray, curve: CurveOrSlope) -> np.ndarray:
    """Expressions of the form at one place x (1,) of a curve."""
    function = ca.Function("at", form.symbols.all, [ca.densify(ca.vertcat(*expressions))])
    unknowns = form.start.unknowns
    return np.asarray(function(x, curve(x, 0), curve(x, 1), [], form.problem.parameter_values, unknowns)).ravel()


def _rate_of_cost(form: Form, solution: Solution, end: int) -> float:
    """How fast what the ends cost grows with the ordinate of one of them."""
    joint, s, curve = form.ends.joint, form.symbols, solution.curve
    if joint is None:
        return 0.0
    assert curve is not None
    rate = ca.gradient(joint.cost, (joint.start, joint.end)[end])
    function = ca.Function("rate", [joint.start, joint.end, s.parameters, s.unknowns], [rate])
    unknowns = solution.unknown_values
    return float(function(*curve(np.array(form.span), 0).T, form.problem.parameter_values, unknowns))
