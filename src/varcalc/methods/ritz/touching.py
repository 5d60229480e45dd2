"""Curves that touch a bound: where contact begins and ends becomes unknown.

The curvature of such a curve jumps where it leaves the bound, and polynomials
across that place converge slowly. A coarse solve shows the stretches of
contact; with their ends among the unknowns, the bound kept as an equation
along them and left out elsewhere, every piece is smooth. The answer counts
only if the bound holds on the free pieces and presses the right way on the
others (Gelfand and Fomin, "Calculus of Variations", sect. 16, one-sided
variations).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Contact, Form, SideCondition, broken_form
from varcalc.methods.answer import Extremal, lifted, runs_forwards
from varcalc.numerics.mesh import CurveOrSlope, subdivided
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Bound
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator

CONTACT_SAMPLES = 2001
AN_ELEMENT = 64
"""Abscissae an element at which contacts are looked for, where that is closer."""
TOUCHING = 1e-4
"""Distance from a bound, in units of its range along the curve, at which a coarse curve touches it."""
ROUGH = 1e-2
"""The same at most, where the curve's own error is larger."""
LEAST_SAMPLES = 8
"""Samples that a stretch of contact must hold: less is a point."""
GAP = 40
"""Samples between two stretches of contact that are one."""
HELD = 1e-9
"""Relative amount by which a bound may be missed on a free piece."""
MOST_CONTACTS = 6
SHORT = 0.1
"""Share of the interval up to which what looks like a stretch is first taken for a point, where it may be one."""
SHORTER = 0.3
"""Share of what looks like a stretch that may be one: a curve with slopes in common leaves a level slowly."""


def touchable(form: Form) -> bool:
    """Whether contacts can be looked for: a plain graph of one function under bounds not on the highest derivative."""
    problem = form.problem
    plain = isinstance(problem, Problem) and problem.n == 1 and not form.stated.is_lifted
    levels = all(c.equality for c in form.conditions.integrals)
    # marks of what lies between the points are no breakpoints of the problem's
    if not (plain and levels) or breaks(problem) or form.conditions.waypoints or form.ends.equations:
        return False
    bounds = all(isinstance(problem.constraints[c.index], Bound) and not c.equality for c in form.conditions.pathwise)
    highest = form.symbols.highest
    return (
        bool(form.conditions.pathwise)
        and bounds
        and not any(ca.depends_on(c.expression, highest) for c in form.conditions.pathwise)
    )


@dataclass(frozen=True)
class Touching:
    """The form with the ends of contact among its unknowns, and whether an answer to it counts."""

    form: Form
    contacts: tuple[Contact, ...]
    plain: Form

    def counts(self, solution: Solution) -> bool:
        """Whether the bounds hold everywhere, and press the right way where they are touched."""
        extremal, moving = solution.extremal, self.form.stated.is_lifted
        if solution.curve is None or extremal is None or (moving and not runs_forwards(extremal)):
            return False
        # as closely as the bound is seen, in units of its contacts too
        ends = [np.array([c.start, c.end]) for c in self.contacts]
        ends = [lifted(extremal, s)[0] for s in ends] if moving else ends
        close = [np.linspace(a - (b - a), b + (b - a), CONTACT_SAMPLES) for a, b in ends]
        x = np.clip(np.concatenate([np.linspace(*self.plain.span, CONTACT_SAMPLES), *close]), *self.plain.span)
        curve = solution.curve
        for condition in self.plain.conditions.pathwise:
            values = _along(self.plain, condition, curve, x)
            room = HELD * max(float(np.abs(values).max()), 1e-300)
            if values.min() < condition.lower - room or values.max() > condition.upper + room:
                return False
        return all(map(partial(self.presses, solution), self.contacts, ends))

    def plainly(self, solution: Solution) -> Solution:
        """The answer with its extremal stated in the problem's own form, bounds and all."""
        curve, sign = solution.curve, self.plain.sign
        assert curve is not None
        pushes = {c.index: solution.multipliers[c.index] for c in self.plain.conditions.pathwise}
        extremal = Extremal(
            form=self.plain,
            evaluate=curve,
            unknowns=solution.unknown_values,
            vertices=solution.x,
            lambdas=np.array(
                [-sign * float(solution.multipliers[c.index]) for c in self.plain.conditions.integrals if c.equality]
            ),
            path={i: _signed(push, sign) for i, push in pushes.items() if push is not None},
        )
        return replace(solution, extremal=extremal)

    def presses(self, solution: Solution, contact: Contact, ends: np.ndarray) -> bool:
        """Whether lifting the bound along a contact between ``ends`` would lower the functional (raise a maximum)."""
        bound = next(c for c in self.plain.conditions.pathwise if c.index == contact.index)
        if contact.start == contact.end:
            points = [c for c in self.contacts if c.start == c.end]
            assert solution.extremal is not None
            push = solution.extremal.forces[2 * (points.index(contact) - len(points))]  # then that of being tangent
        else:
            inside = ends[0] + (ends[1] - ends[0]) * np.linspace(0.1, 0.9, 17)
            push = np.asarray(solution.multipliers[contact.index](inside)) * self.plain.sign
        # the multiplier in J + mu h is negative where a lower bound presses, positive where an upper one does
        return bool((-push if contact.level == bound.lower else push).mean() > 0)


