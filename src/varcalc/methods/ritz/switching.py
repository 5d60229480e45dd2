"""Curves under bounds of their slope where L is of first degree in it: the slope switches from bound to bound.

Along such stretches the curve is a line that is known but for where it lies; where L says what the ordinate has to be
it follows that between them (bang-bang and singular arcs; Bryson and Ho, "Applied Optimal Control", ch. 8). The slope
jumps at the ends of stretches, so that no polynomial holds the curve across one. What is minimised changes with an end
by the square of how far it is moved, so that they are among the unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Contact, Form
from varcalc.methods.ritz.touching import HELD, Touching, marks, placed, touched_stretches
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.problem.end_cost import natural_momenta
from varcalc.problem.functional import arguments_along
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache

CLOSED = (0.02, 0.05, 0.1)
"""Gaps between stretches, in units of the interval, that are taken for a corner in turn: a coarse curve rounds it."""
MOST_STRETCHES = 24
"""Stretches of one curve: more are made of waves of a coarse one."""
SLOPES_TOLD = 513
"""Places along a stretch at which it is told whether the bound grows with the slope."""
PANELS_OF_STRETCH, POINTS_OF_PANEL = 64, 8
"""Panels of a stretch and Gauss points on each by which it is told what presses."""
SWITCHES = 1e-6
"""How much of the most that presses may press the other way: so much is round-off."""

Part = tuple[Contact, int]
"""A stretch, and 1 where its bound grows with the slope, -1 where it falls."""


def of_first_degree(form: Form) -> bool:
    """Whether L and what is levelled are of first degree in the slope, or do without it."""
    s = form.symbols
    expressions = [form.integrand, *(c.expression for c in form.conditions.integrals)]
    return not any(ca.depends_on(ca.gradient(expression, s.dy), s.dy) for expression in expressions)


@dataclass(frozen=True)
class Switching(Touching):
    """The same for stretches at bounds of the slope, all along which these have to press.

    With the bound g at its level and M its multiplier times g_v, M' = L_y - (L_v)' + M g_y / g_v. M is zero where the
    slope switches, and what a free end asks of the momentum there. The other way it would have to switch again.
    """

    def presses(self, solution: Solution, contact: Contact, ends: np.ndarray) -> bool:
        """Whether lifting the bound anywhere on a contact between ``ends`` would lower the functional."""
        bound = next(c for c in self.plain.conditions.pathwise if c.index == contact.index)
        x, weights = composite_gauss(np.linspace(ends[0], ends[1], PANELS_OF_STRETCH + 1), POINTS_OF_PANEL)
        unmet, _, by_place, by_slope = self._along(solution, x, bound.expression)
        factor = np.exp(-np.cumsum(weights * by_place / by_slope))
        summed = np.cumsum(weights * unmet * factor)
        side, known = self._known_at(solution, ends)
        summed += known if side == 0 else known * factor[-1] - summed[-1]
        pressed = summed / factor / by_slope * (-1.0 if contact.level == bound.lower else 1.0)
        return bool(pressed.min() > -SWITCHES * np.abs(pressed).max())

    def _known_at(self, solution: Solution, ends: np.ndarray) -> tuple[int, float]:
        """At which of its ends M is known, the start (0) or the end (1) of a stretch, and what it is there."""
        inside = ends[0] > self.plain.span[0], ends[1] < self.plain.span[1]
        if any(inside):
            return inside.index(True), 0.0
        curve, problem = solution.curve, self.plain.problem
        assert curve is not None
        assert isinstance(problem, Problem)
        asked = natural_momenta(problem, curve)
        side = 0 if asked[0] is not None else 1
        momentum = self._along(solution, ends, self.plain.conditions.pathwise[0].expression)[1]
        return side, float(asked[side] or 0.0) - float(momentum[side])

    def _along(self, solution: Solution, x: np.ndarray, expression: ca.SX) -> np.ndarray:
        """What the Euler-Lagrange equation misses along the curve at x (m,), L_v, and the rates of a bound: (4, m)."""
        form, s, curve = self.plain, self.plain.symbols, solution.curve
        assert curve is not None
        levels = [c for c in form.conditions.integrals if c.equality]
        whole = form.integrand - form.sign * sum(
            float(solution.multipliers[c.index] or 0.0) * c.expression for c in levels
        )
        momentum = ca.gradient(whole, s.dy)
        pace = ca.gradient(momentum, s.x) + ca.gradient(momentum, s.y) * s.dy
        rates = [ca.gradient(expression, s.y), ca.gradient(expression, s.dy)]
        along = ca.Function("along", s.all, [ca.densify(ca.vertcat(ca.gradient(whole, s.y) - pace, momentum, *rates))])
        return np.asarray(along(*arguments_along(form.problem, curve, x, solution.unknown_values)))


@dataclass(frozen=True)
class Forced(Touching):
    """The same for one stretch from one given end to the other: no other curve is admitted, whatever presses."""

    def presses(self, solution: Solution, contact: Contact, ends: np.ndarray) -> bool:  # noqa: ARG002
        """Whether the curve comes to its end, which its stretch leads to by itself."""
        curve, (_, last) = solution.curve, self.plain.span
        assert curve is not None
        size = max(float(np.abs(curve(solution.x, 0)).max()), last - self.plain.span[0])
        return bool(abs(curve(np.array([last]), 0)[0, 0] - self.plain.ends.end[0, 0]) <= HELD * size)


def switching(form: Form, coarse: Solution) -> Iterator[Touching]:
    """The stretches along which a coarse solution's slope is at a bound, their ends unknown, in a few arrangements."""
    curve, known = coarse.curve, list[list[bool]]()
    if curve is None or form.conditions.waypoints or form.conditions.knots:
        return
    touched = [part for c in touched_stretches(form, coarse) for part in _of_one_slope(form, c, curve)]
    touched.sort(key=lambda part: part[0].start)
    for share in CLOSED:
        parts = _joined(form, touched, share * (form.span[1] - form.span[0]))
        contacts = [c for c, _ in parts]
        sequence = [a.end == b.start for a, b in pairwise(contacts)]  # what lies between is left free, or is a corner
        if len(contacts) <= MOST_STRETCHES and contacts and sequence not in known:
            known.append(sequence)
            found = placed(form, contacts, curve, keeping=True)
            yield Switching(**vars(found)) if marks(form, contacts) else _led_by_itself(found)


