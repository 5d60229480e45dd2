"""Curves of first order whose slope is at a bound on stretches: where these end is found by Newton's method.

Along such a stretch the curve is a known line, and the functional hardly says where it is left: an end that is moved
changes it by the third power of the way. That the slope leaves its bound continuously says it (Gelfand and Fomin,
"Calculus of Variations", sect. 16). An end that is moved along the line is away from the extremal beside it by the
square of the way alone, so that the slope there changes as it does along that extremal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Contact, Form
from varcalc.methods.ritz.touching import touched_stretches
from varcalc.problem.conditions import Bound
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache

BESIDE_END = 1e-5
"""Distance from the end of a stretch, in units of the piece beside it, at which its rate is told."""
FOUND, NEARLY_FOUND = 1e-8, 1e-4
"""Shifts of the ends, in units of the interval, with which they are found, and from which on they nearly are.

The next shift goes by the square of the last, and the functional by the third power.
"""
LEAST_LENGTH = 1e-6
"""Length of a stretch, or of what lies between two, in units of the interval, that is none."""


def steep(form: Form) -> bool:
    """Whether a graph of one function of first order is under bounds of its slope alone."""
    problem, bounds = form.problem, form.conditions.pathwise
    plain = isinstance(problem, Problem) and form.n == form.order == 1 and not form.stated.is_lifted
    slopes = all(ca.depends_on(c.expression, form.symbols.dy) for c in bounds)
    numbers = range(len(problem.constraints))  # what else a form has asked for has none of these
    stated = all(c.index in numbers and isinstance(problem.constraints[c.index], Bound) for c in bounds)
    return bool(bounds) and plain and slopes and stated and not any(c.equality for c in bounds)


def steepest(form: Form, coarse: Solution) -> list[Contact]:
    """The stretches along which a coarse solution's slope is at a bound; none where they overlap."""
    contacts = sorted(touched_stretches(form, coarse), key=lambda c: c.start)
    return contacts if all(a.end < b.start for a, b in pairwise(contacts)) else []


def at_bounds(form: Form, contacts: Sequence[Contact], vertices: Iterable[float] = ()) -> Form:
    """The form with its bounds as equations on ``contacts``, and not at all elsewhere, on a mesh with ``vertices``."""
    bounds = {c.index: c for c in form.conditions.pathwise}
    pathwise = tuple(replace(bounds[c.index], lower=c.level, upper=c.level, where=(c.start, c.end)) for c in contacts)
    ends = {e for c in contacts for e in (c.start, c.end) if form.span[0] < e < form.span[1]}
    knots = tuple(sorted({*form.conditions.knots, *ends, *vertices}))
    return replace(form, conditions=replace(form.conditions, pathwise=pathwise, knots=knots), cache=Cache())


def moved(form: Form, contacts: Sequence[Contact], solution: Solution) -> list[Contact]:
    """The contacts with their ends nearer to where the curve beside them is at its bound, but those that vanish."""
    assert solution.curve is not None
    rates = {c.index: _along(form, c.expression) for c in form.conditions.pathwise}
    places = [form.span[0], *(e for c in contacts for e in (c.start, c.end)), form.span[1]]
    ends = []
    for k, contact in enumerate(contacts):
        before, after = contact.start - places[2 * k], places[2 * k + 3] - contact.end
        ends.append(
            tuple(
                end if room <= 0 else end - _newton(rates[contact.index], contact, end, way * room, solution.curve)
                for end, way, room in ((contact.start, -1, before), (contact.end, 1, after))
            )
        )
    least = LEAST_LENGTH * (form.span[1] - form.span[0])
    clipped = [(max(a, form.span[0]), min(b, form.span[1])) for a, b in ends]
    return [replace(c, start=a, end=b) for c, (a, b) in zip(contacts, clipped, strict=True) if b - a > least]


def kept_vertices(contacts: Sequence[Contact], following: Sequence[Contact], solution: Solution) -> list[float]:
    """The vertices of the mesh on which a solution with ``contacts`` was found that others have use for."""
    old, new = ({e for c in each for e in (c.start, c.end)} for each in (contacts, following))
    shifted = max((min(abs(a - b) for b in old) for a in new), default=0.0)
    return [v for v in solution.x[1:-1].tolist() if all(abs(v - e) > 2 * shifted for e in old | new)]


def shift(form: Form, before: Sequence[Contact], after: Sequence[Contact]) -> float:
    """How far the ends of contacts were moved, in units of the interval; infinite where one vanished or two met."""
    met = any(not a.end < b.start for a, b in pairwise(after))
    if len(before) != len(after) or met:
        return math.inf
    shifts = [max(abs(a.start - b.start), abs(a.end - b.end)) for a, b in zip(before, after, strict=True)]
    return max(shifts, default=0.0) / (form.span[1] - form.span[0])


def _newton(
    along: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray], contact: Contact, end: float, room: float,
    curve: Callable[[np.ndarray, int], np.ndarray],
) -> float:  # fmt: skip
    """Newton's step towards where a bound's function has its level, from one end into the ``room`` beside it."""
    x = end + BESIDE_END * room * np.array([1.0, 2.0])
    near, far = along(x, curve(x, 0), curve(x, 1)) - contact.level
    rate = (far - near) / (x[1] - x[0])
    step = (2 * near - far) / rate
    return float(np.clip(step, -abs(room) / 2, abs(room) / 2)) if np.isfinite(step) else 0.0


def _along(form: Form, expression: ca.SX) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """A bound's function at (x, y, slope), (m,) and (1, m) each."""
    function = ca.Function("bound", form.symbols.all, [ca.densify(expression)])
    numbers = form.problem.parameter_values, form.start.unknowns

    def along(x: np.ndarray, y: np.ndarray, slope: np.ndarray) -> np.ndarray:
        columns = [np.tile(n[:, None], (1, len(x))) for n in numbers]
        return np.asarray(function(x[None], y, slope, np.zeros((0, len(x))), *columns))[0]

    return along