def _signed(push: Callable[[np.ndarray], np.ndarray], sign: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda s: sign * push(s)


def touching(form: Form, coarse: Solution) -> list[Touching]:
    """The contacts that a coarse solution shows, as forms of their own in which they may be; none to speak of, none."""
    if coarse.curve is None or not isinstance(form.problem, Problem):
        return []
    curve = coarse.curve
    contacts = touched_stretches(form, coarse)
    contacts.sort(key=lambda c: c.start)
    apart = all(a.end < b.start for a, b in pairwise(contacts))
    if not (0 < len(contacts) <= MOST_CONTACTS and apart):
        return []
    ways = [contacts]
    if form.order > 1:
        short = SHORT * (form.span[1] - form.span[0])
        points = [_within(form, c, 0.0 if c.end - c.start <= short else 1.0) for c in contacts]
        ways = [points, contacts, *([_within(form, c, share) for c in contacts] for share in (SHORTER, 0.0))]
    ways = [way for k, way in enumerate(ways) if way not in ways[:k]]
    return [placed(form, way, curve) for way in ways if marks(form, way)]


def touched_stretches(form: Form, coarse: Solution) -> list[Contact]:
    """The stretches along which a coarse solution is at a bound, or nearly."""
    assert coarse.curve is not None
    curve = coarse.curve
    # a mesh that was marked is fine where the bound is narrow
    x = np.union1d(np.linspace(*form.span, CONTACT_SAMPLES), subdivided(coarse.x, AN_ELEMENT)[:-1])
    contacts: list[Contact] = []
    for condition in form.conditions.pathwise:
        values = _along(form, condition, curve, x)
        for level in {condition.lower, condition.upper}:
            if np.isfinite(level):
                size = max(float(np.ptp(values)), 1e-300)
                steep = form.order == 1 and ca.depends_on(condition.expression, form.symbols.highest)
                # a slope is known less well than an ordinate
                room = ROUGH if steep else max(TOUCHING, min(coarse.error.curve / size, ROUGH))
                near = np.abs(values - level) <= room * size
                contacts += [Contact(condition.index, level, *ends) for ends in _stretches(x, near)]
    return contacts


def _within(form: Form, contact: Contact, share: float) -> Contact:
    """The middle ``share`` of a contact; nothing but a bound on the ordinate presses with a force in one point."""
    condition = next(c for c in form.conditions.pathwise if c.index == contact.index)
    outer = contact.start <= form.span[0] or contact.end >= form.span[1]
    if share == 1.0 or outer or (not share and ca.depends_on(condition.expression, form.symbols.dy)):
        return contact
    middle, half = 0.5 * (contact.start + contact.end), 0.5 * share * (contact.end - contact.start)
    return replace(contact, start=middle - half, end=middle + half)


def placed(form: Form, contacts: list[Contact], curve: CurveOrSlope, *, keeping: bool = False) -> Touching:
    """The form with these contacts, begun from a curve; ``keeping`` some of every piece."""
    assert isinstance(form.problem, Problem)
    broken = broken_form(form.problem, marks(form, contacts), lambda x: curve(x, 0), contacts, keeping=keeping)
    return Touching(broken, tuple(contacts), form)


def marks(form: Form, contacts: Iterable[Contact]) -> list[float]:
    """The ends of contact inside the interval."""
    return sorted({m for c in contacts for m in (c.start, c.end) if form.span[0] < m < form.span[1]})


def _stretches(x: np.ndarray, near: np.ndarray) -> list[tuple[float, float]]:
    """Intervals of x on which ``near`` holds, but for points; a coarse curve waves across the bound a little."""
    joined = near.copy()
    for (_, i), (j, _) in pairwise(runs(near)):
        joined[i:j] |= j - i - 1 <= GAP
    return [(float(x[i]), float(x[j])) for i, j in runs(joined) if j - i + 1 >= LEAST_SAMPLES]


def _along(form: Form, condition: SideCondition, curve: CurveOrSlope, x: np.ndarray) -> np.ndarray:
    """A bound's function along a curve at x (m,)."""
    numbers = (form.problem.parameter_values[None], form.start.unknowns[None])
    slopes = (curve(x, 1).T, np.zeros((1, form.order - 1)))  # no bound here depends on the curvature
    return _bound(form, condition.index)(len(x), x[:, None], curve(x, 0).T, *slopes, *numbers)[:, 0]


@derived
def _bound(form: Form, index: int) -> PointEvaluator:
    """The function of the pathwise condition that constraint ``index`` is."""
    condition = next(c for c in form.conditions.pathwise if c.index == index)
    return PointEvaluator(ca.Function("bound", form.symbols.all, [ca.densify(condition.expression)]))