def _led_by_itself(found: Touching) -> Touching:
    """One stretch all along, its end free where both ends are given: they would say once more what it says."""
    ends = found.form.ends
    if np.isnan([ends.start[0, 0], ends.end[0, 0]]).any():
        return Switching(**vars(found))
    free = ends.end.copy()
    free[0, 0] = np.nan
    return Forced(replace(found.form, ends=replace(ends, end=free), cache=Cache()), found.contacts, found.plain)


def _rising(form: Form, contact: Contact, curve: CurveOrSlope, x: np.ndarray) -> np.ndarray:
    """The sign with which a bound grows with the slope along a curve, at x (m,)."""
    bound = next(c for c in form.conditions.pathwise if c.index == contact.index)
    rate = ca.Function("rate", form.symbols.all, [ca.densify(ca.gradient(bound.expression, form.symbols.dy))])
    return np.sign(np.asarray(rate(*arguments_along(form.problem, curve, x))).ravel())


def _of_one_slope(form: Form, contact: Contact, curve: CurveOrSlope) -> list[Part]:
    """The parts of a contact in which its bound grows, or falls, with the slope: v^2 has one level at two slopes."""
    x = np.linspace(contact.start, contact.end, SLOPES_TOLD)
    signs = _rising(form, contact, curve, x)
    cut = 1 + np.flatnonzero(np.diff(signs))
    edges = [contact.start, *(0.5 * (x[cut] + x[cut - 1])).tolist(), contact.end]
    told = (int(signs[k]) for k in (0, *cut))
    return [(replace(contact, start=a, end=b), s) for (a, b), s in zip(pairwise(edges), told, strict=True) if s]


def _joined(form: Form, touched: list[Part], closed: float) -> list[Part]:
    """Stretches without gaps of less than ``closed`` between them, and to the ends of the interval."""
    first, last = form.span
    parts: list[Part] = []
    for contact, side in touched:
        if not parts:
            parts.append((replace(contact, start=first) if contact.start - first < closed else contact, side))
            continue
        previous, before = parts[-1]
        if contact.end <= previous.end:
            continue
        if contact.start - previous.end >= closed:
            parts.append((contact, side))
        elif (contact.index, contact.level, side) == (previous.index, previous.level, before):
            parts[-1] = replace(previous, end=contact.end), side
        else:
            corner = 0.5 * (contact.start + previous.end)
            parts[-1:] = [(replace(previous, end=corner), before), (replace(contact, start=corner), side)]
    if parts and last - parts[-1][0].end < closed:
        parts[-1] = replace(parts[-1][0], end=last), parts[-1][1]
    return parts
